"""How long a prediction can be relied on: an identified mechanism and a tolerance in, a time out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monodyn.choices import Tolerance
from monodyn.estimation.fit import Fit
from monodyn.estimation.wording import amount, listed
from monodyn.mechanism import Mechanism
from monodyn.mechanism.steps import ERROR_BOUND, spacing
from monodyn.results.curves import BAND
from monodyn.results.fill import fill
from monodyn.results.trace import Trace

FARTHEST = 60.0
"""How long after the fitted frames is looked at most [s]."""
FASTEST = 4.0
"""How much farther is looked at from one time to the next, at most."""
ALL_OF_IT = 1.5
"""Where this much farther is beyond all that is looked at, the rest is looked at as well."""
EXACT = 1e-3
"""Largest integration error that is aimed at, as a share of the tolerance."""


class Horizon(NamedTuple):
    """How long a prediction stays within a tolerance.

    Attributes:
        seconds: From the last fitted frame on [s]; infinite where it does as far as is looked.
        joint: The joint that leaves it first; empty where none does, or where it leaves its band.
        shown: True where frames that the fit did not see end it, before its band does.
    """

    seconds: float
    joint: str
    shown: bool = False


def horizon(fit: Fit, tolerance: Tolerance | None = None, *, record: int = 0) -> Horizon:
    """Return how long the 95 % band of a prediction stays within a tolerance.

    The band has what is not known of the parameters and of the start state, carried along the motion, so that
    it grows as fast as motions nearby part, and what the model lacks. It counts for no longer than frames
    that the fit did not see confirm it (``Doubt.holds``).

    Args:
        fit: The identified mechanism.
        tolerance: How far off it may be; 5 deg and 2 cm when left out.
        record: Which record is carried on.

    Returns:
        The time, zero where nothing is known of what acts after the fitted frames.

    Raises:
        SettingsError: nothing was identified, or there is no such record.
    """
    most = by_joint(fit, tolerance or Tolerance())
    confirmed = Horizon(min((doubt.holds for doubt in fit.doubts), default=np.inf), "", True)
    stamps = fit.time[record] if record < len(fit.time) else np.zeros(1)
    end, step = float(stamps[-1]), spacing(stamps)
    length = max(2.0 * float(stamps[-1] - stamps[0]), 1.0)
    error_bound = max(EXACT * float(np.min(most)), ERROR_BOUND)
    # of a chaotic motion the band grows beyond all numbers: it is followed no farther than it has to be
    while True:
        length = length if ALL_OF_IT * length < FARTHEST else FARTHEST
        ahead = step * np.arange(1, max(round(length / step), 1) + 1)
        band = BAND * fill(fit, end + ahead, record=record, error_bound=error_bound).std / most
        off = ~(band <= 1.0)
        if off.any():
            return min(_first(fit, ahead, off), confirmed)
        if length == FARTHEST or ahead[-1] > confirmed.seconds:
            return confirmed if np.isfinite(confirmed.seconds) else Horizon(np.inf, "")
        length *= _farther(band)


def _farther(band: np.ndarray) -> float:
    """Return how many times as far a band, as a share of what is allowed, (frame, dof), is looked at next: at
    least twice, and up to ``FASTEST`` where it would still be allowed there if it went on to grow as from the
    first half of its frames to the second."""
    first, second = (float(np.max(half, initial=0.0)) for half in np.array_split(band, 2))
    if not second > first > 0.0:
        return FASTEST
    halves = -np.log(second) / np.log(second / first)
    return float(np.clip(1.0 + 0.5 * halves, 2.0, FASTEST))


def horizon_of(fit: Fit, trace: Trace, tolerance: Tolerance, *, record: int = 0) -> Horizon:
    """Return how long a prediction stays within a tolerance, as frames that the fit did not see confirm it.

    Args:
        fit: The identified mechanism.
        trace: The record with its prediction.
        tolerance: How far off it may be.
        record: Its number within the fit.

    Returns:
        The earlier of both times.
    """
    found, (time, error, _) = horizon(fit, tolerance, record=record), trace.ahead
    # what is measured has noise of its own
    noise = np.array([fit.rms[name] for name in trace.poses.joints])
    off = np.abs(np.where(np.isnan(error), 0.0, error)) > by_joint(fit, tolerance) + BAND * noise
    if not off.any():
        return found
    seen = _first(fit, time - float(fit.time[record][-1]), off)
    return seen._replace(shown=True) if seen.seconds < found.seconds else found


def by_joint(fit: Fit, tolerance: Tolerance) -> np.ndarray:
    """Return how far off the prediction of each joint may be [rad or m], (dof,).

    Args:
        fit: The identified mechanism.
        tolerance: How far off it may be, by the kind of joint.
    """
    return np.array([tolerance.of(joint.kind) for joint in fit.mechanism.joints])


def _first(fit: Fit, ahead: np.ndarray, off: np.ndarray) -> Horizon:
    """Return the last time before a joint is off, (frame, dof)."""
    row = int(np.argmax(off.any(axis=1)))
    joint = fit.mechanism.joints[int(np.argmax(off[row]))].name
    return Horizon(float(ahead[row - 1]) if row else 0.0, joint)


def horizon_said(fit: Fit, found: Horizon, tolerance: Tolerance, *, since: str = "the fitted frames") -> str:
    """Write how long a prediction holds.

    Args:
        fit: The identified mechanism.
        found: How long it does.
        tolerance: How far off it may be.
        since: From when on, in words.

    Returns:
        A sentence.
    """
    within = allowed(fit.mechanism, tolerance)
    if np.isinf(found.seconds):
        return f"Predictions stay within {within} over all of the {FARTHEST:g} s that were looked at."
    if found.seconds == 0.0:
        return f"Predictions leave {within} right after {since}."
    how = "as was measured" if found.shown else "by their 95 % band"
    first = f"; {found.joint} is the first to leave" if found.joint else ""
    return f"Predictions stay within {within} for {found.seconds:.2g} s after {since} ({how}{first})."


def lasts(found: Horizon) -> str:
    """Return how long a prediction holds, as a number with its unit.

    Args:
        found: How long it does.
    """
    return f"{found.seconds:.2g} s" if np.isfinite(found.seconds) else f"over {FARTHEST:g} s"


def allowed(mechanism: Mechanism, tolerance: Tolerance) -> str:
    """Write how far off a prediction may be, by the kinds of joints that there are.

    Args:
        mechanism: Gives the joints.
        tolerance: How far off it may be.

    Returns:
        The list as part of a sentence.
    """
    most = {j.kind: amount(mechanism, j.name, tolerance.of(j.kind)) for j in mechanism.joints}
    return listed(list(most.values()))
