"""The least-squares problem of the 2012 paper: start states given by the filtered poses, poses unweighted.

The default problem has the start states among its unknowns; here they are given, and each record is
one rollout.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from monodyn.estimation.record.samples import Data, Pieces
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.shoot import choose_substeps
from monodyn.estimation.shooting.trial import Trial
from monodyn.paper.filter import Filtered
from monodyn.types import Progress

JACOBIAN_STEP = 1e-6
"""Step of the differences for Jacobians, in scales of the unknowns; of start states in their units."""
SINGULAR = 1e-10
"""Eigenvalues of a covariance count as at least this share of the largest."""
SHOWN_EVERY = 50
"""Progress is shown each time after this many rollouts."""


class Rollouts:
    """Counts the rollouts of a search: simulated motions of all records, with or without derivatives.

    Attributes:
        spent: Rollouts so far.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        self.spent, self._progress = 0, progress

    def add(self, count: int = 1) -> None:
        """Count rollouts, and show every few of them.

        Args:
            count: How many.
        """
        before, self.spent = self.spent, self.spent + count
        if self._progress is not None and before // SHOWN_EVERY < self.spent // SHOWN_EVERY:
            self._progress("identify", self.spent, None)


@dataclass(frozen=True, eq=False, kw_only=True)
class FixedStart:
    """One identification whose start states are given.

    Attributes:
        problem: The mechanism, its unknowns and the measurements.
        start: Filtered state at the first row of each record, in its units by stamped time, (record, 2 dof).
        target: Positions, or positions and rates, that are compared, NaN where there are none,
            (row, dof or 2 dof).
        white: Whitening matrices of the target, (row, column, column), or None for a plain difference.
        scale: Typical change of each unknown's coordinate, (param,).
        substeps: Integration steps between stamps.
        response: The filter of each record, each (frame, 2, dof, frame); none to compare measured angles
            alone. With rates the simulated positions go through it as the measured ones did.
        filtered: True to compare filtered angles, False for measured ones.
        rollouts: Counts every simulated motion; one for all problems of a search.
    """

    problem: Problem
    start: np.ndarray
    target: np.ndarray
    white: np.ndarray | None
    scale: np.ndarray
    substeps: int
    response: tuple[np.ndarray, ...] = ()
    filtered: bool = False
    rollouts: Rollouts = field(default_factory=Rollouts)

    @property
    def compared(self) -> int:
        """Number of values that are compared."""
        return int(np.isfinite(self.target).sum())

    @cached_property
    def pieces(self) -> Pieces:
        """One piece a record."""
        return Pieces(self.problem.data.first, np.arange(self.problem.data.records))

    def states(self, x: np.ndarray) -> np.ndarray:
        """Return the start states at coordinates.

        Args:
            x: Coordinates, (param,).

        Returns:
            Positions, then rates by true time [rad or m, rad/s or m/s], (record, 2 dof).
        """
        return self.start * self.units(x)

    def units(self, x: np.ndarray) -> np.ndarray:
        """Return the metres and true seconds of the units that ``start`` is in.

        Args:
            x: Coordinates, (param,).

        Returns:
            Factors, (record, 2 dof).
        """
        unit = np.where(self.problem.data.slide, self.problem.size(x), 1.0)
        return np.concatenate((unit, unit / self.problem.stretch(x)), axis=1)

    def trial(self, x: np.ndarray) -> Trial:
        """Return coordinates with their start states.

        Args:
            x: Coordinates, (param,).
        """
        return Trial(x, self.states(x), self.pieces, self.substeps)

    def motion(self, x: np.ndarray) -> np.ndarray:
        """Simulate every record.

        Args:
            x: Coordinates, (param,).

        Returns:
            Positions in the records' units [rad or m], (row, dof).
        """
        self.rollouts.add()
        q, data = self.problem.simulated(self.trial(x)), self.problem.data
        if not data.slide.any():
            return q
        return q / data.by_row(np.where(data.slide, self.problem.size(x), 1.0))

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Return X_s - X_e, whitened with rates.

        Args:
            x: Coordinates, (param,).

        Returns:
            Differences, 0 where nothing was measured, (row, column).
        """
        simulated = self.motion(x)
        if self.white is not None:
            simulated = self._through_filter(simulated)
        difference = np.where(np.isfinite(self.target), simulated - self.target, 0.0)
        return difference if self.white is None else np.einsum("fij,fj->fi", self.white, difference)

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Differentiate ``residuals`` by the unknowns, along the rollout where nothing is filtered.

        Args:
            x: Coordinates, (param,).

        Returns:
            The Jacobian, (row, column, param).
        """
        if self._by_differences:
            return self.differences(x)
        self.rollouts.add()
        compared = np.isfinite(self.target)
        plain = np.eye(self.target.shape[1]) * compared[:, :, None]
        problem = self.problem.with_data(replace(self.problem.data, white=plain))
        return problem.rows(self.trial(x))[1][:, :, : len(x)]

    @property
    def _by_differences(self) -> bool:
        """True where the tangents along a rollout are not the whole Jacobian."""
        # start states of slides in the start scale move with the sizes, which the tangents do not contain
        return self.white is not None or bool(self.problem.data.slide.any())

    @property
    def jacobian_rollouts(self) -> int:
        """Rollouts that a Jacobian takes, at most: one with derivatives, or two for each unknown."""
        return 2 * len(self.problem.unknowns) if self._by_differences else 1

    def least_substeps(self, x: np.ndarray, error_bound: float) -> tuple[int, float]:
        """Choose the integration steps between stamps by doubling them until the motion no longer changes.

        Args:
            x: Coordinates, (param,).
            error_bound: Largest error [rad or m].

        Returns:
            The number, and the largest error with it [rad or m].
        """
        return choose_substeps(self.problem, self.trial(x), error_bound, lambda _: self.rollouts.add(1))

    def differences(self, x: np.ndarray) -> np.ndarray:
        """Differentiate ``residuals`` by the unknowns, by central differences within their bounds.

        Args:
            x: Coordinates, (param,).

        Returns:
            The Jacobian, (row, column, param).
        """
        lower, upper = self.problem.unknowns.lower, self.problem.unknowns.upper
        jacobian = np.zeros((*self.target.shape, len(x)))
        for p, step in enumerate(JACOBIAN_STEP * self.scale):
            low, high = x.copy(), x.copy()
            low[p], high[p] = x[p] - step, x[p] + step
            # at a bound the difference becomes one-sided: beyond it the mechanism may not exist
            low, high = (np.clip(end, lower, upper) for end in (low, high))
            if high[p] > low[p]:
                ahead, behind = self.residuals(high), self.residuals(low)
                jacobian[:, :, p] = (ahead - behind) / (high[p] - low[p])
        return jacobian

    def start_jacobian(self, x: np.ndarray) -> np.ndarray:
        """Differentiate ``residuals`` by the entries of ``start``.

        Args:
            x: Coordinates, (param,).

        Returns:
            The Jacobian, (row, column, entry).
        """
        slopes = []
        for entry in np.ndindex(self.start.shape):
            ends = []
            for step in (JACOBIAN_STEP, -JACOBIAN_STEP):
                moved = self.start.copy()
                moved[entry] += step
                ends.append(replace(self, start=moved).residuals(x))
            slopes.append((ends[0] - ends[1]) / (2.0 * JACOBIAN_STEP))
        return np.stack(slopes, axis=-1)

    def _through_filter(self, position: np.ndarray) -> np.ndarray:
        """Angles and rates as the filter makes them of positions (row, dof), (row, 2 dof)."""
        rows, dofs = position.shape
        found = np.full((rows, 2 * dofs), np.nan)
        data = self.problem.data
        for first, stop, response in zip(data.first[:-1], data.first[1:], self.response, strict=True):
            # the filter was given the rows of the record's table alone, none of those that were put into gaps
            of = first + np.flatnonzero(data.source[first:stop] >= 0)
            at = data.source[of]
            part = response[np.ix_(at, np.arange(2), np.arange(dofs), at)]
            found[of] = np.einsum("fsde,ed->fsd", part, position[of]).reshape(len(of), 2 * dofs)
        if not self.filtered:
            found[:, :dofs] = position
        return found


def start_states(data: Data, filtered: tuple[Filtered, ...]) -> np.ndarray:
    """Take the filtered state at the first row of each record.

    A joint that is seen later than the first row goes back to it with constant acceleration.

    Args:
        data: The measurements.
        filtered: Filtered motion of each record, on the record's own rows.

    Returns:
        States in the records' units by stamped time [rad or m, rad/s or m/s], (record, 2 dof).
    """
    found = []
    for k, states in enumerate(filtered):
        row = int(data.source[data.first[k]])
        position, velocity = states.position[row].copy(), states.velocity[row].copy()
        for dof in np.flatnonzero(~np.isfinite(position)):
            begun = int(np.argmax(np.isfinite(states.position[:, dof])))
            back = states.time[row] - states.time[begun]
            q, v, a = (part[begun, dof] for part in (states.position, states.velocity, states.acceleration))
            position[dof], velocity[dof] = q + back * v + 0.5 * back**2 * a, v + back * a
        found.append(np.concatenate((position, velocity)))
    return np.array(found)


def targets(
    data: Data, filtered: tuple[Filtered, ...], states: str, rates: bool
) -> tuple[np.ndarray, np.ndarray | None]:
    """Return what the simulated states are compared with, and its whitening.

    Angles alone are compared without weights, as in the paper. With rates the difference is weighted with the
    inverse covariance: that of the filter, or with measured angles that of the measurement and, for
    the rates, of the filter. That covariance does not include the filter's lag, which is why the simulated
    positions then pass the same filter (``FixedStart.response``).

    Args:
        data: The measurements.
        filtered: Filtered motion of each record with its covariance, on the record's own rows.
        states: ``measured`` or ``filtered``.
        rates: True to compare rates as well.

    Returns:
        Target, NaN where there is none, (row, dof or 2 dof); whitening (row, column, column) or None.
    """
    source, record = data.source, data.by_row(np.arange(data.records))
    rows, dofs = data.position.shape
    target, covariance = np.full((rows, 2 * dofs), np.nan), np.full((rows, 2 * dofs, 2 * dofs), np.nan)
    for k, found in enumerate(filtered):
        of = (record == k) & (source >= 0)
        target[of] = np.concatenate((found.position, found.velocity), axis=1)[source[of]]
        if found.covariance is not None:
            covariance[of] = found.covariance[source[of]]
    measured = np.tile(data.measured, 2)
    if states == "measured":
        target[:, :dofs] = data.position
        covariance[:, :dofs, dofs:] = covariance[:, dofs:, :dofs] = 0.0
        # the covariance of what was measured, from the whitening that the default problem keeps
        for i in range(rows):
            use = np.flatnonzero(data.measured[i])
            information = data.white[i].T @ data.white[i]
            covariance[i][np.ix_(use, use)] = np.linalg.inv(information[np.ix_(use, use)])
    target = np.where(measured, target, np.nan)
    if not rates:
        return target[:, :dofs], None
    return target, _whitened(covariance, measured)


def _whitened(covariance: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Roots of the inverse covariances of what is measured, (row, column, column)."""
    both = measured[:, :, None] & measured[:, None, :]
    filled = np.where(both, covariance, np.eye(covariance.shape[1]))
    values, vectors = np.linalg.eigh(filled)
    # a state that two samples determine exactly has a singular covariance to rounding
    values = np.maximum(values, SINGULAR * values[:, -1:])
    white = np.swapaxes(vectors, 1, 2) / np.sqrt(values)[:, :, None]
    return white * measured[:, None, :]
