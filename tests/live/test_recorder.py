"""A stream recorded while it comes."""

from __future__ import annotations

import numpy as np

import monodyn
from monodyn.errors import SettingsError
from monodyn.live.recorder import Recorder
from monodyn.types import Frame
from support import refuses, square


def frame(index: int, time: float) -> Frame:
    return Frame(index, time, square(index, 96, 64), (np.full((32, 48), 128, np.uint8),) * 2)


def test_a_recording_has_the_frames_and_their_times(tmp_path):
    recorder, rng = Recorder(tmp_path / "clip.mp4"), np.random.default_rng(0)
    times = np.append(0.0, np.cumsum(rng.uniform(0.02, 0.05, 39)))
    for k, time in enumerate(times):
        recorder.take(frame(2 * k, time))
    recorder.finish()
    assert recorder.left_out == 0
    assert recorder.numbers == {2 * k: k for k in range(40)}
    clip = monodyn.read(tmp_path / "clip.mp4")
    assert clip.count == 40
    assert np.abs(clip.times - times).max() < 1e-4
    for seen, k in zip(clip.frames(), range(40), strict=True):
        assert np.abs(seen.luma.astype(int) - square(2 * k, 96, 64)).mean() < 3.0


def test_what_comes_faster_than_it_is_written_is_left_out_and_counted(tmp_path, monkeypatch):
    monkeypatch.setattr("monodyn.live.recorder.WAITING", 3)
    recorder = Recorder(tmp_path / "clip.mp4")
    for k in range(400):
        recorder.take(frame(k, k / 30.0))
    recorder.finish()
    assert recorder.left_out + len(recorder.numbers) == 400
    assert recorder.left_out > 0
    assert monodyn.read(tmp_path / "clip.mp4").count == len(recorder.numbers)


def test_a_place_that_cannot_be_written_is_said_at_the_end(tmp_path):
    place = tmp_path / "missing" / "clip.mp4"
    recorder = Recorder(place)
    for k in range(100):
        recorder.take(frame(k, k / 30.0))
    with refuses(
        SettingsError,
        f"'{place}': cannot write the clip (No such file or directory); free some space, or give another "
        "folder with --out.",
    ):
        recorder.finish()
