"""Residuals in, the error of the time stamps out: what makes residuals grow with the rate.

A stamp that is off by d moves every joint by its rate times d, at once. So the error of the stamps shows as
scatter that grows with the rate, s0^2 + rate^2 st^2, while the error of the picture does not.
"""

from __future__ import annotations

import numpy as np

from monodyn.estimation.record.samples import Data
from monodyn.estimation.verdict.regression import variances

CLEAR = 16.0
"""The scatter of the stamps counts where it raises twice the logarithm of the likelihood by more than this,
which chance does once in ten thousand records."""
RELATED = 1.4
"""Second differences of independent residuals are related to their neighbours; the standard deviation of a
sum of their squares is this much larger for it."""
LEAST_SAMPLES = 12
"""Second differences below which no scatter is looked for; more than there are variances in any case."""


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
    if use.sum() < max(LEAST_SAMPLES, squares.shape[1] + 2):
        return 0.0
    joints = np.nonzero(use)[1]
    # one column a joint for the picture's noise, the last for the stamps'
    design = np.zeros((len(joints), squares.shape[1] + 1))
    design[np.arange(len(joints)), joints], design[:, -1] = basis[0][use], basis[1][use]
    without, _ = variances(squares[use], np.ascontiguousarray(design[:, :-1]))
    both, parts = variances(squares[use], design)
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


def _unlikely(squares: np.ndarray, variance: np.ndarray) -> float:
    """Return minus twice the logarithm of the likelihood of normal samples, but for a constant."""
    return float(np.sum(np.log(variance) + squares / variance))
