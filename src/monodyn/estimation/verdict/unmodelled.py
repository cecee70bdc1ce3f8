"""What a model lacks, as random accelerations: how far the motion goes astray of the identified one.

Where residuals are larger than the noise and change slowly, the motion is not exactly that of the mechanism.
About the identified motion its state then wanders: accelerations push it at random, and the mechanism's own
dynamics carry the error on. A Kalman filter over the residuals tells how strong these accelerations are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from monodyn.arrays import usual_step
from monodyn.estimation.parts import Unmodelled
from monodyn.estimation.verdict.refine import Refined

LARGER, SLOWER = 2.0, 1.5
"""Residuals over the part of them that changes from row to row, and root of what their autocorrelation costs,
above which the model lacks something."""
LEAST_NOISE = 1e-3
"""Least noise over the stated one: a record may state too much, but rows that rest are not exact."""
STRIDES = (1, 2)
"""Rows from one to the next by which noise is told from what changes slowly: a filter may have smoothed that
of neighbours."""
DENSITIES = 10.0 ** np.arange(-6.0, 3.01, 0.25)
"""Densities that are tried, over the variance of the residuals by the time between stamps to the third."""
SWEEPS = 2
"""Times that the joints are gone through."""
UNKNOWN = 1e4
"""Variance of the state at the beginning of a record, over that of the residuals."""


@dataclass(frozen=True, eq=False)
class Wander:
    """What is needed to carry an error of the state along a motion which random accelerations push.

    Attributes:
        variance: Of the noise from row to row [rad^2 or m^2], NaN where not measured, (row, dof).
        carried: Derivative of the state at a row by that at the row before, (row, 2 dof, 2 dof).
        steps: Time since the row before [s], (row,).
        begins: True where a record begins, (row,).
        unknown: Variance of positions, then rates where a record begins [SI], (2 dof,).
    """

    variance: np.ndarray
    carried: np.ndarray
    steps: np.ndarray
    begins: np.ndarray
    unknown: np.ndarray

    def innovations(self, moved: np.ndarray, density: np.ndarray) -> tuple[np.ndarray, float]:
        """Return what is new in each row, in its standard deviations, and the logarithm of the density of
        all rows for that of deviations of one.

        Args:
            moved: Positions, each column by itself [rad or m], (row, dof, column).
            density: Spectral density of each joint's random acceleration [rad^2/s^3 or m^2/s^3], (dof,).

        Returns:
            The innovations, (row, dof, column), zero where not measured; minus the sum of the logarithms of
            their deviations.
        """
        new, logarithm, _ = self._filtered(moved, density)
        return new, logarithm

    def error(self, residual: np.ndarray, density: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the logarithm of the likelihood of residuals but for a constant, and the mean square of the
        state's error [SI], (2 dof, 2 dof).

        Args:
            residual: Residuals [rad or m], (row, dof).
            density: As in ``innovations``, (dof,).
        """
        new, logarithm, square = self._filtered(residual[..., None], density)
        return logarithm - 0.5 * float(np.sum(new**2)), square

    def _filtered(self, moved: np.ndarray, density: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
        moved = np.ascontiguousarray(np.nan_to_num(moved))
        return _filtered(moved, self.variance, self.carried, self.steps, self.begins, density, self.unknown)


def wander(found: Refined) -> tuple[Wander, np.ndarray]:
    """Return what carries an error of the state along the motion of a fit, and the residuals of this
    [rad or m], NaN in gaps, (row, dof).

    Args:
        found: The optimum, one piece a record.
    """
    problem, trial = found.problem, found.optimum.trial
    data = problem.data
    unit = data.by_row(np.where(data.slide, problem.size(trial.x), 1.0))
    residual = problem.differences(trial) * unit
    # what is no motion at all changes from row to row
    white = noise_of_rows(residual, np.where(data.measured, data.std, np.nan) * unit)
    clock, carried = found.carried_along
    begins = np.zeros(len(clock), dtype=np.bool_)
    begins[trial.pieces.first[:-1]] = True
    spread = np.nanmean(residual**2, axis=0)
    unknown = UNKNOWN * spread / usual_step(clock) ** 2
    return Wander(white**2, carried, np.diff(clock, prepend=clock[0]), begins, np.tile(unknown, 2)), residual


def unmodelled(found: Refined) -> Unmodelled | None:
    """Find the random accelerations that explain the residuals of a fit.

    Args:
        found: The optimum, one piece a record, and how its residuals compare with the stated noise.

    Returns:
        The accelerations of highest likelihood; None where the noise explains the residuals.

    Source:
        Maximum likelihood of a linear stochastic system by the innovations of its Kalman filter: Åström and
        Källström, Identification of ship steering dynamics, 1976.
    """
    noise = found.noise
    if not np.any(noise.correlation > SLOWER):
        return None
    about, residual = wander(found)
    larger = np.sqrt(np.nanmean(residual**2 / about.variance, axis=0)) > LARGER
    if not np.any(larger & (noise.correlation > SLOWER)):
        return None
    spread, pace = np.nanmean(residual**2, axis=0), usual_step(found.carried_along[0])
    density = np.zeros(len(spread))
    for _ in range(SWEEPS):
        for dof in range(len(density)):
            tried = np.repeat(density[np.newaxis], 1 + len(DENSITIES), axis=0)
            tried[:, dof] = np.append(0.0, DENSITIES * spread[dof] / pace**3)
            density = tried[int(np.argmax([about.error(residual, row)[0] for row in tried]))]
    _, off = about.error(residual, density)
    return Unmodelled(density, off) if density.any() else None


def noise_of_rows(residual: np.ndarray, stated: np.ndarray) -> np.ndarray:
    """Return the part of the residuals that changes from row to row [rad or m], (row, dof).

    Args:
        residual: Residuals, NaN where not measured, (row, dof).
        stated: The stated noise, whose size may be wrong, (row, dof).

    Returns:
        The deviation, in proportion to what is stated, and NaN where not measured.
    """
    white = stated.copy()
    for dof in range(residual.shape[1]):
        relative = residual[:, dof] / stated[:, dof]
        # second differences of what changes slowly vanish, those of noise have six times its variance
        parts = [
            relative[2 * stride :] - 2.0 * relative[stride:-stride] + relative[: -2 * stride]
            for stride in STRIDES
        ]
        known = [part[np.isfinite(part)] for part in parts]
        sizes = [np.sqrt(np.median(part**2) / 0.4549 / 6.0) for part in known if len(part)]
        if sizes:
            white[:, dof] *= max(LEAST_NOISE, *map(float, sizes))
    return white


@njit(cache=True, nogil=True)
def _filtered(
    moved: np.ndarray,
    variance: np.ndarray,
    carried: np.ndarray,
    steps: np.ndarray,
    begins: np.ndarray,
    density: np.ndarray,
    unknown: np.ndarray,
) -> tuple[np.ndarray, float, np.ndarray]:
    """Return innovations in their deviations (row, dof, column), minus the sum of the logarithms of these
    deviations, and the mean square of the state's error as the first column has it, (state, state).

    ``moved`` is (row, dof, column), ``variance`` (row, dof), NaN in gaps; ``carried`` (row, state, state) has
    the derivative of the state at a row by that at the row before, ``unknown`` (state,) the variance
    of the state where a record begins.

    Source:
        Bierman, Factorization methods for discrete sequential estimation, 1977, chapter 2 (the update of
        Potter).
    """
    rows, dofs, columns = moved.shape
    state, error, new = 2 * dofs, np.zeros((2 * dofs, columns)), np.zeros((rows, dofs, columns))
    # the covariance is carried as a root, times its transpose: rounding along a motion that runs away would
    # make one itself negative
    root, square = np.zeros((state, state)), np.zeros((state, state))
    logarithm, counted = 0.0, 0
    for row in range(rows):
        if begins[row]:
            error[:], root[:] = 0.0, 0.0
            for i in range(state):
                root[i, i] = math.sqrt(unknown[i])
        else:
            error = _product(carried[row], error)
            root = _product(carried[row], root)
            if density.any():
                root = _pushed_on(root, density, steps[row])
        for j in range(dofs):
            if not math.isnan(variance[row, j]):
                total = _measured(moved[row, j], variance[row, j], j, error, root, new[row, j])
                logarithm -= 0.5 * math.log(total)
        # the first rows of a record only find its state
        if row >= 4 * dofs and not begins[max(0, row - 4 * dofs) : row + 1].any():
            for i in range(state):
                for k in range(state):
                    square[i, k] += error[i, 0] * error[k, 0]
                    for m in range(state):
                        square[i, k] += root[i, m] * root[k, m]
            counted += 1
    return new, logarithm, square / max(counted, 1)


@njit(cache=True, nogil=True)
def _product(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the product of matrices so small that a library's takes many times as long."""
    found = np.zeros((left.shape[0], right.shape[1]))
    for i in range(left.shape[0]):
        for k in range(left.shape[1]):
            for c in range(right.shape[1]):
                found[i, c] += left[i, k] * right[k, c]
    return found


@njit(cache=True, nogil=True)
def _measured(
    moved: np.ndarray, variance: float, j: int, error: np.ndarray, root: np.ndarray, new: np.ndarray
) -> float:
    """Take up the position of joint ``j``, (column,), in the error (state, column) and the root of its
    covariance (state, state); fill what is new in it (column,), and return the variance of that."""
    state, along = len(root), root[j].copy()
    total = variance + np.sum(along**2)
    share = 1.0 / (1.0 + math.sqrt(variance / total))
    for c in range(len(moved)):
        new[c] = (moved[c] - error[j, c]) / math.sqrt(total)
    for i in range(state):
        gain = np.sum(root[i] * along) / total
        for c in range(len(moved)):
            error[i, c] += gain * math.sqrt(total) * new[c]
        for k in range(state):
            root[i, k] -= share * gain * along[k]
    return total


@njit(cache=True, nogil=True)
def _pushed_on(root: np.ndarray, density: np.ndarray, step: float) -> np.ndarray:
    """Return a root of the covariance with what random accelerations add in a step: the triangle whose
    product with its transpose is that of all their roots side by side, whose rows are made orthogonal."""
    state, dofs = len(root), len(density)
    wide, triangle = np.zeros((state, 2 * state)), np.zeros((state, state))
    wide[:, :state] = root
    for j in range(dofs):
        spread = math.sqrt(density[j] * step)
        wide[j, state + j] = spread * step / math.sqrt(3.0)
        wide[dofs + j, state + j] = spread * math.sqrt(3.0) / 2.0
        wide[dofs + j, state + dofs + j] = spread / 2.0
    for i in range(state):
        length = np.sum(wide[i] ** 2)
        triangle[i, i] = math.sqrt(length)
        if length == 0.0:
            continue
        for k in range(i + 1, state):
            shared = np.sum(wide[k] * wide[i])
            triangle[k, i] = shared / triangle[i, i]
            wide[k] -= shared / length * wide[i]
    return triangle
