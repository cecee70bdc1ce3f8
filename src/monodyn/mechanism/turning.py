"""Whole turns of hinges: angles but for these in, angles that go on from row to row out.

From one measured row to the next a hinge goes the smaller way. Only where it was out of sight may it have
made a turn; there the rates on both sides tell which, where no other number of turns goes with them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from monodyn.arrays import usual_step
from monodyn.types import Poses

TURN = 2.0 * np.pi
"""A whole turn [rad]."""
NEAR_FRAMES = 5
"""Measured frames on either side of a gap from which the rate there is taken."""
LONGER = 1.5
"""Times the usual time between two measurements from which there is a gap."""
HARDEST = 95.0
"""Percentile of the accelerations of a joint that bounds what it does out of sight."""
HARDER = 2.0
"""Times that another number of turns is farther from the expected rate before the nearest one is certain."""
UNLIKELY = 3.0
"""Standard deviations of a rate that noise rarely exceeds."""


@dataclass(frozen=True)
class Gap:
    """Rows of a record in which a joint was not measured.

    Attributes:
        dof: The joint.
        before: Last row in which it was measured before.
        after: First row in which it was measured again.
    """

    dof: int
    before: int
    after: int


def unwound(poses: Poses, joints: np.ndarray) -> Poses:
    """Return a record whose hinges go on from row to row, whatever turns they were found with.

    Args:
        poses: The record.
        joints: True for the hinges whose turns no picture shows, (dof,).

    Returns:
        The record: the smallest step from one measured row to the next, and across a gap the one that goes
        with the rates on both sides where it is certain.
    """
    position = poses.position.copy()
    for dof in np.flatnonzero(joints & poses.measured.any(axis=0)).tolist():
        rows, record = _record(poses, dof)
        angle = np.unwrap(record.angle)
        record = record._replace(angle=angle, hardest=_hardest(record.time, angle, record.together))
        for i in _gaps(record):
            apart = float(record.time[i + 1] - record.time[i])
            mean, slack = _mean_rate(record, int(i))
            step = float(angle[i + 1] - angle[i])
            turns = float(np.round((mean * apart - step) / TURN))
            if _is_certain((step + TURN * turns) / apart, apart, mean, slack):
                angle[i + 1 :] += TURN * turns
        position[rows, dof] = angle
    return replace(poses, position=position)


def doubtful_gaps(poses: Poses, joints: np.ndarray) -> list[Gap]:
    """Find gaps across which the rates on both sides leave more than one number of turns.

    Args:
        poses: The record.
        joints: True for hinges that turn freely, (dof,).

    Returns:
        The gaps, in the order of time.
    """
    found = []
    for dof in np.flatnonzero(joints).tolist():
        rows, record = _record(poses, dof)
        for i in _gaps(record):
            apart = float(record.time[i + 1] - record.time[i])
            rate = float(record.angle[i + 1] - record.angle[i]) / apart
            if not _is_certain(rate, apart, *_mean_rate(record, int(i))):
                found.append(Gap(dof, int(rows[i]), int(rows[i + 1])))
    return sorted(found, key=lambda gap: (gap.after, gap.dof))


class _Record(NamedTuple):
    """The measurements of a joint: time [s], angle [rad], its standard deviation, and the number of the
    stretch, each (sample,); and the acceleration that it rarely exceeds [rad/s^2]."""

    time: np.ndarray
    angle: np.ndarray
    std: np.ndarray
    together: np.ndarray
    hardest: float


def _record(poses: Poses, dof: int) -> tuple[np.ndarray, _Record]:
    """Return the rows in which a joint was measured, and its measurements there."""
    rows = np.flatnonzero(poses.measured[:, dof])
    time, angle = poses.time[rows], poses.position[rows, dof]
    # repeated pictures, too, leave rows without a measurement: a gap is longer than usual
    breaks = np.diff(time) > LONGER * usual_step(time) if len(rows) > 1 else np.zeros(0, dtype=bool)
    together = np.cumsum(np.concatenate(([False], breaks)))[: len(rows)]
    std = np.sqrt(poses.covariance[rows, dof, dof])
    return rows, _Record(time, angle, std, together, _hardest(time, angle, together))


def _gaps(record: _Record) -> np.ndarray:
    """Return the last sample before each gap."""
    return np.flatnonzero(np.diff(record.together))


def _is_certain(rate: float, apart: float, mean: float, slack: float) -> bool:
    """Return whether no other number of turns across a gap goes with the rates at its ends.

    A joint whose acceleration is at most ``a`` crosses a gap of length T at a mean rate within ``a T / 4`` of
    the mean of the rates at its ends, or within ``a T / 2`` of that at one end; one turn more or less changes
    it by ``2 pi / T``. The noise of the angles adds its own.

    Args:
        rate: Mean rate across the gap with the turns that are looked at [rad/s].
        apart: Length of the gap [s].
        mean: Mean of the rates at its ends [rad/s]; NaN where neither shows.
        slack: How far off it may be [rad/s].
    """
    off = abs(rate - mean)
    other = TURN / apart - off
    # a rare acceleration is no doubt where another number of turns takes a much harder one; a rate that is
    # not known leaves a doubt
    return bool(other > slack and (off <= slack or other > HARDER * off))


def _hardest(time: np.ndarray, angle: np.ndarray, together: np.ndarray) -> float:
    """Return the acceleration of a joint that it rarely exceeds; samples of one number in ``together``
    (sample,) have no gap between them."""
    if len(time) < 3:
        return np.inf
    rate = np.diff(angle) / np.diff(time)
    acceleration = np.diff(rate) / (0.5 * (time[2:] - time[:-2]))
    known = np.abs(acceleration[together[2:] == together[:-2]])
    return float(np.percentile(known, HARDEST)) if len(known) else np.inf


def _mean_rate(record: _Record, before: int) -> tuple[float, float]:
    """Return the mean rate across the gap after a sample by the rates at its ends, and how far off it may be
    [rad/s]; NaN where neither end shows its rate."""
    apart = record.time[before + 1] - record.time[before]
    ends = [_rate(record, before, -1), _rate(record, before + 1, 1)]
    known = [end for end in ends if np.isfinite(end[0])]
    if not known:
        return np.nan, np.nan
    mean = float(np.mean([rate for rate, _ in known]))
    spread = float(np.linalg.norm([std for _, std in known])) / len(known)
    noise = float(np.hypot(record.std[before], record.std[before + 1])) / apart
    slack = record.hardest * apart / (4.0 if len(known) == 2 else 2.0)
    return mean, slack + UNLIKELY * float(np.hypot(spread, noise))


def _rate(record: _Record, at: int, side: int) -> tuple[float, float]:
    """Return the rate at one end of a gap by a parabola through the samples on its side, a line through
    two, and its standard deviation; NaN if fewer."""
    near = np.flatnonzero(record.together == record.together[at])
    near = near[:NEAR_FRAMES] if side > 0 else near[-NEAR_FRAMES:]
    if len(near) < 2:
        return np.nan, np.nan
    powers = np.vander(record.time[near] - record.time[at], min(len(near), 3))
    solve = np.linalg.pinv(powers)[-2]
    return float(solve @ record.angle[near]), float(np.linalg.norm(solve * record.std[near]))
