"""Kernels: small systems of linear equations, for other kernels and without a library.

Numba calls LAPACK by way of scipy, of which the program needs nothing else. A matrix of ten rows costs less
here than one call of LAPACK.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.uncounted import UNCOUNTED

SINGULAR = 1e-12
"""Share of the largest eigenvalue below which there is none, in a system without one solution."""
TURNED = 60
"""Rounds of turns at most; Jacobi's method takes about ten."""


@njit(cache=True, error_model="numpy", nogil=True, **UNCOUNTED)
def eliminate(matrix: np.ndarray, right: np.ndarray) -> bool:  # pragma: no cover - compiled
    """Solve a system in place, by Gauss's elimination with the largest pivot of each column.

    Args:
        matrix: The matrix, (row, row); it is lost.
        right: The right sides, (row, column), which become the solutions.

    Returns:
        False where a pivot is zero or no number, and ``right`` is not solved.
    """
    size, columns = right.shape
    for k in range(size):
        pivot = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        if not abs(matrix[pivot, k]) > 0.0:
            return False
        if pivot != k:
            for j in range(k, size):
                matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
            for j in range(columns):
                right[k, j], right[pivot, j] = right[pivot, j], right[k, j]
        for i in range(k + 1, size):
            share = matrix[i, k] / matrix[k, k]
            if share != 0.0:
                for j in range(k + 1, size):
                    matrix[i, j] -= share * matrix[k, j]
                for j in range(columns):
                    right[i, j] -= share * right[k, j]
    for k in range(size - 1, -1, -1):
        for j in range(columns):
            for i in range(k + 1, size):
                right[k, j] -= matrix[k, i] * right[i, j]
            right[k, j] /= matrix[k, k]
    return True


@njit(cache=True, error_model="numpy", nogil=True)
def solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:  # pragma: no cover - compiled
    """Return the solution of a system.

    Args:
        matrix: The matrix, (row, row).
        right: The right side, (row,).

    Returns:
        The solution, (row,); NaN where the matrix is singular.
    """
    found = right.copy().reshape(-1, 1)
    if not eliminate(matrix.copy(), found):
        found[:] = np.nan
    return found[:, 0]


@njit(cache=True, error_model="numpy", nogil=True)
def inverted(matrix: np.ndarray) -> np.ndarray:  # pragma: no cover - compiled
    """Return the inverse of a matrix.

    Args:
        matrix: The matrix, (row, row).

    Returns:
        Its inverse, (row, row); NaN where it is singular.
    """
    found = np.eye(matrix.shape[0])
    if not eliminate(matrix.copy(), found):
        found[:] = np.nan
    return found


@njit(cache=True, error_model="numpy", nogil=True)
def product(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:  # pragma: no cover - compiled
    """Return the product of a matrix and a vector.

    Args:
        matrix: The matrix, (row, column).
        vector: The vector, (column,).

    Returns:
        The product, (row,).
    """
    found = np.zeros(matrix.shape[0])
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            found[i] += matrix[i, j] * vector[j]
    return found


@njit(cache=True, error_model="numpy")
def shortest(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:  # pragma: no cover - compiled
    """Return the shortest of the vectors that solve a system as well as any, by its eigenvectors.

    Args:
        matrix: A symmetric matrix, finite, (row, row).
        right: The right side, (row,).

    Returns:
        The solution, (row,).

    Source:
        Jacobi's cyclic turns: Golub and Van Loan, Matrix Computations, 2013, section 8.5.
    """
    size = right.size
    a, vectors = matrix.copy(), np.eye(size)
    for _ in range(TURNED):
        beside = largest = 0.0
        for i in range(size):
            largest = max(largest, abs(a[i, i]))
            for j in range(i + 1, size):
                beside = max(beside, abs(a[i, j]))
        if beside <= 1e-17 * largest:
            break
        for p in range(size):
            for q in range(p + 1, size):
                if a[p, q] == 0.0:
                    continue
                # the smaller of the two turns that bring a[p, q] to zero
                theta = 0.5 * (a[q, q] - a[p, p]) / a[p, q]
                t = (1.0 if theta >= 0.0 else -1.0) / (abs(theta) + np.sqrt(1.0 + theta * theta))
                c = 1.0 / np.sqrt(1.0 + t * t)
                s = t * c
                for k in range(size):
                    a[k, p], a[k, q] = c * a[k, p] - s * a[k, q], s * a[k, p] + c * a[k, q]
                for k in range(size):
                    a[p, k], a[q, k] = c * a[p, k] - s * a[q, k], s * a[p, k] + c * a[q, k]
                for k in range(size):
                    vectors[k, p], vectors[k, q] = (
                        c * vectors[k, p] - s * vectors[k, q],
                        s * vectors[k, p] + c * vectors[k, q],
                    )
    found, least = np.zeros(size), 0.0
    for i in range(size):
        least = max(least, SINGULAR * abs(a[i, i]))
    for i in range(size):
        if abs(a[i, i]) > least:
            share = 0.0
            for k in range(size):
                share += vectors[k, i] * right[k]
            for k in range(size):
                found[k] += vectors[k, i] * share / a[i, i]
    return found


@njit(cache=True, error_model="numpy")
def banded_root(bands: np.ndarray) -> np.ndarray:  # pragma: no cover - compiled
    """Return the Cholesky root U of a banded matrix U'U.

    Args:
        bands: The symmetric positive definite matrix by diagonals, (band, column): its own in the last row,
            and in the row before each next one above it, as long as it is and at the end of its row.

    Returns:
        The root, likewise; NaN where the matrix is not positive definite.
    """
    root, width = bands.copy(), bands.shape[0] - 1
    for j in range(bands.shape[1]):
        for i in range(max(j - width, 0), j + 1):
            # what rows above i add to the entry (i, j)
            for k in range(max(j - width, 0), i):
                root[width + i - j, j] -= root[width + k - i, i] * root[width + k - j, j]
            if i < j:
                root[width + i - j, j] /= root[width, i]
        root[width, j] = np.sqrt(root[width, j])
    return root


@njit(cache=True, error_model="numpy")
def banded_solved(root: np.ndarray, right: np.ndarray) -> np.ndarray:  # pragma: no cover - compiled
    """Return the solutions of a system from its root.

    Args:
        root: As ``banded_root`` returns it, (band, column).
        right: The right sides, (column, side).

    Returns:
        The solutions, (column, side).
    """
    found, width, size = right.copy(), root.shape[0] - 1, root.shape[1]
    for s in range(right.shape[1]):
        for j in range(size):
            for k in range(max(j - width, 0), j):
                found[j, s] -= root[width + k - j, j] * found[k, s]
            found[j, s] /= root[width, j]
        for j in range(size - 1, -1, -1):
            for k in range(j + 1, min(j + width + 1, size)):
                found[j, s] -= root[width + j - k, k] * found[k, s]
            found[j, s] /= root[width, j]
    return found
