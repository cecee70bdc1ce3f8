"""Numba kernels: planar multibody dynamics of any joint tree (with ``branches`` and ``tangents``).

All quantities are planar spatial vectors about one fixed point, the first joint's place at q = 0: a motion is
(turn rate, velocity at that point), a force is (moment about it, force), an inertia is (m, m c_x, m c_y, J).
Expressed so, inertias of a subtree add up, and one outward and one inward pass give the bias forces and the
joint-space inertia matrix, which is factored along the branches of the tree.

The kernels take ``float64`` or ``complex128`` trees (``links``, ``gravity``, ``q``, ``v`` of one type), so
that a complex step differentiates them exactly.

Source: R. Featherstone, Rigid Body Dynamics Algorithms (2008), tables 5.1 (recursive Newton-Euler), 6.2
(composite rigid body) and 6.3 (LTDL factorization), in planar coordinates; for the double pendulum this is
eq. (8) of the 2012 paper (``paper/two_link.py``).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.mechanism import tree
from monodyn.mechanism.ahead import smoothed_sign, turn_ahead
from monodyn.mechanism.branches import factor, solve
from monodyn.mechanism.drive import NONE, torque
from monodyn.mechanism.reversals import is_held, part_of_step, turns
from monodyn.uncounted import INLINED

C, S, PHI, OX, OY, SW, SX, SY, VW, VX, VY, M, MX, MY, J, FN, FX, FY, AW, AX, AY = range(21)
ALL_M, ALL_MX, ALL_MY, ALL_J = range(21, 25)
"""Columns of the scratch ``w``, one row a link: cosine, sine and angle of its frame; its origin; the motion
that a unit rate of its joint is (S), its own motion (V), inertia (M to J), force (F), acceleration (A); and,
after ``forward``, the inertia of the link with all that it carries."""
WORK = 25


@njit(cache=True, error_model="numpy", **INLINED)
def _place_inertia(i, links, ox, oy, w):  # pragma: no cover - compiled
    """Fill mass, first and second moment of link i, whose frame is at (ox, oy), about the fixed point.

    In this form inertias of links add up.
    """
    x = ox + w[i, C] * links[i, tree.COM_X] - w[i, S] * links[i, tree.COM_Y]
    y = oy + w[i, S] * links[i, tree.COM_X] + w[i, C] * links[i, tree.COM_Y]
    w[i, M] = links[i, tree.MASS]
    w[i, MX] = links[i, tree.MASS] * x
    w[i, MY] = links[i, tree.MASS] * y
    w[i, J] = links[i, tree.INERTIA] + w[i, MX] * x + w[i, MY] * y
    w[i, ALL_M], w[i, ALL_MX], w[i, ALL_MY], w[i, ALL_J] = w[i, M], w[i, MX], w[i, MY], w[i, J]


@njit(cache=True, error_model="numpy", **INLINED)
def place(parent, kind, links, q, v, w):  # pragma: no cover - compiled
    """Fill pose, motion subspace, velocity and inertia of every link (columns C to J of ``w``), outward.

    ``q`` and ``v`` are (dof,), ``w`` is (dof, WORK).
    """
    # A parent comes before its children, so that its row is complete when a child reads it.
    for i in range(parent.size):
        p = parent[i]
        if p < 0:
            # Everything is about the first joint's place, near the mechanism: about a point far away the
            # moments of all links would be large and nearly cancel.
            ox = links[i, tree.ANCHOR_X] - links[0, tree.ANCHOR_X]
            oy = links[i, tree.ANCHOR_Y] - links[0, tree.ANCHOR_Y]
            phi = links[i, tree.ANGLE]
        else:
            ox = w[p, OX] + w[p, C] * links[i, tree.ANCHOR_X] - w[p, S] * links[i, tree.ANCHOR_Y]
            oy = w[p, OY] + w[p, S] * links[i, tree.ANCHOR_X] + w[p, C] * links[i, tree.ANCHOR_Y]
            phi = w[p, PHI] + links[i, tree.ANGLE]
        if kind[i] == tree.HINGE:
            sign = links[i, tree.AXIS_X]
            phi += sign * q[i]
            w[i, C] = np.cos(phi)
            w[i, S] = np.sin(phi)
            # A turn about the hinge at (ox, oy) moves the fixed point by -turn x origin.
            w[i, SW] = sign
            w[i, SX] = sign * oy
            w[i, SY] = -sign * ox
        else:
            w[i, C] = np.cos(phi)
            w[i, S] = np.sin(phi)
            dx = w[i, C] * links[i, tree.AXIS_X] - w[i, S] * links[i, tree.AXIS_Y]
            dy = w[i, S] * links[i, tree.AXIS_X] + w[i, C] * links[i, tree.AXIS_Y]
            ox += dx * q[i]
            oy += dy * q[i]
            # A slide moves every point by the same amount, whatever the point of reference is.
            w[i, SW] = 0.0
            w[i, SX] = dx
            w[i, SY] = dy
        # All motions are about one point, so that velocities simply add up from the root outward.
        w[i, PHI] = phi
        w[i, OX] = ox
        w[i, OY] = oy
        w[i, VW] = w[i, SW] * v[i]
        w[i, VX] = w[i, SX] * v[i]
        w[i, VY] = w[i, SY] * v[i]
        if p >= 0:
            w[i, VW] += w[p, VW]
            w[i, VX] += w[p, VX]
            w[i, VY] += w[p, VY]
        _place_inertia(i, links, ox, oy, w)


@njit(cache=True, error_model="numpy", **INLINED)
def _bias(parent, gravity, v, w):  # pragma: no cover - compiled
    """Fill the force (FN, FX, FY) that each link needs when every joint acceleration is zero.

    ``gravity`` is (2,), ``v`` is (dof,), ``w`` is (dof, WORK) as ``place`` leaves it.
    """
    for i in range(parent.size):
        p = parent[i]
        if p < 0:
            # A ground that accelerates upward in place of gravity: the pass outward carries it to every link.
            w[i, AW] = 0.0
            w[i, AX] = -gravity[0]
            w[i, AY] = -gravity[1]
        else:
            # The subspace is carried along by the parent: its rate of change is V_parent x S, times v.
            w[i, AW] = w[p, AW]
            w[i, AX] = w[p, AX] + v[i] * (w[i, SW] * w[p, VY] - w[p, VW] * w[i, SY])
            w[i, AY] = w[p, AY] + v[i] * (w[p, VW] * w[i, SX] - w[i, SW] * w[p, VX])
        # f = I A + V x* (I V), where (px, py) is the momentum; the moment of momentum drops out in a plane.
        px = w[i, M] * w[i, VX] - w[i, VW] * w[i, MY]
        py = w[i, M] * w[i, VY] + w[i, VW] * w[i, MX]
        w[i, FN] = (
            w[i, J] * w[i, AW] + w[i, MX] * w[i, AY] - w[i, MY] * w[i, AX] + w[i, VX] * py - w[i, VY] * px
        )
        w[i, FX] = w[i, M] * w[i, AX] - w[i, AW] * w[i, MY] - w[i, VW] * py
        w[i, FY] = w[i, M] * w[i, AY] + w[i, AW] * w[i, MX] + w[i, VW] * px


@njit(cache=True, error_model="numpy", **INLINED)
def air_direction(i, kind, links, w):  # pragma: no cover - compiled
    """Return what the air acts along on link i, (moment about the fixed point, x, y), as ``w`` stands.

    The product of this and the link's motion is the motion z that the air resists; it pushes with -c |z| z
    times this. All of it acts at the link's centre of oscillation, at the distance J / (m r) from its hinge,
    J about the hinge and r the distance of the centre of mass, and across the line to the hinge. Where its
    hinge rests z is the turn rate, and a rod meets the moment that its points meet, each resisted by the
    square of its own speed; where the tip moves the same way as the hinge and no slower, moment and force are
    those within about 15 %. A slide's link is resisted along the slide.
    """
    if kind[i] != tree.HINGE:
        return w[i, OX] * w[i, SY] - w[i, OY] * w[i, SX], w[i, SX], w[i, SY]
    m, cx, cy = links[i, tree.MASS], links[i, tree.COM_X], links[i, tree.COM_Y]
    inertia = links[i, tree.INERTIA] + m * (cx * cx + cy * cy)
    if inertia.real <= 0.0:
        return inertia * 0.0 + 1.0, inertia * 0.0, inertia * 0.0
    # one over the distance of the centre of oscillation, toward it
    x = m * (w[i, C] * cx - w[i, S] * cy) / inertia
    y = m * (w[i, S] * cx + w[i, C] * cy) / inertia
    return 1.0 + x * w[i, OX] + y * w[i, OY], -y, x


@njit(cache=True, error_model="numpy", **INLINED)
def resist(kind, links, w):  # pragma: no cover - compiled
    """Add what the air takes to the forces (FN, FX, FY) that the links need."""
    for i in range(kind.size):
        if links[i, tree.AIR] != 0.0:
            n, x, y = air_direction(i, kind, links, w)
            z = n * w[i, VW] + x * w[i, VX] + y * w[i, VY]
            # |z| z is analytic on either side of 0, which a complex step needs; abs() of a complex is not
            force = links[i, tree.AIR] * (z * z if z.real > 0.0 else -z * z)
            w[i, FN] += force * n
            w[i, FX] += force * x
            w[i, FY] += force * y


@njit(cache=True, error_model="numpy", **INLINED)
def forward(parent, kind, links, gravity, q, v, tau, hold, w, h, a):  # pragma: no cover - compiled
    """Write the accelerations into ``a`` and the factored inertia matrix into ``h``; ``w`` is scratch.

    ``q``, ``v``, ``tau``, ``hold`` and ``a`` are (dof,), ``h`` is (dof, dof), ``w`` is (dof, WORK); ``hold``
    adds to the inertia at the joints.
    """
    place(parent, kind, links, q, v, w)
    _bias(parent, gravity, v, w)
    resist(kind, links, w)
    leading = False
    # Inward: when link i is reached, all of its subtree has been added to it, so that its inertia and its
    # force are those of the whole subtree that its joint carries.
    for i in range(parent.size - 1, -1, -1):
        a[i] = (
            tau[i]
            - links[i, tree.DAMPING] * v[i]
            - links[i, tree.STIFFNESS] * (q[i] - links[i, tree.REST])
            - (w[i, SW] * w[i, FN] + w[i, SX] * w[i, FX] + w[i, SY] * w[i, FY])
        )
        if links[i, tree.FRICTION] != 0.0:
            if links[i, tree.LEAD] != 0.0:
                leading = True
            else:
                a[i] -= links[i, tree.FRICTION] * smoothed_sign(v[i], tree.CREEP[kind[i]])
        if links[i, tree.DRAG] != 0.0:
            # as in ``resist``
            a[i] -= links[i, tree.DRAG] * (v[i] * v[i] if v[i].real > 0.0 else -v[i] * v[i])
        # Composite rigid body: (turn, px, py) is the force that moves the rigid subtree with a unit
        # acceleration of joint i; its projection on the subspaces of the joints inward is a row of M(q).
        px = w[i, ALL_M] * w[i, SX] - w[i, SW] * w[i, ALL_MY]
        py = w[i, ALL_M] * w[i, SY] + w[i, SW] * w[i, ALL_MX]
        turn = w[i, ALL_J] * w[i, SW] + w[i, ALL_MX] * w[i, SY] - w[i, ALL_MY] * w[i, SX]
        h[i, i] = w[i, SW] * turn + w[i, SX] * px + w[i, SY] * py + links[i, tree.ARMATURE] + hold[i]
        j = parent[i]
        if j >= 0:
            w[j, ALL_M] += w[i, ALL_M]
            w[j, ALL_MX] += w[i, ALL_MX]
            w[j, ALL_MY] += w[i, ALL_MY]
            w[j, ALL_J] += w[i, ALL_J]
            w[j, FN] += w[i, FN]
            w[j, FX] += w[i, FX]
            w[j, FY] += w[i, FY]
        # Only joints between here and the root: the others have no common link, and ``factor`` skips them.
        while j >= 0:
            h[i, j] = w[j, SW] * turn + w[j, SX] * px + w[j, SY] * py
            j = parent[j]
    if leading:
        turn_ahead(parent, kind, links, v, h, a)
    else:
        factor(parent, h)
        solve(parent, h, a)


@njit(cache=True, error_model="numpy")
def accelerations(parent, kind, links, gravity, q, v, tau):  # pragma: no cover - compiled
    """Return the accelerations in every row of positions, rates and torques, all (frame, dof)."""
    w = np.empty((parent.size, WORK), links.dtype)
    h = np.empty((parent.size, parent.size), links.dtype)
    a, free = np.empty(q.shape, links.dtype), np.zeros(parent.size)
    for f in range(len(q)):
        forward(parent, kind, links, gravity, q[f], v[f], tau[f], free, w, h, a[f])
    return a


@njit(cache=True, error_model="numpy", nogil=True)
def rollouts(
    parent, kind, links, gravity, times, first, substeps, states, mode, stamps, table
):  # pragma: no cover - compiled
    """Integrate runs by Runge-Kutta steps of order four; return positions and rates, each (frame, dof).

    ``times`` is (frame,); run k goes from frame ``first[k]`` to the one before ``first[k + 1]`` and starts in
    ``states[k]`` (2 dof,), positions then rates; ``stamps`` and ``table`` are those of the drive.
    """
    q = np.empty((times.size, parent.size), links.dtype)
    v = np.empty((times.size, parent.size), links.dtype)
    for k in range(first.size - 1):
        rows = slice(first[k], first[k + 1])
        _run(
            parent, kind, links, gravity, times[rows], substeps, states[k], mode, stamps, table, q[rows],
            v[rows],
        )  # fmt: skip
    return q, v


@njit(cache=True, error_model="numpy")
def _run(
    parent, kind, links, gravity, times, substeps, state, mode, stamps, table, q, v
):  # pragma: no cover - compiled
    """Integrate one run into ``q`` and ``v``, (frame, dof)."""
    n = parent.size
    value, rate = np.empty(table.shape[1]), np.empty(table.shape[1])
    slope = np.empty(n, links.dtype)
    w, h = np.empty((n, WORK), links.dtype), np.empty((n, n), links.dtype)
    tau, hold = np.zeros(n, links.dtype), np.zeros(n)
    # at the start of a part of a step, at the stage now, and summed over its stages as a step weighs them
    x0, u0, a0 = np.empty(n, links.dtype), np.empty(n, links.dtype), np.empty(n, links.dtype)
    x, u, a = np.empty(n, links.dtype), np.empty(n, links.dtype), np.empty(n, links.dtype)
    rates, changes = np.empty(n, links.dtype), np.empty(n, links.dtype)
    if times.size == 0:
        return
    x0[:], u0[:] = state[:n], state[n:]
    q[0], v[0] = x0, u0
    for f in range(1, times.size):
        step = (times[f] - times[f - 1]) / substeps
        for s in range(substeps):
            begin = times[f - 1] + s * step
            # the middle of the step determines on which side of a knot its ends are
            middle = begin + 0.5 * step
            left, length, ended = step, step, False
            while not ended:
                for i in range(n):
                    x[i], u[i], hold[i] = x0[i], u0[i], 0.0
                if mode != NONE:
                    torque(mode, stamps, table, begin, middle, value, rate, tau, slope)
                forward(parent, kind, links, gravity, x, u, tau, hold, w, h, a)
                # the first stage does not depend on the length of the part, but where a joint is held
                length = part_of_step(parent, kind, links, u, a, h, left, step, substeps, hold)
                if is_held(hold):
                    forward(parent, kind, links, gravity, x, u, tau, hold, w, h, a)
                for i in range(n):
                    a0[i] = a[i]
                done = False
                while not done:
                    for i in range(n):
                        u[i], a[i], rates[i], changes[i] = u0[i], a0[i], u0[i], a0[i]
                    for k in range(1, 4):
                        part = length if k == 3 else 0.5 * length
                        weight = 1.0 if k == 3 else 2.0
                        for i in range(n):
                            x[i] = x0[i] + part * u[i]
                            u[i] = u0[i] + part * a[i]
                        if mode != NONE:
                            torque(mode, stamps, table, begin + part, middle, value, rate, tau, slope)
                        forward(parent, kind, links, gravity, x, u, tau, hold, w, h, a)
                        for i in range(n):
                            rates[i] += weight * u[i]
                            changes[i] += weight * a[i]
                    done = not turns(kind, links, u0, a0, u, a, length, step)
                    if not done:
                        length *= 0.5
                for i in range(n):
                    x0[i] += length / 6.0 * rates[i]
                    u0[i] += length / 6.0 * changes[i]
                ended = not abs(length) < abs(left)
                left -= length
                begin += length
        for i in range(n):
            q[f, i], v[f, i] = x0[i], u0[i]


@njit(cache=True, error_model="numpy")
def energy(parent, kind, links, gravity, q, v):  # pragma: no cover - compiled
    """Return kinetic, height and spring energy in every row of ``q`` and ``v`` (frame, dof), (frame,)."""
    w = np.empty((parent.size, WORK), links.dtype)
    total = np.zeros(q.shape[0], links.dtype)
    for f in range(q.shape[0]):
        place(parent, kind, links, q[f], v[f], w)
        for i in range(parent.size):
            # Twice the kinetic energy is V.(I V); (MX, MY) holds m c, so that gravity needs no positions.
            px = w[i, M] * w[i, VX] - w[i, VW] * w[i, MY]
            py = w[i, M] * w[i, VY] + w[i, VW] * w[i, MX]
            turn = w[i, J] * w[i, VW] + w[i, MX] * w[i, VY] - w[i, MY] * w[i, VX]
            total[f] += 0.5 * (w[i, VW] * turn + w[i, VX] * px + w[i, VY] * py)
            total[f] += 0.5 * links[i, tree.ARMATURE] * v[f, i] * v[f, i]
            total[f] -= gravity[0] * w[i, MX] + gravity[1] * w[i, MY]
            stretch = q[f, i] - links[i, tree.REST]
            total[f] += 0.5 * links[i, tree.STIFFNESS] * stretch * stretch
    return total
