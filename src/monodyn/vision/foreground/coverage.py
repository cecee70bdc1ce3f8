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
    planes = np.zeros((len(colours), *frame.luma.shape), dtype=np.uint8)
    chroma = dimmed = np.zeros((0, 0, 0), dtype=np.float32)
    if not (palette.grey_only or frame.chroma is None or background.chroma is None):
        dimmed = np.zeros(planes.shape, dtype=np.float32) if palette.dimmed is None else palette.dimmed[0]
        chroma = _chroma_part(frame.chroma, background, palette)
    projection = _Projection(background.luma, colours, dimmed, palette.scale, background.window)
    _project(frame.luma, chroma, projection, planes)
    if palette.any_difference:
        other = _any_difference(frame, background, palette)
        if palette.varied:
            other = _closed(np.maximum(planes.max(axis=0), other))
        planes = np.concatenate([planes, other[np.newaxis]])
    if palette.shadow is not None:
        unshadowed(frame, background, palette.shadow, palette.colours, planes)
    if background.others is not None:
        planes[:, background.others] = 0
    return planes


def _closed(coverage: np.ndarray) -> np.ndarray:
    """Fill the gaps between the bright and the dark edge of a shiny rod, which look like the background."""
    import cv2

    size = 2 * round(CLOSING * max(coverage.shape)) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return cv2.morphologyEx(coverage, cv2.MORPH_CLOSE, kernel)


def _any_difference(frame: Frame, background: Background, palette: Palette) -> np.ndarray:
    """Return coverage from the size of the difference alone, beyond the noise, uint8 (height, width)."""
    import cv2

    squares = (frame.luma - background.luma) ** 2
    if not palette.grey_only and frame.chroma is not None and background.chroma is not None:
        size = (squares.shape[1], squares.shape[0])
        blue, red = (plane - back for plane, back in zip(frame.chroma, background.chroma, strict=True))
        small = blue**2 + red**2
        squares = squares + CHROMA_WEIGHT * cv2.resize(small, size, interpolation=cv2.INTER_LINEAR)
    beyond = np.sqrt(squares) - np.maximum(ANY_BEYOND * palette.contrast, ANY_NOISE * background.pixel_noise)
    # borders that stand out more than the least contrast keep their profile up to twice the range
    full, most = (ANY_CONTRAST, FULL) if palette.varied else (2 * ANY_CONTRAST, 255)
    share = np.clip(beyond * (FULL / (full * palette.contrast)), 0.0, most).astype(np.uint8)
    top, bottom, left, right = background.window
    out = np.zeros_like(share)
    out[top:bottom, left:right] = share[top:bottom, left:right]
    return out


def _chroma_part(
    chroma: tuple[np.ndarray, np.ndarray], background: Background, palette: Palette
) -> np.ndarray:
    """Return the projection of the colour differences, for each colour at full size within the window."""
    import cv2

    assert background.chroma is not None
    behind, colours, shape = background.chroma, palette.colours.astype(np.float32), background.luma.shape
    dimmed = np.zeros((len(colours), *chroma[0].shape), dtype=np.float32)
    if palette.dimmed is not None:
        dimmed = palette.dimmed[1]
    top, bottom, left, right = background.window
    # the projection is linear, so it may be taken at the chroma's own size and enlarged afterwards
    rows, columns = shape[0] / chroma[0].shape[0], shape[1] / chroma[0].shape[1]
    part = (
        slice(int(top / rows), int(np.ceil(bottom / rows))),
        slice(int(left / columns), int(np.ceil(right / columns))),
    )
    small = np.empty(
        (len(colours), part[0].stop - part[0].start, part[1].stop - part[1].start), dtype=np.float32
    )
    _project_chroma(
        chroma[0][part], chroma[1][part], behind[0][part], behind[1][part], colours, dimmed[:, *part], small
    )
    size = (right - left, bottom - top)
    return np.stack([cv2.resize(plane, size, interpolation=cv2.INTER_LINEAR) for plane in small])


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
