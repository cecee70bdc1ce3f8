"""numba kernels: area, centroid and mismatch of the drawn silhouette of a mechanism.

The sum of a picture over the drawn silhouette follows from row prefix sums of that picture
(``drawing.mismatch``): of ones it is the area, of the coordinates x and y the first moments. What lies
outside of the picture, or where the background is not known, has no area.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.vision.drawing.camera import CENTRE_X, CENTRE_Y, DEPTH, FOCAL, X, Y
from monodyn.vision.drawing.mismatch import UNDRAWABLE, blank_cuts, silhouette_sums
from monodyn.vision.drawing.rig import Rig, altered
from monodyn.vision.drawing.silhouette import blank_outlines, draw

PLACEMENTS = 2
"""Steps of depth and place that a camera takes to a pose."""

AREA, MOMENT_X, MOMENT_Y = range(3)
"""Pictures of ``moment_sums``: of their sums over a silhouette these are its area and its first moments."""


class CameraFree(NamedTuple):
    """Which of the camera's coordinates are estimated.

    Attributes:
        x: The one to the right.
        y: The one up.
        depth: The distance from the plane of motion.
    """

    x: bool
    y: bool
    depth: bool


class AreaCentroid(NamedTuple):
    """Area and centroid of a silhouette: what depth and place of the camera follow from.

    Attributes:
        area: Its area [px^2].
        x: Column of its centroid [px].
        y: Row of its centroid [px].
    """

    area: float
    x: float
    y: float


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
            sums[AREA, y, x + 1] = total
            sums[MOMENT_X, y, x + 1] = first
            sums[MOMENT_Y, y, x + 1] = total * y
    return sums


@njit(cache=True)
def drawn(sums: np.ndarray, rig: Rig, position: np.ndarray) -> tuple[float, np.ndarray]:
    """Sum pictures over the drawn silhouette of one pose.

    Args:
        sums: Row prefix sums of each picture, (picture, height, width + 1).
        rig: The mechanism and its camera.
        position: Joint positions, (dof,).

    Returns:
        The drawn area, also outside of the picture [px^2], and the sum of each picture over the silhouette,
        (picture,); all NaN where the mechanism cannot be drawn.
    """
    geoms, inside = rig.radius.shape[0], np.full(sums.shape[0], np.nan)
    outlines = blank_outlines(rig, geoms)
    if not draw(rig, position, outlines):
        return np.nan, inside
    return silhouette_sums(sums, outlines, blank_cuts(geoms), inside), inside


@njit(cache=True)
def placed_mismatch(
    sums: np.ndarray,
    moments: np.ndarray,
    rig: Rig,
    positions: np.ndarray,
    target: AreaCentroid,
    free: CameraFree,
) -> tuple[np.ndarray, np.ndarray]:
    """Place a camera before each of many poses so that area and centroid are those of the seen silhouette.

    Two steps of depth and place come near the least f1 and f2 (eq. 1 and 2). The mismatch before that camera
    ranks the starts of the local search.

    Args:
        sums: Row prefix sums of the seen silhouette, (height, width + 1).
        moments: From ``moment_sums``, (3, height, width + 1).
        rig: The mechanism and where the camera starts.
        positions: Joint positions, (pose, dof).
        target: Area and centroid of the seen silhouette.
        free: What of the camera may change.

    Returns:
        The sum of ``1 - 2 I_a`` over the silhouette for each pose [px^2], (pose,), and the camera's x, y and
        depth [m], (pose, 3).
    """
    costs = np.empty(positions.shape[0])
    places = np.empty((positions.shape[0], 3))
    both = sums.reshape((1, sums.shape[0], sums.shape[1]))
    for i in range(positions.shape[0]):
        own = rig.camera.copy()
        before = altered(rig, rig.links, rig.points, rig.radius, own)
        for _ in range(PLACEMENTS):
            _, inside = drawn(moments, before, positions[i])
            area = inside[AREA]
            if not area > 0.0:  # nothing lies in the picture, or it cannot be drawn (NaN)
                break
            # the area falls with the square of the depth, so the depth grows with the root of the excess
            growth = math.sqrt(area / target.area) if free.depth else 1.0
            scale = own[FOCAL] / (own[DEPTH] * growth)  # px by metre after the step
            # the drawn centroid from the principal point; it shrinks toward it as the camera backs away
            x, y = inside[MOMENT_X] / area - own[CENTRE_X], inside[MOMENT_Y] / area - own[CENTRE_Y]
            if free.x:
                own[X] += (x / growth - (target.x - own[CENTRE_X])) / scale
            if free.y:  # rows count down, the plane's y counts up
                own[Y] -= (y / growth - (target.y - own[CENTRE_Y])) / scale
            own[DEPTH] *= growth
        whole, inside = drawn(both, before, positions[i])
        costs[i] = whole - 2.0 * inside[0] if whole >= 0.0 else UNDRAWABLE
        places[i] = own[X : DEPTH + 1]
    return costs, places
