"""numba kernels: the mismatch of a mechanism's silhouette with a mask.

The mismatch of paper eq. (3), the sum of |I_a - I_m|, is ``sum I_a`` plus the sum of ``1 - 2 I_a`` over the
silhouette. A sum over a silhouette is an integral along its outline (Green's theorem): of x dy for the area,
and of F dy for a picture whose sums from the left end of the row up to x are F. With row prefix sums F costs
one look-up, so a silhouette costs as much as its outline is long. Pixels that the outline cuts count by the
covered share, exactly, along rows and across them.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from monodyn.types import FULL
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.drawing.silhouette import Outlines, blank_outlines, draw, fill_hulls, project

UNDRAWABLE = 1e18
"""Mismatch of a pose that cannot be drawn [px^2]."""
LEFT, RIGHT, TOP, BOTTOM, CENTRE_X, CENTRE_Y, INNER, SIDE, FROM, TO = range(10)
"""Columns of the work space of a silhouette: the box around a geom [px], the centre [px] and the squared
radius [px^2] of a circle inside of it, the side that lay beyond the last edge, and the share of an edge that
is cut out, from 0 to 1."""
ON_LINE = 1e-8
"""Two edges are on one line when the ends of one are this near to the other [px]."""


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
def row_balance(coverage: np.ndarray) -> np.ndarray:
    """Return prefix sums of 1 - 2 c along each row of a mask: what covering its pixels costs a pose.

    Args:
        coverage: uint8 (height, width), ``FULL`` or more for a whole pixel.

    Returns:
        Sum to the left of each column, float32 (height, width + 1).
    """
    height, width = coverage.shape
    balance = np.zeros((height, width + 1), dtype=np.float32)
    for y in range(height):
        total = 0
        for x in range(width):
            total += min(coverage[y, x], FULL)
            balance[y, x + 1] = np.float32(x + 1) - np.float32(2.0) * np.float32(total / FULL)
    return balance


@njit(cache=True)
def blank_cuts(geoms: int) -> np.ndarray:
    """Make the work space of ``silhouette_sums``.

    Args:
        geoms: Number of geoms.

    Returns:
        Room for the place of each geom and for a part cut out of an edge by each, (geom, 10).
    """
    return np.empty((max(geoms, 1), TO + 1))


@njit(cache=True)
def silhouette_sums(sums: np.ndarray, outlines: Outlines, cuts: np.ndarray, inside: np.ndarray) -> float:
    """Sum pictures over the union of the outlines; outside of a picture its pixels are 0.

    Args:
        sums: Row prefix sums of each picture, (picture, height, width + 1).
        outlines: The outlines of a pose.
        cuts: Work space from ``blank_cuts``, (geom, 10).
        inside: Filled with the sum of each picture over the union, (picture,).

    Returns:
        The area of the union, also outside of the pictures [px^2].
    """
    geoms = outlines.first.shape[0] - 1
    _fill_places(outlines, cuts, 0)
    inside[:] = 0.0
    return _add_sums(sums, outlines, cuts, (geoms, 0), inside, np.empty(0))


@njit(cache=True)
def _add_sums(
    sums: np.ndarray,
    outlines: Outlines,
    cuts: np.ndarray,
    counts: tuple[int, int],
    inside: np.ndarray,
    alone: np.ndarray,
) -> float:
    """Add the sums over the union of the first geoms to ``inside`` (picture,), and return its area [px^2].

    ``counts`` has how many geoms, and how many of these are in the first sum of ``inside`` already, as if
    there were no others: an edge of theirs is summed again where others may touch it. Where there are none
    of these ``alone`` (entry of the hull, or 0,) takes the part of each edge in that sum, else it has them.
    """
    px, hull, first = outlines.px, outlines.hull, outlines.first
    (geoms, same), area = counts, 0.0
    # the outline of a union is what lies of each geom's edges outside of all other geoms
    for g in range(geoms):
        for i in range(first[g], first[g + 1]):
            p, q = hull[i], hull[i + 1] if i + 1 < first[g + 1] else hull[first[g]]
            xp, yp, xq, yq = px[p, 0], px[p, 1], px[q, 0], px[q, 1]
            before = inside[0]
            if g < same:
                touched = False
                for h in range(same, geoms):
                    touched |= not _is_beside(cuts, h, xp, yp, xq, yq)
                if not touched:
                    continue
                inside[0] -= alone[i]
            found = 0
            for h in range(geoms):
                if h == g or _is_beside(cuts, h, xp, yp, xq, yq):
                    continue
                x, y, inner = cuts[h, CENTRE_X], cuts[h, CENTRE_Y], cuts[h, INNER]
                if (xp - x) ** 2 + (yp - y) ** 2 < inner and (xq - x) ** 2 + (yq - y) ** 2 < inner:
                    begin, end = 0.0, 1.0  # without a look at each of many sides
                else:
                    begin, end = _part_inside(
                        px, hull[first[h] : first[h + 1]], (xp, yp, xq, yq), h < g, cuts[h]
                    )
                if end > begin:
                    # few geoms overlap: insertion keeps the parts in the order in which they begin
                    k = found
                    while k > 0 and cuts[k - 1, FROM] > begin:
                        cuts[k, FROM], cuts[k, TO] = cuts[k - 1, FROM], cuts[k - 1, TO]
                        k -= 1
                    cuts[k, FROM], cuts[k, TO] = begin, end
                    found += 1
            begun = 0.0
            for k in range(found + 1):
                stop = cuts[k, FROM] if k < found else 1.0
                if stop > begun:
                    x0, y0 = xp + begun * (xq - xp), yp + begun * (yq - yp)
                    x1, y1 = xp + stop * (xq - xp), yp + stop * (yq - yp)
                    area += 0.5 * (x0 + x1) * (y1 - y0)
                    for m in range(sums.shape[0]):
                        inside[m] += _along_edge(sums[m], x0, y0, x1, y1)
                if k < found:
                    begun = max(begun, cuts[k, TO])
            if same == 0 and alone.shape[0] > 0:
                alone[i] = inside[0] - before
    return area


@njit(cache=True, inline="always")
def _is_beside(cuts: np.ndarray, h: int, xp: float, yp: float, xq: float, yq: float) -> bool:
    """Return whether an edge lies beside the box of a geom, ``cuts`` (geom, 10): most are far from most."""
    if cuts[h, LEFT] > max(xp, xq) or cuts[h, RIGHT] < min(xp, xq):
        return True
    return cuts[h, TOP] > max(yp, yq) or cuts[h, BOTTOM] < min(yp, yq)


@njit(cache=True)
def _fill_places(outlines: Outlines, cuts: np.ndarray, begin: int) -> None:
    """Fill the box around each geom from ``begin`` on and a circle inside of it into ``cuts`` (geom, 10)."""
    px, hull, first = outlines.px, outlines.hull, outlines.first
    for g in range(begin, first.shape[0] - 1):
        a, b = first[g], first[g + 1]
        left, right, top, bottom = 1e18, -1e18, 1e18, -1e18
        x, y = 0.0, 0.0
        for i in range(a, b):
            left, right = min(left, px[hull[i], 0]), max(right, px[hull[i], 0])
            top, bottom = min(top, px[hull[i], 1]), max(bottom, px[hull[i], 1])
            x, y = x + px[hull[i], 0] / (b - a), y + px[hull[i], 1] / (b - a)
        # the distance of the nearest side from the mean of the corners
        inner = 1e18 if b - a > 2 else 0.0
        for i in range(a, b):
            p, q = hull[i], hull[i + 1] if i + 1 < b else hull[a]
            dx, dy = px[q, 0] - px[p, 0], px[q, 1] - px[p, 1]
            beyond = dy * (x - px[p, 0]) - dx * (y - px[p, 1])
            inner = min(inner, beyond * beyond / max(dx * dx + dy * dy, 1e-18))
        # an edge on one line with a side of the geom belongs to its box
        cuts[g, LEFT], cuts[g, RIGHT] = left - ON_LINE, right + ON_LINE
        cuts[g, TOP], cuts[g, BOTTOM] = top - ON_LINE, bottom + ON_LINE
        cuts[g, CENTRE_X], cuts[g, CENTRE_Y], cuts[g, INNER], cuts[g, SIDE] = x, y, (1.0 - 1e-9) * inner, 0.0


@njit(cache=True)
def _part_inside(
    px: np.ndarray,
    corners: np.ndarray,
    edge: tuple[float, float, float, float],
    before: bool,
    cut: np.ndarray,
) -> tuple[float, float]:
    """Return the part of an edge that lies in a geom, as shares of the edge; nothing where the second is not
    above the first.

    ``corners`` (corner,) are those of the geom in ``px`` (point, 2), ``edge`` has x and y of both ends. The
    side that lies beyond is kept in ``cut`` (10,), the geom's own row.
    """
    count = corners.shape[0]
    if count < 3:  # no inside
        return 1.0, 0.0
    xp, yp, xq, yq = edge
    begin, end = 0.0, 1.0
    # neighbouring edges mostly lie beyond the same side: the last one is tried first
    i = int(cut[SIDE])
    xs, ys = px[corners[i], 0], px[corners[i], 1]
    for _ in range(count):
        side, xr, yr = i, xs, ys
        i = i + 1 if i + 1 < count else 0
        xs, ys = px[corners[i], 0], px[corners[i], 1]
        dx, dy = xs - xr, ys - yr
        # (dy, -dx) points outwards: distances of both ends beyond this side, times its length
        at_p = dy * (xp - xr) - dx * (yp - yr)
        at_q = dy * (xq - xr) - dx * (yq - yr)
        near = ON_LINE * (abs(dx) + abs(dy))
        if abs(at_p) <= near and abs(at_q) <= near:
            # Two edges on one line. Running the same way they bound the union together, and one of them has
            # to count: that of the first geom. Running opposite ways both count, and cancel.
            same = dx * (xq - xp) + dy * (yq - yp) > 0.0
            if not (same and before):
                return 1.0, 0.0
        elif at_p > 0.0 and at_q > 0.0:
            cut[SIDE] = side
            return 1.0, 0.0
        elif at_p > 0.0:
            begin = max(begin, at_p / (at_p - at_q))
        elif at_q > 0.0:
            end = min(end, at_p / (at_p - at_q))
        if begin >= end:
            return 1.0, 0.0
    return begin, end


@njit(cache=True, error_model="numpy")
def _along_edge(sums: np.ndarray, x0: float, y0: float, x1: float, y1: float) -> float:
    """Integrate F dy along an edge of a silhouette, exactly; ``sums`` (height, width + 1)."""
    if y0 == y1:
        return 0.0
    width, sign = sums.shape[1] - 1, 1.0
    if y0 > y1:  # so that rows are counted up
        x0, y0, x1, y1, sign = x1, y1, x0, y0, -1.0
    # pixel centres are whole numbers, and pixels reach half a pixel to either side: from here on whole
    # numbers are the borders between them
    x0, y0, x1, y1 = x0 + 0.5, y0 + 0.5, x1 + 0.5, y1 + 0.5
    slope = (x1 - x0) / (y1 - y0)
    begin, end, total = max(y0, 0.0), min(y1, float(sums.shape[0])), 0.0
    if min(x0, x1) < 0.0 or max(x0, x1) > width:
        # what is left of the picture meets nothing, what is right of it whole rows
        at_left, at_right = y0 - x0 / slope, y0 + (width - x0) / slope
        if slope == 0.0:
            enter, leave = end, end
            total = _over_rows(sums, begin, end) if x0 > 0.0 else 0.0
        elif slope > 0.0:
            enter, leave = max(begin, at_left), min(end, at_right)
            total = _over_rows(sums, max(begin, at_right), end)
        else:
            enter, leave = max(begin, at_right), min(end, at_left)
            total = _over_rows(sums, begin, min(end, at_right))
        begin, end = enter, leave
    if begin < end:
        start = min(max(x0 + (begin - y0) * slope, 0.0), float(width))
        if abs(slope) <= 1.0:
            total += _row_by_row(sums, (start, begin), end, slope)
        else:
            stop = min(max(x0 + (end - y0) * slope, 0.0), float(width))
            total += _column_by_column(sums, (start, begin), (stop, end), slope)
    return sign * total


@njit(cache=True)
def _over_rows(sums: np.ndarray, begin: float, end: float) -> float:
    """Integrate the sums of whole rows, ``sums`` (height, width + 1), from one height to another."""
    total, i = 0.0, int(begin)
    while i < end:
        total += (min(i + 1.0, end) - max(float(i), begin)) * sums[i, sums.shape[1] - 1]
        i += 1
    return total


@njit(cache=True, error_model="numpy")
def _row_by_row(sums: np.ndarray, start: tuple[float, float], end: float, slope: float) -> float:
    """Integrate F dy along an edge that goes down at least as much as aside; ``sums`` (height, width + 1).

    It begins at x and y of ``start`` and ends at the height ``end``, inside of the picture.
    """
    (x, y), last = start, sums.shape[1] - 2
    total, from_x, from_y = 0.0, x, y
    per_column = 1.0 / slope if slope != 0.0 else 0.0
    for i in range(int(y), math.ceil(end)):
        to_y = min(i + 1.0, end)
        to_x = min(max(x + (to_y - y) * slope, 0.0), last + 1.0)
        # in a row it lies in one column or in two, and within each F is a straight line
        j, k = min(int(from_x), last), min(int(to_x), last)
        # numba counts signed indices from the end where they are negative, and looks whether they are
        row, one, before, after = np.uint64(i), np.uint64(1), np.uint64(j), np.uint64(k)
        f = float(sums[row, before])
        steep = float(sums[row, before + one]) - f
        steeper = float(sums[row, after + one]) - float(sums[row, after]) - steep
        beyond = to_x - max(j, k)
        total += (to_y - from_y) * (f + (0.5 * (from_x + to_x) - j) * steep)
        total += 0.5 * steeper * beyond * beyond * per_column
        from_x, from_y = to_x, to_y
    return total


@njit(cache=True, error_model="numpy")
def _column_by_column(
    sums: np.ndarray, start: tuple[float, float], end: tuple[float, float], slope: float
) -> float:
    """Integrate F dy along an edge that goes aside more than down; ``sums`` (height, width + 1).

    It begins at x and y of ``start`` and ends at those of ``end``, inside of the picture.
    """
    (x, y), (stop_x, stop_y), last, bottom = start, end, sums.shape[1] - 2, sums.shape[0] - 1
    total, from_x, from_y, per_column = 0.0, x, y, 1.0 / slope
    turn = 1 if slope > 0.0 else -1
    j = min(int(x), last) if turn > 0 else max(math.ceil(x) - 1, 0)
    count = turn * ((math.ceil(stop_x) - 1 if turn > 0 else int(stop_x)) - j) + 1
    for _ in range(count):
        to_x = min(j + 1.0, stop_x) if turn > 0 else max(float(j), stop_x)
        to_y = min(y + (to_x - x) * per_column, stop_y)
        # in a column it lies in one row or in two
        i, k = min(int(from_y), bottom), min(int(to_y), bottom)
        border = min(i + 1.0, to_y)
        at_border = x + (border - y) * slope
        above, below, column, one = np.uint64(i), np.uint64(k), np.uint64(j), np.uint64(1)
        f, g = float(sums[above, column]), float(sums[below, column])
        mean = f + (0.5 * (from_x + at_border) - j) * (float(sums[above, column + one]) - f)
        total += (border - from_y) * mean
        mean = g + (0.5 * (at_border + to_x) - j) * (float(sums[below, column + one]) - g)
        total += (to_y - border) * mean
        from_x, from_y = to_x, to_y
        j += turn
    return total


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
    outlines, cuts, inside = blank_outlines(rig, geoms), blank_cuts(geoms), np.empty(1)
    pictures = sums.reshape((1, sums.shape[0], sums.shape[1]))
    costs = np.empty(positions.shape[0])
    for i in range(positions.shape[0]):
        costs[i] = UNDRAWABLE
        if draw(rig, positions[i], outlines):
            area = silhouette_sums(pictures, outlines, cuts, inside)
            costs[i] = area - 2.0 * inside[0]
    return costs


def covered_area(sums: np.ndarray, rig: Rig, position: np.ndarray) -> float:
    """Return how much of a mask lies inside of a mechanism's silhouette.

    Args:
        sums: From ``row_sums``, (height, width + 1).
        rig: The mechanism and its camera.
        position: Joint positions, (dof,).

    Returns:
        The covered pixels inside [px^2]; 0 for a pose that cannot be drawn.
    """
    return _covered_area(sums, rig, position)


@njit(cache=True)
def _covered_area(sums: np.ndarray, rig: Rig, position: np.ndarray) -> float:
    """Do the work of ``covered_area``."""
    geoms = rig.radius.shape[0]
    outlines, inside = blank_outlines(rig, geoms), np.zeros(1)
    if draw(rig, position, outlines):
        pictures = sums.reshape((1, sums.shape[0], sums.shape[1]))
        silhouette_sums(pictures, outlines, blank_cuts(geoms), inside)
    return inside[0]


@njit(cache=True, nogil=True)
def pose_balance(balance: np.ndarray, rig: Rig, positions: np.ndarray, geoms: int) -> np.ndarray:
    """Evaluate the mismatch of many poses as ``pose_mismatch`` does, but inside of the picture alone.

    Nobody knows whether the mechanism is outside of it: that counts neither for a pose nor against it. Poses
    in which all joints but the last one that counts are where they are in the pose before cost less: of the
    geoms before it only what the others touch is summed again.

    Args:
        balance: From ``row_balance``, (height, width + 1).
        rig: The mechanism and its camera.
        positions: Joint positions, (pose, dof).
        geoms: Number of geoms that count.

    Returns:
        The sum of ``1 - 2 I_a`` over the silhouette inside of the picture for each pose [px^2],
        ``UNDRAWABLE`` where it cannot be drawn, (pose,).
    """
    outlines, cuts, inside = blank_outlines(rig, geoms), blank_cuts(geoms), np.empty(1)
    pictures = balance.reshape((1, balance.shape[0], balance.shape[1]))
    costs = np.empty(positions.shape[0])
    last = rig.link[geoms - 1] if geoms > 0 else 0
    same = int(np.sum(rig.link[:geoms] < last))
    # what each edge of these geoms costs as long as no other geom touches it, and all of them
    alone, together = np.empty(outlines.hull.shape[0]), 0.0
    is_known = False
    for i in range(positions.shape[0]):
        costs[i] = UNDRAWABLE
        for joint in range(last):
            is_known = is_known and positions[i, joint] == positions[i - 1, joint]
        begin = same if is_known else 0
        if not project(rig, positions[i], outlines.px, begin):
            # of the geoms before only some may be there
            is_known = False
            continue
        fill_hulls(outlines, begin)
        _fill_places(outlines, cuts, begin)
        if not is_known:
            inside[0] = 0.0
            _add_sums(pictures, outlines, cuts, (same, 0), inside, alone)
            together, is_known = inside[0], True
        inside[0] = together
        _add_sums(pictures, outlines, cuts, (geoms, same), inside, alone)
        costs[i] = inside[0]
    return costs
