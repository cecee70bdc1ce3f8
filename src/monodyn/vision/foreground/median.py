"""numba kernel: median over the frames of a stack of pictures, by counting grey levels."""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.uncounted import UNCOUNTED

NEAR = 4.0
"""Samples within this many standard deviations of the median count as noise; others show something else."""
QUARTILE = 0.6745
"""Distance of a quartile of a normal distribution from its median over its standard deviation."""
LOW, MIDDLE, HIGH = 0.25, 0.5, 0.75
"""The quartiles."""
NEAREST, FARTHEST = 2.0, 12.0
"""Grey levels within which a sample always counts as noise (a codec repeats pictures and then corrects them),
and beyond which it never does."""


@njit(cache=True, nogil=True)
def masked_median(
    stack: np.ndarray, hidden: np.ndarray, with_noise: bool = True
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return median, noise and number of samples of every pixel.

    Within the middle grey level the median is interpolated by its share of the counts, which takes the
    steps of 8-bit values out of slow shading. The noise is the root mean square of the samples within
    ``NEAR`` deviations of the median, as the nearer quartile states them: what passes before a pixel lies on
    one side of it, and does not count, however little it differs.

    Args:
        stack: Grey levels, uint8 (frame, height, width).
        hidden: True where a sample does not count, bool (frame, height, width), or of length 0 when all
            count.
        with_noise: False where the noise is not wanted, which takes most of the time; it is 0 then.

    Returns:
        Median and noise [grey levels], float32 (height, width); count, uint16 (height, width). A pixel
        hidden in every sample has count 0 and the median of them all.
    """
    frames, height, width = stack.shape
    median = np.zeros((height, width), dtype=np.float32)
    noise = np.zeros((height, width), dtype=np.float32)
    count = np.full((height, width), frames, dtype=np.uint16)
    use_hidden = hidden.shape[0] > 0
    quartiles = np.zeros((3, width))
    for y in range(height):
        shown = np.ones((frames, width), dtype=np.uint16)
        if use_hidden:
            _mark_shown(hidden[:, y], shown, count[y])
        _fill_levels(stack[:, y], shown, MIDDLE, use_hidden, quartiles[1])
        median[y] = quartiles[1]
        if with_noise:
            _fill_levels(stack[:, y], shown, LOW, use_hidden, quartiles[0])
            _fill_levels(stack[:, y], shown, HIGH, use_hidden, quartiles[2])
            _fill_noise(stack[:, y], shown, quartiles, noise[y])
    return median, noise, count


@njit(cache=True, **UNCOUNTED)
def _mark_shown(hidden: np.ndarray, shown: np.ndarray, count: np.ndarray) -> None:
    """Mark the samples of a row that count, (frame, width); where none does, all of them do."""
    frames, width = hidden.shape
    count[:] = 0
    for k in range(frames):
        for x in range(width):
            shown[k, x] = not hidden[k, x]
            count[x] += shown[k, x]
    for x in range(width):
        if count[x] == 0:
            shown[:, x] = 1


@njit(cache=True, error_model="numpy")
def _fill_levels(
    row: np.ndarray, shown: np.ndarray, share: float, use_hidden: bool, levels: np.ndarray
) -> None:
    """Fill ``levels`` (width,) with the level below which a share of the samples of a row lie, interpolated
    within it by its share of the counts.

    All pixels of the row are searched at once, bit by bit from the highest one: 8 passes over the samples,
    each of them the same simple operation for every pixel, which fill vector registers.
    """
    frames, width = row.shape
    total, found = np.zeros(width, np.uint16), np.zeros(width, np.uint8)
    below, at = np.zeros(width, np.uint16), np.zeros(width, np.uint16)
    for k in range(frames):
        for x in range(width):
            total[x] += shown[k, x]
    for bit in range(7, -1, -1):
        step = np.uint8(1 << bit)
        _count_below(row, shown, found, step, use_hidden, below)
        # fewer than wanted lie below the level with this bit: it is that level or a higher one
        for x in range(width):
            if below[x] < share * total[x]:
                found[x] += step
    _count_below(row, shown, found, np.uint8(0), use_hidden, below)
    at[:] = 0
    for k in range(frames):
        for x in range(width):
            at[x] += shown[k, x] * np.uint16(row[k, x] == found[x])
    for x in range(width):
        levels[x] = found[x] - 0.5 + (share * total[x] - below[x]) / at[x]


@njit(cache=True, **UNCOUNTED)
def _count_below(
    row: np.ndarray, shown: np.ndarray, found: np.ndarray, step: np.uint8, use_hidden: bool, below: np.ndarray
) -> None:
    """Count the samples of a row, (frame, width), below ``found`` + ``step``, (width,)."""
    frames, width = row.shape
    below[:] = 0
    for k in range(frames):
        if use_hidden:
            for x in range(width):
                below[x] += shown[k, x] * np.uint16(row[k, x] < np.uint8(found[x] + step))
        else:
            for x in range(width):
                below[x] += np.uint16(row[k, x] < np.uint8(found[x] + step))


@njit(cache=True, error_model="numpy")
def _fill_noise(row: np.ndarray, shown: np.ndarray, quartiles: np.ndarray, noise: np.ndarray) -> None:
    """Fill the noise (width,) of a row from its samples (frame, width) and quartiles (3, width)."""
    frames, width = row.shape
    squares, count = np.zeros(width, np.float32), np.zeros(width, np.float32)
    near, median = np.zeros(width, np.float32), np.zeros(width, np.float32)
    for x in range(width):
        low, centre, high = quartiles[0, x], quartiles[1, x], quartiles[2, x]
        near[x] = min(max(NEAR / QUARTILE * min(high - centre, centre - low), NEAREST), FARTHEST)
        median[x] = centre
    for k in range(frames):
        for x in range(width):
            away = np.float32(row[k, x]) - median[x]
            weight = np.float32(shown[k, x]) if abs(away) <= near[x] else np.float32(0.0)
            squares[x] += weight * away * away
            count[x] += weight
    for x in range(width):
        noise[x] = np.sqrt(squares[x] / max(count[x], np.float32(1.0)))
