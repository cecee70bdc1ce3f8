"""numba kernel: median over the frames of a stack of pictures, by counting grey levels."""

from __future__ import annotations

import numpy as np
from numba import njit

NEAR = 4.0
"""Samples within this many standard deviations of the median count as noise; others show something else."""
QUARTILE = 0.6745
"""Distance of a quartile of a normal distribution from its median over its standard deviation."""
NEAREST, FARTHEST = 2.0, 12.0
"""Grey levels within which a sample always counts as noise (a codec repeats pictures and then corrects them),
and beyond which it never does."""


@njit(cache=True)
def masked_median(stack: np.ndarray, hidden: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return median, noise and number of samples of every pixel.

    Within the middle grey level the median is interpolated by its share of the counts, which takes the
    steps of 8-bit values out of slow shading. The noise is the root mean square of the samples within
    ``NEAR`` deviations of the median, as the nearer quartile states them: what passes before a pixel lies on
    one side of it, and does not count, however little it differs.

    Args:
        stack: Grey levels, uint8 (frame, height, width).
        hidden: True where a sample does not count, bool (frame, height, width), or of length 0 when all
            count.

    Returns:
        Median and noise [grey levels], float32 (height, width); count, int32 (height, width). A pixel
        hidden in every sample has count 0 and the median of them all.
    """
    frames, height, width = stack.shape
    median = np.zeros((height, width), dtype=np.float32)
    noise = np.zeros((height, width), dtype=np.float32)
    count = np.zeros((height, width), dtype=np.int32)
    row = np.empty((width, frames), dtype=np.uint8)
    shown = np.ones((width, frames), dtype=np.bool_)
    levels = np.zeros(256, dtype=np.int32)
    # The stack is read along its rows, which lie together in memory, into a table with the samples of each
    # pixel together.
    use_hidden = hidden.shape[0] > 0
    for y in range(height):
        for k in range(frames):
            for x in range(width):
                row[x, k] = stack[k, y, x]
                if use_hidden:
                    shown[x, k] = not hidden[k, y, x]
        for x in range(width):
            n = 0
            for k in range(frames):
                n += shown[x, k]
            low, high = 255, 0
            for k in range(frames):
                if shown[x, k] or n == 0:
                    value = row[x, k]
                    levels[value] += 1
                    low, high = min(low, value), max(high, value)
            total = n if n > 0 else frames
            centre = _level_below(levels, low, 0.5 * total)
            above = _level_below(levels, low, 0.75 * total) - centre
            below = centre - _level_below(levels, low, 0.25 * total)
            near = min(max(NEAR / QUARTILE * min(above, below), NEAREST), FARTHEST)
            median[y, x] = centre
            noise[y, x] = _noise_about(centre, near, levels, low, high)
            count[y, x] = n
    return median, noise, count


@njit(cache=True, inline="always")
def _level_below(levels: np.ndarray, low: int, wanted: float) -> float:
    """Return the level below which the wanted number of samples lie, interpolated."""
    below, level = 0, low
    while below + levels[level] < wanted:
        below += levels[level]
        level += 1
    return level - 0.5 + (wanted - below) / levels[level]


@njit(cache=True, inline="always")
def _noise_about(centre: float, near: float, levels: np.ndarray, low: int, high: int) -> float:
    """Return the root mean square of the counted samples near the centre, and clear the counts (256,)."""
    squares, count = 0.0, 0
    # only the levels between the least and the largest are in use
    for value in range(low, high + 1):
        if abs(value - centre) <= near:
            squares += levels[value] * (value - centre) ** 2
            count += levels[value]
        levels[value] = 0
    return np.sqrt(squares / max(count, 1))
