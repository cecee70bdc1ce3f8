"""Where frames come from: files, pipes, programs and streams, and what goes wrong with them."""

from __future__ import annotations

import http.server
import io
import itertools
import os
import socketserver
import subprocess
import sys
import threading
import time
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache

import av
import numpy as np
import pytest

from monodyn.errors import SettingsError, VideoError
from monodyn.live import sources
from monodyn.live.clock import USUAL_STEP, Clock
from monodyn.live.feed import AHEAD, Feed
from monodyn.live.settings import LiveSettings
from monodyn.live.sources import Source, open_source, raw_frames
from monodyn.types import Frame
from monodyn.vision.clip.stamps import JUMP
from support import left_edge, refuses, square

WIDTH, HEIGHT = 96, 64


def frame(index: int, stamp: float | None = None) -> Frame:
    return Frame(index, index / 30 if stamp is None else stamp, square(index % 60, WIDTH, HEIGHT))


def made(frames, *, live=False):
    """Return a source of a program's own frames that is read on a thread."""
    return Source("made", WIDTH, HEIGHT, frames, live=live)


def taken(feed, count=None):
    """Take frames until there are no more."""
    found = []
    while count is None or len(found) < count:
        try:
            arrival = feed.next(10.0)
        except StopIteration:
            break
        assert arrival is not None, "no frame within 10 s"
        found.append(arrival.frame)
    return found


@contextmanager
def no_thread_left():
    before = set(threading.enumerate())
    yield
    deadline = time.monotonic() + 5.0
    while (left := set(threading.enumerate()) - before) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not left


@lru_cache
def transport(count=40, width=WIDTH, height=HEIGHT, begin=0):
    """Encode frames as an MPEG transport stream, every fifth one a key frame."""
    buffer = io.BytesIO()
    with av.open(buffer, "w", format="mpegts") as container:
        stream = container.add_stream("mpeg4", rate=30)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.gop_size, stream.bit_rate = 5, 2_000_000
        for k in range(count):
            picture = av.VideoFrame.from_ndarray(square(begin + k, width, height), format="gray")
            container.mux(stream.encode(picture.reformat(format="yuv420p")))
        container.mux(stream.encode())
    return buffer.getvalue()


@contextmanager
def sent(*parts, hang=False):
    """Serve one connection after the other, each with its own bytes; then none, or one that hangs."""
    served = iter(parts)
    asked: list[float] = []
    over = threading.Event()

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            asked.append(time.monotonic())
            part = next(served, b"" if not hang else None)
            if part == b"":
                self.send_error(503)
                return
            self.send_response(200)
            self.send_header("Content-Type", "video/mp2t")
            self.end_headers()
            self.wfile.write(part or b"")
            if part is None:
                over.wait(20.0)

        def log_message(self, *_):
            pass

    class Server(socketserver.ThreadingTCPServer):
        allow_reuse_address, daemon_threads = True, True

        def handle_error(self, *_):
            pass

    with Server(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.05,))
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}/live.ts", asked
        finally:
            over.set()
            server.shutdown()
            thread.join()


def clip(tmp_path, count=12, rate=30):
    path = tmp_path / "clip.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=rate)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for k in range(count):
            picture = av.VideoFrame.from_ndarray(square(k, WIDTH, HEIGHT), format="gray")
            container.mux(stream.encode(picture.reformat(format="yuv420p")))
        container.mux(stream.encode())
    return path


# files


def test_a_file_goes_as_fast_as_it_is_taken_and_loses_nothing(tmp_path):
    with no_thread_left():
        source = open_source(clip(tmp_path))
        assert (source.name, source.width, source.height, source.live) == ("clip.mp4", WIDTH, HEIGHT, False)
        feed = Feed(source, 2)
        first = taken(feed, 1)
        time.sleep(0.2)
        found = first + taken(feed)
        feed.close()
    assert [f.index for f in found] == list(range(12))
    assert [left_edge(f.luma) for f in found] == pytest.approx([2 + k for k in range(12)], abs=1)
    assert feed.skipped == 0


def test_of_a_source_that_waits_only_a_few_frames_are_read_ahead():
    read = []

    def frames():
        for number in range(50):
            read.append(number)
            yield frame(number)

    with no_thread_left():
        feed = Feed(made(frames), 60)
        taken(feed, 1)
        time.sleep(0.2)
        assert 1 + AHEAD <= len(read) <= 2 + AHEAD
        assert len(taken(feed)) == 49
        feed.close()


def test_the_last_frame_of_a_source_waits_for_what_is_made_of_it():
    """Nothing is missed by waiting once there are no more; while one waits, or nobody wants any, it is."""
    with no_thread_left():
        feed, job = Feed(made(lambda: map(frame, range(2)), live=True), 5), Future()
        first = taken(feed, 1)
        feed.waits(job)
        assert not job.done()
        assert len(first + taken(feed)) == 2
        threading.Timer(0.1, job.set_result, (None,)).start()
        feed.waits(job)
        assert job.done()
        feed.close()
        feed.waits(Future())


def test_a_file_at_its_own_pace_takes_as_long_as_it_plays(tmp_path):
    source = open_source(clip(tmp_path, 16), LiveSettings(pace="real"))
    assert source.live
    feed = Feed(source, 60)
    began = time.monotonic()
    arrivals = []
    while True:
        try:
            arrivals.append((feed.next(5.0), time.monotonic() - began))
        except StopIteration:
            break
    feed.close()
    assert len(arrivals) == 16
    assert arrivals[-1][1] == pytest.approx(15 / 30, abs=0.25)
    late = [at - arrival.frame.time for arrival, at in arrivals]
    # none before its time
    assert min(late) - late[0] > -0.02


def test_a_pause_in_the_stamps_does_not_hold_up_the_end():
    def frames():
        return sources.in_time(iter([frame(0, 0.0), frame(1, 3600.0)]), source.closing)

    with no_thread_left():
        source = made(frames, live=True)
        feed = Feed(source, 4)
        assert len(taken(feed, 1)) == 1
        began = time.monotonic()
        feed.close()
        assert time.monotonic() - began < 1.0


# pipes


def test_raw_frames_on_a_pipe_in_every_form():
    rng = np.random.default_rng(2)
    grey = rng.integers(16, 235, (HEIGHT, WIDTH), dtype=np.uint8)
    for pixels, data in (
        ("gray", grey),
        ("rgb24", np.stack([grey] * 3, axis=2)),
        ("bgr24", np.stack([grey] * 3, axis=2)),
        ("yuv420p", np.concatenate([grey, np.full((HEIGHT // 2, WIDTH), 128, np.uint8)])),
    ):
        pipe = io.BytesIO(data.tobytes() * 3)
        source = raw_frames(pipe, LiveSettings(size=(WIDTH, HEIGHT), pixels=pixels), 25.0)
        found = list(source.opened())
        assert [f.index for f in found] == [0, 1, 2]
        assert [f.time for f in found] == pytest.approx([0.0, 0.04, 0.08])
        assert found[0].luma.shape == (HEIGHT, WIDTH)
        # brightness alone, whatever the range of the levels
        slope = np.polyfit(grey.ravel().astype(float), found[0].luma.ravel().astype(float), 1)[0]
        assert 0.8 < slope < 1.2
        assert np.corrcoef(grey.ravel(), found[0].luma.ravel())[0, 1] > 0.999


def test_a_pipe_that_is_cut_short_loses_its_last_frame_and_says_so():
    for extra in (1, WIDTH * HEIGHT - 1):
        pipe = io.BytesIO(bytes(2 * WIDTH * HEIGHT + extra))
        source = raw_frames(pipe, LiveSettings(size=(WIDTH, HEIGHT)), 30.0)
        assert len(list(source.opened())) == 2
        assert source.remarks == ["The last frame on the pipe is cut short; it is left out."]
    whole = raw_frames(io.BytesIO(bytes(WIDTH * HEIGHT)), LiveSettings(size=(WIDTH, HEIGHT)), 30.0)
    assert len(list(whole.opened())) == 1
    assert whole.remarks == []


def test_raw_frames_need_a_size_that_fits():
    with refuses(
        SettingsError,
        "live.size: expected width and height of raw frames, got none; give --live.size W,H and "
        "--live.pixels.",
    ):
        raw_frames(io.BytesIO(), LiveSettings(), 30.0)
    with refuses(SettingsError, "live.size: expected an even size for yuv420p, got 97,64."):
        raw_frames(io.BytesIO(), LiveSettings(size=(97, 64), pixels="yuv420p"), 30.0)


def test_a_pipe_in_pieces_is_put_together_and_one_that_stalls_does_not_hold_up_the_end():
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb") as pipe, os.fdopen(writing, "wb", buffering=0) as writer, no_thread_left():
        source = raw_frames(pipe, LiveSettings(size=(WIDTH, HEIGHT)), 30.0)
        feed = Feed(source, 10)
        data = b"".join(square(k, WIDTH, HEIGHT).tobytes() for k in range(2)) + b"half a frame"
        for k in range(0, len(data), 1000):
            writer.write(data[k : k + 1000])
        assert [left_edge(f.luma) for f in taken(feed, 2)] == [2, 3]
        began = time.monotonic()
        feed.close()
        assert time.monotonic() - began < 1.0
    assert source.remarks == []


@pytest.mark.slow
def test_the_program_ends_while_its_standard_input_stalls():
    """A thread that waits in Python's own buffer would abort the program at its end."""
    code = (
        "from monodyn.live.sources import open_source; from monodyn.live.settings import LiveSettings\n"
        "from monodyn.live.feed import Feed\n"
        f"feed = Feed(open_source('-', LiveSettings(size=({WIDTH}, {HEIGHT}))), 4)\n"
        "print(feed.next(5.0).frame.index, feed.next(0.3), flush=True)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as program:
        program.stdin.write(bytes(WIDTH * HEIGHT + 7))
        program.stdin.flush()
        assert program.stdout.read() == b"0 None\n"
        assert program.wait(20) == 0
        assert program.stderr.read() == b""


# programs


def test_pictures_of_a_program_are_read_one_by_one():
    asked = []

    def pictures():
        for k in range(4):
            asked.append(k)
            yield square(k, WIDTH, HEIGHT)

    with no_thread_left():
        feed = Feed(open_source(pictures(), rate=50.0), 8)
        for k in range(4):
            found = feed.next()
            # a picture may depend on what was done with the one before
            assert asked == list(range(k + 1))
            assert (found.frame.index, left_edge(found.frame.luma)) == (k, 2 + k)
            assert found.frame.time == pytest.approx(k / 50.0)
        with pytest.raises(StopIteration):
            feed.next()
        feed.close()


def test_pictures_that_change_their_size_are_brought_to_that_of_the_first_or_refused():
    small, large = square(5, WIDTH, HEIGHT), np.kron(square(5, WIDTH, HEIGHT), np.ones((2, 2), np.uint8))
    found = list(open_source([small, large, small]).opened())
    assert {f.luma.shape for f in found} == {(HEIGHT, WIDTH)}
    assert [left_edge(f.luma) for f in found] == [7, 7, 7]
    turned = open_source([small, small.T.copy()])
    with refuses(
        VideoError,
        "stream: expected pictures of 96x64 px, as the first, got 64x96 at 0.03 s; give all of them in one "
        "shape.",
    ):
        list(turned.opened())


def test_what_is_no_picture_is_refused():
    with refuses(VideoError, "stream: expected pictures, got none; give at least a few seconds of motion."):
        open_source([])
    with refuses(VideoError, "stream: expected pictures of at least 16x16 px, got 10x40."):
        open_source([np.zeros((40, 10), np.uint8)])
    for odd in (np.zeros((64, 96)), np.zeros((64, 96, 4), np.uint8), np.zeros(96, np.uint8)):
        with refuses(
            VideoError,
            "stream: expected pictures as uint8 arrays (height, width) or (height, width, 3), got "
            f"{odd.dtype} {odd.shape}.",
        ):
            open_source([odd])


def test_what_cannot_be_the_number_of_a_camera_is_refused():
    for number, got in (
        (-1, "-1"), (100, "100"), (10**12, "a longer one"), (-(10**5000), "a longer one"), ("100", "100"),
        (np.int64(-3), "-3"),
    ):  # fmt: skip
        with refuses(SettingsError, f"camera: expected a number from 0 to 99, got {got}; give another."):
            open_source(number)


@pytest.mark.parametrize("direct", [True, False])
def test_what_goes_wrong_in_a_source_comes_out_after_what_came_before(direct):
    def frames():
        yield from map(frame, range(3))
        raise ZeroDivisionError("the program's own")

    with no_thread_left():
        feed = Feed(replace(made(frames), direct=direct), 8)
        assert [f.index for f in taken(feed, 3)] == [0, 1, 2]
        with pytest.raises(ZeroDivisionError, match="the program's own"):
            feed.next(5.0)
        feed.close()


def test_a_source_that_cannot_even_begin_says_so():
    def frames():
        raise VideoError("gone")

    feed = Feed(made(frames), 8)
    with pytest.raises(VideoError, match="gone"):
        feed.next(5.0)
    feed.close()


def test_of_a_camera_that_is_faster_the_oldest_give_way_and_of_a_file_none():
    for live in (True, False):
        with no_thread_left():
            feed = Feed(made(lambda: map(frame, range(50)), live=live), 5)
            if live:
                time.sleep(0.2)
            found = [f.index for f in taken(feed)]
            feed.close()
        assert found == (list(range(45, 50)) if live else list(range(50)))
        assert feed.skipped == (45 if live else 0)


def test_closing_in_the_middle_leaves_no_thread():
    for live in (True, False):
        with no_thread_left():
            feed = Feed(made(lambda: map(frame, itertools.count()), live=live), 5)
            assert taken(feed, 3)
            feed.close()


def test_no_frame_within_the_time_is_none():
    hold = threading.Event()

    def frames():
        hold.wait(10.0)
        yield frame(0)

    feed = Feed(made(frames, live=True), 5)
    assert feed.next(0.05) is None
    hold.set()
    assert feed.next(5.0).frame.index == 0
    feed.close()


# streams


@pytest.mark.slow
def test_a_stream_that_breaks_off_is_opened_again():
    data = transport()
    with no_thread_left(), sent(data, data[: len(data) // 2], data, data) as (address, asked):
        source = open_source(address, LiveSettings(patience=1.5))
        assert (source.width, source.height, source.live) == (WIDTH, HEIGHT, True)
        feed = Feed(source, 200)
        found = taken(feed)
        feed.close()
    assert len(asked) >= 4
    assert [f.index for f in found] == list(range(len(found)))
    # half of one, and two whole ones
    assert 85 < len(found) <= 120
    assert source.remarks == [f"The stream '{address}' broke off; it was opened again."]
    clock = Clock(0.0)
    timed = [clock.take(f) for f in found]
    assert np.all(np.diff([t.frame.time for t in timed]) > 0)
    assert sum(t.broken for t in timed) == 2


@pytest.mark.slow
def test_a_stream_that_does_not_come_back_ends_after_a_while_with_longer_and_longer_waits():
    with no_thread_left(), sent(transport(), transport()) as (address, asked):
        source = open_source(address, LiveSettings(patience=1.5))
        feed = Feed(source, 200)
        began = time.monotonic()
        found = taken(feed)
        assert time.monotonic() - began == pytest.approx(1.5, abs=0.7)
        feed.close()
    assert len(found) >= 38
    waits = np.diff(asked[2:])
    assert len(waits) >= 2
    assert waits[1] == pytest.approx(2.0 * waits[0], rel=0.5)
    # it was never opened again
    assert source.remarks == []


@pytest.mark.slow
def test_garbage_in_the_middle_costs_its_own_pictures_only():
    data = bytearray(transport(60))
    middle = len(data) // 2
    rng = np.random.default_rng(4)
    data[middle : middle + 3000] = rng.bytes(3000)
    inserted = bytes(data[:middle]) + rng.bytes(777) + bytes(data[middle:])
    for damaged in (bytes(data), inserted):
        with sent(transport(), damaged) as (address, _):
            feed = Feed(open_source(address, LiveSettings(patience=0.6)), 200)
            found = taken(feed)
            feed.close()
        assert 35 <= len(found) <= 62
        edges = [left_edge(f.luma) for f in found]
        # the end of the stream is whole
        assert edges[0] == pytest.approx(2, abs=1)
        assert edges[-1] == pytest.approx(61, abs=2)
        assert np.all(np.diff([f.time for f in found]) > 0)


@pytest.mark.slow
def test_a_stream_of_nothing_but_garbage_is_refused_and_one_that_turns_into_it_ends():
    rng = np.random.default_rng(5)
    with (
        sent(rng.bytes(200_000)) as (address, _),
        refuses(
            VideoError, f"stream '{address}': expected pictures, got none within 5 s; check the address."
        ),
    ):
        open_source(address)
    with no_thread_left(), sent(transport(), transport(), *[rng.bytes(50_000)] * 20) as (address, _):
        feed = Feed(open_source(address, LiveSettings(patience=1.0)), 200)
        assert len(taken(feed)) >= 38
        feed.close()


@pytest.mark.slow
def test_a_stream_that_comes_back_in_another_size():
    large, turned = transport(20, 2 * WIDTH, 2 * HEIGHT), transport(20, HEIGHT, WIDTH)
    with sent(transport(20), transport(20), large, turned) as (address, _):
        source = open_source(address, LiveSettings(patience=1.0))
        feed = Feed(source, 200)
        found = taken(feed)
        feed.close()
    assert {f.luma.shape for f in found} == {(HEIGHT, WIDTH)}
    assert 34 <= len(found) <= 40
    assert f"The stream '{address}' has pictures of another shape, which are left out." in source.remarks


def test_closing_while_a_stream_stalls_does_not_wait_for_it(monkeypatch):
    monkeypatch.setattr(sources, "OPENS", 1.0)
    with no_thread_left(), sent(transport(), transport(), hang=True) as (address, _):
        feed = Feed(open_source(address, LiveSettings(patience=60.0)), 200)
        assert len(taken(feed, 30)) == 30
        began = time.monotonic()
        feed.close()
        assert time.monotonic() - began < 2.5


def test_an_address_where_nothing_answers_is_one_clear_line():
    with refuses(
        VideoError,
        "stream 'http://127.0.0.1:9/x': expected pictures, got none within 5 s; check the address.",
    ):
        open_source("http://127.0.0.1:9/x")


def test_a_stream_opens_no_file_of_this_machine(tmp_path):
    """A playlist may name anything; what it names is fetched by us."""
    path = clip(tmp_path)
    listed = f"#EXTM3U\n#EXT-X-TARGETDURATION:2\n#EXTINF:1,\nfile://{path}\n#EXT-X-ENDLIST\n".encode()
    with sent(*[listed] * 4) as (address, _), pytest.raises(VideoError, match="expected pictures, got none"):
        open_source(address.replace(".ts", ".m3u8"))


def test_a_camera_that_is_not_there_is_one_clear_line(capfd):
    with refuses(
        VideoError,
        "camera 97: expected pictures, got none; check that it is connected and that no other program has "
        "it.",
    ):
        open_source("97")
    assert capfd.readouterr().err == ""


def test_a_camera_gives_frames_by_the_clock_of_this_machine_until_it_vanishes(monkeypatch):
    class Device:
        def __init__(self, number):
            self.count, self.released = 0, False
            devices.append(self)

        def set(self, *_):
            pass

        def read(self):
            self.count += 1
            time.sleep(0.01)
            grey = square(self.count, WIDTH, HEIGHT)
            return (True, np.stack([grey] * 3, axis=2)) if self.count <= 6 else (False, None)

        def release(self):
            self.released = True

    import cv2

    devices: list[Device] = []
    monkeypatch.setattr(cv2, "VideoCapture", Device)
    with no_thread_left():
        source = open_source(0)
        assert (source.name, source.live) == ("camera 0", True)
        feed = Feed(source, 60)
        found = taken(feed)
        feed.close()
    assert [left_edge(f.luma) for f in found] == [3, 4, 5, 6, 7, 8]
    assert np.all(np.diff([f.time for f in found]) > 0.005)
    assert devices[0].released


# the clock


def test_a_clock_goes_on_by_its_usual_step_where_stamps_jump():
    stamps = [10.0, 10.05, 10.1, 10.15, 3.0, 3.05, 3.05, 3.1, 900.0, 900.05]
    clock = Clock(0.0)
    timed = [clock.take(frame(k, stamp)) for k, stamp in enumerate(stamps)]
    times = [t.frame.time for t in timed]
    assert times == pytest.approx(np.arange(10) * 0.05)
    assert [t.broken for t in timed] == [False] * 4 + [True, False, True, False, True, False]
    assert clock.breaks == 3
    assert clock.step == pytest.approx(0.05)


def test_a_clock_keeps_the_stamps_of_a_clip_and_learns_its_rate():
    clock = Clock(None)
    timed = [clock.take(frame(k, 7.0 + k / 24)) for k in range(30)]
    assert [t.frame.time for t in timed] == pytest.approx([7.0 + k / 24 for k in range(30)])
    assert clock.step == pytest.approx(1 / 24)
    # dropped frames are no break, minutes are
    assert not clock.take(frame(31, timed[-1].frame.time + JUMP - 0.1)).broken
    assert clock.take(frame(32, timed[-1].frame.time + 2 * JUMP + 60.0)).broken


def test_a_clock_that_stands_still_from_the_start_steps_as_usual():
    clock = Clock(0.0)
    times = [clock.take(frame(k, 5.0)).frame.time for k in range(4)]
    assert times == pytest.approx([k * USUAL_STEP for k in range(4)])
