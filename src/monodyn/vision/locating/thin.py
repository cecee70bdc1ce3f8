"""What is thinner than the steps of the search, made as thick as these, in the masks and the mechanism alike.

A search that tries poses and lengths in steps meets a link only if the link is about as wide as the steps are
long. In a reduced mask a thin rod, and a faint one, is a line of pixels none of which is covered by half: to
a score that compares areas it is not there. So every level of such a mask is taken against the highest one
next to it, and everything in it is made thicker by one amount, by which the mechanism is drawn thicker too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.mechanism import Mechanism
from monodyn.types import FULL
from monodyn.vision.locating.unit import drawn

LEAST_WIDTH_PX = 1.5
"""No width becomes smaller than this in a refinement: an outline without an inside meets no edges [px]."""
MET_PX = 4.0
"""Width of what the search meets: half a step of a hinge away, a link as long as half of the reduced picture
still touches itself at its far end [reduced px]."""
WIDE_SHARE = 0.2
"""Share of the foreground in places at least as wide, below which everything is made thicker. Links of two
reduced pixels, of which hardly anything is as wide, are still met as they are; and where much is wide, what
is made thicker grows together with the shadows beside it."""
LEAST_GAIN = 0.4
"""Share of the foreground that even the best outline explains, to a score that compares areas, below which
the levels are too low for that score."""
NEAR_PX = 2
"""Levels are taken against the highest one within this distance [reduced px]."""
SPECK = 8
"""Pixels of a connected piece of the mask below which it is noise."""


def lacking(masks: Sequence[np.ndarray]) -> int | None:
    """Return by how much the foreground has to be made thicker to be met by the search.

    Args:
        masks: Reduced masks, 0 where nothing is known, uint8 (height, width).

    Returns:
        The amount to every side [reduced px]; None where the masks can be searched as they are.
    """
    import cv2

    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (int(MET_PX),) * 2)

    def judged(mask: np.ndarray) -> tuple[float, float, float] | None:
        pieces = _without_specks(mask)
        level = pieces / FULL
        total = float(level.sum())
        if total <= 0.0:
            return None
        wide = float(cv2.morphologyEx(level, cv2.MORPH_OPEN, disc).sum()) / total
        gained = float(np.maximum(2.0 * level - 1.0, 0.0).sum()) / total
        return wide, gained, _typical_width(_evened(pieces))

    found = [one for one in on_all_cores(judged, masks) if one is not None]
    if not found:
        return None
    wide, gained, width = np.median(found, axis=0).tolist()
    if wide < WIDE_SHARE:
        return max(0, int(np.ceil(0.5 * (MET_PX - width))))
    return 0 if gained < LEAST_GAIN else None


def thickened_mask(mask: np.ndarray, by: int) -> np.ndarray:
    """Return a mask in which the foreground is thicker, at even levels.

    Args:
        mask: Reduced mask, uint8 (height, width).
        by: The amount to every side [reduced px].

    Returns:
        The mask, uint8 (height, width).
    """
    import cv2

    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * by + 1,) * 2)
    return cv2.dilate(evened(mask), disc)


def evened(mask: np.ndarray) -> np.ndarray:
    """Take every level of a mask against the highest one next to it.

    Args:
        mask: Reduced mask, uint8 (height, width).

    Returns:
        The mask without specks, ``FULL`` on every ridge, uint8 (height, width).
    """
    return _evened(_without_specks(mask))


def _evened(level: np.ndarray) -> np.ndarray:
    """Take every level, float32 (height, width), against the highest one next to it."""
    import cv2

    highest = cv2.dilate(level, np.ones((2 * NEAR_PX + 1,) * 2, np.uint8))
    return np.round(FULL * level / np.maximum(highest, 1.0)).astype(np.uint8)


def _without_specks(mask: np.ndarray) -> np.ndarray:
    """Return the levels of a mask without its small pieces, float32 (height, width)."""
    import cv2

    _, pieces, stats, _ = cv2.connectedComponentsWithStats((mask > 0).astype(np.uint8), connectivity=8)
    kept = (stats[:, cv2.CC_STAT_AREA] >= SPECK)[np.asarray(pieces, dtype=np.intp)]
    return np.where(kept, np.minimum(mask, FULL), 0).astype(np.float32)


def _typical_width(mask: np.ndarray) -> float:
    """Return the median width of the foreground along its ridges [reduced px]."""
    import cv2

    depth = cv2.distanceTransform((mask > FULL // 2).astype(np.uint8), cv2.DIST_L2, 5)
    ridge = depth[(depth > 0) & (depth >= cv2.dilate(depth, np.ones((3, 3), np.uint8)))]
    # a distance is counted to the middle of the next pixel outside
    return 2.0 * float(np.median(ridge)) - 1.0


def thickened(mechanism: Mechanism, by: float, least: float = 0.0) -> Mechanism:
    """Return a mechanism whose bodies are thicker.

    Args:
        mechanism: The mechanism.
        by: The amount to every side, in its unit of length; negative for thinner.
        least: No width becomes less than this, in the same unit.

    Returns:
        The mechanism with other widths, and ends that reach as much farther.
    """
    if by == 0.0:
        return mechanism
    sizes = {}
    for p in drawn(mechanism):
        if p.kind in ("width", "extent"):
            sizes[p.name] = max(p.value + 2.0 * by, least)
        elif p.kind in ("tail", "tip"):
            sizes[p.name] = max(p.value + by, 0.0)
    return mechanism.with_values(sizes)
