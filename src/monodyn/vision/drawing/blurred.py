"""numba kernels: where the edges of a blurred mask lie along the normals of the outline of what moves.

While a picture is exposed the outline sweeps over it. A place is covered for the share of the exposure in
which it lies inside of the outline, which is known where the motion is.
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
from monodyn.vision.foreground.masks import BACK

LEAST_SWEEP_PX = 1.0
"""Motion during the exposure from which an outline is compared with a blurred picture [px]."""
MOST_TIMES = 32
"""Times of an exposure at which the outline is placed, at most."""
LEAST_SHARE = 0.1
"""Share of the exposure in which a geom covers a place, at least, against which the coverage there is
judged."""
DEEP = 0.6
"""Share of the search inwards beyond which a geom shows its own level."""


@njit(cache=True, **UNCOUNTED)
def find_blurred_edge(
    coverage: np.ndarray,
    known: np.ndarray,
    shaded: bool,
    px: np.ndarray,
    hull: np.ndarray,
    first: np.ndarray,
    lines: np.ndarray,
    order: np.ndarray,
    own: int,
    at: probe.Normal,
    path: tuple[float, float, float, float],
    reach: float,
    ends: np.ndarray,
    sample: np.ndarray,
) -> int:
    """Search one normal of a geom for its edge in a picture in whose exposure the geom moves.

    The area under the coverage along the normal is compared with that under the share of the exposure in
    which the geom covers each place. This area is the mean over the exposure of how much of the normal the
    geom covers. It grows as the edge moves outwards, by the share of the exposure in which the edge crosses
    what is searched of the normal, and so it does with the edge on the other side of the geom.

    Args:
        coverage: A plane of the mask, uint8 (height, width).
        known: Its trust, float32 (height, width).
        shaded: True where the edge is taken against the geom's own level.
        px: Outline points [px], (point, 2).
        hull: Corners of all geoms, indices into ``px``, (entry,).
        first: Where each geom's corners start, (geom + 1,).
        lines: The lines along their edges, from ``outline_lines``, (entry, column).
        order: Which geoms lie in front of which, (geom, geom).
        own: The geom.
        at: The place on its outline.
        path: Where that place is at the beginning and at the end of the exposure, against its middle: x, y
            of each [px].
        reach: Length of the search outwards, beyond the blur [px].
        ends: Filled with the outline points of the edge on the other side, (column,).
        sample: Filled with what is found, (column,).

    Returns:
        Why the edge cannot be judged, ``USED`` where it can.
    """
    height, width = coverage.shape
    x, y, nx, ny = at
    sample[probe.NORMAL_X], sample[probe.NORMAL_Y] = nx, ny
    sample[probe.AT_X], sample[probe.AT_Y], sample[probe.GEOM] = x, y, own
    begin, end = path[0] * nx + path[1] * ny, path[2] * nx + path[3] * ny
    # no farther inwards than the middle of the geom: what is beyond counts for the normals of the other side
    middle = 0.5 * probe.depth_inside(lines, first[own], first[own + 1], at)
    inner, outer = min(reach - min(begin, end, 0.0), middle), reach + max(begin, end, 0.0)
    for t in (-inner, outer):
        if not (0.0 <= x + t * nx < width - 1.001 and 0.0 <= y + t * ny < height - 1.001):
            return probe.OUTSIDE
    for there in (
        at,
        probe.Normal(x - path[0], y - path[1], nx, ny),
        probe.Normal(x - path[2], y - path[3], nx, ny),
    ):
        # the other geoms move much the same: seen from them it is this place that moves
        covered = probe.is_covered(lines, first, order, own, there, reach)
        if covered or probe.meets(lines, first, order, own, there, -inner, BACK):
            return probe.HIDDEN
    weight = probe.least_trust(known, at, inner, outer)
    if weight < probe.TRUSTED:
        return probe.FAINT
    deep, depth = DEEP * inner, min(probe.DEEP_PX, inner)
    expected, deep_expected, shown, near, far = 0.0, 0.0, 0.0, 0.0, 0.0
    times = times_of(path)
    for k in range(times):
        low, high = covered_part(px, hull, first[own], first[own + 1], at, path, (k + 0.5) / times - 0.5)
        expected += max(min(high, outer) - max(low, -inner), 0.0) / times
        deep_expected += max(min(high, -deep) - max(low, -inner), 0.0) / times
        shown += (low < -depth < high) / times
        near += (-inner < high < outer and low < high) / times
        far += (-inner < low < outer and low < high) / times
    steps = max(2, math.ceil((inner + outer) / probe.STEP_PX))
    step = (inner + outer) / steps
    total, inside = 0.0, 0.0
    for k in range(steps + 1):
        t = -inner + k * step
        c = probe.bilinear(coverage, x + t * nx, y + t * ny) * step
        total += 0.5 * c if k == 0 or k == steps else c
        if t < -deep:
            inside += 0.5 * c if k == 0 else c
    flat = shaded and inner >= probe.FLAT_PX and inside > probe.LEAST_LEVEL * FULL * deep_expected > 0.0
    level = inside / deep_expected if flat else FULL
    if near <= 0.0:
        return probe.FAINT
    sample[probe.BORDER] = False
    sample[probe.AWAY] = total / level - expected
    # noise adds up along the normal
    sample[probe.WEIGHT] = weight * weight * (reach + min(reach, middle)) / (inner + outer)
    sample[probe.INNER] = inner
    sample[probe.GAIN], sample[probe.SHOWN] = near, max(shown, LEAST_SHARE)
    _other_side(px, hull, first[own], first[own + 1], at, far, ends, sample)
    return probe.USED


@njit(cache=True, **INLINED)
def times_of(path: tuple[float, float, float, float]) -> int:
    """Return at how many times of an exposure an outline is placed that moves along a path [px]."""
    way = math.sqrt((path[2] - path[0]) ** 2 + (path[3] - path[1]) ** 2)
    return min(max(4, math.ceil(way)), MOST_TIMES)


@njit(cache=True, **INLINED)
def covered_part(
    px: np.ndarray,
    hull: np.ndarray,
    a: int,
    b: int,
    at: probe.Normal,
    path: tuple[float, float, float, float],
    time: float,
) -> tuple[float, float]:
    """Return from where to where a normal lies inside of the outline ``hull[a:b]`` at a time of the exposure,
    -0.5 to 0.5, as it moves along a path through the place at which it is drawn [px]; nowhere where the first
    is not less than the second."""
    one, two = time * (2.0 * time - 1.0), time * (2.0 * time + 1.0)
    x, y = at.x - one * path[0] - two * path[2], at.y - one * path[1] - two * path[3]
    low, high = -1e18, 1e18
    for i in range(a, b):
        p = hull[i]
        q = hull[i + 1] if i + 1 < b else hull[a]
        ex, ey = px[q, 0] - px[p, 0], px[q, 1] - px[p, 1]
        # how far beyond this edge, and how fast that grows outwards; both times the length of the edge
        away = (x - px[p, 0]) * ey - (y - px[p, 1]) * ex
        grows = at.nx * ey - at.ny * ex
        if grows > 0.0:
            high = min(high, -away / grows)
        elif grows < 0.0:
            low = max(low, -away / grows)
        elif away > 0.0:
            return 0.0, -1.0
    return low, high


@njit(cache=True, **UNCOUNTED)
def _other_side(
    px: np.ndarray,
    hull: np.ndarray,
    a: int,
    b: int,
    at: probe.Normal,
    far: float,
    ends: np.ndarray,
    sample: np.ndarray,
) -> None:
    """Fill in the edge of ``hull[a:b]`` where a normal enters it, and what its displacement, in a share
    ``far`` of the exposure, adds to the area."""
    sample[probe.FAR_X], sample[probe.FAR_Y] = 0.0, 0.0
    ends[probe.FAR_FROM], ends[probe.FAR_TO], sample[probe.FAR_SHARE] = hull[a], hull[a], 0.0
    nearest = 1e18
    for i in range(a, b):
        p = hull[i]
        q = hull[i + 1] if i + 1 < b else hull[a]
        ex, ey = px[q, 0] - px[p, 0], px[q, 1] - px[p, 1]
        across = -at.nx * ey + at.ny * ex
        if across <= 1e-9:
            continue
        depth = ((px[p, 0] - at.x) * ey - (px[p, 1] - at.y) * ex) / across
        if 0.0 < depth < nearest:
            nearest = depth
            there = (at.x - depth * at.nx - px[p, 0]) * ex + (at.y - depth * at.ny - px[p, 1]) * ey
            ends[probe.FAR_FROM], ends[probe.FAR_TO] = p, q
            sample[probe.FAR_SHARE] = min(max(there / (ex * ex + ey * ey), 0.0), 1.0)
            # (ey, -ex) points outwards
            sample[probe.FAR_X], sample[probe.FAR_Y] = far * ey / across, -far * ex / across
