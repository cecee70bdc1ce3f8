"""Where thumbnails show something in front of the background, and how much, by a numba kernel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.vision.foreground.background import Background
from monodyn.vision.foreground.thumbnails import Thumbnails, Window, reduced


class Still(NamedTuple):
    """What the cells of thumbnails show without anything in front.

    Attributes:
        least: Least level of each channel, as many as the background has, uint8 (channel, height, width).
        most: Largest level of each, uint8 (channel, height, width).
        inside: The region that counts, bool (height, width).
        window: The rows and columns in which it lies.
    """

    least: np.ndarray
    most: np.ndarray
    inside: np.ndarray
    window: Window


def still_cells(thumbnails: Thumbnails, background: Background) -> Still:
    """Find what the cells show where nothing is in front of the background.

    Args:
        thumbnails: Reduced pictures.
        background: The background in full size; where it counts is the region.

    Returns:
        What they show.
    """
    import cv2

    height, width = thumbnails.planes.shape[2:]
    planes = [background.luma, *(background.chroma or ())][: thumbnails.planes.shape[1]]
    behind = np.empty((len(planes), height, width), dtype=np.uint8)
    reduced([np.round(plane).astype(np.uint8) for plane in planes], behind)
    counts = background.counts.astype(np.float32)
    inside = cv2.resize(counts, (width, height), interpolation=cv2.INTER_AREA) > 0.5
    # grey levels are whole numbers
    by = int(thumbnails.still)
    least, most = (np.clip(behind.astype(np.int64) + step, 0, 255).astype(np.uint8) for step in (-by, by))
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    window = Window(0, 0, 0, 0)
    if len(rows):
        window = Window(int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1)
    return Still(least, most, inside, window)


@njit(cache=True, nogil=True)
def changed_area(shown: np.ndarray, still: Still) -> np.ndarray:
    """Return how many cells of each thumbnail show something in front of the background.

    Args:
        shown: The thumbnails, uint8 (frame, channel, height, width).
        still: What they show without.

    Returns:
        The numbers of cells, int64 (frame,).
    """
    top, bottom, left, right = still.window
    # 8 bits to the end: so a loop takes a whole register at a time
    area, changed = np.zeros(shown.shape[0], np.int64), np.empty(right - left, np.uint8)
    for f in range(shown.shape[0]):
        for y in range(top, bottom):
            changed[:] = 0
            for c in range(still.least.shape[0]):
                value, least, most = shown[f, c, y], still.least[c, y], still.most[c, y]
                value, least, most = value[left:right], least[left:right], most[left:right]
                for x in range(right - left):
                    changed[x] |= np.uint8(value[x] < least[x]) | np.uint8(value[x] > most[x])
            inside, count = still.inside[y][left:right], 0
            for x in range(right - left):
                count += changed[x] & inside[x]
            area[f] += count
    return area


def changed(shown: np.ndarray, still: Still) -> np.ndarray:
    """Return where a thumbnail shows something in front of the background.

    Args:
        shown: The thumbnail, uint8 (channel, height, width).
        still: What it shows without.

    Returns:
        The cells, bool (height, width).
    """
    # a background that was given may have no colours
    shown = shown[: len(still.least)]
    return np.any((shown < still.least) | (shown > still.most), axis=0) & still.inside
