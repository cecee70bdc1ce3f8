"""Poses put at the times that their motion shows, against a motion in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from monodyn.types import Poses
from monodyn.vision.clip.repeats import Repeats
from monodyn.vision.clip.video import Video
from monodyn.vision.clock import at_true_times, unevenness, with_time_noise

COUNT, STAMPS = 120, np.arange(120) / 30.0


def motion(times: np.ndarray) -> np.ndarray:
    return np.column_stack([np.sin(7.0 * times), 0.4 * np.cos(11.0 * times)])


def clip(*, tick: float = 0.0) -> Video:
    """Return a clip of 30 pictures a second in which a scene of 25 was copied."""
    scene = np.floor(np.arange(COUNT) / 1.2 + 1e-9)
    frames = tuple(int(k) for k in 1 + np.flatnonzero(np.diff(scene) == 0))
    fresh = np.setdiff1d(np.arange(COUNT), frames)
    times = np.interp(np.arange(COUNT), fresh, scene[fresh] / 25.0 + 0.004)
    times[-1] += 0.001 * (COUNT - 1 in frames)
    return Video(
        Path("clip.mp4"), 8, 8, STAMPS, lambda start, stop: iter(()), tick=tick,
        repeats=Repeats(frames, 25.0, times),
    )  # fmt: skip


def poses(video: Video, content: np.ndarray) -> Poses:
    """Return noisy poses of the motion at the times that the pictures show."""
    seen = np.ones(COUNT, dtype=bool)
    seen[list(video.repeats.frames)] = False
    noise = 1e-3 * np.random.default_rng(2).normal(size=(COUNT, 2))
    position = np.where(seen[:, None], motion(content) + noise, np.nan)
    covariance = np.where(seen[:, None, None], 1e-6 * np.eye(2), np.nan)
    return Poses(("a", "b"), np.arange(COUNT), STAMPS, position, covariance, seen)


def test_a_scene_that_was_copied_belongs_to_its_own_rate() -> None:
    video = clip()
    put = at_true_times(poses(video, video.repeats.times), video)
    assert np.array_equal(put.time, video.repeats.times)
    at_true_times(poses(video, video.repeats.times), video)
    # it is said once, however often the clip is tracked
    assert video.notes == (
        "The motion is smooth at a constant rate of 25 new pictures a second and not at their time stamps; "
        "that rate takes their place.",
    )


def test_pictures_around_lost_ones_belong_to_their_stamps() -> None:
    video = clip()
    put = at_true_times(poses(video, STAMPS), video)
    assert np.array_equal(put.time, STAMPS)
    assert video.notes == ()


def test_too_few_poses_keep_their_stamps() -> None:
    video = clip()
    few = poses(video, video.repeats.times)[:5]
    assert np.array_equal(at_true_times(few, video).time[:5], STAMPS[:5])


def test_repeats_at_the_end_keep_their_rows() -> None:
    video = clip()
    last = max(video.repeats.frames)
    put = at_true_times(poses(video, STAMPS)[:last], video)
    assert put.frame.tolist() == list(range(last + 1))
    assert not put.seen[-1]
    assert np.all(np.isnan(put.position[-1]))


def test_cubics_miss_nothing_of_a_cubic_and_noise_by_its_size() -> None:
    times = np.cumsum(np.random.default_rng(1).uniform(0.02, 0.05, size=4000))
    cubic = np.column_stack([(times - 1.0) ** 3, times**2])
    assert np.all(unevenness(times[:40], cubic[:40]) < 1e-12)
    noise = np.random.default_rng(4).normal(size=(4000, 1))
    # the median of the absolute value of a normal variable
    assert unevenness(times, noise)[0] == pytest.approx(0.6745, rel=0.05)


def test_the_rounding_of_stamps_grows_with_the_rate() -> None:
    video = clip(tick=0.01)
    before = poses(video, STAMPS)
    after = at_true_times(before, video)
    extra = (after.covariance - before.covariance)[before.seen]
    rates = np.column_stack([7.0 * np.cos(7.0 * STAMPS), -4.4 * np.sin(11.0 * STAMPS)])[before.seen]
    expected = 0.01**2 / 12.0 * rates[:, :, None] * rates[:, None, :]
    # rates are differences of neighbours, whose own errors are a few per cent here
    assert np.abs(extra - expected)[2:-2].max() < 0.2 * np.abs(expected).max()
    assert np.all(np.isnan(after.covariance[~before.seen]))


def test_a_single_pose_has_no_rate() -> None:
    one = poses(clip(), STAMPS)[:1]
    assert np.array_equal(with_time_noise(one, 1e-3).covariance, one.covariance)
