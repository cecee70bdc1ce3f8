"""numba kernels: from joint positions to the outlines of the bodies in the picture, and their mismatch with
a mask.

Each geom is the convex hull of points grown by a radius, so its silhouette is the convex hull of the
projected points; a sphere is seen along its tangent cone. The silhouette of the mechanism is the union of
these polygons.

The mismatch of paper eq. (3), the sum of |I_a - I_m|, is ``sum I_a`` plus the sum of ``1 - 2 I_a`` over the
silhouette. With row prefix sums of the mask that second sum costs one look-up per row and body.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.mechanism.tree import ANCHOR_X, ANCHOR_Y, ANGLE, AXIS_X, AXIS_Y, HINGE
from monodyn.types import FULL
from monodyn.vision.drawing.camera import CENTRE_X, CENTRE_Y, DEPTH, FOCAL, ROTATION, X, Y
from monodyn.vision.drawing.rig import Rig

RING = 32
"""Points on the outline of a ball."""
FARTHEST_PX = 1e6
"""Points farther out than this have no place in a picture [px]."""
ROUNDING = math.sqrt(2.0 * math.pi / RING / math.sin(2.0 * math.pi / RING))
"""Growth of the ring that gives the polygon the area of the circle."""
UNDRAWABLE = 1e18
"""Mismatch of a pose that cannot be drawn [px^2]."""
LINK_X, LINK_Y, LINK_ANGLE = range(3)
"""Columns of a table of link frames: position in the plane [m] and angle [rad]."""
LEFT, RIGHT = range(2)
"""Columns of a row's span in a geom: its ends [px]."""


class Outlines(NamedTuple):
    """Room for the outlines of a mechanism's geoms, and the outlines themselves once ``draw`` has filled it.

    Attributes:
        starts: Where each geom's outline points start, int64 (geom + 1,).
        px: Outline points [px], (outline point, 2).
        hull: Indices into ``px`` of the corners of each geom's convex outline, geom after geom, int64
            (entry,).
        first: Where each geom's corners start in ``hull``, int64 (geom + 1,).
    """

    starts: np.ndarray
    px: np.ndarray
    hull: np.ndarray
    first: np.ndarray


@njit(cache=True)
def blank_outlines(rig: Rig, geoms: int) -> Outlines:
    """Make room for the outlines of the first geoms of a mechanism.

    Args:
        rig: The mechanism and its camera.
        geoms: Number of geoms to draw.

    Returns:
        Outlines to be filled by ``draw``.
    """
    starts = outline_starts(rig, geoms)
    px = np.empty((starts[geoms], 2))
    # each hull needs one place more than it has points, see ``convex_hull``
    hull = np.empty(starts[geoms] + 2 * geoms + 2, dtype=np.int64)
    return Outlines(starts, px, hull, np.zeros(geoms + 1, dtype=np.int64))


@njit(cache=True)
def draw(rig: Rig, position: np.ndarray, outlines: Outlines) -> bool:
    """Fill the outlines of a pose.

    Args:
        rig: The mechanism and its camera.
        position: Joint positions [rad or m], (dof,).
        outlines: Filled, for as many geoms as it has room for.

    Returns:
        False when the pose cannot be drawn, see ``project``; the outlines are then undefined.
    """
    if not project(rig, position, outlines.px):
        return False
    px, hull, first = outlines.px, outlines.hull, outlines.first
    first[0] = 0
    for g in range(outlines.starts.shape[0] - 1):
        at = first[g]
        first[g + 1] = at + convex_hull(px, outlines.starts[g], outlines.starts[g + 1], hull[at:])
    return True


@njit(cache=True)
def link_frames(rig: Rig, position: np.ndarray) -> np.ndarray:
    """Place every link's frame in the plane.

    Args:
        rig: The mechanism.
        position: Joint positions [rad or m], (dof,).

    Returns:
        Position [m] and angle [rad] of each link, (dof, 3).
    """
    links = rig.links
    frames = np.empty((position.shape[0], 3))
    for i in range(position.shape[0]):
        x, y, angle = 0.0, 0.0, 0.0
        parent = rig.parent[i]
        # a parent comes before its children in the tree, so its frame is known already
        if parent >= 0:
            x, y, angle = frames[parent, LINK_X], frames[parent, LINK_Y], frames[parent, LINK_ANGLE]
        c, s = math.cos(angle), math.sin(angle)
        x, y = (
            x + c * links[i, ANCHOR_X] - s * links[i, ANCHOR_Y],
            y + s * links[i, ANCHOR_X] + c * links[i, ANCHOR_Y],
        )
        angle += links[i, ANGLE]
        if rig.kind[i] == HINGE:
            angle += links[i, AXIS_X] * position[i]
        else:
            c, s = math.cos(angle), math.sin(angle)
            x += (c * links[i, AXIS_X] - s * links[i, AXIS_Y]) * position[i]
            y += (s * links[i, AXIS_X] + c * links[i, AXIS_Y]) * position[i]
        frames[i, LINK_X], frames[i, LINK_Y], frames[i, LINK_ANGLE] = x, y, angle
    return frames


@njit(cache=True)
def outline_starts(rig: Rig, geoms: int) -> np.ndarray:
    """Return where each geom's outline points start.

    Args:
        rig: The mechanism.
        geoms: Number of geoms that count.

    Returns:
        One more than the geoms, the last one the number of points, int64 (geom + 1,).
    """
    starts = np.zeros(geoms + 1, dtype=np.int64)
    for g in range(geoms):
        own = rig.first[g + 1] - rig.first[g]
        starts[g + 1] = starts[g] + own * (RING if rig.radius[g] > 0.0 else 1)
    return starts


@njit(cache=True)
def project(rig: Rig, position: np.ndarray, px: np.ndarray) -> bool:
    """Project the outline points of the geoms, in their order, until ``px`` is full.

    Args:
        rig: The mechanism and its camera.
        position: Joint positions [rad or m], (dof,).
        px: Filled with pixel coordinates, (outline point, 2).

    Returns:
        False when a point lies behind the camera, absurdly far out of the picture, or nowhere (NaN).
    """
    frames = link_frames(rig, position)
    camera = rig.camera
    focal, cx, cy = camera[FOCAL], camera[CENTRE_X], camera[CENTRE_Y]
    turn = camera[:ROTATION].reshape(3, 3)
    g, k = 0, 0
    while k < px.shape[0]:
        at = rig.link[g]
        x0, y0, angle = frames[at, LINK_X], frames[at, LINK_Y], frames[at, LINK_ANGLE]
        c, s = math.cos(angle), math.sin(angle)
        r = rig.radius[g]
        for i in range(rig.first[g], rig.first[g + 1]):
            dx = x0 + c * rig.points[i, 0] - s * rig.points[i, 1] - camera[X]
            dy = y0 + s * rig.points[i, 0] + c * rig.points[i, 1] - camera[Y]
            dz = rig.points[i, 2] - camera[DEPTH]
            x = turn[0, 0] * dx + turn[0, 1] * dy + turn[0, 2] * dz
            y = turn[1, 0] * dx + turn[1, 1] * dy + turn[1, 2] * dz
            z = turn[2, 0] * dx + turn[2, 1] * dy + turn[2, 2] * dz
            # both tests are written so that NaN fails them
            if not z > r + 1e-9 or not abs(focal * x) + abs(focal * y) < FARTHEST_PX * z:
                return False
            if r == 0.0:
                px[k, 0] = cx + focal * x / z
                px[k, 1] = cy + focal * y / z
                k += 1
                continue
            # The tangent cone touches the ball in a circle about the line of sight, nearer than the centre:
            # at the distance d (1 - r^2 / d^2), with the radius r sqrt(1 - r^2 / d^2).
            d2 = x * x + y * y + z * z
            shrink = 1.0 - r * r / d2
            ring = r * math.sqrt(shrink) * ROUNDING
            # a = (ax, 0, az) and b are unit vectors across the line of sight u: a level, b = u x a
            n1 = math.sqrt(z * z + x * x)
            ax, az = z / n1, -x / n1
            d = math.sqrt(d2)
            ux, uy, uz = x / d, y / d, z / d
            bx, by, bz = uy * az, uz * ax - ux * az, -uy * ax
            for j in range(RING):
                w = 2.0 * math.pi * j / RING
                cw, sw = ring * math.cos(w), ring * math.sin(w)
                qx = x * shrink + cw * ax + sw * bx
                qy = y * shrink + sw * by
                qz = z * shrink + cw * az + sw * bz
                px[k, 0] = cx + focal * qx / qz
                px[k, 1] = cy + focal * qy / qz
                k += 1
        g += 1
    return True


@njit(cache=True)
def convex_hull(px: np.ndarray, start: int, stop: int, hull: np.ndarray) -> int:
    """Write the indices of the convex hull of ``px[start:stop]`` to ``hull``; return their number.

    Monotone chain; the outline turns so that (dy, -dx) of an edge points outwards.

    Args:
        px: Points [px], (point, 2).
        start: First point.
        stop: One past the last point.
        hull: Filled with indices into ``px``, (at least ``stop - start + 1``,).

    Returns:
        Number of corners of the hull.
    """
    n = stop - start
    order = np.empty(n, dtype=np.int64)
    for i in range(n):
        order[i] = start + i
    # insertion sort by x, then y: most geoms have a few dozen points at most
    for i in range(1, n):
        item = order[i]
        j = i - 1
        while j >= 0 and (
            px[order[j], 0] > px[item, 0]
            or (px[order[j], 0] == px[item, 0] and px[order[j], 1] > px[item, 1])
        ):
            order[j + 1] = order[j]
            j -= 1
        order[j + 1] = item
    # One chain goes from the leftmost point to the rightmost, the other one back. Within a chain every
    # corner turns the same way; a point that would turn the other way, or not at all, is not on the hull.
    size = 0
    for turn in range(2):
        base = size
        for i in range(n):
            p = order[i] if turn == 0 else order[n - 1 - i]
            while size - base >= 2:
                a, b = hull[size - 2], hull[size - 1]
                cross = (px[b, 0] - px[a, 0]) * (px[p, 1] - px[a, 1]) - (px[b, 1] - px[a, 1]) * (
                    px[p, 0] - px[a, 0]
                )
                if cross > 1e-12:
                    break
                size -= 1
            hull[size] = p
            size += 1
        # the last point of a chain is the first of the other
        size -= 1
    return max(size, 1)


@njit(cache=True)
def row_sums(coverage: np.ndarray) -> np.ndarray:
    """Return prefix sums along each row of a mask.

    Args:
        coverage: uint8 (height, width), ``FULL`` or more for a whole pixel.

    Returns:
        Covered pixels to the left of each column, float32 (height, width + 1).
    """
    height, width = coverage.shape
    sums = np.zeros((height, width + 1), dtype=np.float32)
    for y in range(height):
        # summed in whole numbers, so that the error of a long row stays that of one division
        total = 0
        for x in range(width):
            total += min(coverage[y, x], FULL)
            sums[y, x + 1] = total / FULL
    return sums


@njit(cache=True)
def _covered(sums: np.ndarray, y: int, left: float, right: float) -> float:
    """Integrate coverage over row y between two x coordinates (pixel centres at whole numbers) [px]."""
    width = sums.shape[1] - 1
    # column i of the sums is the boundary at x = i - 0.5; between two boundaries coverage is constant
    a = min(max(left + 0.5, 0.0), float(width))
    b = min(max(right + 0.5, 0.0), float(width))
    ia, ib = int(a), int(b)
    low = sums[y, ia]
    if ia < width:
        low += (a - ia) * (sums[y, ia + 1] - sums[y, ia])
    high = sums[y, ib]
    if ib < width:
        high += (b - ib) * (sums[y, ib + 1] - sums[y, ib])
    return high - low


@njit(cache=True)
def blank_spans(sums: np.ndarray, geoms: int) -> np.ndarray:
    """Make the work space of ``mismatch``: one picture height above the picture and one below it.

    Args:
        sums: From ``row_sums``, (height, width + 1).
        geoms: Number of geoms.

    Returns:
        Room for the span of each geom in each row, (row, geom, 2).
    """
    return np.empty((3 * sums.shape[0], max(geoms, 1), 2))


@njit(cache=True)
def mismatch(sums: np.ndarray, outlines: Outlines, spans: np.ndarray) -> tuple[float, float]:
    """Sum ``1 - 2 I_a`` over the union of the outlines; outside of the picture I_a is 0.

    Args:
        sums: From ``row_sums``, (height, width + 1).
        outlines: The outlines of a pose.
        spans: Work space from ``blank_spans``, (row, geom, 2).

    Returns:
        The sum [px^2] and the area of the union [px^2].
    """
    geoms = outlines.first.shape[0] - 1
    height, rows = sums.shape[0], spans.shape[0]
    # row y of the picture is row y + offset of the spans; what lies farther out is cut off
    offset = (rows - height) // 2
    top, bottom = 1e18, -1e18
    for i in range(outlines.first[geoms]):
        top = min(top, outlines.px[outlines.hull[i], 1])
        bottom = max(bottom, outlines.px[outlines.hull[i], 1])
    y0 = max(math.ceil(top), -offset)
    y1 = min(math.floor(bottom), rows - offset - 1)
    _fill_spans(outlines, y0, y1, offset, spans)
    # The union of a row's spans, from left to right: ``end`` is how far the row has been summed, and the
    # next piece belongs to the span that begins first beyond it. So no pixel counts twice.
    cost, area = 0.0, 0.0
    for y in range(y0, y1 + 1):
        row = spans[y + offset]
        end = -1e18
        while True:
            left, right = 1e18, 0.0
            for g in range(geoms):
                if row[g, RIGHT] > end and max(row[g, LEFT], end) < left:
                    left, right = max(row[g, LEFT], end), row[g, RIGHT]
            if left > 1e17:
                break
            end = right
            area += right - left
            cost += right - left
            if 0 <= y < height:
                cost -= 2.0 * _covered(sums, y, left, right)
    return cost, area


@njit(cache=True)
def _fill_spans(outlines: Outlines, y0: int, y1: int, offset: int, spans: np.ndarray) -> None:
    """Fill the span of each geom in the rows ``y0`` to ``y1``, which are those from ``y0 + offset`` on in
    ``spans``, (row, geom, 2)."""
    px, hull, first = outlines.px, outlines.hull, outlines.first
    geoms = first.shape[0] - 1
    for y in range(y0, y1 + 1):
        for g in range(geoms):
            spans[y + offset, g, LEFT] = 1e18
            spans[y + offset, g, RIGHT] = -1e18
    # An outline is convex, so its part of a row is one span: between the least and the largest of the
    # crossings of its edges with the row's middle line.
    for g in range(geoms):
        a, b = first[g], first[g + 1]
        for i in range(a, b):
            p = hull[i]
            q = hull[i + 1] if i + 1 < b else hull[a]
            if px[p, 1] > px[q, 1]:
                p, q = q, p
            dy = px[q, 1] - px[p, 1]
            slope = (px[q, 0] - px[p, 0]) / dy if dy > 1e-12 else 0.0
            for y in range(max(math.ceil(px[p, 1]), y0), min(math.floor(px[q, 1]), y1) + 1):
                x = px[p, 0] + (y - px[p, 1]) * slope
                spans[y + offset, g, LEFT] = min(spans[y + offset, g, LEFT], x)
                spans[y + offset, g, RIGHT] = max(spans[y + offset, g, RIGHT], x)


@njit(cache=True)
def pose_mismatch(sums: np.ndarray, rig: Rig, positions: np.ndarray, geoms: int) -> np.ndarray:
    """Evaluate the mismatch of many poses over the first ``geoms`` geoms.

    Args:
        sums: From ``row_sums``, (height, width + 1).
        rig: The mechanism and its camera.
        positions: Joint positions, (pose, dof).
        geoms: Number of geoms that count.

    Returns:
        The sum of ``1 - 2 I_a`` over the silhouette for each pose [px^2], ``UNDRAWABLE`` where it cannot be
        drawn, (pose,).
    """
    outlines, spans = blank_outlines(rig, geoms), blank_spans(sums, geoms)
    costs = np.empty(positions.shape[0])
    for i in range(positions.shape[0]):
        drawn = draw(rig, positions[i], outlines)
        costs[i] = mismatch(sums, outlines, spans)[0] if drawn else UNDRAWABLE
    return costs
