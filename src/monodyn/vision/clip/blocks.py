"""numba kernels: what the blocks of a picture show, each of whole pixels."""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.uncounted import INLINED, UNCOUNTED

SHORT = 256
"""Rows of a block on average below which the sums of its columns are taken in 16 bits: these hold 257 rows,
and a block has one more than the average at most."""


@njit(cache=True, nogil=True)
def block_means(plane: np.ndarray, out: np.ndarray) -> None:
    """Fill ``out`` with the means of the blocks into which it divides a plane, as even as whole pixels are.

    Args:
        plane: Grey levels, uint8 (height, width).
        out: The means, rounded, uint8 (row, column); at most as many of either as the plane has.
    """
    width, (rows, columns) = plane.shape[1], out.shape
    edges = _edges(width, columns)
    if plane.shape[0] < SHORT * rows:
        _fill_means(plane, np.zeros(width, np.uint16), edges, out)
    else:
        _fill_means(plane, np.zeros(width, np.uint32), edges, out)


@njit(cache=True, **UNCOUNTED)
def _fill_means(plane: np.ndarray, total: np.ndarray, edges: np.ndarray, out: np.ndarray) -> None:
    """Fill the means of blocks between edges, (column + 1,); ``total`` (width,) is room for their sums."""
    (height, width), (rows, columns) = plane.shape, out.shape
    for i in range(rows):
        top, bottom = i * height // rows, (i + 1) * height // rows
        # down the columns first: whole registers are added at once
        total[:] = 0
        for y in range(top, bottom):
            row = plane[y]
            for x in range(width):
                total[x] += row[x]
        # blocks of luma and chroma of most clips, written out: so they fill registers, too
        if width == 4 * columns:
            for j in range(columns):
                block = total[4 * j] + total[4 * j + 1] + total[4 * j + 2] + total[4 * j + 3]
                out[i, j] = _rounded(block, 4 * (bottom - top))
        elif width == 2 * columns:
            for j in range(columns):
                out[i, j] = _rounded(total[2 * j] + total[2 * j + 1], 2 * (bottom - top))
        else:
            for j in range(columns):
                block = np.uint32(0)
                for x in range(edges[j], edges[j + 1]):
                    block += total[x]
                out[i, j] = _rounded(block, (bottom - top) * (edges[j + 1] - edges[j]))


@njit(cache=True, **INLINED)
def _rounded(total: np.uint32, count: int) -> np.uint8:
    """Return a mean, rounded; signed numbers are what registers convert."""
    return np.uint8(np.int32(np.float32(np.int32(total)) / np.float32(count) + np.float32(0.5)))


@njit(cache=True, nogil=True)
def block_squares(one: np.ndarray, other: np.ndarray, out: np.ndarray) -> None:
    """Fill ``out`` with the mean squared difference of two pictures in each block, summed over the channels.

    Args:
        one: A picture of any type, (channel, height, width).
        other: Another one; channels that only one of them has do not count.
        out: The squares, float32 (row, column); at most as many of either as the pictures have.
    """
    _, height, width = one.shape
    channels, (rows, columns) = min(len(one), len(other)), out.shape
    total, edges = np.zeros(width, np.float32), _edges(width, columns)
    for i in range(rows):
        top, bottom = i * height // rows, (i + 1) * height // rows
        total[:] = 0.0
        for c in range(channels):
            for y in range(top, bottom):
                first, second = one[c, y], other[c, y]
                for x in range(width):
                    change = np.float32(first[x]) - np.float32(second[x])
                    total[x] += change * change
        for j in range(columns):
            left, right = edges[j], edges[j + 1]
            out[i, j] = total[left:right].sum() / np.float32((bottom - top) * (right - left))


@njit(cache=True, nogil=True)
def _edges(size: int, blocks: int) -> np.ndarray:
    """Return where the blocks of a side begin, and where the last one ends, int (blocks + 1,)."""
    edges = np.empty(blocks + 1, np.int64)
    for k in range(blocks + 1):
        edges[k] = k * size // blocks
    return edges
