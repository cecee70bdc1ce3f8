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
BLOCK = 512
"""Pixels searched at once: what all frames show of them fills whole registers and fits a cache."""
GROUP = 252
"""Samples of a pixel that are counted at once: the most that are fours, and that 8 bits hold."""
BRIGHTEST = np.uint8(255)
"""Grey level that lies below none."""


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
        stack: Grey levels, uint8 (frame, height, width), in C order.
        hidden: True where a sample does not count, bool (frame, height, width), in C order, or of length 0
            when all count.
        with_noise: False where the noise is not wanted, which takes most of the time; it is 0 then.

    Returns:
        Median and noise [grey levels], float32 (height, width); count, uint16 (height, width). A pixel
        hidden in every sample has count 0 and the median of them all.
    """
    frames, height, width = stack.shape
    pixels = height * width
    median, noise = np.zeros(pixels, dtype=np.float32), np.zeros(pixels, dtype=np.float32)
    count = np.full(pixels, frames, dtype=np.uint16)
    use_hidden = hidden.shape[0] > 0
    every, masks = stack.reshape(frames, pixels), hidden.reshape(hidden.shape[0], pixels * use_hidden)
    block, shown = np.zeros((frames, BLOCK), np.uint8), np.ones((frames, BLOCK), np.uint8)
    quartiles, lowest = np.zeros((3, BLOCK)), np.zeros(BLOCK, np.uint8)
    for first in range(0, pixels, BLOCK):
        stop = min(first + BLOCK, pixels)
        _take(every[:, first:stop], block)
        bits = _narrowed(block, lowest)
        if use_hidden:
            _mark_shown(masks[:, first:stop], shown, count[first:stop])
            _brighten(shown, block)
        _fill_levels(block, shown, MIDDLE, bits, lowest, quartiles[1])
        median[first:stop] = quartiles[1, : stop - first]
        if with_noise:
            _fill_levels(block, shown, LOW, bits, lowest, quartiles[0])
            _fill_levels(block, shown, HIGH, bits, lowest, quartiles[2])
            _fill_noise(block, shown, quartiles, noise[first:stop])
    shape = (height, width)
    return median.reshape(shape), noise.reshape(shape), count.reshape(shape)


@njit(cache=True, **UNCOUNTED)
def _take(samples: np.ndarray, block: np.ndarray) -> None:
    """Copy samples, (frame, pixel), to the beginning of a block of as many frames."""
    for k in range(len(samples)):
        source, target = samples[k], block[k]
        for x in range(len(source)):
            target[x] = source[x]


@njit(cache=True)
def _narrowed(block: np.ndarray, lowest: np.ndarray) -> int:
    """Fill ``lowest`` (``BLOCK``,) with a level below which no sample of a pixel lies, and return in how many
    bits those of every pixel of the block, (frame, ``BLOCK``), lie above it."""
    highest = np.zeros(BLOCK, np.uint8)
    for x in range(BLOCK):
        lowest[x] = highest[x] = block[0, x]
    for k in range(1, len(block)):
        for x in range(BLOCK):
            level = block[k, x]
            lowest[x] = level if level < lowest[x] else lowest[x]
            highest[x] = level if level > highest[x] else highest[x]
    widest = np.uint8(0)
    for x in range(BLOCK):
        across = np.uint8(highest[x] - lowest[x])
        widest = across if across > widest else widest
    bits = 0
    while widest >> bits:
        bits += 1
    # none that is looked for is brighter than the brightest
    last = np.uint8(256 - (1 << bits)) if bits > 0 else BRIGHTEST
    for x in range(BLOCK):
        lowest[x] = lowest[x] if lowest[x] < last else last
    return bits


@njit(cache=True, **UNCOUNTED)
def _mark_shown(hidden: np.ndarray, shown: np.ndarray, count: np.ndarray) -> None:
    """Mark which samples of the first pixels of a block, (frame, ``BLOCK``), count; and count them, (pixel,).

    Where none does, all of them do.
    """
    frames, pixels = hidden.shape
    count[:] = 0
    for k in range(frames):
        for x in range(pixels):
            shown[k, x] = not hidden[k, x]
            count[x] += shown[k, x]
    for x in range(pixels):
        if count[x] == 0:
            shown[:, x] = 1


@njit(cache=True, **UNCOUNTED)
def _brighten(shown: np.ndarray, block: np.ndarray) -> None:
    """Set the samples of a block, (frame, ``BLOCK``), that do not count to what lies below no level."""
    for k in range(len(block)):
        for x in range(BLOCK):
            block[k, x] = block[k, x] if shown[k, x] else BRIGHTEST


@njit(cache=True, error_model="numpy")
def _fill_levels(
    block: np.ndarray, shown: np.ndarray, share: float, bits: int, lowest: np.ndarray, levels: np.ndarray
) -> None:
    """Fill ``levels`` (``BLOCK``,) with the level below which a share of the samples of a block lie, (frame,
    ``BLOCK``), interpolated within it by its share of the counts.

    All pixels of the block are searched at once above their lowest levels, (``BLOCK``,), within so many bits,
    from the highest one: a pass over the samples for each bit, the same simple operation for every pixel,
    which fills registers.
    """
    total, wanted, below = np.zeros(BLOCK, np.uint16), np.zeros(BLOCK, np.uint16), np.zeros(BLOCK, np.uint16)
    less, most, partial = np.zeros(BLOCK, np.uint16), np.zeros(BLOCK, np.uint16), np.zeros(BLOCK, np.uint8)
    found, limit = np.zeros(BLOCK, np.uint8), np.zeros(BLOCK, np.uint8)
    for k in range(len(block)):
        for x in range(BLOCK):
            total[x] += shown[k, x]
    for x in range(BLOCK):
        wanted[x] = np.ceil(share * total[x])
        most[x], found[x] = total[x], lowest[x]
    for bit in range(bits - 1, -1, -1):
        step = np.uint8(1 << bit)
        for x in range(BLOCK):
            limit[x] = found[x] + step
        _count_below(block, limit, partial, below)
        # fewer than wanted lie below the level with this bit: it is that level or a higher one
        for x in range(BLOCK):
            higher = below[x] < wanted[x]
            found[x] = limit[x] if higher else found[x]
            less[x] = below[x] if higher else less[x]
            most[x] = most[x] if higher else below[x]
    # below the level lie so many, and below the next one so many: the last one that was too high
    for x in range(BLOCK):
        levels[x] = found[x] - 0.5 + (share * total[x] - less[x]) / (most[x] - less[x])


@njit(cache=True, **UNCOUNTED)
def _count_below(block: np.ndarray, limit: np.ndarray, partial: np.ndarray, below: np.ndarray) -> None:
    """Count the samples of a block, (frame, ``BLOCK``), below a level of each pixel, (``BLOCK``,).

    ``partial``, as large, is room for the counts of a group.
    """
    below[:] = 0
    for first in range(0, len(block), GROUP):
        group = block[first : first + GROUP]
        fours = len(group) // 4 * 4
        partial[:] = 0
        # of four frames at a time: what is counted is read and written less often
        for k in range(0, fours, 4):
            one, two, three, four = group[k], group[k + 1], group[k + 2], group[k + 3]
            for x in range(BLOCK):
                level = limit[x]
                partial[x] += np.uint8(
                    np.uint8(np.uint8(one[x] < level) + np.uint8(two[x] < level))
                    + np.uint8(np.uint8(three[x] < level) + np.uint8(four[x] < level))
                )
        for k in range(fours, len(group)):
            for x in range(BLOCK):
                partial[x] += np.uint8(group[k, x] < limit[x])
        for x in range(BLOCK):
            below[x] += partial[x]


@njit(cache=True, error_model="numpy")
def _fill_noise(block: np.ndarray, shown: np.ndarray, quartiles: np.ndarray, noise: np.ndarray) -> None:
    """Fill the noise (pixel,) of the first pixels of a block from its samples, (frame, ``BLOCK``), and
    quartiles, (3, ``BLOCK``)."""
    squares, count = np.zeros(BLOCK, np.float32), np.zeros(BLOCK, np.float32)
    near, median = np.zeros(BLOCK, np.float32), np.zeros(BLOCK, np.float32)
    for x in range(BLOCK):
        low, centre, high = quartiles[0, x], quartiles[1, x], quartiles[2, x]
        near[x] = min(max(NEAR / QUARTILE * min(high - centre, centre - low), NEAREST), FARTHEST)
        median[x] = centre
    for k in range(len(block)):
        for x in range(BLOCK):
            away = np.float32(block[k, x]) - median[x]
            weight = np.float32(shown[k, x]) if abs(away) <= near[x] else np.float32(0.0)
            squares[x] += weight * away * away
            count[x] += weight
    for x in range(len(noise)):
        noise[x] = np.sqrt(squares[x] / max(count[x], np.float32(1.0)))
