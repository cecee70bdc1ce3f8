"""From samples and background to the pixels that have changed: what moves, and by how much it differs."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from monodyn.types import Frame
from monodyn.vision.foreground.background import CHANGED_NOISE, Background
from monodyn.vision.foreground.shadow import Shadow, in_shadow

MOST_CONTRAST = 14.0
"""A pixel that differs from the background by more than this has changed, however strong the mechanism's
contrast is [grey levels]."""
CHANGED_SHARE = 0.3
"""Share of the contrast of what stands out most from which a pixel has changed, where that is less."""
SHOWN, BEHIND, FRAME = slice(0, 3), slice(3, 6), 6
"""Columns of a table of pixels: colour, colour of the background there, and number of the frame."""
PIXEL_COLUMNS = FRAME + 1
"""Number of these columns."""


def least_contrast(samples: Sequence[Frame], background: Background, grey_only: bool) -> float:
    """Choose the difference from which on a pixel has changed, as a share of what stands out most.

    Where the mechanism is strong, faint changes are shadows, reflections and the codec's; where it is faint,
    they are the mechanism.

    Args:
        samples: Frames of the clip.
        background: Its background.
        grey_only: True where colours do not count.

    Returns:
        The difference [grey levels].
    """
    noise = background.pixel_noise
    # a quarter of the pixels is plenty
    noise = noise if noise.shape == (1, 1) else noise[::2, ::2]
    behind = [
        plane[::2, ::2] for plane in full_size(background.luma, None if grey_only else background.chroma)
    ]
    counts, found = background.counts[::2, ::2], []
    for frame in samples[:: max(1, len(samples) // 12)]:
        planes = [p[::2, ::2] for p in full_size(frame.luma, None if grey_only else frame.chroma)]
        squares = apart(planes, behind)
        found.append(squares[(squares > (CHANGED_NOISE * noise) ** 2) & counts])
    sizes = np.sqrt(np.concatenate(found))
    typical = float(np.percentile(sizes, 95.0)) if len(sizes) else 0.0
    return float(np.clip(CHANGED_SHARE * typical, CHANGED_NOISE * background.noise, MOST_CONTRAST))


def moving_pixels(
    samples: Sequence[Frame],
    background: Background,
    grey_only: bool,
    contrast: float,
    shadow: Shadow | None,
) -> np.ndarray:
    """Gather the colours of inner foreground pixels.

    Args:
        samples: Frames of the clip.
        background: Its background.
        grey_only: True where colours do not count.
        contrast: Least difference of a pixel that has changed [grey levels].
        shadow: The mechanism's shadow, which does not count.

    Returns:
        Their colours, those of their backgrounds and the frames' numbers, in the columns named above, (pixel,
        column).
    """
    import cv2

    rows, part = [], _margined(background)
    behind = [p[part] for p in full_size(background.luma, None if grey_only else background.chroma)]
    inner = np.ones((3, 3), np.uint8)
    around = [plane[part] for plane in surroundings(samples, background, contrast)]
    noise = np.broadcast_to(background.pixel_noise, background.luma.shape)[part]
    counts, least = background.counts[part], np.maximum(contrast, CHANGED_NOISE * noise) ** 2
    picks = range(0, len(samples), max(1, len(samples) // 24))
    for i in picks:
        frame = samples[i]
        planes = [p[part] for p in full_size(frame.luma, None if grey_only else frame.chroma)]
        moving = (apart(planes, behind) > least) & counts
        # Where the first background shows the mechanism itself, what moves is its absence: such a pixel is
        # more like its surroundings than the background is, and does not count.
        y, x = np.nonzero(moving)
        shown, back, near = ([plane[y, x] for plane in picture] for picture in (planes, behind, around))
        moving[y, x] = apart(shown, near) > apart(back, near)
        if shadow is not None:
            moving &= ~in_shadow(frame, background, shadow)[part]
        # pixels at an edge are mixed with the background; only a thin mechanism has no others
        core = cv2.erode(moving.astype(np.uint8), inner) > 0
        if core.sum() < 20:
            core = moving
        y, x = np.nonzero(core)
        step = max(1, len(y) // 1500)
        y, x = y[::step], x[::step]
        columns = [plane[y, x] for plane in planes + behind]
        if grey_only:
            blank = np.zeros(len(y))
            columns = [columns[0], blank, blank, columns[1], blank, blank]
        rows.append(np.column_stack([*columns, np.full(len(y), i)]))
    return np.concatenate(rows).astype(np.float64, copy=False) if rows else np.zeros((0, PIXEL_COLUMNS))


def _margined(background: Background) -> tuple[slice, slice]:
    """Return rows and columns of the part in which anything moves, and of a still pixel around it."""
    top, bottom, left, right = background.window
    return slice(max(0, top - 1), bottom + 1), slice(max(0, left - 1), right + 1)


def surroundings(samples: Sequence[Frame], background: Background, contrast: float) -> list[np.ndarray]:
    """Fill the places where anything moves from the still ones around them.

    Args:
        samples: Frames of the clip.
        background: Its background.
        contrast: Least difference of a pixel that has changed [grey levels].

    Returns:
        The background's planes, filled, each (height, width).
    """
    import cv2

    lumas = [frame.luma for frame in samples[:: max(1, len(samples) // 24)]]
    # one after the other: all of them side by side would be copied together first
    most, least = functools.reduce(np.maximum, lumas), functools.reduce(np.minimum, lumas)
    moves = (most.astype(np.int16) - least) > max(contrast, 8.0 * background.noise)
    # A blur in which moving pixels have no weight, normalized by the blurred weights: it fills the places
    # where anything moves from the still ones around them.
    still = 1.0 - cv2.dilate(moves.astype(np.uint8), np.ones((5, 5), np.uint8)).astype(np.float32)
    size = (still.shape[1] // 8, still.shape[0] // 8)
    blur = 0.06 * max(size)

    def blurred(plane: np.ndarray) -> np.ndarray:
        return cv2.GaussianBlur(cv2.resize(plane, size, interpolation=cv2.INTER_AREA), (0, 0), blur)

    weight = np.maximum(blurred(still), 1e-6)
    full = (still.shape[1], still.shape[0])
    planes = full_size(background.luma, background.chroma)
    return [cv2.resize(blurred(still * p) / weight, full, interpolation=cv2.INTER_LINEAR) for p in planes]


def full_size(luma: np.ndarray, chroma: tuple[np.ndarray, np.ndarray] | None) -> list[np.ndarray]:
    """Bring the planes of a picture to its full size.

    Args:
        luma: Grey levels, (height, width).
        chroma: Blue and red difference, each (row, column) of any size, or None.

    Returns:
        One or three planes, float32 (height, width) each.
    """
    import cv2

    size = (luma.shape[1], luma.shape[0])
    small = () if chroma is None else chroma
    return [luma.astype(np.float32)] + [
        cv2.resize(plane.astype(np.float32), size, interpolation=cv2.INTER_LINEAR) for plane in small
    ]


def apart(planes: list[np.ndarray], other: list) -> np.ndarray:
    """Compute the squared distance of colours.

    Args:
        planes: A picture, float32 (height, width) each, or some of its pixels, (pixel,) each.
        other: Another one, or one number for each plane; what there is more of either does not count.

    Returns:
        The sum of the squares over the planes, float32 (height, width) or (pixel,) [grey levels squared].
    """
    squares = np.zeros(planes[0].shape, dtype=np.float32)
    for plane, value in zip(planes, other, strict=False):
        difference = plane - value
        squares += np.square(difference, out=difference)
    return squares
