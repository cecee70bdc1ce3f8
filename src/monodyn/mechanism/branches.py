"""Numba kernels that factor and solve the joint-space inertia matrix along the branches of the tree.

Entries of joints on different branches are zero, and stay zero when the matrix is eliminated from the tips
to the roots, because joint k only changes entries among the joints between it and the root. (Eliminated from
the roots outward, as Cholesky's L L^T does, they would fill.) So every loop walks along parents.

Source: R. Featherstone, Rigid Body Dynamics Algorithms (2008), table 6.3 (LTDL factorization).
"""

from __future__ import annotations

from numba import njit

from monodyn.uncounted import INLINED


@njit(cache=True, error_model="numpy", **INLINED)
def factor(parent, h):  # pragma: no cover - compiled
    """Factor the inertia matrix ``h`` (dof, dof) in place as L^T D L; L is below the diagonal, D on it."""
    # When joint k is reached, rows and columns beyond it are eliminated: h[k, k] is its final pivot.
    for k in range(parent.size - 1, -1, -1):
        i = parent[k]
        while i >= 0:
            ratio = h[k, i] / h[k, k]
            j = i
            while j >= 0:
                # h[k, j] is an entry of the matrix still: ratios replace row k from k inward, after their use
                h[i, j] -= h[k, j] * ratio
                j = parent[j]
            h[k, i] = ratio
            i = parent[i]


@njit(cache=True, error_model="numpy", **INLINED)
def solve(parent, h, x):  # pragma: no cover - compiled
    """Solve L^T D L x = b in place, ``x`` (dof,) holding b, with ``h`` (dof, dof) from ``factor``."""
    # L^T is solved from the tips inward, D and L from the roots outward.
    for i in range(parent.size - 1, -1, -1):
        j = parent[i]
        while j >= 0:
            x[j] -= h[i, j] * x[i]
            j = parent[j]
    for i in range(parent.size):
        x[i] /= h[i, i]
        j = parent[i]
        while j >= 0:
            x[i] -= h[i, j] * x[j]
            j = parent[j]


@njit(cache=True, error_model="numpy", **INLINED)
def solve_all(parent, h, x, count):  # pragma: no cover - compiled
    """Solve as ``solve`` does, for the first ``count`` columns of ``x`` (dof, column)."""
    for i in range(parent.size - 1, -1, -1):
        j = parent[i]
        while j >= 0:
            for k in range(count):
                x[j, k] -= h[i, j] * x[i, k]
            j = parent[j]
    for i in range(parent.size):
        for k in range(count):
            x[i, k] /= h[i, i]
        j = parent[i]
        while j >= 0:
            for k in range(count):
                x[i, k] -= h[i, j] * x[j, k]
            j = parent[j]
