"""numba kernels: area, centroid and mismatch of the drawn silhouette of a mechanism.

A sum over the drawn silhouette of any picture is a sum of row prefix sums of that picture
(``silhouette.mismatch``): of ones it is the area, of the coordinates x and y the first moments. What lies
outside of the picture, or where the background is not known, has no area.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from monodyn.vision.drawing.camera import CENTRE_X, CENTRE_Y, DEPTH, FOCAL, X, Y
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.drawing.silhouette import blank_outlines, blank_spans, draw, mismatch

NOWHERE = 1e18
"""Mismatch of a mechanism that cannot be drawn [px^2]."""


@njit(cache=True)
def moment_sums(weight: np.ndarray) -> np.ndarray:
    """Return the row prefix sums of the pictures w, w x and w y: float32 (3, height, width + 1).

    Args:
        weight: What each pixel counts, float32 (height, width).
    """
    height, width = weight.shape
    sums = np.zeros((3, height, width + 1), dtype=np.float32)
    for y in range(height):
        total, first = 0.0, 0.0
        for x in range(width):
            total += weight[y, x]
            first += weight[y, x] * x
            sums[0, y, x + 1] = total
            sums[1, y, x + 1] = first
            sums[2, y, x + 1] = total * y
    return sums


@njit(cache=True)
def drawn(sums: np.ndarray, rig: Rig, position: np.ndarray) -> np.ndarray:
    """Sum pictures over the drawn silhouette of one pose.

    Args:
        sums: Row prefix sums of each picture, (picture, height, width + 1).
        rig: The mechanism and its camera.
        position: Joint positions, (dof,).

    Returns:
        Drawn area, also outside of the picture [px^2], then the sum of each picture over the silhouette; NaN
        where it cannot be drawn; (1 + picture,).
    """
    pictures = sums.shape[0]
    geoms = rig.radius.shape[0]
    out = np.full(1 + pictures, np.nan)
    outlines = blank_outlines(rig, geoms)
    if not draw(rig, position, outlines):
        return out
    spans = blank_spans(sums[0], geoms)
    for i in range(pictures):
        cost, area = mismatch(sums[i], outlines, spans)
        out[0] = area
        out[1 + i] = 0.5 * (area - cost)
    return out


@njit(cache=True)
def placed_mismatch(
    sums: np.ndarray,
    moments: np.ndarray,
    rig: Rig,
    positions: np.ndarray,
    seen: np.ndarray,
    moves: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Put a camera before each of many poses so that area and centroid are the seen ones, and compare.

    The area falls with the square of the depth and the centroid moves with the camera: two steps of each
    come near the least f1 and f2 (eq. 1 and 2). This ranks the starts of the local search.

    Args:
        sums: Row prefix sums of the seen silhouette.
        moments: From ``moment_sums``.
        rig: The mechanism and where the camera starts.
        positions: Joint positions, (pose, dof).
        seen: Area [px^2] and centroid x, y [px] of the seen silhouette, (3,).
        moves: True where x, y and depth of the camera may change, bool (3,).

    Returns:
        The sum of ``1 - 2 I_a`` over the silhouette for each pose [px^2], (pose,), and the camera's x, y and
        depth [m], (pose, 3).
    """
    costs = np.empty(positions.shape[0])
    places = np.empty((positions.shape[0], 3))
    both = sums.reshape((1, sums.shape[0], sums.shape[1]))
    for i in range(positions.shape[0]):
        own = rig.camera.copy()
        before = Rig(rig.parent, rig.kind, rig.links, rig.link, rig.first, rig.points, rig.radius, own)
        for _ in range(2):
            d = drawn(moments, before, positions[i])
            if not d[1] > 0.0:
                break
            growth = math.sqrt(d[1] / seen[0]) if moves[2] else 1.0
            scale = own[FOCAL] / (own[DEPTH] * growth)
            x, y = d[2] / d[1] - own[CENTRE_X], d[3] / d[1] - own[CENTRE_Y]
            if moves[0]:
                own[X] += (x / growth - (seen[1] - own[CENTRE_X])) / scale
            if moves[1]:
                own[Y] -= (y / growth - (seen[2] - own[CENTRE_Y])) / scale
            own[DEPTH] *= growth
        d = drawn(both, before, positions[i])
        costs[i] = d[0] - 2.0 * d[1] if d[0] >= 0.0 else NOWHERE
        places[i] = own[X : DEPTH + 1]
    return costs, places
