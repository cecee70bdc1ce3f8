"""Whole turns of a hinge that were lost while it was out of sight, found by the dynamics.

A picture shows a hinge's angle but for whole turns, and across a gap they come from the motion before it.
Where more than one number of turns would do, the stretches of the record between such gaps are identified
together, each with a start state of its own; the identified motion across the gap then decides.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from monodyn.arrays import usual_step
from monodyn.errors import VideoError
from monodyn.estimation.fit import Fit
from monodyn.estimation.settings import IdentifySettings
from monodyn.results.fill import fill
from monodyn.results.trace import metric
from monodyn.stages import identify
from monodyn.types import Poses, Progress

if TYPE_CHECKING:
    from monodyn.mechanism import Mechanism

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
LEAST_ROWS = 12
"""Rows of the shortest stretch that is identified."""
MOST_STRETCHES = 4
"""Longest stretches that are identified; more of them would say the same."""
CERTAIN = 1.0
"""A number of turns is certain where the motion ends this near to the measured angle, and is known as well
[rad]."""


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


def with_right_turns(
    poses: Poses,
    fitted: tuple[int, int],
    mechanism: Mechanism,
    settings: IdentifySettings,
    progress: Progress | None = None,
) -> tuple[Poses, list[str]]:
    """Return a record with the whole turns after each gap as the dynamics have them.

    Args:
        poses: The record.
        fitted: First row that may be identified, and the one after the last.
        mechanism: The mechanism of the record.
        settings: How it is identified.
        progress: Called as the identification goes.

    Returns:
        The record, and what remains uncertain, as sentences; the record itself where no gap leaves a doubt.
    """
    if settings.method == "paper":
        return poses, []  # the published method has its own rule
    free = np.array(
        [j.kind == "hinge" and not np.isfinite([j.lower, j.upper]).all() for j in mechanism.joints]
    )
    gaps = doubtful_gaps(poses, free)
    if not gaps:
        return poses, []
    parts = _stretches(poses, gaps, fitted)
    try:
        fit = identify([poses[slice(*part)] for part in parts], mechanism, settings, progress=progress)
    except VideoError:
        fit = None  # no stretch is long enough
    offset, unsure = np.zeros(poses.position.shape), []
    for gap in gaps:
        found = None if fit is None or not fit.ok else _turns_across(gap, poses, parts, fit)
        if found is None:
            unsure.append(gap)
        # angles count in the turns of the stretch that the motion across the gap comes from
        from_row, turns = found or (gap.before, 0.0)
        offset[gap.after :, gap.dof] = offset[from_row, gap.dof] + TURN * turns
    # from the first such gap of a joint on its turns are open, whatever comes after
    first_unsure = [gap for i, gap in enumerate(unsure) if gap.dof not in [g.dof for g in unsure[:i]]]
    notes = [
        f"The whole turns of {poses.joints[gap.dof]!r} from frame {int(poses.frame[gap.after])} on are not "
        "certain: it was out of sight too long, and the motion before does not determine them."
        for gap in first_unsure
    ]
    return (replace(poses, position=poses.position + offset) if offset.any() else poses), notes


def _turns_across(
    gap: Gap, poses: Poses, parts: Sequence[tuple[int, int]], fit: Fit
) -> tuple[int, float] | None:
    """Return a row of the stretch whose motion crosses the gap, and the turns after it by that motion; None
    where it is not known well enough there."""
    before = [i for i, part in enumerate(parts) if part[0] <= gap.before]
    if not before:
        return None
    motion = fill(fit, poses.time[[gap.after]], record=before[-1])
    # the motion is against gravity, the record as the camera had it
    measured = metric(poses[gap.after : gap.after + 1], fit.mechanism, fit.scale, fit.common_of(before[-1]))
    off = float(motion.position[0, gap.dof] - measured.position[0, gap.dof])
    turns = float(np.round(off / TURN))
    if abs(off - TURN * turns) > CERTAIN or not motion.std[0, gap.dof] < CERTAIN:
        return None
    return parts[before[-1]][0], turns


def doubtful_gaps(poses: Poses, joints: np.ndarray) -> list[Gap]:
    """Find gaps across which the rates on both sides leave more than one number of turns.

    A joint whose acceleration is at most ``a`` crosses a gap of length T at a mean rate within ``a T / 4`` of
    the mean of the rates at its ends, or within ``a T / 2`` of that at one end; one turn more or less changes
    it by ``2 pi / T``. The noise of the angles adds its own.

    Args:
        poses: The record.
        joints: True for hinges that turn freely, (dof,).

    Returns:
        The gaps, in the order of time.
    """
    found = []
    for dof in np.flatnonzero(joints):
        rows = np.flatnonzero(poses.measured[:, dof])
        time, angle = poses.time[rows], poses.position[rows, dof]
        std = np.sqrt(poses.covariance[rows, dof, dof])
        # repeated pictures, too, leave rows without a measurement: a gap is longer than usual
        breaks = np.flatnonzero(np.diff(time) > LONGER * usual_step(time)) if len(rows) > 1 else []
        together = np.cumsum(np.isin(np.arange(len(rows)), np.add(breaks, 1)))
        hardest = _hardest(time, angle, together)
        for i in breaks:
            apart = time[i + 1] - time[i]
            mean, slack = _mean_rate(_Record(time, angle, std, together, hardest), int(i))
            off = abs((angle[i + 1] - angle[i]) / apart - mean)
            other = TURN / apart - off
            # a rare acceleration is no doubt where another number of turns takes a much harder one; written
            # so that a rate that is not known, NaN, leaves a doubt
            if not (other > slack and (off <= slack or other > HARDER * off)):
                found.append(Gap(int(dof), int(rows[i]), int(rows[i + 1])))
    return sorted(found, key=lambda gap: (gap.after, gap.dof))


def _hardest(time: np.ndarray, angle: np.ndarray, together: np.ndarray) -> float:
    """Return the acceleration of a joint that it rarely exceeds; samples of one number in ``together``
    (sample,) have no gap between them."""
    if len(time) < 3:
        return np.inf
    rate = np.diff(angle) / np.diff(time)
    acceleration = np.diff(rate) / (0.5 * (time[2:] - time[:-2]))
    known = np.abs(acceleration[together[2:] == together[:-2]])
    return float(np.percentile(known, HARDEST)) if len(known) else np.inf


class _Record(NamedTuple):
    """The measurements of a joint: time [s], angle [rad], its standard deviation, and the number of the
    stretch, each (sample,); and the acceleration that it rarely exceeds [rad/s^2]."""

    time: np.ndarray
    angle: np.ndarray
    std: np.ndarray
    together: np.ndarray
    hardest: float


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


def _stretches(poses: Poses, gaps: Sequence[Gap], fitted: tuple[int, int]) -> list[tuple[int, int]]:
    """Return the longest stretches of the fitted rows without such a gap, in the order of time."""
    first, stop = fitted
    cuts = [first, *(cut for gap in gaps for cut in (gap.before + 1, gap.after)), stop]
    cuts = sorted({min(max(cut, first), stop) for cut in cuts})
    inside = {(gap.before + 1, gap.after) for gap in gaps}
    parts = [
        (a, b)
        for a, b in itertools.pairwise(cuts)
        if not any(low <= a and b <= high for low, high in inside)
        and poses.measured[a:b].sum(axis=0).min() >= LEAST_ROWS
    ]
    longest = sorted(parts, key=lambda part: part[0] - part[1])[:MOST_STRETCHES]
    return sorted(longest)
