"""numba kernels: the mismatch of a mechanism's silhouette with a mask.

The mismatch of paper eq. (3), the sum of |I_a - I_m|, is ``sum I_a`` plus the sum of ``1 - 2 I_a`` over the
silhouette. With row prefix sums of the mask that second sum costs one look-up per row and body.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from monodyn.types import FULL
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.drawing.silhouette import Outlines, blank_outlines, draw

UNDRAWABLE = 1e18
"""Mismatch of a pose that cannot be drawn [px^2]."""
LEFT, RIGHT = range(2)
"""Columns of a row's span in a geom: its ends [px]."""


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
