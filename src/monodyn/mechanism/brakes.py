"""Numba kernels: derivatives of what most joints lack: dry friction, drag and springs."""

from __future__ import annotations

from numba import njit

from monodyn.mechanism.ahead import smoothed_sign
from monodyn.mechanism.tree import CREEP, DRAG, FRICTION, LEAD, REST, STIFFNESS

BRAKED = (FRICTION, DRAG, STIFFNESS)
"""Columns of ``brake``: leads and rests act through them."""


@njit(cache=True, error_model="numpy")
def brake(kind, links, dlinks, q, v, a, dq, dv, da, live):  # pragma: no cover - compiled
    """Add minus the derivatives of dry friction, drag and springs to ``da`` (dof, direction)."""
    for i in range(kind.size):
        # where friction leads, ``h`` has what its slope by the acceleration adds
        creep = CREEP[kind[i]]
        grip = smoothed_sign(v[i] + links[i, LEAD] * a[i], creep)
        slope = links[i, FRICTION] * (1.0 - grip * grip) / creep
        ahead = slope * a[i]
        if links[i, DRAG] != 0.0:
            slope += 2.0 * links[i, DRAG] * abs(v[i])
        for k in range(live):
            da[i, k] -= (
                slope * dv[i, k]
                + dlinks[i, FRICTION, k] * grip
                + dlinks[i, LEAD, k] * ahead
                + dlinks[i, DRAG, k] * abs(v[i]) * v[i]
                + dlinks[i, STIFFNESS, k] * (q[i] - links[i, REST])
                + links[i, STIFFNESS] * (dq[i, k] - dlinks[i, REST, k])
            )


@njit(cache=True, error_model="numpy")
def occurs(links, dlinks, columns):  # pragma: no cover - compiled
    """Return whether one of the columns is anywhere but zero, or a direction changes it."""
    for i in range(links.shape[0]):
        for c in columns:
            if links[i, c] != 0.0:
                return True
            for k in range(dlinks.shape[2]):
                if dlinks[i, c, k] != 0.0:
                    return True
    return False
