"""Measured figures next to their targets: one row each, as a table, as JSON, as an exit code."""

from __future__ import annotations

import argparse
import json
import math
import platform
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

PACKAGES = ("monodyn", "numpy", "scipy", "numba", "mujoco-core", "av", "opencv-python-headless")
"""Libraries whose versions are written down with the figures."""
SIDE_BY_SIDE = ("times", "MB")
"""Units of what hardly depends on the machine: ratios of times, and memory."""
SLACK = 1.25
"""By which factor such a figure may be worse than in the baseline: two runs differ by up to a sixth."""
BOUND_COLUMN = 4
NUMBER_COLUMNS = (2, 3, BOUND_COLUMN)
"""Columns of the table that are numbers: measured, target, bound."""


@dataclass(frozen=True)
class Figure:
    """One measured number.

    Attributes:
        case: What was run.
        name: What was measured.
        value: The measurement; NaN where there is none.
        unit: Its unit.
        target: What it must not exceed (or fall below, see ``least``); None where there is no target.
        bound: What the noise alone would leave on average, or None.
        least: True when ``target`` is the smallest allowed value rather than the largest.
    """

    case: str
    name: str
    value: float
    unit: str
    target: float | None = None
    bound: float | None = None
    least: bool = False

    @property
    def verdict(self) -> str:
        """``PASS``, ``MISS``, or nothing where there is no target; a missing value is a miss."""
        if self.target is None:
            return ""
        # NaN compares false with everything, so that it misses either way
        good = self.value >= self.target if self.least else self.value <= self.target
        return "PASS" if good else "MISS"


def table(figures: Sequence[Figure], *, bound: str | None = None) -> str:
    """Return the figures as lines of text, a blank line between two cases.

    Args:
        figures: The rows.
        bound: Heading of the column of bounds; None leaves the column out.
    """
    rows = [("case", "figure", "measured", "target", bound or "", "unit", "")]
    for figure in figures:
        sign = ">=" if figure.least else "<="
        target = "" if figure.target is None else f"{sign} {figure.target:g}"
        limit = "" if figure.bound is None else _number(figure.bound)
        rows.append(
            (figure.case, figure.name, _number(figure.value), target, limit, figure.unit, figure.verdict)
        )
    columns = [i for i in range(len(rows[0])) if i != BOUND_COLUMN or bound]
    wide = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines, last = [], ""
    for row in rows:
        shown = ["" if i == 0 and row[0] == last else row[i] for i in columns]
        if row[0] != last:
            lines.append("")
        last = row[0]
        cells = [
            text.rjust(wide[i]) if i in NUMBER_COLUMNS else text.ljust(wide[i])
            for i, text in zip(columns, shown, strict=True)
        ]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines[1:])


def command_line(text: str | None, names: Sequence[str]) -> argparse.ArgumentParser:
    """Return a parser of the options that benchmarks share: ``--only``, ``--json`` and ``--gate``.

    Args:
        text: Documentation of the script; its first line is the help.
        names: What can be measured.
    """
    parser = argparse.ArgumentParser(description=(text or "").splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=names, metavar="NAME", help=f"of {', '.join(names)}")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there, too")
    parser.add_argument("--gate", action="store_true", help="exit code 1 when a target is missed")
    return parser


def finish(figures: Sequence[Figure], *, to: Path | None, gate: bool, baseline: Path | None = None) -> int:
    """Print how many targets were missed and write the figures as JSON where asked.

    Args:
        figures: The figures.
        to: File for the JSON, or None.
        gate: True when a missed target is an error, and what is worse than the baseline.
        baseline: File of such JSON with which they are compared, or None.

    Returns:
        The exit code.
    """
    missed = [figure for figure in figures if figure.verdict == "MISS"]
    asked = sum(1 for figure in figures if figure.verdict)
    print(f"\n{asked - len(missed)} of {asked} targets reached.")
    for figure in missed:
        print(f"missed: {figure.case}, {figure.name}: {_number(figure.value)} {figure.unit}")
    lost = [] if baseline is None else list(worse(figures, baseline))
    for line in lost:
        print(f"worse than the baseline: {line}")
    if to is not None:
        save(figures, to)
    return 1 if gate and (missed or lost) else 0


def worse(figures: Sequence[Figure], baseline: Path) -> Iterator[str]:
    """Compare figures with those of an earlier run, perhaps of another machine.

    Only what has a target counts, and of it what was measured side by side in one run, and memory.

    Args:
        figures: The figures.
        baseline: The JSON of the earlier run.

    Returns:
        A line for each figure that is worse by more than ``SLACK``; those that only one run has are left out.
    """
    rows = json.loads(baseline.read_text(encoding="utf-8"))["figures"]
    before = {(row["case"], row["name"]): row["value"] for row in rows}
    for figure in figures:
        known = before.get((figure.case, figure.name))
        if known is None or figure.target is None or figure.unit not in SIDE_BY_SIDE:
            continue
        grown = known / figure.value if figure.least else figure.value / known
        # NaN is worse than anything
        if not grown <= SLACK:
            now, then = _number(figure.value), _number(known)
            yield f"{figure.case}, {figure.name}: {now} {figure.unit}, {then} before"


def save(figures: Sequence[Figure], path: Path) -> None:
    """Write the figures as JSON, with the versions of the libraries.

    Args:
        figures: The figures.
        path: The file.
    """
    rows = [
        {key: _finite(value) for key, value in {**asdict(figure), "verdict": figure.verdict}.items()}
        for figure in figures
    ]
    document = {
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        "versions": {name: version(name) for name in PACKAGES},
        "figures": rows,
    }
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def figures_of(script: str, *words: str) -> list[Figure]:
    """Return what another benchmark measures; its progress goes to the standard error.

    Args:
        script: Its file beside this one.
        words: Its arguments.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "figures.json"
        command = [sys.executable, str(Path(__file__).with_name(script)), *words, "--json", str(path)]
        subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
        rows = json.loads(path.read_text(encoding="utf-8"))["figures"]
    names = [field.name for field in fields(Figure)]
    found = [Figure(**{name: row[name] for name in names}) for row in rows]
    return [replace(figure, value=math.nan) if figure.value is None else figure for figure in found]


def say(text: str) -> None:
    """Print a line of progress on the standard error.

    Args:
        text: The line.
    """
    print(text, file=sys.stderr, flush=True)


def _number(value: float) -> str:
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def _finite(value: object) -> object:
    """Return a value as JSON can hold it: None for NaN and infinity, numpy's numbers as Python's."""
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not math.isfinite(value) else value
