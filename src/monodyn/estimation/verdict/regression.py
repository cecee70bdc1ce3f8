"""numba kernels: the variances that parts of a scatter have, none of them negative."""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.solving import eliminate, shortest

ROUNDS = 20
"""Most rounds of the weighted regression; each takes the weights from the last one."""
SETTLED = 1e-4
"""The regression has settled when no variance changes by more than this share."""


@njit(cache=True)
def variances(squares: np.ndarray, design: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Regress squares of normal samples on what adds to their variance.

    Args:
        squares: The squares, (sample,).
        design: What each part adds to their mean, (sample, column).

    Returns:
        The variances (sample,), and the coefficients (column,), none of them negative.
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
        found = not_negative(design / variance.reshape(-1, 1), squares / variance)
        for i in range(count):
            variance[i] = 0.0
            for j in range(columns):
                variance[i] += design[i, j] * found[j]
        variance = np.maximum(variance, 1e-3 * np.mean(variance) + 1e-300)
        if np.all(np.abs(found - before) <= SETTLED * np.maximum(found, before)):
            break
    return variance, found / size


@njit(cache=True)
def not_negative(design: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the coefficients of least squares, the most negative one set to zero until none is.

    Args:
        design: What they are the coefficients of, (sample, column).
        values: What is explained, (sample,).

    Returns:
        The coefficients, (column,).
    """
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
        # those that are left out stay at this
        found[:] = 0.0
    return found
