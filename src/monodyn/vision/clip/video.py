"""A file or a folder into a stream of grey pictures with their presentation time stamps.

The one idea: the stamps of all frames are read first, without decoding where the container allows it, and
each decoded picture finds its number by its stamp. So a frame number means the same in every pass, whatever
the decoder drops, and a pass may start anywhere. Frames are handed over one at a time; nothing is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count
from pathlib import Path

import numpy as np

from monodyn.arrays import Frozen, frozen, increasing, usual_step
from monodyn.cores import give_back_large
from monodyn.errors import VideoError
from monodyn.markup import card, counted, sentences, stretch
from monodyn.names import meant, near_files
from monodyn.typed import checked
from monodyn.types import Frame
from monodyn.vision.clip.ahead import made_ahead
from monodyn.vision.clip.repeats import NO_REPEATS, Repeats
from monodyn.vision.clip.steady import CameraPath
from monodyn.vision.settings import LEAST_SIDE, RATES

AHEAD = 8
"""Frames that are decoded before they are asked for, at most."""

LARGE_PIXELS = 2_100_000
"""Pixels from which on the memory of a picture matters."""
WHOLE_PIXELS = 6_000_000
"""Most pixels of a picture that is looked at whole: larger ones are reduced, unless that is refused."""
LONGEST_SIDE = 16_384
"""Most pixels along a side of a picture: what draws and warps pictures counts to twice that."""
MOST_PIXELS = 20_000_000
"""Most pixels of a picture: what a whole run holds of them is some 150 bytes each."""
MOST_REPEATS = 0.3
"""Share of pictures that repeat the one before above which a clip was copied to another rate: twice as many
make half of them, a camera in trouble a sixth. Nothing changes from 0.2 to 0.45."""
Decode = Callable[[int, int], Iterator[Frame]]


@dataclass(frozen=True, eq=False)
class Video(Frozen):
    """A clip: its size, its time stamps and a way to stream its frames.

    Luma is in the video ("limited") range whatever the file holds: black 16, white 235.

    Attributes:
        path: File or folder of the clip.
        width: Picture width in square pixels, upright [px].
        height: Picture height in square pixels, upright [px].
        times: Presentation time stamps of all frames [s], increasing, (frame,).
        decode: Streams the frames of a range of frame numbers.
        remarks: Where the notes are collected.
        tick: Unit to which the stamps are rounded [s]; 0 where they are exact.
        stretch: By how much the stamps of the file are stretched against these times.
        repeats: Pictures that repeat the one before; ``frames`` leaves them out.
        camera_path: The way of a camera that moves: ``frames`` gives what it would have filmed at rest; None
            for one that stands still.
        bare: True where too little shows of the still scene to tell whether the camera moves.
        straight: What puts a frame of the same camera straight that is no part of the clip; None where its
            pictures are as the camera took them. ``decode`` has done so with its own.
        held: True where all of its frames are in memory anyway, so that nobody needs copies of some.
        shrink: Pixels of the file to a side of one of these, where large pictures are looked at reduced.
    """

    path: Path
    width: int
    height: int
    times: np.ndarray
    decode: Decode = field(repr=False)
    remarks: list[str] = field(default_factory=list, repr=False)
    tick: float = 0.0
    stretch: float = 1.0
    repeats: Repeats = NO_REPEATS
    camera_path: CameraPath | None = None
    bare: bool = False
    straight: Callable[[Frame], Frame] | None = field(default=None, repr=False)
    held: bool = False
    shrink: int = 1

    def __post_init__(self) -> None:
        times = frozen("Video.times", self.times, (None,), error=VideoError)
        object.__setattr__(self, "times", increasing("Video.times", times, error=VideoError))

    @property
    def count(self) -> int:
        """Number of frames in the clip."""
        return len(self.times)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was dropped, missing or assumed, in sentences; complete after a pass over the frames."""
        return tuple(self.remarks)

    @checked
    def frames(self, start: int = 0, stop: int | None = None) -> Iterator[Frame]:
        """Decode frames ``start`` to ``stop - 1``, on a thread of its own while those before are worked on.

        A frame that cannot be decoded is left out (its number is skipped) and counted in ``notes``; so is one
        of ``repeats``, and one in which it is not known where a camera that moves was. A frame's arrays stay
        valid for as long as they are held; they are read-only.

        Args:
            start: First frame number.
            stop: Frame number after the last one; None goes to the end of the clip.

        Returns:
            An iterator of frames with increasing numbers.

        Raises:
            VideoError: The range lies outside the clip.
            SettingsError: A number is no whole number.
        """
        end = self.count if stop is None else stop
        if not 0 <= start <= end <= self.count:
            raise VideoError(
                f"frames: expected a range within 0:{self.count}, got {start}:{end}; "
                f"clip '{self.path}' has {self.count} frames."
            )
        frames = self._shown(start, end)
        # a few frames are sooner there than a thread
        return made_ahead(frames, AHEAD) if end - start > AHEAD else frames

    def _shown(self, start: int, end: int) -> Generator[Frame]:
        """Yield the frames of a range that show something new, at rest."""
        left_out, path = frozenset(self.repeats.frames), self.camera_path
        for frame in self.decode(start, end):
            if frame.index in left_out:
                continue
            shown = frame if path is None else path.steady(frame)
            if shown is not None:
                yield shown

    @property
    def as_filmed(self) -> Video:
        """The clip with its pictures as they are, whether or not the camera moves."""
        return replace(self, camera_path=None)

    def within(self, top: int, bottom: int, left: int, right: int) -> Video:
        """Return the clip for somebody who looks at a window of the pictures alone: before a moving camera
        the rest need not be registered.

        Args:
            top: First row [px].
            bottom: Row below the last one [px].
            left: First column [px].
            right: Column to the right of the last one [px].
        """
        path = self.camera_path
        return self if path is None else replace(self, camera_path=path.within(top, bottom, left, right))

    def without(self, repeats: Repeats) -> Video:
        """Return the clip without pictures that repeat the one before, and note them.

        Args:
            repeats: What was found among its pictures.

        Raises:
            VideoError: The file states at what rate it was captured, and was copied to another one since.
        """
        count = len(repeats.frames)
        if self.stretch != 1.0 and count > MOST_REPEATS * self.count:
            rate = self.count / ((self.count - count) * usual_step(self.times))
            raise VideoError(
                f"clip '{self.path}': expected new pictures, as the file states at what rate they were "
                f"taken, got {count} of {self.count} that repeat the one before: it was copied to another "
                f"rate since. If what it states is of the new pictures, give --rate {rate:.4g}."
            )
        if count:
            verbs = ("repeats", "it counts") if count == 1 else ("repeat", "they count")
            note = f"{count} of {self.count} pictures {verbs[0]} the one before; {verbs[1]} as not seen."
            if note not in self.remarks:
                self.remarks.append(note)
        return replace(self, repeats=repeats)

    def __repr__(self) -> str:
        rate = (self.count - 1) / (self.times[-1] - self.times[0]) if self.count > 1 else 0.0
        shown = f", {rate:.4g} Hz" if rate else ""
        return (
            f"<Video {self.path.name}: {self.width}x{self.height} px, {counted(self.count, 'frame')}, "
            f"{stretch(self.times.tolist())}{shown}>"
        )

    def _repr_html_(self) -> str:
        """Return the clip as HTML, for notebooks, with what was noted."""
        moves = (
            [] if self.camera_path is None else ["The camera moves; frames are as one at rest shows them."]
        )
        return card(repr(self), sentences([str(self.path), *moves, *self.notes]))

    def timed(self, frames: np.ndarray, times: np.ndarray) -> Video:
        """Return the whole clip, repeats and all, with other times.

        Args:
            frames: Frame numbers, int (frame,).
            times: Their times [s], (frame,); frames that are not named keep their stamps.
        """
        clock = self.times.copy()
        clock[frames] = times
        return replace(self, times=clock, repeats=NO_REPEATS)


def read(path: str | Path, *, rate: float | None = None, still: bool = False, whole: bool = False) -> Video:
    """Open a clip and read the time stamps of its frames.

    Args:
        path: Video file (mp4, mov, webm, mkv, avi, gif, ...) or a folder of numbered pictures (png, jpg, bmp,
            tif).
        rate: Frames a second [Hz] in place of the time stamps of the file; None uses the stamps (30 a second
            for a folder, which has none).
        still: Take one picture file as a clip of one frame, with luma as in the clips it is compared with.
        whole: Take pictures of more than 6 million pixels at their full size, with four times the memory;
            else they are reduced by a whole number, those of 4K to half: pixels are those of the reduced
            pictures, and a note says so.

    Returns:
        The clip; its pictures are decoded by ``Video.frames``.

    Raises:
        VideoError: The path is missing or not a video, has no picture stream, no time stamps, fewer than two
            frames, pictures that show nothing, or larger ones than can be worked on; or it is no picture
            although ``still`` is true.

    Example:
        >>> import monodyn
        >>> video = monodyn.read("clip.mp4")  # doctest: +SKIP
        >>> video.width, video.height, video.count  # doctest: +SKIP
        (720, 480, 300)
    """
    check_rate(rate)
    path = Path(path)
    if still:
        from monodyn.vision.clip.folder import read_still

        return Video(path, *read_still(path))
    if path.is_dir():
        from monodyn.vision.clip.folder import read_folder

        return _checked(Video(path, *read_folder(path, rate)), whole=whole)
    if not path.exists():
        end = meant(near_files(path)) or "check the path."
        raise VideoError(
            f"clip '{path}': expected a video file or a folder of pictures, found nothing; {end}"
        )
    if not path.is_file():
        raise VideoError(
            f"clip '{path}': expected a file or a folder, got a device or pipe; save the clip to a file."
        )
    from monodyn.vision.clip.container import read_container

    return _checked(Video(path, *read_container(path, rate)), whole=whole)


def _checked(video: Video, *, whole: bool) -> Video:
    """Return a clip whose pictures are large enough to show a mechanism, and not too large for the memory."""
    if min(video.width, video.height) < LEAST_SIDE:
        raise VideoError(
            f"clip '{video.path}': expected pictures of at least {LEAST_SIDE}x{LEAST_SIDE} px, got "
            f"{video.width}x{video.height}; give the clip at its full size."
        )
    if max(video.width, video.height) > LONGEST_SIDE:
        raise VideoError(
            f"clip '{video.path}': expected pictures of at most {LONGEST_SIDE} px to a side, got "
            f"{video.width}x{video.height}; give the part that shows the mechanism."
        )
    if video.width * video.height > MOST_PIXELS:
        raise VideoError(
            f"clip '{video.path}': expected pictures of at most {MOST_PIXELS / 1e6:.0f} million pixels, got "
            f"{video.width}x{video.height}; give the clip at half its size, for example as made by ffmpeg -i "
            "CLIP -vf scale=iw/2:-2 SMALLER.mp4."
        )
    if video.width * video.height > LARGE_PIXELS:
        give_back_large()
    return video if whole else _reduced(video)


def _reduced(video: Video) -> Video:
    """Return a clip with its pictures reduced by the least whole number that brings them below
    ``WHOLE_PIXELS``."""
    by = next(k for k in count(1) if (video.width // k) * (video.height // k) <= WHOLE_PIXELS)
    if by == 1:
        return video
    width, height = video.width // by, video.height // by
    video.remarks.append(
        f"Pictures of {video.width}x{video.height} px are looked at reduced, {width}x{height}; --whole looks "
        "at all of their pixels, with more memory and time."
    )
    return replace(video, width=width, height=height, decode=partial(_smaller, by, video.decode), shrink=by)


def _smaller(by: int, decode: Decode, start: int, stop: int) -> Iterator[Frame]:
    """Yield the reduced pictures of a range of frame numbers, each pixel the mean of those that it covers."""
    import cv2

    def mean(plane: np.ndarray, height: int, width: int) -> np.ndarray:
        found = cv2.resize(plane, (width, height), interpolation=cv2.INTER_AREA)
        found.flags.writeable = False
        return found

    for frame in decode(start, stop):
        # what is left over of a side that is no multiple is left out
        height, width = (side // by for side in frame.luma.shape)
        luma, chroma = mean(frame.luma[: height * by, : width * by], height, width), None
        if frame.chroma is not None:
            blue, red = (mean(one, (height + 1) // 2, (width + 1) // 2) for one in frame.chroma)
            chroma = blue, red
        yield replace(frame, luma=luma, chroma=chroma)


def check_rate(rate: float | None) -> None:
    """Refuse a rate that no camera has.

    Args:
        rate: Frames a second [Hz]; None is none.

    Raises:
        VideoError: it is out of range, or no number.
    """
    if rate is not None and not RATES[0] <= rate <= RATES[1]:
        raise VideoError(
            f"rate: expected {RATES[0]:g} to {RATES[1]:g} frames a second, got {rate:g}; give the true rate."
        )
