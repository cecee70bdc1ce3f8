"""The first seconds of a stream: what counts as motion, and what is kept."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.live import begin as begun
from monodyn.live.begin import STILL_KEPT, Beginning, as_clip, search
from monodyn.live.settings import LiveSettings
from monodyn.live.sources import pictures_of
from monodyn.live.stream import Session
from monodyn.mechanism import load
from monodyn.settings import RunSettings
from monodyn.types import Frame
from support import refuses


def noisy(index: int, *, moving: bool, rng: np.random.Generator, rate: float = 30.0) -> Frame:
    """A grey picture with noise, and a bright bar that moves."""
    picture = 90.0 + 3.0 * rng.standard_normal((120, 160))
    if moving:
        first = 20 + 2 * index % 100
        picture[30:90, first : first + 20] = 200.0
    return Frame(index, index / rate, np.clip(picture, 16, 235).astype(np.uint8))


def test_noise_is_no_motion_and_what_was_still_gives_way():
    watched, rng = Beginning(1.0), np.random.default_rng(0)
    for k in range(150):
        watched.add(noisy(k, moving=False, rng=rng))
    assert watched.moving == 0.0
    assert watched.frames[-1].time - watched.frames[0].time <= STILL_KEPT + 1e-9
    for k in range(150, 185):
        watched.add(noisy(k, moving=True, rng=rng))
    assert watched.ready
    assert watched.moving == pytest.approx(35 / 30.0, abs=0.1)
    # the still seconds before show the background
    assert watched.frames[0].index < 150


def test_after_a_search_in_vain_half_as_much_again_is_waited_for():
    watched, rng = Beginning(0.5), np.random.default_rng(0)
    for k in range(20):
        watched.add(noisy(k, moving=True, rng=rng))
    assert watched.ready
    before = watched.moving
    watched.in_vain()
    assert not watched.ready
    assert watched.needed == pytest.approx(1.5 * before)


def test_what_is_held_is_bounded_also_while_it_is_looked_at(monkeypatch):
    monkeypatch.setattr(begun, "MOST_HELD", 40 * 120 * 160)
    watched, rng = Beginning(0.5), np.random.default_rng(0)
    for k in range(60):
        watched.add(noisy(k, moving=True, rng=rng))
    assert 38 <= len(watched.frames) <= 41
    held = watched.frames[0].index
    watched.hold()
    for k in range(60, 80):
        watched.add(noisy(k, moving=True, rng=rng))
    assert watched.frames[0].index == held
    assert watched.left_out >= 19


def test_frames_are_a_clip_with_their_own_numbers():
    rng = np.random.default_rng(0)
    frames = [noisy(k, moving=True, rng=rng) for k in range(40, 60)]
    clip = as_clip(frames, "camera 0")
    assert (clip.count, clip.width, clip.height) == (20, 160, 120)
    assert [frame.index for frame in clip.frames(5, 8)] == [5, 6, 7]
    assert np.array_equal(clip.times, [frame.time for frame in frames])


def test_a_camera_that_moves_is_refused(monkeypatch):
    moving = SimpleNamespace(video=SimpleNamespace(camera_path=object()))
    monkeypatch.setattr(begun, "segment", lambda *_, **__: moving)
    rng = np.random.default_rng(0)
    frames = [noisy(k, moving=True, rng=rng) for k in range(4)]
    with refuses(VideoError, "camera 0: expected a camera that stands still, got one that moves; fasten it."):
        search(frames, "camera 0", load("double"), RunSettings())


def test_a_mechanism_of_dots_is_refused_before_the_first_frame(monkeypatch):
    rng = np.random.default_rng(0)
    source = pictures_of([noisy(k, moving=True, rng=rng) for k in range(4)], 30.0)
    mechanism = replace(load("double"), name="balls")
    monkeypatch.setattr("monodyn.live.stream.shows_dots", lambda _: True)
    with refuses(
        VideoError,
        "pictures: expected a mechanism that shows its outline, got 'balls', which is followed by its dots; "
        "record a clip and take monodyn run.",
    ):
        Session(source, mechanism, LiveSettings(), RunSettings())


def test_it_is_said_what_is_looked_at(monkeypatch):
    rng = np.random.default_rng(0)
    source = pictures_of([noisy(k, moving=True, rng=rng) for k in range(40)], 30.0)
    said = []
    error = VideoError("nothing is there")

    def looked(*_):
        said.append(session.said)
        return error

    monkeypatch.setattr("monodyn.live.stream.begin", looked)
    with Session(source, load("double"), LiveSettings(begin=1.0), RunSettings()) as session:
        steps = list(session.steps())
    assert steps[5].said == "Waiting for motion."
    assert steps[-1].said == "nothing is there"
    seconds = said[0].removeprefix("Looking for the mechanism in the last ").removesuffix(" s.")
    assert said[0] == f"Looking for the mechanism in the last {seconds} s."
    assert 0.9 < float(seconds) < 1.2
