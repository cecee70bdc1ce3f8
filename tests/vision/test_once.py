"""A clip that is decoded once: the same pictures in every pass, whatever the disk and the decoder do."""

from __future__ import annotations

import gc
import itertools
import pickle
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.types import Frame
from monodyn.vision.clip import container, once
from monodyn.vision.clip.once import decoded_once
from monodyn.vision.clip.video import Video, read
from support import ClipMaker


def same(one: Frame, other: Frame) -> bool:
    """Return whether two frames are the same, and of one kind for what is compiled."""
    planes = [(frame.luma, *(frame.chroma or ())) for frame in (one, other)]
    return (one.index, one.time, len(planes[0])) == (other.index, other.time, len(planes[1])) and all(
        np.array_equal(a, b) and a.strides == b.strides and a.flags.writeable == b.flags.writeable
        for a, b in zip(*planes, strict=True)
    )


def counted(made: list[int], count: int = 20, missing: tuple[int, ...] = ()) -> Video:
    """Return a clip of random pictures that notes which of them it makes."""

    def decode(start: int, stop: int) -> Iterator[Frame]:
        for k in range(start, stop):
            if k not in missing:
                made.append(k)
                luma = np.random.default_rng(k).integers(0, 255, (48, 64), np.uint8)
                luma.flags.writeable = False
                yield Frame(k, k / 30, luma)

    return Video(Path("drawn"), 64, 48, np.arange(count) / 30, decode)


def failing(monkeypatch: pytest.MonkeyPatch, write: Callable[[Any, Any], int]) -> None:
    """Let the file for the pictures be one whose disk takes what ``write`` takes."""

    def opened(**how: Any) -> Any:
        file = tempfile.TemporaryFile(**how)  # noqa: SIM115 (it is given on)
        return SimpleNamespace(
            write=lambda data: write(file, data), seek=file.seek, readinto=file.readinto, close=file.close
        )

    monkeypatch.setattr(
        once, "tempfile", SimpleNamespace(TemporaryFile=opened, gettempdir=tempfile.gettempdir)
    )


def threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name == "decoded once"]


def until(true: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 20.0
    while not true() and time.monotonic() < deadline:
        time.sleep(0.001)
    assert true()


@pytest.mark.parametrize(
    "how",
    [{}, {"size": (66, 50)}, {"size": (128, 64)}, {"pixel": "gray", "name": "clip.mkv"}, {"rotation": 90},
     {"full_range": True}, {"name": "clip.gif"}],
    ids=str,
)  # fmt: skip
def test_every_pass_gives_the_pictures_of_the_clip(make_clip: ClipMaker, how: dict[str, Any]) -> None:
    video = read(make_clip(**how))
    kept = decoded_once(video)
    assert kept is not video
    for first, stop in ((3, 9), (0, 12), (11, 12), (4, 4), (0, 12)):
        shown, wanted = list(kept.frames(first, stop)), list(video.frames(first, stop))
        assert len(shown) == len(wanted) == stop - first
        assert all(map(same, shown, wanted))
    assert kept.notes == video.notes


def test_a_picture_is_decoded_once_however_many_look_at_it() -> None:
    made: list[int] = []
    kept = decoded_once(counted(made))
    with ThreadPoolExecutor(4) as pool:
        passes = list(pool.map(lambda _: [frame.index for frame in kept.frames()], range(8)))
    assert passes == [list(range(20))] * 8
    assert [frame.index for frame in kept.frames(7, 9)] == [7, 8]
    assert made == list(range(20))


def test_a_pass_follows_the_decoder_and_waits_for_it() -> None:
    free, video = threading.Semaphore(0), counted([])

    def decode(start: int, stop: int) -> Iterator[Frame]:
        for frame in video.decode(start, stop):
            free.acquire()
            yield frame

    frames = decoded_once(replace(video, decode=decode)).decode(2, 5)
    with ThreadPoolExecutor(1) as pool:
        for index in (2, 3, 4):
            waiting = pool.submit(next, frames)
            time.sleep(0.02)
            assert not waiting.done()
            for _ in range(3 if index == 2 else 1):
                free.release()
            assert waiting.result(20.0).index == index
    # the pass ends where its range does, without a look at what comes after
    free.release()
    assert next(frames, None) is None
    for _ in range(20):
        free.release()


def test_frames_that_do_not_decode_stay_out() -> None:
    kept = decoded_once(counted([], missing=(0, 5, 6, 19)))
    assert [frame.index for frame in kept.frames()] == [*range(1, 5), *range(7, 19)]
    assert [frame.index for frame in kept.frames(0, 1)] == []
    assert [frame.index for frame in kept.frames(5, 8)] == [7]
    assert [frame.index for frame in kept.frames(18, 20)] == [18]


def test_what_does_not_decode_is_noted(make_clip: ClipMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    video = read(make_clip())
    real = container.pictures
    monkeypatch.setattr(container, "pictures", lambda c, s: itertools.islice(real(c, s), 0, None, 2))
    kept = decoded_once(video)
    assert len(list(kept.frames())) == len(list(kept.frames())) == 6
    assert kept.notes == ("6 of 12 frames cannot be decoded; 6 are used.",)


@pytest.mark.parametrize("error", [VideoError("no more"), ValueError("other")])
def test_what_the_decoder_raises_comes_after_the_pictures_before(error: Exception) -> None:
    video = counted([])

    def decode(start: int, stop: int) -> Iterator[Frame]:
        yield from video.decode(start, 4)
        raise error

    kept = decoded_once(replace(video, decode=decode))
    for _ in range(2):
        seen: list[int] = []
        with pytest.raises(type(error), match=str(error)):
            seen.extend(frame.index for frame in kept.frames(2))
        assert [frame.index for frame in kept.frames(0, 4)] == [0, 1, 2, 3]
    # nobody is told of what lies beyond what they ask for
    assert len(list(kept.frames(1, 3))) == 2


@pytest.mark.parametrize("cut", [0, 1000])
@pytest.mark.parametrize("held", [0, 1, 7])
def test_a_disk_that_is_full_costs_time_alone(monkeypatch: pytest.MonkeyPatch, held: int, cut: int) -> None:
    written: list[int] = []

    def write(file: Any, data: Any) -> int:
        written.append(1)
        if len(written) <= held:
            return file.write(data)
        if cut and len(written) == held + 1:
            return file.write(data[:cut])
        raise OSError(28, "No space left on device")

    failing(monkeypatch, write)
    made: list[int] = []
    video = counted(made, missing=(3,))
    kept = decoded_once(video)
    for first, stop in ((0, 20), (2, 9), (15, 20), (0, 20)):
        assert all(map(same, kept.frames(first, stop), video.frames(first, stop)))
        assert len(list(kept.frames(first, stop))) == len(list(video.frames(first, stop)))
    # the disk is left alone from then on, but the clip is decoded to its end, for its notes
    assert len(written) == held + 1
    until(lambda: not threads())


def test_a_picture_that_was_cut_off_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = decoded_once(counted([]))
    list(kept.frames())
    file: Any = kept.decode._pictures._file
    file.truncate(64 * 48 * 3 + 100)
    assert len(list(kept.frames(0, 3))) == 3
    with pytest.raises(OSError, match="frame 3: its picture was cut off"):
        list(kept.frames())


def test_a_clip_without_room_is_decoded_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    video = counted([])
    assert decoded_once(replace(video, held=True)).decode is video.decode
    with monkeypatch.context() as patch:
        patch.setattr(once, "MOST_BYTES", int(1.5 * once.PADDED * 64 * 48 * 20) - 1)
        assert decoded_once(video) is video
    for free, taken in ((int(6.0 * once.PADDED * 64 * 48 * 20) + 4, True), (6 * 64 * 48 * 20, False)):
        with monkeypatch.context() as patch:
            patch.setattr(once.shutil, "disk_usage", lambda _, free=free: SimpleNamespace(free=free))
            assert (decoded_once(video) is not video) == taken

    def none(**_: Any) -> Any:
        raise FileNotFoundError(2, "No usable temporary directory found")

    for name in ("gettempdir", "TemporaryFile"):
        with monkeypatch.context() as patch:
            patch.setattr(once.tempfile, name, none)
            assert decoded_once(video) is video


def test_nothing_is_left_of_a_clip_that_is_let_go(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    free, video = threading.Semaphore(3), counted([])

    def decode(start: int, stop: int) -> Iterator[Frame]:
        for frame in video.decode(start, stop):
            free.acquire()
            yield frame

    kept = decoded_once(replace(video, decode=decode))
    assert len(list(kept.frames(0, 3))) == 3
    assert threads()
    assert list(tmp_path.iterdir()) == []
    file: Any = kept.decode._pictures._file
    del kept
    gc.collect()
    assert file.closed
    # the thread learns of it with the next picture
    free.release()
    until(lambda: not threads())


def test_a_clip_out_of_a_pickle_decodes_for_itself(make_clip: ClipMaker) -> None:
    video = read(make_clip())
    copy = pickle.loads(pickle.dumps(decoded_once(video)))
    assert all(map(same, copy.frames(), video.frames()))
    assert copy.count == 12
