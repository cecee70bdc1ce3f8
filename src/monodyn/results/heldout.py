"""How well a fit predicts frames that it did not see, what that says against it, and against single poses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monodyn.estimation.fit import Doubt, Fit
from monodyn.estimation.wording import amount, listed
from monodyn.results.trace import Trace
from monodyn.types import Poses

WITHIN = 0.1
"""Error up to which a prediction holds, as a share of the joint's range of motion (at most one turn)."""
MOST_BANDS = 3.0
"""Error over its standard deviation, both rms, above which the band of a prediction is too narrow."""
USELESS = 0.5
"""Share of the range that a prediction misses at once where it is none."""
AT_ONCE = 0.25
"""Share of the fitted time within which it does."""


EXCLUDED = 8.0
"""Standard deviations beyond which a pose is none of the identified motion, where that goes on beside it."""


class HeldOut(NamedTuple):
    """Frames after the fitted ones, compared with their prediction.

    Attributes:
        bands: Rms error over the rms of its standard deviation by joint, which has prediction and
            measurement, (dof,); NaN where none was measured.
        share: Largest error as a share of the range of motion so far, (frame,).
        time: Seconds after the last fitted frame, (frame,).
        joint: The joint that leaves the tolerance first, or is off most.
    """

    bands: np.ndarray
    share: np.ndarray
    time: np.ndarray
    joint: int

    @property
    def holds(self) -> float:
        """How long the prediction stays within the tolerance [s]; infinite as far as was measured."""
        off = self.share > WITHIN
        return float(self.time[int(np.argmax(off))]) if off.any() else np.inf


def held_out(fit: Fit, trace: Trace) -> HeldOut | None:
    """Compare the frames after the fitted ones with their prediction.

    Args:
        fit: The fit.
        trace: A record of it with its prediction.

    Returns:
        What was found; None where no frame is left.
    """
    time, error, std = trace.ahead
    use = np.isfinite(error)
    if not use.any():
        return None
    fitted = trace.poses.part(*trace.rows)
    rms = np.array([fit.rms[name] for name in trace.poses.joints])
    expected = np.where(use, std**2 + rms**2, np.nan)
    squares = np.where(use, error**2, np.nan)
    counted = use.any(axis=0)
    bands = np.full(len(rms), np.nan)
    bands[counted] = np.sqrt(np.nansum(squares[:, counted], axis=0) / np.nansum(expected[:, counted], axis=0))
    position = np.where(fitted.measured, fitted.position, np.nan)
    known = fitted.measured.any(axis=0)
    ranges = np.full(len(rms), np.inf)
    ranges[known] = np.nanmax(position[:, known], axis=0) - np.nanmin(position[:, known], axis=0)
    hinge = np.array([joint.kind == "hinge" for joint in fit.mechanism.joints])
    ranges = np.maximum(np.where(hinge, np.minimum(ranges, 2.0 * np.pi), ranges), 1e-9)
    shares = np.where(use, np.abs(error) / ranges, 0.0)
    so_far = np.maximum.accumulate(shares.max(axis=1))
    far = shares > WITHIN
    row = int(np.argmax(far.any(axis=1))) if far.any() else int(np.argmax(shares.max(axis=1)))
    return HeldOut(bands, so_far, time - float(fitted.time[-1]), int(np.argmax(shares[row])))


def heldout_doubts(fit: Fit, trace: Trace, *, kept: bool = False) -> list[Doubt]:
    """Return what the frames after the fitted ones say against a fit.

    Args:
        fit: The fit.
        trace: A record of it with its prediction.
        kept: True where they were kept back of what is fitted.
    """
    found = held_out(fit, trace)
    if found is None:
        return []
    doubts, joints = [], trace.poses.joints
    if np.isfinite(found.holds):
        name = joints[found.joint]
        rms = amount(fit.mechanism, name, trace.heldout()[name] or 0.0)
        off = (
            f"{name} is off by more than {WITHIN:.0%} of its range, {rms} rms over the "
            f"{found.time[-1]:.2g} s that were held out."
        )
        soon = found.time <= AT_ONCE * (fit.time[0][-1] - fit.time[0][0])
        if soon.any() and found.share[soon][-1] > USELESS:
            said = f"The motion does not go on as identified: after {found.holds:.2g} s {off}"
            doubts.append(Doubt("refused", said))
        else:
            said = f"The prediction holds for {found.holds:.2g} s after the fitted frames; then {off}"
            doubts.append(Doubt("approximate", said))
    outside = [joint for joint, bands in zip(joints, found.bands, strict=True) if bands > MOST_BANDS]
    if outside:
        said = (
            f"The frames that were held out lie {np.nanmax(found.bands):.2g} standard deviations from their "
            f"prediction ({listed(outside)}): its band is too narrow, and so may be the intervals of the "
            "parameters."
        )
        doubts.append(Doubt("approximate", said))
    without = f"Identified without the last {found.time[-1]:.2g} s of the record: " if kept else ""
    return [Doubt(doubt.grade, f"{without}{doubt.reason}") for doubt in doubts]


def excluded(fit: Fit, trace: Trace) -> np.ndarray:
    """Mark the measured positions that the identified dynamics exclude: the tracking was wrong there.

    They lie far outside of the band of the motion, which has that of the fit, the residuals and the pose, and
    the motion is followed before and after them for at least as many rows: where it is not, the motion is
    wrong and not the poses.

    Args:
        fit: The fit.
        trace: A record of it.

    Returns:
        True for those, bool (frame, dof).
    """
    poses, states = trace.poses, trace.states
    rms = np.array([fit.rms[name] for name in poses.joints])
    variance = np.diagonal(poses.covariance, axis1=1, axis2=2)
    band = EXCLUDED * np.sqrt(states.std**2 + rms**2 + np.where(poses.measured, variance, 0.0))
    off = poses.position - states.position
    found = np.zeros(off.shape, dtype=bool)
    for dof in range(off.shape[1]):
        if dof in trace.turning:
            # a gap may hide a turn
            off[:, dof] -= 2.0 * np.pi * np.round(off[:, dof] / (2.0 * np.pi))
        rows = np.flatnonzero(poses.measured[:, dof])
        far = np.abs(off[rows, dof]) > band[rows, dof]
        edges = np.flatnonzero(np.diff(np.concatenate(([False], far, [False])).astype(int)))
        for begin, end in edges.reshape(-1, 2).tolist():
            count = end - begin
            beside = np.concatenate((far[max(begin - count, 0) : begin], far[end : end + count]))
            if len(beside) == 2 * count and not beside.any():
                found[rows[begin:end], dof] = True
    return found


def excluded_note(found: np.ndarray, poses: Poses) -> list[str]:
    """Return a note on the poses that the identified dynamics exclude; none where there are none.

    Args:
        found: True for those, bool (frame, dof).
        poses: The record.
    """
    rows = [str(number) for number in poses.frame[found.any(axis=1)]]
    if not rows:
        return []
    joints = [poses.joints[dof] for dof in range(found.shape[1]) if found[:, dof].any()]
    return [
        f"The identified dynamics exclude the position of {listed(joints)} in frame {listed(rows)}: the "
        "tracking was wrong there; <joint>_excluded marks it in poses.csv."
    ]
