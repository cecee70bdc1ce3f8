"""Key pictures: the points of a picture of the scene with which others are aligned.

Points of strong gradient, spread evenly over the picture, at every size from coarse to fine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.arrays import median
from monodyn.vision.clip.homography import Homography

FINEST_PX = 640
"""Longer side of the finest picture that is aligned, at most [px]."""
COARSEST_PX = 48
"""Shorter side of the coarsest one, at least [px]."""
CELLS = (24, 16)
"""Columns and rows of cells over which the points are spread."""
POINTS_A_CELL = 6
"""Points of a cell, at most."""
BLOCKS = (4, 3)
"""Columns and rows of blocks, each of which is left out once to see how much hangs on it."""
CLEAR_EDGE, FAINT_EDGE = 5.0, 2.0
"""Least gradient of a point over the noise, and in a picture without as many edges [1 / px of the level]."""
CODEC = 3.0
"""Standard deviation of a difference of grey levels over the noise: what a codec leaves of it is blobs, each
of which counts as many points."""
LEAST_NOISE = 0.3
"""Least noise of a picture: what rounding makes [grey levels]."""
LEAST_BLOCKS = 5
"""Blocks that must hold a picture: what a mechanism covers are fewer."""
LEAST_POINTS = 5
"""Agreeing points with which a block holds the picture."""


class Level(NamedTuple):
    """Points of a key picture at one size.

    Attributes:
        scale: Pixels of the clip per pixel.
        points: Place from the middle of the clip's picture, grey level and its gradient to the right and down
            [per px of the clip], (column, point).
        rows: Derivative of its grey level by the unknowns, (unknown, point); by the gain it is the grey level
            over the mean of all.
        block: Block of each point, int64 (point,), rising.
        noise: Standard deviation of a difference of two grey levels [grey levels].
    """

    scale: float
    points: np.ndarray
    rows: np.ndarray
    block: np.ndarray
    noise: float


class Key(NamedTuple):
    """A key picture: what others are aligned with.

    Attributes:
        levels: Its points at each size, the coarsest first.
        at: Where the scene appears in it.
    """

    levels: tuple[Level, ...]
    at: Homography

    @property
    def holds(self) -> bool:
        """Whether it shows enough, in enough parts, to align a picture with."""
        counts = np.bincount(self.levels[-1].block, minlength=1)
        return int(np.sum(counts >= LEAST_POINTS)) >= LEAST_BLOCKS


def pyramid(luma: np.ndarray) -> list[np.ndarray]:
    """Return a picture at the sizes at which it is aligned, the coarsest first, each uint8 (height, width).

    Args:
        luma: Grey levels, uint8 (height, width).
    """
    import cv2

    picture = luma
    while max(picture.shape) > FINEST_PX:
        picture = cv2.pyrDown(picture)
    levels = [picture]
    while min(levels[-1].shape) >= 2 * COARSEST_PX:
        levels.append(cv2.pyrDown(levels[-1]))
    return levels[::-1]


def key_of(
    pictures: Sequence[np.ndarray], at: Homography, noise: Sequence[float] = (), *, faint: bool = True
) -> Key:
    """Make a key picture.

    Args:
        pictures: From ``pyramid``, each uint8 (height, width).
        at: Where the scene appears in it.
        noise: Standard deviation by which pictures of the scene differ from it at each size [grey levels];
            empty for a single picture, whose noise is looked for in it.
        faint: False where clear edges alone may count.

    Returns:
        The key picture.
    """
    # each halving rounds an odd side up
    finest = 1.0
    while max(at.size) / finest > FINEST_PX:
        finest *= 2.0
    key = Key((), at)
    # What a codec makes of noise are blobs that stay where they are while the scene moves. Where there are
    # clear edges, they alone count.
    for clear in (CLEAR_EDGE, FAINT_EDGE) if faint else (CLEAR_EDGE,):
        levels = []
        for i, picture in enumerate(pictures):
            scale, grey = finest * 2.0 ** (len(pictures) - 1 - i), picture.astype(np.float32)
            own = max(LEAST_NOISE, noise[i]) if len(noise) else _noise(grey)
            levels.append(_level(grey, scale, at.middle, (CODEC * own, clear * own)))
        key = Key(tuple(levels), at)
        if key.holds:
            break
    return key


def _level(grey: np.ndarray, scale: float, middle: np.ndarray, noise: tuple[float, float]) -> Level:
    """Choose the points of a picture: in each cell those of the strongest gradient.

    ``noise`` has that of a difference of grey levels, and the least gradient.
    """
    height, width = grey.shape[0] - 2, grey.shape[1] - 2
    rows = np.linspace(0, height, CELLS[1] + 1).astype(int)
    columns = np.linspace(0, width, CELLS[0] + 1).astype(int)
    y, x = _strongest(grey, rows, columns, noise[1] ** 2)
    right = 0.5 * (grey[y + 1, x + 2] - grey[y + 1, x])
    down = 0.5 * (grey[y + 2, x + 1] - grey[y, x + 1])
    place_x, place_y = (x + 1) * scale - middle[0], (y + 1) * scale - middle[1]
    block = (x * BLOCKS[0] // width) + BLOCKS[0] * (y * BLOCKS[1] // height)
    points = np.stack([place_x, place_y, grey[y + 1, x + 1], right / scale, down / scale])
    order = np.argsort(block, kind="stable")
    points = np.ascontiguousarray(points[:, order], dtype=float)
    return Level(scale, points, _rows(points, middle), block[order].astype(np.int64), noise[0])


@njit(cache=True, nogil=True)
def _strongest(
    grey: np.ndarray, rows: np.ndarray, columns: np.ndarray, least: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return row and column, counted from the first inner pixel, of the points of the strongest gradient in
    each of the cells between rows and columns; of equals the first ones, the strongest first."""
    most = (len(rows) - 1) * (len(columns) - 1) * POINTS_A_CELL
    y, x, size = np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most, np.float32)
    begin, end = 0, 0
    for i in range(len(rows) - 1):
        for j in range(len(columns) - 1):
            for r in range(rows[i], rows[i + 1]):
                for c in range(columns[j], columns[j + 1]):
                    right = np.float32(0.5) * (grey[r + 1, c + 2] - grey[r + 1, c])
                    down = np.float32(0.5) * (grey[r + 2, c + 1] - grey[r, c + 1])
                    square = right * right + down * down
                    full = end - begin == POINTS_A_CELL
                    if square < least or square <= 0.0 or (full and square <= size[end - 1]):
                        continue
                    end = end if full else end + 1
                    k = end - 1
                    while k > begin and size[k - 1] < square:
                        y[k], x[k], size[k] = y[k - 1], x[k - 1], size[k - 1]
                        k -= 1
                    y[k], x[k], size[k] = r, c, square
            begin = end
    return y[:end], x[:end]


def _rows(points: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Return the derivative of the points' grey levels by the unknowns, (unknown, point)."""
    x, y, grey, gx, gy = points
    reach = halfway(middle)
    outward, turned = (gx * x + gy * y) / reach, (gy * x - gx * y) / reach
    over = grey - grey.sum() / max(1, len(grey))
    return np.stack(
        [gx, gy, outward, turned, outward * x / reach, outward * y / reach, over, np.ones_like(x)]
    )


def _noise(grey: np.ndarray) -> float:
    """Return the noise of a single picture [grey levels].

    Source:
        Immerkaer, "Fast noise variance estimation", 1996, with a median in place of the mean.
    """
    import cv2

    # differences of neighbours across both axes leave the noise alone
    fine = cv2.filter2D(grey, cv2.CV_32F, np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32))
    return max(LEAST_NOISE, median(np.abs(fine[1:-1, 1:-1])) / 0.6745 / 6.0)


@njit(cache=True)
def halfway(middle: np.ndarray) -> float:
    """Return how far it is halfway to a corner [px]: all unknowns but the light are what they displace there.

    Args:
        middle: Middle of the picture [px], (2,).
    """
    return 0.5 * math.sqrt(middle[0] ** 2 + middle[1] ** 2)
