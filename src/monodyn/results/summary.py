"""What was found, in a sentence, and what the names and symbols of a result mean."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from monodyn.estimation.wording import listed
from monodyn.numbers import plus_minus

if TYPE_CHECKING:
    from monodyn.estimation.fit import Estimate, Fit
    from monodyn.estimation.parts import Combination
    from monodyn.mechanism import Mechanism

UNITS = ((1.0, "m"), (0.01, "cm"), (1e-3, "mm"))
"""Units of length [m], each for what is at least one of it; the last one for what is shorter, too."""


@cache
def meanings() -> Mapping[str, Any]:
    """Return what names and symbols mean: ``parameters`` by kind, ``symbols`` of combinations, ``open``."""
    return json.loads((Path(__file__).parent / "meanings.json").read_text(encoding="utf-8"))


def summary(fit: Fit) -> str:
    """Return sizes and friction as they are known, a sentence; nothing of a refused fit.

    Args:
        fit: The fit.
    """
    if not fit.ok:
        return ""
    known = _known(fit)
    said = _lengths(fit.mechanism, known)
    for what, rows in frictions(fit).items():
        values = [f"{_value(row)} at {joint}" for joint, row in rows]
        said += f"; {what} {listed(values, 12)}"
    period = known.get("torque.period")
    said += f"; a torque repeats every {_value(period)}" if period is not None else ""
    return f"{said[0].upper()}{said[1:]} (95 %)."


def frictions(fit: Fit) -> dict[str, list[tuple[str, Estimate | Combination]]]:
    """Return friction as it is known: over the inertia that it brakes where that is fixed, else by itself.

    Args:
        fit: The fit.

    Returns:
        By what it is, in words: (joint, value) pairs.
    """
    known = _known(fit)
    rows: dict[str, list[tuple[str, Estimate | Combination]]] = {}
    for kind, word in meanings()["friction"].items():
        for joint in fit.mechanism.joints:
            name, symbol = f"{joint.name}.{kind}", "J" if joint.kind == "hinge" else "M"
            over = known.get(f"{name} / {joint.body}.{symbol}")
            row = over or known.get(name)
            if row is not None and row.value != 0.0:
                against = {"J": " over inertia", "M": " over mass"}[symbol] if over else ""
                rows.setdefault(f"{word}{against}", []).append((joint.name, row))
    return rows


def _known(fit: Fit) -> dict[str, Estimate | Combination]:
    """Return what is given or has an interval, by name."""
    rows = [row for row in fit.parameters if row.identifiable and not row.at_bound]
    return {row.name: row for row in (*rows, *fit.combinations) if math.isfinite(row.upper - row.lower)}


def _lengths(mechanism: Mechanism, known: Mapping[str, Estimate | Combination]) -> str:
    """Count the slides and links, and write how long each link is."""
    links = [joint.body for joint in mechanism.joints if joint.kind == "hinge"]
    slides = len(mechanism.joints) - len(links)
    lengths = [_length(known[name]) if (name := f"{body}.length") in known else "" for body in links]
    counts = [_counted(slides, "slide")] * (slides > 0) + [_counted(len(links), "link")] * bool(links)
    if not any(lengths):
        return " and ".join(counts) + (" of unknown length" if links else "")
    return f"{' and '.join(counts)}, {listed([length or 'one of unknown length' for length in lengths], 12)}"


def _counted(count: int, noun: str) -> str:
    words = meanings()["counts"]
    return f"{words[count] if count < len(words) else count} {noun}{'s' if count != 1 else ''}"


def _length(row: Estimate | Combination) -> str:
    size, unit = next((one for one in UNITS if row.value >= one[0]), UNITS[-1])
    return f"{plus_minus(row.value / size, 0.5 * (row.upper - row.lower) / size)} {unit}"


def _value(row: Estimate | Combination) -> str:
    return f"{plus_minus(row.value, 0.5 * (row.upper - row.lower))} {row.unit}".rstrip()
