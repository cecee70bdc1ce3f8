"""One JSON object a frame: whole lines, flushed, whatever its reader does."""

from __future__ import annotations

import contextlib
import io
import json
import os
import threading
import time

import pytest

from lives import followed, watched
from monodyn.live import lines as module
from monodyn.live.lines import Lines


@pytest.fixture
def pipe():
    """Open both ends of a pipe, bytes to read and text to write."""
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb", buffering=0) as reader:
        writer = os.fdopen(writing, "w", encoding="ascii")
        yield reader, writer
        reader.close()
        with contextlib.suppress(OSError):
            writer.close()


def test_every_frame_is_one_line_that_any_reader_understands():
    text = io.StringIO()
    lines = Lines(text)
    steps = [watched(0, said='Wärten "on"\nmotion ∞'), *(followed(k) for k in (45, 46))]
    for step in steps:
        lines.add(step, wait=True)
    lines.close()
    rows = text.getvalue().splitlines()
    assert [json.loads(row)["frame"] for row in rows] == [0, 45, 46]
    assert text.getvalue().isascii()
    assert json.loads(rows[0])["said"] == 'Wärten "on"\nmotion ∞'
    assert (lines.lost, lines.error) == (0, None)


def test_a_line_is_there_before_the_next_frame(pipe):
    reader, writer = pipe
    lines = Lines(writer, owned=True)
    lines.add(watched(7), wait=True)
    # nothing else is written, and nothing is closed: an unflushed line would never come
    found = b""
    while not found.endswith(b"\n"):
        found += reader.read(65536)
    assert json.loads(found)["frame"] == 7
    lines.close()
    assert reader.read() == b""
    assert writer.closed


def test_a_reader_that_goes_away_ends_the_lines_alone(pipe):
    reader, writer = pipe
    lines = Lines(writer, owned=True)
    lines.add(watched(0), wait=True)
    reader.read(10)
    reader.close()
    for k in range(3000):
        lines.add(watched(k), wait=True)
    lines.close()
    assert (lines.error, lines.lost) == (None, 0)


def test_a_disk_that_is_full_is_an_error_and_delays_nothing():
    class Full(io.StringIO):
        def write(self, text):
            raise OSError(28, "No space left on device")

    lines = Lines(Full())
    for k in range(3000):
        lines.add(watched(k), wait=True)
    lines.close()
    assert str(lines.error) == "[Errno 28] No space left on device"


def test_a_reader_that_stalls_delays_no_frame_of_a_camera_and_what_it_misses_is_counted(monkeypatch, pipe):
    monkeypatch.setattr(module, "WAITING", 20)
    monkeypatch.setattr(module, "LAST_WAIT", 0.2)
    reader, writer = pipe
    lines = Lines(writer)
    step, began = followed(45), time.monotonic()
    for _ in range(400):
        lines.add(step, wait=False)
    # a pipe holds 64 KiB, some 30 lines
    assert time.monotonic() - began < 5.0
    assert 300 < lines.lost < 400
    lines.close()
    assert time.monotonic() - began < 6.0
    # lets go of the thread that writes
    reader.close()
    lines._thread.join(5.0)
    assert not lines._thread.is_alive()


def test_of_a_clip_no_line_is_lost_however_slow_the_reader(monkeypatch, pipe):
    monkeypatch.setattr(module, "WAITING", 5)
    reader, writer = pipe
    found: list[bytes] = []

    def read():
        while part := reader.read(2000):
            found.append(part)
            time.sleep(1e-3)

    thread = threading.Thread(target=read)
    thread.start()
    lines = Lines(writer, owned=True)
    for k in range(100):
        lines.add(watched(k), wait=True)
    lines.close()
    thread.join()
    assert [json.loads(row)["frame"] for row in b"".join(found).splitlines()] == list(range(100))
    assert lines.lost == 0


@pytest.mark.parametrize("wait", [True, False])
def test_no_thread_is_left(wait):
    before = threading.active_count()
    lines = Lines(io.StringIO())
    lines.add(watched(), wait=wait)
    lines.close()
    assert threading.active_count() == before
