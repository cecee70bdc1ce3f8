"""Numba kernels of the identification: residuals of many short rollouts and their normal equations.

Plain arrays only. A *piece* is a run of consecutive samples with its own start state; shared unknowns come
first in every Jacobian, the start state (positions, then rates) last.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.mechanism.dynamics import WORK, forward
from monodyn.mechanism.tangents import rollout_tangents

TINY = 1e-30
"""Step of the complex-step derivative: far below rounding, so the derivative is exact."""


@njit(cache=True)
def piece_rows(
    parent, kind, links, dlinks, gravity, dgravity, times, substeps, state, position, white, slide, size,
    dsize, stretch, dstretch,
):  # fmt: skip
    """Residuals of one piece and their Jacobian.

    r = W (x / size - y): W whitens, ``size`` is the metric scale for slides of a record in the start scale
    and 1 for everything else. True time is ``stretch`` times the time stamp.

    Args:
        parent: Parent dof, (dof,).
        kind: Joint kinds, (dof,).
        links: Constants of the links, (dof, column).
        dlinks: Their derivative by shared unknown, (dof, column, param).
        gravity: Gravity [m/s^2], (2,).
        dgravity: Its derivative by shared unknown, (2, param).
        times: Time stamps of the piece [s], (frame,).
        substeps: Integration steps between stamps.
        state: Positions and rates at the first stamp, (2 dof,).
        position: Measured positions, (frame, dof).
        white: Whitening matrices, (frame, dof, dof).
        slide: True for dofs that are slides in the start scale, (dof,).
        size: Metric scale of those slides.
        dsize: Derivative of log size by shared unknown, (param,).
        stretch: True seconds per stamped second.
        dstretch: Derivative of log stretch by shared unknown, (param,).

    Returns:
        Residuals (frame, dof) and Jacobian (frame, dof, param + 2 dof).
    """
    frames, dofs = position.shape
    params = len(dsize)
    true_times = (times - times[0]) * stretch
    q, v, dq, _ = rollout_tangents(
        parent, kind, links, dlinks, gravity, dgravity, true_times, substeps, state[:dofs], state[dofs:]
    )
    for j in range(dofs):
        for f in range(frames):
            for p in range(params):
                dq[f, j, p] += v[f, j] * true_times[f] * dstretch[p]
            if slide[j]:
                q[f, j] /= size
                for p in range(params + 2 * dofs):
                    dq[f, j, p] /= size
                for p in range(params):
                    dq[f, j, p] -= q[f, j] * dsize[p]
    residual = np.zeros((frames, dofs))
    jacobian = np.zeros((frames, dofs, params + 2 * dofs))
    for f in range(frames):
        for i in range(dofs):
            for j in range(dofs):
                w = white[f, i, j]
                if w != 0.0:
                    residual[f, i] += w * (q[f, j] - position[f, j])
                    for p in range(params + 2 * dofs):
                        jacobian[f, i, p] += w * dq[f, j, p]
    return residual, jacobian


@njit(cache=True)
def pieces_model(
    parent, kind, links, dlinks, gravity, dgravity, times, first, substeps, states, position, white, slide,
    size, dsize, stretch, dstretch, limit,
):  # fmt: skip
    """Cost and Gauss-Newton model over all pieces, in blocks.

    The loss of a sample with whitened residual e is limit^2/2 log(1 + e.e/limit^2) (Cauchy), or e.e/2 when
    ``limit`` is 0. Arguments as in `piece_rows`, with ``first`` (piece + 1,) the first sample of each piece
    and ``states`` (piece, 2 dof), ``slide`` (piece, dof).

    Returns:
        cost, shared Hessian (param, param), shared gradient (param,), cross (piece, param, 2 dof), local
        Hessian (piece, 2 dof, 2 dof), local gradient (piece, 2 dof), residuals (frame, dof).
    """
    pieces, local = states.shape
    dofs = local // 2
    params = len(dsize)
    hessian, gradient = np.zeros((params, params)), np.zeros(params)
    cross, local_hessian = np.zeros((pieces, params, local)), np.zeros((pieces, local, local))
    local_gradient, residuals = np.zeros((pieces, local)), np.zeros(position.shape)
    cost = 0.0
    for k in range(pieces):
        a, b = first[k], first[k + 1]
        residual, jacobian = piece_rows(
            parent, kind, links, dlinks, gravity, dgravity, times[a:b], substeps, states[k], position[a:b],
            white[a:b], slide[k], size, dsize, stretch, dstretch,
        )  # fmt: skip
        residuals[a:b] = residual
        for f in range(b - a):
            square = 0.0
            for i in range(dofs):
                square += residual[f, i] ** 2
            weight = 1.0
            if limit > 0.0:
                weight = 1.0 / (1.0 + square / limit**2)
                cost += 0.5 * limit**2 * np.log1p(square / limit**2)
            else:
                cost += 0.5 * square
            root = np.sqrt(weight)
            for i in range(dofs):
                residual[f, i] *= root
                for p in range(params + local):
                    jacobian[f, i, p] *= root
        rows = jacobian.reshape((b - a) * dofs, params + local)
        normal = rows.T @ rows
        slope = rows.T @ residual.reshape((b - a) * dofs)
        hessian += normal[:params, :params]
        gradient += slope[:params]
        cross[k] = normal[:params, params:]
        local_hessian[k] = normal[params:, params:]
        local_gradient[k] = slope[params:]
    return cost, hessian, gradient, cross, local_hessian, local_gradient, residuals


@njit(cache=True)
def acceleration_rows(
    parent, kind, links, dlinks, gravity, dgravity, q, v, a, weight, slide, size, dsize, stretch, dstretch
):
    """Weighted differences between simulated and smoothed accelerations, and their Jacobian.

    All of q, v, a (frame, dof) are in units of the record: slides in the start scale where ``slide`` (frame,
    dof) says so, rates per stamped second. Other arguments as in `piece_rows`.

    Returns:
        Rows (frame, dof) and Jacobian (frame, dof, param), by complex step.
    """
    frames, dofs = q.shape
    params = len(dsize)
    residual, jacobian = np.zeros((frames, dofs)), np.zeros((frames, dofs, params))
    none = np.zeros(dofs, dtype=np.complex128)
    q_true, v_true = np.zeros(dofs, dtype=np.complex128), np.zeros(dofs, dtype=np.complex128)
    unit, found = np.ones(dofs, dtype=np.complex128), np.zeros(dofs, dtype=np.complex128)
    work = np.zeros((dofs, WORK), dtype=np.complex128)
    factors = np.zeros((dofs, dofs), dtype=np.complex128)
    for p in range(params):
        links_p = links + 1j * TINY * dlinks[:, :, p]
        gravity_p = gravity + 1j * TINY * dgravity[:, p]
        pace = stretch * (1.0 + 1j * TINY * dstretch[p])
        length = size * (1.0 + 1j * TINY * dsize[p])
        for f in range(frames):
            for j in range(dofs):
                unit[j] = length if slide[f, j] else 1.0
                q_true[j] = q[f, j] * unit[j]
                v_true[j] = v[f, j] * unit[j] / pace
            forward(parent, kind, links_p, gravity_p, q_true, v_true, none, work, factors, found)
            for j in range(dofs):
                row = weight[f, j] * found[j] * pace * pace / unit[j]
                jacobian[f, j, p] = row.imag / TINY
                residual[f, j] = row.real - weight[f, j] * a[f, j]
    return residual, jacobian
