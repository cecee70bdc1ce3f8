"""Residuals in, the error of the time stamps out: what makes residuals grow with the rate.

A stamp that is off by d moves every joint by its rate times d, at once. So the error of the stamps shows as
scatter that grows with the rate, s0^2 + rate^2 st^2, while the error of the picture does not.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.estimation.record.samples import Data
from monodyn.solving import eliminate, shortest

ROUNDS = 20
"""Most rounds of the weighted regression; each takes the weights from the last one."""
SETTLED = 1e-4
"""The regression has settled when no variance changes by more than this share."""
CLEAR = 16.0
"""The scatter of the stamps counts where it raises twice the logarithm of the likelihood by more than this,
which chance does once in ten thousand records."""
RELATED = 1.4
"""Second differences of independent residuals are related to their neighbours; the standard deviation of a
sum of their squares is this much larger for it."""
LEAST_SAMPLES = 12
"""Second differences below which no scatter is looked for."""


def stamp_error(data: Data, difference: np.ndarray, rates: np.ndarray) -> float:
    """Estimate the standard deviation of the time stamps.

    The variance of each joint's residuals is a_j s^2 + b v^2 with s the stated deviation and v the rate.
    Second differences of the residuals take their place: a fault of the model changes slowly, an error of a
    stamp does not. The regression is weighted with the variances that it finds.

    Args:
        data: The data, with its stated noise.
        difference: Measured less simulated positions in the record's units, NaN in gaps, (row, dof).
        rates: Simulated rates in the record's units by stamped second, (row, dof).

    Returns:
        The standard deviation sqrt(b) [s]; 0 where it is not clear.

    Source:
        Searle, Casella and McCulloch, Variance Components, 1992, chapter 6 (Fisher scoring).
    """
    record = data.by_row(np.arange(data.records))
    inner = np.equal(record[2:], record[:-2])
    squares, basis = _second_differences(data, difference, rates)
    use = np.isfinite(squares) & inner[:, None]
    if use.sum() < LEAST_SAMPLES:
        return 0.0
    joints = np.nonzero(use)[1]
    # one column a joint for the picture's noise, the last for the stamps'
    design = np.zeros((len(joints), squares.shape[1] + 1))
    design[np.arange(len(joints)), joints], design[:, -1] = basis[0][use], basis[1][use]
    without, _ = _variances(squares[use], design[:, :-1])
    both, parts = _variances(squares[use], design)
    gain = _unlikely(squares[use], without) - _unlikely(squares[use], both)
    return float(np.sqrt(parts[-1])) if gain > CLEAR * RELATED**2 else 0.0


def _second_differences(
    data: Data, difference: np.ndarray, rates: np.ndarray
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Return squared second differences of the residuals, and what s^2 and v^2 add, (row - 2, dof)."""

    def spread(variance: np.ndarray) -> np.ndarray:
        return variance[1:-1] + 0.25 * (variance[:-2] + variance[2:])

    middle = difference[1:-1] - 0.5 * (difference[:-2] + difference[2:])
    return middle**2, (spread(data.std**2), spread(rates**2))


@njit(cache=True)
def _variances(squares: np.ndarray, design: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Regress squares (sample,) on what adds to them, (sample, column), none of it negative.

    Returns:
        The variances (sample,) and the coefficients (column,).
    """
    count, columns = design.shape
    size = np.empty(columns)
    for j in range(columns):
        size[j] = np.sqrt(np.mean(design[:, j] ** 2))
        size[j] = size[j] if size[j] > 0.0 else 1.0
    design = design / size
    found, variance = np.zeros(columns), np.full(count, max(np.mean(squares), 1e-300))
    for _ in range(ROUNDS):
        # the variance of a square is twice its squared mean
        before = found
        found = _not_negative(design / variance.reshape(-1, 1), squares / variance)
        for i in range(count):
            variance[i] = 0.0
            for j in range(columns):
                variance[i] += design[i, j] * found[j]
        variance = np.maximum(variance, 1e-3 * np.mean(variance) + 1e-300)
        if np.all(np.abs(found - before) <= SETTLED * np.maximum(found, before)):
            break
    return variance, found / size


@njit(cache=True)
def _not_negative(design: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return least-squares coefficients (column,) of a design (sample, column), the most negative one set to
    zero until none is."""
    columns = design.shape[1]
    found, kept = np.zeros(columns), np.ones(columns, dtype=np.bool_)
    while kept.any():
        inside = np.flatnonzero(kept)
        normal, right = np.empty((inside.size, inside.size)), np.empty((inside.size, 1))
        for i in range(inside.size):
            right[i, 0] = np.sum(design[:, inside[i]] * values)
            for j in range(inside.size):
                normal[i, j] = np.sum(design[:, inside[i]] * design[:, inside[j]])
        alone = right.copy()
        # columns that are alike share what they explain
        found[inside] = alone[:, 0] if eliminate(normal.copy(), alone) else shortest(normal, right[:, 0])
        if found.min() >= 0.0:
            break
        kept[np.argmin(found)] = False
        found[:] = 0.0
    return found


def _unlikely(squares: np.ndarray, variance: np.ndarray) -> float:
    """Return minus twice the logarithm of the likelihood of normal samples, but for a constant."""
    return float(np.sum(np.log(variance) + squares / variance))
