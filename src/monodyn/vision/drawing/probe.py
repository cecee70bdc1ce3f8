"""numba kernels: a place on an outline, what lies along its normal, and the table of what is found there."""

# elements of typed arrays are arrays to the type checker and numbers to numba
# pyright: reportArgumentType=false
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.uncounted import INLINED, UNCOUNTED
from monodyn.vision.foreground.masks import FRONT

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
OUT_X, OUT_Y, OUT_AT = range(3)
"""Columns of a line along an edge of an outline: its outward unit normal, and how far out along that it lies
[px]."""
LINE_COLUMNS = OUT_AT + 1
"""Number of these columns."""
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


@njit(cache=True, **INLINED)
def least_trust(known: np.ndarray, at: Normal, inner: float, reach: float) -> float:
    """Return the least trust of a plane (height, width) at five places along the searched normal."""
    weight = 1.0
    for t in (-inner, -0.5 * inner, 0.0, 0.5 * reach, reach):
        weight = min(weight, known[int(at.y + t * at.ny + 0.5), int(at.x + t * at.nx + 0.5)])
    return weight


@njit(cache=True)
def outline_lines(px: np.ndarray, hull: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return the lines along the edges of outlines, which every sample is compared with.

    Args:
        px: Outline points [px], (point, 2).
        hull: Corners of all geoms, indices into ``px``, (entry,).
        first: Where each geom's corners start, (geom + 1,).

    Returns:
        Of the edge from each corner to the next its outward unit normal and how far out along it the edge
        lies [px], in the columns named above, (entry, 3).
    """
    lines = np.empty((first[-1], LINE_COLUMNS))
    for g in range(first.shape[0] - 1):
        for i in range(first[g], first[g + 1]):
            p = hull[i]
            q = hull[i + 1] if i + 1 < first[g + 1] else hull[first[g]]
            ex, ey = px[q, 0] - px[p, 0], px[q, 1] - px[p, 1]
            length = math.sqrt(ex * ex + ey * ey)
            if length < 1e-9:
                # an edge without length has nothing outside of it
                lines[i, OUT_X], lines[i, OUT_Y], lines[i, OUT_AT] = 0.0, 0.0, 1e18
                continue
            # the hull turns so that (ey, -ex) points outwards
            lines[i, OUT_X], lines[i, OUT_Y] = ey / length, -ex / length
            lines[i, OUT_AT] = (px[p, 0] * ey - px[p, 1] * ex) / length
    return lines


@njit(cache=True, **INLINED)
def is_covered(
    lines: np.ndarray, first: np.ndarray, order: np.ndarray, own: int, at: Normal, reach: float
) -> bool:
    """Return whether another geom than ``own`` covers a place or what lies outwards of it.

    What ``own`` lies in front of, by the order of the geoms (geom, geom), does not.
    """
    for g in range(first.shape[0] - 1):
        if g != own and order[own, g] != FRONT and _reaches(lines, first[g], first[g + 1], at, reach):
            return True
    return False


@njit(cache=True, **INLINED)
def meets(
    lines: np.ndarray, first: np.ndarray, order: np.ndarray, own: int, at: Normal, reach: float, side: int
) -> bool:
    """Return whether a geom that ``own`` lies in ``FRONT`` of, or at the ``BACK`` of, by the order of the
    geoms (geom, geom), covers a place or what lies outwards of it, inwards for a negative reach."""
    for g in range(first.shape[0] - 1):
        if order[own, g] == side and _reaches(lines, first[g], first[g + 1], at, reach):
            return True
    return False


@njit(cache=True, **INLINED)
def _reaches(lines: np.ndarray, a: int, b: int, at: Normal, reach: float) -> bool:
    """Return whether the outline ``lines[a:b]`` covers a place or what lies so far outwards of it.

    Four places along the normal find every geom that is wider than a third of the search length.
    """
    if _is_apart(lines, a, b, at, reach):
        return False
    for k in range(4):
        t = k * reach / 3.0
        if outside(lines, a, b, at.x + t * at.nx, at.y + t * at.ny) < COVERED_PX:
            return True
    return False


@njit(cache=True, **UNCOUNTED)
def _is_apart(lines: np.ndarray, a: int, b: int, at: Normal, reach: float) -> bool:
    """Return whether one of the edges ``lines[a:b]`` has both ends of a normal, and so all of it, outside."""
    for i in range(a, b):
        begin = lines[i, OUT_X] * at.x + lines[i, OUT_Y] * at.y - lines[i, OUT_AT]
        end = begin + reach * (lines[i, OUT_X] * at.nx + lines[i, OUT_Y] * at.ny)
        if begin >= COVERED_PX and end >= COVERED_PX:
            return True
    return False


@njit(cache=True, **UNCOUNTED)
def outside(lines: np.ndarray, a: int, b: int, x: float, y: float) -> float:
    """Return how far a point lies outside of the outline ``lines[a:b]``, negative inside [px]."""
    # of a convex outline: the largest of the distances from the lines through its edges
    most = -1e18
    for i in range(a, b):
        most = max(most, lines[i, OUT_X] * x + lines[i, OUT_Y] * y - lines[i, OUT_AT])
    return most


@njit(cache=True, **UNCOUNTED)
def depth_inside(lines: np.ndarray, a: int, b: int, at: Normal) -> float:
    """Return the width of the outline ``lines[a:b]`` from a place on it against the normal [px]."""
    far = 1e18
    for i in range(a, b):
        # the line against the normal leaves the outline through the first edge that it crosses outwards
        across = -(lines[i, OUT_X] * at.nx + lines[i, OUT_Y] * at.ny)
        if across > 1e-9:
            away = (lines[i, OUT_AT] - lines[i, OUT_X] * at.x - lines[i, OUT_Y] * at.y) / across
            if 0.0 < away < far:
                far = away
    return far


@njit(cache=True, **INLINED)
def bilinear(picture: np.ndarray, x: float, y: float) -> float:
    """Return the picture's value between pixels; the caller keeps (x, y) inside."""
    column, row = int(x), int(y)
    fx, fy = x - column, y - row
    # numba counts signed indices from the end where they are negative, and looks whether they are
    ix, iy, one = np.uint64(column), np.uint64(row), np.uint64(1)
    a, b = float(picture[iy, ix]), float(picture[iy, ix + one])
    c, d = float(picture[iy + one, ix]), float(picture[iy + one, ix + one])
    top, low = a + fx * (b - a), c + fx * (d - c)
    return top + fy * (low - top)
