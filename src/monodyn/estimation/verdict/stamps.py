"""Residuals in, the error of the time stamps out: what makes residuals grow with the rate.

A stamp that is off by d moves every joint by its rate times d, at once. So the error of the stamps shows as
scatter that grows with the rate, s0^2 + rate^2 st^2, while the error of the picture does not.
"""

from __future__ import annotations

import numpy as np

from monodyn.estimation.record.samples import Data

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


def _variances(squares: np.ndarray, design: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Regress squares on what adds to them, none of it negative.

    Returns:
        The variances (sample,) and the coefficients (column,).
    """
    size = np.sqrt(np.mean(design**2, axis=0))
    design = design / np.where(size > 0, size, 1.0)
    found, variance = np.zeros(design.shape[1]), np.full(len(squares), max(float(np.mean(squares)), 1e-300))
    for _ in range(ROUNDS):
        # the variance of a square is twice its squared mean
        before, found = found, _not_negative(design / variance[:, None], squares / variance)
        variance = np.maximum(design @ found, 1e-3 * float(np.mean(design @ found)) + 1e-300)
        if np.all(np.abs(found - before) <= SETTLED * np.maximum(found, before)):
            break
    return variance, found / np.where(size > 0, size, 1.0)


def _not_negative(design: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return least-squares coefficients (column,) of a design (sample, column), the most negative one set to
    zero until none is."""
    # for so few columns; importing a library's solver takes longer than the whole fit
    found, kept = np.zeros(design.shape[1]), np.ones(design.shape[1], dtype=bool)
    while kept.any():
        found[kept] = np.linalg.lstsq(design[:, kept], values, rcond=None)[0]
        if found.min() >= 0.0:
            break
        kept[np.argmin(found)] = False
        found[~kept] = 0.0
    return found


def _unlikely(squares: np.ndarray, variance: np.ndarray) -> float:
    """Return minus twice the logarithm of the likelihood of normal samples, but for a constant."""
    return float(np.sum(np.log(variance) + squares / variance))
