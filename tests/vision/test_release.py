"""The frames in which nothing holds or touches the mechanism."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from films import COUNT, film
from monodyn.mechanism import load
from monodyn.types import Poses
from monodyn.vision.release import (
    FreeSpan,
    blanked,
    free_span,
    hangs,
    longest_free,
    released,
    span_of_poses,
    touching,
)

STD = 5e-4
"""Noise of the poses [rad]."""


def poses_of(position: np.ndarray, *, rate: float = 30.0, seed: int = 1) -> Poses:
    """Return poses of a motion (frame, dof) with noise."""
    frames, dofs = position.shape
    noisy = position + np.random.default_rng(seed).normal(scale=STD, size=position.shape)
    joints = tuple(f"joint{i + 1}" for i in range(dofs))
    covariance = np.tile(STD**2 * np.eye(dofs), (frames, 1, 1))
    seen = np.ones(frames, dtype=bool)
    return Poses(joints, np.arange(frames), np.arange(frames) / rate, noisy, covariance, seen)


def swing(held: int, frames: int = 120, *, rate: float = 30.0, angular: float = 6.0) -> np.ndarray:
    """Return a swing that is held at its turning point for some frames [rad], (frame, 1)."""
    t = np.maximum(np.arange(frames) - held, 0) / rate
    return 0.8 * np.cos(angular * t)[:, None]


@pytest.mark.parametrize("rate", [30.0, 120.0])
@pytest.mark.parametrize("held", [10, 25, 60])
def test_a_string_that_is_cut_releases(held: int, rate: float) -> None:
    found = released(poses_of(swing(held, 240, rate=rate), rate=rate), 0, 240)
    # what is not yet beyond the noise may be counted as rest; a frame before the release would be wrong
    assert held <= found + 1
    assert found <= held + 0.1 * rate


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_slide_is_released_at_any_scale_of_its_file(scale: float) -> None:
    """While it is held the tracked place wanders by a two-thousandth of the way, more than its noise."""
    wander = 4e-4 * np.sin(0.9 * np.arange(120))[:, None]
    poses = poses_of(swing(30) + wander)
    position, covariance = scale * poses.position, (0.02 * scale) ** 2 * poses.covariance
    slide = replace(poses, position=position, covariance=covariance)
    assert abs(released(slide, 0, 120, slides=np.array([True])) - 30) <= 3


def test_no_motion_goes_on_across_a_jump_of_the_time() -> None:
    poses = poses_of(swing(0, 40, angular=5.0))
    both = replace(poses, time=poses.time + np.where(poses.frame < 25, 0.0, 10.0))
    found = span_of_poses(both, load("single"), None)
    assert (found.first, found.stop) == (0, 25)
    assert found.notes == (
        "The motion of the mechanism is taken to be free in frames 0:25, 0.000 to 0.800 s: the time jumps "
        "(--time-range A:B [s] gives another range).",
    )
    assert span_of_poses(poses, load("single"), None) == FreeSpan(0, 40, ())


def test_the_first_free_frame_may_be_the_first_of_the_stretch() -> None:
    poses = poses_of(np.vstack([swing(0, 30), swing(20, 90)]))
    assert abs(released(poses, 30, 120) - 50) <= 3


@pytest.mark.parametrize("rate", [30.0, 240.0])
def test_a_free_mechanism_is_not_held(rate: float) -> None:
    """At its turning point it stays near it for a while, before as long as after."""
    for phase in np.linspace(0.0, 2.0 * np.pi, 25):
        t = np.arange(300) / rate
        poses = poses_of(0.8 * np.cos(6.0 * t + phase)[:, None], rate=rate)
        assert released(poses, 0, 300) == 0


def test_a_rest_in_the_end_is_friction() -> None:
    t = np.arange(120) / 30.0
    poses = poses_of(np.where(t < 2.0, np.cos(4.0 * t) * (1.0 - 0.5 * t), 0.0)[:, None])
    assert released(poses, 0, 120) == 0
    still = poses_of(np.zeros((120, 1)))
    assert released(still, 0, 120) == 0


def test_a_mechanism_hangs_where_its_energy_is_least() -> None:
    double = load("double")
    down = np.zeros(2) if hangs(double, np.zeros(2)) else np.array([-np.pi / 2, 0.0])
    assert hangs(double, down)
    # a camera out of level turns the whole mechanism
    assert hangs(double, down + np.array([0.08, 0.0]))
    assert not hangs(double, down + np.array([0.2, 0.0]))
    assert not hangs(double, down + np.array([0.0, 0.3]))
    assert not hangs(double, down + np.array([np.pi, 0.0]))
    # a cart stays wherever it is, its pole only below it
    pole = load("cartpole")
    low = next(q for q in np.linspace(-np.pi, np.pi, 5) if hangs(pole, np.array([0.0, q])))
    assert hangs(pole, np.array([0.1, low]))
    assert not hangs(pole, np.array([0.1, low + np.pi]))


def test_frames_in_which_it_hangs_stay_seen() -> None:
    poses = blanked(poses_of(swing(0)), FreeSpan(30, 100, (), 10))
    assert poses.seen.tolist() == [20 <= k < 100 for k in range(120)]


def test_a_rest_at_the_lowest_place_is_no_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    """It swings up from where it hangs; the same motion from a raised place was held."""
    mechanism = load("single")
    low = next(q for q in np.linspace(-np.pi, np.pi, 5) if hangs(mechanism, np.array([q])))
    t = np.maximum(np.arange(COUNT) - 16, 0) / 30.0
    for rest, hanging in ((low, True), (low + 1.0, False)):
        poses = poses_of((rest + 0.8 * np.sin(2.0 * t) ** 2)[:, None])
        thumbnails = SimpleNamespace(number=np.arange(COUNT))
        samples = SimpleNamespace(span=None, given=False, thumbnails=thumbnails, frames=())
        scene = SimpleNamespace(mechanism=mechanism)
        monkeypatch.setattr("monodyn.vision.release.touching", lambda *_: np.zeros(COUNT, dtype=bool))
        span = free_span(SimpleNamespace(samples=samples), scene, poses)  # type: ignore[arg-type]
        assert abs(span.first - 17) <= 2
        assert span.hanging == (span.first if hanging else 0)
        begin, end = span.first / 30.0, (COUNT - 1) / 30.0
        said = (
            f"The mechanism hardly moves before frame {span.first}, near where it hangs; the fit begins "
            "there unless --fit-frames A:B says otherwise."
            if hanging
            else f"The motion of the mechanism is taken to be free in frames {span.first}:{COUNT}, "
            f"{begin:.3f} to {end:.3f} s: it hardly moves before, and may be held (--time-range A:B [s] "
            "gives another range)."
        )
        assert span.notes == (said,)


def test_the_longest_stretch_between_two_touches() -> None:
    seen = np.ones(100, dtype=bool)
    touched = np.zeros(100, dtype=bool)
    assert longest_free(touched, seen, (0, 100)) == (0, 100)
    assert longest_free(touched, seen, (5, 90)) == (5, 90)
    touched[:20] = touched[85:] = True
    assert longest_free(touched, seen, (0, 100)) == (20, 85)
    touched[40:45] = True
    assert longest_free(touched, seen, (0, 100)) == (45, 85)
    for jump, stretch in ((50, (50, 85)), (80, (45, 80)), (42, (45, 85)), (45, (45, 85)), (85, (45, 85))):
        assert longest_free(touched, seen, (0, 100), [jump]) == stretch
    assert longest_free(touched, seen, (0, 100), [30, 60, 70]) == (45, 60)
    seen[50:85] = False
    assert longest_free(touched, seen, (0, 100)) == (20, 40)
    assert longest_free(np.ones(100, dtype=bool), seen, (5, 90)) == (5, 90)


def test_rows_outside_of_the_stretch_are_not_seen() -> None:
    poses = blanked(poses_of(swing(0)), FreeSpan(30, 100, ()))
    assert len(poses) == 120
    assert poses.seen.tolist() == [30 <= k < 100 for k in range(120)]
    assert np.isnan(poses.position[:30]).all()
    assert np.isnan(poses.covariance[100:]).all()


def with_arm(until: int, back: int = COUNT) -> object:
    """Return what draws an arm of 14 px from the border to the first hinge, before and after a stretch."""

    def change(k: int, picture: np.ndarray) -> np.ndarray:
        if k < until or k >= back:
            picture = picture.copy()
            cv2.line(picture, (359, 10), (170, 96), 90.0, 14)  # pyright: ignore[reportCallIssue, reportArgumentType]
        return picture

    return change


@pytest.mark.parametrize(("until", "back"), [(0, COUNT), (12, COUNT), (0, 28), (8, 33)])
def test_what_lies_against_the_mechanism_touches_it(tmp_path: Path, until: int, back: int) -> None:
    scene, poses = film(tmp_path, with_arm(until, back))  # type: ignore[arg-type]
    samples = scene.masks.samples
    assert samples.thumbnails is not None
    sampled = np.isin(samples.thumbnails.number, [frame.index for frame in samples.frames])
    touched = touching(samples.thumbnails, sampled, scene, poses)
    assert touched.tolist() == [k < until or k >= back for k in range(COUNT)]
    span = free_span(scene.masks, scene, poses)
    assert span[:2] == (until, back)
    said = (
        f"The motion of the mechanism is taken to be free in frames {until}:{back}, {until / 30:.3f} to "
        f"{(back - 1) / 30:.3f} s: more than usual stands out beside it in other frames, which may touch it "
        "(--time-range A:B [s] gives another range)."
    )
    assert span.notes == (() if (until, back) == (0, COUNT) else (said,))


def test_a_range_that_is_given_is_obeyed(tmp_path: Path) -> None:
    scene, poses = film(tmp_path, with_arm(12))  # type: ignore[arg-type]
    given = replace(scene.masks.samples, given=True, span=(4, 30))
    span = free_span(replace(scene.masks, samples=given), scene, poses)  # type: ignore[type-var]
    assert span == FreeSpan(4, 30, ())


def test_a_prelude_is_named(tmp_path: Path) -> None:
    scene, poses = film(tmp_path, lambda k, picture: picture * min(1.0, k / 6.0))
    span = free_span(scene.masks, scene, poses)
    assert span[:2] == (6, COUNT)
    assert span.notes == (
        "The scene shows in frames 6:40 only; the clip fades there, or shows something else at first or in "
        "the end.",
    )
