"""From a frame to its binary silhouette: background subtraction and a threshold.

The one idea: what differs from the background by more than one level is the mechanism. Otsu's level divides
the differences into two classes and lies about half-way between their means. So it lies half-way up the edge
of a link of the usual contrast, whose silhouette keeps its size; a link that stands out more comes out a
little larger, one that stands out less a little smaller.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monodyn.errors import SettingsError
from monodyn.types import FULL, Frame
from monodyn.vision.foreground.background import Background

OPEN = FULL // 2
"""What a silhouette holds where the background is not known: such a pixel counts neither for nor against."""
LEAST_PART = 0.04
"""A patch smaller than this share of the largest one is noise."""
SMALL, SURROUNDED = 0.1, 0.33
"""A patch without a known background is the mechanism's when it touches it and is smaller than this share of
it, or when the mechanism covers this share of the patch's border."""
LEAST_THRESHOLD = 4.0
"""Least threshold, in standard deviations of a pixel's noise."""


def silhouette(
    frame: Frame, background: Background, threshold: Threshold, *, settle: bool = True
) -> np.ndarray:
    """Separate the mechanism from the background by a threshold on the difference, ``|I - B| > level``.

    Small patches are left out.

    Args:
        frame: The picture.
        background: What the pixels show without the mechanism.
        threshold: Of grey or of colour.
        settle: Give patches without a known background to the mechanism where it borders them.

    Returns:
        ``FULL`` on the mechanism, 0 elsewhere, and ``OPEN`` where that is not known, uint8
        (height, width).

    Raises:
        SettingsError: the level is not above 0 and below 255.

    Source:
        The 2012 paper, initial pose estimation: silhouette by background subtraction and thresholding.
    """
    import cv2

    level = threshold.level
    if not 0.0 < level < 255.0:
        raise SettingsError(f"silhouette: expected a level above 0 and below 255, got {level:g}.")
    apart = difference(frame, background, colour=threshold.colour)
    _, over = cv2.threshold(apart, level, FULL, cv2.THRESH_BINARY)
    # patches are labelled within their bounding box alone, which is much smaller than the picture
    x, y, width, height = cv2.boundingRect(over)
    if width:
        part = over[y : y + height, x : x + width]
        _, labels, stats, _ = cv2.connectedComponentsWithStats(part, connectivity=4)
        area = stats[:, cv2.CC_STAT_AREA]
        kept = area >= LEAST_PART * area[1:].max()
        kept[0] = False  # label 0 is everything below the level
        part[...] = (kept.astype(np.uint8) * np.uint8(FULL))[np.asarray(labels)]
    # set last: what the removal of small patches left of these pixels gives no information about the
    # mechanism
    over[~background.known] = OPEN
    if settle and not background.known.all():
        _settle_unknown(over, ~background.known)
    return over


def _settle_unknown(picture: np.ndarray, unknown: np.ndarray) -> None:
    """Give patches without a known background to the mechanism where it borders them.

    A first hinge is always covered, and so is a stand that the mechanism was taken for.
    """
    import cv2

    # two pixels more to each side, so that the ring around a patch lies within the window
    x, y, width, height = cv2.boundingRect(unknown.astype(np.uint8))
    x0, y0 = max(x - 2, 0), max(y - 2, 0)
    window = (slice(y0, y + height + 2), slice(x0, x + width + 2))
    part, covered = unknown[window].astype(np.uint8), picture[window] == FULL
    whole = float(np.count_nonzero(picture == FULL))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(part, connectivity=8)
    labels = np.asarray(labels)
    for i in range(1, count):
        left, top, wide, tall = (int(value) for value in stats[i, :4])
        near = (slice(max(top - 2, 0), top + tall + 2), slice(max(left - 2, 0), left + wide + 2))
        # what lies around the patch and is known decides: how much of that ring the mechanism covers
        own = (labels[near] == i).astype(np.uint8)
        ring = (cv2.dilate(own, np.ones((5, 5), np.uint8)) > 0) & (part[near] == 0)
        share = float(covered[near][ring].mean()) if ring.any() else 0.0
        small = stats[i, cv2.CC_STAT_AREA] < SMALL * whole
        # a small patch need only be touched; a large one, like a stand, must be surrounded to a good part
        if share > (0.0 if small else SURROUNDED):
            picture[window][near][own > 0] = FULL


def holds(silhouette: np.ndarray) -> bool:
    """Return whether a silhouette holds anything of the mechanism.

    Args:
        silhouette: uint8 (height, width).
    """
    return bool(np.any(silhouette == FULL))


@dataclass(frozen=True)
class Threshold:
    """What divides the mechanism from the background.

    Attributes:
        level: Least difference of the mechanism [grey levels].
        colour: Colours are compared, and not grey levels alone.
    """

    level: float
    colour: bool = False


def difference(frame: Frame, background: Background, *, colour: bool = False) -> np.ndarray:
    """Return how far each pixel is from the background [grey levels], uint8 (height, width).

    In grey ``|Y - Y_B|``, in colour ``sqrt((Y - Y_B)^2 + (Cb - Cb_B)^2 + (Cr - Cr_B)^2)``.

    Args:
        frame: The picture.
        background: What the pixels show without the mechanism.
        colour: Compare colours, where both have them.
    """
    import cv2

    grey = cv2.absdiff(frame.luma, cv2.convertScaleAbs(background.luma))
    if not colour or frame.chroma is None or background.chroma is None:
        return grey
    blue, red = (
        cv2.absdiff(own, cv2.convertScaleAbs(behind)).astype(np.float32)
        for own, behind in zip(frame.chroma, background.chroma, strict=True)
    )
    # the two colour planes are joined at their own size, a quarter of the picture's, and enlarged once
    size = (grey.shape[1], grey.shape[0])
    hue = cv2.resize(cv2.magnitude(blue, red), size, interpolation=cv2.INTER_LINEAR)
    return cv2.convertScaleAbs(cv2.magnitude(grey.astype(np.float32), hue))


def otsu_threshold(frames: Sequence[Frame], background: Background) -> Threshold:
    """Return the threshold that divides the differences of some frames best into two classes.

    The level maximizes the variance between the classes, ``n0 n1 (m0 - m1)^2``. Colours are compared where
    that variance is then the larger share of the whole one: coloured links may have the background's grey,
    but a picture has half as many colour samples to either side, and grey edges are sharper.

    Args:
        frames: Pictures with the mechanism in them.
        background: What the pixels show without the mechanism.

    Returns:
        The threshold, above the pixels' noise.

    Source:
        Otsu, A threshold selection method from gray-level histograms, 1979.
    """
    grey = _divided(frames, background, colour=False)
    shown = background.chroma is not None and all(frame.chroma is not None for frame in frames)
    (level, share), colour = grey, False
    if shown:
        coloured = _divided(frames, background, colour=True)
        if coloured[1] > share:
            (level, _), colour = coloured, True
    return Threshold(max(level, LEAST_THRESHOLD * background.noise, 1.0), colour)


def _divided(frames: Sequence[Frame], background: Background, *, colour: bool) -> tuple[float, float]:
    """Return Otsu's level [grey levels], and the share of the variance that lies between its classes."""
    top, bottom, left, right = background.window
    counts = np.zeros(256)
    for frame in frames:
        part = difference(frame, background, colour=colour)[top:bottom, left:right]
        counts += np.bincount(part.ravel(), minlength=256)
    levels = np.arange(256.0)
    below, total = np.cumsum(counts), counts.sum()
    sums = np.cumsum(counts * levels)
    above = total - below
    # both classes must have a pixel, or there is no mean to compare
    split = (below > 0) & (above > 0)
    apart = np.zeros(256)
    apart[split] = (sums[split] / below[split] - (sums[-1] - sums[split]) / above[split]) ** 2
    between = below * above * apart
    # the maximum is flat over levels that no pixel has: their middle is as far from both classes as can be
    best = np.flatnonzero(between == between.max())
    whole = total * float(counts @ levels**2) - float(sums[-1]) ** 2
    return float(best.mean()), float(between.max()) / whole if whole > 0.0 else 0.0
