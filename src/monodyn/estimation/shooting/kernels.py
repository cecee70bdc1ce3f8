"""Numba kernels of the identification: residuals of many short rollouts and their normal equations.

Plain arrays only. A *piece* is a run of consecutive samples with its own start state; shared unknowns come
first in every Jacobian, the start state (positions, then rates) last. The rollouts come from ``mechanism``.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def whitened_rows(q, dq, position, white, slide, size, dsize):
    """Residuals r = W (x / size - y) of rollouts and their Jacobian.

    W whitens; ``size`` divides slides of records in the start scale and nothing else.

    Args:
        q: Simulated positions [rad or m], (row, dof).
        dq: Derivative of q by shared unknowns and by the start state of the row's piece, (row, dof, column).
        position: Measured positions, (row, dof).
        white: Whitening matrices, (row, dof, dof).
        slide: True for slides in the start scale, (row, dof).
        size: Metric scale of those slides.
        dsize: Derivative of log size by shared unknown, (param,).

    Returns:
        Residuals (row, dof) and Jacobian (row, dof, column).
    """
    rows, dofs, columns = dq.shape
    params = len(dsize)
    residual, jacobian = np.zeros((rows, dofs)), np.zeros((rows, dofs, columns))
    # one scratch row, so that nothing is allocated within the loops
    slope = np.zeros(columns)
    for f in range(rows):
        for j in range(dofs):
            # a slide that a picture measured is in units of the start: the identified scale divides it
            unit = 1.0 / size if slide[f, j] else 1.0
            x = q[f, j] * unit
            for p in range(columns):
                slope[p] = dq[f, j, p] * unit
            # d (x / size) = dx / size - (x / size) d log size; start states do not change the scale
            if slide[f, j]:
                for p in range(params):
                    slope[p] -= x * dsize[p]
            for i in range(dofs):
                # W is triangular, and zero in gaps: skip what is zero
                w = white[f, i, j]
                if w != 0.0:
                    residual[f, i] += w * (x - position[f, j])
                    for p in range(columns):
                        jacobian[f, i, p] += w * slope[p]
    return residual, jacobian


@njit(cache=True, nogil=True)
def normal_blocks(residual, jacobian, first, params, limit):
    """Cost and Gauss-Newton model over all pieces, in blocks.

    The loss of a sample with whitened residual e is limit^2/2 log(1 + e.e/limit^2) (Cauchy), or e.e/2 when
    ``limit`` is 0.

    Args:
        residual: Whitened residuals, (row, dof).
        jacobian: Their Jacobian, (row, dof, column).
        first: First row of each piece and one past the last, (piece + 1,).
        params: Number of shared unknowns.
        limit: Residual norm from which on a sample's pull no longer grows, or 0.

    Returns:
        cost, shared Hessian (param, param), shared gradient (param,), cross (piece, param, local), local
        Hessian (piece, local, local) and local gradient (piece, local).
    """
    pieces, dofs, local = len(first) - 1, jacobian.shape[1], jacobian.shape[2] - params
    hessian, gradient = np.zeros((params, params)), np.zeros(params)
    cross, local_hessian = np.zeros((pieces, params, local)), np.zeros((pieces, local, local))
    local_gradient = np.zeros((pieces, local))
    cost = 0.0
    for k in range(pieces):
        for f in range(first[k], first[k + 1]):
            square = 0.0
            for i in range(dofs):
                square += residual[f, i] ** 2
            # iteratively reweighted: the gradient is exact, the Hessian leaves the weight's own slope out and
            # so stays positive
            weight = 1.0
            if limit > 0.0:
                weight = 1.0 / (1.0 + square / limit**2)
                cost += 0.5 * limit**2 * np.log1p(square / limit**2)
            else:
                cost += 0.5 * square
            for i in range(dofs):
                # rows of a piece touch the shared unknowns and this piece's start state, and no other: the
                # normal equations are an arrow, of which only the blocks are kept
                for p in range(params):
                    scaled = weight * jacobian[f, i, p]
                    gradient[p] += scaled * residual[f, i]
                    for r in range(params):
                        hessian[p, r] += scaled * jacobian[f, i, r]
                    for r in range(local):
                        cross[k, p, r] += scaled * jacobian[f, i, params + r]
                for p in range(local):
                    scaled = weight * jacobian[f, i, params + p]
                    local_gradient[k, p] += scaled * residual[f, i]
                    for r in range(local):
                        local_hessian[k, p, r] += scaled * jacobian[f, i, params + r]
    return cost, hessian, gradient, cross, local_hessian, local_gradient


@njit(cache=True, nogil=True)
def bent_pull(residual, jacobian, ahead, step, local_step, first, along, limit):
    """J.r'' of the second derivative r'' of residuals along a step, by a finite difference.

    r(x + h s) = r + h J s + h^2/2 r''.

    Args:
        residual: Whitened residuals, (row, dof).
        jacobian: Their Jacobian, (row, dof, column).
        ahead: The residuals at the share ``along`` of the step, (row, dof).
        step: Step of the shared unknowns, (param,).
        local_step: Step of the start states, (piece, local).
        first: First row of each piece and one past the last, (piece + 1,).
        along: h.
        limit: Residual norm from which on a sample's pull no longer grows, or 0.

    Returns:
        J.r'' of the shared unknowns, (param,), and of the start states, (piece, local).
    """
    params, (pieces, local), dofs = len(step), local_step.shape, residual.shape[1]
    shared, own = np.zeros(params), np.zeros((pieces, local))
    for k in range(pieces):
        for f in range(first[k], first[k + 1]):
            square = 0.0
            for i in range(dofs):
                square += residual[f, i] ** 2
            weight = 1.0 / (1.0 + square / limit**2) if limit > 0.0 else 1.0
            for i in range(dofs):
                slope = 0.0
                for p in range(params):
                    slope += jacobian[f, i, p] * step[p]
                for p in range(local):
                    slope += jacobian[f, i, params + p] * local_step[k, p]
                bend = 2.0 / along * ((ahead[f, i] - residual[f, i]) / along - slope)
                for p in range(params):
                    shared[p] += weight * jacobian[f, i, p] * bend
                for p in range(local):
                    own[k, p] += weight * jacobian[f, i, params + p] * bend
    return shared, own
