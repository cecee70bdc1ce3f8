"""numba kernels: from joint positions to the outlines of the bodies in the picture.

Each geom is the convex hull of points grown by a radius, so its silhouette is the convex hull of the
projected points; a sphere is seen along its tangent cone. The silhouette of the mechanism is the union of
these polygons.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.mechanism.tree import ANCHOR_X, ANCHOR_Y, ANGLE, AXIS_X, AXIS_Y, HINGE
from monodyn.uncounted import COUNTED, UNCOUNTED
from monodyn.vision.drawing.camera import CENTRE_X, CENTRE_Y, DEPTH, FOCAL, ROTATION, X, Y
from monodyn.vision.drawing.rig import RING, Rig

FARTHEST_PX = 1e6
"""Points farther out than this have no place in a picture [px]."""
AROUND = np.stack(
    [np.cos(2.0 * np.pi / RING * np.arange(RING)), np.sin(2.0 * np.pi / RING * np.arange(RING))]
)
"""Cosine and sine of the angle of each point on the outline of a ball, (2, ring)."""
LINK_X, LINK_Y, LINK_ANGLE = range(3)
"""Columns of a table of link frames: position in the plane [m] and angle [rad]."""
CAUGHT = 3
"""Times that the row in which a point is caught is looked for: a point moves much slower than the rows."""


class Outlines(NamedTuple):
    """Room for the outlines of a mechanism's geoms, and the outlines themselves once ``draw`` has filled it.

    Attributes:
        starts: Where each geom's outline points start, int64 (geom + 1,).
        px: Outline points [px], (outline point, 2).
        hull: Indices into ``px`` of the corners of each geom's convex outline, geom after geom, int64
            (entry,).
        first: Where each geom's corners start in ``hull``, int64 (geom + 1,).
        frames: Room for the frames of the links, see ``link_frames``, (dof, 3).
        order: Each geom's points in the order that they had in the outlines before, int64 (outline point,).
    """

    starts: np.ndarray
    px: np.ndarray
    hull: np.ndarray
    first: np.ndarray
    frames: np.ndarray
    order: np.ndarray


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
    first = np.zeros(geoms + 1, dtype=np.int64)
    return Outlines(starts, px, hull, first, frames_room(rig), np.arange(starts[geoms]))


@njit(cache=True, **UNCOUNTED)
def draw(rig: Rig, position: np.ndarray, outlines: Outlines) -> bool:
    """Fill the outlines of a pose.

    Args:
        rig: The mechanism and its camera.
        position: Joint positions [rad or m], (dof,).
        outlines: Filled, for as many geoms as it has room for.

    Returns:
        False when the pose cannot be drawn, see ``project``; the outlines are then undefined.
    """
    if not projected(rig, position, outlines.px, outlines.frames, 0):
        return False
    fill_hulls(outlines, 0)
    return True


@njit(cache=True, **UNCOUNTED)
def fill_hulls(outlines: Outlines, begin: int) -> None:
    """Find the corners of the geoms' outlines among their points.

    Args:
        outlines: With the points from ``project``; their corners are filled.
        begin: The first geom; the corners of those before it are there.
    """
    px, starts, hull, first = outlines.px, outlines.starts, outlines.hull, outlines.first
    for g in range(begin, starts.shape[0] - 1):
        at = first[g]
        order = outlines.order[starts[g] : starts[g + 1]]
        first[g + 1] = at + convex_hull(px, hull[at:], order)


@njit(cache=True)
def frames_room(rig: Rig) -> np.ndarray:
    """Make room for the frames of a mechanism's links.

    Args:
        rig: The mechanism.

    Returns:
        Room to be filled, (dof, 3).
    """
    return np.empty((rig.links.shape[0], 3))


@njit(cache=True)
def link_frames(rig: Rig, position: np.ndarray) -> np.ndarray:
    """Place every link's frame in the plane.

    Args:
        rig: The mechanism.
        position: Joint positions [rad or m], (dof,).

    Returns:
        Position [m] and angle [rad] of each link, (dof, 3).
    """
    frames = frames_room(rig)
    _fill_frames(rig, position, frames)
    return frames


@njit(cache=True, **UNCOUNTED)
def _fill_frames(rig: Rig, position: np.ndarray, frames: np.ndarray) -> None:
    """Do the work of ``link_frames``: fill ``frames`` (dof, 3) for a pose, (dof,)."""
    links = rig.links
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
        starts[g + 1] = starts[g] + _outline_points(rig, g)
    return starts


@njit(cache=True, **UNCOUNTED)
def _outline_points(rig: Rig, geom: int) -> int:
    """Return how many outline points a geom has."""
    return (rig.first[geom + 1] - rig.first[geom]) * (rig.ring if rig.radius[geom] > 0.0 else 1)


@njit(cache=True)
def project(rig: Rig, position: np.ndarray, px: np.ndarray, begin: int = 0) -> bool:
    """Project the outline points of the geoms, in their order, until ``px`` is full.

    Args:
        rig: The mechanism and its camera.
        position: Joint positions in the middle of the picture's exposure [rad or m], (dof,).
        px: Filled with pixel coordinates, (outline point, 2).
        begin: The first geom; the points of those before it are there, and need not be found again.

    Returns:
        False when a point lies behind the camera, absurdly far out of the picture, or nowhere (NaN).
    """
    return projected(rig, position, px, frames_room(rig), begin)


@njit(cache=True, **UNCOUNTED)
def projected(rig: Rig, position: np.ndarray, px: np.ndarray, frames: np.ndarray, begin: int) -> bool:
    """Do the work of ``project`` for it and for other kernels.

    Args:
        rig: The mechanism and its camera.
        position: Joint positions in the middle of the picture's exposure [rad or m], (dof,).
        px: Filled with pixel coordinates, (outline point, 2).
        frames: Room for the frames of the links, (dof, 3).
        begin: The first geom, as in ``project``.

    Returns:
        What ``project`` returns.
    """
    still = True
    for j in range(rig.skew.shape[0]):
        still = still and rig.skew[j] == 0.0
    if not _project_at_once(rig, position, px, frames, begin if still else 0):
        return False
    return still or _catch(rig, position, px, frames)


@njit(cache=True, **COUNTED)
def _catch(rig: Rig, position: np.ndarray, px: np.ndarray, frames: np.ndarray) -> bool:
    """Move the points, (outline point, 2), from where they are in the middle of the exposure to where the row
    that is exposed just then catches them; return False as ``project`` does."""
    before, after = np.empty_like(px), np.empty_like(px)
    if not (
        _project_at_once(rig, position - 0.5 * rig.skew + rig.lean, before, frames, 0)
        and _project_at_once(rig, position + 0.5 * rig.skew + rig.lean, after, frames, 0)
    ):
        return False
    middle = rig.camera[CENTRE_Y]
    for k in range(px.shape[0]):
        # a point is caught in the row that is exposed when the point is there
        y = px[k, 1]
        for _ in range(CAUGHT):
            time = min(max(0.5 * (y - middle) / middle, -0.5), 0.5)
            # the parabola through the places at the beginning, in the middle and at the end
            one, two = time * (2.0 * time - 1.0), time * (2.0 * time + 1.0)
            y = px[k, 1] + one * (before[k, 1] - px[k, 1]) + two * (after[k, 1] - px[k, 1])
        px[k, 0] += one * (before[k, 0] - px[k, 0]) + two * (after[k, 0] - px[k, 0])
        px[k, 1] = y
    return True


@njit(cache=True, **UNCOUNTED)
def _project_at_once(rig: Rig, position: np.ndarray, px: np.ndarray, frames: np.ndarray, begin: int) -> bool:
    """Do the work of ``projected`` for a picture whose rows are exposed together."""
    _fill_frames(rig, position, frames)
    camera = rig.camera
    focal, cx, cy = camera[FOCAL], camera[CENTRE_X], camera[CENTRE_Y]
    turn = camera[:ROTATION].reshape(3, 3)
    g, k = begin, 0
    for before in range(begin):
        k += _outline_points(rig, before)
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
            _project_ball((x, y, z), r, (focal, cx, cy), px[k : k + rig.ring])
            k += rig.ring
        g += 1
    return True


@njit(cache=True, **UNCOUNTED)
def _project_ball(
    centre: tuple[float, float, float], r: float, lens: tuple[float, float, float], px: np.ndarray
) -> None:
    """Fill ``px`` (ring, 2) with the outline of a ball: its centre before the camera [m], its radius [m], and
    the camera's focal length and principal point [px]."""
    x, y, z = centre
    focal, cx, cy = lens
    # The tangent cone touches the ball in a circle about the line of sight, nearer than the centre: at the
    # distance d (1 - r^2 / d^2), with the radius r sqrt(1 - r^2 / d^2).
    d2 = x * x + y * y + z * z
    shrink = 1.0 - r * r / d2
    # a polygon of the circle's area
    turn = 2.0 * math.pi / px.shape[0]
    ring = r * math.sqrt(shrink * turn / math.sin(turn))
    # a = (ax, 0, az) and b are unit vectors across the line of sight u: a level, b = u x a
    n1 = math.sqrt(z * z + x * x)
    ax, az = z / n1, -x / n1
    d = math.sqrt(d2)
    ux, uy, uz = x / d, y / d, z / d
    bx, by, bz = uy * az, uz * ax - ux * az, -uy * ax
    step = RING // px.shape[0]
    for j in range(px.shape[0]):
        cw, sw = ring * AROUND[0, j * step], ring * AROUND[1, j * step]
        qx = x * shrink + cw * ax + sw * bx
        qy = y * shrink + sw * by
        qz = z * shrink + cw * az + sw * bz
        px[j, 0] = cx + focal * qx / qz
        px[j, 1] = cy + focal * qy / qz


@njit(cache=True, **UNCOUNTED)
def convex_hull(px: np.ndarray, hull: np.ndarray, order: np.ndarray) -> int:
    """Write the indices of the convex hull of some points to ``hull``; return their number.

    Monotone chain; the outline turns so that (dy, -dx) of an edge points outwards.

    Args:
        px: Points [px], (point, 2).
        hull: Filled with indices into ``px``, one entry longer than ``order``.
        order: Indices of the points that count, which are sorted: it takes least where the order is nearly
            that of a pose like this one, int64 (entry,).

    Returns:
        Number of corners of the hull.
    """
    n = order.shape[0]
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
