"""Numba kernels: derivatives of a rollout along many directions at once, the forward-mode twin of ``planar``.

With tau = M(q) a + bias(q, v) solved for a, a direction d obeys M da = dtau - (dM a + dbias): the inverse
dynamics at fixed a, differentiated by hand, then one solve with the factors already at hand. The same
Runge-Kutta steps are taken for the motion and its derivatives, so these are the exact derivatives of what
``rollout`` returns (but for joints under a friction that hardly anything overcomes: ``part_of_step``). A
direction costs time only from where it begins to change the motion: that of a knot of the drive from the
knot before on.

Names: ``d...`` is a derivative, with the direction as its last axis; ``entry``, ``load`` and ``clock`` are
those of ``Directions``; ``live`` counts the directions that have begun.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.mechanism.brakes import BRAKED, brake, occurs
from monodyn.mechanism.branches import solve_all
from monodyn.mechanism.drive import NONE, torque
from monodyn.mechanism.planar import (
    AW,
    AX,
    AY,
    FN,
    FX,
    FY,
    MX,
    MY,
    OX,
    OY,
    SW,
    SX,
    SY,
    VW,
    VX,
    VY,
    WORK,
    C,
    J,
    M,
    S,
    air_direction,
    forward,
    place,
    resist,
)  # fmt: skip
from monodyn.mechanism.reversals import part_of_step, turns
from monodyn.mechanism.tree import (
    AIR,
    ANCHOR_X,
    ANCHOR_Y,
    ANGLE,
    ARMATURE,
    AXIS_X,
    AXIS_Y,
    COM_X,
    COM_Y,
    DAMPING,
    HINGE,
    INERTIA,
    MASS,
)  # fmt: skip

DPHI, DOX, DOY, DSX, DSY, DVW, DVX, DVY, DAW, DAX, DAY, DFN, DFX, DFY = range(14)
"""Columns of the scratch ``t`` (dof, TANGENT, direction): derivatives of those columns of the scratch of
``planar`` that depend on the directions; SW, the sign of a hinge, does not."""
TANGENT = 14


@njit(cache=True, error_model="numpy")
def needed_forces(parent, kind, links, gravity, v, a, w):  # pragma: no cover - compiled
    """Fill A (AW..AY) and force (FN..FY) of each link at the accelerations ``a``; sum forces inward.

    ``v`` and ``a`` are (dof,), ``w`` is (dof, WORK) as ``place`` leaves it. This is ``_bias`` with the actual
    accelerations: the derivative of the inverse dynamics needs A and the force of the actual motion.
    """
    for i in range(parent.size):
        p = parent[i]
        w[i, AW] = w[i, SW] * a[i]
        w[i, AX] = w[i, SX] * a[i]
        w[i, AY] = w[i, SY] * a[i]
        # A root that accelerates against gravity stands for the weight of every link beyond it, so that
        # no link needs a weight of its own. Elsewhere the parent carries the joint's axis along: V x S v.
        if p < 0:
            w[i, AX] -= gravity[0]
            w[i, AY] -= gravity[1]
        else:
            w[i, AW] += w[p, AW]
            w[i, AX] += w[p, AX] + v[i] * (w[i, SW] * w[p, VY] - w[p, VW] * w[i, SY])
            w[i, AY] += w[p, AY] + v[i] * (w[p, VW] * w[i, SX] - w[i, SW] * w[p, VX])
        # (px, py) is the link's linear momentum. The force is I A + V x* (I V); of the moment of the second
        # term only v x p is left, because turn rates in one plane do not act on each other.
        px = w[i, M] * w[i, VX] - w[i, VW] * w[i, MY]
        py = w[i, M] * w[i, VY] + w[i, VW] * w[i, MX]
        w[i, FN] = (
            w[i, J] * w[i, AW] + w[i, MX] * w[i, AY] - w[i, MY] * w[i, AX] + w[i, VX] * py - w[i, VY] * px
        )
        w[i, FX] = w[i, M] * w[i, AX] - w[i, AW] * w[i, MY] - w[i, VW] * py
        w[i, FY] = w[i, M] * w[i, AY] + w[i, AW] * w[i, MX] + w[i, VW] * px
    resist(kind, links, w)
    # All forces are taken about the same fixed point: a child's adds to its parent's without a shift. Parents
    # come before their children, so that each sum is complete before it is passed on.
    for i in range(parent.size - 1, -1, -1):
        p = parent[i]
        if p >= 0:
            w[p, FN] += w[i, FN]
            w[p, FX] += w[i, FX]
            w[p, FY] += w[i, FY]


@njit(cache=True, error_model="numpy")
def move(parent, kind, links, dlinks, q, v, dq, dv, w, t, live):  # pragma: no cover - compiled
    """Differentiate ``place``: origins, motion subspaces and velocities of every link, outward.

    ``dq`` and ``dv`` are (dof, direction). Cosines and sines need no column: their derivatives are those of a
    turn of the frame, so that a vector R r changes by R (dr + dphi e x r).
    """
    for i in range(parent.size):
        p = parent[i]
        ax, ay = links[i, ANCHOR_X], links[i, ANCHOR_Y]
        for k in range(live):
            dphi = dlinks[i, ANGLE, k]
            if p < 0:
                dox = dlinks[i, ANCHOR_X, k] - dlinks[0, ANCHOR_X, k]
                doy = dlinks[i, ANCHOR_Y, k] - dlinks[0, ANCHOR_Y, k]
            else:
                turn = t[p, DPHI, k]
                dx, dy = dlinks[i, ANCHOR_X, k] - turn * ay, dlinks[i, ANCHOR_Y, k] + turn * ax
                dox = t[p, DOX, k] + w[p, C] * dx - w[p, S] * dy
                doy = t[p, DOY, k] + w[p, S] * dx + w[p, C] * dy
                dphi += turn
            if kind[i] == HINGE:
                dphi += w[i, SW] * dq[i, k]  # SW is the sign of the hinge
                t[i, DSX, k] = w[i, SW] * doy
                t[i, DSY, k] = -w[i, SW] * dox
            else:
                # the direction of a slide turns with its frame; its origin moves by d(S q)
                dx = dlinks[i, AXIS_X, k] - dphi * links[i, AXIS_Y]
                dy = dlinks[i, AXIS_Y, k] + dphi * links[i, AXIS_X]
                t[i, DSX, k] = w[i, C] * dx - w[i, S] * dy
                t[i, DSY, k] = w[i, S] * dx + w[i, C] * dy
                dox += t[i, DSX, k] * q[i] + w[i, SX] * dq[i, k]
                doy += t[i, DSY, k] * q[i] + w[i, SY] * dq[i, k]
            t[i, DPHI, k] = dphi
            t[i, DOX, k] = dox
            t[i, DOY, k] = doy
            dvw = w[i, SW] * dv[i, k]
            dvx = t[i, DSX, k] * v[i] + w[i, SX] * dv[i, k]
            dvy = t[i, DSY, k] * v[i] + w[i, SY] * dv[i, k]
            if p >= 0:
                dvw += t[p, DVW, k]
                dvx += t[p, DVX, k]
                dvy += t[p, DVY, k]
            t[i, DVW, k] = dvw
            t[i, DVX, k] = dvx
            t[i, DVY, k] = dvy


@njit(cache=True, error_model="numpy")
def push(parent, links, dlinks, dgravity, v, a, dv, w, t, live):  # pragma: no cover - compiled
    """Differentiate each link's acceleration and force, outward; ``w`` holds single-link inertias.

    The accelerations ``a`` (dof,) are held: their own change is what is solved for in the end.
    """
    for i in range(parent.size):
        p = parent[i]
        m, cx, cy = links[i, MASS], links[i, COM_X], links[i, COM_Y]
        c, s = w[i, C], w[i, S]
        x = w[i, OX] + c * cx - s * cy
        y = w[i, OY] + s * cx + c * cy
        vw, vx, vy = w[i, VW], w[i, VX], w[i, VY]
        aw, ax, ay = w[i, AW], w[i, AX], w[i, AY]
        px, py = m * vx - vw * w[i, MY], m * vy + vw * w[i, MX]
        for k in range(live):
            # A_i = A_p + S_i a_i + v_i (V_p x S_i), term by term by the product rule
            daw = 0.0
            dax = t[i, DSX, k] * a[i]
            day = t[i, DSY, k] * a[i]
            if p < 0:
                dax -= dgravity[0, k]
                day -= dgravity[1, k]
            else:
                daw += t[p, DAW, k]
                dax += t[p, DAX, k] + dv[i, k] * (w[i, SW] * w[p, VY] - w[p, VW] * w[i, SY])
                dax += v[i] * (w[i, SW] * t[p, DVY, k] - t[p, DVW, k] * w[i, SY] - w[p, VW] * t[i, DSY, k])
                day += t[p, DAY, k] + dv[i, k] * (w[p, VW] * w[i, SX] - w[i, SW] * w[p, VX])
                day += v[i] * (t[p, DVW, k] * w[i, SX] + w[p, VW] * t[i, DSX, k] - w[i, SW] * t[p, DVX, k])
            t[i, DAW, k], t[i, DAX, k], t[i, DAY, k] = daw, dax, day
            # first and second moments about the fixed point follow the centre of mass, (dx, dy) its change
            bx, by = dlinks[i, COM_X, k] - t[i, DPHI, k] * cy, dlinks[i, COM_Y, k] + t[i, DPHI, k] * cx
            dx = t[i, DOX, k] + c * bx - s * by
            dy = t[i, DOY, k] + s * bx + c * by
            dm = dlinks[i, MASS, k]
            dmx = dm * x + m * dx
            dmy = dm * y + m * dy
            dj = dlinks[i, INERTIA, k] + dmx * x + dmy * y + m * (x * dx + y * dy)
            # f = I A + V x* p with the momentum p = I V, term by term
            dvw, dvx, dvy = t[i, DVW, k], t[i, DVX, k], t[i, DVY, k]
            dpx = dm * vx + m * dvx - dvw * w[i, MY] - vw * dmy
            dpy = dm * vy + m * dvy + dvw * w[i, MX] + vw * dmx
            t[i, DFN, k] = dj * aw + w[i, J] * daw + dmx * ay + w[i, MX] * day - dmy * ax - w[i, MY] * dax
            t[i, DFN, k] += dvx * py + vx * dpy - dvy * px - vy * dpx
            t[i, DFX, k] = dm * ax + m * dax - daw * w[i, MY] - aw * dmy - dvw * py - vw * dpy
            t[i, DFY, k] = dm * ay + m * day + daw * w[i, MX] + aw * dmx + dvw * px + vw * dpx


@njit(cache=True, error_model="numpy")
def push_air(kind, links, dlinks, w, t, live):  # pragma: no cover - compiled
    """Add the derivatives of what the air takes to those of the links' forces, as ``resist`` has them."""
    for i in range(kind.size):
        c = links[i, AIR]
        n, x, y = air_direction(i, kind, links, w)
        z = n * w[i, VW] + x * w[i, VX] + y * w[i, VY]
        law, slope = abs(z) * z, 2.0 * c * abs(z)
        m, cx, cy = links[i, MASS], links[i, COM_X], links[i, COM_Y]
        inertia = links[i, INERTIA] + m * (cx * cx + cy * cy)
        gx, gy = (m * cx / inertia, m * cy / inertia) if inertia > 0.0 else (0.0, 0.0)
        for k in range(live):
            if kind[i] == HINGE:
                bx, by = -t[i, DPHI, k] * gy, t[i, DPHI, k] * gx
                if inertia > 0.0:
                    dm, dx, dy = dlinks[i, MASS, k], dlinks[i, COM_X, k], dlinks[i, COM_Y, k]
                    more = dlinks[i, INERTIA, k] + dm * (cx * cx + cy * cy) + 2.0 * m * (cx * dx + cy * dy)
                    bx += (dm * cx + m * dx - gx * more) / inertia
                    by += (dm * cy + m * dy - gy * more) / inertia
                dfx, dfy = -(w[i, S] * bx + w[i, C] * by), w[i, C] * bx - w[i, S] * by
            else:
                dfx, dfy = t[i, DSX, k], t[i, DSY, k]
            # the moment of a force (x, y) at the origin about the fixed point, and one where it turns
            dfn = t[i, DOX, k] * y + w[i, OX] * dfy - t[i, DOY, k] * x - w[i, OY] * dfx
            dz = dfn * w[i, VW] + n * t[i, DVW, k]
            dz += dfx * w[i, VX] + x * t[i, DVX, k] + dfy * w[i, VY] + y * t[i, DVY, k]
            change = dlinks[i, AIR, k] * law + slope * dz
            t[i, DFN, k] += change * n + c * law * dfn
            t[i, DFX, k] += change * x + c * law * dfx
            t[i, DFY, k] += change * y + c * law * dfy


@njit(cache=True, error_model="numpy")
def gather(parent, links, dlinks, v, a, dv, w, t, da, live):  # pragma: no cover - compiled
    """Sum the force derivatives inward and write the joint-space right-hand side into ``da``.

    Row i of the equation of motion is S_i.F_i + armature a_i = tau_i - friction(v_i) - spring(q_i) with the
    force F_i of the whole subtree; ``da`` (dof, direction) receives minus the derivative of all terms at
    fixed ``a``, without those of the drive, of dry friction, drag and springs.
    """
    for i in range(parent.size - 1, -1, -1):
        p = parent[i]
        for k in range(live):
            da[i, k] = -(
                w[i, SW] * t[i, DFN, k]
                + t[i, DSX, k] * w[i, FX]
                + w[i, SX] * t[i, DFX, k]
                + t[i, DSY, k] * w[i, FY]
                + w[i, SY] * t[i, DFY, k]
                + dlinks[i, ARMATURE, k] * a[i]
                + dlinks[i, DAMPING, k] * v[i]
                + links[i, DAMPING] * dv[i, k]
            )
        # children come after their parents, so F of this link is complete, as in ``forward``
        if p >= 0:
            for k in range(live):
                t[p, DFN, k] += t[i, DFN, k]
                t[p, DFX, k] += t[i, DFX, k]
                t[p, DFY, k] += t[i, DFY, k]


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy", nogil=True)
def _to_stage(r, part, x, u, a, dx, du, da, live):  # pragma: no cover - compiled
    """Put state and tangents of stage ``r`` where those of the stage before lead in the time ``part``."""
    for i in range(x.shape[1]):
        x[r, i] = x[0, i] + part * u[r - 1, i]
        u[r, i] = u[0, i] + part * a[r - 1, i]
        for k in range(live):
            dx[r, i, k] = dx[0, i, k] + part * du[r - 1, i, k]
            du[r, i, k] = du[0, i, k] + part * da[r - 1, i, k]


@njit(cache=True, error_model="numpy", nogil=True)
def _to_end(sixth, x, u, a, dx, du, da, live):  # pragma: no cover - compiled
    """Put state and tangents of stage 0 at the end of a step, of which ``sixth`` is a sixth."""
    for i in range(x.shape[1]):
        x[0, i] += sixth * (u[0, i] + 2.0 * u[1, i] + 2.0 * u[2, i] + u[3, i])
        u[0, i] += sixth * (a[0, i] + 2.0 * a[1, i] + 2.0 * a[2, i] + a[3, i])
        for k in range(live):
            dx[0, i, k] += sixth * (du[0, i, k] + 2.0 * (du[1, i, k] + du[2, i, k]) + du[3, i, k])
            du[0, i, k] += sixth * (da[0, i, k] + 2.0 * (da[1, i, k] + da[2, i, k]) + da[3, i, k])


@njit(cache=True, error_model="numpy", nogil=True)
def rollout_tangents(
    parent, kind, links, dpar, gravity, dgpar, times, substeps, q0, v0, mode, stamps, table, lagging, entry,
    load, clock, lag, order, live,
):  # pragma: no cover - compiled  # fmt: skip
    """Integrate motion and tangents; return positions, rates and the derivatives of both.

    ``dpar`` (dof, column, param) and ``dgpar`` (2, param) are the derivatives of ``links`` and ``gravity``.
    The directions are the parameters, then ``q0``, then ``v0``; column k in here is column ``order[k]`` of
    what is returned, (frame, dof, param + 2 dof). At frame f only the first ``live[f]`` of them are not zero.
    """
    # Directions that never begin are not carried at all; their columns of the result stay zero.
    n, params = parent.size, dpar.shape[2]
    count = live[-1] if times.size > 0 else 0
    dlinks, dgravity = np.zeros((n, dpar.shape[1], count)), np.zeros((2, count))
    loads, clocks, lags = np.zeros(count), np.zeros(count), np.zeros(count)
    slot = np.full(entry.shape, -1)
    x, u, a = np.empty((4, n)), np.empty((4, n)), np.empty((4, n))
    dx, du, da = np.zeros((4, n, count)), np.zeros((4, n, count)), np.empty((4, n, count))
    # A start state's direction begins as a one in the state and changes no parameter; a parameter's begins as
    # zeros in the state.
    for k in range(count):
        p = order[k]
        if p >= params + n:
            du[0, p - params - n, k] = 1.0
        elif p >= params:
            dx[0, p - params, k] = 1.0
        else:
            dlinks[:, :, k], dgravity[:, k] = dpar[:, :, p], dgpar[:, p]
            loads[k], clocks[k], lags[k] = load[p], clock[p], lag[p]
            for i in range(n):
                for c in range(entry.shape[1]):
                    if entry[i, c] == p:
                        slot[i, c] = k
    # most mechanisms have none of these, and what they take costs as much as all else at a joint
    airy, resisted = occurs(links, dlinks, (AIR,)), occurs(links, dlinks, BRAKED)
    w, h, tau, slope, hold = np.empty((n, WORK)), np.empty((n, n)), np.zeros(n), np.zeros(n), np.zeros(n)
    value, rate = np.empty(table.shape[1]), np.empty(table.shape[1])
    t = np.empty((n, TANGENT, count))
    q, v = np.empty((times.size, n)), np.empty((times.size, n))
    dq, dv = np.zeros((times.size, n, order.size)), np.zeros((times.size, n, order.size))
    if times.size == 0:
        return q, v, dq, dv
    x[0], u[0] = q0, v0
    # Frame 0 takes no step and only writes the start. A direction that begins in an interval has zero
    # tangents until then, which is what its rows of dx and du hold.
    for f in range(times.size):
        many = live[f]
        step = (times[f] - times[f - 1]) / substeps if f > 0 else 0.0
        for s in range(substeps if f > 0 else 0):
            begin = times[f - 1] + s * step
            left, length, ended = step, step, False
            while not ended:
                r = 0
                while r < 4:
                    part = 0.0 if r == 0 else length if r == 3 else 0.5 * length
                    if r > 0:
                        _to_stage(r, part, x, u, a, dx, du, da, many)
                    time, span = begin + part, (0, 0)
                    if mode != NONE:
                        # of the whole step: its parts are on the same side of a knot
                        middle = times[f - 1] + (s + 0.5) * step
                        span = torque(mode, stamps, table, time, middle, value, rate, tau, slope)
                    # ``forward`` leaves the factors of M in h and sums of subtrees in w; the tangents need
                    # the inertia of each link alone, which ``place`` restores.
                    if r == 0:
                        hold[:] = 0.0
                    forward(parent, kind, links, gravity, x[r], u[r], tau, hold, w, h, a[r])
                    # as in ``planar.rollout``, so that these are the derivatives of that very rollout
                    if r == 0:
                        length = part_of_step(parent, kind, links, u[0], a[0], h, left, step, hold)
                        if hold.any():
                            forward(parent, kind, links, gravity, x[0], u[0], tau, hold, w, h, a[0])
                    place(parent, kind, links, x[r], u[r], w)
                    needed_forces(parent, kind, links, gravity, u[r], a[r], w)
                    move(parent, kind, links, dlinks, x[r], u[r], dx[r], du[r], w, t, many)
                    push(parent, links, dlinks, dgravity, u[r], a[r], du[r], w, t, many)
                    if airy:
                        push_air(kind, links, dlinks, w, t, many)
                    gather(parent, links, dlinks, u[r], a[r], du[r], w, t, da[r], many)
                    if resisted:
                        brake(kind, links, dlinks, x[r], u[r], a[r], dx[r], du[r], da[r], many)
                    if mode != NONE:
                        _add_torque(
                            tau, slope, time, value, span, slot, loads, clocks, lagging, lags, da[r], many
                        )
                    # da holds dtau - (dM a + dbias); M is that of this stage
                    solve_all(parent, h, da[r], many)
                    r += 1
                    if r == 4 and turns(kind, links, u, a, length, step):
                        r, length = 1, 0.5 * length
                _to_end(length / 6.0, x, u, a, dx, du, da, many)
                ended = not abs(length) < abs(left)
                left -= length
                begin += length
        for i in range(n):
            q[f, i], v[f, i] = x[0, i], u[0, i]
            for k in range(many):
                dq[f, i, order[k]], dv[f, i, order[k]] = dx[0, i, k], du[0, i, k]
    return q, v, dq, dv
