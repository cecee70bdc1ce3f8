"""Reduced pictures of every frame, small enough to be kept: when the clip shows its scene.

The one idea: what is usually still shows whether a frame belongs to the scene. While a clip fades in, shows a
title, or the camera still settles its exposure, most of that differs from the background by as much as a
mechanism would.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from monodyn.arrays import medians
from monodyn.cores import on_all_cores
from monodyn.types import Frame

SHRINK = 4.0
"""Pixels of the clip per pixel of a thumbnail, at least."""
THUMBNAIL_BYTES = 64_000_000
"""Most memory that the thumbnails of a clip may take; of a long clip they are smaller."""
STILL_GREY = 8.0
"""Grey levels that a pixel may change by noise alone, at most."""
STILL_SHARE = 0.3
"""Share of what changes most that counts as noise, where that is less."""
STILL_NOISE = 2.0
"""Change over that of the typical cell from which it is no noise."""
LEAST_CHANGE = 2.0
"""Grey levels that a cell may change by rounding alone."""
STILL_DEVIATION = 4.0
"""Median deviation over time below which a pixel is usually still [grey levels]."""
CHANGED_SHARE = 0.25
"""Share of the still pixels that differ from the background in a frame which does not show the scene."""
LONGEST_SHARE = 1.0 / 3.0
"""Share of the clip up to which a stretch at an end counts as something else than the scene."""
PROBED_FRAMES, PROBED_PIXELS = 96, 4000
"""Frames and pixels that are enough for what is usual."""


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
class Thumbnails:
    """Reduced pictures of every frame of a clip.

    Attributes:
        number: Number of each frame in the clip, int (frame,).
        planes: Grey level and, where there is colour, both differences, uint8 (frame, channel, height,
            width).
        shrink: Pixels of the clip per pixel of a thumbnail.
    """

    number: np.ndarray
    planes: np.ndarray
    shrink: float

    @cached_property
    def ranges(self) -> np.ndarray:
        """By how much each cell changes, uint8 (channel, height, width)."""
        channels = self.planes.swapaxes(0, 1)
        return np.stack(on_all_cores(lambda plane: plane.max(axis=0) - plane.min(axis=0), channels))

    @cached_property
    def still(self) -> float:
        """Change of a cell that may be noise [grey levels]; less where all that moves is faint."""
        noise = max(STILL_NOISE * float(np.median(self.ranges[0])), LEAST_CHANGE)
        moving = self.ranges[0][self.ranges[0] > noise]
        most = float(np.percentile(moving, 95.0)) if len(moving) else 0.0
        return min(STILL_GREY, max(noise, STILL_SHARE * most))

    def within(self, span: tuple[int, int]) -> Thumbnails:
        """Return those of a stretch of the clip.

        Args:
            span: Number of its first frame and of the one after its last.
        """
        rows = slice(*np.searchsorted(self.number, span))
        return Thumbnails(self.number[rows], self.planes[rows], self.shrink)


class ThumbnailStore:
    """Takes the frames of a clip one by one, in memory that is limited from the beginning.

    Args:
        width: Picture width [px].
        height: Picture height [px].
        count: Number of frames to come, at most.
    """

    def __init__(self, width: int, height: int, count: int) -> None:
        # three planes of (width height / shrink^2) bytes for each frame
        least = np.sqrt(3.0 * width * height * count / THUMBNAIL_BYTES)
        self._shrink = float(max(SHRINK, least))
        self._size = max(1, round(height / self._shrink)), max(1, round(width / self._shrink))
        self._number: list[int] = []
        self._planes, self._count, self._channels = np.zeros((0, 0, 0, 0), np.uint8), count, 0

    def add(self, frame: Frame) -> np.ndarray:
        """Keep the thumbnail of one frame.

        Args:
            frame: The next frame.

        Returns:
            The thumbnail, uint8 (channel, height, width).
        """
        planes, row = (frame.luma, *(frame.chroma or ())), len(self._number)
        if row == 0:
            # what is not filled yet takes no memory
            self._channels = len(planes)
            self._planes = np.empty((self._count, len(planes), *self._size), dtype=np.uint8)
        # a frame without colour in a clip with colour is rare: only the grey level is common to all then
        self._channels = min(self._channels, len(planes))
        small = self._planes[row, : len(planes)]
        reduced(planes[: len(small)], small)
        self._number.append(frame.index)
        return small

    def finished(self) -> Thumbnails:
        """Return the thumbnails of all frames that were added."""
        planes = self._planes[: len(self._number), : self._channels]
        return Thumbnails(np.array(self._number, dtype=np.int64), planes, self._shrink)


def reduced(planes: Sequence[np.ndarray], out: np.ndarray) -> None:
    """Reduce the planes of a picture to those of a thumbnail.

    Args:
        planes: Grey level and, where there is colour, both differences, each uint8 (row, column).
        out: The thumbnail, uint8 (channel, height, width), which is filled.
    """
    from monodyn.vision.clip.blocks import block_means

    for plane, small in zip(planes, out, strict=True):
        block_means(plane, small)


def scene_span(thumbnails: Thumbnails, contrast: float, whole: tuple[int, int]) -> tuple[int, int]:
    """Return the stretch of the clip that shows the scene, without what precedes and follows it.

    Args:
        thumbnails: All frames.
        contrast: Difference from the background that counts as foreground [grey levels].
        whole: Number of the first frame and of the one after the last.

    Returns:
        The same of the scene.
    """
    usual = _usual(thumbnails)
    # where neither end still changes, as is mostly so, both show the scene
    if not np.any(_differs(thumbnails, usual, [0, -1], STILL_DEVIATION)):
        return whole
    unlike, changing = _differs(thumbnails, usual, slice(None), contrast, STILL_DEVIATION)
    first = _prelude(unlike, changing)
    stop = len(unlike) - _prelude(unlike[::-1], changing[::-1])
    number = thumbnails.number
    # the ends of the whole stay where the clip does not begin or end with something else
    begin = int(number[first]) if first else whole[0]
    return begin, int(number[stop - 1]) + 1 if stop < len(number) else whole[1]


def _prelude(unlike: np.ndarray, changing: np.ndarray) -> int:
    """Return how many frames precede the scene: unlike it at first, then still changing."""
    most = int(LONGEST_SHARE * len(unlike))
    if not len(unlike) or not unlike[0]:
        return 0
    scene = np.flatnonzero(~changing)
    # a longer stretch is no prelude: the light has changed, or the other stretch is the scene
    return int(scene[0]) if len(scene) and scene[0] <= most else 0


class _Usual(NamedTuple):
    """What is usually still: every how many cells, which of these, bool (point,), and their grey levels,
    float32 (point,)."""

    step: int
    still: np.ndarray
    level: np.ndarray


def _usual(thumbnails: Thumbnails) -> _Usual:
    """Return what is usually still."""
    count, cells = len(thumbnails.number), thumbnails.planes[0, 0].size
    step = max(1, cells // PROBED_PIXELS)
    few = _probed(thumbnails, slice(None, None, max(1, count // PROBED_FRAMES)), step)
    level = medians(few)
    few -= level
    return _Usual(step, medians(np.abs(few, out=few)) < STILL_DEVIATION, level)


def _probed(thumbnails: Thumbnails, rows: slice | list[int], step: int) -> np.ndarray:
    """Return the grey level of some of the cells in some of the frames, float32 (frame, point)."""
    # all channels of a frame follow one another, so that to cut the first one out first would copy it
    cells = thumbnails.planes[0, 0].size
    grey = thumbnails.planes.reshape(len(thumbnails.number), -1)[:, :cells:step]
    return grey[rows].astype(np.float32)


def _differs(
    thumbnails: Thumbnails, usual: _Usual, rows: slice | list[int], *levels: float
) -> list[np.ndarray]:
    """Return which of some frames are off by more than each level in much of what is usually still, bool
    (frame,)."""
    # where nothing is usually still, there is nothing to compare with
    if np.mean(usual.still) < CHANGED_SHARE:
        return [np.zeros(len(thumbnails.number[rows]), dtype=bool) for _ in levels]
    change = _probed(thumbnails, rows, usual.step)[:, usual.still]
    change -= usual.level[usual.still]
    np.abs(change, out=change)
    most = CHANGED_SHARE * np.count_nonzero(usual.still)
    return [np.count_nonzero(change > level, axis=1) > most for level in levels]
