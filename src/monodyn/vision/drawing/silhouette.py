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

import numpy as np
from numba import njit

from monodyn.mechanism.tree import ANCHOR_X, ANCHOR_Y, ANGLE, AXIS_X, AXIS_Y, HINGE
from monodyn.types import FULL
from monodyn.vision.drawing.rig import Rig

RING = 32
"""Points on the outline of a ball."""
FARTHEST_PX = 1e6
"""Points farther out than this have no place in a picture [px]."""
ROUNDING = math.sqrt(2.0 * math.pi / RING / math.sin(2.0 * math.pi / RING))
"""Growth of the ring that gives the polygon the area of the circle."""


@njit(cache=True)
def link_frames(parent: np.ndarray, kind: np.ndarray, links: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Place every link's frame in the plane.

    Args:
        parent: Parent of each link, -1 for the world, (dof,).
        kind: Joint kinds, (dof,).
        links: Link table of the mechanism's tree, (dof, 14).
        q: Joint positions [rad or m], (dof,).

    Returns:
        Position [m] and angle [rad] of each link, (dof, 3).
    """
    frames = np.empty((q.shape[0], 3))
    for i in range(q.shape[0]):
        x, y, angle = 0.0, 0.0, 0.0
        if parent[i] >= 0:
            x, y, angle = frames[parent[i], 0], frames[parent[i], 1], frames[parent[i], 2]
        c, s = math.cos(angle), math.sin(angle)
        x, y = (
            x + c * links[i, ANCHOR_X] - s * links[i, ANCHOR_Y],
            y + s * links[i, ANCHOR_X] + c * links[i, ANCHOR_Y],
        )
        angle += links[i, ANGLE]
        if kind[i] == HINGE:
            angle += links[i, AXIS_X] * q[i]
        else:
            c, s = math.cos(angle), math.sin(angle)
            x += (c * links[i, AXIS_X] - s * links[i, AXIS_Y]) * q[i]
            y += (s * links[i, AXIS_X] + c * links[i, AXIS_Y]) * q[i]
        frames[i, 0], frames[i, 1], frames[i, 2] = x, y, angle
    return frames


@njit(cache=True)
def outline_counts(first: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Return where each geom's outline points start: int64 (geom + 1,).

    Args:
        first: Where each geom's own points start, (geom + 1,).
        radius: Radius of each geom [m], (geom,).
    """
    geoms = radius.shape[0]
    starts = np.zeros(geoms + 1, dtype=np.int64)
    for g in range(geoms):
        own = first[g + 1] - first[g]
        starts[g + 1] = starts[g] + own * (RING if radius[g] > 0.0 else 1)
    return starts


@njit(cache=True)
def project(
    frames: np.ndarray,
    link: np.ndarray,
    first: np.ndarray,
    points: np.ndarray,
    radius: np.ndarray,
    camera: np.ndarray,
    out: np.ndarray,
) -> bool:
    """Project the outline points of every geom.

    Args:
        frames: Position [m] and angle [rad] of each link, (dof, 3).
        link: Link of each geom, (geom,).
        first: Where each geom's points start, (geom + 1,).
        points: Points in the link's frame [m], (point, 3).
        radius: Radius around the points of each geom [m], (geom,).
        camera: From ``camera_array``, (15,).
        out: Filled with pixel coordinates, (outline point, 2).

    Returns:
        False when a point lies behind the camera, absurdly far out of the picture, or nowhere (NaN).
    """
    k = 0
    focal, cx, cy = camera[12], camera[13], camera[14]
    for g in range(link.shape[0]):
        x0, y0, angle = frames[link[g], 0], frames[link[g], 1], frames[link[g], 2]
        c, s = math.cos(angle), math.sin(angle)
        r = radius[g]
        for i in range(first[g], first[g + 1]):
            dx = x0 + c * points[i, 0] - s * points[i, 1] - camera[9]
            dy = y0 + s * points[i, 0] + c * points[i, 1] - camera[10]
            dz = points[i, 2] - camera[11]
            px = camera[0] * dx + camera[1] * dy + camera[2] * dz
            py = camera[3] * dx + camera[4] * dy + camera[5] * dz
            pz = camera[6] * dx + camera[7] * dy + camera[8] * dz
            if not pz > r + 1e-9 or not abs(focal * px) + abs(focal * py) < FARTHEST_PX * pz:
                return False
            if r == 0.0:
                out[k, 0] = cx + focal * px / pz
                out[k, 1] = cy + focal * py / pz
                k += 1
                continue
            d2 = px * px + py * py + pz * pz
            shrink = 1.0 - r * r / d2
            ring = r * math.sqrt(shrink) * ROUNDING
            n1 = math.sqrt(pz * pz + px * px)
            ax, az = pz / n1, -px / n1
            d = math.sqrt(d2)
            ux, uy, uz = px / d, py / d, pz / d
            bx, by, bz = uy * az, uz * ax - ux * az, -uy * ax
            for j in range(RING):
                w = 2.0 * math.pi * j / RING
                cw, sw = ring * math.cos(w), ring * math.sin(w)
                qx = px * shrink + cw * ax + sw * bx
                qy = py * shrink + sw * by
                qz = pz * shrink + cw * az + sw * bz
                out[k, 0] = cx + focal * qx / qz
                out[k, 1] = cy + focal * qy / qz
                k += 1
    return True


@njit(cache=True)
def convex_hull(px: np.ndarray, start: int, stop: int, hull: np.ndarray) -> int:
    """Write the indices of the convex hull of ``px[start:stop]`` to ``hull``; return their number.

    Monotone chain; the outline turns so that (dy, -dx) of an edge points outwards.

    Args:
        px: Points [px], (point, 2).
        start: First point.
        stop: One past the last point.
        hull: Filled with indices into ``px``, at least ``stop - start + 1`` long.
    """
    n = stop - start
    order = np.empty(n, dtype=np.int64)
    for i in range(n):
        order[i] = start + i
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
        size -= 1
    return max(size, 1)


@njit(cache=True)
def hulls(px: np.ndarray, starts: np.ndarray, geoms: int, hull: np.ndarray, hull_first: np.ndarray) -> None:
    """Fill ``hull`` and ``hull_first`` with the outlines of the first ``geoms`` geoms.

    Args:
        px: Outline points [px], (outline point, 2).
        starts: Where each geom's outline points start, (geom + 1,).
        geoms: Number of geoms to do.
        hull: Filled with indices into ``px``; length of ``px`` plus 2 a geom.
        hull_first: Filled with where each hull starts, (geom + 1,).
    """
    hull_first[0] = 0
    for g in range(geoms):
        at = hull_first[g]
        size = convex_hull(px, starts[g], starts[g + 1], hull[at:])
        hull_first[g + 1] = at + size


@njit(cache=True)
def row_sums(coverage: np.ndarray) -> np.ndarray:
    """Return prefix sums along each row of a mask: float32 (height, width + 1), in pixels.

    Args:
        coverage: uint8 (height, width), ``FULL`` or more for a whole pixel.
    """
    height, width = coverage.shape
    sums = np.zeros((height, width + 1), dtype=np.float32)
    for y in range(height):
        total = 0
        for x in range(width):
            total += min(coverage[y, x], FULL)
            sums[y, x + 1] = total / FULL
    return sums


@njit(cache=True)
def _covered(sums: np.ndarray, y: int, left: float, right: float) -> float:
    """Integrate coverage over row y between two x coordinates (pixel centres at whole numbers) [px]."""
    width = sums.shape[1] - 1
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
def mismatch(
    sums: np.ndarray, px: np.ndarray, hull: np.ndarray, hull_first: np.ndarray, geoms: int, spans: np.ndarray
) -> tuple[float, float]:
    """Sum ``1 - 2 I_a`` over the union of the outlines; outside of the picture I_a is 0.

    Args:
        sums: From ``row_sums``.
        px: Outline points [px].
        hull: Indices of the outlines.
        hull_first: Where each outline starts.
        geoms: Number of outlines.
        spans: Work space, (at least rows, geom, 2).

    Returns:
        The sum [px^2] and the area of the union [px^2].
    """
    height = sums.shape[0]
    top, bottom = 1e18, -1e18
    for i in range(hull_first[geoms]):
        top = min(top, px[hull[i], 1])
        bottom = max(bottom, px[hull[i], 1])
    rows = spans.shape[0]
    offset = (rows - height) // 2
    y0 = max(math.ceil(top), -offset)
    y1 = min(math.floor(bottom), rows - offset - 1)
    for y in range(y0, y1 + 1):
        for g in range(geoms):
            spans[y + offset, g, 0] = 1e18
            spans[y + offset, g, 1] = -1e18
    for g in range(geoms):
        a, b = hull_first[g], hull_first[g + 1]
        for i in range(a, b):
            p = hull[i]
            q = hull[i + 1] if i + 1 < b else hull[a]
            if px[p, 1] > px[q, 1]:
                p, q = q, p
            dy = px[q, 1] - px[p, 1]
            slope = (px[q, 0] - px[p, 0]) / dy if dy > 1e-12 else 0.0
            for y in range(max(math.ceil(px[p, 1]), y0), min(math.floor(px[q, 1]), y1) + 1):
                x = px[p, 0] + (y - px[p, 1]) * slope
                spans[y + offset, g, 0] = min(spans[y + offset, g, 0], x)
                spans[y + offset, g, 1] = max(spans[y + offset, g, 1], x)
    cost, area = 0.0, 0.0
    for y in range(y0, y1 + 1):
        row = spans[y + offset]
        end = -1e18
        while True:
            left, right = 1e18, 0.0
            for g in range(geoms):
                if row[g, 1] > end and max(row[g, 0], end) < left:
                    left, right = max(row[g, 0], end), row[g, 1]
            if left > 1e17:
                break
            end = right
            area += right - left
            cost += right - left
            if 0 <= y < height:
                cost -= 2.0 * _covered(sums, y, left, right)
    return cost, area


@njit(cache=True)
def pose_mismatch(sums: np.ndarray, rig: Rig, positions: np.ndarray, geoms: int) -> np.ndarray:
    """Evaluate the mismatch of many poses over the first ``geoms`` geoms.

    Args:
        sums: From ``row_sums``.
        rig: The mechanism and its camera.
        positions: Joint positions, (pose, dof).
        geoms: Number of geoms that count.

    Returns:
        The sum of ``1 - 2 I_a`` over the silhouette for each pose [px^2], (pose,).
    """
    starts = outline_counts(rig.first[: geoms + 1], rig.radius[:geoms])
    px = np.empty((starts[geoms], 2))
    hull = np.empty(starts[geoms] + 2 * geoms + 2, dtype=np.int64)
    hull_first = np.zeros(geoms + 1, dtype=np.int64)
    spans = np.empty((3 * sums.shape[0], max(geoms, 1), 2))
    costs = np.empty(positions.shape[0])
    for i in range(positions.shape[0]):
        frames = link_frames(rig.parent, rig.kind, rig.links, positions[i])
        if not project(frames, rig.link[:geoms], rig.first, rig.points, rig.radius, rig.camera, px):
            costs[i] = 1e18
            continue
        hulls(px, starts, geoms, hull, hull_first)
        costs[i] = mismatch(sums, px, hull, hull_first, geoms, spans)[0]
    return costs
