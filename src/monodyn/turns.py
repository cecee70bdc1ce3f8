"""Whole turns of a hinge that were lost while it was out of sight, found by the dynamics.

A picture shows a hinge's angle but for whole turns, and across a gap they come from the motion before it.
Where more than one number of turns would do, the stretches of the record between such gaps are identified
together, each with a start state of its own; the identified motion across the gap then decides.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from monodyn.estimation.fit import Fit
from monodyn.estimation.settings import IdentifySettings
from monodyn.mechanism.turning import TURN, Gap, doubtful_gaps
from monodyn.results.fill import fill
from monodyn.results.trace import metric
from monodyn.stages import identify
from monodyn.types import Poses, Progress

if TYPE_CHECKING:
    from monodyn.mechanism import Mechanism

LEAST_ROWS = 12
"""Rows of the shortest stretch that is identified."""
MOST_STRETCHES = 4
"""Longest stretches that are identified; more of them would say the same."""
CERTAIN = 1.0
"""A number of turns is certain where the motion ends this near to the measured angle, and is known as well
[rad]."""


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
    gaps = doubtful_gaps(poses, np.array([joint.turns for joint in mechanism.joints]))
    if not gaps:
        return poses, []
    parts = _stretches(poses, gaps, fitted)
    # no stretch may be long enough
    records = [poses[slice(*part)] for part in parts]
    fit = identify(records, mechanism, settings, progress=progress) if records else None
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
    return sorted(sorted(parts, key=lambda part: part[0] - part[1])[:MOST_STRETCHES])
