"""From samples and background to the pixels that have changed: what moves, and by how much it differs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.types import Frame
from monodyn.vision.foreground.background import CHANGED_NOISE, Background
from monodyn.vision.foreground.chroma import enlarged, whole_samples
from monodyn.vision.foreground.shadow import Shadow, in_shadow
from monodyn.vision.foreground.thinned import spacing, thinned, thinning
from monodyn.vision.foreground.thumbnails import Window

if TYPE_CHECKING:
    from monodyn.vision.foreground.inner import Scenery

MOST_CONTRAST = 14.0
"""A pixel that differs from the background by more than this has changed, however strong the mechanism's
contrast is [grey levels]."""
CHANGED_SHARE = 0.3
"""Share of the contrast of what stands out most from which a pixel has changed, where that is less."""
SHOWN, BEHIND, FRAME = slice(0, 3), slice(3, 6), 6
"""Columns of a table of pixels: colour, colour of the background there, and number of the frame."""
PICKED_FRAMES = 12
"""Samples, about, that are enough for the contrast of what moves, and for its colours."""
PIXELS_AT_ONCE = 17_000_000
"""Pixels of all the samples that are gone through at a time, about."""
PICKED = 500
"""Pixels of such a sample that are enough for its colours."""
LEAST_CORE = 20
"""Pixels inside of what moves below which all that move count."""
MARGIN_PX = 5
"""Margin of the part in which anything moves: a still pixel, and a sample of the colours [px]."""
AROUND_PX = 90
"""Longer side of the picture of the surroundings, at most [px]."""


class Moving(NamedTuple):
    """Pixels that have changed: their colours, those of their backgrounds and the frames' numbers, in the
    columns named above; of each frame every so many, of both kinds alike.

    Attributes:
        pixels: Those that show what moves, (pixel, column).
        absent: Those that are more like what is around than the background is, which may hold what has gone,
            (pixel, column).
    """

    pixels: np.ndarray
    absent: np.ndarray


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
    step = thinning(background.luma.shape)
    noise = background.pixel_noise[::step, ::step]
    least, counts = (CHANGED_NOISE * noise) ** 2, background.counts[::step, ::step]
    behind = thinned(background.luma, None if grey_only else background.chroma, step)

    def changed(frame: Frame) -> np.ndarray:
        """Return the squared differences of the pixels of one sample that have changed, (pixel,)."""
        squares = apart(thinned(frame.luma, None if grey_only else frame.chroma, step), behind)
        return squares[(squares > least) & counts]

    picks = samples[:: spacing(len(samples), PICKED_FRAMES)]
    sizes = np.sqrt(np.concatenate(on_all_cores(changed, picks)))
    typical = float(np.percentile(sizes, 95.0)) if len(sizes) else 0.0
    return float(np.clip(CHANGED_SHARE * typical, CHANGED_NOISE * background.noise, MOST_CONTRAST))


def moving_pixels(
    samples: Sequence[Frame],
    background: Background,
    around: Sequence[np.ndarray],
    grey_only: bool,
    contrast: float,
    shadow: Shadow | None,
) -> Moving:
    """Gather the colours of inner pixels of what has changed.

    Args:
        samples: Frames of the clip.
        background: Its background.
        around: What is around all that moves, from ``surroundings``, each float32 (row, column), reduced.
        grey_only: True where colours do not count.
        contrast: Least difference of a pixel that has changed [grey levels].
        shadow: The mechanism's shadow, which does not count.

    Returns:
        Their colours.
    """
    import cv2

    from monodyn.vision.foreground.inner import ABSENT, MOVING, fill_moving

    window, least = _moving_window(background), (float(contrast), CHANGED_NOISE)
    behind, shape = _scenery(background, np.stack(around), grey_only, window), background.luma.shape

    def picked(number: int) -> Moving:
        """Return the pixels of one sample."""
        frame = samples[number]
        luma = _cut(frame.luma, window, shape)
        small = () if grey_only else frame.chroma or ()
        tint = np.zeros((len(small), *(luma.shape if small else (1, 1))), np.uint8)
        for out, plane in zip(tint, small, strict=True):
            out[:] = _cut(plane, window, shape)
        marks = np.zeros_like(luma)
        fill_moving(luma, tint, behind, least, marks)
        if shadow is not None:
            marks[_cut(in_shadow(frame, background, shadow), window, shape)] = 0
        # pixels at an edge are mixed with the background; only a thin mechanism has no others
        moving, absent = ((marks == kind).view(np.uint8) for kind in (MOVING, ABSENT))
        core, absent = (cv2.erode(mask, np.ones((3, 3), np.uint8)) for mask in (moving, absent))
        inner = core if cv2.countNonZero(core) >= LEAST_CORE else moving
        step = max(1, max(cv2.countNonZero(mask) for mask in (inner, absent)) // PICKED)
        shown, usual = [luma, *tint], [behind.luma, *behind.chroma]
        return Moving(*(_table(shown, usual, *_some(mask, step), number) for mask in (inner, absent)))

    rows = range(0, len(samples), spacing(len(samples), PICKED_FRAMES))
    most = max(1, PIXELS_AT_ONCE // background.luma.size)
    pixels, absent = zip(*on_all_cores(picked, rows, most=most), strict=True)
    return Moving(np.concatenate(pixels), np.concatenate(absent))


def _some(mask: np.ndarray, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of every ``step``-th pixel of a mask, (pixel,) each."""
    import cv2

    # to find none takes as long as to find some
    at = cv2.findNonZero(mask) if cv2.countNonZero(mask) else None
    x, y = (np.zeros((0, 2), np.int32) if at is None else at.reshape(-1, 2)[::step]).T
    return y, x


def _table(
    shown: Sequence[np.ndarray], usual: Sequence[np.ndarray], y: np.ndarray, x: np.ndarray, frame: int
) -> np.ndarray:
    """Return some pixels of one or three planes of a frame and of its background, (pixel, column)."""
    found = np.zeros((len(y), FRAME + 1))
    found[:, FRAME] = frame
    for columns, planes in ((SHOWN, shown), (BEHIND, usual)):
        for channel, plane in zip(found[:, columns].T, planes, strict=False):
            channel[:] = plane[y, x]
    return found


def _scenery(background: Background, around: np.ndarray, grey_only: bool, window: Window) -> Scenery:
    """Return what a window of the samples is compared with."""
    from monodyn.vision.foreground.inner import Scenery

    shape = background.luma.shape
    chroma = () if grey_only else background.chroma or ()
    tint = [_cut(plane, window, shape) for plane in chroma]
    planes = (background.luma, background.pixel_noise, background.counts)
    luma, noise, counts = (_cut(plane, window, shape) for plane in planes)
    rows = np.arange(window.top, window.bottom) * around.shape[1] // shape[0]
    columns = np.arange(window.left, window.right) * around.shape[2] // shape[1]
    top, bottom, left, right = background.window
    inside = Window(top - window.top, bottom - window.top, left - window.left, right - window.left)
    behind = np.stack(tint) if tint else np.zeros((0, 1, 1), np.float32)
    return Scenery(luma, behind, around, noise, counts, inside, rows, columns)


def _moving_window(background: Background) -> Window:
    """Return the window of a background with a margin, of whole samples of its colours."""
    (top, bottom, left, right), chroma = background.window, background.chroma
    around = Window(top - MARGIN_PX, bottom + MARGIN_PX, left - MARGIN_PX, right + MARGIN_PX)
    return whole_samples(around, background.luma.shape, None if chroma is None else chroma[0].shape)


def _cut(plane: np.ndarray, window: Window, shape: tuple[int, ...]) -> np.ndarray:
    """Return the window of a plane of a picture of a height and width, at full size, (row, column)."""
    if plane.shape == shape:
        return np.ascontiguousarray(plane[window.top : window.bottom, window.left : window.right])
    way = enlarged(window, shape, plane.shape)
    return way.cut(plane[way.part])


def surroundings(samples: Sequence[Frame], background: Background, contrast: float) -> list[np.ndarray]:
    """Fill the places where anything moves from the still ones around them.

    Args:
        samples: Frames of the clip.
        background: Its background.
        contrast: Least difference of a pixel that has changed [grey levels].

    Returns:
        The background's planes, filled and reduced, each float32 (row, column).
    """
    import cv2

    step, picks = thinning(background.luma.shape), samples[:: spacing(len(samples), PICKED_FRAMES)]

    def over_all(function: np.ufunc) -> np.ndarray:
        """Return the most or the least grey level of the pixels over the samples, (row, column)."""
        found = picks[0].luma[::step].copy()
        for frame in picks[1:]:
            function(found, frame.luma[::step], out=found)
        return found

    most, least = on_all_cores(over_all, (np.maximum, np.minimum))
    moves = most - least > max(contrast, 8.0 * background.noise)
    # A blur in which moving pixels have no weight, normalized by the blurred weights: it fills the places
    # where anything moves from the still ones around them.
    still = 1.0 - cv2.dilate(moves.astype(np.uint8), np.ones((3, 5), np.uint8)).astype(np.float32)
    height, width = background.luma.shape
    shrink = max(8.0, max(height, width) / AROUND_PX)
    size = max(1, int(width / shrink)), max(1, int(height / shrink))
    blur = 0.06 * max(size)

    def blurred(plane: np.ndarray) -> np.ndarray:
        return cv2.GaussianBlur(cv2.resize(plane, size, interpolation=cv2.INTER_AREA), (0, 0), blur)

    weight = np.maximum(blurred(still), 1e-6)
    rows = [background.luma[::step]]
    for plane in background.chroma or ():
        rows.append(cv2.resize(plane, still.shape[::-1], interpolation=cv2.INTER_NEAREST))
    return [blurred(still * plane) / weight for plane in rows]


def full_size(luma: np.ndarray, chroma: tuple[np.ndarray, np.ndarray] | None) -> list[np.ndarray]:
    """Bring the planes of a picture to its full size; what has it already is not copied.

    Args:
        luma: Grey levels, (height, width).
        chroma: Blue and red difference, each (row, column) of any size, or None.

    Returns:
        One or three planes, float32 (height, width) each.
    """
    import cv2

    size = (luma.shape[1], luma.shape[0])
    small = () if chroma is None else chroma
    return [luma.astype(np.float32, copy=False)] + [
        cv2.resize(plane.astype(np.float32, copy=False), size, interpolation=cv2.INTER_LINEAR)
        for plane in small
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
