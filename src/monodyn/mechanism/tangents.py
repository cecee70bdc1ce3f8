"""Numba kernels: derivatives of rollouts along many directions at once, the forward-mode twin of ``planar``.

At every stage of a Runge-Kutta step the accelerations' derivatives by the state, of ``slopes``, carry each
direction's change of the state along, to which is added what the direction itself changes. The
same steps are taken for the motion and its derivatives, so these are the exact derivatives of what
``planar`` returns (but for joints under a friction that hardly anything overcomes: ``part_of_step``). A
direction costs time only from where it begins to change the motion: that of a knot of the drive from the
knot before on.

Names: ``d...`` is a derivative, with the direction as its last axis; ``entry``, ``load`` and ``clock`` are
those of ``Directions``; ``live`` counts the directions that have begun.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.mechanism.branches import solve_all
from monodyn.mechanism.drive import NONE, torque
from monodyn.mechanism.planar import WORK, forward
from monodyn.mechanism.reversals import is_held, part_of_step, turns
from monodyn.mechanism.slopes import SLOPE, by_gravity, by_links, by_state, outward, touched
from monodyn.uncounted import INLINED


@njit(cache=True, error_model="numpy", **INLINED)
def _add_torque(
    tau, slope, time, value, span, slot, load, clock, lagging, lag, da, live
):  # pragma: no cover - compiled
    """Add the derivative of the torque to ``da``; ``slot`` holds the column of ``da`` by table entry.

    The torque is linear in its table, so that an entry's derivative is its basis function, which is zero
    outside of the columns ``span``.
    """
    for i in range(tau.size):
        later = 0.0
        for c in range(span[0], span[1]):
            if slot[i, c] >= 0:
                da[i, slot[i, c]] += value[c]
            later += lagging[i, c] * value[c]
        for k in range(live):
            da[i, k] += load[k] * tau[i] + clock[k] * time * slope[i] + lag[k] * later


@njit(cache=True, error_model="numpy", **INLINED)
def _carry(by_q, by_v, dx, du, da, live):  # pragma: no cover - compiled
    """Write minus what the change of the state adds to the forces, all (dof, direction), into ``da``."""
    for i in range(by_q.shape[0]):
        for k in range(live):
            da[i, k] = -by_q[i, 0] * dx[0, k] - by_v[i, 0] * du[0, k]
        for j in range(1, by_q.shape[0]):
            for k in range(live):
                da[i, k] -= by_q[i, j] * dx[j, k] + by_v[i, j] * du[j, k]


@njit(cache=True, error_model="numpy", **INLINED)
def _to_stage(part, x0, u0, dx0, du0, x, u, a, dx, du, da, live):  # pragma: no cover - compiled
    """Put state and tangents of the next stage where those of this one lead from the start in the time
    ``part``."""
    for i in range(x.shape[0]):
        x[i] = x0[i] + part * u[i]
        u[i] = u0[i] + part * a[i]
        for k in range(live):
            dx[i, k] = dx0[i, k] + part * du[i, k]
            du[i, k] = du0[i, k] + part * da[i, k]


@njit(cache=True, error_model="numpy", **INLINED)
def _put(u, a, du, da, u0, a0, du0, da0, live):  # pragma: no cover - compiled
    """Copy rates and accelerations (or a state) with their derivatives into others."""
    for i in range(u.shape[0]):
        u0[i], a0[i] = u[i], a[i]
        for k in range(live):
            du0[i, k], da0[i, k] = du[i, k], da[i, k]


@njit(cache=True, error_model="numpy", **INLINED)
def _add(part, u, a, du, da, x0, u0, dx0, du0, live):  # pragma: no cover - compiled
    """Add what rates and accelerations, and their derivatives, change in the time ``part`` to a state."""
    for i in range(u.shape[0]):
        x0[i] += part * u[i]
        u0[i] += part * a[i]
        for k in range(live):
            dx0[i, k] += part * du[i, k]
            du0[i, k] += part * da[i, k]


@njit(cache=True, error_model="numpy", nogil=True)
def rollout_tangents(
    parent, kind, links, dpar, gravity, dgpar, times, first, substeps, states, mode, stamps, table, lagging,
    entry, load, clock, lag, order, live,
):  # pragma: no cover - compiled  # fmt: skip
    """Integrate motion and tangents of runs; return positions, rates and the derivatives of both.

    ``dpar`` (dof, column, param) and ``dgpar`` (2, param) are the derivatives of ``links`` and ``gravity``.
    Run k goes from frame ``first[k]`` to the one before ``first[k + 1]`` and starts in ``states[k]`` (2
    dof,). The directions are the parameters, then the run's positions and rates at its start; column c along
    run k is column ``order[k, c]`` of what is returned, (frame, dof, param + 2 dof). At frame f only the
    first ``live[f]`` of them are not zero.
    """
    n, frames, count = parent.size, times.size, order.shape[1]
    q, v = np.empty((frames, n)), np.empty((frames, n))
    dq, dv = np.zeros((frames, n, count)), np.zeros((frames, n, count))
    for k in range(first.size - 1):
        rows = slice(first[k], first[k + 1])
        if first[k] < first[k + 1]:
            _run(
                parent, kind, links, dpar, gravity, dgpar, times[rows], substeps, states[k], mode, stamps,
                table, lagging, entry, load, clock, lag, order[k], live[rows], q[rows], v[rows], dq[rows],
                dv[rows],
            )  # fmt: skip
    return q, v, dq, dv


@njit(cache=True, error_model="numpy", nogil=True)
def _run(
    parent, kind, links, dpar, gravity, dgpar, times, substeps, state, mode, stamps, table, lagging, entry,
    load, clock, lag, order, live, q, v, dq, dv,
):  # pragma: no cover - compiled  # fmt: skip
    """Integrate one run into ``q`` and ``v`` (frame, dof), ``dq`` and ``dv`` (frame, dof, direction)."""
    # Directions that never begin are not carried at all; their columns of the result stay zero.
    n, params = parent.size, dpar.shape[2]
    count = live[-1]
    dlinks, dgravity = np.zeros((n, dpar.shape[1], count)), np.zeros((2, count))
    loads, clocks, lags = np.zeros(count), np.zeros(count), np.zeros(count)
    slot = np.full(entry.shape, -1)
    # as in ``planar``: at the start of a part of a step, at the stage now, and summed over its stages
    x0, u0, a0 = state[:n].copy(), state[n:].copy(), np.empty(n)
    x, u, a, rates, changes = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    dx0, du0, da0 = np.zeros((n, count)), np.zeros((n, count)), np.empty((n, count))
    dx, du, da = np.empty((n, count)), np.empty((n, count)), np.empty((n, count))
    drates, dchanges = np.empty((n, count)), np.empty((n, count))
    # A start state's direction begins as a one in the state and changes no parameter; a parameter's begins as
    # zeros in the state.
    for k in range(count):
        p = order[k]
        if p >= params + n:
            du0[p - params - n, k] = 1.0
        elif p >= params:
            dx0[p - params, k] = 1.0
        else:
            dlinks[:, :, k], dgravity[:, k] = dpar[:, :, p], dgpar[:, p]
            loads[k], clocks[k], lags[k] = load[p], clock[p], lag[p]
            for i in range(n):
                for c in range(entry.shape[1]):
                    if entry[i, c] == p:
                        slot[i, c] = k
    (at, what), pulled = touched(dlinks, count), dgravity.any()
    w, h, d = np.empty((n, WORK)), np.empty((n, n)), np.empty((n, SLOPE))
    by_q, by_v = np.zeros((n, n)), np.zeros((n, n))
    tau, slope, hold = np.zeros(n), np.zeros(n), np.zeros(n)
    value, rate = np.empty(table.shape[1]), np.empty(table.shape[1])
    # Frame 0 takes no step and only writes the start. A direction that begins in an interval has zero
    # tangents until then, which is what its rows of dx0 and du0 hold.
    for f in range(times.size):
        many = live[f]
        touching = np.searchsorted(at[:, 0], many)
        step = (times[f] - times[f - 1]) / substeps if f > 0 else 0.0
        for s in range(substeps if f > 0 else 0):
            begin = times[f - 1] + s * step
            # of the whole step: its parts are on the same side of a knot
            middle = begin + 0.5 * step
            left, length, ended = step, step, False
            while not ended:
                _put(x0, u0, dx0, du0, x, u, dx, du, many)
                for i in range(n):
                    hold[i] = 0.0
                r = 0
                while r < 4:
                    part = 0.0 if r == 0 else length if r == 3 else 0.5 * length
                    if r > 0:
                        _to_stage(part, x0, u0, dx0, du0, x, u, a, dx, du, da, many)
                    time, span = begin + part, (0, 0)
                    if mode != NONE:
                        span = torque(mode, stamps, table, time, middle, value, rate, tau, slope)
                    # ``forward`` leaves the factors of M in h and all but forces and accelerations in w
                    forward(parent, kind, links, gravity, x, u, tau, hold, w, h, a)
                    # as in ``planar.rollouts``, so that these are the derivatives of that very rollout
                    if r == 0:
                        length = part_of_step(parent, kind, links, u, a, h, left, step, substeps, hold)
                        if is_held(hold):
                            forward(parent, kind, links, gravity, x, u, tau, hold, w, h, a)
                    outward(parent, kind, links, gravity, u, a, w, d)
                    by_state(parent, kind, links, u, a, w, d, by_q, by_v)
                    _carry(by_q, by_v, dx, du, da, many)
                    by_links(parent, kind, links, gravity, at, what, touching, x, u, a, w, d, da)
                    if pulled:
                        by_gravity(dgravity, d, da, many)
                    if mode != NONE:
                        _add_torque(
                            tau, slope, time, value, span, slot, loads, clocks, lagging, lags, da, many
                        )
                    # da holds dtau - (dM a + dbias); M is that of this stage
                    solve_all(parent, h, da, many)
                    if r == 0:
                        _put(u, a, du, da, u0, a0, du0, da0, many)
                        _put(u, a, du, da, rates, changes, drates, dchanges, many)
                    else:
                        weight = 1.0 if r == 3 else 2.0
                        _add(weight, u, a, du, da, rates, changes, drates, dchanges, many)
                    r += 1
                    if r == 4 and turns(kind, links, u0, a0, u, a, length, step):
                        # half as far, from the first stage on
                        r, length = 1, 0.5 * length
                        _put(u0, a0, du0, da0, u, a, du, da, many)
                        _put(u0, a0, du0, da0, rates, changes, drates, dchanges, many)
                _add(length / 6.0, rates, changes, drates, dchanges, x0, u0, dx0, du0, many)
                ended = not abs(length) < abs(left)
                left -= length
                begin += length
        for i in range(n):
            q[f, i], v[f, i] = x0[i], u0[i]
            for k in range(many):
                dq[f, i, order[k]], dv[f, i, order[k]] = dx0[i, k], du0[i, k]
