"""Numba kernel: the numbers on which motions depend, of many trees (``regrouped.features``)."""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.mechanism import tree
from monodyn.mechanism.assembled import over


@njit(cache=True, nogil=True, error_model="numpy")
def factors(parent, kind, links, gravity, absolute):  # pragma: no cover - compiled
    """Return the factors of the equations of motion, (feature, draw), and what divides ratios, (draw,).

    ``links`` is (dof, column, draw) and ``gravity`` (2, draw), of one type. The mass of everything that hangs
    on a hinged body is moved to the joint it hangs on; where something slides on it that cannot be.
    """
    dofs, _, draws = links.shape
    hinged, last = np.ones(dofs, np.bool_), -1
    for i in range(dofs):
        if kind[i] != tree.HINGE:
            hinged[i] = False
            if parent[i] >= 0:
                hinged[parent[i]] = False
    count = 0
    for i in range(dofs):
        count += 8
        if hinged[i]:
            last = i
            count += 4
            if parent[i] >= 0:
                count += 4 if kind[parent[i]] == tree.HINGE else 2
    found, unit = np.empty((count, draws), links.dtype), np.empty(draws, links.dtype)
    total, inertia, first_x, first_y = (
        np.empty(dofs, links.dtype),
        np.empty(dofs, links.dtype),
        np.empty(dofs, links.dtype),
        np.empty(dofs, links.dtype),
    )
    for k in range(draws):
        for i in range(dofs):
            total[i] = links[i, tree.MASS, k]
        for i in range(dofs - 1, -1, -1):  # children stand after their parents
            if parent[i] >= 0:
                total[parent[i]] += total[i]
        for i in range(dofs):
            mass, cx, cy = links[i, tree.MASS, k], links[i, tree.COM_X, k], links[i, tree.COM_Y, k]
            inertia[i] = links[i, tree.INERTIA, k] + mass * (cx * cx + cy * cy)
            first_x[i], first_y[i] = mass * cx, mass * cy
        for i in range(dofs):
            p = parent[i]
            if p >= 0:
                ax, ay = links[i, tree.ANCHOR_X, k], links[i, tree.ANCHOR_Y, k]
                inertia[p] += total[i] * (ax * ax + ay * ay)
                first_x[p] += total[i] * ax
                first_y[p] += total[i] * ay
        unit[k] = inertia[last] if last >= 0 else total[dofs - 1]
        by = unit[k] * 0.0 + 1.0 if absolute else unit[k]
        n = 0
        for i in range(dofs):
            found[n, k] = over(inertia[i] if hinged[i] else total[i], by)
            # where a spring is slack counts as much as the spring does
            found[n + 1, k] = over(links[i, tree.STIFFNESS, k] * links[i, tree.REST, k], by)
            found[n + 2, k] = over(links[i, tree.DAMPING, k], by)
            found[n + 3, k] = over(links[i, tree.FRICTION, k], by)
            found[n + 4, k] = over(links[i, tree.STIFFNESS, k], by)
            found[n + 5, k] = over(links[i, tree.DRAG, k], by)
            found[n + 6, k] = over(links[i, tree.AIR, k], by)
            found[n + 7, k] = over(links[i, tree.ARMATURE, k], by)
            n += 8
            if not hinged[i]:
                continue
            x, y = over(first_x[i], by), over(first_y[i], by)
            found[n, k], found[n + 1, k] = x * gravity[0, k], x * gravity[1, k]
            found[n + 2, k], found[n + 3, k] = y * gravity[0, k], y * gravity[1, k]
            n += 4
            if parent[i] >= 0 and kind[parent[i]] == tree.HINGE:
                ax, ay = links[i, tree.ANCHOR_X, k], links[i, tree.ANCHOR_Y, k]
                found[n, k], found[n + 1, k] = x * ax, x * ay
                found[n + 2, k], found[n + 3, k] = y * ax, y * ay
                n += 4
            elif parent[i] >= 0:
                # on a slide the first moment couples by itself
                found[n, k], found[n + 1, k] = x, y
                n += 2
    return found, unit
