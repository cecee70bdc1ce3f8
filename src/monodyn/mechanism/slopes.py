"""Numba kernels: derivatives of the equation of motion in one state, by the state and by parameters.

With tau = M(q) a + bias(q, v) solved for a, a direction d obeys M da = dtau - (dM a + dbias): the inverse
dynamics at fixed a, differentiated in closed form, then one solve with the factors at hand. A change of one
joint, or of the place of one link, turns and shifts all that the link carries as one body, a small motion T;
in its own frame that changes velocities by V x T and accelerations by A x T + V x (V x T), V and A those of
the parent link. What any of this does to the force of a subtree follows from three sums over its links
(inertia, force, and the matrix that a change of velocity meets), so that a derivative costs a few products,
however many links are moved.

Names: ``d...`` is a derivative, with the direction as its last axis; ``w`` is the scratch of ``planar``.

Source: S. Singh, R. Russo, P. Wensing, Efficient Analytical Derivatives of Rigid-Body Dynamics using Spatial
Vector Algebra (2022), in planar coordinates, in which the matrix of the velocities has one column.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.mechanism import tree
from monodyn.mechanism.brakes import brake, braked
from monodyn.mechanism.branches import solve_all
from monodyn.mechanism.planar import (
    ALL_M,
    ALL_MX,
    ALL_MY,
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
)  # fmt: skip
from monodyn.uncounted import INLINED

VSX, VSY, BX, BY, IX, IY, KN, KX, KY, GN, GX, GY, RNN, RNX, RNY, RXX, RXY, RYY = range(18)
"""Columns of the scratch ``d``, one row a link: V x S of its joint, and A x S + V x (V x S), which do not
turn; what of an acceleration (I) and of a velocity (K) of all that it carries its joint meets; of all that it
carries, G, the force by a unit turn rate, and R, the resistance of the air, symmetric."""
SLOPE = 18


@njit(cache=True, error_model="numpy", **INLINED)
def outward(parent, kind, links, gravity, v, a, w, d):  # pragma: no cover - compiled
    """Fill A and force (AW to FY of ``w``) of the motion with accelerations ``a``, and VSX to BY of ``d``;
    then sum forces, G and R over all that each link carries.

    ``v`` and ``a`` are (dof,), ``w`` is (dof, WORK) as ``forward`` leaves it, ``d`` is (dof, SLOPE).
    """
    for i in range(parent.size):
        p = parent[i]
        # A root that accelerates against gravity stands for the weight of every link beyond it, so that
        # no link needs a weight of its own.
        pvw, pvx, pvy, paw, pax, pay = 0.0, 0.0, 0.0, 0.0, -gravity[0], -gravity[1]
        if p >= 0:
            pvw, pvx, pvy, paw, pax, pay = w[p, VW], w[p, VX], w[p, VY], w[p, AW], w[p, AX], w[p, AY]
        sw, sx, sy = w[i, SW], w[i, SX], w[i, SY]
        # the parent carries the joint's axis along
        vsx, vsy = sw * pvy - pvw * sy, pvw * sx - sw * pvx
        d[i, VSX], d[i, VSY] = vsx, vsy
        d[i, BX] = sw * pay - paw * sy - pvw * vsy
        d[i, BY] = paw * sx - sw * pax + pvw * vsx
        aw, ax, ay = paw + sw * a[i], pax + sx * a[i] + v[i] * vsx, pay + sy * a[i] + v[i] * vsy
        w[i, AW], w[i, AX], w[i, AY] = aw, ax, ay
        # (px, py) is the link's linear momentum. The force is I A + V x* (I V); of the moment of the second
        # term only v x p is left, because turn rates in one plane do not act on each other.
        m, mx, my, vw, vx, vy = w[i, M], w[i, MX], w[i, MY], w[i, VW], w[i, VX], w[i, VY]
        px, py = m * vx - vw * my, m * vy + vw * mx
        w[i, FN] = w[i, J] * aw + mx * ay - my * ax + vx * py - vy * px
        w[i, FX] = m * ax - aw * my - vw * py
        w[i, FY] = m * ay + aw * mx + vw * px
        # by the velocity, along with the axes: V x* (I U) - I (V x U) + U x* (I V) of a motion U, of which
        # the turn rate alone is left in one plane
        d[i, GN], d[i, GX], d[i, GY] = 2.0 * (mx * vx + my * vy), -2.0 * py, 2.0 * px
        d[i, RNN], d[i, RNX], d[i, RNY], d[i, RXX], d[i, RXY], d[i, RYY] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if links[i, tree.AIR] != 0.0:
            n, x, y = air_direction(i, kind, links, w)
            z = n * vw + x * vx + y * vy
            force, slope = links[i, tree.AIR] * abs(z) * z, 2.0 * links[i, tree.AIR] * abs(z)
            w[i, FN] += force * n
            w[i, FX] += force * x
            w[i, FY] += force * y
            d[i, RNN], d[i, RNX], d[i, RNY] = slope * n * n, slope * n * x, slope * n * y
            d[i, RXX], d[i, RXY], d[i, RYY] = slope * x * x, slope * x * y, slope * y * y
    # All is about one fixed point: a child's adds to its parent's without a shift. Parents come before their
    # children, so that each sum is complete before it is passed on.
    for i in range(parent.size - 1, -1, -1):
        p = parent[i]
        if p >= 0:
            w[p, FN] += w[i, FN]
            w[p, FX] += w[i, FX]
            w[p, FY] += w[i, FY]
            for c in range(GN, SLOPE):
                d[p, c] += d[i, c]


@njit(cache=True, error_model="numpy", **INLINED)
def _met(i, w, d, vw, vx, vy, bx, by):  # pragma: no cover - compiled
    """Return the change of the force (n, x, y) of all that link i carries, as its velocity changes by
    (vw, vx, vy) and its acceleration by (0, bx, by)."""
    m, mx, my = w[i, ALL_M], w[i, ALL_MX], w[i, ALL_MY]
    n = mx * by - my * bx + d[i, GN] * vw + d[i, RNN] * vw + d[i, RNX] * vx + d[i, RNY] * vy
    x = m * bx + d[i, GX] * vw + d[i, RNX] * vw + d[i, RXX] * vx + d[i, RXY] * vy
    y = m * by + d[i, GY] * vw + d[i, RNY] * vw + d[i, RXY] * vx + d[i, RYY] * vy
    return n, x, y


@njit(cache=True, error_model="numpy", **INLINED)
def by_state(parent, kind, links, v, a, w, d, by_q, by_v):  # pragma: no cover - compiled
    """Fill the derivatives of the inverse dynamics by positions and rates at fixed accelerations, (dof, dof)
    each; entries of joints that do not carry each other are left as they are.

    ``w`` and ``d`` are as ``outward`` leaves them.
    """
    for i in range(parent.size):
        sw, sx, sy = w[i, SW], w[i, SX], w[i, SY]
        m, mx, my = w[i, ALL_M], w[i, ALL_MX], w[i, ALL_MY]
        ix, iy = sx * m - sw * my, sy * m + sw * mx
        kn = sw * (d[i, GN] + d[i, RNN]) + sx * (d[i, GX] + d[i, RNX]) + sy * (d[i, GY] + d[i, RNY])
        kx = sw * d[i, RNX] + sx * d[i, RXX] + sy * d[i, RXY]
        ky = sw * d[i, RNY] + sx * d[i, RXY] + sy * d[i, RYY]
        d[i, IX], d[i, IY], d[i, KN], d[i, KX], d[i, KY] = ix, iy, kn, kx, ky
        # this joint by those that carry it, itself first
        j = i
        while j >= 0:
            vsx, vsy = d[j, VSX], d[j, VSY]
            by_q[i, j] = ix * d[j, BX] + iy * d[j, BY] + kx * vsx + ky * vsy
            by_v[i, j] = kn * w[j, SW] + kx * w[j, SX] + ky * w[j, SY] + 2.0 * (ix * vsx + iy * vsy)
            j = parent[j]
        by_q[i, i] += links[i, tree.STIFFNESS]
        by_v[i, i] += links[i, tree.DAMPING] + braked(i, kind, links, v, a)
        # those that carry it by this joint: the force of all beyond it also turns along
        j = parent[i]
        if j >= 0:
            vsx, vsy = d[i, VSX], d[i, VSY]
            n, x, y = _met(i, w, d, 0.0, vsx, vsy, d[i, BX], d[i, BY])
            n += sx * w[i, FY] - sy * w[i, FX]
            x -= sw * w[i, FY]
            y += sw * w[i, FX]
            nv, xv, yv = _met(i, w, d, sw, sx, sy, 2.0 * vsx, 2.0 * vsy)
            while j >= 0:
                by_q[j, i] = w[j, SW] * n + w[j, SX] * x + w[j, SY] * y
                by_v[j, i] = w[j, SW] * nv + w[j, SX] * xv + w[j, SY] * yv
                j = parent[j]


@njit(cache=True, error_model="numpy")
def touched(dlinks, count):  # pragma: no cover - compiled
    """Return what the first ``count`` directions change of which link: direction and link, int64 (change, 2),
    in order of the directions, and the derivatives of its columns, (change, column)."""
    n, columns = dlinks.shape[:2]
    at, what = np.empty((count * n, 2), np.int64), np.empty((count * n, columns))
    many = 0
    for k in range(count):
        for i in range(n):
            if dlinks[i, :, k].any():
                at[many, 0], at[many, 1] = k, i
                what[many] = dlinks[i, :, k]
                many += 1
    return at[:many], what[:many]


@njit(cache=True, error_model="numpy", **INLINED)
def by_links(parent, kind, links, gravity, at, what, many, q, v, a, w, d, da):  # pragma: no cover - compiled
    """Subtract the derivatives of the inverse dynamics by what directions change of links, the first ``many``
    rows of ``at`` and ``what`` from ``touched``, from ``da`` (dof, direction)."""
    brake(kind, links, at, what, many, q, v, a, da)
    _by_inertia(parent, kind, links, at, what, many, w, da)
    _by_place(parent, kind, gravity, at, what, many, q, v, a, w, d, da)


@njit(cache=True, error_model="numpy", **INLINED)
def _by_inertia(parent, kind, links, at, what, many, w, da):  # pragma: no cover - compiled
    """Subtract what changes of mass, centre of mass and inertia of links, and of the air's resistance to
    them, add to the forces of the joints that carry them."""
    for row in range(many):
        k, i = at[row, 0], at[row, 1]
        dm, dcx, dcy = what[row, tree.MASS], what[row, tree.COM_X], what[row, tree.COM_Y]
        dinertia, dair = what[row, tree.INERTIA], what[row, tree.AIR]
        air = links[i, tree.AIR]
        if dm == 0.0 and dcx == 0.0 and dcy == 0.0 and dinertia == 0.0 and dair == 0.0 and air == 0.0:
            continue
        m, cx, cy, c, s = links[i, tree.MASS], links[i, tree.COM_X], links[i, tree.COM_Y], w[i, C], w[i, S]
        vw, vx, vy, aw, ax, ay = w[i, VW], w[i, VX], w[i, VY], w[i, AW], w[i, AX], w[i, AY]
        # first and second moments about the fixed point; (x, y) is the centre of mass there
        x, y = w[i, OX] + c * cx - s * cy, w[i, OY] + s * cx + c * cy
        dx, dy = c * dcx - s * dcy, s * dcx + c * dcy
        dmx, dmy = dm * x + m * dx, dm * y + m * dy
        dj = dinertia + dmx * x + dmy * y + m * (x * dx + y * dy)
        # f = I A + V x* p with the momentum p = I V, linear in I
        dpx, dpy = dm * vx - vw * dmy, dm * vy + vw * dmx
        fn = dj * aw + dmx * ay - dmy * ax + vx * dpy - vy * dpx
        fx = dm * ax - aw * dmy - vw * dpy
        fy = dm * ay + aw * dmx + vw * dpx
        if air != 0.0 or dair != 0.0:
            n, ex, ey = air_direction(i, kind, links, w)
            z = n * vw + ex * vx + ey * vy
            law, slope = abs(z) * z, 2.0 * air * abs(z)
            # how the direction changes, turned along with the link
            dex, dey = 0.0, 0.0
            own = links[i, tree.INERTIA] + m * (cx * cx + cy * cy)
            if kind[i] == tree.SLIDE:
                dex = c * what[row, tree.AXIS_X] - s * what[row, tree.AXIS_Y]
                dey = s * what[row, tree.AXIS_X] + c * what[row, tree.AXIS_Y]
            elif own > 0.0:
                more = dinertia + dm * (cx * cx + cy * cy) + 2.0 * m * (cx * dcx + cy * dcy)
                ux = (dm * cx + m * dcx - m * cx * more / own) / own
                uy = (dm * cy + m * dcy - m * cy * more / own) / own
                dex, dey = -(s * ux + c * uy), c * ux - s * uy
            dn = w[i, OX] * dey - w[i, OY] * dex
            change = dair * law + slope * (dn * vw + dex * vx + dey * vy)
            fn += change * n + air * law * dn
            fx += change * ex + air * law * dex
            fy += change * ey + air * law * dey
        while i >= 0:
            da[i, k] -= w[i, SW] * fn + w[i, SX] * fx + w[i, SY] * fy
            i = parent[i]


@njit(cache=True, error_model="numpy", **INLINED)
def _by_place(parent, kind, gravity, at, what, many, q, v, a, w, d, da):  # pragma: no cover - compiled
    """Subtract what changes of the place of joints in their parents' frames, of their frames' turns there, or
    of the directions of slides add to the forces of all joints that they move or that carry them."""
    for row in range(many):
        k, i = at[row, 0], at[row, 1]
        dax, day, t = what[row, tree.ANCHOR_X], what[row, tree.ANCHOR_Y], what[row, tree.ANGLE]
        dux, duy = what[row, tree.AXIS_X], what[row, tree.AXIS_Y]
        if dax == 0.0 and day == 0.0 and t == 0.0 and dux == 0.0 and duy == 0.0:
            continue
        p = parent[i]
        sx, sy = w[i, SX], w[i, SY]
        # a frame turns about its joint's place, from where a slide has moved it; a root that is put elsewhere
        # moves as before
        ox, oy, dx, dy = w[i, OX], w[i, OY], 0.0, 0.0
        pvw, pvx, pvy, paw, pax, pay = 0.0, 0.0, 0.0, 0.0, -gravity[0], -gravity[1]
        if kind[i] == tree.SLIDE:
            ox, oy = ox - sx * q[i], oy - sy * q[i]
        if p >= 0:
            dx = w[p, C] * dax - w[p, S] * day
            dy = w[p, S] * dax + w[p, C] * day
            pvw, pvx, pvy, paw, pax, pay = w[p, VW], w[p, VX], w[p, VY], w[p, AW], w[p, AX], w[p, AY]
        ux, uy = 0.0, 0.0
        if kind[i] == tree.SLIDE:
            ux = w[i, C] * dux - w[i, S] * duy
            uy = w[i, S] * dux + w[i, C] * duy
            dx, dy = dx + q[i] * ux, dy + q[i] * uy
            # the axis itself meets the force of all beyond it
            da[i, k] -= ux * w[i, FX] + uy * w[i, FY]
        tx, ty = dx + t * oy, dy - t * ox
        vx, vy = t * pvy - pvw * ty, pvw * tx - t * pvx
        bx, by = t * pay - paw * ty - pvw * vy, paw * tx - t * pax + pvw * vx
        # another direction of a slide is a second slide along the change, in proportion to the first
        bx += a[i] * ux - 2.0 * v[i] * pvw * uy
        by += a[i] * uy + 2.0 * v[i] * pvw * ux
        vx, vy = vx + v[i] * ux, vy + v[i] * uy
        # the joints beyond, whose ancestor this is
        for r in range(i, parent.size):
            j = r
            while j > i:
                j = parent[j]
            if j == i:
                da[r, k] -= d[r, IX] * bx + d[r, IY] * by + d[r, KX] * vx + d[r, KY] * vy
        if p >= 0:
            n, x, y = _met(i, w, d, 0.0, vx, vy, bx, by)
            n += tx * w[i, FY] - ty * w[i, FX]
            x -= t * w[i, FY]
            y += t * w[i, FX]
            while p >= 0:
                da[p, k] -= w[p, SW] * n + w[p, SX] * x + w[p, SY] * y
                p = parent[p]


@njit(cache=True, error_model="numpy", **INLINED)
def by_gravity(dgravity, d, da, live):  # pragma: no cover - compiled
    """Add what a change of gravity (2, direction) adds to the right-hand side ``da`` (dof, direction)."""
    for i in range(d.shape[0]):
        for k in range(live):
            da[i, k] += d[i, IX] * dgravity[0, k] + d[i, IY] * dgravity[1, k]


@njit(cache=True, error_model="numpy", **INLINED)
def linearize(
    parent, kind, links, gravity, dgravity, at, what, q, v, a, w, h, d, by_q, by_v, da
):  # pragma: no cover - compiled
    """Write the derivatives of the accelerations ``a`` by parameters, positions and rates into the first
    columns of ``da``, (dof, param + 2 dof).

    ``w`` and ``h`` are as ``forward`` leaves them, ``dgravity`` is (2, param), ``at`` and ``what`` are those
    of ``touched``.
    """
    n, params = parent.size, dgravity.shape[1]
    outward(parent, kind, links, gravity, v, a, w, d)
    by_state(parent, kind, links, v, a, w, d, by_q, by_v)
    da[:, :params] = 0.0
    by_links(parent, kind, links, gravity, at, what, len(at), q, v, a, w, d, da)
    by_gravity(dgravity, d, da, params)
    for i in range(n):
        for j in range(n):
            da[i, params + j] = -by_q[i, j]
            da[i, params + n + j] = -by_v[i, j]
    solve_all(parent, h, da, params + 2 * n)


@njit(cache=True, error_model="numpy", nogil=True)
def acceleration_tangents(
    parent, kind, links, dlinks, gravity, dgravity, q, v, tau
):  # pragma: no cover - compiled
    """Return accelerations (row, dof) and their derivatives (row, dof, param + 3 dof) in every row.

    ``q``, ``v`` and ``tau`` are (row, dof); the directions are the parameters, then those three.
    """
    rows, n = q.shape
    params = dlinks.shape[2]
    at, what = touched(dlinks, params)
    w, h, d, hold = np.empty((n, WORK)), np.empty((n, n)), np.empty((n, SLOPE)), np.zeros(n)
    by_q, by_v = np.zeros((n, n)), np.zeros((n, n))
    a, da = np.empty((rows, n)), np.zeros((rows, n, params + 3 * n))
    for f in range(rows):
        # the factors of M stay in h
        forward(parent, kind, links, gravity, q[f], v[f], tau[f], hold, w, h, a[f])
        linearize(
            parent, kind, links, gravity, dgravity, at, what, q[f], v[f], a[f], w, h, d, by_q, by_v, da[f]
        )  # fmt: skip
        for i in range(n):
            da[f, i, params + 2 * n + i] = 1.0
        solve_all(parent, h, da[f, :, params + 2 * n :], n)
    return a, da
