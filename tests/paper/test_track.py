"""The pose in video within move limits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import monodyn
from chains import CAMERA, chain, silhouette_of, view_of
from monodyn.paper.settings import PaperTrackSettings
from monodyn.paper.track import (
    LIMIT_FACTORS,
    FrameOutcome,
    MotionState,
    PaperPoses,
    joint_ranges,
    move_limits,
    next_pose,
    scatter_covariance,
)
from monodyn.paper.view import CAMERA_HELD, model_view, silhouette_image
from monodyn.types import FULL
from support import slow


def test_move_limits() -> None:
    """Eq. (5): a share of each joint's range about the last pose; adaptive about where its velocity leads."""
    mechanism = monodyn.load("double")
    at = model_view(mechanism, CAMERA, np.zeros(2), CAMERA_HELD)
    np.testing.assert_allclose(joint_ranges(at), 2 * np.pi)
    motion = MotionState(1.0, np.array([0.5, 1.0]), np.array([6.0, -3.0]), 5, 0, 0.05)
    start, (lower, upper) = move_limits(at, motion, 1.05, PaperTrackSettings(move_share=0.1, adaptive=False))
    np.testing.assert_allclose(start, motion.position)
    np.testing.assert_allclose(upper - start, 0.2 * np.pi)
    np.testing.assert_allclose(start - lower, 0.2 * np.pi)
    start, (lower, upper) = move_limits(at, motion, 1.05, PaperTrackSettings(move_share=0.1))
    np.testing.assert_allclose(start, [0.8, 0.85])
    np.testing.assert_allclose(upper - start, 0.8 * 0.3)
    slow = replace(motion, velocity=np.zeros(2))
    start, (lower, upper) = move_limits(at, slow, 1.05, PaperTrackSettings(move_share=0.1))
    np.testing.assert_allclose(upper - start, 0.2 * 0.2 * np.pi)
    lost = replace(motion, lost=2)
    _, (lower, upper) = move_limits(at, lost, 1.1, PaperTrackSettings(move_share=0.1))
    np.testing.assert_allclose(upper - lower, 0.4 * np.pi * 1.6**2)


@pytest.mark.parametrize("lost", [6, 40])
def test_move_limits_end_at_half_a_turn(lost: int) -> None:
    """However long the gap and whatever the factor: a pose a whole turn on is never within the limits."""
    at = model_view(monodyn.load("double"), CAMERA, np.zeros(2), CAMERA_HELD)
    motion = MotionState(1.0, np.array([9.0, -20.0]), np.array([6.0, -3.0]), 5, lost, 0.05)
    for factor in LIMIT_FACTORS:
        _, (lower, upper) = move_limits(at, motion, 1.5, PaperTrackSettings(), factor=factor)
        np.testing.assert_allclose(lower, motion.position - np.pi)
        np.testing.assert_allclose(upper, motion.position + np.pi)


def test_move_limits_of_a_slide_end_at_half_its_range() -> None:
    at = model_view(monodyn.load("cartpole"), CAMERA, np.zeros(2), CAMERA_HELD)
    motion = MotionState(1.0, np.zeros(2), np.zeros(2), 5, 40, 0.05)
    _, (_, upper) = move_limits(at, motion, 1.5, PaperTrackSettings(), factor=4.0)
    own = at.limits[1, 0]
    np.testing.assert_allclose(upper, [min(own, 0.5 * joint_ranges(at)[0]), np.pi])


def lasting_gap(tmp_path: Path, glimpse: bool) -> list[tuple[np.ndarray, FrameOutcome]]:
    """Follow a swing near -pi that is hidden for a long time; a glimpse shows another pose in between."""
    at = view_of(chain(tmp_path), free=CAMERA_HELD)
    hidden = silhouette_image(cv2.circle(np.zeros((280, 360), np.uint8), (60, 60), 40, FULL, -1))
    motion, out = None, []
    for k in range(26):
        t = k / 30.0
        truth = np.array([-3.1 + 0.5 * np.sin(3.0 * t), 0.6 * np.cos(3.0 * t)])
        image = hidden if 6 <= k < 20 else silhouette_of(truth)
        if glimpse and k == 15:
            image = silhouette_of(truth + np.array([0.0, 2.9]))
        found = next_pose(image, at, motion, t, PaperTrackSettings(), truth if k == 0 else None)
        motion = found.motion
        out.append((truth, found))
    return out


@pytest.mark.slow
@pytest.mark.parametrize("glimpse", [slow(False), True])
def test_a_gap_invents_no_turn(tmp_path: Path, glimpse: bool) -> None:
    """After 14 frames the angles are those of the turn that the motion was on."""
    followed = lasting_gap(tmp_path, glimpse)
    seen_frames = [k for k, (_, found) in enumerate(followed) if found.position is not None]
    assert seen_frames == [k for k in range(26) if k < 6 or k >= 20 or (glimpse and k == 15)]
    for truth, found in followed[20:]:
        assert found.position is not None
        np.testing.assert_allclose(found.position, truth, atol=np.radians(1.5))


@pytest.mark.slow
def test_one_frame_alone_after_a_gap_is_forgotten(tmp_path: Path) -> None:
    """The next frame is not seen: what was known before the glimpse holds again, two frames later."""
    followed = lasting_gap(tmp_path, True)
    before, glimpse, after = (followed[k][1].motion for k in (14, 15, 16))
    assert before is not None
    assert glimpse is not None
    assert after is not None
    assert glimpse.unconfirmed is before
    assert after.unconfirmed is None
    np.testing.assert_array_equal(after.position, before.position)
    assert (before.lost, glimpse.lost, after.lost) == (9, 0, 11)


@pytest.mark.slow
@pytest.mark.parametrize("adaptive", [True, slow(False)])
def test_a_motion_is_followed_through_a_gap(tmp_path: Path, adaptive: bool) -> None:
    """Eq. (5) on a swing of up to 0.3 rad a frame; for two frames something else hides the second link."""
    at = view_of(chain(tmp_path), free=CAMERA_HELD)
    settings = PaperTrackSettings(method="paper", adaptive=adaptive)
    motion, seen_frames = None, []
    for k in range(24):
        t = k / 30.0
        truth = np.array([-1.5 + 1.2 * np.sin(6.0 * t), 1.5 * np.sin(6.0 * t)])
        image = silhouette_of(truth)
        if k in (12, 13):
            image = silhouette_image(cv2.circle(np.zeros((280, 360), np.uint8), (60, 60), 40, FULL, -1))
        found = next_pose(image, at, motion, t, settings, truth if k == 0 else None)
        motion = found.motion
        seen_frames.append(found.position is not None)
        assert found.drawings > 0
        if found.position is not None:
            # the upright edges of links of 60 px cross their pixel centres all at once: a pixel is a degree
            np.testing.assert_allclose(found.position, truth, atol=np.radians(1.5))
    assert [k for k, lies in enumerate(seen_frames) if not lies] == [12, 13]


def test_scatter_is_the_noise_about_smooth_motion() -> None:
    """Of 400 samples a deviation is known within 10 %; a cubic motion and lost frames change nothing."""
    rng = np.random.default_rng(4)
    t = np.arange(400) / 30.0
    noise = np.array([2e-3, 5e-4])
    position = np.column_stack([1 + t - 0.02 * t**3, 0.3 * t**2]) + noise * rng.standard_normal((400, 2))
    position[50:60] = np.nan
    found = scatter_covariance(t, position, np.array([True, True]))
    np.testing.assert_allclose(np.sqrt(np.diag(found)), noise, rtol=0.15)
    assert found[0, 1] == 0.0


def test_a_part_of_the_poses_keeps_its_evaluations() -> None:
    poses = PaperPoses(
        ("a",), np.arange(4), np.arange(4.0), np.zeros((4, 1)), np.ones((4, 1, 1)), np.ones(4, dtype=bool),
        evaluations=np.array([5, 6, 7, 8]),
    )  # fmt: skip
    part = poses[1:3]
    assert part.frame.tolist() == [1, 2]
    assert part.evaluations.tolist() == [6, 7]
