"""numba kernels: soft coverage of every pixel from a frame, its background and the mechanism's colours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba import njit

from monodyn.types import FULL, Frame
from monodyn.uncounted import INLINED, UNCOUNTED
from monodyn.vision.foreground.background import Background, Window
from monodyn.vision.foreground.chroma import enlarged
from monodyn.vision.foreground.masks import EVERY_PLANE, LEFT, PLANE, RIGHT, ROW, Wanted
from monodyn.vision.foreground.palette import BLACK, CHROMA_WEIGHT, Palette
from monodyn.vision.foreground.shadow import unshadowed

ANY_CONTRAST = 2.0
"""Difference from the background, beyond the noise, that counts in full where the colours vary [least
contrasts]."""
ANY_BEYOND = 0.4
"""Share of the least contrast that does not count there."""
CHANGED_LEVEL = (1.0 - ANY_BEYOND) / (2.0 * ANY_CONTRAST)
"""Level there of a pixel that has just changed, as a share of ``FULL``, where the plane serves borders."""
ANY_NOISE = 4.0
"""Standard deviations of a pixel that do not count there: this plane has no colour by which noise would
average out."""

CLOSING = 0.004
"""Gaps up to twice this share of the picture's longer side are closed where the colours vary."""


CHROMA_PX = 2
"""How far around a pixel the colour planes count that are enlarged to the picture's size [px]."""
SHADOW_PX = 8
"""How far around a pixel a shadow is judged [px]."""
NOTHING = np.zeros((0, 0, 0), dtype=np.float32)
"""Stands for planes of colours that do not count."""
GREY, BLUE, RED = range(3)
"""Columns of a colour."""


def coverage_of(
    frame: Frame, background: Background, palette: Palette, wanted: Wanted | None = None
) -> np.ndarray:
    """Project each pixel's difference from the background on the mechanism's colours.

    Args:
        frame: The picture.
        background: What it shows without the mechanism.
        palette: Colours and scale from ``palette_of``.
        wanted: Part of the mask that is wanted; None for all of it.

    Returns:
        Coverage by each colour, and by any difference where they vary, uint8 (plane, height, width),
        ``FULL`` where the mechanism covers the whole pixel; 0 outside of the background's window, and
        anything outside of the part that is wanted.
    """
    shape, inside = (len(palette.trust), *frame.luma.shape), background.window
    if wanted is None:
        planes = np.zeros(shape, dtype=np.uint8)
    else:
        # a picture is large and the mechanism small: to write zeros over all of it costs more than the rest
        planes, window = np.empty(shape, dtype=np.uint8), wanted.window
        if _common(inside, window) != window:
            planes[:, window.top : window.bottom, window.left : window.right] = 0
        by = _around(palette, shape[1:])
        wider = Window(window.top - by, window.bottom + by, window.left - by, window.right + by)
        inside = _common(inside, wider)
    if inside.top < inside.bottom and inside.left < inside.right:
        # gaps are closed, and shadows taken out, in a rectangle
        apart = wanted is not None and palette.shadow is None and not palette.varied
        rows = wanted.rows if wanted is not None and apart else _rows_of(inside)
        _cover(frame, background, palette, inside, rows, planes)
    return planes


def _rows_of(window: Window) -> np.ndarray:
    """Return the stretches of a window, in all planes, as in ``Wanted``."""
    rows = np.full((window.bottom - window.top, RIGHT + 1), EVERY_PLANE, dtype=np.int64)
    rows[:, ROW] = np.arange(window.top, window.bottom)
    rows[:, LEFT], rows[:, RIGHT] = window.left, window.right
    return rows


def _cover(
    frame: Frame,
    background: Background,
    palette: Palette,
    window: Window,
    rows: np.ndarray,
    planes: np.ndarray,
) -> None:
    """Fill stretches of the planes, (row, column), as far as they lie in a window."""
    colours = palette.colours.astype(np.float32)
    chroma = dimmed = taken = NOTHING
    other = np.full(len(colours), -1) if palette.other is None else palette.other
    if not (palette.grey_only or frame.chroma is None or background.chroma is None):
        dimmed = palette.dimmed[0] if palette.dimmed is not None else NOTHING
        taken = NOTHING if palette.taken is None else palette.taken
        chroma = _chroma_part(frame.chroma, background, palette, window)
    ways = (palette.scale, taken, other)
    _project(frame.luma, chroma, background.luma, colours, dimmed, ways, window, rows, planes)
    high, wide = slice(window.top, window.bottom), slice(window.left, window.right)
    if palette.any_difference:
        _any_difference(frame, background, palette, window, rows, planes[-1])
        if palette.varied:
            inside = planes[:, high, wide]
            planes[-1, high, wide] = _closed(inside.max(axis=0), _closing(frame.luma.shape))
    if palette.shadow is not None:
        part = replace(background, window=window)
        unshadowed(frame, part, palette.shadow, palette.colours, planes)
    if background.others is not None:
        planes[:, high, wide][:, background.others[high, wide]] = 0


def _common(one: Window, other: Window) -> Window:
    """Return what two windows have in common; without rows or columns where that is nothing."""
    return Window(
        max(one.top, other.top),
        min(one.bottom, other.bottom),
        max(one.left, other.left),
        min(one.right, other.right),
    )


def _around(palette: Palette, shape: tuple[int, ...]) -> int:
    """Return how far around a pixel its coverage depends on the picture [px]."""
    around = CHROMA_PX
    if palette.any_difference and palette.varied:
        around += 2 * _closing(shape)
    return around if palette.shadow is None else around + SHADOW_PX


def _closing(shape: tuple[int, ...]) -> int:
    """Return by how much the gaps of a picture of a height and width are closed from either side [px]."""
    return round(CLOSING * max(shape))


def _closed(coverage: np.ndarray, by: int) -> np.ndarray:
    """Fill the gaps between the bright and the dark edge of a shiny rod, which look like the background, from
    either side by so much [px]."""
    import cv2

    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * by + 1, 2 * by + 1))
    # from its middle row down: how far each reaches to either side
    reaches = disc[by:].sum(axis=1, dtype=np.int64) // 2
    return 255 - _spread(255 - _spread(coverage, reaches), reaches)


@njit(cache=True, nogil=True)
def _spread(plane: np.ndarray, reaches: np.ndarray) -> np.ndarray:
    """Return the most that a plane, uint8 (height, width), has within a disc around each pixel.

    The disc is symmetric, and its rows reach the less far, ``reaches`` (row,), the farther they are from the
    middle one. So each row of the plane is widened step by step; of a disc of 17 px that takes a third of the
    time that OpenCV needs for all of its pixels.
    """
    (height, width), out, row = plane.shape, np.zeros_like(plane), np.empty(plane.shape[1], np.uint8)
    for y in range(height):
        row[:] = plane[y]
        reach = 0
        for away in range(len(reaches) - 1, -1, -1):
            while reach < min(reaches[away], width - 1):
                reach += 1
                _raise(row[: width - reach], plane[y, reach:])
                _raise(row[reach:], plane[y, : width - reach])
            for at in (y - away, y + away):
                if 0 <= at < height:
                    _raise(out[at], row)
    return out


@njit(cache=True, **INLINED)
def _raise(out: np.ndarray, row: np.ndarray) -> None:
    """Raise the values of a row, uint8 (width,), to those of another one."""
    for x in range(len(out)):
        out[x] = max(out[x], row[x])


def _any_difference(
    frame: Frame, background: Background, palette: Palette, window: Window, rows: np.ndarray, out: np.ndarray
) -> None:
    """Fill stretches of ``out``, uint8 (height, width), as far as they lie in a window, with coverage from
    the size of the difference alone, beyond the noise."""
    chroma = np.zeros((0, 0), dtype=np.float32)
    if not palette.grey_only and frame.chroma is not None and background.chroma is not None:
        way = enlarged(window, frame.luma.shape, frame.chroma[0].shape)
        pairs = zip(frame.chroma, background.chroma, strict=True)
        blue, red = (plane[way.part] - back[way.part] for plane, back in pairs)
        chroma = np.ascontiguousarray(way.cut(blue**2 + red**2))
    # borders that stand out more than the least contrast keep their profile up to twice the range
    full, most = (ANY_CONTRAST, FULL) if palette.varied else (2 * ANY_CONTRAST, 255)
    levels = np.array([ANY_BEYOND * palette.contrast, FULL / (full * palette.contrast), most], np.float32)
    _differing(frame.luma, chroma, background.luma, background.pixel_noise, window, rows, levels, out)


def _chroma_part(
    chroma: tuple[np.ndarray, np.ndarray], background: Background, palette: Palette, window: Window
) -> np.ndarray:
    """Return the projection of the colour differences, for each colour at full size within a window."""
    assert background.chroma is not None
    behind, colours, shape = background.chroma, palette.colours.astype(np.float32), background.luma.shape
    # the projection is linear, so it may be taken at the chroma's own size and enlarged afterwards
    way = enlarged(window, shape, chroma[0].shape)
    dimmed = NOTHING if palette.dimmed is None else palette.dimmed[1][:, *way.part].copy()
    blue, red = (plane[way.part].copy() for plane in chroma)
    blue_behind, red_behind = (plane[way.part].copy() for plane in behind)
    small = np.empty((len(colours), blue.shape[0], blue.shape[1]), dtype=np.float32)
    _project_chroma(blue, red, blue_behind, red_behind, colours, dimmed, small)
    return np.stack([way.cut(plane) for plane in small])


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True, **UNCOUNTED)
def _project_chroma(
    blue: np.ndarray,
    red: np.ndarray,
    blue_background: np.ndarray,
    red_background: np.ndarray,
    colours: np.ndarray,
    dimmed: np.ndarray,
    out: np.ndarray,
) -> None:
    """Fill ``out`` (colour, height, width) with the weighted product of (I - B) and (F - B), less what light
    does, over both channels; ``dimmed`` has length 0 where light is even."""
    weight, share = np.float32(CHROMA_WEIGHT), np.float32(0.0)
    even = dimmed.shape[0] == 0
    for k in range(colours.shape[0]):
        blue_light = colours[k, BLUE] - np.float32(BLACK[BLUE])
        red_light = colours[k, RED] - np.float32(BLACK[RED])
        for y in range(out.shape[1]):
            for x in range(out.shape[2]):
                b0, r0 = blue_background[y, x], red_background[y, x]
                if not even:
                    share = dimmed[k, y, x]
                b = (np.float32(blue[y, x]) - b0) * (colours[k, BLUE] - b0 - share * blue_light)
                r = (np.float32(red[y, x]) - r0) * (colours[k, RED] - r0 - share * red_light)
                out[k, y, x] = weight * (b + r)


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True, **UNCOUNTED)
def _project(
    luma: np.ndarray,
    chroma: np.ndarray,
    background: np.ndarray,
    colours: np.ndarray,
    dimmed: np.ndarray,
    ways: tuple[np.ndarray, np.ndarray, np.ndarray],
    window: Window,
    rows: np.ndarray,
    out: np.ndarray,
) -> None:
    """Fill stretches of ``out`` (colour, height, width), as far as they lie in a window, with the coverage by
    each colour.

    ``chroma``, the part of the colours in the window, has length 0 when grey alone counts, and ``dimmed``,
    how much of each colour is taken out, where light is even. ``ways`` are scale, taken and other of a
    `Palette`; taken has length 0 where no colour is taken out of another.
    """
    scale, taken, other = ways
    # Rows are cut out, and the cases are separate loops without a branch: so they use vector registers.
    for i in range(rows.shape[0]):
        y, left, right = _stretch(rows[i], window)
        if left >= right:
            continue
        shown, behind = luma[y][left:right], background[y][left:right]
        for k in range(colours.shape[0]):
            if rows[i, PLANE] != k and rows[i, PLANE] != EVERY_PLANE:
                continue
            target = colours[k, GREY]
            light = target - np.float32(BLACK[GREY])
            gain, covered = scale[k, y][left:right], out[k, y][left:right]
            if chroma.shape[0] == 0:
                for x in range(right - left):
                    b = behind[x]
                    covered[x] = _level((np.float32(shown[x]) - b) * (target - b) * gain[x])
                continue
            tint = chroma[k, y - window.top][left - window.left : right - window.left]
            if taken.shape[0] > 0 and other[k] >= 0:
                j = other[k]
                second, less = colours[j, GREY], taken[k, y][left:right]
                second_light = second - np.float32(BLACK[GREY])
                second_tint = chroma[j, y - window.top][left - window.left : right - window.left]
                if dimmed.shape[0] == 0:
                    for x in range(right - left):
                        b = behind[x]
                        off = np.float32(shown[x]) - b
                        own, its = off * (target - b) + tint[x], off * (second - b) + second_tint[x]
                        covered[x] = _level(own * gain[x] - its * less[x])
                    continue
                share, second_share = dimmed[k, y][left:right], dimmed[j, y][left:right]
                for x in range(right - left):
                    b = behind[x]
                    off = np.float32(shown[x]) - b
                    own = off * (target - b - share[x] * light) + tint[x]
                    its = off * (second - b - second_share[x] * second_light) + second_tint[x]
                    covered[x] = _level(own * gain[x] - its * less[x])
                continue
            if dimmed.shape[0] == 0:
                for x in range(right - left):
                    b = behind[x]
                    covered[x] = _level(((np.float32(shown[x]) - b) * (target - b) + tint[x]) * gain[x])
                continue
            share = dimmed[k, y][left:right]
            for x in range(right - left):
                b = behind[x]
                step = target - b - share[x] * light
                covered[x] = _level(((np.float32(shown[x]) - b) * step + tint[x]) * gain[x])


@njit(cache=True, **INLINED)
def _stretch(row: np.ndarray, window: Window) -> tuple[int, int, int]:
    """Return the row of a stretch (column,), its first column and the one past its last within a window."""
    y = row[ROW]
    if y < window.top or y >= window.bottom:
        return 0, 0, 0
    return y, max(row[LEFT], window.left), min(row[RIGHT], window.right)


@njit(cache=True, fastmath=True, **INLINED)
def _level(value: np.float32) -> np.uint8:
    """Return a coverage as a level of 8 bits, rounded."""
    none, most, level = np.float32(0.0), np.float32(255.0), value + np.float32(0.5)
    level = level if level > none else none
    level = level if level < most else most
    # straight to 8 bits there is no instruction for a whole register
    return np.uint8(np.int32(level))


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True, **UNCOUNTED)
def _differing(
    luma: np.ndarray,
    chroma: np.ndarray,
    background: np.ndarray,
    noise: np.ndarray,
    window: Window,
    rows: np.ndarray,
    levels: np.ndarray,
    out: np.ndarray,
) -> None:
    """Fill stretches of ``out``, as far as they lie in a window, with the size of the difference beyond the
    least that counts, times a scale.

    ``chroma``, the squared difference of the colours in the window, has length 0 when grey alone counts;
    ``levels`` holds the least difference, the scale and the most.
    """
    beyond, scale, most = levels[0], levels[1], levels[2]
    none, weight, counts = np.float32(0.0), np.float32(CHROMA_WEIGHT), np.float32(ANY_NOISE)
    for i in range(rows.shape[0]):
        y, left, right = _stretch(rows[i], window)
        if left >= right:
            continue
        shown, behind, covered = luma[y][left:right], background[y][left:right], out[y][left:right]
        usual = noise[y][left:right]
        for x in range(right - left):
            difference = np.float32(shown[x]) - behind[x]
            square = difference * difference
            if chroma.shape[0] > 0:
                square += weight * chroma[y - window.top, left - window.left + x]
            least = counts * usual[x]
            least = least if least > beyond else beyond
            share = (np.sqrt(square) - least) * scale
            share = share if share > none else none
            share = share if share < most else most
            covered[x] = np.uint8(np.int32(share))
