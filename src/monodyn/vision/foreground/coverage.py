"""numba kernels: soft coverage of every pixel from a frame, its background and the mechanism's colours."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.types import FULL, Frame
from monodyn.vision.foreground.background import Background, Window
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


GREY, BLUE, RED = range(3)
"""Columns of a colour."""


class _Projection(NamedTuple):
    """What stays the same from frame to frame.

    Attributes:
        background: Grey level of each pixel, float32 (height, width).
        colours: Colours of the mechanism, float32 (colour, 3).
        dimmed: How much of each colour is taken out of its difference from the background, float32 (colour,
            height, width).
        scale: ``FULL`` over the squared contrast, float32 (colour, height, width).
        window: Part of the picture in which anything moves.
    """

    background: np.ndarray
    colours: np.ndarray
    dimmed: np.ndarray
    scale: np.ndarray
    window: Window


def coverage_of(frame: Frame, background: Background, palette: Palette) -> np.ndarray:
    """Project each pixel's difference from the background on the mechanism's colours.

    Args:
        frame: The picture.
        background: What it shows without the mechanism.
        palette: Colours and scale from ``choose_palette``.

    Returns:
        Coverage by each colour, and by any difference where they vary, uint8 (plane, height, width),
        ``FULL`` where the mechanism covers the whole pixel; 0 outside of the background's window.
    """
    colours = palette.colours.astype(np.float32)
    count = len(colours) + palette.any_difference
    planes = np.zeros((count, *frame.luma.shape), dtype=np.uint8)
    chroma = dimmed = np.zeros((0, 0, 0), dtype=np.float32)
    if not (palette.grey_only or frame.chroma is None or background.chroma is None):
        dimmed = palette.dimmed[0] if palette.dimmed is not None else _undimmed(len(colours), frame.luma)
        chroma = _chroma_part(frame.chroma, background, palette)
    projection = _Projection(background.luma, colours, dimmed, palette.scale, background.window)
    _project(frame.luma, chroma, projection, planes)
    if palette.any_difference:
        _any_difference(frame, background, palette, planes[-1])
        if palette.varied:
            top, bottom, left, right = background.window
            inside = planes[:, top:bottom, left:right]
            planes[-1, top:bottom, left:right] = _closed(inside.max(axis=0), max(frame.luma.shape))
    if palette.shadow is not None:
        unshadowed(frame, background, palette.shadow, palette.colours, planes)
    if background.others is not None:
        planes[:, background.others] = 0
    return planes


def _undimmed(colours: int, plane: np.ndarray) -> np.ndarray:
    """Return shares of zero: nothing is taken out of the colours, float32 (colour, height, width)."""
    return np.zeros((colours, *plane.shape), dtype=np.float32)


def _closed(coverage: np.ndarray, longer: int) -> np.ndarray:
    """Fill the gaps between the bright and the dark edge of a shiny rod, which look like the background, in a
    picture whose longer side is given [px]."""
    import cv2

    size = 2 * round(CLOSING * longer) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return cv2.morphologyEx(coverage, cv2.MORPH_CLOSE, kernel)


def _any_difference(frame: Frame, background: Background, palette: Palette, out: np.ndarray) -> None:
    """Fill ``out``, uint8 (height, width), with coverage from the size of the difference alone, beyond the
    noise."""
    chroma = np.zeros((0, 0), dtype=np.float32)
    if not palette.grey_only and frame.chroma is not None and background.chroma is not None:
        way = _enlarged(background.window, frame.luma.shape, frame.chroma[0].shape)
        pairs = zip(frame.chroma, background.chroma, strict=True)
        blue, red = (plane[way.part] - back[way.part] for plane, back in pairs)
        chroma = np.ascontiguousarray(way.cut(blue**2 + red**2))
    # borders that stand out more than the least contrast keep their profile up to twice the range
    full, most = (ANY_CONTRAST, FULL) if palette.varied else (2 * ANY_CONTRAST, 255)
    noise = background.pixel_noise
    if noise.shape != out.shape:
        noise = np.full(out.shape, noise[0, 0])
    levels = np.array([ANY_BEYOND * palette.contrast, FULL / (full * palette.contrast), most], np.float32)
    _differing(frame.luma, chroma, (background.luma, noise), background.window, levels, out)


class _Enlarged(NamedTuple):
    """How a window is cut out of chroma planes.

    Attributes:
        part: The pixels of the planes that show it, rows and columns.
        size: Width and height that these cover in the full picture [px].
        inside: Rows and columns of the window in that.
    """

    part: tuple[slice, slice]
    size: tuple[int, int]
    inside: tuple[slice, slice]

    def cut(self, plane: np.ndarray) -> np.ndarray:
        """Return the window of a part of a plane at its full size."""
        import cv2

        return cv2.resize(plane, self.size, interpolation=cv2.INTER_LINEAR)[self.inside]


def _enlarged(window: Window, shape: tuple[int, ...], small: tuple[int, ...]) -> _Enlarged:
    """Return how a window of a picture is cut out of chroma planes, the sizes being (height, width)."""
    parts, sizes, insides = [], [], []
    for first, stop, full, count in (
        (window.top, window.bottom, shape[0], small[0]),
        (window.left, window.right, shape[1], small[1]),
    ):
        # a window may begin in the middle of a chroma pixel
        step = full / count
        begin, end = int(first / step), int(np.ceil(stop / step))
        start = round(begin * step)
        parts.append(slice(begin, end))
        sizes.append(round(end * step) - start)
        insides.append(slice(first - start, stop - start))
    return _Enlarged((parts[0], parts[1]), (sizes[1], sizes[0]), (insides[0], insides[1]))


def _chroma_part(
    chroma: tuple[np.ndarray, np.ndarray], background: Background, palette: Palette
) -> np.ndarray:
    """Return the projection of the colour differences, for each colour at full size within the window."""
    assert background.chroma is not None
    behind, colours, shape = background.chroma, palette.colours.astype(np.float32), background.luma.shape
    dimmed = palette.dimmed[1] if palette.dimmed is not None else _undimmed(len(colours), chroma[0])
    # the projection is linear, so it may be taken at the chroma's own size and enlarged afterwards
    way = _enlarged(background.window, shape, chroma[0].shape)
    part = way.part
    small = np.empty(
        (len(colours), part[0].stop - part[0].start, part[1].stop - part[1].start), dtype=np.float32
    )
    _project_chroma(
        chroma[0][part], chroma[1][part], behind[0][part], behind[1][part], colours, dimmed[:, *part], small
    )
    return np.stack([way.cut(plane) for plane in small])


@njit(cache=True, fastmath=True, error_model="numpy")
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
    does, over both channels."""
    weight = np.float32(CHROMA_WEIGHT)
    for k in range(colours.shape[0]):
        blue_light = colours[k, BLUE] - np.float32(BLACK[BLUE])
        red_light = colours[k, RED] - np.float32(BLACK[RED])
        for y in range(out.shape[1]):
            for x in range(out.shape[2]):
                b0, r0 = blue_background[y, x], red_background[y, x]
                share = dimmed[k, y, x]
                b = (np.float32(blue[y, x]) - b0) * (colours[k, BLUE] - b0 - share * blue_light)
                r = (np.float32(red[y, x]) - r0) * (colours[k, RED] - r0 - share * red_light)
                out[k, y, x] = weight * (b + r)


@njit(cache=True, fastmath=True, error_model="numpy")
def _project(luma: np.ndarray, chroma: np.ndarray, projection: _Projection, out: np.ndarray) -> None:
    """Fill ``out`` with the coverage by each colour; ``chroma`` has length 0 when grey alone counts."""
    background, colours, dimmed, scale, window = projection
    none, most, half = np.float32(0.0), np.float32(255.0), np.float32(0.5)
    # the two cases are separate loops, so that the common one, grey, has no branch and uses vector registers
    for k in range(colours.shape[0]):
        target = colours[k, GREY]
        light = target - np.float32(BLACK[GREY])
        for y in range(window.top, window.bottom):
            if chroma.shape[0] == 0:
                for x in range(window.left, window.right):
                    b = background[y, x]
                    value = (np.float32(luma[y, x]) - b) * (target - b) * scale[k, y, x]
                    out[k, y, x] = np.uint8(min(most, max(none, value + half)))
            else:
                for x in range(window.left, window.right):
                    b = background[y, x]
                    difference = chroma[k, y - window.top, x - window.left]
                    step = target - b - dimmed[k, y, x] * light
                    value = (np.float32(luma[y, x]) - b) * step + difference
                    out[k, y, x] = np.uint8(min(most, max(none, value * scale[k, y, x] + half)))


@njit(cache=True, fastmath=True, error_model="numpy")
def _differing(
    luma: np.ndarray,
    chroma: np.ndarray,
    behind: tuple[np.ndarray, np.ndarray],
    window: Window,
    levels: np.ndarray,
    out: np.ndarray,
) -> None:
    """Fill ``out`` with the size of the difference beyond the least that counts, times a scale.

    ``chroma``, the squared difference of the colours in the window, has length 0 when grey alone counts;
    ``behind`` holds background and noise, and ``levels`` the least difference, the scale and the most.
    """
    background, noise = behind
    beyond, scale, most = levels[0], levels[1], levels[2]
    none, weight, counts = np.float32(0.0), np.float32(CHROMA_WEIGHT), np.float32(ANY_NOISE)
    for y in range(window.top, window.bottom):
        for x in range(window.left, window.right):
            difference = np.float32(luma[y, x]) - background[y, x]
            square = difference * difference
            if chroma.shape[0] > 0:
                square += weight * chroma[y - window.top, x - window.left]
            share = (np.sqrt(square) - max(beyond, counts * noise[y, x])) * scale
            out[y, x] = np.uint8(min(most, max(none, share)))
