"""From a frame to its binary silhouette: background subtraction and a threshold.

The one idea: what differs from the background by more than one level is the mechanism. Otsu's level parts
the differences into two classes; it lies half-way up the mechanism's edge, so the silhouette keeps its size.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.errors import SettingsError
from monodyn.types import FULL, Frame
from monodyn.vision.background import Background

LEAST_PART = 0.04
"""A patch smaller than this share of the largest one is noise."""
LEAST_LEVEL = 4.0
"""Least threshold, in standard deviations of a pixel's noise."""


def silhouette(frame: Frame, background: Background, level: float) -> np.ndarray:
    """Tell the mechanism from the background by a threshold on the grey difference, ``|I - B| > level``.

    Pixels that the background never shows are always covered, so they belong to the mechanism. Small patches
    are left out.

    Args:
        frame: The picture.
        background: What the pixels show without the mechanism.
        level: The threshold [grey levels].

    Returns:
        ``FULL`` on the mechanism and 0 elsewhere, uint8 (height, width).

    Raises:
        SettingsError: the level is not above 0 and below 255.

    Source:
        The 2012 paper, initial pose estimation: silhouette by background subtraction and thresholding.
    """
    import cv2

    if not 0.0 < level < 255.0:
        raise SettingsError(f"silhouette: expected a level above 0 and below 255, got {level:g}.")
    stands_out = (difference(frame, background) > level) | ~background.known
    count, labels, stats, _ = cv2.connectedComponentsWithStats(stands_out.astype(np.uint8), connectivity=4)
    if count == 1:
        return np.zeros(stands_out.shape, np.uint8)
    area = stats[:, cv2.CC_STAT_AREA]
    kept = area >= LEAST_PART * area[1:].max()
    kept[0] = False
    return (kept.astype(np.uint8) * np.uint8(FULL))[np.asarray(labels)]


def difference(frame: Frame, background: Background) -> np.ndarray:
    """Return how far each pixel is from the background [grey levels], uint8 (height, width).

    Args:
        frame: The picture.
        background: What the pixels show without the mechanism.
    """
    import cv2

    return cv2.absdiff(frame.luma, cv2.convertScaleAbs(background.luma))


def otsu_level(frames: Sequence[Frame], background: Background) -> float:
    """Return the threshold that parts the differences of some frames best into two classes.

    The level maximizes the variance between the classes, ``n0 n1 (m0 - m1)^2``.

    Args:
        frames: Pictures with the mechanism in them.
        background: What the pixels show without the mechanism.

    Returns:
        The threshold [grey levels], above the pixels' noise.

    Source:
        Otsu, A threshold selection method from gray-level histograms, 1979.
    """
    top, bottom, left, right = background.reach
    counts = np.zeros(256)
    for frame in frames:
        part = difference(frame, background)[top:bottom, left:right]
        counts += np.bincount(part.ravel(), minlength=256)
    levels = np.arange(256.0)
    below, total = np.cumsum(counts), counts.sum()
    sums = np.cumsum(counts * levels)
    above = total - below
    split = (below > 0) & (above > 0)
    apart = np.zeros(256)
    apart[split] = (sums[split] / below[split] - (sums[-1] - sums[split]) / above[split]) ** 2
    best = np.flatnonzero(below * above * apart == (below * above * apart).max())
    return float(max(best.mean(), LEAST_LEVEL * background.noise, 1.0))
