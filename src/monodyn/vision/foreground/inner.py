"""numba kernel: where a frame shows what moves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.uncounted import UNCOUNTED
from monodyn.vision.foreground.thumbnails import Window

MOVING, ABSENT = 1, 2
"""Marks of a pixel that shows what moves, and of one where the background does and the frame does not."""


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
    """Mark the pixels of a frame that differ from the background.

    Where the background shows the mechanism itself, what moves is its absence: such a pixel is more like its
    surroundings than the background is.

    Args:
        luma: Grey levels, uint8 (height, width).
        chroma: Blue and red difference, uint8 (channel, height, width); no channels where grey alone counts.
        behind: What the frame is compared with.
        least: Difference from which a pixel has changed [grey levels], and over its noise.
        out: Set to ``MOVING`` or ``ABSENT`` at these pixels and to 0 at others within the window, uint8
            (height, width).
    """
    top, bottom, left, right = behind.window
    contrast, noises = np.float32(least[0]), np.float32(least[1])
    squares = np.zeros(right - left, np.float32)
    for y in range(top, bottom):
        _fill_squares(luma[y][left:right], behind.luma[y][left:right], squares)
        for c in range(chroma.shape[0]):
            _add_squares(chroma[c, y][left:right], behind.chroma[c, y][left:right], squares)
        noise, counts, marks = behind.noise[y][left:right], behind.counts[y][left:right], out[y][left:right]
        _mark_changed(squares, noise, counts, contrast, noises, marks)
        near, columns = behind.around[:, behind.rows[y]], behind.columns[left:right]
        shown = (luma[y][left:right], chroma[:, y, left:right])
        usual = (behind.luma[y][left:right], behind.chroma[:, y, left:right])
        _mark_absent(shown, usual, near, columns, marks)


@njit(cache=True, **UNCOUNTED)
def _fill_squares(row: np.ndarray, behind: np.ndarray, squares: np.ndarray) -> None:
    """Fill ``squares`` with the squared differences of a row of a picture from the background, (pixel,)."""
    for x in range(len(squares)):
        difference = np.float32(row[x]) - behind[x]
        squares[x] = difference * difference


@njit(cache=True, **UNCOUNTED)
def _add_squares(row: np.ndarray, behind: np.ndarray, squares: np.ndarray) -> None:
    """Add the same of another plane."""
    for x in range(len(squares)):
        difference = np.float32(row[x]) - behind[x]
        squares[x] += difference * difference


@njit(cache=True, **UNCOUNTED)
def _mark_changed(
    squares: np.ndarray,
    noise: np.ndarray,
    counts: np.ndarray,
    contrast: np.float32,
    noises: np.float32,
    marks: np.ndarray,
) -> None:
    """Fill ``marks`` with whether the pixels of a row have changed, (pixel,)."""
    for x in range(len(squares)):
        deviation = noises * noise[x]
        deviation = deviation if deviation > contrast else contrast
        marks[x] = (squares[x] > deviation * deviation) & counts[x]


@njit(cache=True, **UNCOUNTED)
def _mark_absent(
    shown: tuple[np.ndarray, np.ndarray],
    usual: tuple[np.ndarray, np.ndarray],
    around: np.ndarray,
    columns: np.ndarray,
    marks: np.ndarray,
) -> None:
    """Mark pixels of a row that are more like what is around, (channel, column), than their background is.

    ``shown`` and ``usual`` are grey levels (pixel,) and colours (channel, pixel).
    """
    for x in range(len(marks)):
        if not marks[x]:
            continue
        near = around[0, columns[x]]
        one, other = np.float32(shown[0][x]) - near, usual[0][x] - near
        off, behind = one * one, other * other
        for c in range(len(shown[1])):
            near = around[c + 1, columns[x]]
            one, other = np.float32(shown[1][c, x]) - near, usual[1][c, x] - near
            off += one * one
            behind += other * other
        if off <= behind:
            marks[x] = ABSENT
