"""Whether a table is in the units that it should be in: radians and seconds.

What gravity moves turns back on itself: between two reversals a hinge makes a turn or two, and how fast it
does tells a length, the one over which gravity would move it so. Degrees and milliseconds lie far beyond.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.estimation.record.smooth import smooth
from monodyn.mechanism import Mechanism
from monodyn.types import Poses

MOST_TURNS = 2.0
"""Turns from one reversal to the next, the median, beyond which angles are in degrees."""
FEWEST_SWINGS = 3
"""Swings that a hinge must make to tell."""
SHORTEST, LONGEST = 1e-5, 100.0
"""Lengths of a mechanism below and beyond which the time is not in seconds [m]."""
USUAL = (0.02, 2.0)
"""Lengths of mechanisms that people film or measure [m]."""


def wrong_units(records: Sequence[Poses], mechanism: Mechanism) -> str | None:
    """Find out whether records are in other units than radians and seconds.

    Args:
        records: The records.
        mechanism: Their mechanism; where its gravity or time scale is open any unit of time will do.

    Returns:
        What is wrong and what to do, in sentences; None where nothing is.
    """
    hinges = [j for j, joint in enumerate(mechanism.joints) if joint.kind == "hinge"]
    swings = [_swings(record, j) for record in records for j in hinges]
    turns = max((float(np.median(s)) / (2.0 * np.pi) for s in swings if len(s) >= FEWEST_SWINGS), default=0.0)
    if turns > MOST_TURNS:
        return (
            f"expected angles in radians, got swings of {turns:.3g} turns from one reversal to the next: "
            "these look like degrees; multiply them by pi / 180."
        )
    free = {p.name for p in mechanism.parameters if p.free}
    gravity = mechanism.values["gravity"]
    if gravity <= 0.0 or free & {"gravity", "time_scale"} or not hinges:
        return None
    lengths = [_length(record, hinges, gravity) for record in records]
    length = float(np.median(lengths))
    if 0.0 < length < SHORTEST:
        return (
            f"expected times in seconds, got a motion so quick that gravity would move lengths of "
            f"{length:.2g} m like that: these look like another unit; give seconds, or free the clock with "
            "--free time_scale."
        )
    if not length > LONGEST:
        return None
    unit = np.sqrt(np.array(USUAL) / length)
    said = "milliseconds" if unit[0] <= 1e-3 <= unit[1] else "frame numbers or another unit"
    return (
        f"expected times in seconds, got a motion so slow that gravity would move lengths of {length:.2g} m "
        f"like that: these look like {said}; give seconds, or free the clock with --free time_scale."
    )


def _swings(record: Poses, dof: int) -> np.ndarray:
    """Return how far a joint goes from one reversal to the next [rad], (swing,)."""
    values = record.position[record.measured[:, dof], dof]
    if len(values) < 2:
        return np.zeros(0)
    least, ends = 0.05 * float(np.percentile(values, 95) - np.percentile(values, 5)), [values[0]]
    rising = 0
    # a reversal counts where the joint comes back by more than noise
    for value in values[1:]:
        if rising == 0 or (value - ends[-1]) * rising > 0:
            if rising == 0 and abs(value - ends[0]) <= least:
                continue
            if rising == 0:
                rising = 1 if value > ends[0] else -1
                ends.append(value)
            ends[-1] = value
        elif abs(value - ends[-1]) > least:
            ends.append(value)
            rising = -rising
    # the first and the last are cut off
    return np.abs(np.diff(ends))[1:-1]


def _length(record: Poses, hinges: Sequence[int], gravity: float) -> float:
    """Return the length over which gravity would move hinges as a record has it [m]."""
    moved = smooth(record)
    sizes, stds = np.abs(moved.acceleration[:, hinges]), moved.acceleration_std[:, hinges]
    known = np.isfinite(sizes) & np.isfinite(stds)
    if not known.any():
        return 0.0
    quick, clear = float(np.median(sizes[known])), float(np.median(stds[known]))
    # at rest nothing tells a length
    return gravity / quick if quick > 3.0 * clear else 0.0
