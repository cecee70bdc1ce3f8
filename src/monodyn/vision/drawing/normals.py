"""numba kernels: where the edges of a mask lie along the normals of the mechanism's outline.

Along the normal of an outline point the coverage c(t) falls from 1 inside to 0 outside. If the edge lies at
t*, then ``integral of c from -a to b = a + t*``, whatever the blur, as long as it is symmetric: the
displacement is an area, not a threshold, and linear in the picture.
"""

# elements of typed arrays are arrays to the type checker and numbers to numba
# pyright: reportArgumentType=false
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.types import FULL
from monodyn.vision.drawing.silhouette import Outlines
from monodyn.vision.foreground.coverage import CHANGED_LEVEL
from monodyn.vision.foreground.masks import View

CORNER_PX = 2.5
"""Outline within this distance of a sharp corner is left out: blur rounds corners."""
LEAST_EDGE_PX = 3.0
"""Length of an edge between two sharp corners from which blur leaves its middle in place [px]."""
SHARP = math.cos(math.radians(35.0))
"""Edges that turn by more than 35 degrees meet in a corner."""
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
OVERFULL = 1.3
"""Coverage of a border (a side that is darker than the front), over that of the rest, from which the edge
is taken against the border's own level."""
BLURRED_PX2 = 0.5
"""Squared distance from the middle of a thin line at which blur halves it: sqrt(2 ln 2) standard deviations
of 0.6 px [px^2]."""
COVERED_PX = 0.75
"""A place this close to another outline, or inside of it, is taken as covered by it [px]."""

FROM, TO = range(2)
"""Columns of a sample's edge: the outline points between which it lies."""
SHARE, NORMAL_X, NORMAL_Y, AWAY, WEIGHT, INNER, AT_X, AT_Y, GEOM, REASON, BORDER = range(11)
"""Columns of a sample: share of the second point of its edge; outward normal; displacement t* of the edge
of the mask [px]; weight; length of the search inwards [px]; its place [px]; its geom; why it is left out; 1
where only a border of the geom shows, else 0."""
SAMPLE_COLUMNS = BORDER + 1
"""Number of these columns."""
USED, OUTSIDE, HIDDEN, FAINT = range(4)
"""Why a sample is left out: it is not; its normal leaves the picture; another geom covers it; the
background cannot be distinguished from the mechanism."""


class _Normal(NamedTuple):
    """A place on an outline [px] and the outward unit normal there."""

    x: float
    y: float
    nx: float
    ny: float


@njit(cache=True)
def edge_samples(
    planes: np.ndarray,
    view: View,
    outlines: Outlines,
    search: tuple[float, float],
    ends: np.ndarray,
    samples: np.ndarray,
    left_out: bool = False,
) -> int:
    """Find the edges of a mask along the visible outline.

    Samples are left out at sharp corners, where another body's outline covers the outer side, where the
    background cannot be distinguished from the mechanism, and outside of the picture.

    Args:
        planes: Mask by colour, uint8 (colour, height, width).
        view: How its planes are to be read.
        outlines: The outlines of the pose.
        search: Length of the search to either side and distance between samples [px].
        ends: Filled with the two outline points of each sample's edge, (sample, 2).
        samples: Filled with what is found, (sample, column), in the columns named above.
        left_out: Fill in the samples that are left out too, but for the corners; without displacement.

    Returns:
        Number of samples.
    """
    count = 0
    for g in range(outlines.first.shape[0] - 1):
        if view.part[g] >= 0 and outlines.first[g + 1] - outlines.first[g] >= 3:
            count = _geom_samples(planes, view, outlines, search, g, ends, samples, count, left_out)
    return count


@njit(cache=True)
def _geom_samples(
    planes: np.ndarray,
    view: View,
    outlines: Outlines,
    search: tuple[float, float],
    g: int,
    ends: np.ndarray,
    samples: np.ndarray,
    count: int,
    left_out: bool,
) -> int:
    """Do the work of ``edge_samples`` for geom ``g``, from sample ``count`` on."""
    px, hull, first = outlines.px, outlines.hull, outlines.first
    reach, spacing = search
    a, size = first[g], first[g + 1] - first[g]
    coverage, known, shaded = planes[view.part[g]], view.trust[view.part[g]], view.shaded[g]
    # without a plane of any difference the geom's own stands in for it, and shows nothing that it did not
    border = view.part[g] if view.border < 0 else view.border
    borders, borders_known = planes[border], view.trust[border]
    # ``rest`` carries the spacing over the soft corners of a ring, whose edges are shorter than it
    rest = 0.5 * spacing
    for i in range(size):
        p, q = hull[a + i], hull[a + (i + 1) % size]
        before, after = hull[a + (i - 1) % size], hull[a + (i + 2) % size]
        ex, ey = px[q, 0] - px[p, 0], px[q, 1] - px[p, 1]
        length = math.sqrt(ex * ex + ey * ey)
        if length < 1e-9:
            continue
        ex, ey = ex / length, ey / length
        # an edge too short for two such margins, the end of a thin rod, keeps its middle
        margin = min(CORNER_PX, 0.5 * length - 1e-6) if length > LEAST_EDGE_PX else CORNER_PX
        start, stop = rest, length
        # Blur rounds a sharp corner, so that the mask's edge lies inside of the outline there: the
        # samples keep away from it, and between two such corners they are centred on the edge.
        if _turn(px, before, p, ex, ey) < SHARP:
            start = max(margin, 0.5 * (length - spacing * math.floor((length - 2 * margin) / spacing)))
        if _turn(px, q, after, ex, ey) < SHARP:
            stop = length - margin
        along = start
        while along <= stop:
            if count >= samples.shape[0]:
                return count
            # the hull turns so that (ey, -ex) points outwards
            at = _Normal(px[p, 0] + along * ex, px[p, 1] + along * ey, ey, -ex)
            reason = _find_edge(
                coverage, known, borders, borders_known, shaded, px, hull, first, g, at, reach, samples[count]
            )
            if reason == USED or left_out:
                samples[count, REASON] = reason
                ends[count, FROM], ends[count, TO] = p, q
                samples[count, SHARE] = along / length
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
def _find_edge(
    coverage: np.ndarray,
    known: np.ndarray,
    borders: np.ndarray,
    borders_known: np.ndarray,
    shaded: bool,
    px: np.ndarray,
    hull: np.ndarray,
    first: np.ndarray,
    own: int,
    at: _Normal,
    reach: float,
    sample: np.ndarray,
) -> int:
    """Search one normal of geom ``own`` in its plane and that plane's trust, or, where that is not trusted,
    in the plane of any difference, and fill ``sample`` (11,) but for its share and reason; return the
    reason why the edge cannot be judged, ``USED`` where it can.

    It runs for every sample, and takes plain arrays: reading them out of tuples costs a tenth of the search.
    """
    height, width = coverage.shape
    x, y, nx, ny = at
    sample[NORMAL_X], sample[NORMAL_Y] = nx, ny
    sample[AT_X], sample[AT_Y], sample[GEOM] = x, y, own
    # no farther inwards than the middle of the body: beyond it the other side's edge would be integrated
    inner = min(reach, 0.5 * _depth_inside(px, hull, first[own], first[own + 1], at))
    for t in (-inner, reach):
        if not (0.0 <= x + t * nx < width - 1.001 and 0.0 <= y + t * ny < height - 1.001):
            return OUTSIDE
    # where another geom covers the outer side the mask has no edge: it goes on in the other geom
    if _is_covered(px, hull, first, own, at, reach):
        return HIDDEN
    weight = _least_trust(known, at, inner, reach)
    border = weight < TRUSTED
    if border:
        coverage, weight = borders, _least_trust(borders_known, at, inner, reach)
    if weight < TRUSTED:
        return FAINT
    steps = max(2, math.ceil((inner + reach) / STEP_PX))
    step = (inner + reach) / steps
    total, deep, level = 0.0, 0, 0.0
    most, envelope, peak, within = 0.0, 0.0, reach, 0.0
    for k in range(steps, -1, -1):
        t = -inner + k * step
        c = _bilinear(coverage, x + t * nx, y + t * ny)
        if c > most:
            most, peak = c, t
        envelope += 0.5 * most if k == 0 or k == steps else most
        within = c if k == 0 else within
        c = min(c, FULL)
        if t < -0.6 * inner:
            deep += 1
            level += c
        total += 0.5 * c if k == 0 or k == steps else c
    # Trapezoids: the area under c over its level is how far the covered part of the normal goes. Light and
    # shade lower the level of a geom, and against full coverage its edge would seem to lie too far inside.
    flat = shaded and inner >= FLAT_PX and level > LEAST_LEVEL * FULL * deep
    level = level / deep if flat else FULL
    away = total * step / level - inner
    # Where the geom looks like the background, that nothing shows says nothing; a border that shows is an
    # edge.
    if border and most < CHANGED_LEVEL * FULL:
        return FAINT
    if border or most > OVERFULL * max(within, FULL):
        # A side that stands out more than the front is narrow, and blur widens it. Half of its own level is
        # reached at ``half`` from its peak, and the edge lies nearer by what the blur has added.
        half = envelope * step / most - inner - peak
        away = peak + math.sqrt(max(half * half - BLURRED_PX2, 0.0))
    sample[BORDER] = border
    sample[AWAY] = away
    sample[WEIGHT] = weight * weight
    sample[INNER] = inner
    return USED


@njit(cache=True, inline="always")
def _least_trust(known: np.ndarray, at: _Normal, inner: float, reach: float) -> float:
    """Return the least trust of a plane (height, width) at five places along the searched normal."""
    weight = 1.0
    for t in (-inner, -0.5 * inner, 0.0, 0.5 * reach, reach):
        weight = min(weight, known[int(at.y + t * at.ny + 0.5), int(at.x + t * at.nx + 0.5)])
    return weight


@njit(cache=True, inline="always")
def _is_covered(
    px: np.ndarray, hull: np.ndarray, first: np.ndarray, own: int, at: _Normal, reach: float
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
            away = _outside(px, hull, first[g], first[g + 1], at.x + t * at.nx, at.y + t * at.ny)
            if away < COVERED_PX:
                covered = True
                break
        if covered:
            break
    return covered


@njit(cache=True)
def _outside(px: np.ndarray, hull: np.ndarray, a: int, b: int, x: float, y: float) -> float:
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
def _depth_inside(px: np.ndarray, hull: np.ndarray, a: int, b: int, at: _Normal) -> float:
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
def _bilinear(picture: np.ndarray, x: float, y: float) -> float:
    """Return the picture's value between pixels; the caller keeps (x, y) inside."""
    ix, iy = int(x), int(y)
    fx, fy = x - ix, y - iy
    top = picture[iy, ix] * (1.0 - fx) + picture[iy, ix + 1] * fx
    low = picture[iy + 1, ix] * (1.0 - fx) + picture[iy + 1, ix + 1] * fx
    return top * (1.0 - fy) + low * fy
