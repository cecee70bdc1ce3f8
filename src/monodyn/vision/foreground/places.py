"""numba kernel: whether a picture shows the same grey levels as a reference at a grid of places."""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.uncounted import UNCOUNTED


@njit(cache=True, nogil=True, **UNCOUNTED)
def is_unchanged(
    luma: np.ndarray, row: np.ndarray, column: np.ndarray, level: np.ndarray, least: float
) -> bool:
    """Return whether the median difference is less than ``least`` in either half of the places.

    Args:
        luma: Grey levels of the picture, uint8 (height, width).
        row: Row of each place [px], (point,).
        column: Its column [px], (point,).
        level: Its grey level in the reference, float32 (point,).
        least: The difference [grey levels].
    """
    half = len(level) // 2
    for begin, end in ((0, half), (half, len(level))):
        under, over = 0, 0
        for k in range(begin, end):
            change = luma[row[k], column[k]] - level[k]
            under += change <= -least
            over += change >= least
        # the upper median is among neither of them
        middle = (end - begin) // 2
        if under > middle or over >= end - begin - middle:
            return False
    return True
