"""How well a fit predicts frames that it did not see, what that says against it, and against single poses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monodyn.choices import Tolerance
from monodyn.estimation.fit import Doubt, Fit
from monodyn.estimation.wording import listed
from monodyn.mechanism.steps import spacing
from monodyn.results.curves import BAND
from monodyn.results.fill import fill
from monodyn.results.horizon import allowed, by_joint, horizon_of
from monodyn.results.predict import predict
from monodyn.results.trace import Trace, trace_of
from monodyn.types import Poses

PREDICTED = 0.1
"""95 % band up to which a prediction says something, as a share of the joint's range of motion (at most one
turn): beyond, how an error grows is no longer in proportion to it. From 0.03 to 0.3 the same records are
doubted."""
MOST_BANDS = 3.0
"""Error over its standard deviation, rms, above which the band of a prediction is too narrow: one of three
hundred right ones is."""
FARTHEST_BANDS = 9.0
"""Standard deviations from which on a row counts no more: one row in nine of another kind decides, fewer do
not."""
USELESS = 0.5
"""Share of the range that a prediction misses at once where it is none."""
AT_ONCE = 0.25
"""Share of the fitted time within which it does."""
EXCLUDED = 8.0
"""Standard deviations beyond which a pose is none of the identified motion, where that goes on beside it."""


class HeldOut(NamedTuple):
    """Frames after the fitted ones, compared with their prediction.

    Attributes:
        bands: Rms of the error over its standard deviation, which has prediction and measurement, by joint,
            (dof,), over the frames up to which the prediction says something; NaN where there are none.
        holds: Seconds after the last fitted frame until the first joint whose band is too narrow leaves it;
            infinite where none is.
        share: Largest error as a share of the range of motion so far, (frame,); infinite from where on there
            is no prediction of what was measured.
        time: Seconds after the last fitted frame, (frame,).
    """

    bands: np.ndarray
    holds: float
    share: np.ndarray
    time: np.ndarray


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
    rms = np.array([fit.rms[name] for name in trace.poses.joints])
    ranges = _ranges(fit, trace)
    size = np.where(measured & np.isfinite(error), np.abs(error), 0.0)
    # of a chaotic motion the band grows until it says nothing, and from there on nothing contradicts it; what
    # grew beyond all numbers is no prediction, whatever its band
    says = np.logical_and.accumulate(BAND * std <= PREDICTED * ranges, axis=0)
    far = np.where(
        np.isinf(error), FARTHEST_BANDS, np.minimum(size / np.sqrt(std**2 + rms**2), FARTHEST_BANDS)
    )
    judged = (says | np.isinf(error)) & measured
    far = np.where(judged, far, 0.0)
    counts = np.where(judged.any(axis=0), judged.sum(axis=0), np.nan)
    bands = np.sqrt(np.sum(far**2, axis=0) / counts)
    since = time - float(trace.poses.time[trace.rows[1] - 1])
    left = ((far > MOST_BANDS) & (bands > MOST_BANDS)).any(axis=1)
    holds = float(np.append(0.0, since)[int(np.argmax(left))]) if left.any() else np.inf
    share = np.maximum.accumulate(np.where(np.isinf(error), np.inf, size / ranges).max(axis=1))
    return HeldOut(bands, holds, share, since)


def _ranges(fit: Fit, trace: Trace) -> np.ndarray:
    """Return the range of each joint in the fitted rows [rad or m], of a hinge at most a turn, (dof,);
    infinite where it was not measured."""
    fitted = trace.poses[slice(*trace.rows)]
    position, known = np.where(fitted.measured, fitted.position, np.nan), fitted.measured.any(axis=0)
    ranges = np.full(len(trace.poses.joints), np.inf)
    ranges[known] = np.nanmax(position[:, known], axis=0) - np.nanmin(position[:, known], axis=0)
    hinge = np.array([joint.kind == "hinge" for joint in fit.mechanism.joints])
    return np.maximum(np.where(hinge, np.minimum(ranges, 2.0 * np.pi), ranges), 1e-9)


def heldout_doubts(fit: Fit, traces: Sequence[Trace]) -> list[Doubt]:
    """Return what predictions say against a fit: those of frames that it did not see, and how short they are.

    Args:
        fit: The fit.
        traces: Its records with their predictions, in the order of the fit.
    """
    if not fit.ok:
        return []
    doubts = [doubt for trace in traces if (doubt := missed(fit, trace))]
    if any(np.isfinite(doubt.holds) for doubt in (*fit.doubts, *doubts)):
        return doubts
    return [doubt for k, trace in enumerate(traces) if (doubt := _blind(fit, trace, k))][:1]


def missed(fit: Fit, trace: Trace) -> Doubt | None:
    """Return a doubt of one that misses the frames after the fitted ones by more than its prediction's band.

    Args:
        fit: The fit.
        trace: A record of it with its prediction.
    """
    found = held_out(fit, trace)
    if found is None or not np.isfinite(found.holds):
        return None
    outside = [
        joint for joint, bands in zip(trace.poses.joints, found.bands, strict=True) if bands > MOST_BANDS
    ]
    first, last = (float(trace.poses.time[row]) for row in (trace.rows[0], trace.rows[1] - 1))
    soon = found.time <= AT_ONCE * (last - first)
    if soon.any() and found.share[soon][-1] > USELESS:
        return Doubt(
            "refused",
            f"The motion does not go on as identified: within {found.time[soon][-1]:.2g} s the prediction "
            f"misses it by more than {USELESS:.0%} of its range, farther than its band has it "
            f"({listed(outside)}).",
            found.holds,
        )
    return Doubt(
        "approximate",
        f"The frames that were held out lie {np.nanmax(found.bands):.2g} standard deviations from their "
        f"prediction ({listed(outside)}): its band is too narrow, and so may be the intervals of the "
        "parameters.",
        found.holds,
    )


def _blind(fit: Fit, trace: Trace, record: int) -> Doubt | None:
    """Doubt a fit of which no force shows as long as its prediction can be relied on."""
    tolerance, end = Tolerance(), fit.time[record][-1:]
    found = horizon_of(fit, trace, tolerance, record=record)
    if np.isinf(found.seconds) or fit.unpushed(end + spacing(fit.time[record]), record)[0]:
        return None
    motion = fill(fit, np.append(end, end + max(found.seconds, 1e-9)), record=record)
    uniform = motion.position[0] + motion.velocity[0] * (motion.time - end)[:, None]
    most = by_joint(fit, tolerance)
    if np.any(np.abs(motion.position - uniform) > most):
        return None
    return Doubt(
        "approximate",
        f"A prediction may be off by {allowed(fit.mechanism, tolerance)} {found.seconds:.2g} s after the "
        "fitted frames, before anything that acts has changed the motion by as much: it shows the last rates "
        "and hardly what was identified.",
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
