"""Derivatives of motions without torques over time or dry friction, by the variational equation.

A change d of the state obeys d'' = A_q d + A_v d' + b along the motion, with A the derivatives of the
accelerations by the state and b those by a parameter, which ``slopes`` has. It is integrated in steps of two
steps of the motion each, by the cubic that obeys it at the start, the middle and the end, which is of order
four. Steps of the motion begin there, so that one linearization a step is enough where the derivatives of the
very rollout (``tangents``) need four; and the equation is linear, so that the step, though implicit, takes
one small system. These are the derivatives of the motion itself, a few times less exact than its integration.

How exact shows in the motion: its rates and accelerations are such a change d, that of a start a little
later, so that the derivatives by the start have to carry them along. Of a joint that rests all along nothing
is seen; it counts as inexact.

Names: as in ``tangents``; ``by`` is b, A_q and A_v at the start, the middle and the end of two steps, (3,
dof, param + 2 dof).

Source: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I (1993), I.14
(variational equation), and II (1996), IV.5 (Lobatto IIIA).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.arrays import plain
from monodyn.mechanism.drive import NONE, Drive
from monodyn.mechanism.planar import WORK, forward
from monodyn.mechanism.slopes import SLOPE, linearize, touched
from monodyn.mechanism.tree import FRICTION, Directions, Tree
from monodyn.solving import eliminate
from monodyn.uncounted import INLINED

REST = 1e-6
"""Share of the squared rates of a joint's fastest run below which a run of it counts as one at rest."""


def derivatives(
    tree: Tree, directions: Directions, times: np.ndarray, first: np.ndarray, substeps: int,
    states: np.ndarray, drive: Drive, most_off: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None:  # fmt: skip
    """Integrate motions with their derivatives where these are exact enough.

    Args:
        tree: The joint tree.
        directions: What each parameter changes in the tree.
        times: Time stamps of all runs end to end [s], (frame,).
        first: First frame of each run and one past the last, int64 (piece + 1,).
        substeps: Equal steps between two stamps.
        states: Joint positions, then rates at the first frame of each run [rad or m, rad/s or m/s], (piece,
            2 dof).
        drive: Torques over time in addition to friction and springs.
        most_off: How far off the derivatives by the start may be, as a share, by what they make of the rates.

    Returns:
        Positions and rates, each (frame, dof), the same as of ``simulate.rollouts``, and their derivatives,
        each (frame, dof, param + 2 dof); None where something acts that is not smooth over time, for an odd
        number of steps, and where derivatives come out less exact.
    """
    dry = tree.links[:, FRICTION].any() or directions.links[:, FRICTION].any()
    if drive.mode != NONE or dry or substeps % 2:
        return None
    acting = np.flatnonzero(directions.acting)
    links, gravity = plain(directions.links[:, :, acting], float), plain(directions.gravity[:, acting], float)
    q, v, dq, dv, off = variations(
        tree.parent, tree.kind, tree.links, links, tree.gravity, gravity, times, first, int(substeps), states
    )
    if not off <= most_off:
        return None
    params, starts = len(directions.acting), states.shape[1]
    if len(acting) < params:
        columns = np.concatenate((acting, params + np.arange(starts)))
        every = np.zeros((2, *q.shape, params + starts))
        every[0][:, :, columns], every[1][:, :, columns] = dq, dv
        dq, dv = every
    return q, v, dq, dv


@njit(cache=True, error_model="numpy", **INLINED)
def _carry(length, by, dx, du, middle, da, matrix, right):  # pragma: no cover - compiled
    """Carry tangents ``dx`` and ``du`` (dof, direction) over two steps, of ``length`` together.

    ``by`` is (3, dof, param + 2 dof), its end becomes the start; ``middle`` (2 dof, direction), ``da`` (dof,
    direction), ``matrix`` (2 dof, 2 dof) and ``right`` (2 dof, direction) are scratch. With x and u at the
    start 0, in the middle 1 and at the end 2, and a = A_q x + A_v u + b:

        x2 = x0 + h/2 (u0 + u2) + h^2/12 (a0 - a2)        x1 = (x0 + x2)/2 + h/8 (u0 - u2)
        u2 = u0 + h/6 (a0 + 4 a1 + a2)                    u1 = (u0 + u2)/2 + h/8 (a0 - a2)

    What of this the start determines is the right side of a system for x2 and u2.
    """
    n, live = dx.shape
    params, h = live - 2 * n, length
    by0, by1, by2 = by[0], by[1], by[2]
    for i in range(n):
        for j in range(n):
            q1, v1 = by1[i, params + j], by1[i, params + n + j]
            q2, v2 = by2[i, params + j], by2[i, params + n + j]
            to_q, to_v = 0.0, 0.0
            for k in range(n):
                to_q += by1[i, params + n + k] * by2[k, params + j]
                to_v += by1[i, params + n + k] * by2[k, params + n + j]
            same = 1.0 if i == j else 0.0
            matrix[i, j] = same + h * h / 12.0 * q2
            matrix[i, n + j] = h * h / 12.0 * v2 - 0.5 * h * same
            matrix[n + i, j] = h * h / 12.0 * to_q - h / 6.0 * q2 - h / 3.0 * q1
            matrix[n + i, n + j] = same + h * h / 12.0 * (to_v + q1) - h / 6.0 * v2 - h / 3.0 * v1
    # a0, then a0 - b2
    _accelerate(by0, dx, du, da)
    for i in range(n):
        for k in range(live):
            b2 = by2[i, k] if k < params else 0.0
            right[n + i, k] = du[i, k] + h / 6.0 * (da[i, k] + b2)
            da[i, k] -= b2
            right[i, k] = dx[i, k] + 0.5 * h * du[i, k] + h * h / 12.0 * da[i, k]
            middle[i, k] = 0.5 * dx[i, k] + 0.125 * h * du[i, k]
            middle[n + i, k] = 0.5 * du[i, k] + 0.125 * h * da[i, k]
    _accelerate(by1, middle[:n], middle[n:], da)
    for i in range(n):
        for k in range(live):
            right[n + i, k] += 2.0 * h / 3.0 * da[i, k]
    solved = eliminate(matrix, right)
    for i in range(n):
        for k in range(live):
            dx[i, k] = right[i, k] if solved else np.nan
            du[i, k] = right[n + i, k] if solved else np.nan
            by0[i, k] = by2[i, k]


@njit(cache=True, error_model="numpy", **INLINED)
def _linearize(
    parent, kind, links, gravity, dgravity, at, what, q, v, a, w, h, d, by_q, by_v, by, k
):  # pragma: no cover - compiled
    """Fill ``by[k]`` as ``slopes.linearize`` does; ``by`` is (3, dof, param + 2 dof)."""
    linearize(parent, kind, links, gravity, dgravity, at, what, q, v, a, w, h, d, by_q, by_v, by[k])


@njit(cache=True, error_model="numpy", **INLINED)
def _note(x0, u0, dx, du, q, v, dq, dv, f):  # pragma: no cover - compiled
    """Put state (dof,) and tangents (dof, direction) into row ``f`` of motion, (frame, dof), and tangents."""
    for i in range(x0.size):
        q[f, i], v[f, i] = x0[i], u0[i]
        for k in range(dx.shape[1]):
            dq[f, i, k], dv[f, i, k] = dx[i, k], du[i, k]


@njit(cache=True, error_model="numpy", **INLINED)
def _accelerate(by, dx, du, da):  # pragma: no cover - compiled
    """Write the changes of the accelerations, A_q dx + A_v du + b, into ``da`` (dof, direction)."""
    n, live = dx.shape
    params = live - 2 * n
    for i in range(n):
        for k in range(live):
            da[i, k] = by[i, k] if k < params else 0.0
        for j in range(n):
            to_q, to_v = by[i, params + j], by[i, params + n + j]
            for k in range(live):
                da[i, k] += to_q * dx[j, k] + to_v * du[j, k]


@njit(cache=True, error_model="numpy", **INLINED)
def _advance(
    parent, kind, links, gravity, step, x0, u0, a, x, u, rates, changes, tau, w, h
):  # pragma: no cover - compiled
    """Take a step of the motion from positions ``x0`` and rates ``u0`` with accelerations ``a``; leave those
    at its end there, ``w`` and ``h`` as ``forward`` does. ``tau`` is zero, the rest is scratch."""
    for i in range(x.size):
        u[i], rates[i], changes[i] = u0[i], u0[i], a[i]
    for r in range(1, 4):
        part = step if r == 3 else 0.5 * step
        weight = 1.0 if r == 3 else 2.0
        for i in range(x.size):
            x[i] = x0[i] + part * u[i]
            u[i] = u0[i] + part * a[i]
        forward(parent, kind, links, gravity, x, u, tau, tau, w, h, a)
        for i in range(x.size):
            rates[i] += weight * u[i]
            changes[i] += weight * a[i]
    for i in range(x.size):
        x0[i] += step / 6.0 * rates[i]
        u0[i] += step / 6.0 * changes[i]
    forward(parent, kind, links, gravity, x0, u0, tau, tau, w, h, a)


@njit(cache=True, error_model="numpy", nogil=True)
def variations(
    parent, kind, links, dlinks, gravity, dgravity, times, first, substeps, states
):  # pragma: no cover - compiled
    """Integrate motion and tangents of runs; return positions, rates, the derivatives of both, and how far
    off these are.

    ``dlinks`` (dof, column, param) and ``dgravity`` (2, param) are the derivatives of ``links`` and
    ``gravity``, ``substeps`` is even; all else is as in ``tangents.rollout_tangents``, the directions in
    their order. How far off is the typical difference of a joint's rate and of what the derivatives by the
    start make of the rates and accelerations there, as a share of the joint's typical rate in the run, the
    largest of all joints and runs; infinite for a joint that never moves. Runs that grow beyond all bounds do
    not count.
    """
    n, frames, params = parent.size, times.size, dlinks.shape[2]
    live = params + 2 * n
    q, v = np.empty((frames, n)), np.empty((frames, n))
    dq, dv = np.empty((frames, n, live)), np.empty((frames, n, live))
    w, h, d = np.empty((n, WORK)), np.empty((n, n)), np.empty((n, SLOPE))
    by_q, by_v, by = np.zeros((n, n)), np.zeros((n, n)), np.zeros((3, n, live))
    tau = np.zeros(n)
    x0, u0, x, u, a = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    rates, changes, pull = np.empty(n), np.empty(n), np.empty(n)
    dx, du, da = np.empty((n, live)), np.empty((n, live)), np.empty((n, live))
    middle, right, matrix = np.empty((2 * n, live)), np.empty((2 * n, live)), np.empty((2 * n, 2 * n))
    at, what = touched(dlinks, params)
    gaps, speeds = np.zeros((first.size - 1, n)), np.zeros((first.size - 1, n))
    for run in range(first.size - 1):
        begin, end = first[run], first[run + 1]
        if begin == end:
            continue
        x0[:], u0[:] = states[run, :n], states[run, n:]
        dx[:], du[:] = 0.0, 0.0
        for i in range(n):
            dx[i, params + i], du[i, params + n + i] = 1.0, 1.0
        _note(x0, u0, dx, du, q, v, dq, dv, begin)
        if begin + 1 == end:
            continue
        forward(parent, kind, links, gravity, x0, u0, tau, tau, w, h, a)
        _linearize(parent, kind, links, gravity, dgravity, at, what, x0, u0, a, w, h, d, by_q, by_v, by, 0)
        pull[:] = a
        for f in range(begin + 1, end):
            step = (times[f] - times[f - 1]) / substeps
            for s in range(substeps):
                _advance(parent, kind, links, gravity, step, x0, u0, a, x, u, rates, changes, tau, w, h)
                _linearize(
                    parent, kind, links, gravity, dgravity, at, what, x0, u0, a, w, h, d, by_q, by_v, by,
                    1 + s % 2,
                )  # fmt: skip
                if s % 2:
                    _carry(2.0 * step, by, dx, du, middle, da, matrix, right)
            _note(x0, u0, dx, du, q, v, dq, dv, f)
            for i in range(n):
                carried = 0.0
                for j in range(n):
                    carried += dx[i, params + j] * v[begin, j] + dx[i, params + n + j] * pull[j]
                gaps[run, i] += (carried - u0[i]) ** 2
                speeds[run, i] += u0[i] ** 2
    return q, v, dq, dv, _off(gaps, speeds)


@njit(cache=True, error_model="numpy", **INLINED)
def _off(gaps, speeds):  # pragma: no cover - compiled
    """Return the largest share of what rates are off by, from sums of squares of both, (run, dof)."""
    off = 0.0
    for i in range(gaps.shape[1]):
        fastest = 0.0
        for run in range(gaps.shape[0]):
            if np.isfinite(speeds[run, i]):
                fastest = max(fastest, speeds[run, i])
        for run in range(gaps.shape[0]):
            if np.isfinite(speeds[run, i]):
                share = np.sqrt(gaps[run, i] / (speeds[run, i] + REST * fastest))
                off = max(off, share) if np.isfinite(share) else np.inf
    return off
