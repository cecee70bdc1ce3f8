"""A clip that is decoded once, however often its pictures are looked at.

The one idea: a thread decodes all pictures, from the first one on and as fast as it can, into a file without
a name, and each pass over the clip reads them there, the first one close behind. So they take no memory of
the process, and the system drops them with the file, of most clips before any of them reached the disk.
"""

from __future__ import annotations

import shutil
import tempfile
import weakref
from bisect import bisect_left
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from threading import Condition, Lock, Thread
from typing import NamedTuple

import numpy as np

from monodyn.types import Frame
from monodyn.vision.clip.video import Decode, Video

MOST_BYTES = 1_600_000_000
"""Most room that the pictures of a clip may take [bytes]: 14 s of 1080x1920 at 30 a second, the usual ones of
a phone. Longer clips are decoded in each pass, up to seven times; the results are the same with any value."""
MOST_OF_ROOM = 0.25
"""Share of what is free in the folder for temporary files that they may take."""
PADDED = 1.2
"""Size of the pictures as a decoder has them, its lines padded, over that of what they show, at most."""


def decoded_once(video: Video) -> Video:
    """Begin to decode a clip; whoever looks at its pictures waits for each of them once.

    Args:
        video: The clip.

    Returns:
        The clip with the same pictures; itself where they are in memory anyway, or there is no room for them.
    """
    size = int(1.5 * PADDED * video.width * video.height * video.count)
    if video.held or size > MOST_BYTES:
        return video
    try:
        if size > MOST_OF_ROOM * shutil.disk_usage(tempfile.gettempdir()).free:
            return video
        return replace(video, decode=_Once(video))
    except OSError:
        # no folder for temporary files
        return video


class _Plane(NamedTuple):
    """How a plane lies among the bytes of its picture.

    Attributes:
        begin: Where it begins.
        shape: Rows, and bytes of each with what it is padded with.
        width: Bytes of each row that are picture.
    """

    begin: int
    shape: tuple[int, int]
    width: int

    def of(self, picture: np.ndarray) -> np.ndarray:
        """Return the plane of the bytes of a picture, a view."""
        rows, step = self.shape
        return picture[self.begin : self.begin + rows * step].reshape(rows, step)[:, : self.width]


class _Kept(NamedTuple):
    """A picture in the file.

    Attributes:
        index: Number of the frame.
        time: Its time stamp [s].
        place: Where in the file it begins.
        size: Its bytes.
        planes: Its planes, luma first.
    """

    index: int
    time: float
    place: int
    size: int
    planes: tuple[_Plane, ...]


class _Once:
    """Gives the pictures of a clip where a thread puts all of them, as ``Video.decode``.

    Args:
        video: The clip.

    Raises:
        OSError: there is no folder for temporary files.
    """

    def __init__(self, video: Video) -> None:
        self._decode, self._pictures = video.decode, _Pictures()
        # the thread knows the pictures alone, and ends when nobody can look at the clip any more
        weakref.finalize(self, self._pictures.close)
        fill = partial(_fill, self._pictures, video.decode, video.count)
        Thread(target=fill, name="decoded once", daemon=True).start()

    def __call__(self, start: int, stop: int) -> Iterator[Frame]:
        pictures, row = self._pictures, None
        while start < stop:
            row = pictures.row_of(start) if row is None else row + 1
            kept = pictures.at(row)
            if kept is None and pictures.full:
                yield from self._decode(start, stop)
            if kept is None or kept.index >= stop:
                return
            yield pictures.read(kept)
            start = kept.index + 1

    def __reduce__(self) -> tuple[Callable[[Decode], Decode], tuple[Decode]]:
        return _itself, (self._decode,)


def _itself(decode: Decode) -> Decode:
    """Return how whoever takes a clip out of a pickle decodes it."""
    return decode


def _fill(pictures: _Pictures, decode: Decode, count: int) -> None:
    """Put all pictures of a clip into the file."""
    failed: BaseException | None = None
    try:
        # to the end, even where the disk is full: what does not decode is noted there
        for frame in decode(0, count):
            pictures.add(frame)
            if pictures.closed:
                break
    except BaseException as error:
        failed = error
    pictures.end(failed)


class _Pictures:
    """Pictures in a file without a name, one after another: one thread adds them, any may read them.

    Attributes:
        full: True when the disk takes no more of them.
        closed: True when nobody can ask for them any more.
    """

    def __init__(self) -> None:
        self.full = self.closed = False
        # whoever reads or writes goes to the place first
        self._file, self._lock = tempfile.TemporaryFile(buffering=0), Lock()  # noqa: SIM115 (read for as long as the clip)
        self._kept: list[_Kept] = []
        self._size, self._page = 0, np.empty(0, np.uint8)
        self._changed, self._ended = Condition(), False
        self._failed: BaseException | None = None

    def add(self, frame: Frame) -> None:
        """Take the next picture.

        Args:
            frame: The picture.
        """
        if self.full:
            return
        planes, size = [], 0
        for plane in (frame.luma, *(frame.chroma or ())):
            # its lines stay padded as they are: kernels are compiled for arrays of this kind
            rows, width = plane.shape
            step = max(width, plane.strides[0])
            planes.append(_Plane(size, (rows, step), width))
            size += rows * step
        if len(self._page) != size:
            self._page = np.zeros(size, np.uint8)
        for plane, taken in zip((frame.luma, *(frame.chroma or ())), planes, strict=True):
            taken.of(self._page)[:] = plane
        written = 0
        with self._lock, suppress(OSError):
            if not self.closed:
                self._file.seek(self._size)
                written = self._file.write(self._page.data)
        with self._changed:
            if written == size:
                self._kept.append(_Kept(frame.index, frame.time, self._size, size, tuple(planes)))
                self._size += size
            else:
                self.full = True
            self._changed.notify_all()

    def end(self, failed: BaseException | None) -> None:
        """Take note that no more pictures come.

        Args:
            failed: What ended their decoding, if it was not their end.
        """
        with self._changed:
            self._ended, self._failed = True, failed
            self._changed.notify_all()

    def row_of(self, index: int) -> int:
        """Return which picture is the first one from a frame on, when it is there.

        Args:
            index: Number of the frame.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._over or bool(self._kept and self._kept[-1].index >= index))
            return bisect_left(self._kept, index, key=lambda kept: kept.index)

    def at(self, row: int) -> _Kept | None:
        """Return where a picture is, when it is there; None where there are not as many.

        Args:
            row: Which of them.

        Raises:
            BaseException: what ended their decoding.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._over or row < len(self._kept))
            if row < len(self._kept):
                return self._kept[row]
            if self._failed is not None:
                raise self._failed
            return None

    @property
    def _over(self) -> bool:
        """True when no more pictures come into the file."""
        return self._ended or self.full

    def read(self, kept: _Kept) -> Frame:
        """Read a picture.

        Args:
            kept: Where it is.

        Returns:
            The picture, read-only, in memory of its own.
        """
        page = np.empty(kept.size, np.uint8)
        with self._lock:
            self._file.seek(kept.place)
            taken = self._file.readinto(page.data)
        if taken != kept.size:
            raise OSError(f"frame {kept.index}: its picture was cut off where temporary files are")
        page.flags.writeable = False
        luma, *chroma = (plane.of(page) for plane in kept.planes)
        return Frame(kept.index, kept.time, luma, (chroma[0], chroma[1]) if chroma else None)

    def close(self) -> None:
        """Let the file go."""
        self.closed = True
        with self._lock:
            self._file.close()
