"""numba kernel: where a frame shows what moves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.uncounted import UNCOUNTED
from monodyn.vision.foreground.thumbnails import Window


class Scenery(NamedTuple):
    """What frames are compared with.

    Attributes:
        luma: Grey level of the background, float32 (height, width).
        chroma: Its blue and red difference, float32 (channel, height, width); no channels where grey alone
            counts.
        around: What is around all that moves, float32 (channel, row, column), at any size.
        noise: Standard deviation of each pixel [grey levels], float32 (height, width).
        counts: Where a difference counts as motion, bool (height, width).
        window: The part of the picture in which it does.
        rows: Row of ``around`` that shows each row of the picture, int (height,).
        columns: The same of the columns, int (width,).
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
        chroma: Blue and red difference, uint8 (channel, height, width); no channels where grey alone counts.
        behind: What the frame is compared with.
        least: Difference from which a pixel has changed [grey levels], and over its noise.
        out: Set to 1 at these pixels and to 0 at others within the window, uint8 (height, width).
    """
    top, bottom, left, right = behind.window
    contrast, noises = np.float32(least[0]), np.float32(least[1])
    squares = np.zeros(luma.shape[1], np.float32)
    for y in range(top, bottom):
        row, back, noise, counts, marks = luma[y], behind.luma[y], behind.noise[y], behind.counts[y], out[y]
        for x in range(left, right):
            squares[x] = (np.float32(row[x]) - back[x]) ** 2
        for c in range(chroma.shape[0]):
            shown, usual = chroma[c, y], behind.chroma[c, y]
            for x in range(left, right):
                squares[x] += (np.float32(shown[x]) - usual[x]) ** 2
        for x in range(left, right):
            deviation = noises * noise[x]
            deviation = deviation if deviation > contrast else contrast
            marks[x] = (squares[x] > deviation * deviation) & counts[x]
        for x in range(left, right):
            if marks[x]:
                marks[x] = _stands_out(luma, chroma, behind, y, x)


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def _stands_out(luma: np.ndarray, chroma: np.ndarray, behind: Scenery, y: int, x: int) -> bool:
    """Return whether a pixel is less like what is around than its background is."""
    i, j = behind.rows[y], behind.columns[x]
    near = behind.around[0, i, j]
    off, usual = (np.float32(luma[y, x]) - near) ** 2, (behind.luma[y, x] - near) ** 2
    for c in range(chroma.shape[0]):
        near = behind.around[c + 1, i, j]
        off += (np.float32(chroma[c, y, x]) - near) ** 2
        usual += (behind.chroma[c, y, x] - near) ** 2
    return off > usual
