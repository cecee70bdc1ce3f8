"""Numba kernels: how far an integration goes at once where dry friction changes its sign."""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.mechanism.ahead import smoothed_sign
from monodyn.mechanism.tree import CREEP, FRICTION, LEAD
from monodyn.uncounted import COUNTED, INLINED

SETTLED = 4.0
"""Rate over that of creep beyond which dry friction no longer changes (to 1e-3)."""
AHEAD = 1.5
"""The time in which a rate comes near zero by the acceleration of now is divided by this."""
RESOLVED = 1.0
"""Largest change of a rate in a part of a step through zero, in units of the rate of creep."""
MOST_PARTS = 1024
"""The shortest part of a step is that share of it, a power of two."""
STABLE = 2.0
"""Longest part of a step in which a joint is held, in units of the time in which it comes to rest: a
Runge-Kutta step of order four leaves that state beyond 2.8."""
LED = 0.25
"""The same in units of its lead, where friction that leads brings a joint to rest: exact to 1e-4 then."""
TURNED = 0.5
"""Change of the smoothed sign in a part of a step, at most, where friction leads."""
MOST_HELD, MOST_BETWEEN, FASTEST = 64, 512, 3e4
"""Such parts of a step, and of all steps between two stamps, at most, and the largest rate at which a joint
comes to rest [1/s] ..."""
SHARE = 0.5
"""... and how much of what friction would take off the rate in a longer one is added to the inertia, by the
rate: the way to rest is then gone by two thirds at most, for any length."""


@njit(cache=True, error_model="numpy", **INLINED)
def part_of_step(parent, kind, links, v, a, h, left, step, substeps, hold):  # pragma: no cover - compiled
    """Return how far to go at once of what is ``left`` of a step, where dry friction may change its sign.

    A step over the change misses it by its own length times the friction, however smooth all else is; so one
    goes up to it, and through it by parts in which a rate changes by at most ``RESOLVED`` widths of the
    friction's own transition. A joint that is held has no acceleration, but comes to rest so fast that longer
    parts than ``STABLE`` would leave that state, and still more its derivatives. Where that takes more than
    ``MOST_HELD`` or ``MOST_BETWEEN`` of them, or goes faster than ``FASTEST``, under a friction that hardly
    anything overcomes, the joint is not followed to its rest: ``hold`` (dof,) is filled by what is added to
    its inertia, so that it goes a share of the way to rest in a part of any length. Derivatives leave out how
    that changes.

    ``step`` is one of ``substeps`` between two stamps; ``v`` and ``a`` (dof,) are rates and accelerations
    now, ``h`` (dof, dof) the factored inertia matrix.

    Source:
        Hairer and Wanner, Solving Ordinary Differential Equations II, 1996, section IV.7 (linearly implicit
        methods with an inexact Jacobian).
    """
    longest, held, forth = abs(left), 0.0, 1.0 if step > 0.0 else -1.0
    most = min(MOST_HELD, max(MOST_BETWEEN // substeps, 1))
    for i in range(links.shape[0]):
        hold[i] = 0.0
        if links[i, FRICTION].real == 0.0:
            continue
        lead, creep = links[i, LEAD].real, CREEP[kind[i]]
        rate, change = v[i].real + lead * a[i].real, abs(a[i].real)
        beyond = abs(rate) - SETTLED * creep
        if beyond > 0.0 and not forth * rate * a[i].real < 0.0:
            continue
        alone = links[i, FRICTION].real * _yield(parent, h, i)
        # within its turn friction that leads takes the rate to zero in the time of the lead, not faster
        free = alone if lead == 0.0 else min(alone, creep / lead)
        if free > FASTEST * creep or free * abs(step) > STABLE * most * creep:
            hold[i] = free
        elif beyond > 0.0:
            longest = min(longest, (beyond / AHEAD + RESOLVED * creep) / change)
        elif lead == 0.0:
            held += free / creep
            longest = min(longest, RESOLVED * creep / max(change, 1e-300))
        else:
            # what friction turns with goes on by so much less, until its grip is full again; and a lead that
            # is short takes no more parts than none
            bend = lead * (1.0 - smoothed_sign(rate, creep) ** 2)
            held += STABLE / max(LED * lead, STABLE * (creep / alone - bend))
            slow = 1.0 - bend * alone / creep
            longest = min(longest, 0.5 * RESOLVED * creep / max(slow * change, 1e-300))
    if held > 0.0:
        longest = min(longest, STABLE / held)
    part = left
    # a power of two: parts are the same for motions nearby then, and derivatives those of this very motion;
    # of a motion without bounds nothing is a number
    if longest < abs(left):
        share = max(longest / abs(step), 1.0 / MOST_PARTS)
        part = step * 2.0 ** np.floor(np.log2(share))
    for i in range(links.shape[0]):
        if hold[i] > 0.0:
            # what friction takes off by the rate; the least rate stands for rest
            rate = max(abs(v[i].real), 1e-3 * CREEP[kind[i]])
            share = abs(smoothed_sign(rate, CREEP[kind[i]])) / rate
            # backward in time nothing comes to rest
            slow = part * hold[i] * share > STABLE
            hold[i] = SHARE * part * links[i, FRICTION].real * share if slow else 0.0
    return part


@njit(cache=True, error_model="numpy", **INLINED)
def is_held(hold):  # pragma: no cover - compiled
    """Return whether ``part_of_step`` has added to the inertia at a joint; ``hold`` is (dof,)."""
    held = False
    for i in range(hold.size):
        held = held or hold[i] != 0.0
    return held


@njit(cache=True, error_model="numpy", **INLINED)
def turns(kind, links, u0, a0, u, a, length, step):  # pragma: no cover - compiled
    """Return whether friction that leads turns too far in a part of a step, which is then to be halved.

    Accelerations come into it, and those of a joint change fast where another one turns: what is ahead is not
    seen in the state before. ``u0``, ``a0`` and ``u``, ``a`` (dof,) are rates and accelerations of the first
    and the last stage of the part.
    """
    if abs(length) <= abs(step) / MOST_PARTS:
        return False
    for i in range(links.shape[0]):
        lead, creep = links[i, LEAD].real, CREEP[kind[i]]
        if lead == 0.0 or links[i, FRICTION].real == 0.0:
            continue
        before = smoothed_sign(u0[i].real + lead * a0[i].real, creep)
        after = smoothed_sign(u[i].real + lead * a[i].real, creep)
        if abs(after - before) > TURNED:
            return True
    return False


@njit(cache=True, error_model="numpy", **COUNTED)
def _yield(parent, h, i):  # pragma: no cover - compiled
    """Return the acceleration of joint i by a unit force at it: a diagonal entry of the inverse of M."""
    x = np.zeros(h.shape[0])
    x[i] = 1.0
    total = 0.0
    while i >= 0:
        # D L x = L^-T e: entries toward the root alone; their squares over D add up
        j = parent[i]
        while j >= 0:
            x[j] -= h[i, j].real * x[i]
            j = parent[j]
        total += x[i] * x[i] / h[i, i].real
        i = parent[i]
    return total
