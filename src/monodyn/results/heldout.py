"""How well a fit predicts frames that it did not see, what that says against it, and against single poses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monodyn.estimation.fit import Doubt, Fit
from monodyn.estimation.wording import amount, listed
from monodyn.results.predict import predict
from monodyn.results.trace import Trace, trace_of
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
            measurement, (dof,); NaN where none was measured and predicted.
        share: Largest error as a share of the range of motion so far, (frame,); infinite from where on there
            is no prediction of what was measured.
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


class Judged(NamedTuple):
    """What frames that a fit did not see say against it, each None where they do not.

    Attributes:
        motion: The motion does not go on as predicted.
        band: It is farther off than the band of the prediction has it.
    """

    motion: Doubt | None
    band: Doubt | None


def predicted_trace(fit: Fit, poses: Poses, times: np.ndarray, name: str, *, record: int = 0) -> list[Trace]:
    """Put a record next to its motion by the fit, and that motion on beyond the fitted frames.

    Args:
        fit: The fit.
        poses: The tracked clip, or a table.
        times: Time stamps to predict [s], (frame,).
        name: Name of the record.
        record: Its number within the fit.

    Returns:
        One trace, or none where the fit has no motion.
    """
    future = predict(fit, times=times, record=record) if fit.starts and len(times) else None
    return [trace_of(fit, poses, future, name=name, record=record)] if fit.starts else []


def held_out(fit: Fit, trace: Trace) -> HeldOut | None:
    """Compare the frames after the fitted ones with their prediction.

    Args:
        fit: The fit.
        trace: A record of it with its prediction.

    Returns:
        What was found; None where no frame is left.
    """
    time, error, std = trace.ahead
    measured = ~np.isnan(error)
    if not measured.any():
        return None
    # what grew beyond all numbers is no prediction: it misses
    use = np.isfinite(error)
    rms = np.array([fit.rms[name] for name in trace.poses.joints])
    expected = np.where(use, std**2 + rms**2, np.nan)
    squares = np.where(use, error**2, np.nan)
    counted = use.any(axis=0)
    bands = np.full(len(rms), np.nan)
    bands[counted] = np.sqrt(np.nansum(squares[:, counted], axis=0) / np.nansum(expected[:, counted], axis=0))
    shares = np.where(use, np.abs(np.where(use, error, 0.0)) / _ranges(fit, trace), 0.0)
    shares[measured & ~use] = np.inf
    so_far = np.maximum.accumulate(shares.max(axis=1))
    far = shares > WITHIN
    row = int(np.argmax(far.any(axis=1))) if far.any() else int(np.argmax(shares.max(axis=1)))
    last = float(trace.poses.time[trace.rows[1] - 1])
    return HeldOut(bands, so_far, time - last, int(np.argmax(shares[row])))


def _ranges(fit: Fit, trace: Trace) -> np.ndarray:
    """Return the range of each joint in the fitted rows [rad or m], of a hinge at most a turn, (dof,);
    infinite where it was not measured."""
    fitted = trace.poses[slice(*trace.rows)]
    position, known = np.where(fitted.measured, fitted.position, np.nan), fitted.measured.any(axis=0)
    ranges = np.full(len(trace.poses.joints), np.inf)
    ranges[known] = np.nanmax(position[:, known], axis=0) - np.nanmin(position[:, known], axis=0)
    hinge = np.array([joint.kind == "hinge" for joint in fit.mechanism.joints])
    return np.maximum(np.where(hinge, np.minimum(ranges, 2.0 * np.pi), ranges), 1e-9)


def heldout_doubts(fit: Fit, trace: Trace) -> list[Doubt]:
    """Return what the frames after the fitted ones say against a fit.

    Args:
        fit: The fit.
        trace: A record of it with its prediction.
    """
    return [doubt for doubt in judged(fit, trace) if doubt is not None]


def judged(fit: Fit, trace: Trace) -> Judged:
    """Return what the frames after the fitted ones say against a fit, by kind.

    Args:
        fit: The fit.
        trace: A record of it with its prediction.
    """
    found = held_out(fit, trace)
    return Judged(None, None) if found is None else Judged(_astray(fit, trace, found), _narrow(trace, found))


def _astray(fit: Fit, trace: Trace, found: HeldOut) -> Doubt | None:
    """Doubt a fit whose prediction leaves its tolerance."""
    if not np.isfinite(found.holds):
        return None
    name, first = trace.poses.joints[found.joint], float(trace.poses.time[trace.rows[0]])
    fitted = float(trace.poses.time[trace.rows[1] - 1]) - first
    rms = trace.heldout()[name]
    if rms is None or not np.isfinite(rms):
        off = f"the identified motion of {name} grows beyond all numbers."
    else:
        off = (
            f"{name} is off by more than {WITHIN:.0%} of its range, {amount(fit.mechanism, name, rms)} rms "
            f"over the {found.time[-1]:.2g} s that were held out."
        )
    soon = found.time <= AT_ONCE * fitted
    if soon.any() and found.share[soon][-1] > USELESS:
        return Doubt("refused", f"The motion does not go on as identified: after {found.holds:.2g} s {off}")
    return Doubt(
        "approximate", f"The prediction holds for {found.holds:.2g} s after the fitted frames; then {off}"
    )


def _narrow(trace: Trace, found: HeldOut) -> Doubt | None:
    """Doubt a fit whose prediction is farther off than its band."""
    joints = trace.poses.joints
    outside = [joint for joint, bands in zip(joints, found.bands, strict=True) if bands > MOST_BANDS]
    if not outside:
        return None
    return Doubt(
        "approximate",
        f"The frames that were held out lie {np.nanmax(found.bands):.2g} standard deviations from their "
        f"prediction ({listed(outside)}): its band is too narrow, and so may be the intervals of the "
        "parameters.",
    )


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


def excluded_note(found: np.ndarray, poses: Poses, name: str = "", *, marked: bool = True) -> list[str]:
    """Return a note on the poses that the identified dynamics exclude; none where there are none.

    Args:
        found: True for those, bool (frame, dof).
        poses: The record.
        name: What the record is called, where there are several.
        marked: Whether ``poses.csv`` marks them; else the record is a table of the user's.
    """
    rows = [str(number) for number in poses.frame[found.any(axis=1)]]
    if not rows:
        return []
    joints = [poses.joints[dof] for dof in range(found.shape[1]) if found[:, dof].any()]
    where = f" of {name}" if name else ""
    wrong = (
        "the tracking was wrong there; <joint>_excluded marks it in poses.csv."
        if marked
        else "the measurement was wrong there."
    )
    return [
        f"The identified dynamics exclude the position of {listed(joints)} in frame {listed(rows)}{where}: "
        f"{wrong}"
    ]
