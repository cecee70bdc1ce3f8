"""A video file through libav: time stamps of all frames first, then streaming decode by frame number.

The stamps come from the packets, which costs no decoding. A packet that carries no stamp, or first pictures
whose stamps are not among the packets', mean that the container cannot be trusted: then the file is decoded
once for the stamps of what is shown.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from monodyn.arrays import usual_step
from monodyn.errors import VideoError
from monodyn.types import Frame
from monodyn.vision.clip.capture import stretch_of
from monodyn.vision.clip.orientation import Turn, square_size, turn_of, upright_planes
from monodyn.vision.clip.stamps import clock_of, without_pauses

_NOT_CLIPS = ("hls", "concat", "dash", "sdp", "image2", "image2pipe", "tty", "webm_dash_manifest")
"""Formats that name other files or are one picture or text, by the demuxer's name."""


MOST_ASPECT = 8
"""Most width of a pixel over its height, and height over width: no format has half of that."""
OPENING = 4
"""Pictures that are decoded to compare their stamps with those of the packets."""
COARSE = 0.01
"""Rounding of the time stamps that is worth a note, as a share of the time between two frames."""
NO_TIMESTAMPS = 0x0080
"""libav's flag for formats without stamps (``AVFMT_NOTIMESTAMPS``)."""


class _Layout(NamedTuple):
    """How the pictures of a file are stored.

    Attributes:
        shape: Stored width and height [px]; a picture of another shape is left out.
        size: Width and height in square pixels, before the turn [px].
        turn: What brings a picture upright.
    """

    shape: tuple[int, int]
    size: tuple[int, int]
    turn: Turn


class _Opening(NamedTuple):
    """What the first pictures of a file show.

    Attributes:
        pts: Their stamps, as the decoder gives them; None where it gives none.
        base: Length of a tick [s].
        rates: Rates that the file states [Hz].
        stampless: True when the format stores no stamps, so that those of the decoder are made up.
        layout: How the pictures are stored.
        tags: Keys of the file and of its picture stream, with their values.
    """

    pts: list[int | None]
    base: Fraction
    rates: tuple[Fraction, ...]
    stampless: bool
    layout: _Layout
    tags: dict[str, str]


class _Stamps(NamedTuple):
    """Time stamps of all frames in the order of display.

    Attributes:
        ticks: Stamps of the file, increasing, int64 (frame,).
        times: Times [s], (frame,).
        own: True when they are the file's own, so that a picture finds its number by its stamp.
    """

    ticks: np.ndarray
    times: np.ndarray
    own: bool


def read_container(
    path: Path, rate: float | None
) -> tuple[int, int, np.ndarray, Any, list[str], float, float]:
    """Read size and time stamps of a video file.

    Args:
        path: The file.
        rate: Frames a second [Hz] in place of the file's stamps, or None.

    Returns:
        Width and height [px], times [s] (frame,), the decode function, the notes, what the times are
        rounded to [s] and by how much the stamps were stretched, as ``Video`` takes them.

    Raises:
        VideoError: The file has no time stamps, or fewer than two frames.
    """
    notes: list[str] = []
    opening = _first_pictures(path)
    ticks, own = _ticks(path, opening, notes)
    if rate is None and not own:
        raise VideoError(
            f"clip '{path}': expected time stamps, the file has none; give its frame rate with --rate."
        )
    if len(ticks) < 2:
        raise VideoError(
            f"clip '{path}': expected a clip of at least two frames, got one frame; record a longer clip."
        )
    layout = opening.layout
    if not layout.turn.exact:
        notes.append(
            "The file requires a rotation that is not a quarter turn; the nearest quarter turn is used."
        )
    if rate is None:
        shown = without_pauses(ticks, float(opening.base), notes)
        times, tick = clock_of(shown, opening.base, opening.rates)
        if tick > COARSE * usual_step(times):
            notes.append(
                f"The time stamps are rounded to {1e3 * tick:.3g} ms and follow no constant rate; the "
                "rounding counts as noise."
            )
        _note_missing(path, times + (ticks[-1] - shown[-1]) * float(opening.base), notes)
        stretch = stretch_of(path, opening.tags, 1.0 / usual_step(times), notes)
        times, tick = times / stretch, tick / stretch
    else:
        times, tick, stretch = np.arange(len(ticks)) / rate, 0.0, 1.0
        notes.append(f"Time stamps replaced by {rate:g} frames a second.")
    clip = _Clip(path, layout, _Stamps(ticks, times, own), notes)
    width, height = layout.size[::-1] if layout.turn.transpose else layout.size
    return width, height, times, clip.decode, notes, tick, stretch


def opened(address: str, **how: Any) -> Any:
    """Open a file or a stream, in whatever code its titles and the like are.

    Args:
        address: Where it is, in words of libav.
        **how: Further arguments of ``av.open``.

    Returns:
        The ``av`` container.
    """
    import av

    # from 19 on av takes texts as they come, and has no word for it
    if int(av.__version__.partition(".")[0]) < 19:
        how["metadata_errors"] = "ignore"
    return av.open(address, **how)


def open_stream(path: Path) -> tuple[Any, Any]:
    """Open a file and pick its picture stream.

    Args:
        path: The file.

    Returns:
        ``av`` container and video stream; the caller closes the container.

    Raises:
        VideoError: The file cannot be read as a video, or it holds no moving picture.
    """
    import av.error

    try:
        container = opened(f"file:{path.resolve()}", options={"protocol_whitelist": "file"})
    except (av.error.FFmpegError, OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise VideoError(
            f"clip '{path}': expected a video file, cannot read it as one ({why}); "
            "check the file or convert it to mp4."
        ) from None
    # a playlist would open files that the user has not named
    names = set(container.format.name.split(","))
    if names & set(_NOT_CLIPS) or any(name.endswith("_pipe") for name in names):
        container.close()
        raise VideoError(
            f"clip '{path}': expected a video file, got {_kind(names)}; "
            "give a clip or a folder of numbered pictures."
        )
    # the cover picture of a sound file is a video stream to libav
    streams = [s for s in container.streams.video if "attached_pic" not in str(s.disposition)]
    if not streams:
        found = "only sound" if container.streams.audio else "no picture stream"
        container.close()
        raise VideoError(
            f"clip '{path}': expected a video, the file holds {found}; give a file with pictures."
        )
    streams[0].thread_type = "AUTO"
    return container, streams[0]


def _kind(names: set[str]) -> str:
    if any(name.endswith("_pipe") or name.startswith("image2") for name in names):
        return "a single picture"
    if "tty" in names:
        return "text"
    return f"a list of other files ({', '.join(sorted(names))})"


def _first_pictures(path: Path) -> _Opening:
    """Decode the first pictures: their stamps, how they are stored, and whether the format has stamps."""
    container, stream = open_stream(path)
    with container:
        aspect: Fraction | None = stream.sample_aspect_ratio
        pts: list[int | None] = []
        shape, turn = (0, 0), Turn()
        for frame in pictures(container, stream):
            if not pts:
                shape, turn = (frame.width, frame.height), turn_of(frame)
            pts.append(frame.pts)
            if len(pts) == OPENING:
                break
        base = stream.time_base
        rates = tuple(rate for rate in (stream.base_rate, stream.average_rate) if rate)
        stampless = bool(int(getattr(container.format, "flags", 0)) & NO_TIMESTAMPS)
        tags = {**stream.metadata, **container.metadata}
    if not pts:
        raise VideoError(
            f"clip '{path}': expected pictures, none of them decodes; the file is empty or damaged."
        )
    if aspect and not 1.0 / MOST_ASPECT <= aspect <= MOST_ASPECT:
        raise VideoError(
            f"clip '{path}': expected pixels at most {MOST_ASPECT} times as wide as high, or as high as "
            f"wide, got {aspect.numerator}:{aspect.denominator}; correct the file's sample aspect ratio, for "
            "example as made by ffmpeg -i CLIP -vf setsar=1 FIXED.mp4."
        )
    return _Opening(pts, base, rates, stampless, _Layout(shape, square_size(*shape, aspect), turn), tags)


def pictures(container: Any, stream: Any) -> Iterator[Any]:
    """Decode every packet that decodes; what is damaged is left out.

    Args:
        container: Open ``av`` container.
        stream: Its picture stream.

    Yields:
        ``av.VideoFrame``, in the order of display.
    """
    import av.error

    for packet in _packets(container, stream):
        try:
            decoded = packet.decode()
        except EOFError:
            return
        except av.error.FFmpegError:
            continue
        yield from (frame for frame in decoded if not getattr(frame, "is_corrupt", False))


def _packets(container: Any, stream: Any) -> Iterator[Any]:
    """Yield the packets of a stream: a damaged container ends at the damage, as does a whole one."""
    import av.error

    with contextlib.suppress(EOFError, av.error.FFmpegError):
        yield from container.demux(stream)


def _ticks(path: Path, opening: _Opening, notes: list[str]) -> tuple[np.ndarray, bool]:
    """Return the stamps [ticks] in display order (frame,) and whether they are the file's own."""
    if opening.stampless or None in opening.pts:
        count = sum(1 for _ in _all_pictures(path))
        return np.arange(count, dtype=np.int64), False
    packets = _packet_stamps(path)
    if packets is None or not set(opening.pts) <= set(packets):
        shown = [frame.pts for frame in _all_pictures(path)]
        if None in shown:
            return np.arange(len(shown), dtype=np.int64), False
        # pictures come in the order of display, so a stamp that falls is an error: it is dropped below
        ticks = np.maximum.accumulate(np.array(shown, dtype=np.int64))
    else:
        # packets come in the order of decoding, in which pictures that others are predicted from come first
        ticks = np.sort(np.array(packets, dtype=np.int64))
    kept = np.concatenate([[True], np.diff(ticks) > 0]) if len(ticks) else np.zeros(0, bool)
    dropped = int(np.sum(~kept))
    if dropped:
        notes.append(f"{dropped} of {len(ticks)} frames dropped: their time stamps do not increase.")
    return ticks[kept], True


def _packet_stamps(path: Path) -> list[int] | None:
    """Read the stamps of all packets without decoding; None where a packet has none."""
    container, stream = open_stream(path)
    found: list[int] = []
    with container:
        for packet in _packets(container, stream):
            # an empty packet ends the stream; one to be discarded is decoded for others and never shown
            if packet.size == 0 or getattr(packet, "is_discard", False):
                continue
            if packet.pts is None:
                return None
            found.append(packet.pts)
    return found


def _all_pictures(path: Path) -> Iterator[Any]:
    container, stream = open_stream(path)
    with container:
        yield from pictures(container, stream)


def _note_missing(path: Path, times: np.ndarray, notes: list[str]) -> None:
    """Note when the file announces more than it holds."""
    container, stream = open_stream(path)
    with container:
        announced, held = stream.frames, len(times)
        if announced > held + 1:
            # those that an edit list hides, or whose stamps do not increase, are there
            held = sum(packet.size > 0 for packet in _packets(container, stream))
        duration = float(container.duration) / 1e6 if container.duration else 0.0
        start = float(container.start_time) / 1e6 if container.start_time else 0.0
        alone = len(container.streams) == 1
    step = usual_step(times)
    # some formats count their duration from time 0, others from the first stamp
    end = max(times[-1], times[-1] - start)
    # the duration is that of the longest stream: with sound it gives no information about the pictures
    if announced > held + 1:
        notes.append(f"The file announces {announced} frames but holds {held}; it may be cut short.")
    elif alone and duration > end + max(3 * step, 0.05 * duration):
        notes.append(f"The file announces {duration:.2f} s but ends at {end:.2f} s; it may be cut short.")


class _Clip:
    """One file with its stamps; decodes any range by frame number."""

    def __init__(self, path: Path, layout: _Layout, stamps: _Stamps, notes: list[str]) -> None:
        self.path, self.layout, self.stamps, self.notes = path, layout, stamps, notes
        self.numbers = {int(tick): number for number, tick in enumerate(stamps.ticks)}

    def decode(self, start: int, stop: int) -> Iterator[Frame]:
        """Yield frames ``start`` to ``stop - 1`` that decode; a whole pass notes how many it misses.

        Args:
            start: First frame number.
            stop: Frame number after the last one.
        """
        if start >= stop:
            return
        given = 0
        for frame in self._from(start):
            if frame.index >= stop:
                break
            if frame.index >= start:
                given += 1
                yield frame
        if start == 0 and stop == len(self.stamps.ticks) and given < stop:
            note = f"{stop - given} of {stop} frames cannot be decoded; {given} are used."
            if note not in self.notes:
                self.notes.append(note)

    def _from(self, start: int) -> Iterator[Frame]:
        """Yield decoded frames from a key frame at or before ``start``."""
        # A seek leads to the key frame before the stamp, but not in every container: where it comes out
        # behind the frame, or nowhere, the file is decoded from its start.
        if start > 0 and self.stamps.own:
            frames = self._run(int(self.stamps.ticks[start]))
            first = next(frames, None)
            if first is not None and first.index <= start:
                yield first
                yield from frames
                return
        yield from self._run(None)

    def _run(self, tick: int | None) -> Iterator[Frame]:
        """Decode from the key frame before ``tick`` (None: from the start), numbering by stamp."""
        import av.error
        from av.video.reformatter import VideoReformatter

        layout = self.layout
        reformatter, last, position = VideoReformatter(), -1, -1
        container, stream = open_stream(self.path)
        with contextlib.closing(container):
            if tick is not None:
                try:
                    container.seek(tick, stream=stream, backward=True)
                except av.error.FFmpegError:
                    return
            for picture in pictures(container, stream):
                position += 1
                # A number belongs to a stamp and not to a count of pictures: so it means the same in every
                # pass, whatever the decoder drops after a seek or at damage.
                index = self.numbers.get(picture.pts) if self.stamps.own else position
                if index is None or index <= last or (picture.width, picture.height) != layout.shape:
                    continue
                last = index
                luma, chroma = upright_planes(picture, reformatter, layout.size, layout.turn)
                yield Frame(index, float(self.stamps.times[index]), luma, chroma)
