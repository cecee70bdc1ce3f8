"""Where the root of a mechanism may be, inside of the picture or not, from what its masks have in common.

A body that turns about a fixed point shows at every distance from it the same amount of foreground in all
frames. So does, but for what folds over, a chain of bodies near its root. The share of the foreground that
keeps its distance therefore tells how likely a point is the root, also where the point is hidden, out of the
picture, or joined to the rest by something that cannot be seen. What slides along a line keeps its distances
from the line instead.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.types import FULL
from monodyn.uncounted import UNCOUNTED
from monodyn.vision.locating.keyframes import KeyFrames

FARTHEST_DISTANCE = 40.0
"""Distances from the foreground count up to this [reduced px]."""
UNKNOWN_DISTANCE = 0.3
"""Weight of distances where the background is not known."""
COMPARED = 8
"""Frames of which the profiles are compared."""
SPARED = (0, 2)
"""Frames that may lack at a distance what the others have there. None: the sharpest comparison; some: what is
hidden or leaves the picture now and then counts all the same."""
JUDGED = 1
"""Frames that may lack it when the found points are compared."""
COARSE_CELLS, FINE_CELLS = 22, 45
"""Cells of the foreground's extent, in which its amount is summed before distances are taken: on the grid and
around its best points."""
LEAST_AMOUNT = 0.15
"""Foreground of a cell that counts, in sides of the cell [reduced px]."""
MOST_STEPS = 12
"""Most steps of one length on the way to a best point."""
POINTS = 18
"""Points of the grid over the extent; the grid reaches as far beyond it on every side."""
BEST = 2
"""Best points of each comparison that are refined."""
APART = 0.08
"""Least distance of two such points, as a share of the extent."""
LEAST_COMMON = 0.4
"""Foreground on a line, in all frames, from which a root may slide there [reduced px]."""
LEAST_REACH = 2.0
"""Least reach of a mechanism [reduced px]."""


class Root(NamedTuple):
    """Where the first joint may be.

    Attributes:
        x: Its place to the right [px], NaN for one that slides that way.
        y: Its place downwards [px], NaN for one that slides that way.
        reach: How far the foreground reaches from there [px].
        extents: How long the foreground is along a slide, together with what is not known of the background
            [px]: least, median and greatest of the frames; none for a hinge.
    """

    x: float
    y: float
    reach: float
    extents: tuple[float, ...] = ()


class _Cells(NamedTuple):
    """The foreground of some frames as cells: places [reduced px], amounts, and where each frame's start."""

    x: np.ndarray
    y: np.ndarray
    amount: np.ndarray
    first: np.ndarray
    side: float
    extent: float


def root_points(frames: KeyFrames, count: int = 6) -> list[Root]:
    """Return where a fixed first hinge may be, the likeliest first.

    Args:
        frames: Key frames of the clip.
        count: Most points.

    Returns:
        The points.
    """
    points = [*_turning_points(frames), *_resting_points(frames, count)]
    least = 2.0
    chosen: list[tuple[float, float]] = []
    for point in points:
        if all(math.dist(point, other) >= least for other in chosen):
            chosen.append(point)
    shown = [np.argwhere((frame.coarse > FULL // 2) & ~frames.unknown) for frame in frames.frames]
    return [_root_at(shown, frames.shrink, *point) for point in chosen[:count]]


def root_lines(frames: KeyFrames, count: int = 7, *, upright: bool = False) -> list[Root]:
    """Return heights at which a sliding root may run; along its slide its place is the joint position.

    Args:
        frames: Key frames of the clip.
        count: Most heights.
        upright: True for a slide up and down; then these are places to the right.

    Returns:
        The heights, as roots that are NaN along the slide.
    """
    axis = 0 if upright else 1
    known = [np.where(frames.unknown, 0, frame.coarse) for frame in frames.frames]
    ever = np.nonzero(np.max([mask.max(axis=axis) for mask in known], axis=0) > FULL // 2)[0]
    if not len(ever):
        return []
    places: list[float] = []
    for hidden in (0, FULL):
        # what slides along a line covers as much of it in every frame, where the background is not known too
        masks = [np.where(frames.unknown, hidden, mask) for mask in known]
        common = np.min([mask.sum(axis=axis, dtype=np.int64) for mask in masks], axis=0) / FULL
        always = np.nonzero(common > LEAST_COMMON)[0]
        if len(always):
            places.append(float(np.mean(np.nonzero(common > 0.5 * common.max())[0])))
            places += np.linspace(always[0], always[-1], count // 2).tolist()
    places = places or np.linspace(ever[0], ever[-1], count).tolist()
    roots = []
    for place in np.unique(np.round(places)):
        px = float(place + 0.5) * frames.shrink - 0.5
        reach = max(float(ever[-1] - place), float(place - ever[0]), LEAST_REACH) * frames.shrink
        along = _extents(frames, int(place), upright=upright)
        roots.append(Root(px, np.nan, reach, along) if upright else Root(np.nan, px, reach, along))
    return roots


def _extents(frames: KeyFrames, place: int, *, upright: bool) -> tuple[float, ...]:
    """Return the extents of the longest stretch of each frame along a line [px]; see ``Root``.

    A body that slides little shows its ends alone, and what is between them is its own picture.
    """
    lengths = []
    for frame in frames.frames:
        inside = (frame.coarse > FULL // 2) | frames.unknown
        line = np.concatenate([[False], inside[:, place] if upright else inside[place], [False]])
        edges = np.flatnonzero(line[1:] != line[:-1])
        lengths.append(float(np.max(edges[1::2] - edges[::2], initial=0)))
    return tuple(length * frames.shrink for length in np.percentile(lengths, [0, 50, 100]) if length > 0.0)


def _turning_points(frames: KeyFrames) -> list[tuple[float, float]]:
    """Return points from which the foreground keeps its distances, the best first [reduced px]."""
    masks = [np.where(frames.unknown, 0, frames.frames[row].coarse) for row in frames.most_distinct(COMPARED)]
    rough, fine = (_cells(masks, count) for count in (COARSE_CELLS, FINE_CELLS))
    if not len(rough.x):
        return []
    step = rough.extent / POINTS
    x = np.arange(rough.x.min() - rough.extent, rough.x.max() + rough.extent + step, step)
    y = np.arange(rough.y.min() - rough.extent, rough.y.max() + rough.extent + step, step)
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    kept = _kept_amount(rough, grid, step)
    found = []
    for rank in SPARED:
        left = kept[:, rank].copy()
        for _ in range(BEST):
            best = int(np.argmax(left))
            found.append(_climbed(fine, grid[best], step, rank))
            left[np.hypot(*(grid - grid[best]).T) < max(APART * rough.extent, step)] = -1.0
    # all are judged by one measure, at the finest step
    judged = _kept_amount(fine, np.array(found), fine.side)[:, JUDGED]
    return [(float(found[i][0]), float(found[i][1])) for i in np.argsort(judged, kind="stable")[::-1]]


def _cells(masks: list[np.ndarray], count: int) -> _Cells:
    """Sum the foreground over cells, of which its extent has about ``count``."""
    rows, columns = np.nonzero(np.max(masks, axis=0) > FULL // 2)
    if not len(rows):
        none = np.zeros(0)
        return _Cells(none, none, none, np.zeros(1, dtype=np.int64), 1.0, 1.0)
    extent = float(max(np.ptp(rows), np.ptp(columns), 1))
    side = max(1, round(extent / count))
    x, y, amount, first = [], [], [], [0]
    for mask in masks:
        height, width = (size // side for size in mask.shape)
        blocks = mask[: height * side, : width * side].reshape(height, side, width, side)
        sums = blocks.sum(axis=(1, 3), dtype=np.float64) / FULL
        below, right = np.nonzero(sums > LEAST_AMOUNT * side)
        x.append(side * (right + 0.5) - 0.5)
        y.append(side * (below + 0.5) - 0.5)
        amount.append(sums[below, right])
        first.append(first[-1] + len(below))
    return _Cells(
        np.concatenate(x), np.concatenate(y), np.concatenate(amount), np.array(first), float(side), extent
    )


def _climbed(cells: _Cells, start: np.ndarray, step: float, rank: int) -> np.ndarray:
    """Move a point to where most of the foreground keeps its distance, in steps down to a cell, (2,)."""
    around = np.array([(i, j) for i in (-1.0, 0.0, 1.0) for j in (-1.0, 0.0, 1.0)])
    point = start
    while step > 0.5 * cells.side:
        # far from the foreground the best points lie on a narrow ridge: many short steps lead along it
        for _ in range(MOST_STEPS):
            tried = point + step * around
            kept = _kept_amount(cells, tried, max(step, cells.side))[:, rank]
            best = int(np.argmax(kept))
            if kept[best] <= kept[4]:
                break
            point = tried[best]
        step *= 0.5
    return point


def _kept_amount(cells: _Cells, points: np.ndarray, width: float) -> np.ndarray:
    """Return how much of the foreground keeps its distance from each point (point, 2), as a share of all,
    where 0, 1 or 2 frames may have less, (point, 3); distances are told apart by ``width`` [reduced px]."""
    frames = len(cells.first) - 1
    far = float(np.abs(points).max()) + float(max(cells.x.max(), cells.y.max()))
    amount = np.zeros((len(points), 3))
    bins = np.zeros((int(1.5 * far / width) + 3, frames))
    _fill_kept(cells, points, width, bins, amount)
    return amount * frames / max(float(cells.amount.sum()), 1e-9)


@njit(cache=True, **UNCOUNTED)
def _fill_kept(cells: _Cells, points: np.ndarray, width: float, bins: np.ndarray, amount: np.ndarray) -> None:
    """Fill ``amount`` (point, 3) by way of ``bins`` (distance, frame)."""
    x, y, weight, first = cells.x, cells.y, cells.amount, cells.first
    frames = bins.shape[1]
    for p in range(points.shape[0]):
        low, high = bins.shape[0] - 1, 0
        for f in range(frames):
            for i in range(first[f], first[f + 1]):
                dx, dy = x[i] - points[p, 0], y[i] - points[p, 1]
                r = math.sqrt(dx * dx + dy * dy) / width
                k = int(r)
                bins[k, f] += weight[i] * (k + 1 - r)
                bins[k + 1, f] += weight[i] * (r - k)
                low, high = min(low, k), max(high, k + 1)
        amount[p] = 0.0
        for k in range(low, high + 1):
            # the three least amounts, in order
            least, second, third = 1e18, 1e18, 1e18
            for f in range(frames):
                value = bins[k, f]
                bins[k, f] = 0.0
                if value < least:
                    least, second, third = value, least, second
                elif value < second:
                    second, third = value, second
                elif value < third:
                    third = value
            amount[p, 0] += least
            amount[p, 1] += second if frames > 1 else least
            amount[p, 2] += third if frames > 2 else least


def _resting_points(frames: KeyFrames, count: int) -> list[tuple[float, float]]:
    """Return points on which the foreground rests [reduced px]: the likeliest first, then each time the one
    farthest from those chosen."""
    distance = _distances(frames)
    y, x = np.nonzero(distance <= distance.min() + 1.5)
    points = np.column_stack([x, y]).astype(np.float64)
    picks = [points[int(np.argmin(distance[y, x]))]]
    apart = np.full(len(points), np.inf)
    while len(picks) < min(count, len(points)):
        apart = np.minimum(apart, np.hypot(*(points - picks[-1]).T))
        if apart.max() < 2.0:
            break
        picks.append(points[int(np.argmax(apart))])
    return [(float(px), float(py)) for px, py in picks]


def _distances(frames: KeyFrames) -> np.ndarray:
    """Return each reduced pixel's mean distance from the foreground of the frames [reduced px].

    Where the background is not known the mechanism may be without being seen: distances count less there.
    """
    import cv2

    far = []
    for frame in frames.frames:
        empty = ((frame.coarse < 0.4 * FULL) | frames.unknown).astype(np.uint8)
        far.append(np.minimum(cv2.distanceTransform(empty, cv2.DIST_L2, 5), FARTHEST_DISTANCE))
    return np.mean(far, axis=0) * np.where(frames.unknown, UNKNOWN_DISTANCE, 1.0)


def _root_at(shown: list[np.ndarray], shrink: int, px: float, py: float) -> Root:
    """Return a root at a reduced pixel with the farthest that the foreground reaches from there; ``shown`` is
    where it is in each frame, rows and columns, (pixel, 2)."""
    reaches = []
    for pixels in shown:
        if len(pixels):
            away = np.hypot(pixels[::2, 1] - px, pixels[::2, 0] - py)
            # not the farthest pixel, which may be a speck
            reaches.append(float(np.partition(away, -1 - len(away) // 100)[-1 - len(away) // 100]))
    reach = max(reaches, default=10.0)
    return Root((px + 0.5) * shrink - 0.5, (py + 0.5) * shrink - 0.5, max(reach, LEAST_REACH) * shrink)
