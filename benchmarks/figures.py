"""Measured figures beside their targets: one row each, as a table, as JSON, as an exit code."""

from __future__ import annotations

import json
import math
import platform
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

PACKAGES = ("monodyn", "numpy", "scipy", "numba", "mujoco", "av", "opencv-python-headless")


@dataclass(frozen=True)
class Figure:
    """One measured number.

    Attributes:
        case: What was run.
        name: What was measured.
        value: The measurement; NaN where there is none.
        unit: Its unit.
        target: What it must not exceed (or fall below, see ``least``); None where nothing is asked.
        bound: What the noise alone would leave on average, or None.
        least: True when ``target`` is the least value, not the most.
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
        """``PASS``, ``MISS``, or nothing where nothing is asked; a missing value is a miss."""
        if self.target is None:
            return ""
        good = self.value >= self.target if self.least else self.value <= self.target
        return "PASS" if good else "MISS"


def table(figures: Sequence[Figure], *, bound: str | None = None) -> str:
    """Return the figures as lines of text.

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
    columns = [i for i in range(7) if i != 4 or bound]
    wide = [max(len(row[i]) for row in rows) for i in range(7)]
    lines, last = [], ""
    for row in rows:
        shown = ["" if i == 0 and row[0] == last else row[i] for i in columns]
        if row[0] != last:
            lines.append("")
        last = row[0]
        cells = [
            text.rjust(wide[i]) if i in (2, 3, 4) else text.ljust(wide[i])
            for i, text in zip(columns, shown, strict=True)
        ]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines[1:])


def finish(figures: Sequence[Figure], *, to: Path | None, gate: bool) -> int:
    """Write the figures as JSON where asked, say how many were missed, and return the exit code.

    Args:
        figures: The figures.
        to: File for the JSON, or None.
        gate: True when a missed target is an error.
    """
    missed = [figure for figure in figures if figure.verdict == "MISS"]
    asked = sum(1 for figure in figures if figure.verdict)
    print(f"\n{asked - len(missed)} of {asked} targets reached.")
    for figure in missed:
        print(f"missed: {figure.case}, {figure.name}: {_number(figure.value)} {figure.unit}")
    if to is not None:
        rows = [
            {key: _plain(value) for key, value in {**asdict(figure), "verdict": figure.verdict}.items()}
            for figure in figures
        ]
        document = {
            "python": platform.python_version(),
            "machine": f"{platform.system()} {platform.machine()}",
            "versions": {name: version(name) for name in PACKAGES},
            "figures": rows,
        }
        to.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return 1 if gate and missed else 0


def say(text: str) -> None:
    """Tell on the standard error what is going on."""
    print(text, file=sys.stderr, flush=True)


def _number(value: float) -> str:
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def _plain(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value
