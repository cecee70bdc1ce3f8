"""Numba kernels: derivatives of what acts at single joints: frictions, drag and springs."""

from __future__ import annotations

from numba import njit

from monodyn.mechanism.ahead import smoothed_sign
from monodyn.mechanism.tree import ARMATURE, CREEP, DAMPING, DRAG, FRICTION, LEAD, REST, STIFFNESS
from monodyn.uncounted import INLINED


@njit(cache=True, error_model="numpy", **INLINED)
def braked(i, kind, links, v, a):  # pragma: no cover - compiled
    """Return the derivative of dry friction and drag at joint i by its rate, at fixed accelerations."""
    slope = 0.0
    if links[i, FRICTION] != 0.0:
        # where friction leads, ``h`` has what its slope by the acceleration adds
        creep = CREEP[kind[i]]
        grip = smoothed_sign(v[i] + links[i, LEAD] * a[i], creep)
        slope = links[i, FRICTION] * (1.0 - grip * grip) / creep
    if links[i, DRAG] != 0.0:
        slope += 2.0 * links[i, DRAG] * abs(v[i])
    return slope


@njit(cache=True, error_model="numpy", **INLINED)
def brake(kind, links, at, what, many, q, v, a, da):  # pragma: no cover - compiled
    """Subtract what directions change of friction, drag, spring and armature at joints from ``da`` (dof,
    direction); ``at`` and ``what`` are as in ``by_links``."""
    for row in range(many):
        k, i = at[row, 0], at[row, 1]
        if what[row, FRICTION] != 0.0 or what[row, LEAD] != 0.0:
            creep = CREEP[kind[i]]
            grip = smoothed_sign(v[i] + links[i, LEAD] * a[i], creep)
            ahead = links[i, FRICTION] * (1.0 - grip * grip) / creep * a[i]
            da[i, k] -= what[row, FRICTION] * grip + what[row, LEAD] * ahead
        da[i, k] -= (
            what[row, ARMATURE] * a[i]
            + what[row, DAMPING] * v[i]
            + what[row, DRAG] * abs(v[i]) * v[i]
            + what[row, STIFFNESS] * (q[i] - links[i, REST])
            - links[i, STIFFNESS] * what[row, REST]
        )
