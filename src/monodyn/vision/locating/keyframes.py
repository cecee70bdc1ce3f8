"""From the samples of a clip to a few masks that differ from one another, reduced for the global search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.types import FULL, Mask
from monodyn.vision.drawing.mismatch import row_balance, row_sums
from monodyn.vision.foreground.masks import Masks, View, plain_view, planes_for
from monodyn.vision.locating.thin import lacking, thickened_mask

UNKNOWN = 0.06
"""Trust below which a pixel carries no information."""
MOST_STRAY = FULL * 16 // 100
"""Coverage of a reduced pixel up to which it counts as none."""
COARSE_PX = 170
"""Largest side of the reduced picture of the moving part [px]."""
JUDGED = 8
"""Most distinct frames by which it is judged how thick the mechanism is."""
COMPARED_PX = 90
"""Largest side of the masks that are compared to find those that differ most [px]."""


@dataclass(frozen=True, eq=False)
class KeyFrame:
    """One mask, whole and reduced.

    Attributes:
        index: Number of the frame in the clip.
        time: Time stamp [s].
        planes: Mask by colour, uint8 (colour, height, width); one plane until the geoms' colours are known.
        coarse: Reduced mask, half of ``FULL`` where the background is not known, uint8 (height,
            width).
        area: Covered area of the reduced mask [reduced px^2].
    """

    index: int
    time: float
    planes: np.ndarray
    coarse: np.ndarray
    area: float

    @cached_property
    def sums(self) -> np.ndarray:
        """Row prefix sums of ``coarse``, float32 (height, width + 1)."""
        return row_sums(self.coarse)

    @cached_property
    def balance(self) -> np.ndarray:
        """What covering the pixels of ``coarse`` costs a pose, from ``row_balance``, (height, width + 1)."""
        return row_balance(self.coarse)

    @cached_property
    def extent(self) -> tuple[np.ndarray, np.ndarray]:
        """First and last row, then first and last column, of what is more than half covered [reduced px],
        each (2,); zero and the picture's sizes where nothing is."""
        shown = self.coarse > FULL // 2
        rows, columns = (np.flatnonzero(shown.any(axis=axis)) for axis in (1, 0))
        if not len(rows):
            rows, columns = (np.array([0, size]) for size in shown.shape)
        return rows[[0, -1]], columns[[0, -1]]


@dataclass(frozen=True, eq=False)
class KeyFrames:
    """Masks spread over the motion.

    Attributes:
        frames: The key frames, in the order of time.
        shrink: Pixels of the clip per reduced pixel.
        view: How the planes of the masks are to be read.
        coarse_trust: Trust in the least distinct plane, reduced, float32 (height, width).
        most_trust: Trust in the most distinct plane, reduced, float32 (height, width).
        thicker: By how much everything in the reduced masks is thicker to every side than it is [reduced px];
            None where the masks are as they come.
    """

    frames: tuple[KeyFrame, ...]
    shrink: int
    view: View
    coarse_trust: np.ndarray
    most_trust: np.ndarray
    thicker: float | None = None

    def most_distinct(self, count: int) -> list[int]:
        """Choose the frames whose masks differ most.

        Args:
            count: How many, at most.

        Returns:
            Their rows in ``frames``, the fullest first.
        """
        while len(self._order) < min(count, len(self.frames)):
            self._order.append(self._farthest())
        return self._order[:count]

    def only(self, rows: Sequence[int]) -> KeyFrames:
        """Return some of the frames as a set of their own.

        Args:
            rows: Their rows in ``frames``.

        Returns:
            These, in the order of ``rows``.
        """
        return replace(self, frames=tuple(self.frames[row] for row in rows))

    def afresh(self) -> KeyFrames:
        """Return the same frames without what was worked out of them: of all of them it would be much to keep
        for what is done with them once."""
        return replace(self, frames=tuple(replace(frame) for frame in self.frames))

    def reduced(self, factor: int) -> KeyFrames:
        """Return the frames reduced further.

        Args:
            factor: Reduced pixels per new pixel.

        Returns:
            The same frames with smaller reduced masks.
        """
        if factor == 1:
            return self
        frames = [
            replace(frame, coarse=coarse, area=frame.area / factor**2)
            for frame in self.frames
            for coarse in (_averaged(frame.coarse, factor),)
        ]
        return replace(
            self,
            frames=tuple(frames),
            shrink=self.shrink * factor,
            coarse_trust=_averaged(self.coarse_trust, factor),
            most_trust=_averaged(self.most_trust, factor),
            thicker=None if self.thicker is None else self.thicker / factor,
        )

    def thickened(self, by: int) -> KeyFrames:
        """Return the frames with everything in the reduced masks thicker.

        Args:
            by: The amount to every side [reduced px].

        Returns:
            The same frames.
        """
        thick = replace(self, thicker=float(by))
        frames = [
            replace(frame, coarse=coarse, area=area)
            for frame in self.frames
            for coarse, area in (_filled(thickened_mask(self.shown(frame), by), self),)
        ]
        return replace(thick, frames=tuple(frames))

    def shown(self, frame: KeyFrame) -> np.ndarray:
        """Return what a reduced mask shows as covered, uint8 (height, width).

        Args:
            frame: One of the frames.
        """
        return np.where(self.unknown & (frame.coarse <= FULL // 2), np.uint8(0), frame.coarse)

    @property
    def coarse_view(self) -> View:
        """How the one plane of the reduced masks is to be read."""
        return plain_view(self.coarse_trust, len(self.view.part))

    @cached_property
    def unknown(self) -> np.ndarray:
        """True where a reduced pixel carries no information, bool (height, width)."""
        return self.coarse_trust < UNKNOWN

    @cached_property
    def unknown_places(self) -> np.ndarray:
        """Which pixels these are, by flat index, (pixel,)."""
        return np.flatnonzero(self.unknown)

    @cached_property
    def blind(self) -> np.ndarray:
        """True where it carries none of any colour, bool (height, width)."""
        return self.most_trust < UNKNOWN

    @cached_property
    def _order(self) -> list[int]:
        """Rows chosen so far, each the farthest from those before it; the first one is the fullest."""
        return [int(np.argmax([frame.area for frame in self.frames]))]

    @cached_property
    def _apart(self) -> np.ndarray:
        """Each frame's distance from the nearest one chosen before the last, (key frame,)."""
        return np.full(len(self.frames), np.inf)

    @cached_property
    def _small(self) -> np.ndarray:
        """The masks, small enough to be compared one with another, uint8 (key frame, pixel)."""
        import cv2

        by = max(4.0, max(self.coarse_trust.shape) / COMPARED_PX)
        size = [max(1, round(side / by)) for side in self.coarse_trust.shape[::-1]]
        small = [cv2.resize(frame.coarse, size, interpolation=cv2.INTER_AREA) for frame in self.frames]
        return np.stack(small).reshape(len(small), -1)

    def _farthest(self) -> int:
        """Return the row of the frame that is the farthest from those chosen so far."""
        last, small = self._order[-1], self._small
        # whole numbers, a quarter of the memory of fractions: of their differences neither may be negative
        apart = np.maximum(small, small[last])
        apart -= np.minimum(small, small[last])
        np.minimum(self._apart, apart.sum(axis=1, dtype=np.uint32), out=self._apart)
        self._apart[last] = -1.0
        return int(np.argmax(self._apart))


def key_frames(masks: Masks, geoms: int) -> KeyFrames:
    """Compute the masks of the sample frames, whole and reduced.

    Args:
        masks: The soft foreground of the clip.
        geoms: Number of geoms of the mechanism.

    Returns:
        One key frame per sample.
    """
    empty = no_frames(masks, masks.view(geoms))
    made = on_all_cores(lambda frame: key_frame(masks.of(frame), empty), masks.samples.frames)
    frames = replace(empty, frames=tuple(made))
    by = lacking([frames.shown(frames.frames[row]) for row in frames.most_distinct(JUDGED)])
    return frames if by is None else frames.thickened(by)


def key_frame(mask: Mask, frames: KeyFrames) -> KeyFrame:
    """Make a key frame of one mask, as thick as the others.

    Args:
        mask: A mask of the clip.
        frames: How it is reduced, for example from ``no_frames``.

    Returns:
        The key frame.
    """
    import cv2

    shown = _averaged(mask.coverage, frames.shrink)
    np.minimum(shown, FULL, out=shown)
    cv2.threshold(shown, MOST_STRAY, 0, cv2.THRESH_TOZERO, dst=shown)
    if frames.thicker is not None:
        shown = thickened_mask(np.where(frames.blind, np.uint8(0), shown), round(frames.thicker))
    coarse, area = _filled(shown, frames)
    planes = planes_for(mask, frames.view)
    return KeyFrame(mask.index, mask.time, planes, coarse, area)


def no_frames(masks: Masks, view: View) -> KeyFrames:
    """Return a set without frames: the reduction of the picture and its trust.

    Args:
        masks: The soft foreground of the clip.
        view: How the planes of the masks are to be read.

    Returns:
        The empty set.
    """

    # until the pose is known, a pixel is worth what it shows of the colour that it shows least
    least = view.trust[-1] if masks.varied else view.least
    most = view.trust.max(axis=0)
    window = masks.background.window
    size = max(window.bottom - window.top, window.right - window.left)
    shrink = max(1, round(size / COARSE_PX))
    return KeyFrames((), shrink, view, _averaged(least, shrink), _averaged(most, shrink))


def _filled(shown: np.ndarray, frames: KeyFrames) -> tuple[np.ndarray, float]:
    """Return a reduced mask and its area from what it shows, where it may not show all of the mechanism."""
    area, places = int(shown.sum(dtype=np.uint32)) / FULL, frames.unknown_places
    # Half covered costs a pose the same whether it covers the pixel or not: 1 - 2 I_a is zero there. Where
    # some of the mechanism's colours cannot be seen, what shows is the mechanism all the same.
    seen = np.where(frames.blind.ravel()[places], 0, shown.ravel()[places])
    filled = shown.copy()
    filled.ravel()[places] = np.maximum(seen, FULL // 2)
    return filled, area


def _averaged(picture: np.ndarray, factor: int) -> np.ndarray:
    """Return a picture whose pixels are the means of squares of pixels."""
    import cv2

    height, width = (side // factor for side in picture.shape)
    part = picture[: height * factor, : width * factor]
    return cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA)
