"""Positions in, which of them repeat the reading before out: a sensor that is slower than its table.

A log that is written faster than a sensor answers holds its last reading. Such a row is right at an earlier
time: as a measurement of its own it is off by all that the joint moved since.
"""

from __future__ import annotations

import numpy as np

from monodyn.types import Poses

SMALL = 0.05
"""Quantile of the distances from one reading to the next larger one that stands for the resolution."""
SAME = 1e-9
"""Distance below which readings are the same but for rounding, as a share of their range."""
CLEAR = 4.0
"""Steps to and from a repeated reading, in resolutions, from which on the joint moved meanwhile: a slow joint
steps by one or two. Between 3 and 20 the same logs are taken as held."""
LEAST = 0.02
"""Share of the readings that have to be held: noise as large as the resolution repeats some by chance."""


def held_rows(position: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Mark positions that repeat the one before while their joint moves on.

    A joint that rests, turns back, or is slower than its encoder resolves, repeats readings, too: what lies
    between clear steps in one direction counts, and all repeated readings of a joint where most of them do.

    Args:
        position: Joint positions [rad or m], (frame, dof).
        measured: True where there is one, bool (frame, dof).

    Returns:
        True for those, bool (frame, dof).
    """
    held = np.zeros(position.shape, dtype=bool)
    for dof in range(position.shape[1]):
        rows = np.flatnonzero(measured[:, dof])
        values = position[rows, dof]
        first = np.append(True, np.diff(values) != 0.0)[: len(rows)]
        steps, ordered = np.diff(values[first]), np.unique(values)
        distances = ordered[1:] - ordered[:-1]
        distances = distances[distances > SAME * distances.sum()]
        if first.all() or len(distances) < 2:
            continue
        clear = np.abs(steps) > CLEAR * np.quantile(distances, SMALL)
        moving = np.concatenate(([False], clear[1:] & clear[:-1] & (steps[1:] * steps[:-1] > 0.0), [False]))
        repeats = ~first & moving[np.cumsum(first) - 1]
        if np.sum(repeats) >= LEAST * len(rows):
            held[rows[repeats if 2 * np.sum(repeats) < np.sum(~first) else ~first], dof] = True
    return held


def held_note(poses: Poses, name: str) -> list[str]:
    """Return a note on the positions of a table that repeat the one before; none where none does.

    Args:
        poses: The table, as read.
        name: What it is called.
    """
    held = held_rows(poses.position, np.isfinite(poses.position)) & ~poses.measured
    return [
        f"{name}: {joint} repeats its last reading in {count} of {len(poses)} rows while it moves on, as "
        "where a log is written faster than a sensor answers; these rows do not count as measured."
        for joint, count in zip(poses.joints, held.sum(axis=0).tolist(), strict=True)
        if count
    ]
