"""The least-squares problem of the 2012 paper: start states held at the filtered ones, poses unweighted.

The default problem has the start states among its unknowns; here they are given, and all that is left is one
rollout a record.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from monodyn.estimation.record.samples import Data, Pieces
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.verdict.uncertainty import Knowledge
from monodyn.paper.filter import FIRST, Filtered, parabola

STEP = 1e-6
"""Step of the differences that the covariance rests on, in scales of the unknowns."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Held(Problem):
    """One identification with held start states.

    Attributes:
        held: Filtered state at the first row of each record, in its units by stamped time, (record, 2 dof).
        target: Positions, or positions and rates, that are compared, NaN where there are none,
            (row, dof or 2 dof).
        white: Whitening matrices of the target, (row, column, column), or None for a plain difference.
        change: Typical change of each unknown's coordinate, (param,).
        substeps: Integration steps between stamps.
        response: The filter of each record, each (frame, 2, dof, frame); none to compare measured angles
            alone. With rates the simulated positions go through it as the measured ones did.
        filtered: True to compare filtered angles, False for measured ones.
        noise: Standard deviation of a residual, by which those of ``rows`` are divided.
    """

    held: np.ndarray
    target: np.ndarray
    white: np.ndarray | None
    change: np.ndarray
    substeps: int
    response: tuple[np.ndarray, ...] = ()
    filtered: bool = False
    noise: float = 1.0

    @property
    def pieces(self) -> Pieces:
        """One piece a record."""
        return Pieces(self.data.first, np.arange(len(self.data.first) - 1))

    def stretch(self, x: np.ndarray) -> float:
        """Return the true seconds per stamped second."""
        return self._clock if "time_scale" not in self.unknowns.names else super().stretch(x)

    @cached_property
    def _clock(self) -> float:
        return self.mechanism.values["time_scale"]

    def states(self, x: np.ndarray) -> np.ndarray:
        """Return the start states at coordinates ``x`` [rad or m], by true time, (record, 2 dof)."""
        unit = np.where(self.data.slide, self.size(x), 1.0)
        return self.held * np.concatenate((unit, unit / self.stretch(x)), axis=1)

    def motion(self, x: np.ndarray) -> np.ndarray:
        """Return the simulated positions in the records' units, (row, dof)."""
        ends = zip(self.data.first[:-1], self.data.first[1:], self.states(x), strict=True)
        q = self.rollouts(x, list(ends), self.substeps)
        if not self.data.slide.any():
            return q
        return q / np.repeat(np.where(self.data.slide, self.size(x), 1.0), np.diff(self.data.first), axis=0)

    def residuals_at(self, x: np.ndarray) -> np.ndarray:
        """Return X_s - X_e, whitened with rates, 0 where nothing was measured, (row, column)."""
        simulated = self.motion(x)
        if self.white is not None:
            simulated = self._through_filter(simulated)
        difference = np.where(np.isfinite(self.target), simulated - self.target, 0.0)
        return difference if self.white is None else np.einsum("fij,fj->fi", self.white, difference)

    def start_rows(self, x: np.ndarray) -> np.ndarray:
        """Return the Jacobian of ``residuals_at`` by the entries of ``held``, (row, column, entry)."""
        slopes = []
        for entry in np.ndindex(self.held.shape):
            ends = []
            for step in (STEP, -STEP):
                moved = self.held.copy()
                moved[entry] += step
                ends.append(replace(self, held=moved).residuals_at(x))
            slopes.append((ends[0] - ends[1]) / (2.0 * STEP))
        return np.stack(slopes, axis=-1)

    def _through_filter(self, position: np.ndarray) -> np.ndarray:
        """Angles and rates as the filter makes them of positions (row, dof), (row, 2 dof)."""
        rows, dofs = position.shape
        found = np.full((rows, 2 * dofs), np.nan)
        for first, stop, response in zip(
            self.data.first[:-1], self.data.first[1:], self.response, strict=True
        ):
            of = first + np.flatnonzero(self.data.source[first:stop] >= 0)
            at = self.data.source[of]
            part = response[np.ix_(at, np.arange(2), np.arange(dofs), at)]
            found[of] = np.einsum("fsde,ed->fsd", part, position[of]).reshape(len(of), 2 * dofs)
        if not self.filtered:
            found[:, :dofs] = position
        return found

    def rows(
        self, x: np.ndarray, states: np.ndarray, pieces: Pieces, substeps: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the residuals in standard deviations and their Jacobian by the unknowns alone.

        Central differences: (row, column) and (row, column, param).
        """
        base = self.residuals_at(x)
        jacobian = np.zeros((*base.shape, len(x)))
        for p, step in enumerate(STEP * self.change):
            low, high = x.copy(), x.copy()
            low[p], high[p] = x[p] - step, x[p] + step
            low, high = (np.clip(end, self.unknowns.lower, self.unknowns.upper) for end in (low, high))
            if high[p] > low[p]:
                ahead, behind = self.residuals_at(high), self.residuals_at(low)
                jacobian[:, :, p] = (ahead - behind) / (high[p] - low[p])
        return base / self.noise, jacobian / self.noise


def held_states(data: Data, filtered: tuple[Filtered, ...]) -> np.ndarray:
    """Return the filtered state at the first row of each record, (record, 2 dof).

    A joint that is seen later than the first row goes back to it with constant acceleration.

    Args:
        data: The measurements.
        filtered: Filtered motion of each record, on the record's own rows.
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

    Angles alone are compared as they are, as in the paper. With rates the difference is weighted with the
    inverse covariance: that of the filter, or with measured angles that of the measurement beside the
    filter's of the rates. That covariance knows nothing of the filter's lag, which is why the simulated
    positions then pass the same filter (``Held.response``).

    Args:
        data: The measurements.
        filtered: Filtered motion of each record with its covariance, on the record's own rows.
        states: ``measured`` or ``filtered``.
        rates: True to compare rates as well.

    Returns:
        Target, NaN where there is none, (row, dof or 2 dof); whitening (row, column, column) or None.
    """
    source, record = data.source, np.repeat(np.arange(len(data.first) - 1), np.diff(data.first))
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
    values = np.maximum(values, 1e-10 * values[:, -1:])
    white = np.swapaxes(vectors, 1, 2) / np.sqrt(values)[:, :, None]
    return white * measured[:, None, :]


def start_response(data: Data) -> np.ndarray:
    """Return what a one in each sample adds to the start states of ``held_states``, (entry, row, dof).

    Args:
        data: The measurements; every joint at least three times in each record.
    """
    dofs, records = data.position.shape[1], len(data.first) - 1
    found = np.zeros((records, 2, dofs, *data.position.shape))
    for k, (first, stop) in enumerate(zip(data.first[:-1], data.first[1:], strict=True)):
        for dof in range(dofs):
            head = first + np.flatnonzero(data.measured[first:stop, dof])[:FIRST]
            back = data.times[first] - data.times[head[0]]
            carry = np.array([[1.0, back, 0.5 * back**2], [0.0, 1.0, back]])
            found[k, :, dof, head, dof] = (carry @ parabola(data.times[head])).T
    return found.reshape(records * 2 * dofs, *data.position.shape)


def target_response(held: Held) -> np.ndarray:
    """Return what a one in each sample adds to the whitened target, (row, column, row, dof).

    Args:
        held: The problem.
    """
    (rows, dofs), columns = held.data.position.shape, held.target.shape[1]
    found = np.zeros((rows, columns, rows, dofs))
    record = np.repeat(np.arange(len(held.data.first) - 1), np.diff(held.data.first))
    for k, response in enumerate(held.response):
        of = np.flatnonzero((record == k) & (held.data.source >= 0))
        at = held.data.source[of]
        part = response[np.ix_(at, np.arange(columns // dofs), np.arange(dofs), at)]
        for dof in range(dofs):
            for state in range(columns // dofs):
                found[np.ix_(of, np.array([state * dofs + dof]), of, np.array([dof]))] = part[:, state, dof][
                    :, None, :, None
                ]
    if not held.filtered:
        found[:, :dofs] = np.eye(rows * dofs).reshape(rows, dofs, rows, dofs)
    found *= np.isfinite(held.target)[:, :, None, None]
    if held.white is not None:
        found = np.einsum("fij,fjed->fied", held.white, found, optimize=True)
    return found


def with_start_noise(held: Held, x: np.ndarray, known: Knowledge) -> Knowledge:
    """Let the noise of the samples act on the parameters both directly and by way of the start state.

    Samples y with noise e have the start state s = P y and the target L y, both linear. At the optimum the
    parameters change by A J' (L - J_s P) e with A = (J' J)^-1, and with the covariance R of the samples

        C_s = P R P', C_ps = A J' (L - J_s P) R P', C_p = A J' (L - J_s P) R (L - J_s P)' J A.

    For a start state that is independent of the target this is A (J' R J + J' J_s C_s J_s' J) A and
    -A J' J_s C_s. R is the stated covariance, or larger by the factor that makes the residuals as large as
    expected. The parabola through three samples misses what the motion has of third order: the error that
    it makes of the simulated motion counts as one more source.

    Args:
        held: The problem, ``noise`` the size of a residual.
        x: Coordinates of the optimum, (param,).
        known: What would be known with the start state exact: its ``covariance`` is A.

    Returns:
        The knowledge with covariances of parameters and start states.
    """
    data, count = held.data, len(x)
    samples = data.position.size
    residuals, jacobian = held.rows(x, held.states(x), held.pieces, held.substeps)
    jacobian = jacobian.reshape(-1, count)
    by_start = held.start_rows(x).reshape(len(jacobian), -1) / held.noise
    starts = start_response(data).reshape(-1, samples)
    cov = _stated(data)
    if held.response:
        direct = target_response(held).reshape(-1, samples) / held.noise
        along, plain = jacobian.T @ direct, float(np.sum(_times(direct, cov) * direct))
        shared = np.sum((_times(starts, cov) @ direct.T) * by_start.T)
    else:
        along = jacobian.T / held.noise
        plain = float(np.trace(cov, axis1=1, axis2=2).sum()) / held.noise**2
        shared = np.sum(_times(starts, cov) * by_start.T) / held.noise
    spread = _times(starts, cov) @ starts.T
    whole = along - jacobian.T @ by_start @ starts
    change = known.covariance @ whole
    left = plain - 2.0 * float(shared) + float(np.sum((by_start @ spread) * by_start))
    left -= float(np.sum((_times(whole, cov) @ whole.T) * known.covariance))
    larger = max(float(np.sum(residuals**2)) / max(left, 1e-300), 1.0) if len(jacobian) > count else 1.0
    ways = np.concatenate((change, starts))
    found = larger * (_times(ways, cov) @ ways.T)
    missed = starts @ np.where(data.measured, held.motion(x), 0.0).ravel() - held.held.ravel()
    missed = np.concatenate((-known.covariance @ (jacobian.T @ (by_start @ missed)), missed))
    found += np.outer(missed, missed)
    carry = _carry(held, x)
    full = carry @ found @ carry.T
    own = full[:count, :count]
    std = np.where(np.isfinite(known.std), np.sqrt(np.diag(own)), np.inf)
    return replace(known, covariance=own, std=std, full=0.5 * (full + full.T))


def _stated(data: Data) -> np.ndarray:
    """Stated covariance of each row's samples, 0 where there are none, (row, dof, dof)."""
    both = data.measured[:, :, None] & data.measured[:, None, :]
    gaps = np.eye(data.measured.shape[1]) * ~data.measured[:, None, :]
    return np.where(both, np.linalg.inv(np.swapaxes(data.white, 1, 2) @ data.white + gaps), 0.0)


def _times(ways: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Responses to the samples (way, sample) times their covariance (row, dof, dof)."""
    rows, dofs = covariance.shape[:2]
    return np.einsum("wrd,rde->wre", ways.reshape(-1, rows, dofs), covariance).reshape(ways.shape)


def _carry(held: Held, x: np.ndarray) -> np.ndarray:
    """Change of parameters and start states [rad or m] by that of parameters and ``held.held``."""
    count, names = len(x), held.unknowns.names
    states = held.states(x)
    dofs = states.shape[1] // 2
    slide = np.tile(held.data.slide, 2)
    clock = np.array([name == "time_scale" for name in names], dtype=float)
    grow = slide[:, :, None] * held.prior.weights
    grow = grow - np.repeat([0.0, 1.0], dofs)[:, None] * clock
    unit = np.where(held.data.slide, held.size(x), 1.0)
    unit = np.concatenate((unit, unit / held.stretch(x)), axis=1)
    carry = np.eye(count + states.size)
    carry[count:, :count] = (states[:, :, None] * grow).reshape(-1, count)
    carry[count:, count:] = np.diag(unit.ravel())
    return carry
