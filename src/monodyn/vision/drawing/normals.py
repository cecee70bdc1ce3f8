"""numba kernels: where the edges of a mask lie along the normals of the mechanism's outline.

Along the normal of an outline point the coverage c(t) falls from 1 inside to 0 outside. If the edge lies at
t*, then ``integral of c from -a to b = a + t*``, whatever the blur, as long as it is symmetric: the
displacement is an area, not a threshold, and linear in the picture.
"""

# elements of typed arrays are arrays to the type checker and numbers to numba
# pyright: reportArgumentType=false
from __future__ import annotations

import math

import numpy as np
from numba import njit

from monodyn.types import FULL
from monodyn.uncounted import INLINED, UNCOUNTED
from monodyn.vision.drawing import probe
from monodyn.vision.drawing.blurred import LEAST_SWEEP_PX, find_blurred_edge
from monodyn.vision.drawing.shutter import BEGIN_X, BEGIN_Y, DURING_X, DURING_Y, END_X, END_Y, WHEN
from monodyn.vision.drawing.silhouette import Outlines
from monodyn.vision.foreground.coverage import CHANGED_LEVEL
from monodyn.vision.foreground.masks import BACK, FRONT, View

CORNER_PX = 2.5
"""Outline within this distance of a sharp corner is left out: blur rounds corners."""
LEAST_EDGE_PX = 3.0
"""Length of an edge between two sharp corners from which blur leaves its middle in place [px]."""
SHARP = math.cos(math.radians(35.0))
"""Edges that turn by more than 35 degrees meet in a corner."""
OVERFULL = 1.3
"""Coverage of a border (a side that is darker than the front), over that of the rest, from which the edge
is taken against the border's own level."""
OWN_LEVEL = 0.4
"""Share of the search inwards, from its inner end, in which the coverage is that of the geom itself."""
ITS_OWN = 0.8
"""Coverage at the inner end of a search from which a geom shows there itself: what lies in front of it may
have a part of its colour."""
ONE, WEIGHTS = 1 << 20, 1 << 12
"""Units of a pixel in which places along a normal are counted, and steps of the weights of its neighbours."""
VALUE = WEIGHTS * WEIGHTS
"""Units of a level of a plane in which values between pixels are counted."""
MOST = 255.0
"""The most coverage that a mask may have."""
BLURRED_PX2 = 0.5
"""Squared distance from the middle of a thin line at which blur halves it: sqrt(2 ln 2) standard deviations
of 0.6 px [px^2]."""


@njit(cache=True)
def edge_samples(
    planes: np.ndarray,
    view: View,
    outlines: Outlines,
    swept: np.ndarray,
    search: tuple[float, float],
    ends: np.ndarray,
    samples: np.ndarray,
    left_out: bool = False,
) -> int:
    """Find the edges of a mask along the visible outline.

    Samples are left out at sharp corners, where another geom covers the outer side, or one in front the inner
    side, where the background cannot be distinguished from the mechanism, and outside of the picture.

    Args:
        planes: Mask by colour, uint8 (colour, height, width).
        view: How its planes are to be read.
        outlines: The outlines of the pose.
        swept: How each outline point moves during the exposure, (outline point, column), from
            ``swept_points``; of no points for a sharp picture.
        search: Length of the search to either side and distance between samples [px].
        ends: Filled with the outline points of each sample's edges, (sample, column).
        samples: Filled with what is found, (sample, column), in the columns named above.
        left_out: Fill in the samples that are left out too, but for the corners; without displacement.

    Returns:
        Number of samples.
    """
    count = 0
    lines = probe.outline_lines(outlines.px, outlines.hull, outlines.first)
    for g in range(outlines.first.shape[0] - 1):
        if view.part[g] >= 0 and outlines.first[g + 1] - outlines.first[g] >= 3:
            count = _geom_samples(
                planes, view, outlines, lines, swept, search, g, ends, samples, count, left_out
            )
    return count


@njit(cache=True, **UNCOUNTED)
def _geom_samples(
    planes: np.ndarray,
    view: View,
    outlines: Outlines,
    lines: np.ndarray,
    swept: np.ndarray,
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
    order = view.order
    # without a plane of any difference the geom's own stands in for it, and shows nothing that it did not
    border = view.part[g] if view.border < 0 else view.border
    borders, borders_known = planes[border], view.trust[border]
    top = _most_that_counts(swept)
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
            at = probe.Normal(px[p, 0] + along * ex, px[p, 1] + along * ey, ey, -ex)
            path = 0.0, 0.0, 0.0, 0.0
            if swept.shape[0] > 0:
                one, two = 1.0 - along / length, along / length
                path = (
                    one * swept[p, BEGIN_X] + two * swept[q, BEGIN_X],
                    one * swept[p, BEGIN_Y] + two * swept[q, BEGIN_Y],
                    one * swept[p, END_X] + two * swept[q, END_X],
                    one * swept[p, END_Y] + two * swept[q, END_Y],
                )
                # Rows that are exposed one after the other bend an edge that turns: a place on it has both
                # the rate and the row between those of its ends, and moves by their product.
                bow = one * two * (swept[q, WHEN] - swept[p, WHEN])
                at = probe.Normal(
                    at.x - bow * (swept[q, DURING_X] - swept[p, DURING_X]),
                    at.y - bow * (swept[q, DURING_Y] - swept[p, DURING_Y]),
                    ey,
                    -ex,
                )
            if (path[2] - path[0]) ** 2 + (path[3] - path[1]) ** 2 > LEAST_SWEEP_PX * LEAST_SWEEP_PX:
                reason = find_blurred_edge(
                    coverage, known, shaded, px, hull, first, lines, order, g, at, path, reach, ends[count],
                    samples[count],
                )  # fmt: skip
            else:
                reason = _find_edge(
                    coverage, known, borders, borders_known, shaded, lines, first, order, g, at, reach, top,
                    samples[count],
                )  # fmt: skip
            if reason == probe.USED or left_out:
                samples[count, probe.REASON] = reason
                ends[count, probe.FROM], ends[count, probe.TO] = p, q
                samples[count, probe.SHARE] = along / length
                count += 1
            along += spacing
        rest = along - length if along > length else 0.5 * spacing
    return count


@njit(cache=True, **UNCOUNTED)
def _most_that_counts(swept: np.ndarray) -> float:
    """Return the most coverage that counts, from how the outline moves, (outline point, column).

    What stands out more than its geom's colour, by light, counts as that colour. Covered for half of an
    exposure it does not stand out more: where pictures are blurred, all of it counts at all edges.
    """
    for k in range(swept.shape[0]):
        if swept[k, BEGIN_X] != 0.0 or swept[k, BEGIN_Y] != 0.0:
            return MOST
    return float(FULL)


@njit(cache=True, **UNCOUNTED)
def _turn(px: np.ndarray, p: int, q: int, ex: float, ey: float) -> float:
    """Return the cosine of the turn between edge p-q and the direction (ex, ey)."""
    dx, dy = px[q, 0] - px[p, 0], px[q, 1] - px[p, 1]
    return (dx * ex + dy * ey) / max(math.sqrt(dx * dx + dy * dy), 1e-12)


@njit(cache=True, **UNCOUNTED)
def _find_edge(
    coverage: np.ndarray,
    known: np.ndarray,
    borders: np.ndarray,
    borders_known: np.ndarray,
    shaded: bool,
    lines: np.ndarray,
    first: np.ndarray,
    order: np.ndarray,
    own: int,
    at: probe.Normal,
    reach: float,
    top: float,
    sample: np.ndarray,
) -> int:
    """Search one normal of geom ``own`` in its plane and that plane's trust, or, where that is not trusted,
    in the plane of any difference, and fill ``sample`` (11,) but for its share and reason; return the
    reason why the edge cannot be judged, ``USED`` where it can. More coverage than ``top`` counts as ``top``.

    It runs for every sample, and takes plain arrays: reading them out of tuples costs a tenth of the search.
    """
    height, width = coverage.shape
    x, y, nx, ny = at
    sample[probe.NORMAL_X], sample[probe.NORMAL_Y] = nx, ny
    sample[probe.AT_X], sample[probe.AT_Y], sample[probe.GEOM] = x, y, own
    # no farther inwards than the middle of the body: beyond it the other side's edge would be integrated
    inner = min(reach, 0.5 * probe.depth_inside(lines, first[own], first[own + 1], at))
    for t in (-inner, reach):
        if not (0.0 <= x + t * nx < width - 1.001 and 0.0 <= y + t * ny < height - 1.001):
            return probe.OUTSIDE
    # where another geom covers the outer side the mask has no edge: it goes on in the other geom
    if probe.is_covered(lines, first, order, own, at, reach):
        return probe.HIDDEN
    weight = probe.least_trust(known, at, inner, reach)
    border = weight < probe.TRUSTED
    if border:
        coverage, weight = borders, probe.least_trust(borders_known, at, inner, reach)
        # there the geom behind shows as well
        if probe.meets(lines, first, order, own, at, reach, FRONT):
            return probe.HIDDEN
    if weight < probe.TRUSTED:
        return probe.FAINT
    steps = max(2, math.ceil((inner + reach) / probe.STEP_PX))
    step = (inner + reach) / steps
    # places from the outer end inwards, in whole units, of which a pixel has ``ONE``
    at_x, at_y = _units(x + reach * nx), _units(y + reach * ny)
    by_x, by_y = round(step * nx * ONE), round(step * ny * ONE)
    # farther inwards than this the coverage is that of the geom itself
    deep = math.ceil(OWN_LEVEL * inner / step)
    limit = round(top * VALUE)
    total, outer, envelope, most, peak = 0, 0, 0, 0, steps
    begin, most_begin, c, shown = 0, 0, 0, 0
    for k in range(steps, -1, -1):
        c = _value(coverage, at_x, at_y)
        at_x, at_y = at_x - by_x, at_y - by_y
        if c > most:
            most, peak = c, k
        envelope += most
        shown = min(c, limit)
        total += shown
        if k == steps:
            begin, most_begin = shown, most
        if k == deep:
            outer = total
    # as a fraction of the plane's own levels
    level, within = (total - outer) / VALUE, c / VALUE
    # where one in front covers the inner side the geom ends in it, unless the other one is not there
    if within < ITS_OWN * FULL and probe.meets(lines, first, order, own, at, -inner, BACK):
        return probe.HIDDEN
    area = (total - 0.5 * (begin + shown)) / VALUE
    # Trapezoids: the area under c over its level is how far the covered part of the normal goes. Light and
    # shade lower the level of a geom, and against full coverage its edge would seem to lie too far inside.
    flat = shaded and inner >= probe.FLAT_PX and level > probe.LEAST_LEVEL * FULL * deep
    level = level / deep if flat else FULL
    away = area * step / level - inner
    # Where the geom looks like the background, that nothing shows says nothing; a border that shows is an
    # edge.
    if border and most < CHANGED_LEVEL * FULL * VALUE:
        return probe.FAINT
    if border or most > OVERFULL * max(within, FULL) * VALUE:
        # A side that stands out more than the front is narrow, and blur widens it. Half of its own level is
        # reached at ``half`` from its peak, and the edge lies nearer by what the blur has added.
        farthest = peak * step - inner
        half = (envelope - 0.5 * (most_begin + most)) * step / most - inner - farthest
        away = farthest + math.sqrt(max(half * half - BLURRED_PX2, 0.0))
    sample[probe.BORDER] = border
    sample[probe.AWAY] = away
    sample[probe.WEIGHT] = weight * weight
    sample[probe.INNER] = inner
    sample[probe.GAIN], sample[probe.SHOWN], sample[probe.FAR_X], sample[probe.FAR_Y] = 1.0, 1.0, 0.0, 0.0
    return probe.USED


@njit(cache=True, **INLINED)
def _units(place: float) -> int:
    """Return a place [px] in whole units, half of a weight's step ahead so that weights are rounded."""
    return round(place * ONE) + ONE // (2 * WEIGHTS)


@njit(cache=True, **INLINED)
def _value(picture: np.ndarray, x: int, y: int) -> np.int64:
    """Return a picture's value between pixels in units of a ``VALUE``th, at a place in units of a ``ONE``th;
    the caller keeps it inside. This is ``bilinear`` in whole numbers, which takes half of the time."""
    fx, fy = x // (ONE // WEIGHTS) % WEIGHTS, y // (ONE // WEIGHTS) % WEIGHTS
    # numba counts signed indices from the end where they are negative, and looks whether they are
    ix, iy, one = np.uint64(x // ONE), np.uint64(y // ONE), np.uint64(1)
    a, b = np.int64(picture[iy, ix]), np.int64(picture[iy, ix + one])
    c, d = np.int64(picture[iy + one, ix]), np.int64(picture[iy + one, ix + one])
    top, low = a * WEIGHTS + fx * (b - a), c * WEIGHTS + fx * (d - c)
    return top * WEIGHTS + fy * (low - top)
