"""The torques that a fit found to act at the joints in addition to friction, over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.arrays import usual_step
from monodyn.estimation.fit import Fit

CLOSE = 1e-4
"""How far the motion under torques that are linear between the rows of a table may be from that under the
identified ones [rad or m]: a tenth of what the table promises, so that another integrator may add its own."""
MOST_PARTS = 64
"""Rows of a table from one frame to the next, at most."""
FINEST_STEPS = 64
"""Integration steps from one frame to the next, at most."""


@dataclass(frozen=True, eq=False)
class Torques:
    """Torques over time.

    Attributes:
        time: Time stamps [s], (frame,).
        torque: Torque [N m] at a hinge, force [N] at a slide, (frame, dof); NaN before and after free ones,
            where nothing is known of them and predictions have none.
        std: Standard deviation from that of the fit, the mass scale as it was assumed; infinite where the
            fit has none, NaN before and after free or known torques, (frame, dof).
    """

    time: np.ndarray
    torque: np.ndarray
    std: np.ndarray


def torques(fit: Fit, times: np.ndarray, *, record: int = 0) -> Torques:
    """Return the torque of the fitted drive; friction and springs are not part of it.

    Args:
        fit: A fit with ``torque`` ``fourier``, ``free`` or ``known``.
        times: Time stamps [s], (frame,).
        record: Which record, for known torques.

    Returns:
        The torques at ``times``; zero without a drive. The nearest value of a log stands for known torques
        before and after it.
    """
    mechanism = fit.mechanism
    clock = times * mechanism.values["time_scale"]
    drive, _ = fit.driven(times, record)
    found, slopes = drive.derivatives(mechanism.directions(fit.shared), clock)
    variance = np.einsum("fip,pr,fir->fi", slopes, fit.shared_covariance, slopes, optimize=True)
    variance = np.where(np.isnan(variance), np.inf, variance)
    std, unknown = np.sqrt(np.maximum(variance, 0.0)), fit.unpushed(times, record)
    std[unknown] = np.nan
    if fit.torque == "free":
        found[unknown] = np.nan
    return Torques(times, found, std)


def torque_course(fit: Fit, times: np.ndarray, *, record: int = 0) -> Torques:
    """Return the torques at so many times that their lines make the same motion.

    Args:
        fit: A fit with ``torque`` ``fourier``, ``free`` or ``known``.
        times: Time stamps of record and prediction [s], (frame,), increasing.
        record: Which record.

    Returns:
        The torques at ``times``, and at further times in between: under what is linear between the rows the
        motion from the fitted start is within ``CLOSE``, or ``MOST_PARTS`` rows are not enough.
    """
    if fit.torque == "free":
        # they are linear between their knots
        knots = fit.mechanism.drive.times / fit.mechanism.values["time_scale"]
        # a knot is at a stamp, but for rounding
        between = knots[np.abs(times[:, None] - knots).min(axis=0) > 1e-9]
        return torques(fit, np.union1d(times, between), record=record)
    usual = usual_step(fit.time[record]) if len(fit.time[record]) > 1 else 0.05
    # a gap is cut into the usual steps first
    pieces = np.maximum(np.ceil(np.diff(times) / (1.5 * usual)), 1.0).astype(int)
    base = np.interp(np.arange(pieces.sum() + 1), np.concatenate(([0], np.cumsum(pieces))), times)
    parts = 1
    while True:
        rows = np.interp(np.arange((len(base) - 1) * parts + 1) / parts, np.arange(len(base)), base)
        found = torques(fit, rows, record=record)
        if parts >= MOST_PARTS or _astray(fit, base, found, parts, record) <= CLOSE:
            return found
        parts *= 2


def _astray(fit: Fit, stamps: np.ndarray, linear: Torques, parts: int, record: int) -> float:
    """Return how far the motion under lines between some torques is from the identified one [rad or m].

    Args:
        fit: The fit.
        stamps: Time stamps [s], (frame,), increasing.
        linear: Torques at these and at ``parts - 1`` times between each two.
        parts: Lines from one stamp to the next.
        record: Which record.
    """
    from monodyn.mechanism.drive import KNOTS, Drive
    from monodyn.mechanism.simulate import rollout

    start, stretch, off = fit.starts[record], fit.mechanism.values["time_scale"], 0.0
    lines, steps = Drive(KNOTS, linear.time * stretch, linear.torque.T), max(1, FINEST_STEPS // parts)
    # from the start a rollout runs either way; its steps end at the rows, where the lines bend
    for way in (-1, 1):
        at = linear.time[way * (linear.time - start.time) >= 0.0][::way] * stretch
        drive, _ = fit.driven(stamps[way * (stamps - start.time) >= 0.0][::way], record)
        state = (fit.mechanism.tree, at, start.position, start.velocity)
        if len(at) > 1:
            one, other = (rollout(*state, substeps=steps, drive=each)[0] for each in (drive, lines))
            off = max(off, float(np.abs(one - other).max()))
    return off
