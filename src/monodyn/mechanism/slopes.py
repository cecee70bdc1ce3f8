"""Numba kernel: derivatives of the accelerations in single states, made of the pieces of ``tangents``.

A rollout's tangents are those of its states along the way; a linear system needs them in one state, by
parameters, positions, rates and torques, without a step.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.mechanism.brakes import brake
from monodyn.mechanism.branches import solve_all
from monodyn.mechanism.planar import WORK, forward, place
from monodyn.mechanism.tangents import TANGENT, gather, move, needed_forces, push, push_air


@njit(cache=True, error_model="numpy", nogil=True)
def acceleration_tangents(
    parent, kind, links, dlinks, gravity, dgravity, q, v, tau
):  # pragma: no cover - compiled
    """Return accelerations (row, dof) and their derivatives (row, dof, param + 3 dof) in every row.

    ``q``, ``v`` and ``tau`` are (row, dof); the directions are the parameters, then those three.
    """
    rows, n = q.shape
    params = dlinks.shape[2]
    count = params + 3 * n
    dpar, dgpar = np.zeros((n, dlinks.shape[1], count)), np.zeros((2, count))
    dpar[:, :, :params], dgpar[:, :params] = dlinks, dgravity
    dq, dv = np.zeros((n, count)), np.zeros((n, count))
    for i in range(n):
        dq[i, params + i] = 1.0
        dv[i, params + n + i] = 1.0
    w, h, t, hold = np.empty((n, WORK)), np.empty((n, n)), np.empty((n, TANGENT, count)), np.zeros(n)
    a, da = np.empty((rows, n)), np.empty((rows, n, count))
    for f in range(rows):
        # as in ``rollout_tangents``: the factors of M stay in h, ``place`` restores the inertias of w
        forward(parent, kind, links, gravity, q[f], v[f], tau[f], hold, w, h, a[f])
        place(parent, kind, links, q[f], v[f], w)
        needed_forces(parent, kind, links, gravity, v[f], a[f], w)
        move(parent, kind, links, dpar, q[f], v[f], dq, dv, w, t, count)
        push(parent, links, dpar, dgpar, v[f], a[f], dv, w, t, count)
        push_air(kind, links, dpar, w, t, count)
        gather(parent, links, dpar, v[f], a[f], dv, w, t, da[f], count)
        brake(kind, links, dpar, q[f], v[f], a[f], dq, dv, da[f], count)
        for i in range(n):
            da[f, i, params + 2 * n + i] += 1.0
        solve_all(parent, h, da[f], count)
    return a, da
