"""Sample frames and the background that they leave free."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.vision.clip.video import read
from monodyn.vision.foreground import background
from monodyn.vision.foreground.background import background_of, sample_frames
from pictures import samples, wandering
from support import ClipMaker, refuses


def test_background_is_what_the_square_leaves_free() -> None:
    made = wandering()
    found = background_of(samples(made))
    # covered up to 10 times of 24, always darker: the median is then a low percentile of the noise of 1
    np.testing.assert_allclose(found.luma, 160, atol=3.0)
    assert found.known.all()
    assert 0.5 <= found.noise <= 1.5


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


def test_a_clip_of_one_frame_has_no_background(make_clip: ClipMaker) -> None:
    video = read(make_clip(count=12))
    first = replace(video, decode=lambda start, stop: video.decode(start, 1))
    with refuses(
        VideoError,
        f"{video.path}: expected at least 2 frames, got 1; give a clip that shows motion.",
    ):
        sample_frames(first)


def test_memory_is_bounded_and_the_samples_stay_spread(
    make_clip: ClipMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With room for 16 frames a clip of 60 is thinned out; the samples still span it evenly."""
    monkeypatch.setattr(background, "SAMPLE_BYTES", 1)
    video = read(make_clip(count=60, size=(128, 96)))
    index = [frame.index for frame in sample_frames(video).frames]
    assert 8 <= len(index) < 16
    assert index[0] == 0
    assert index[-1] >= 52
    assert np.diff(index).max() <= 2 * np.median(np.diff(index))
