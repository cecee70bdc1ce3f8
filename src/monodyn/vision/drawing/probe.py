"""numba kernels: a place on an outline, what lies along its normal, and the table of what is found there."""

# elements of typed arrays are arrays to the type checker and numbers to numba
# pyright: reportArgumentType=false
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

STEP_PX = 0.5
"""Distance of the picture samples along a normal [px]."""
FLAT_PX = 3.0
"""Search length inwards from which the coverage levels off; an edge is taken against its own level
there."""
LEAST_LEVEL = 0.35
"""Coverage inside of an edge below which the edge is looked for against full coverage: it is not where it
was expected."""
TRUSTED = 0.09
"""Least trust of the picture along a normal."""
DEEP_PX = 3.0
"""Depth at which the coverage inside of the outline is read, at most [px]."""

FROM, TO, FAR_FROM, FAR_TO = range(4)
"""Columns of a sample's edges: the outline points between which it lies, and those between which its normal
enters the geom on the other side."""
END_COLUMNS = FAR_TO + 1
"""Number of these columns."""
SHARE, NORMAL_X, NORMAL_Y, AWAY, WEIGHT, INNER, AT_X, AT_Y, GEOM, REASON, BORDER = range(11)
"""Columns of a sample: share of the second point of its edge; outward normal; area that the mask has more
along the normal than the outline, which of a sharp edge is its displacement t* [px]; weight; length of the
search inwards [px]; its place [px]; its geom; why it is left out; 1 where only a border of the geom shows,
else 0."""
GAIN, SHOWN, FAR_SHARE, FAR_X, FAR_Y = range(BORDER + 1, BORDER + 6)
"""Further columns, for what moves during the exposure: by how much that area grows as the edge moves
outwards; share of the exposure in which the geom covers what lies ``DEEP_PX`` inside; share of the second
point of the edge on the other side; what a displacement of that is multiplied by for its part of the area."""
SAMPLE_COLUMNS = FAR_Y + 1
"""Number of these columns."""
USED, OUTSIDE, HIDDEN, FAINT = range(4)
"""Why a sample is left out: it is not; its normal leaves the picture; another geom covers it; the
background cannot be distinguished from the mechanism."""
COVERED_PX = 0.75
"""A place this close to another outline, or inside of it, is taken as covered by it [px]."""


class Normal(NamedTuple):
    """A place on an outline, and the normal there.

    Attributes:
        x: Column of the place [px].
        y: Its row [px].
        nx: The outward unit normal, along the columns.
        ny: The same along the rows.
    """

    x: float
    y: float
    nx: float
    ny: float


@njit(cache=True, inline="always")
def least_trust(known: np.ndarray, at: Normal, inner: float, reach: float) -> float:
    """Return the least trust of a plane (height, width) at five places along the searched normal."""
    weight = 1.0
    for t in (-inner, -0.5 * inner, 0.0, 0.5 * reach, reach):
        weight = min(weight, known[int(at.y + t * at.ny + 0.5), int(at.x + t * at.nx + 0.5)])
    return weight


@njit(cache=True, inline="always")
def is_covered(
    px: np.ndarray, hull: np.ndarray, first: np.ndarray, own: int, at: Normal, reach: float
) -> bool:
    """Return whether another geom than ``own`` covers a place or what lies outwards of it.

    Four places along the normal find every geom that is wider than a third of the search length.
    """
    covered = False
    for g in range(first.shape[0] - 1):
        if g == own:
            continue
        for k in range(4):
            t = k * reach / 3.0
            away = outside(px, hull, first[g], first[g + 1], at.x + t * at.nx, at.y + t * at.ny)
            if away < COVERED_PX:
                covered = True
                break
        if covered:
            break
    return covered


@njit(cache=True)
def outside(px: np.ndarray, hull: np.ndarray, a: int, b: int, x: float, y: float) -> float:
    """Return how far a point lies outside of the outline ``hull[a:b]``, negative inside [px]."""
    # of a convex outline: the largest of the distances from the lines through its edges
    most = -1e18
    for i in range(a, b):
        p = hull[i]
        q = hull[i + 1] if i + 1 < b else hull[a]
        ex, ey = px[q, 0] - px[p, 0], px[q, 1] - px[p, 1]
        length = math.sqrt(ex * ex + ey * ey)
        if length < 1e-9:
            continue
        most = max(most, ((x - px[p, 0]) * ey - (y - px[p, 1]) * ex) / length)
    return most


@njit(cache=True)
def depth_inside(px: np.ndarray, hull: np.ndarray, a: int, b: int, at: Normal) -> float:
    """Return the width of the outline ``hull[a:b]`` from a place on it against the normal [px]."""
    far = 1e18
    for i in range(a, b):
        p = hull[i]
        q = hull[i + 1] if i + 1 < b else hull[a]
        ex, ey = px[q, 0] - px[p, 0], px[q, 1] - px[p, 1]
        # the line against the normal leaves the outline through the first edge that it crosses outwards
        across = -at.nx * ey + at.ny * ex
        if across > 1e-9:
            away = ((px[p, 0] - at.x) * ey - (px[p, 1] - at.y) * ex) / across
            if away > 0.0:
                far = min(far, away)
    return far


@njit(cache=True)
def bilinear(picture: np.ndarray, x: float, y: float) -> float:
    """Return the picture's value between pixels; the caller keeps (x, y) inside."""
    ix, iy = int(x), int(y)
    fx, fy = x - ix, y - iy
    top = picture[iy, ix] * (1.0 - fx) + picture[iy, ix + 1] * fx
    low = picture[iy + 1, ix] * (1.0 - fx) + picture[iy + 1, ix + 1] * fx
    return top * (1.0 - fy) + low * fy
