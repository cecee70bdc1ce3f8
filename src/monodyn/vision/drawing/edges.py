"""numba kernels: sub-pixel edge search along the normals of the mechanism's outline.

Along the normal of an outline point the coverage c(t) falls from 1 inside to 0 outside. If the edge lies at
t*, then ``integral of c from -a to b = a + t*``, whatever the blur, as long as it is symmetric: the
residual is an area, not a threshold, and linear in the picture. A Gauss-Newton step moves the outline by t*
along its normals.
"""

# elements of typed arrays are arrays to the type checker and numbers to numba
# pyright: reportArgumentType=false
from __future__ import annotations

import math

import numpy as np
from numba import njit

from monodyn.types import FULL
from monodyn.vision.drawing.silhouette import hulls, link_frames, outline_counts, project

CORNER_PX = 2.5
"""Outline within this distance of a sharp corner is left out: blur rounds corners."""
SHARP = math.cos(math.radians(35.0))
"""Edges that turn by more than 35 degrees meet in a corner."""
STEP = 0.5
"""Distance of the picture samples along a normal [px]."""
FLAT_PX = 3.0
"""Search length inwards from which the coverage levels off; an edge is taken against its own level there."""
LEAST_LEVEL = 0.35
"""Coverage inside of an edge below which the edge is looked for against full coverage: it is not where it is
thought."""
TRUSTED = 0.09
"""Least trust of the picture along a normal."""


@njit(cache=True)
def _bilinear(picture: np.ndarray, x: float, y: float) -> float:
    """Return the picture's value between pixels; the caller keeps (x, y) inside."""
    ix, iy = int(x), int(y)
    fx, fy = x - ix, y - iy
    top = picture[iy, ix] * (1.0 - fx) + picture[iy, ix + 1] * fx
    low = picture[iy + 1, ix] * (1.0 - fx) + picture[iy + 1, ix + 1] * fx
    return top * (1.0 - fy) + low * fy


@njit(cache=True)
def _outside(px: np.ndarray, hull: np.ndarray, a: int, b: int, x: float, y: float) -> float:
    """Return how far a point lies outside of a convex outline, negative inside [px]."""
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
def _depth_inside(
    px: np.ndarray, hull: np.ndarray, a: int, b: int, x: float, y: float, nx: float, ny: float
) -> float:
    """Return the width of a convex outline from (x, y) against the normal (nx, ny) [px]."""
    far = 1e18
    for i in range(a, b):
        p = hull[i]
        q = hull[i + 1] if i + 1 < b else hull[a]
        ex, ey = px[q, 0] - px[p, 0], px[q, 1] - px[p, 1]
        across = -nx * ey + ny * ex
        if across > 1e-9:
            away = ((px[p, 0] - x) * ey - (px[p, 1] - y) * ex) / across
            if away > 0.0:
                far = min(far, away)
    return far


@njit(cache=True)
def edge_samples(
    planes: np.ndarray,
    trust: np.ndarray,
    part: np.ndarray,
    shaded: np.ndarray,
    px: np.ndarray,
    hull: np.ndarray,
    hull_first: np.ndarray,
    geoms: int,
    spacing: float,
    reach: float,
    ends: np.ndarray,
    values: np.ndarray,
) -> int:
    """Find the edges of a mask along the visible outline.

    Samples are left out at sharp corners, where another body's outline covers the outer side, where the
    background cannot be told from the mechanism, and outside of the picture.

    Args:
        planes: Mask by colour, uint8 (colour, height, width).
        trust: How well each pixel tells each colour from the background, float32 (colour, height, width).
        part: Plane of each geom, (geom,).
        shaded: True for geoms whose edges are taken against their own level, bool (geom,).
        px: Outline points [px], (outline point, 2).
        hull: Indices of the outlines.
        hull_first: Where each outline starts.
        geoms: Number of outlines.
        spacing: Distance between samples [px].
        reach: Length of the search to either side [px].
        ends: Filled with the two outline points of each sample's edge, (sample, 2).
        values: Filled for each sample with share of the second point, normal x, normal y, displacement t*
            [px], weight, length of the search inwards [px], x, y, geom, (sample, 9).

    Returns:
        Number of samples.
    """
    count = 0
    most = values.shape[0]
    for g in range(geoms):
        a, b = hull_first[g], hull_first[g + 1]
        size = b - a
        if size < 3:
            continue
        rest = 0.5 * spacing
        for i in range(size):
            p, q = hull[a + i], hull[a + (i + 1) % size]
            before, after = hull[a + (i - 1) % size], hull[a + (i + 2) % size]
            ex, ey = px[q, 0] - px[p, 0], px[q, 1] - px[p, 1]
            length = math.sqrt(ex * ex + ey * ey)
            if length < 1e-9:
                continue
            ex, ey = ex / length, ey / length
            nx, ny = ey, -ex
            start, stop = rest, length
            if _turn(px, before, p, ex, ey) < SHARP:
                start = max(
                    CORNER_PX, 0.5 * (length - spacing * math.floor((length - 2 * CORNER_PX) / spacing))
                )
            if _turn(px, q, after, ex, ey) < SHARP:
                stop = length - CORNER_PX
            along = start
            while along <= stop:
                if count >= most:
                    return count
                x, y = px[p, 0] + along * ex, px[p, 1] + along * ey
                if _edge(
                    planes,
                    trust,
                    part,
                    shaded,
                    px,
                    hull,
                    hull_first,
                    geoms,
                    g,
                    x,
                    y,
                    nx,
                    ny,
                    reach,
                    values[count],
                ):
                    ends[count, 0], ends[count, 1] = p, q
                    values[count, 0] = along / length
                    count += 1
                along += spacing
            rest = along - length if along > length else 0.5 * spacing
    return count


@njit(cache=True)
def _turn(px: np.ndarray, p: int, q: int, ex: float, ey: float) -> float:
    """Return the cosine of the turn between edge p-q and the direction (ex, ey)."""
    dx, dy = px[q, 0] - px[p, 0], px[q, 1] - px[p, 1]
    return (dx * ex + dy * ey) / max(math.sqrt(dx * dx + dy * dy), 1e-12)


@njit(cache=True)
def _edge(
    planes: np.ndarray,
    trust: np.ndarray,
    part: np.ndarray,
    shaded: np.ndarray,
    px: np.ndarray,
    hull: np.ndarray,
    hull_first: np.ndarray,
    geoms: int,
    own: int,
    x: float,
    y: float,
    nx: float,
    ny: float,
    reach: float,
    value: np.ndarray,
) -> bool:
    """Search one normal; fill normal, displacement, weight, inner length and place; False where nothing can
    be said."""
    coverage, known = planes[part[own]], trust[part[own]]
    height, width = coverage.shape
    inner = min(reach, 0.5 * _depth_inside(px, hull, hull_first[own], hull_first[own + 1], x, y, nx, ny))
    for t in (-inner, reach):
        if not (0.0 <= x + t * nx < width - 1.001 and 0.0 <= y + t * ny < height - 1.001):
            return False
    for g in range(geoms):
        if g == own:
            continue
        for k in range(4):
            t = k * reach / 3.0
            if _outside(px, hull, hull_first[g], hull_first[g + 1], x + t * nx, y + t * ny) < 0.75:
                return False
    weight = 1.0
    for t in (-inner, -0.5 * inner, 0.0, 0.5 * reach, reach):
        weight = min(weight, known[int(y + t * ny + 0.5), int(x + t * nx + 0.5)])
    if weight < TRUSTED:
        return False
    steps = max(2, math.ceil((inner + reach) / STEP))
    step = (inner + reach) / steps
    total, deep, level = 0.0, 0, 0.0
    for k in range(steps + 1):
        t = -inner + k * step
        c = min(_bilinear(coverage, x + t * nx, y + t * ny), FULL)
        if t < -0.6 * inner:
            deep += 1
            level += c
        total += 0.5 * c if k == 0 or k == steps else c
    level = level / deep if shaded[own] and inner >= FLAT_PX and level > LEAST_LEVEL * FULL * deep else FULL
    value[1], value[2] = nx, ny
    value[3] = total * step / level - inner
    value[4] = weight * weight
    value[5] = inner
    value[6], value[7], value[8] = x, y, own
    return True


@njit(cache=True)
def robust_weight(residual: float, scale: float) -> float:
    """Return the Geman-McClure weight of a residual.

    Args:
        residual: The residual.
        scale: Residual at which the weight has fallen to a quarter.
    """
    u = residual / scale
    return 1.0 / (1.0 + u * u) ** 2


@njit(cache=True)
def edge_terms(
    planes: np.ndarray,
    trust: np.ndarray,
    part: np.ndarray,
    shaded: np.ndarray,
    parent: np.ndarray,
    kind: np.ndarray,
    link: np.ndarray,
    first: np.ndarray,
    links: np.ndarray,
    points: np.ndarray,
    radius: np.ndarray,
    cameras: np.ndarray,
    steps: np.ndarray,
    q: np.ndarray,
    reach: float,
    spacing: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Form the normal equations of one mask over (pose, shared parameters).

    ``links``, ``points``, ``radius`` and ``cameras`` hold the mechanism in row 0 and, after it, the
    mechanism with each shared parameter shifted by its step.

    Args:
        planes: Mask by colour, uint8 (colour, height, width).
        trust: How well each pixel tells each colour from the background, float32 (colour, height, width).
        part: Plane of each geom, (geom,).
        shaded: True for geoms whose edges are taken against their own level, bool (geom,).
        parent: Parent of each link.
        kind: Joint kinds.
        link: Link of each geom.
        first: Where each geom's points start.
        links: Link tables, (1 + param, dof, 14).
        points: Points of the geoms [m], (1 + param, point, 3).
        radius: Radius of the geoms [m], (1 + param, geom).
        cameras: Packed cameras, (1 + param, 15).
        steps: Shift of each shared parameter, (param,).
        q: Joint positions, (dof,).
        reach: Length of the search along the normals [px].
        spacing: Distance between samples [px].

    Returns:
        Normal matrix (dof + param, dof + param) and right side (dof + param,) for unit noise of a sample,
        and facts: number of samples, share of them within 1.5 px of an edge, root mean square of these
        [px], and mean coverage just inside of the outline, all weighted like the samples.
    """
    dofs, shared, geoms = q.shape[0], steps.shape[0], radius.shape[1]
    size = dofs + shared
    starts = outline_counts(first, radius[0])
    total = starts[geoms]
    px, moved = np.empty((total, 2)), np.empty((size, total, 2))
    hull, hull_first = np.empty(total + 2 * geoms + 2, dtype=np.int64), np.zeros(geoms + 1, dtype=np.int64)
    ends, values = np.empty((4096, 2), dtype=np.int64), np.empty((4096, 9))
    normal, right, row, facts = np.zeros((size, size)), np.zeros(size), np.zeros(size), np.zeros(4)
    if not project(link_frames(parent, kind, links[0], q), link, first, points[0], radius[0], cameras[0], px):
        return normal, right, facts
    hulls(px, starts, geoms, hull, hull_first)
    count = edge_samples(
        planes, trust, part, shaded, px, hull, hull_first, geoms, spacing, reach, ends, values
    )
    for j in range(size):
        shifted = q.copy()
        k = 0
        if j < dofs:
            shifted[j] += 1e-6
        else:
            k = j - dofs + 1
        project(
            link_frames(parent, kind, links[k], shifted),
            link,
            first,
            points[k],
            radius[k],
            cameras[k],
            moved[j],
        )
    scale, total_weight = max(0.35 * reach, 1.0), 0.0
    for s in range(count):
        p, r = ends[s, 0], ends[s, 1]
        share, nx, ny, t = values[s, 0], values[s, 1], values[s, 2], values[s, 3]
        for j in range(size):
            h = 1e-6 if j < dofs else steps[j - dofs]
            dx = (1.0 - share) * (moved[j, p, 0] - px[p, 0]) + share * (moved[j, r, 0] - px[r, 0])
            dy = (1.0 - share) * (moved[j, p, 1] - px[p, 1]) + share * (moved[j, r, 1] - px[r, 1])
            row[j] = (dx * nx + dy * ny) / h
        trusted = values[s, 4]
        w = trusted * robust_weight(t, scale)
        total_weight += trusted
        if abs(t) < 1.5:
            facts[1] += trusted
            facts[2] += trusted * t * t
        deep = min(3.0, values[s, 5])
        ix, iy = int(values[s, 6] - deep * nx + 0.5), int(values[s, 7] - deep * ny + 0.5)
        g = int(values[s, 8])
        whole = LEAST_LEVEL * FULL if shaded[g] else FULL
        facts[3] += trusted * min(planes[part[g], iy, ix] / whole, 1.0)
        for j in range(size):
            right[j] += w * row[j] * t
            for k in range(size):
                normal[j, k] += w * row[j] * row[k]
    facts[0] = count
    facts[2] = np.sqrt(facts[2] / max(facts[1], 1e-9))
    facts[1] /= max(total_weight, 1e-9)
    facts[3] /= max(total_weight, 1e-9)
    return normal, right, facts
