"""From a clip to its background: what each pixel shows while nothing moves over it.

The one idea: samples are taken at equal steps of *travelled motion*, not of time, so that a mechanism that
comes to rest, or lingers at its turning points, counts there once and not for the seconds it stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from monodyn.errors import VideoError
from monodyn.types import Frame, Progress
from monodyn.vision.clip.repeats import NO_REPEATS, Differences, Repeats
from monodyn.vision.clip.video import Video

SAMPLE_BYTES = 96_000_000
"""Most memory that the samples of a clip may take."""
CHANGED_NOISE = 5.0
"""A pixel has changed only if it differs by more than this many standard deviations of its own noise."""
SHOWN_NOISE = 4.0
"""Contrast over the noise of a pixel from which it shows whether it is covered."""
LEAST_NOISE = 0.5
"""Least standard deviation of a pixel: what rounding makes of no noise at all [grey levels]."""
SAMPLES = 72
"""Frames from which the background is taken."""
STILL_GREY = 8.0
"""Grey levels that a pixel may change between two frames by noise alone."""


class Window(NamedTuple):
    """A rectangle of the picture.

    Attributes:
        top: First row [px].
        bottom: Row below the last one [px].
        left: First column [px].
        right: Column to the right of the last one [px].
    """

    top: int
    bottom: int
    left: int
    right: int


@dataclass(frozen=True, eq=False)
class Background:
    """What the camera sees without the mechanism.

    Attributes:
        luma: Grey level of each pixel, float32 (height, width).
        chroma: Blue and red difference, each float32 (row, column) at the size of the clip's chroma planes,
            or None for a grey clip.
        noise: Standard deviation of a typical pixel's grey level over time [grey levels].
        known: False where too few samples show the pixel uncovered, bool (height, width).
        window: Part of the picture in which anything moves.
        given: True when it is a picture that the user gave, and not taken from the clip.
        deviation: Standard deviation of each pixel's grey level over time [grey levels], float32 (height,
            width); None where only the typical one is known.
    """

    luma: np.ndarray
    chroma: tuple[np.ndarray, np.ndarray] | None
    noise: float
    known: np.ndarray
    window: Window
    given: bool = False
    deviation: np.ndarray | None = None

    @property
    def pixel_noise(self) -> np.ndarray:
        """Standard deviation of each pixel over time, (height, width) or (1, 1) [grey levels]."""
        return np.full((1, 1), self.noise, np.float32) if self.deviation is None else self.deviation


@dataclass(frozen=True, eq=False)
class Samples:
    """Frames spread over the motion of a clip.

    Attributes:
        frames: The frames, in the order of time.
        window: Part of the picture in which anything moves over the whole clip.
        repeats: Pictures of the clip that repeat the one before; none of them is among the frames.
    """

    frames: tuple[Frame, ...]
    window: Window
    repeats: Repeats = NO_REPEATS


def sample_frames(video: Video, *, progress: Progress | None = None) -> Samples:
    """Pick frames of the clip at about equal steps of travelled motion, in one pass of bounded memory.

    Args:
        video: The clip.
        progress: Called with the number of frames read.

    Returns:
        At most ``SAMPLES`` frames, and where anything moves.

    Raises:
        VideoError: The clip has fewer than two frames.
    """
    # twice as many as wanted are kept, so that a choice is left after a halving
    limit = max(16, min(2 * SAMPLES, int(SAMPLE_BYTES / (1.5 * video.width * video.height))))
    kept: list[Frame] = []
    places: list[float] = []
    previous = lightest = darkest = np.zeros((0, 0, 0), dtype=np.float32)
    travelled = 0.0
    step = 0.0
    differences = Differences()
    for done, frame in enumerate(video.frames(), start=1):
        small = _thumbnail(frame)
        differences.add(frame.index, small)
        if previous.size:
            # noise does not travel; the tiny rest keeps the path increasing while the clip stands still
            moved = np.maximum(np.abs(small - previous) - STILL_GREY, 0.0)
            travelled += float(moved.sum()) + 1e-6
            np.maximum(lightest, small, out=lightest)
            np.minimum(darkest, small, out=darkest)
        else:
            lightest, darkest = small.copy(), small.copy()
        previous = small
        if not places or travelled - places[-1] >= step:
            kept.append(_own_copy(frame))
            places.append(travelled)
        # The length of the whole path is not known before its end: every frame is kept at first, and each
        # time that memory is full every other one is dropped and the step between two doubled.
        if len(kept) >= limit:
            kept, places = kept[::2], places[::2]
            step = max(2.0 * step, (places[-1] - places[0]) / max(1, len(places) - 1))
        if progress is not None:
            progress("background", done, video.count)
    if len(kept) < 2:
        raise VideoError(
            f"{video.path}: expected at least 2 frames, got {len(kept)}; give a clip that shows motion."
        )
    moves = _moving_cells(np.any(lightest - darkest > STILL_GREY, axis=0))
    window, repeats = _window_of(moves, video), differences.repeats(moves, video.times)
    fresh = [i for i, frame in enumerate(kept) if frame.index not in repeats.frames]
    kept, places = [kept[i] for i in fresh], [places[i] for i in fresh]
    targets = np.linspace(places[0], places[-1], min(SAMPLES, len(kept)))
    picks = np.unique(np.searchsorted(places, targets))
    kept = [kept[i] for i in picks]
    return Samples(tuple(kept), window, repeats)


def background_of(
    samples: Samples, covered: Sequence[np.ndarray] | None = None, *, fallback: Background | None = None
) -> Background:
    """Take the robust per-pixel median of sample frames.

    Args:
        samples: Frames of the clip.
        covered: For each sample the pixels that the mechanism covers, bool (height, width); they do not
            count.
        fallback: Background for the pixels that are covered in every sample; they stay unknown.

    Returns:
        The background with its noise level.
    """
    from monodyn.vision.foreground.median import masked_median

    frames = samples.frames
    luma = np.stack([frame.luma for frame in frames])
    hidden = np.zeros((0, 0, 0), dtype=np.bool_) if covered is None else np.stack(covered)
    grey, deviation, count = masked_median(luma, hidden)
    known = count >= max(2, len(frames) // 24)
    deviation = _smooth_deviation(deviation)
    noise = float(np.median(deviation))
    chroma = None
    if all(frame.chroma is not None for frame in frames):
        planes = []
        for channel in range(2):
            stack = np.stack([frame.chroma[channel] for frame in frames if frame.chroma is not None])
            small = hidden
            if covered is not None:
                small = np.stack([_shrink(mask, stack.shape[1:]) for mask in covered])
            planes.append(masked_median(stack, small)[0])
        chroma = (planes[0], planes[1])
    # a pixel that is never seen uncovered keeps the first guess, which the palette then does not trust
    if fallback is not None:
        grey = np.where(known, grey, fallback.luma)
        if chroma is not None and fallback.chroma is not None:
            known_small = _shrink(known, chroma[0].shape)
            blue, red = (
                np.where(known_small, new, old) for new, old in zip(chroma, fallback.chroma, strict=True)
            )
            chroma = (blue, red)
    return Background(grey, chroma, noise, known, samples.window, deviation=deviation)


def _smooth_deviation(deviation: np.ndarray) -> np.ndarray:
    """Return the deviation of each pixel, averaged with its neighbours' [grey levels], (height, width).

    A few samples determine a single pixel's noise within a tenth only, and where the background has an edge
    that shakes, the pixels next to it will change too.
    """
    import cv2

    return np.sqrt(np.maximum(cv2.blur(deviation**2, (5, 5)), LEAST_NOISE**2))


def _thumbnail(frame: Frame) -> np.ndarray:
    """Return the planes reduced to a quarter of the picture's size, float32 (channel, height, width)."""
    import cv2

    size = (max(1, frame.luma.shape[1] // 4), max(1, frame.luma.shape[0] // 4))
    planes = (frame.luma, *(frame.chroma or ()))
    return np.stack([cv2.resize(plane, size, interpolation=cv2.INTER_AREA) for plane in planes]).astype(
        np.float32
    )


def _moving_cells(moves: np.ndarray) -> np.ndarray:
    """Leave out the lone ones among the moving cells of the reduced picture."""
    import cv2

    # a lone cell is a flicker of the codec; label 0 is what does not move
    _, labels, stats, _ = cv2.connectedComponentsWithStats(moves.astype(np.uint8), connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= 6
    large[0] = False
    return large[np.asarray(labels, dtype=np.intp)]


def _window_of(moves: np.ndarray, video: Video) -> Window:
    """Return the bounding box of the moving cells of the reduced picture, with a margin."""
    rows, columns = np.nonzero(moves.any(axis=1))[0], np.nonzero(moves.any(axis=0))[0]
    if not len(rows):
        return Window(0, video.height, 0, video.width)
    scale_y, scale_x = video.height / moves.shape[0], video.width / moves.shape[1]
    margin = max(16, video.height // 24)
    return Window(
        max(0, int(rows[0] * scale_y) - margin),
        min(video.height, int((rows[-1] + 1) * scale_y) + margin),
        max(0, int(columns[0] * scale_x) - margin),
        min(video.width, int((columns[-1] + 1) * scale_x) + margin),
    )


def _own_copy(frame: Frame) -> Frame:
    """Copy the planes, so that the decoder's buffers go back to it."""
    chroma = None if frame.chroma is None else (frame.chroma[0].copy(), frame.chroma[1].copy())
    return Frame(frame.index, frame.time, frame.luma.copy(), chroma)


def _shrink(mask: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Reduce a mask to the chroma planes; a pixel is set when any of its parts is."""
    import cv2

    small = cv2.resize(mask.astype(np.float32), (shape[1], shape[0]), interpolation=cv2.INTER_AREA)
    return small > 0.0
