"""Some of the frames of a clip, and of their pixels: as many as its statistics need, whatever its size."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

WIDE_PX = 360
"""Longer side of a thinned picture, about [px]."""

Chroma = tuple[np.ndarray, np.ndarray]


def thinning(shape: tuple[int, ...]) -> int:
    """Return every how many rows and columns one is kept.

    Args:
        shape: Height and width of the picture [px].
    """
    return max(2, round(max(shape) / WIDE_PX))


def spacing(count: int, enough: int) -> int:
    """Return every how many of some frames one is taken.

    Args:
        count: How many there are.
        enough: About how many of them are wanted: between three quarters of that and half as many again are
            taken, or all where there are not so many.
    """
    return max(1, round(count / enough))


def thinned(luma: np.ndarray, chroma: Chroma | None, step: int) -> list[np.ndarray]:
    """Return some of the rows and columns of a picture.

    Args:
        luma: Grey levels, (height, width).
        chroma: Blue and red difference, each (row, column) of any size, or None.
        step: Every how many rows and columns one is kept.

    Returns:
        One or three planes, float32 (row, column) each; of the colours the samples at these pixels.
    """
    import cv2

    grey = luma[::step, ::step].astype(np.float32)
    size = grey.shape[::-1]
    small = [cv2.resize(plane, size, interpolation=cv2.INTER_NEAREST) for plane in chroma or ()]
    return [grey, *(plane.astype(np.float32) for plane in small)]


def at_pixels(
    planes: Sequence[np.ndarray], shape: tuple[int, ...], rows: np.ndarray, columns: np.ndarray
) -> list[np.ndarray]:
    """Return what a picture shows at some of its pixels.

    Args:
        planes: Its planes, each (row, column) of any size.
        shape: Height and width of the picture [px].
        rows: Rows of the pixels, int (pixel,).
        columns: Their columns, int (pixel,).

    Returns:
        What the samples of each plane at these pixels are, float32 (pixel,) each.
    """
    found = []
    for plane in planes:
        y, x = rows * plane.shape[0] // shape[0], columns * plane.shape[1] // shape[1]
        found.append(plane[y, x].astype(np.float32))
    return found
