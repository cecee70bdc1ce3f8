"""numba kernel: where a frame shows what moves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.vision.foreground.thumbnails import Window


class Scenery(NamedTuple):
    """What frames are compared with.

    Attributes:
        luma: Grey level of the background, float32 (height, width).
        chroma: Its blue and red difference, float32 (channel, row, column); no channels where grey alone
            counts.
        around: What is around all that moves, float32 (channel, row, column), at any size.
        noise: Standard deviation of each pixel [grey levels], float32 (height, width).
        counts: Where a difference counts as motion, bool (height, width).
        window: The part of the picture in which it does.
        rows: Row of ``chroma`` and of ``around`` that shows each row of the picture, int (2, height).
        columns: The same of the columns, int (2, width).
    """

    luma: np.ndarray
    chroma: np.ndarray
    around: np.ndarray
    noise: np.ndarray
    counts: np.ndarray
    window: Window
    rows: np.ndarray
    columns: np.ndarray


@njit(cache=True, nogil=True, error_model="numpy")
def fill_moving(
    luma: np.ndarray, chroma: np.ndarray, behind: Scenery, least: tuple[float, float], out: np.ndarray
) -> None:
    """Mark the pixels of a frame that differ from the background, and are less like what is around than that.

    Where the background shows the mechanism itself, what moves is its absence: such a pixel is more like its
    surroundings than the background is, and does not count.

    Args:
        luma: Grey levels, uint8 (height, width).
        chroma: Blue and red difference, uint8 (channel, row, column); no channels where grey alone counts.
        behind: What the frame is compared with.
        least: Difference from which a pixel has changed [grey levels], and over its noise.
        out: Set to 1 at these pixels and to 0 at others within the window, uint8 (height, width).
    """
    top, bottom, left, right = behind.window
    contrast, noises = np.float32(least[0]), np.float32(least[1])
    columns, tint = behind.columns[0], np.zeros(chroma.shape[2], np.float32)
    for y in range(top, bottom):
        tint[:] = 0.0
        for c in range(chroma.shape[0]):
            shown, usual = chroma[c, behind.rows[0, y]], behind.chroma[c, behind.rows[0, y]]
            for v in range(len(tint)):
                tint[v] += (np.float32(shown[v]) - usual[v]) ** 2
        row, back, noise, counts, marks = luma[y], behind.luma[y], behind.noise[y], behind.counts[y], out[y]
        for x in range(left, right):
            difference = np.float32(row[x]) - back[x]
            deviation = noises * noise[x]
            deviation = deviation if deviation > contrast else contrast
            changed = difference * difference + tint[columns[x]] > deviation * deviation
            marks[x] = changed and counts[x]
        for x in range(left, right):
            if marks[x]:
                marks[x] = _stands_out(row[x], back[x], chroma, behind.chroma, behind.around,
                                       behind.rows[:, y], behind.columns[:, x])  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _stands_out(
    grey: np.uint8,
    back: np.float32,
    chroma: np.ndarray,
    behind: np.ndarray,
    around: np.ndarray,
    rows: np.ndarray,
    columns: np.ndarray,
) -> bool:
    """Return whether a pixel is less like what is around than its background is."""
    near = around[0, rows[1], columns[1]]
    off, usual = (np.float32(grey) - near) ** 2, (back - near) ** 2
    for c in range(chroma.shape[0]):
        near = around[c + 1, rows[1], columns[1]]
        off += (np.float32(chroma[c, rows[0], columns[0]]) - near) ** 2
        usual += (behind[c, rows[0], columns[0]] - near) ** 2
    return off > usual
