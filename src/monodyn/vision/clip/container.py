"""A video file through libav: time stamps of all frames first, then streaming decode by frame number."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from monodyn.errors import VideoError
from monodyn.types import Frame
from monodyn.vision.clip.orientation import Turn, square_size, turn_of, upright_planes

_NOT_CLIPS = ("hls", "concat", "dash", "sdp", "image2", "image2pipe", "tty", "webm_dash_manifest")
"""Formats that name other files or are one picture or text, by the demuxer's name."""


def read_container(path: Path, rate: float | None) -> tuple[int, int, np.ndarray, Any, list[str]]:
    """Read size and time stamps of a video file.

    Args:
        path: The file.
        rate: Frames a second [Hz] in place of the file's stamps, or None.

    Returns:
        Width and height [px], times [s] (frame,), the decode function and the notes, as ``Video`` takes them.

    Raises:
        VideoError: not a video, no picture stream, nothing decodes, no time stamps, fewer than two frames.
    """
    notes: list[str] = []
    first, size, turn = _first_picture(path)
    ticks, stamped = _stamps(path, first, notes)
    if rate is None and not stamped:
        raise VideoError(
            f"clip '{path}': expected time stamps, the file has none; give its frame rate with --rate."
        )
    if len(ticks) < 2:
        found = "one frame" if len(ticks) == 1 else "no frame"
        raise VideoError(
            f"clip '{path}': expected a clip of at least two frames, got {found}; record a longer clip."
        )
    if not turn.exact:
        notes.append(
            "The file asks for a rotation that is not a quarter turn; the nearest quarter turn is used."
        )
    if rate is None:
        times = np.array([float(tick * first["base"]) for tick in ticks.tolist()])
        _note_missing(path, times, notes)
    else:
        times = np.arange(len(ticks)) / rate
        notes.append(f"Time stamps replaced by {rate:g} frames a second.")
    clip = _Clip(path, ticks, times, first["shape"], size, turn, stamped, notes)
    width, height = (size[1], size[0]) if turn.transpose else size
    return width, height, times, clip.decode, notes


def open_stream(path: Path) -> tuple[Any, Any]:
    """Open a file and pick its picture stream.

    Args:
        path: The file.

    Returns:
        ``av`` container and video stream; the caller closes the container.

    Raises:
        VideoError: libav cannot read the file, or it holds no moving picture.
    """
    import av
    import av.error

    try:
        container = av.open(
            f"file:{path.resolve()}", options={"protocol_whitelist": "file"}, metadata_errors="ignore"
        )
    except (av.error.FFmpegError, OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise VideoError(
            f"clip '{path}': expected a video file, cannot read it as one ({why}); "
            "check the file or convert it to mp4."
        ) from None
    names = set(container.format.name.split(","))
    if names & set(_NOT_CLIPS) or any(name.endswith("_pipe") for name in names):
        container.close()
        raise VideoError(
            f"clip '{path}': expected a video file, got {_kind(names)}; "
            "give a clip or a folder of numbered pictures."
        )
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


def _first_picture(path: Path) -> tuple[dict[str, Any], tuple[int, int], Turn]:
    """Decode the first frames: stamps to compare, stored shape, square size and turn."""
    container, stream = open_stream(path)
    with container:
        aspect: Fraction | None = stream.sample_aspect_ratio
        pts: list[int | None] = []
        shape, turn = (0, 0), Turn()
        for frame in pictures(container, stream):
            if not pts:
                shape, turn = (frame.width, frame.height), turn_of(frame)
            pts.append(frame.pts)
            if len(pts) == 4:
                break
        base = stream.time_base
        stampless = _stampless(container.format)
    if not pts:
        raise VideoError(
            f"clip '{path}': expected pictures, none of them decodes; the file is empty or damaged."
        )
    first = {"pts": pts, "shape": shape, "base": base, "stampless": stampless}
    return first, square_size(*shape, aspect), turn


def _stampless(form: Any) -> bool:
    flags = getattr(form, "flags", 0)
    return bool(int(flags) & 0x0080)


def pictures(container: Any, stream: Any, faults: list[int] | None = None) -> Iterator[Any]:
    """Decode every packet that decodes.

    Args:
        container: Open ``av`` container.
        stream: Its picture stream.
        faults: One entry is added for every packet or picture that is damaged.
    """
    import av
    import av.error

    faults = [] if faults is None else faults
    packets = container.demux(stream)
    while True:
        try:
            packet = next(packets)
        except (StopIteration, EOFError):
            return
        except av.error.FFmpegError:
            faults.append(-1)
            return
        try:
            decoded = packet.decode()
        except EOFError:
            return
        except av.error.FFmpegError:
            faults.append(packet.pts or 0)
            continue
        for frame in decoded:
            if getattr(frame, "is_corrupt", False):
                faults.append(frame.pts or 0)
            else:
                yield frame


def _stamps(path: Path, first: dict[str, Any], notes: list[str]) -> tuple[np.ndarray, bool]:
    """Return the stamps [ticks] in display order (frame,) and whether the file has any."""
    if first["stampless"] or None in first["pts"]:
        count = sum(1 for _ in _all_pictures(path))
        return np.arange(count, dtype=np.int64), False
    packets = _packet_stamps(path)
    if packets is None or not set(first["pts"]) <= set(packets):
        shown = [frame.pts for frame in _all_pictures(path)]
        if None in shown:
            return np.arange(len(shown), dtype=np.int64), False
        ticks = np.maximum.accumulate(np.array(shown, dtype=np.int64))
    else:
        ticks = np.sort(np.array(packets, dtype=np.int64))
    kept = np.concatenate([[True], np.diff(ticks) > 0]) if len(ticks) else np.zeros(0, bool)
    dropped = int(np.sum(~kept))
    if dropped:
        notes.append(f"{dropped} of {len(ticks)} frames dropped: their time stamps do not increase.")
    return ticks[kept], True


def _packet_stamps(path: Path) -> list[int] | None:
    """Read the stamps of all packets without decoding; None where a packet has none."""
    import av
    import av.error

    container, stream = open_stream(path)
    found: list[int] = []
    with container:
        packets = container.demux(stream)
        while True:
            try:
                packet = next(packets)
            except (StopIteration, EOFError, av.error.FFmpegError):
                return found
            if packet.size == 0 or getattr(packet, "is_discard", False):
                continue
            if packet.pts is None:
                return None
            found.append(packet.pts)


def _all_pictures(path: Path) -> Iterator[Any]:
    container, stream = open_stream(path)
    with container:
        yield from pictures(container, stream)


def _note_missing(path: Path, times: np.ndarray, notes: list[str]) -> None:
    """Say when the file announces more than it holds."""
    container, stream = open_stream(path)
    with container:
        announced = stream.frames
        duration = float(container.duration) / 1e6 if container.duration else 0.0
        start = float(container.start_time) / 1e6 if container.start_time else 0.0
        alone = len(container.streams) == 1
    step = float(np.median(np.diff(times)))
    if announced > len(times) + 1:
        notes.append(f"The file announces {announced} frames but holds {len(times)}; it is cut short.")
    elif alone and duration > times[-1] - start + max(3 * step, 0.05 * duration):
        notes.append(
            f"The file announces {duration:.2f} s but ends at {times[-1] - start:.2f} s; it is cut short."
        )


class _Clip:
    """One file with its stamps; decodes any range by frame number."""

    def __init__(
        self,
        path: Path,
        ticks: np.ndarray,
        times: np.ndarray,
        shape: tuple[int, int],
        size: tuple[int, int],
        turn: Turn,
        stamped: bool,
        notes: list[str],
    ) -> None:
        self.path, self.ticks, self.times, self.notes = path, ticks, times, notes
        self.shape, self.size, self.turn, self.stamped = shape, size, turn, stamped
        self.numbers = {int(tick): number for number, tick in enumerate(ticks)}

    def decode(self, start: int, stop: int) -> Iterator[Frame]:
        """Yield frames ``start`` to ``stop - 1`` that decode; says in the notes what a whole pass misses."""
        if start >= stop:
            return
        given = 0
        for frame in self._from(start):
            if frame.index >= stop:
                break
            if frame.index >= start:
                given += 1
                yield frame
        if start == 0 and stop == len(self.ticks) and given < stop:
            note = f"{stop - given} of {stop} frames cannot be decoded; {given} are used."
            if note not in self.notes:
                self.notes.append(note)

    def _from(self, start: int) -> Iterator[Frame]:
        """Yield decoded frames from a key frame at or before ``start``."""
        if start > 0 and self.stamped:
            frames = self._run(int(self.ticks[start]))
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
                index = self.numbers.get(picture.pts) if self.stamped else position
                if index is None or index <= last or (picture.width, picture.height) != self.shape:
                    continue
                last = index
                luma, chroma = upright_planes(picture, reformatter, self.size, self.turn)
                yield Frame(index, float(self.times[index]), luma, chroma)
