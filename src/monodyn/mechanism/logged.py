"""A log of known torques in, the drive of an integration out: hats at the record's stamps and in between.

Where a torque bends within a Runge-Kutta step the step loses its order, and a log bends in every row. So the
log is brought onto knots at which steps end: of all torques that are linear between those, the one nearest to
it in the mean square. That one has the log's impulse about every knot, so that the motion is the same but for
what the torque does within a knot's interval. Where the torque lags behind its log, the log is moved before
that, and the knots stay where they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.arrays import usual_step
from monodyn.mechanism.drive import KNOTS, UNDRIVEN, Drive
from monodyn.types import TorqueLog

FINEST = 8
"""Intervals between two stamps, at most: what is faster than an eighth hardly shows in the next position."""


@dataclass(frozen=True, eq=False)
class LoggedTorque:
    """Known torques at the stamps of a record.

    Attributes:
        log: What acted by the record's clock.
        dofs: Column of the log for each joint of the mechanism, -1 for none, int (dof,).
        times: Stamps of the record [s], (frame,).
        parts: Intervals between two stamps, a power of two: no integration step may be longer.
        knots: Times of the hats [s], (knot,).
    """

    log: TorqueLog
    dofs: np.ndarray
    times: np.ndarray
    parts: int
    knots: np.ndarray

    def drive(self, lag: float, stretch: float, first: int = 0, stop: int | None = None) -> Drive:
        """Return the torques between two stamps.

        Args:
            lag: How much later than in the log they act [s].
            stretch: True seconds per stamped second.
            first: First stamp.
            stop: The one after the last; None for all.

        Returns:
            The drive in true time, with its derivative by the lag.
        """
        stop = len(self.times) if stop is None else stop
        knots = self.knots[first * self.parts : (stop - 1) * self.parts + 1]
        if len(knots) < 2:  # nothing is integrated
            return UNDRIVEN(len(self.dofs))
        table, slope = (values[:, self.dofs] * (self.dofs >= 0) for values in on_knots(self.log, knots, lag))
        return Drive(KNOTS, knots * stretch, table.T, slope.T)

    def at(self, lag: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the torques at the stamps, without what is faster, and their derivative by the lag.

        Args:
            lag: How much later than in the log they act [s].

        Returns:
            Torques [N m or N] and derivatives by lag, each (frame, dof).
        """
        values, slopes = on_knots(self.log, self.times, lag)
        acts = self.dofs >= 0
        return values[:, self.dofs] * acts, slopes[:, self.dofs] * acts


def logged(log: TorqueLog, joints: tuple[str, ...], times: np.ndarray) -> LoggedTorque:
    """Place known torques at the stamps of a record.

    Args:
        log: The log.
        joints: Names of the mechanism's joints.
        times: Stamps [s], (frame,), increasing.

    Returns:
        The torques, in intervals as short as those of the log, or an eighth of the stamps'.
    """
    step = usual_step(times) if len(times) > 1 else 0.0
    parts, wanted = 1, usual_step(log.time)
    while parts < FINEST and step / parts > 1.001 * wanted:
        parts *= 2
    at = np.arange((len(times) - 1) * parts + 1) / parts
    dofs = np.array([log.joints.index(name) if name in log.joints else -1 for name in joints])
    return LoggedTorque(log, dofs, times, parts, np.interp(at, np.arange(len(times)), times))


def on_knots(log: TorqueLog, knots: np.ndarray, lag: float) -> tuple[np.ndarray, np.ndarray]:
    """Bring a log onto knots: minimize the integral of (sum_k c_k hat_k(t) - tau(t - lag))^2 over them.

    Args:
        log: The log.
        knots: Their times [s], (knot,), at least two.
        lag: How much later than in the log the torques act [s].

    Returns:
        The values c at the knots and their derivatives by the lag, each (knot, dof), by joint of the log.

    Source:
        The normal equations M c = b of linear finite elements: M_jk the integral of hat_j hat_k, b_j that of
        hat_j tau, whose derivative by the lag is minus that of hat_j times the slope of tau.
    """
    from monodyn.solving import banded_root, banded_solved

    # between two neighbouring bends, of the log or of the hats, both are straight and Simpson's rule is exact
    inner = log.time + lag
    ends = np.union1d(knots, inner[(inner > knots[0]) & (inner < knots[-1])])
    width = np.diff(ends)[:, None]
    knot = np.searchsorted(knots, ends[:-1], side="right") - 1
    span = np.diff(knots)
    right = [((end - knots[knot]) / span[knot])[:, None] for end in (ends[:-1], ends[1:])]
    torque = np.column_stack([np.interp(ends - lag, log.time, column) for column in log.torque.T])
    begin, end = torque[:-1], torque[1:]
    load, slope = np.zeros((2, len(knots), len(log.joints)))
    for which, (a, b) in enumerate(((1.0 - right[0], 1.0 - right[1]), right)):
        part = width / 6.0 * (a * (2.0 * begin + end) + b * (begin + 2.0 * end))
        np.add.at(load, knot + which, part)
        np.add.at(slope, knot + which, -0.5 * (end - begin) * (a + b))
    matrix = np.zeros((2, len(knots)))
    matrix[0, 1:] = span / 6.0
    matrix[1, 1:] += span / 3.0
    matrix[1, :-1] += span / 3.0
    found = banded_solved(banded_root(matrix), np.concatenate((load, slope), axis=1))
    return found[:, : len(log.joints)], found[:, len(log.joints) :]
