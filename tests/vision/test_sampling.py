"""Samples at equal steps of the motion, and where and when the scene shows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from monodyn.errors import SettingsError, VideoError
from monodyn.types import Frame
from monodyn.vision.clip.video import read
from monodyn.vision.foreground import sampling
from monodyn.vision.foreground.sampling import frames_between, sample_frames, window_of
from monodyn.vision.foreground.thumbnails import Window
from monodyn.vision.settings import SegmentSettings
from support import ClipMaker, refuses


def test_the_reach_holds_all_motion(make_clip: ClipMaker) -> None:
    path = make_clip("moving.mp4", count=40, size=(128, 96))
    video = read(path)
    found = sample_frames(video)
    assert len(found.frames) <= 72
    top, bottom, left, right = found.window
    assert top == 0
    assert left == 0
    assert right >= 52
    assert bottom <= 48


def test_samples_follow_the_motion_not_the_time(make_clip: ClipMaker) -> None:
    """Of 200 frames the last 160 stand still; nearly all samples come from the first 40."""
    path = make_clip("rest.mp4", count=200, size=(128, 96), places=[min(i, 40) for i in range(200)])
    found = [frame.index for frame in sample_frames(read(path)).frames]
    assert sum(index > 45 for index in found) <= 3
    assert sum(index <= 45 for index in found) >= 15


@pytest.mark.parametrize("colours", [0, 2])
def test_the_way_is_what_changes_beyond_noise(colours: int, make_clip: ClipMaker) -> None:
    video = read(make_clip())
    path, rng = sampling._Path(video), np.random.default_rng(2)
    way, before = 0.0, None
    for number in range(6):
        # two thirds of the picture change in the last frame, as when the light is switched
        sides = [(48, 64), (24, 32), (24, 32)][: 1 + colours]
        planes = [rng.integers(90, 110, side, dtype=np.uint8) for side in sides]
        planes[0][: 32 if number == 5 else 8] += np.uint8(60 * (number % 2))
        # of colours that much may change
        for plane in planes[1:]:
            plane += np.uint8(60 * (number == 3))
        frame = Frame(number, number / 30.0, planes[0], (planes[1], planes[2]) if colours else None)
        path.add(frame)
        small = path.thumbnails.finished().planes[-1].astype(int)
        if before is not None:
            moved = np.maximum(np.abs(small - before) - 8, 0)
            way += (0.0 if np.mean(moved[0] > 0) > 0.5 else moved.sum()) + 1e-6
        assert path._travelled == pytest.approx(way, abs=1e-12)
        before = small
    assert way > 1.0


def test_a_clip_of_one_frame_has_no_background(make_clip: ClipMaker) -> None:
    video = read(make_clip(count=12))
    first = replace(video, decode=lambda start, stop: video.decode(start, 1))
    with refuses(
        VideoError,
        f"{video.path}: expected at least 2 frames, got 1; give a clip that shows motion.",
    ):
        sample_frames(first)
    none = replace(video, decode=lambda start, stop: iter(()))
    with refuses(
        VideoError,
        f"{video.path}: expected at least 2 frames, got 0; give a clip that shows motion.",
    ):
        sample_frames(none)


def test_memory_is_bounded_and_the_samples_stay_spread(
    make_clip: ClipMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With room for 16 frames a clip of 60 is thinned out; the samples still span it evenly."""
    monkeypatch.setattr(sampling, "SAMPLE_BYTES", 1)
    video = read(make_clip(count=60, size=(128, 96)))
    index = [frame.index for frame in sample_frames(video).frames]
    assert 8 <= len(index) < 16
    assert index[0] == 0
    assert index[-1] >= 52
    assert np.diff(index).max() <= 2 * np.median(np.diff(index))


def test_samples_lie_in_the_time_range_and_the_window_is_the_users(make_clip: ClipMaker) -> None:
    video = read(make_clip(count=40, size=(128, 96)))
    settings = SegmentSettings(roi=(10, 5, 60, 40), time_range=(0.5, 1.0))
    found = sample_frames(video, settings)
    assert found.span == (15, 31)
    assert found.given
    assert {frame.index for frame in found.frames} <= set(range(15, 31))
    assert found.window == Window(5, 45, 10, 70)
    assert found.parts is None


def test_of_what_moves_across_the_edge_of_a_region_nothing_is_known_outside(tmp_path: Path) -> None:
    for i in range(40):
        picture = np.full((96, 128), 180, np.uint8)
        picture[30:50, 10 + i : 30 + i] = 60
        cv2.imwrite(str(tmp_path / f"{i:03d}.png"), picture)
    cut = sample_frames(read(tmp_path), SegmentSettings(roi=(0, 0, 40, 96)))
    assert cut.others is not None
    assert not cut.others[:, :40].any()
    # the square sweeps columns 10 to 69 of rows 30 to 49
    assert cut.others[30:50, 40:68].all()
    assert not cut.others[:16].any()
    assert not cut.others[:, 90:].any()
    assert sample_frames(read(tmp_path), SegmentSettings(roi=(0, 8, 100, 80))).others is None


def test_a_prelude_is_no_part_of_the_scene(tmp_path: Path) -> None:
    """Nine black pictures and six of a fade before a dark square wanders over a light wall."""
    for i in range(60):
        picture = np.full((96, 128), 180.0)
        picture[30:50, 10 + i : 30 + i] = 60.0
        light = np.clip((i - 8) / 7.0, 0.0, 1.0)
        cv2.imwrite(str(tmp_path / f"{i:03d}.png"), (light * picture).round().astype(np.uint8))
    found = sample_frames(read(tmp_path))
    assert found.span == (15, 60)
    assert not found.given
    assert found.frames[0].index >= 15
    # the light that comes up is no motion: the window is around the square alone
    assert found.window.right < 128
    assert found.window.bottom <= 50 + 16 + 4


def test_a_time_range_is_frames_of_the_clip() -> None:
    times = np.arange(90) / 30.0
    assert frames_between(times, None) == (0, 90)
    # stamps that are written with three digits are those of their frames
    assert frames_between(times, (0.333, 0.667)) == (10, 21)
    assert frames_between(times, (1.0, None)) == (30, 90)
    with refuses(
        SettingsError,
        "time-range: expected at least two frames within 0.000:2.967 s, got 5:9 s with 0; give seconds of "
        "the clip.",
    ):
        frames_between(times, (5.0, 9.0))


def test_a_region_lies_in_the_picture(make_clip: ClipMaker) -> None:
    video = read(make_clip())
    assert window_of((4, 8, 60, 40), video) == Window(8, 48, 4, 64)
    with refuses(
        SettingsError,
        "roi: expected X,Y,W,H within the picture of 64x48 px, got 4,8,61,40; give column and row of the "
        "upper left corner, width and height.",
    ):
        window_of((4, 8, 61, 40), video)
