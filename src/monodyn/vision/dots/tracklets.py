"""Spots in, tracklets out: runs of spots that are surely one thing, because nothing else was near.

A tracklet goes on where its motion leads. Where two could go on with one spot, or one with two, all of them
end: which is which is for the mechanism to say.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.vision.dots.pairs import cheapest_pairs
from monodyn.vision.dots.spots import Spots

NEAR_PX = 3.0
"""Distance from where the motion leads within which a spot goes on with it, at least [px]."""
NEAR_STEP = 0.5
"""The same as a share of the last step."""
CLEARER = 2.0
"""How many times farther away the next best has to be for a spot to go on with a tracklet surely."""
FARTHEST = 0.15
"""Largest first step, as a share of the picture's longer side."""
GAP = 2
"""Frames without a spot that a tracklet outlasts."""
WHOLE = (0.55, 1.45)
"""Area of a spot over the usual one around it within which it is that thing alone, wholly seen."""
MERGED = 1.25
"""The same over nearly the largest of the tracklet, at most."""
AROUND = 4
"""Spots before and after one whose median area is the usual one: a thing that becomes fast becomes small."""
LEAST = 3
"""Spots of a tracklet, at least."""


@dataclass(frozen=True, eq=False)
class Tracklet:
    """One thing over some frames.

    Attributes:
        row: Rows of the frames, increasing, (point,).
        px: Where it is [px], (point, 2).
        area: Its area [px], (point,).
    """

    row: np.ndarray
    px: np.ndarray
    area: np.ndarray

    def between(self, first: int, stop: int) -> Tracklet:
        """Return the part in some frames.

        Args:
            first: Row of the first.
            stop: Row after the last.
        """
        kept = (self.row >= first) & (self.row < stop)
        return Tracklet(self.row[kept], self.px[kept], self.area[kept])


def tracklets_of(spots: Spots, longest: float) -> list[Tracklet]:
    """Put the spots of a clip into tracklets.

    Args:
        spots: The spots.
        longest: Longer side of the picture [px].

    Returns:
        The tracklets, the earliest first.
    """
    ends = np.searchsorted(spots.row, np.arange(len(spots.frame) + 1))
    open_ones: list[list[int]] = []
    done: list[list[int]] = []
    for row in range(len(spots.frame)):
        new = np.arange(ends[row], ends[row + 1])
        late = [run for run in open_ones if row - spots.row[run[-1]] > GAP + 1]
        done += late
        open_ones = [run for run in open_ones if run not in late]
        after = np.arange(ends[row + 1], ends[row + 2]) if row + 1 < len(spots.frame) else new[:0]
        joined, broken = _joined(spots, open_ones, new, after, FARTHEST * longest)
        for k, spot in joined:
            open_ones[k].append(int(spot))
        done += [open_ones[k] for k in broken]
        taken = {int(spot) for _, spot in joined}
        open_ones = [run for k, run in enumerate(open_ones) if k not in broken]
        open_ones += [[int(spot)] for spot in new if int(spot) not in taken]
    found = [_whole(spots, np.array(run)) for run in (*done, *open_ones) if len(run) >= LEAST]
    return sorted((t for t in found if len(t.row) >= LEAST), key=lambda t: (int(t.row[0]), -len(t.row)))


def _joined(
    spots: Spots, runs: list[list[int]], new: np.ndarray, after: np.ndarray, farthest: float
) -> tuple[list[tuple[int, int]], set[int]]:
    """Return which run goes on with which spot, and the runs that end because that is not clear."""
    if not len(runs) or not len(new):
        return [], set()
    row = int(spots.row[new[0]])
    away, near = np.full((len(runs), len(new)), np.inf), np.zeros(len(runs))
    for k, run in enumerate(runs):
        away[k], near[k] = _away(spots, run, row, new, after, farthest)
    rows, columns = cheapest_pairs(np.minimum(away / near[:, np.newaxis], 1e3))
    joined, broken = [], set()
    for k, j in zip(rows, columns, strict=True):
        if away[k, j] > near[k]:
            continue
        # another spot that this run could go on with, or another run that could go on with this spot
        others = np.concatenate([np.delete(away[k], j) / near[k], np.delete(away[:, j] / near, k)])
        if others.min(initial=np.inf) < max(CLEARER * away[k, j] / near[k], 0.5 if len(runs[k]) > 1 else 0.0):
            broken.add(int(k))
        else:
            joined.append((int(k), int(new[j])))
    return joined, broken


def _away(
    spots: Spots, run: list[int], row: int, new: np.ndarray, after: np.ndarray, farthest: float
) -> tuple[np.ndarray, float]:
    """Return how far the spots of a frame are from where a run leads (point,), and how far they may be."""
    px, rows = spots.px[run[-3:]], spots.row[run[-3:]]
    gap = row - int(rows[-1])
    if len(run) == 1:
        # nothing is known of its motion: the frame after has to show it going on
        step = np.linalg.norm(spots.px[new] - px[-1], axis=1)
        on = 2.0 * spots.px[new] - px[-1]
        if not len(after) or gap > 1:
            return np.where(step < NEAR_PX, step, np.inf), NEAR_PX
        off = np.linalg.norm(spots.px[after][np.newaxis] - on[:, np.newaxis], axis=2).min(axis=1)
        near = NEAR_PX + NEAR_STEP * step
        score = np.where((step < farthest) & (off < near), off + 0.5 * step, np.inf)
        return score, farthest
    rate = (px[-1] - px[-2]) / (rows[-1] - rows[-2])
    expected = px[-1] + rate * gap
    if len(run) > 2 and rows[-1] - rows[-3] == 2:
        # three in a row show how the motion bends
        expected += 0.5 * gap * (gap + 1) * (px[-1] - 2.0 * px[-2] + px[-3])
    near = gap * (NEAR_PX + NEAR_STEP * float(np.hypot(*rate)))
    return np.linalg.norm(spots.px[new] - expected, axis=1), near


def _whole(spots: Spots, run: np.ndarray) -> Tracklet:
    """Return a run without spots of an unusual area: partly hidden, or two things in one."""
    rows = np.clip(np.arange(len(run))[:, np.newaxis] + np.arange(-AROUND, AROUND + 1), 0, len(run) - 1)
    share = spots.area[run] / np.median(spots.area[run][rows], axis=1)
    # two things that are one spot for long are not usual in the whole of the run
    alone = spots.area[run] < MERGED * np.percentile(spots.area[run], 80.0)
    kept = run[(share > WHOLE[0]) & (share < WHOLE[1]) & alone]
    return Tracklet(spots.row[kept], spots.px[kept], spots.area[kept])
