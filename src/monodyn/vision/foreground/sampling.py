"""From a clip to sample frames of its scene, and where and when anything moves in it.

The one idea: samples are taken at equal steps of *travelled motion*, not of time, so that a mechanism that
comes to rest, or lingers at its turning points, counts there once and not for the seconds it stays.
"""

from __future__ import annotations

import numpy as np

from monodyn.errors import SettingsError, VideoError
from monodyn.types import Frame, Progress
from monodyn.vision.clip.repeats import Differences, Repeats
from monodyn.vision.clip.video import Video
from monodyn.vision.foreground.background import Samples, Window
from monodyn.vision.foreground.parts import moving_cells, moving_outside, moving_parts, window_around
from monodyn.vision.foreground.thumbnails import STILL_GREY, ThumbnailStore, scene_span
from monodyn.vision.settings import SegmentSettings

SAMPLE_BYTES = 96_000_000
"""Most memory that the samples of a clip may take."""
SAMPLES = 72
"""Frames from which the background is taken."""
HALF_DIGIT = 5e-4
"""Half of the last digit to which time stamps are usually written [s]."""
CUT_SHARE = 0.5
"""Share of the picture that changes between two frames when the light or the scene does, not a mechanism."""


def sample_frames(
    video: Video, settings: SegmentSettings | None = None, *, progress: Progress | None = None
) -> Samples:
    """Pick frames of the clip at about equal steps of travelled motion, in one pass of bounded memory.

    Args:
        video: The clip.
        settings: Region and time range, where the user gives them, and the contrast that counts as seen.
        progress: Called with the number of frames read.

    Returns:
        At most ``SAMPLES`` frames, and where and when anything moves.

    Raises:
        VideoError: The clip has fewer than two frames.
        SettingsError: The region or the time range lies outside of the clip.
    """
    settings = settings or SegmentSettings()
    first, stop = frames_between(video.times, settings.time_range)
    window = None if settings.roi is None else window_of(settings.roi, video)
    path, done = _Path(video), 0
    for done, frame in enumerate(video.frames(first, stop), start=1):
        path.add(frame)
        if progress is not None:
            progress("background", done, stop - first)
    # none of the frames may decode, in a damaged part of a clip
    _check_enough(video, done)
    thumbnails = path.thumbnails.finished()
    # a range that the user gave is the scene's
    span = (first, stop)
    if settings.time_range is None:
        span = scene_span(thumbnails, settings.contrast, span)
    shown = thumbnails.within(span)
    cells = moving_cells(shown)
    repeats = path.differences.repeats(cells, video.times)
    frames = path.spread(span, repeats)
    _check_enough(video, len(frames))
    size, parts, others = (video.width, video.height), None, None
    if window is not None:
        # the mechanism may go on outside of the user's region: its edge is no edge of the mechanism
        others = moving_outside(shown, window, size)
    else:
        window = window_around(cells, size)
        parts = moving_parts(shown, [frame.index for frame in frames], size)
    given = settings.time_range is not None
    return Samples(frames, window, repeats, span, shown, parts, given=given, others=others)


def _check_enough(video: Video, count: int) -> None:
    """Refuse a clip of which fewer than two frames can be used."""
    if count < 2:
        raise VideoError(
            f"{video.path}: expected at least 2 frames, got {count}; give a clip that shows motion."
        )


class _Path:
    """Frames at equal steps of the travelled motion, and the thumbnails of all."""

    def __init__(self, video: Video) -> None:
        # twice as many as wanted are kept, so that a choice is left after a halving
        self._limit = max(16, min(2 * SAMPLES, int(SAMPLE_BYTES / (1.5 * video.width * video.height))))
        self._kept: list[Frame] = []
        self._held = video.held
        self._places: list[float] = []
        self._travelled = self._step = 0.0
        self._previous: np.ndarray | None = None
        self.differences = Differences()
        self.thumbnails = ThumbnailStore(video.width, video.height, video.count)

    def add(self, frame: Frame) -> None:
        """Take the next frame."""
        import cv2

        small = self.thumbnails.add(frame)
        self.differences.add(frame.index, small)
        if self._previous is not None and self._previous.shape == small.shape:
            # noise does not travel; the tiny rest keeps the path increasing while the clip stands still
            rows, before = (planes.reshape(-1, planes.shape[2]) for planes in (small, self._previous))
            moved = cv2.subtract(cv2.absdiff(rows, before), np.full_like(rows, STILL_GREY))
            cut = np.count_nonzero(moved[: small.shape[1]]) > CUT_SHARE * small[0].size
            self._travelled += 1e-6 if cut else cv2.norm(moved, cv2.NORM_L1) + 1e-6
        self._previous = small
        if not self._places or self._travelled - self._places[-1] >= self._step:
            self._kept.append(frame if self._held else own_copy(frame))
            self._places.append(self._travelled)
        # The length of the whole path is not known before its end: every frame is kept at first, and each
        # time that memory is full every other one is dropped and the step between two doubled.
        if len(self._kept) >= self._limit:
            self._kept, self._places = self._kept[::2], self._places[::2]
            whole = self._places[-1] - self._places[0]
            self._step = max(2.0 * self._step, whole / max(1, len(self._places) - 1))

    def spread(self, span: tuple[int, int], repeats: Repeats) -> tuple[Frame, ...]:
        """Return frames of the span, none of them a repeat, at about equal steps of the path."""
        numbers = set(range(*span)).difference(repeats.frames)
        rows = [i for i, frame in enumerate(self._kept) if frame.index in numbers]
        if not rows:
            return ()
        places = np.array(self._places)[rows]
        targets = np.linspace(places[0], places[-1], min(SAMPLES, len(rows)))
        picks = np.unique(np.searchsorted(places, targets))
        return tuple(self._kept[rows[i]] for i in picks)


def frames_between(times: np.ndarray, seconds: tuple[float, float | None] | None) -> tuple[int, int]:
    """Return the first frame of a time range and the one after its last.

    Args:
        times: Time stamps of the clip [s], (frame,).
        seconds: Begin and end [s], the end included; None for the whole clip, as for an end left out.

    Raises:
        SettingsError: fewer than two frames lie in the range.
    """
    if seconds is None:
        return 0, len(times)
    begin, end = seconds[0], np.inf if seconds[1] is None else seconds[1]
    # a stamp that is written with three digits stands for itself
    first = int(np.searchsorted(times, begin - HALF_DIGIT))
    stop = int(np.searchsorted(times, end + HALF_DIGIT, side="right"))
    if stop < first + 2:
        raise SettingsError(
            f"time-range: expected at least two frames within {times[0]:.3f}:{times[-1]:.3f} s, got "
            f"{begin:g}:{end:g} s with {max(0, stop - first)}; give seconds of the clip."
        )
    return first, stop


def window_of(roi: tuple[int, int, int, int], video: Video) -> Window:
    """Return the rectangle that a user gives.

    Args:
        roi: Left column, top row, width and height [px].
        video: The clip.

    Raises:
        SettingsError: it does not lie in the picture.
    """
    left, top, width, height = roi
    if left + width > video.width or top + height > video.height:
        raise SettingsError(
            f"roi: expected X,Y,W,H within the picture of {video.width}x{video.height} px, got "
            f"{left},{top},{width},{height}; give column and row of the upper left corner, width and height."
        )
    return Window(top, top + height, left, left + width)


def own_copy(frame: Frame) -> Frame:
    """Return a frame with planes of its own, so that the decoder's buffers go back to it.

    Args:
        frame: The frame.
    """
    chroma = None if frame.chroma is None else (frame.chroma[0].copy(), frame.chroma[1].copy())
    return Frame(frame.index, frame.time, frame.luma.copy(), chroma)
