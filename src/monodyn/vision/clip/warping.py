"""numba kernels: planes of pictures put in the place of the scene that they show.

A camera held by hand turns and zooms little between two pictures. Along a row the place of a pixel in the
picture then stays the same but for a fraction of a pixel, over many pixels at once: such a run lies side by
side in memory, and a processor interpolates many of its pixels in one step.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from monodyn.uncounted import UNCOUNTED

SPAN = 32
"""Pixels of a row over which perspective is met by a straight line: before a camera with a focal length of
1000 px that turned by 5 deg to the side this is right within 0.02 px."""

LEAST = 1e-9
"""Change of a place from pixel to pixel below which there is none [px]."""


@njit(cache=True, fastmath=True, error_model="numpy")
def put_in_place(
    plane: np.ndarray, matrix: np.ndarray, out: np.ndarray, window: tuple[int, int, int, int]
) -> None:
    """Write a plane to where a scene has what it shows, by linear interpolation.

    Args:
        plane: The plane, uint8 (height, width), contiguous.
        matrix: Map from a pixel (x, y, 1) of the scene to one of the plane, (3, 3).
        out: Where to write, uint8 (height, width), contiguous; what the plane does not show stays.
        window: First and end row, first and end column that are written [px].
    """
    height, width = plane.shape
    top, bottom, left, right = window
    source, target, m = plane.reshape(-1), out.reshape(-1), matrix
    span = SPAN if m[2, 0] != 0.0 or m[2, 1] != 0.0 else max(right - left, 1)
    for row in range(top, bottom):
        to_x, to_y = _place(m, left, row)
        for start in range(left, right, span):
            stop = min(start + span, right)
            x, y = to_x, to_y
            to_x, to_y = _place(m, stop, row)
            grows_x, grows_y = (to_x - x) / (stop - start) - 1.0, (to_y - y) / (stop - start)
            # from a pixel of the scene to its place in the plane
            x -= start
            at = start
            while at < stop:
                off_x, off_y = x + grows_x * (at - start), y + grows_y * (at - start)
                whole_x, whole_y = math.floor(off_x), math.floor(off_y)
                # as long as both fractions of a pixel stay between 0 and 1
                run = min(
                    (whole_x + 1.0 - off_x if grows_x >= 0.0 else off_x - whole_x) / max(abs(grows_x), LEAST),
                    (whole_y + 1.0 - off_y if grows_y >= 0.0 else off_y - whole_y) / max(abs(grows_y), LEAST),
                    float(stop - at),
                )
                end = at + max(1, math.ceil(run))
                first, last = max(at, -whole_x), min(end, width - 1 - whole_x)
                if 0 <= whole_y < height - 1 and first < last:
                    begun = first - at
                    _blend(
                        source,
                        whole_y * width + first + whole_x,
                        width,
                        target,
                        row * out.shape[1] + first,
                        last - first,
                        (off_x - whole_x + begun * grows_x, grows_x),
                        (off_y - whole_y + begun * grows_y, grows_y),
                    )
                at = end


@njit(cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _place(matrix: np.ndarray, x: float, y: float) -> tuple[float, float]:
    """Return where a pixel of the scene lies in the plane [px]."""
    m = matrix
    z = m[2, 0] * x + m[2, 1] * y + m[2, 2]
    return (m[0, 0] * x + m[0, 1] * y + m[0, 2]) / z, (m[1, 0] * x + m[1, 1] * y + m[1, 2]) / z


@njit(cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _blend(
    source: np.ndarray,
    begin: int,
    width: int,
    target: np.ndarray,
    to: int,
    count: int,
    x: tuple[float, float],
    y: tuple[float, float],
) -> None:
    """Interpolate a run of pixels, which begins at ``begin``; ``x`` and ``y`` have the fraction of a pixel at
    its beginning and by how much that grows."""
    # unsigned indices do not count from the end, and single precision goes many at a time
    upper_left, upper_right = np.uintp(begin), np.uintp(begin + 1)
    lower_left, lower_right = np.uintp(begin + width), np.uintp(begin + width + 1)
    written = np.uintp(to)
    x_0, x_1, y_0, y_1 = np.float32(x[0]), np.float32(x[1]), np.float32(y[0]), np.float32(y[1])
    for i in range(count):
        j, k = np.uintp(i), np.float32(np.int32(i))
        across, downward = x_0 + x_1 * k, y_0 + y_1 * k
        upper, lower = np.float32(source[upper_left + j]), np.float32(source[lower_left + j])
        upper += (np.float32(source[upper_right + j]) - upper) * across
        lower += (np.float32(source[lower_right + j]) - lower) * across
        target[written + j] = np.uint8(np.int32(upper + (lower - upper) * downward + np.float32(0.5)))
