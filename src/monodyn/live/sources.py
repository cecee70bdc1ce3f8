"""Where frames come from: a camera, a stream, a file, raw frames on a pipe, pictures of a program.

All of them become one noun, a size and a way to iterate over frames with increasing numbers. What belongs to
one kind alone (a stream that is opened again, a file at its own pace) happens here.
"""

from __future__ import annotations

import itertools
import os
import select
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from numbers import Integral
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from monodyn.errors import SettingsError, VideoError
from monodyn.live.settings import LiveSettings
from monodyn.numbers import is_whole
from monodyn.types import Frame
from monodyn.vision.clip.orientation import Turn, upright_planes
from monodyn.vision.clip.video import Video, read
from monodyn.vision.settings import LEAST_SIDE

USUAL_RATE = 30.0
"""Frames a second of what states no rate [Hz]."""
LAST_CAMERA = 99
"""Highest number of a camera: with those above it OpenCV means other ways to the same ones."""
MOST_TOLD, DIGITS = 10**9, 100
"""Numbers from here on are not written out, and digits after these do not count."""
BACK_OFF = (0.1, 5.0)
"""First and longest wait before a stream is opened again [s]; each is twice the one before."""
SCHEMES = ("rtsp", "rtsps", "rtmp", "http", "https", "udp", "tcp", "rtp", "srt")
"""What the address of a stream may begin with."""
PROTOCOLS = "rtsp,rtsps,rtp,srtp,rtmp,http,https,tcp,tls,udp,srt,crypto"
"""What such a stream may open in turn: no file of this machine."""
OPENS = 5.0
"""Seconds within which a stream has to answer."""
TICK = 0.2
"""Longest wait for bytes before it is looked whether they are still wanted [s]."""
SAME_SHAPE = 0.01
"""Share by which the shape of a frame of another size may differ for it to be the same picture."""


@dataclass(frozen=True, eq=False)
class Source:
    """Where frames come from.

    Attributes:
        name: What it is called, for people.
        width: Width of its frames [px].
        height: Height of its frames [px].
        opened: Begins to give frames, with increasing numbers.
        live: True where frames come whether or not anybody takes them; one that waits loses none.
        direct: True where a frame may depend on what was done with the ones before: none is read ahead.
        video: The clip, where it is a file.
        remarks: Where notes are collected while frames come.
        closing: Set when no more frames are wanted: whatever waits for the next one stops waiting.
    """

    name: str
    width: int
    height: int
    opened: Callable[[], Iterator[Frame]] = field(repr=False)
    live: bool
    direct: bool = False
    video: Video | None = None
    remarks: list[str] = field(default_factory=list)
    closing: threading.Event = field(default_factory=threading.Event, repr=False)


Pictures = Iterable[Any]
"""Frames of a program: `Frame`, or uint8 arrays (height, width) or (height, width, 3)."""


def open_source(
    source: int | str | Path | Pictures, settings: LiveSettings | None = None, *, rate: float | None = None,
    whole: bool = False,
) -> Source:  # fmt: skip
    """Open what gives the frames.

    Args:
        source: Number of a camera, address of a stream, a video file or folder of pictures, ``-`` for raw
            frames on the standard input, or an iterable of pictures.
        settings: How it is read.
        rate: Frames a second [Hz] in place of the time stamps of the source.
        whole: Take the pictures of a file at their full size, however large, as ``monodyn.read`` does.

    Returns:
        The source; its first frame has been looked at where that alone tells its size.

    Raises:
        VideoError: it cannot be opened, or gives no picture.
        SettingsError: raw frames without a size or without a standard input, or no number of a camera.
    """
    settings = settings or LiveSettings()
    if isinstance(source, str) and source == "-":
        return raw_frames(_standard_input(), settings, rate or USUAL_RATE)
    if isinstance(source, (int, Integral)) or (isinstance(source, str) and is_whole(source)):
        # Python reads no number of thousands of digits; far fewer are too many here
        return camera(int(source[:DIGITS] if isinstance(source, str) else source), rate)
    if isinstance(source, str) and source.partition("://")[0] in SCHEMES:
        return stream_at(source, settings, rate)
    if isinstance(source, (str, Path)):
        return file_at(Path(source), settings, rate, whole=whole)
    return pictures_of(source, rate or USUAL_RATE)


def file_at(path: Path, settings: LiveSettings, rate: float | None, *, whole: bool = False) -> Source:
    """Return the frames of a clip, as fast as they are taken or at the pace of their time stamps.

    Args:
        path: Video file or folder of pictures.
        settings: Says which pace.
        rate: Frames a second [Hz] in place of its stamps, or None.
        whole: Take large pictures at their full size.
    """
    video = read(path, rate=rate, whole=whole)
    paced, closing = settings.pace == "real", threading.Event()
    return Source(
        path.name, video.width, video.height,
        (lambda: in_time(video.frames(), closing)) if paced else video.frames,
        live=paced, video=video, remarks=video.remarks, closing=closing,
    )  # fmt: skip


def in_time(frames: Iterable[Frame], closing: threading.Event) -> Iterator[Frame]:
    """Yield frames when it is their time, the first at once.

    Args:
        frames: The frames, in the order of time.
        closing: Ends the waiting, and the frames.
    """
    begun = None
    for frame in frames:
        begun = time.monotonic() - frame.time if begun is None else begun
        if closing.wait(max(begun + frame.time - time.monotonic(), 0.0)):
            return
        yield frame


def pictures_of(pictures: Pictures, rate: float) -> Source:
    """Return the pictures of a program.

    Args:
        pictures: `Frame`, or uint8 arrays (height, width), grey, or (height, width, 3), red, green, blue.
        rate: Pictures a second where they have no time stamps [Hz].

    Raises:
        VideoError: there is none, or one is no picture, or of another shape than the first.
    """
    each = iter(pictures)
    first = next(each, None)
    if first is None:
        raise VideoError("stream: expected pictures, got none; give at least a few seconds of motion.")
    planes = _Planes()
    begin = first if isinstance(first, Frame) else planes.frame(0, 0.0, first)
    height, width = begin.luma.shape
    _large_enough("stream", width, height)

    def frames() -> Iterator[Frame]:
        yield begin
        for number, picture in enumerate(each, start=1):
            frame = picture if isinstance(picture, Frame) else planes.frame(number, number / rate, picture)
            sized = _sized(frame, width, height)
            if sized is None:
                rows, columns = frame.luma.shape
                raise VideoError(
                    f"stream: expected pictures of {width}x{height} px, as the first, got {columns}x{rows} "
                    f"at {frame.time:.2f} s; give all of them in one shape."
                )
            yield sized

    return Source("pictures", width, height, frames, live=False, direct=True)


def raw_frames(pipe: BinaryIO, settings: LiveSettings, rate: float) -> Source:
    """Return raw frames on a pipe, one after the other.

    Args:
        pipe: Where they come from.
        settings: Their size, and how they store their pixels.
        rate: Frames a second [Hz].

    Raises:
        SettingsError: their size is not given, or has no such pixels.
    """
    if settings.size is None:
        raise SettingsError(
            "live.size: expected width and height of raw frames, got none; give --live.size W,H and "
            "--live.pixels."
        )
    (width, height), kind = settings.size, settings.pixels
    if kind == "yuv420p" and (width % 2 or height % 2):
        raise SettingsError(f"live.size: expected an even size for yuv420p, got {width},{height}.")
    shapes = {"gray": (height, width), "yuv420p": (height * 3 // 2, width)}
    shape = shapes.get(kind, (height, width, 3))
    remarks, closing = [], threading.Event()

    def frames() -> Iterator[Frame]:
        planes, whole = _Planes(), int(np.prod(shape))
        for number in itertools.count():
            data = _taken(pipe, whole, closing)
            if len(data) < whole:
                if data and not closing.is_set():
                    remarks.append("The last frame on the pipe is cut short; it is left out.")
                return
            yield planes.frame(number, number / rate, np.frombuffer(data, np.uint8).reshape(shape), kind)

    live = settings.pace == "real"
    return Source("standard input", width, height, frames, live=live, remarks=remarks, closing=closing)


def _standard_input() -> BinaryIO:
    """Return the standard input; there is none where the caller has closed it, or has put a text there."""
    pipe = getattr(sys.stdin, "buffer", None)
    if pipe is None:
        raise SettingsError(
            "source '-': expected raw frames on the standard input, got one that is closed; send them "
            "through a pipe."
        )
    return pipe


def _taken(pipe: BinaryIO, count: int, closing: threading.Event) -> bytes:
    """Return so many bytes of a pipe; fewer where it ends, or where they are no longer wanted."""
    try:
        number = pipe.fileno()
    # a pipe of a program
    except (AttributeError, OSError):
        return pipe.read(count)
    # past Python's own buffer, whose lock a thread that waits in it would keep to the end of the program
    data = bytearray()
    while len(data) < count and not closing.is_set():
        # what is no file to the system's ``select`` (Windows) is waited for as long as it takes
        if os.name == "posix" and not select.select([number], [], [], TICK)[0]:
            continue
        part = os.read(number, min(count - len(data), 1 << 20))
        if not part:
            break
        data += part
    return bytes(data)


def camera(number: int, rate: float | None) -> Source:
    """Return the frames of a camera of this machine.

    Args:
        number: Which one, from 0.
        rate: Frames a second that it is asked for [Hz]; None takes what it gives.

    Raises:
        SettingsError: no camera can have that number.
        VideoError: there is no such camera, or it gives no picture.
    """
    if not 0 <= number <= LAST_CAMERA:
        got = number if abs(number) < MOST_TOLD else "a longer one"
        raise SettingsError(f"camera: expected a number from 0 to {LAST_CAMERA}, got {got}; give another.")
    import cv2

    # what OpenCV prints of a camera that is not there is not for people
    before = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        device = cv2.VideoCapture(number)
    finally:
        cv2.utils.logging.setLogLevel(before)
    if rate is not None:
        device.set(cv2.CAP_PROP_FPS, rate)
    shown, picture = device.read()
    if not shown:
        device.release()
        raise VideoError(
            f"camera {number}: expected pictures, got none; check that it is connected and that no other "
            "program has it."
        )

    closing = threading.Event()

    def frames() -> Iterator[Frame]:
        planes, begun, pending = _Planes(), time.monotonic(), picture
        try:
            for index in itertools.count():
                if closing.is_set():
                    return
                yield planes.frame(index, time.monotonic() - begun, pending, "bgr24")
                shown, pending = device.read()
                if not shown:
                    return
        finally:
            device.release()

    height, width = picture.shape[:2]
    return Source(f"camera {number}", width, height, frames, live=True, closing=closing)


def stream_at(address: str, settings: LiveSettings, rate: float | None) -> Source:
    """Return the frames of a stream; one that drops is opened again, with longer and longer waits.

    Args:
        address: Its address.
        settings: After how long without a frame it counts as gone.
        rate: Frames a second [Hz] in place of its stamps, or None.

    Raises:
        VideoError: it cannot be opened, or gives no picture.
    """
    remarks, closing = [], threading.Event()
    first = next(_received(address, rate, _Planes()), None)
    if first is None:
        raise VideoError(
            f"stream '{address}': expected pictures, got none within {OPENS:g} s; check the address."
        )
    height, width = first.luma.shape
    _large_enough(f"stream '{address}'", width, height)

    def note(text: str) -> None:
        if text not in remarks:
            remarks.append(text)

    def frames() -> Iterator[Frame]:
        planes, number, wait, last = _Planes(), itertools.count(), BACK_OFF[0], time.monotonic()
        broken = False
        while not closing.is_set() and time.monotonic() - last < settings.patience:
            for frame in _received(address, rate, planes):
                sized = _sized(frame, width, height)
                if closing.is_set() or time.monotonic() - last > settings.patience:
                    break
                if sized is None:
                    note(f"The stream '{address}' has pictures of another shape, which are left out.")
                    continue
                if broken:
                    note(f"The stream '{address}' broke off; it was opened again.")
                broken, wait, last = False, BACK_OFF[0], time.monotonic()
                yield replace(sized, index=next(number))
            broken = True
            closing.wait(min(wait, max(settings.patience - (time.monotonic() - last), 0.0)))
            wait = min(2.0 * wait, BACK_OFF[1])

    return Source(address, width, height, frames, live=True, remarks=remarks, closing=closing)


def _received(address: str, rate: float | None, planes: _Planes) -> Iterator[Frame]:
    """Yield the frames of one connection, until it ends, by the stamps of the stream."""
    import av.error

    from monodyn.vision.clip.container import opened, pictures

    try:
        container = opened(address, timeout=OPENS, options={"protocol_whitelist": PROTOCOLS})
    except (av.error.FFmpegError, OSError, ValueError):
        return
    with container:
        if not container.streams.video:
            return
        stream = container.streams.video[0]
        stream.thread_type = "SLICE"
        for number, picture in enumerate(pictures(container, stream)):
            stamp = picture.time if picture.time is not None else number / USUAL_RATE
            yield planes.of(number, number / rate if rate else float(stamp), picture)


def _sized(frame: Frame, width: int, height: int) -> Frame | None:
    """Return a frame at the size of the first one; None for one of another shape."""
    rows, columns = frame.luma.shape
    if (columns, rows) == (width, height):
        return frame
    if abs(columns * height / (rows * width) - 1.0) > SAME_SHAPE:
        return None
    import cv2

    half = ((width + 1) // 2, (height + 1) // 2)
    luma = cv2.resize(frame.luma, (width, height), interpolation=cv2.INTER_AREA)
    chroma = frame.chroma
    if chroma is not None:
        chroma = (cv2.resize(chroma[0], half), cv2.resize(chroma[1], half))
    return replace(frame, luma=luma, chroma=chroma)


def _large_enough(name: str, width: int, height: int) -> None:
    if min(width, height) < LEAST_SIDE:
        raise VideoError(
            f"{name}: expected pictures of at least {LEAST_SIDE}x{LEAST_SIDE} px, got {width}x{height}."
        )


class _Planes:
    """Turns arrays and decoded pictures into frames; keeps the converter between them."""

    def __init__(self) -> None:
        from av.video.reformatter import VideoReformatter

        self._reformatter = VideoReformatter()

    def frame(self, number: int, stamp: float, pixels: Any, kind: str = "") -> Frame:
        """Return the frame of an array: its number, its time stamp [s], uint8 pixels, how they are stored."""
        import av

        pixels = np.ascontiguousarray(pixels)
        usual = {2: "gray", 3: "rgb24"}.get(pixels.ndim, "")
        if pixels.dtype != np.uint8 or not usual or (pixels.ndim == 3 and pixels.shape[2] != 3):
            raise VideoError(
                "stream: expected pictures as uint8 arrays (height, width) or (height, width, 3), got "
                f"{pixels.dtype} {pixels.shape}."
            )
        return self.of(number, stamp, av.VideoFrame.from_ndarray(pixels, format=kind or usual))

    def of(self, number: int, stamp: float, picture: Any) -> Frame:
        """Return the frame of a decoded picture."""
        size = (picture.width, picture.height)
        return Frame(number, stamp, *upright_planes(picture, self._reformatter, size, Turn()))
