"""What is thinner than the steps of the search, made as thick as these: in the masks, and the mechanism alike.

A search that tries poses and lengths in steps meets a link only if the link is about as wide as the steps are
long. In a reduced mask a thin rod, and a faint one, is a line of pixels none of which is covered by half: to a
score that compares areas it is not there. So every level of such a mask is taken against the highest one next
to it, and all of it is made thicker by the same amount.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.types import FULL
from monodyn.vision.locating.unit import drawn

MET_PX = 4.0
"""Width of what the search meets: with half a step of a hinge between them, the outline of a link as long as
half of the largest reduced picture still touches the link at its far end [reduced px]."""
WIDE_SHARE = 0.5
"""Share of the foreground wider than that below which all is made thicker."""
LEAST_GAIN = 0.4
"""What the best possible outline explains of the foreground, as a score that compares areas counts it, below
which the levels are too low for that score."""
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
    wide, gained, widths = [], [], []
    for mask in masks:
        level = _without_specks(mask) / FULL
        total = float(level.sum())
        if total == 0.0:
            continue
        wide.append(float(cv2.morphologyEx(level, cv2.MORPH_OPEN, disc).sum()) / total)
        gained.append(float(np.maximum(2.0 * level - 1.0, 0.0).sum()) / total)
        depth = cv2.distanceTransform((evened(mask) > FULL // 2).astype(np.uint8), cv2.DIST_L2, 5)
        ridge = depth[(depth > 0) & (depth >= cv2.dilate(depth, np.ones((3, 3), np.uint8)))]
        widths.append(2.0 * float(np.median(ridge)) - 1.0 if len(ridge) else MET_PX)
    if not wide:
        return None
    thin = float(np.median(wide)) < WIDE_SHARE
    if not thin and float(np.median(gained)) >= LEAST_GAIN:
        return None
    return max(0, int(np.ceil(0.5 * (MET_PX - float(np.median(widths)))))) if thin else 0


def evened(mask: np.ndarray) -> np.ndarray:
    """Take every level of a mask against the highest one next to it.

    Args:
        mask: Reduced mask, uint8 (height, width).

    Returns:
        The mask without specks, ``FULL`` on every ridge, uint8 (height, width).
    """
    import cv2

    levels = _without_specks(mask)
    highest = cv2.dilate(levels, np.ones((2 * NEAR_PX + 1,) * 2, np.uint8))
    return np.round(FULL * levels / np.maximum(highest, 1.0)).astype(np.uint8)


def thickened_mask(mask: np.ndarray, by: int) -> np.ndarray:
    """Return a mask in which the foreground is thicker.

    Args:
        mask: Reduced mask, uint8 (height, width).
        by: The amount to every side [reduced px].

    Returns:
        The mask, uint8 (height, width).
    """
    import cv2

    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * by + 1,) * 2)
    return cv2.dilate(evened(mask), disc)


def _without_specks(mask: np.ndarray) -> np.ndarray:
    """Return the levels of a mask without small pieces, float32 (height, width)."""
    import cv2

    _, pieces, stats, _ = cv2.connectedComponentsWithStats((mask > 0).astype(np.uint8), connectivity=8)
    kept = (stats[:, cv2.CC_STAT_AREA] >= SPECK)[np.asarray(pieces, dtype=np.intp)]
    return np.where(kept, np.minimum(mask, FULL), 0).astype(np.float32)


def thickened(mechanism: Mechanism, by: float, least: float = 0.0) -> Mechanism:
    """Return a mechanism whose bodies are thicker.

    Args:
        mechanism: The mechanism.
        by: The amount to every side, in its unit of length; less than 0 for thinner.
        least: No width becomes less than this.

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
