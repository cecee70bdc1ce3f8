"""Compare the figures of two runs of a benchmark: a change of the code that must not change a number.

Run: ``python benchmarks/compare.py BEFORE.json AFTER.json [--relative 1e-9]`` on files that ``accuracy.py``,
``published.py``, ``encoders.py`` or ``speed.py`` wrote with ``--json``. Prints the rows that differ and those
that only one of the files has. What depends on the machine is left out: times, memory, library versions.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

MACHINE_UNITS = ("s", "ms", "ms a frame", "times", "MB")
"""Units of figures that differ from run to run: times, ratios of times and memory."""
MACHINE_NAMES = ("time to ",)
"""How names of figures begin that do so without such a unit: ratios of the times of two methods."""

Row = tuple[str, str]
"""A figure's case and name."""


def main(words: Sequence[str] | None = None) -> int:
    """Print the rows that differ.

    Args:
        words: Command line; None takes the program's own.

    Returns:
        The exit code: 1 when a row differs, 2 when a file cannot be read.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("before", type=Path, metavar="BEFORE.json")
    parser.add_argument("after", type=Path, metavar="AFTER.json")
    parser.add_argument(
        "--relative", type=float, default=1e-9, metavar="SHARE", help="largest allowed change (1e-9)"
    )
    options = parser.parse_args(words)
    try:
        before, after = figures(options.before), figures(options.after)
    except (OSError, ValueError, KeyError, TypeError) as error:
        print(f"compare.py: expected two files written with --json, got {error!r}.", file=sys.stderr)
        return 2
    found = list(differences(before, after, options.relative))
    for line in found:
        print(line)
    common = len(before.keys() & after.keys())
    print(f"{common} figures compared, {len(found)} differ by more than {options.relative:g} of their value.")
    return 1 if found else 0


def figures(path: Path) -> dict[Row, dict]:
    """Read the rows of one file, those of the machine left out.

    Args:
        path: The JSON file.

    Returns:
        The rows by case and name.

    Raises:
        ValueError: Two rows have the same case and name.
    """
    rows = json.loads(path.read_text(encoding="utf-8"))["figures"]
    kept = [
        row for row in rows if row["unit"] not in MACHINE_UNITS and not row["name"].startswith(MACHINE_NAMES)
    ]
    found = {(row["case"], row["name"]): row for row in kept}
    if len(found) < len(kept):
        raise ValueError(f"{path}: two rows of one name")
    return found


def differences(before: dict[Row, dict], after: dict[Row, dict], relative: float) -> Iterator[str]:
    """Yield a line for each row that differs in value, bound, target or verdict, or is in one file alone.

    Args:
        before: Rows of the older run, by case and name.
        after: Rows of the newer run.
        relative: Largest allowed difference of two numbers over the larger of them.
    """
    for row in before.keys() - after.keys():
        yield f"{row[0]}, {row[1]}: only before"
    for row in after.keys() - before.keys():
        yield f"{row[0]}, {row[1]}: only after"
    for row in before:
        for key in ("value", "bound", "target", "verdict", "unit") if row in after else ():
            old, new = before[row].get(key), after[row].get(key)
            if not same(old, new, relative):
                yield f"{row[0]}, {row[1]}: {key} {old} before, {new} after{_change(old, new)}"


def same(old: object, new: object, relative: float) -> bool:
    """Return whether two entries are equal, numbers up to a share of the larger one.

    Args:
        old: A number, a text or None.
        new: The same of the other file.
        relative: Largest allowed share.
    """
    if isinstance(old, int | float) and isinstance(new, int | float):
        return math.isclose(old, new, rel_tol=relative, abs_tol=0.0)
    return old == new


def _change(old: object, new: object) -> str:
    """Return the relative change of a number in words, or nothing."""
    if isinstance(old, int | float) and isinstance(new, int | float):
        return f", {abs(new - old) / max(abs(old), abs(new)):.1e} of it"
    return ""


if __name__ == "__main__":
    raise SystemExit(main())
