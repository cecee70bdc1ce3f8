"""numba kernels: soft coverage of every pixel from a frame, its background and the mechanism's colours."""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.types import Frame
from monodyn.vision.background import Background
from monodyn.vision.palette import Palette


def coverage_of(frame: Frame, background: Background, palette: Palette) -> np.ndarray:
    """Project each pixel's difference from the background on the mechanism's colours.

    With several colours the largest coverage counts.

    Args:
        frame: The picture.
        background: What it shows without the mechanism.
        palette: Colours and gains from ``choose_palette``.

    Returns:
        Coverage, uint8 (height, width), 255 where the mechanism covers the whole pixel.
    """
    out = np.zeros(frame.luma.shape, dtype=np.uint8)
    reach = np.array(background.reach)
    if palette.chroma_gain is None or frame.chroma is None or background.chroma is None:
        _grey(frame.luma, background.luma, palette.luma_gain, reach, out)
        return out
    import cv2

    size = (frame.luma.shape[1], frame.luma.shape[0])
    planes = [
        cv2.resize(plane.astype(np.float32) - back, size, interpolation=cv2.INTER_LINEAR)
        for plane, back in zip(frame.chroma, background.chroma, strict=True)
    ]
    _colour(
        frame.luma, planes[0], planes[1], background.luma, palette.luma_gain, palette.chroma_gain[0],
        palette.chroma_gain[1], reach, out,
    )  # fmt: skip
    return out


@njit(cache=True, fastmath=True, error_model="numpy")
def _grey(luma: np.ndarray, background: np.ndarray, gain: np.ndarray, reach: np.ndarray, out: np.ndarray) -> None:
    """Fill ``out`` from the grey levels alone; ``gain`` is (colour, height, width)."""
    colours = gain.shape[0]
    for y in range(reach[0], reach[1]):
        for x in range(reach[2], reach[3]):
            out[y, x] = np.uint8(min(255.0, max(0.0, (luma[y, x] - background[y, x]) * gain[0, y, x] + np.float32(0.5))))
        for k in range(1, colours):
            for x in range(reach[2], reach[3]):
                value = min(255.0, max(0.0, (luma[y, x] - background[y, x]) * gain[k, y, x] + np.float32(0.5)))
                out[y, x] = max(out[y, x], np.uint8(value))


@njit(cache=True, fastmath=True, error_model="numpy")
def _colour(
    luma: np.ndarray,
    blue: np.ndarray,
    red: np.ndarray,
    background: np.ndarray,
    luma_gain: np.ndarray,
    blue_gain: np.ndarray,
    red_gain: np.ndarray,
    reach: np.ndarray,
    out: np.ndarray,
) -> None:
    """Fill ``out`` from grey level and colour differences; each gain is (colour, height, width)."""
    colours = luma_gain.shape[0]
    for y in range(reach[0], reach[1]):
        for x in range(reach[2], reach[3]):
            grey = luma[y, x] - background[y, x]
            most = np.float32(0.0)
            for k in range(colours):
                value = grey * luma_gain[k, y, x] + blue[y, x] * blue_gain[k, y, x] + red[y, x] * red_gain[k, y, x]
                most = max(most, value)
            out[y, x] = np.uint8(min(np.float32(255.0), most + np.float32(0.5)))
