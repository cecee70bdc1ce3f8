"""Numba kernels: one damped, bounded step on normal equations with the shape of an arrow.

Matrices of ten unknowns cost less to solve than one call of a library from Python costs, and a search makes
some hundred steps.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.solving import eliminate, shortest
from monodyn.uncounted import UNCOUNTED

TINY = 1e-300
"""Least of what roots are taken of and what is divided by."""


@njit(cache=True, error_model="numpy")
def finite(hessian, gradient, cross, local_hessian, local_gradient):  # pragma: no cover - compiled
    """Return whether nothing in a model is NaN or infinite; arrays as in ``levenberg.Arrow``."""
    for part in (hessian.ravel(), gradient, cross.ravel(), local_hessian.ravel(), local_gradient.ravel()):
        for value in part:
            if not np.isfinite(value):
                return False
    return True


@njit(cache=True)
def diagonals(hessian, local_hessian):  # pragma: no cover - compiled
    """Return the diagonals (shared,) and (block, local) of a model's blocks, 1 for an unknown without
    influence; arrays as in ``levenberg.Arrow``."""
    size, (blocks, width, _) = hessian.shape[0], local_hessian.shape
    shared, local = np.ones(size), np.ones((blocks, width))
    for s in range(size):
        if hessian[s, s] > 0.0:
            shared[s] = hessian[s, s]
    for b in range(blocks):
        for i in range(width):
            if local_hessian[b, i, i] > 0.0:
                local[b, i] = local_hessian[b, i, i]
    return shared, local


@njit(cache=True, error_model="numpy")
def damped_step(
    hessian, gradient, cross, local_hessian, local_gradient, damping, scale, local_scale, below, above
):  # pragma: no cover - compiled
    """Solve one damped, bounded step; arrays as in ``levenberg.damped_step``.

    Returns:
        Shared step (shared,), local step (block, local), and the predicted decrease, NaN where a block is
        singular.
    """
    size, (blocks, width) = gradient.size, local_gradient.shape
    reduced, right = hessian.copy(), gradient.copy()
    solved = np.zeros((blocks, width, size + 1))
    step, local_step = np.zeros(size), np.zeros((blocks, width))
    for s in range(size):
        reduced[s, s] += damping * scale[s]
    # With A the shared, C the local and B the cross block, the local step is -C^-1 (c + B' d), so that the
    # shared step solves the Schur complement (A - B C^-1 B') d = -(a - B C^-1 c): C is inverted by blocks.
    for b in range(blocks):
        block = local_hessian[b].copy()
        for i in range(width):
            block[i, i] += damping * local_scale[b, i]
            for s in range(size):
                solved[b, i, s] = cross[b, s, i]
            solved[b, i, size] = local_gradient[b, i]
        # as good as no damping leaves a block singular whose start state nothing determines
        if not eliminate(block, solved[b]):
            return step, local_step, np.nan
        for s in range(size):
            for i in range(width):
                right[s] -= cross[b, s, i] * solved[b, i, size]
                for t in range(size):
                    reduced[s, t] -= cross[b, s, i] * solved[b, i, t]
    _bounded_solve(reduced, right, below, above, step)
    # The local unknowns have no bounds, so that they follow the bounded shared step exactly. The prediction
    # is that of the undamped model: the damping is no part of the cost.
    predicted = 0.0
    for s in range(size):
        slope = gradient[s]
        for t in range(size):
            slope += 0.5 * hessian[s, t] * step[t]
        predicted -= slope * step[s]
    for b in range(blocks):
        for i in range(width):
            local_step[b, i] = -solved[b, i, size]
            for s in range(size):
                local_step[b, i] -= solved[b, i, s] * step[s]
        for i in range(width):
            slope = local_gradient[b, i]
            for j in range(width):
                slope += 0.5 * local_hessian[b, i, j] * local_step[b, j]
            for s in range(size):
                slope += cross[b, s, i] * step[s]
            predicted -= slope * local_step[b, i]
    # a step beyond all bounds promises nothing
    return step, local_step, predicted if np.isfinite(predicted) else np.nan


@njit(cache=True, error_model="numpy")
def _bounded_solve(hessian, gradient, below, above, step):  # pragma: no cover - compiled
    """Minimize g.d + 1/2 d.H.d over below <= d <= above into ``step`` (shared,), from 0 and downhill all the
    way.

    Source:
        Primal active sets: Nocedal and Wright, Numerical Optimization, 2006, section 16.5.
    """
    size = gradient.size
    held, slope, move, unit = (
        np.zeros(size, np.bool_),
        np.empty(size),
        np.empty(size),
        np.empty(size),
    )
    largest = 0.0
    for i in range(size):
        step[i] = 0.0
        # Unknowns that lie on a bound and are pulled outward begin in the active set, all others are free.
        held[i] = (below[i] >= 0.0 and gradient[i] > 0.0) or (above[i] <= 0.0 and gradient[i] < 0.0)
        # Slopes of unknowns in different units compare only after division by the root of their curvature.
        unit[i] = np.sqrt(max(hessian[i, i], TINY))
        largest = max(largest, abs(gradient[i] / unit[i]))
    # The number of changes of the active set is bounded, because rounding could make it cycle.
    for _ in range(4 * size + 1):
        _slopes(hessian, gradient, step, slope)
        _free_move(hessian, slope, unit, held, move)
        first = np.inf
        for i in range(size):
            if move[i] != 0.0:
                share = ((above[i] if move[i] > 0.0 else below[i]) - step[i]) / move[i]
                first = min(first, share)
        if first < 1.0:
            # The free minimum lies beyond a bound: go as far as the nearest one and hold it from there on.
            # The value has not risen, because the way leads toward the minimum of a convex function.
            for i in range(size):
                if move[i] != 0.0:
                    bound = above[i] if move[i] > 0.0 else below[i]
                    if (bound - step[i]) / move[i] <= first:
                        step[i], held[i] = bound, True
                    else:
                        step[i] += max(first, 0.0) * move[i]
            continue
        for i in range(size):
            step[i] += move[i]
        # At the minimum of this active set, release the held unknown that is pulled inward most; when there
        # is none, the multipliers have the right sign and the step is the best one of the whole box.
        _slopes(hessian, gradient, step, slope)
        most, which = 0.0, -1
        for i in range(size):
            # an unknown without any room would be released and held again for ever
            if held[i] and below[i] != above[i]:
                inward = (-slope[i] if step[i] <= below[i] else slope[i]) / unit[i]
                if inward > most:
                    most, which = inward, i
        if not most > 1e-9 * largest or which < 0:
            break
        held[which] = False


@njit(cache=True, error_model="numpy", **UNCOUNTED)
def _slopes(hessian, gradient, step, slope):  # pragma: no cover - compiled
    for i in range(gradient.size):
        slope[i] = gradient[i]
        for j in range(gradient.size):
            slope[i] += hessian[i, j] * step[j]


@njit(cache=True, error_model="numpy")
def _free_move(hessian, slope, unit, held, move):  # pragma: no cover - compiled
    """Fill ``move`` (shared,) with the step of the free unknowns to their minimum, the shortest where their
    system is singular, and 0 for those held. Lengths, masses and dampings differ by many powers of ten: with
    its diagonal scaled to one, the condition of the system is that of the data."""
    inside = np.flatnonzero(~held)
    matrix, right = np.empty((inside.size, inside.size)), np.empty((inside.size, 1))
    for i in range(inside.size):
        for j in range(inside.size):
            matrix[i, j] = hessian[inside[i], inside[j]] / (unit[inside[i]] * unit[inside[j]])
        right[i, 0] = -slope[inside[i]] / unit[inside[i]]
    move[:] = 0.0
    solved = right.copy()
    if not eliminate(matrix.copy(), solved):
        if np.isfinite(matrix).all() and np.isfinite(right).all():
            solved[:, 0] = shortest(matrix, right[:, 0])
        else:
            solved[:] = np.nan
    for i in range(inside.size):
        move[inside[i]] = solved[i, 0] / unit[inside[i]]
