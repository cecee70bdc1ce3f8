"""numba kernel: the pixels around the outline of a pose, row by row."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from monodyn.uncounted import UNCOUNTED
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.drawing.silhouette import blank_outlines, draw
from monodyn.vision.foreground.masks import LEFT, PLANE, RIGHT, ROW, Wanted
from monodyn.vision.foreground.thumbnails import Window


# short enough to be done at a stretch: whoever leaves the interpreter has to wait for it afterwards
@njit(cache=True)
def rows_around(rig: Rig, position: np.ndarray, part: np.ndarray, by: int, size: tuple[int, int]) -> Wanted:
    """Return the pixels in and around the outline of each geom.

    Args:
        rig: The mechanism and its camera.
        position: Joint positions, (dof,).
        part: Plane of each geom, int64 (geom,); a geom whose plane is negative is left out.
        by: How far around the outline, along rows and columns [px].
        size: Height and width of the picture [px].

    Returns:
        Stretches of each geom's plane; those of several geoms may overlap. None where the pose cannot be
        drawn.
    """
    outlines = blank_outlines(rig, rig.radius.shape[0])
    if not draw(rig, position, outlines):
        return Wanted(np.empty((0, 4), np.int64), Window(0, 0, 0, 0))
    first, geoms = outlines.first, rig.radius.shape[0]
    # farther out than this no row of an outline matters
    above, below = -by - 1, size[0] + by
    ends, most = np.zeros((geoms, 2), np.int64), 0
    for g in range(geoms):
        top, bottom = 1e18, -1e18
        for i in range(first[g], first[g + 1]):
            y = outlines.px[outlines.hull[i], 1]
            top, bottom = min(top, y), max(bottom, y)
        ends[g, 0], ends[g, 1] = max(math.floor(top), above), min(math.floor(bottom), below) + 1
        if part[g] >= 0:
            most += max(ends[g, 1] - ends[g, 0], 0) + 2 * by
    rows, sides, count = np.empty((most, 4), np.int64), np.empty((2, below - above + 1), np.int64), 0
    for g in range(geoms):
        top, bottom = ends[g]
        if part[g] >= 0 and top < bottom:
            _find_sides(outlines.px, outlines.hull[first[g] : first[g + 1]], top, bottom, sides)
            count = _add_rows(sides, top, bottom, part[g], by, size, rows, count)
    return _in_a_window(rows[:count])


@njit(cache=True)
def _in_a_window(rows: np.ndarray) -> Wanted:
    """Return stretches, (row, column), with the window in which they lie."""
    if rows.shape[0] == 0:
        return Wanted(rows, Window(0, 0, 0, 0))
    top, bottom, left, right = rows[0, ROW], rows[0, ROW], rows[0, LEFT], rows[0, RIGHT]
    for i in range(rows.shape[0]):
        top, bottom = min(top, rows[i, ROW]), max(bottom, rows[i, ROW])
        left, right = min(left, rows[i, LEFT]), max(right, rows[i, RIGHT])
    return Wanted(rows, Window(top, bottom + 1, left, right))


@njit(cache=True, **UNCOUNTED)
def _find_sides(px: np.ndarray, hull: np.ndarray, top: int, bottom: int, sides: np.ndarray) -> None:
    """Fill ``sides`` (2, row) with the first and the last column of a convex outline in the rows from ``top``
    to ``bottom``; ``hull`` (corner,) are the indices of its corners in ``px`` (point, 2)."""
    left, right = sides[0], sides[1]
    for k in range(bottom - top):
        left[k], right[k] = 1 << 40, -(1 << 40)
    for i in range(hull.shape[0]):
        p, q = hull[i], hull[(i + 1) % hull.shape[0]]
        if px[p, 1] > px[q, 1]:
            p, q = q, p
        x, y, height = px[p, 0], px[p, 1], px[q, 1] - px[p, 1]
        for row in range(max(math.floor(y), top), min(math.floor(px[q, 1]) + 1, bottom)):
            # the part of the edge within the row
            begin = x if row <= y else x + (px[q, 0] - x) * (row - y) / height
            end = px[q, 0] if row + 1.0 >= px[q, 1] else x + (px[q, 0] - x) * (row + 1.0 - y) / height
            k = row - top
            left[k] = min(left[k], math.floor(min(begin, end)))
            right[k] = max(right[k], math.ceil(max(begin, end)))


@njit(cache=True, **UNCOUNTED)
def _add_rows(
    sides: np.ndarray, top: int, bottom: int, part: int, by: int, size: tuple[int, int], rows: np.ndarray,
    count: int,
) -> int:  # fmt: skip
    """Add to ``rows`` (row, column), from stretch ``count`` on, what lies around an outline with the columns
    ``sides`` (2, row) in the rows from ``top`` to ``bottom``, ``by`` pixels to all sides within a picture of
    a height and width, for the plane ``part``. Return the number of stretches."""
    height, width = size
    left, right, last = sides[0], sides[1], bottom - top - 1
    far_left, far_right = np.argmin(left[: last + 1]), np.argmax(right[: last + 1])
    for row in range(max(top - by, 0), min(bottom + by, height)):
        low, high = max(row - by - top, 0), min(row + by - top, last)
        # the sides of a convex outline have one turn each: a row as near to it as can be is the farthest out
        begin = max(left[min(max(far_left, low), high)] - by, 0)
        end = min(right[min(max(far_right, low), high)] + by + 1, width)
        if begin < end:
            rows[count, PLANE], rows[count, ROW] = part, row
            rows[count, LEFT], rows[count, RIGHT] = begin, end
            count += 1
    return count
