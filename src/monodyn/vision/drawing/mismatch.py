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
from monodyn.uncounted import INLINED, UNCOUNTED
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.drawing.silhouette import Outlines, blank_outlines, draw, fill_hulls, projected

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
    balance = row_sums(coverage)
    for y in range(balance.shape[0]):
        for x in range(balance.shape[1]):
            balance[y, x] = np.float32(x) - np.float32(2.0) * balance[y, x]
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


@njit(cache=True, **UNCOUNTED)
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
            xp, yp, xq, yq = float(px[p, 0]), float(px[p, 1]), float(px[q, 0]), float(px[q, 1])
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


@njit(cache=True, **INLINED)
def _is_beside(cuts: np.ndarray, h: int, xp: float, yp: float, xq: float, yq: float) -> bool:
    """Return whether an edge lies beside the box of a geom, ``cuts`` (geom, 10): most are far from most."""
    if cuts[h, LEFT] > max(xp, xq) or cuts[h, RIGHT] < min(xp, xq):
        return True
    return cuts[h, TOP] > max(yp, yq) or cuts[h, BOTTOM] < min(yp, yq)


@njit(cache=True, **UNCOUNTED)
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


@njit(cache=True, **UNCOUNTED)
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


@njit(cache=True, **UNCOUNTED)
def _along_edge(sums: np.ndarray, x0: float, y0: float, x1: float, y1: float) -> float:
    """Integrate F dy along an edge of a silhouette, pixel by pixel; ``sums`` (height, width + 1)."""
    if y0 == y1:
        return 0.0
    height, width = sums.shape[0], sums.shape[1] - 1
    sign = 1.0
    if y0 > y1:  # so that rows are counted up
        x0, y0, x1, y1, sign = x1, y1, x0, y0, -1.0
    slope = (x1 - x0) / (y1 - y0)
    # pixel centres are whole numbers, and pixels reach half a pixel to either side: from here on whole
    # numbers are the borders between them
    x, y, end = x0 + 0.5, y0 + 0.5, min(y1 + 0.5, float(height))
    if y < 0.0:
        x, y = x - y * slope, 0.0
    # what enters or leaves the picture by its sides passes through columns that do not exist
    i, j, total = int(y), min(max(math.floor(x), -1), width), 0.0
    turn = 1 if slope > 0.0 else -1
    per_column = abs(1.0 / slope) if slope != 0.0 else 1e18
    below = i + 1.0
    beside = 1e18
    if slope > 0.0 and j < width:
        beside = y + (j + 1 - x) * per_column
    elif slope < 0.0 and j >= 0:
        beside = y + (x - j) * per_column
    while y < end:
        # the next border that the edge meets: that of a row, of a column, or its own end
        stop = min(below, beside, end)
        step = stop - y
        to = x + step * slope
        if j >= width:
            total += step * sums[i, width]
        elif j >= 0:
            # within a pixel F is a straight line: its mean is the value in the middle
            before = sums[i, j]
            total += step * (before + (0.5 * (x + to) - j) * (sums[i, j + 1] - before))
        if beside <= below:
            j += turn
            beside = 1e18 if (j < 0 and turn < 0) or (j >= width and turn > 0) else beside + per_column
        if stop == below:
            i += 1
            below += 1.0
        x, y = to, stop
    return sign * total


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
    costs, alone = np.empty(positions.shape[0]), np.empty(outlines.hull.shape[0])
    _fill_balance(pictures, rig, positions, geoms, outlines, cuts, inside, alone, costs)
    return costs


@njit(cache=True, **UNCOUNTED)
def _fill_balance(
    pictures: np.ndarray,
    rig: Rig,
    positions: np.ndarray,
    geoms: int,
    outlines: Outlines,
    cuts: np.ndarray,
    inside: np.ndarray,
    alone: np.ndarray,
    costs: np.ndarray,
) -> None:
    """Do the work of ``pose_balance``: fill ``costs`` (pose,) for ``positions`` (pose, dof).

    ``pictures`` (1, height, width + 1) has the balance; the outlines, ``cuts`` (geom, 10), ``inside`` (1,)
    and ``alone`` (entry of the hull,) are room.
    """
    last, same = rig.link[geoms - 1] if geoms > 0 else 0, 0
    for g in range(geoms):
        same += rig.link[g] < last
    # of the geoms before the last joint's: what each edge costs as long as no other geom touches it is kept
    # in ``alone``, and what all of them cost here
    together, is_known = 0.0, False
    for i in range(positions.shape[0]):
        costs[i] = UNDRAWABLE
        for joint in range(last):
            is_known = is_known and positions[i, joint] == positions[i - 1, joint]
        begin = same if is_known else 0
        if not projected(rig, positions[i], outlines.px, outlines.frames, begin):
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
