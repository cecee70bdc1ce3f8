"""Numba kernels: dry friction, as a smoothed sign of the rate or of the rate a little later.

A simulator that has dry friction as a soft constraint, as MuJoCo does, lets it turn before the rate does: it
follows v + lead a, where the acceleration a is the one with friction. Then accelerations solve an equation.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.mechanism.branches import factor, solve
from monodyn.mechanism.tree import CREEP, FRICTION, LEAD
from monodyn.uncounted import COUNTED, INLINED, UNCOUNTED

MOST_NEWTON, MOST_HALVED = 60, 50
"""Steps to the accelerations under friction that leads, and halvings of one of them, at most."""
SETTLED_AT = 1e-10
"""Change of what friction turns with, relative to itself or the rate of creep, at which they are found."""


@njit(cache=True, error_model="numpy", **INLINED)
def smoothed_sign(rate, creep):  # pragma: no cover - compiled
    """Return the smoothed sign of ``rate``, tanh(rate / creep), without overflow for complex rates."""
    x = rate / creep
    if x.real > 20.0:
        return x * 0.0 + 1.0
    if x.real < -20.0:
        return x * 0.0 - 1.0
    # tanh(x) by exp(-2 x), which serves both real and complex rates
    e = np.exp(-2.0 * x)
    return (1.0 - e) / (1.0 + e)


@njit(cache=True, error_model="numpy", **INLINED)
def _ahead(i, kind, links, v, a):  # pragma: no cover - compiled
    """Return the dry friction of joint i that turns ahead of the rate, and its slope by the acceleration.

    ``a`` is the acceleration of that joint; both are 0 where friction turns with the rate.
    """
    lead, creep = links[i, LEAD], CREEP[kind[i]]
    grip = smoothed_sign(v[i] + lead * a, creep)
    force = links[i, FRICTION] if lead != 0.0 else 0.0 * links[i, FRICTION]
    return force * grip, force * (1.0 - grip * grip) * lead / creep


@njit(cache=True, error_model="numpy", **COUNTED)
def turn_ahead(parent, kind, links, v, h, a):  # pragma: no cover - compiled
    """Solve M a + F s((v + lead a) / creep) = b, s the smoothed sign, at the joints that have a lead.

    ``h`` (dof, dof) comes with M and ``a`` (dof,) with b; they leave with the factors of the Jacobian
    M + F s' lead / creep, through which accelerations depend on all else, and with the solution.
    """
    n = parent.size
    m, b, x = np.empty((n, n)), np.empty(n), np.empty(n)
    for i in range(n):
        b[i] = a[i].real
        j = i
        while j >= 0:
            m[i, j] = h[i, j].real
            j = parent[j]
    _balance(parent, kind, links, v, m, b, x)
    # One more of Newton's steps, in the numbers of the tree: of complex ones it has the exact derivative.
    for i in range(n):
        grip, slope = _ahead(i, kind, links, v, x[i])
        a[i] -= grip + h[i, i] * x[i]
        j = parent[i]
        while j >= 0:
            a[i] -= h[i, j] * x[j]
            a[j] -= h[i, j] * x[i]
            j = parent[j]
        h[i, i] += slope
    factor(parent, h)
    solve(parent, h, a)
    for i in range(n):
        a[i] += x[i]


@njit(cache=True, error_model="numpy", **COUNTED)
def _balance(parent, kind, links, v, m, b, x):  # pragma: no cover - compiled
    """Fill ``x`` (dof,) with the real accelerations that balance ``m`` (dof, dof), friction and ``b`` (dof,).

    They are where a convex function is least, whose gradient is M x + F s - b: M is positive definite and s
    rises. So there is one solution, and Newton's method finds it from anywhere with a search along its steps,
    which overshoot where s is all but flat.
    """
    n = parent.size
    k, d, left = np.empty((n, n)), np.empty(n), np.empty(n)
    x[:] = 0.0
    for _ in range(MOST_NEWTON):
        k[:] = m
        left[:] = b
        for i in range(n):
            grip, slope = _ahead(i, kind, links, v, x[i])
            left[i] -= grip.real + m[i, i] * x[i]
            j = parent[i]
            while j >= 0:
                left[i] -= m[i, j] * x[j]
                left[j] -= m[i, j] * x[i]
                j = parent[j]
            k[i, i] += slope.real
        d[:] = left
        factor(parent, k)
        solve(parent, k, d)
        settled = True
        for i in range(n):
            lead = links[i, LEAD].real
            if lead * abs(d[i]) > SETTLED_AT * max(CREEP[kind[i]], abs(v[i].real + lead * x[i])):
                settled = False
        if settled:
            break
        share = _share(parent, kind, links, v, m, x, d, left)
        for i in range(n):
            x[i] += share * d[i]


@njit(cache=True, error_model="numpy", **UNCOUNTED)
def _share(parent, kind, links, v, m, x, d, left):  # pragma: no cover - compiled
    """Return how much of the step ``d`` from ``x`` to take: all of it unless the function rises there again.

    ``left`` (dof,) is minus the gradient at ``x``. Along the step the slope of the function rises from below
    zero; the share is halved in between until the slope is less than half of what it was.
    """
    falls, bends = 0.0, 0.0
    for i in range(parent.size):
        falls += left[i] * d[i]
        bends += m[i, i] * d[i] * d[i]
        j = parent[i]
        while j >= 0:
            bends += 2.0 * m[i, j] * d[i] * d[j]
            j = parent[j]
    low, high, share = 0.0, 1.0, 1.0
    for _ in range(MOST_HALVED):
        slope = share * bends - falls
        for i in range(parent.size):
            after, before = (
                _ahead(i, kind, links, v, x[i] + share * d[i])[0],
                _ahead(i, kind, links, v, x[i])[0],
            )
            slope += (after.real - before.real) * d[i]
        if abs(slope) <= 0.5 * falls or (slope < 0.0 and share == 1.0):
            break
        low, high = (low, share) if slope > 0.0 else (share, high)
        share = 0.5 * (low + high)
    return share
