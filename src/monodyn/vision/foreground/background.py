"""From sample frames to the background: what each pixel shows while nothing moves over it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from monodyn.arrays import median
from monodyn.cores import on_all_cores
from monodyn.types import Frame
from monodyn.vision.clip.repeats import NO_REPEATS, Repeats
from monodyn.vision.foreground.covered import Covered, reduced_mask
from monodyn.vision.foreground.parts import Parts
from monodyn.vision.foreground.thumbnails import Thumbnails, Window

CHANGED_NOISE = 5.0
"""A pixel has changed only if it differs by more than this many standard deviations of its own noise."""
SHOWN_NOISE = 4.0
"""Contrast over the noise of a pixel from which it shows whether it is covered."""
AT_ONCE = 20_000
"""Pixels whose samples are gathered at a time."""
LEAST_NOISE = 0.5
"""Least standard deviation of a pixel: what rounding makes of no noise at all [grey levels]."""


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
        others: Where something other than the mechanism moves within the window, bool (height, width), or
            None.
    """

    luma: np.ndarray
    chroma: tuple[np.ndarray, np.ndarray] | None
    noise: float
    known: np.ndarray
    window: Window
    given: bool = False
    deviation: np.ndarray | None = None
    others: np.ndarray | None = None

    @cached_property
    def pixel_noise(self) -> np.ndarray:
        """Standard deviation of each pixel over time, float32 (height, width) [grey levels]."""
        return np.full(self.luma.shape, self.noise, np.float32) if self.deviation is None else self.deviation

    @property
    def counts(self) -> np.ndarray:
        """Where a difference counts as motion of the mechanism, bool (height, width)."""
        inside = np.zeros(self.luma.shape, dtype=np.bool_)
        top, bottom, left, right = self.window
        inside[top:bottom, left:right] = True
        return inside if self.others is None else inside & ~self.others


class Medians(NamedTuple):
    """What the pixels show over some frames.

    Attributes:
        luma: Median grey level, float32 (height, width).
        deviation: Noise of each pixel [grey levels], float32 (height, width).
        count: Samples that count, uint16 (height, width).
        chroma: Median blue and red difference, each float32 (row, column), or None for a grey clip.
    """

    luma: np.ndarray
    deviation: np.ndarray
    count: np.ndarray
    chroma: tuple[np.ndarray, np.ndarray] | None


@dataclass(frozen=True, eq=False)
class Samples:
    """Frames spread over the motion of a clip.

    Attributes:
        frames: The frames, in the order of time.
        window: Part of the picture in which anything moves over the whole clip.
        repeats: Pictures of the clip that repeat the one before; none of them is among the frames.
        span: First frame that shows the scene, and the one after the last; None stands for the whole clip.
        thumbnails: Reduced pictures of all frames of the span, or None where there are none.
        parts: Parts of the picture that move apart from one another; None where all motion is in one, or
            the region is given.
        others: Where something other than the mechanism moves within the window, or anything outside of one
            that is given, bool (height, width), or None.
        given: True where the span is one that the user gave.
    """

    frames: tuple[Frame, ...]
    window: Window
    repeats: Repeats = NO_REPEATS
    span: tuple[int, int] | None = None
    thumbnails: Thumbnails | None = None
    parts: Parts | None = None
    others: np.ndarray | None = None
    given: bool = False

    @cached_property
    def medians(self) -> Medians:
        """What the pixels show over all frames."""
        return _medians(self.frames)


def background_of(
    samples: Samples, covered: Covered | None = None, *, fallback: Background | None = None
) -> Background:
    """Take the robust per-pixel median of sample frames.

    Args:
        samples: Frames of the clip.
        covered: The pixels of each sample that the mechanism covers; they do not count.
        fallback: Background for the pixels that are covered in every sample; they stay unknown.

    Returns:
        The background with its noise level.
    """
    found = samples.medians if covered is None else _uncovered(samples, covered)
    grey, chroma = found.luma, found.chroma
    known = found.count >= max(2, len(samples.frames) // 24)
    deviation = _smooth_deviation(found.deviation)
    noise = median(deviation)
    # a pixel that is never seen uncovered keeps the first guess, which the palette then does not trust
    if fallback is not None:
        grey = np.where(known, grey, fallback.luma)
        if chroma is not None and fallback.chroma is not None:
            known_small = reduced_mask(known, chroma[0].shape)
            blue, red = (
                np.where(known_small, new, old) for new, old in zip(chroma, fallback.chroma, strict=True)
            )
            chroma = (blue, red)
    result = Background(grey, chroma, noise, known, samples.window, deviation=deviation)
    return within(result, samples.window, samples.others)


def _medians(frames: Sequence[Frame]) -> Medians:
    """Return what the pixels show over all frames."""
    every = [[frame.luma for frame in frames]]
    colours = [frame.chroma for frame in frames if frame.chroma is not None]
    if len(colours) == len(frames):
        every += [list(planes) for planes in zip(*colours, strict=True)]
    (luma, deviation, count), *rest = _over_all(every)
    return Medians(luma, deviation, count, (rest[0][0], rest[1][0]) if rest else None)


def _over_all(every: Sequence[Sequence[np.ndarray]]) -> list[list[np.ndarray]]:
    """Return median, noise and count of the pixels of planes, each (height, width); noise of the first."""
    from monodyn.vision.foreground.median import masked_median

    nothing = np.zeros((0, 0, 0), dtype=np.bool_)
    # what all frames show of a few rows stays at hand, and takes no memory to speak of
    parts = []
    for kind, planes in enumerate(every):
        height, width = planes[0].shape
        rows = max(1, AT_ONCE // width)
        parts += [(kind, slice(first, first + rows)) for first in range(0, height, rows)]

    def counted(part: tuple[int, slice]) -> tuple[np.ndarray, ...]:
        kind, rows = part
        stack = np.ascontiguousarray(np.stack([plane[rows] for plane in every[kind]]))
        return masked_median(stack, nothing, kind == 0)

    found: list[list[tuple[np.ndarray, ...]]] = [[] for _ in every]
    for (kind, _), medians in zip(parts, on_all_cores(counted, parts), strict=True):
        found[kind].append(medians)
    return [[np.concatenate(rows) for rows in zip(*some, strict=True)] for some in found]


def _uncovered(samples: Samples, covered: Covered) -> Medians:
    """Return what the pixels show over the frames in which they are not covered.

    Only the pixels that are covered in some frame are counted again.
    """
    luma, deviation, count, chroma = samples.medians
    luma, deviation, count = luma.copy(), deviation.copy(), count.copy()
    found = _again([frame.luma for frame in samples.frames], covered)
    for plane, values in zip((luma, deviation, count), found, strict=True):
        covered.cut(plane)[covered.anywhere] = values
    if chroma is not None:
        small = covered.of_samples(luma.shape, chroma[0].shape)
        colours = [frame.chroma for frame in samples.frames if frame.chroma is not None]
        chroma = (chroma[0].copy(), chroma[1].copy())
        for target, planes in zip(chroma, zip(*colours, strict=True), strict=True):
            small.cut(target)[small.anywhere] = _again(planes, small, noise=False)[0]
    return Medians(luma, deviation, count, chroma)


def _again(planes: Sequence[np.ndarray], covered: Covered, *, noise: bool = True) -> list[np.ndarray]:
    """Return median, noise and count of the pixels of planes that some of them do not show, each (pixel,)."""
    from monodyn.vision.foreground.median import masked_median

    pixels, inside = covered.pixels(planes[0].shape[1]), np.flatnonzero(covered.anywhere)

    def counted(first: int) -> list[np.ndarray]:
        some = slice(first, first + AT_ONCE)
        stack = np.stack([plane.take(pixels[some]) for plane in planes])
        hidden = np.stack([mask.take(inside[some]) for mask in covered.masks])
        return [found[0] for found in masked_median(stack[:, np.newaxis], hidden[:, np.newaxis], noise)]

    # of a large picture the pixels of all frames at once would fill the memory
    parts = on_all_cores(counted, range(0, max(len(pixels), 1), AT_ONCE))
    return [np.concatenate(part) for part in zip(*parts, strict=True)]


def _smooth_deviation(deviation: np.ndarray) -> np.ndarray:
    """Return the deviation of each pixel, averaged with its neighbours' [grey levels], (height, width).

    A few samples determine a single pixel's noise within a tenth only, and where the background has an edge
    that shakes, the pixels next to it will change too.
    """
    import cv2

    smooth = deviation**2
    cv2.blur(smooth, (5, 5), dst=smooth)
    return np.sqrt(np.maximum(smooth, LEAST_NOISE**2, out=smooth), out=smooth)


def within(background: Background, window: Window, others: np.ndarray | None) -> Background:
    """Return a background of which only a part of the picture counts.

    Args:
        background: The background.
        window: The part.
        others: Where something else moves in it, bool (height, width), or None.
    """
    # what shows other things may hide the mechanism: nothing is known of it there
    known = background.known if others is None else background.known & ~others
    return replace(background, known=known, window=window, others=others)
