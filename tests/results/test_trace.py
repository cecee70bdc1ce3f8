"""A record next to its motion: frame numbers, held-out errors, metres."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fits import TIME, made_fit, record
from monodyn.errors import VideoError
from monodyn.estimation.parts import Common
from monodyn.mechanism import load
from monodyn.mechanism.upright import ROLL_STD
from monodyn.results.predict import predict
from monodyn.results.trace import (
    counted,
    fitted_poses,
    frame_numbers,
    metric,
    rms_of,
    shared_errors,
    trace_of,
)
from monodyn.types import Poses
from support import refuses


def test_heldout_counts_seen_and_predicted_rows_alone() -> None:
    fit = made_fit()
    poses = record(fit)
    trace = trace_of(fit, poses, predict(fit, times=poses.time[20:25]))
    assert trace.heldout() == {"joint1": pytest.approx(1e-3, rel=1e-3)}  # the record is 1 mrad off
    assert trace_of(fit, poses).heldout() == {"joint1": None}
    assert rms_of(["a", "b"], np.array([[3.0, np.nan], [4.0, np.nan]])) == {"a": math.sqrt(12.5), "b": None}


def test_frame_numbers_go_on_beyond_the_record() -> None:
    known, numbers = np.array([0.0, 0.1, 0.2, 0.4]), np.array([0, 1, 2, 4])
    assert frame_numbers(np.array([0.2, 0.4, 0.5, 0.6]), known, numbers).tolist() == [2, 4, 5, 6]


def test_slides_become_metric() -> None:
    mechanism = load("cartpole")
    joints = tuple(joint.name for joint in mechanism.joints)
    poses = Poses(
        joints,
        np.arange(2),
        np.arange(2.0),
        np.ones((2, 2)),
        np.ones((2, 2, 2)),
        np.ones(2, bool),
        metric=False,
    )
    found = metric(poses, mechanism, 0.5)
    slide = [joint.kind for joint in mechanism.joints].index("slide")
    assert found.metric
    assert found.position[0, slide] == 0.5
    assert found.position[0, 1 - slide] == 1.0
    assert found.covariance[0, slide, slide] == 0.25
    assert metric(found, mechanism, 0.5) is found


def test_what_positions_have_in_common_is_taken_off_once() -> None:
    mechanism, count = load("double"), 3
    shifts = np.stack([np.full((count, 2), 0.01), np.full((count, 2), 0.02)])
    poses = Poses(
        ("joint1", "joint2"), np.arange(count), np.arange(float(count)), np.ones((count, 2)),
        np.ones((count, 2, 2)), np.ones(count, bool), shifts=shifts,
    )  # fmt: skip
    common = Common(np.array([1.0, -2.0]), np.diag([0.25, 0.0]))
    found = metric(poses, mechanism, 1.0, common)
    np.testing.assert_allclose(found.position, 1.0 - 0.01 + 0.04)
    assert found.shifts is not None
    np.testing.assert_allclose(np.sum(found.shifts**2, axis=0), 0.005**2)
    assert metric(found, mechanism, 1.0, common) is found


def test_roll_common_errors_and_scale_are_taken_off_together_as_one_after_the_other() -> None:
    mechanism, rng = load("cartpole"), np.random.default_rng(0)
    joints = tuple(joint.name for joint in mechanism.joints)
    poses = Poses(
        joints, np.arange(4), np.arange(4.0), rng.normal(size=(4, 2)), np.tile(np.eye(2), (4, 1, 1)),
        np.ones(4, bool), metric=False, roll=0.1, shifts=rng.normal(size=(3, 4, 2)),
    )  # fmt: skip
    common = Common(np.array([0.1, -0.2, 0.3]), np.diag([0.5, 0.6, 0.7]))
    found = metric(poses, mechanism, 0.5, common)
    upright = metric(replace(poses, metric=True, cleared=True), mechanism, 1.0)
    clear = metric(replace(upright, cleared=False), mechanism, 1.0, common)
    wanted = metric(replace(clear, metric=False), mechanism, 0.5)
    assert (upright.roll, clear.cleared, found.roll, found.cleared) == (None, True, None, True)
    for name in ("position", "covariance", "shifts"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name))


def test_shared_errors_are_those_of_sizes_and_roll() -> None:
    """However they are turned, their covariance is that of the shifts and of a roll of 3 deg."""
    rng, double = np.random.default_rng(1), load("double").with_choices(free=["camera.roll"])
    shifts = 0.01 * rng.normal(size=(3, 8, 2))
    poses = Poses(
        ("joint1", "joint2"), np.arange(8), np.arange(8.0), rng.normal(size=(8, 2)),
        np.tile(1e-8 * np.eye(2), (8, 1, 1)), np.ones(8, dtype=bool), shifts=shifts,
    )  # fmt: skip

    def covariance(directions: np.ndarray) -> np.ndarray:
        return np.tensordot(directions, directions, axes=(0, 0))

    rolled = np.zeros((1, 8, 2))
    rolled[..., 0] = ROLL_STD
    found = shared_errors(poses, double)
    assert found is not None
    np.testing.assert_allclose(covariance(found), covariance(np.concatenate((shifts, rolled))), atol=1e-9)
    given = shared_errors(poses, load("double"))
    assert given is not None
    np.testing.assert_allclose(covariance(given), covariance(shifts), atol=1e-9)
    assert shared_errors(replace(poses, shifts=None, roll=None), double) is None
    # below what all positions together tell apart
    exact = replace(poses, shifts=1e-7 * shifts, roll=None)
    assert shared_errors(exact, double) is None


def test_frames_without_numbers_are_counted_where_the_stamps_tell() -> None:
    assert counted(np.arange(50, 60) / 30.0).tolist() == list(range(50, 60))
    assert counted(np.round(np.arange(50, 60) / 30.0, 3)).tolist() == list(range(50, 60))
    assert counted(np.arange(10) * 0.1 + 0.05).tolist() == list(range(10))
    assert counted(np.array([1.0, 1.1, 1.3])).tolist() == [0, 1, 2]


def test_the_record_must_be_the_one_that_was_fitted() -> None:
    fit = made_fit()
    said = "poses: expected the record that was fitted, got other time stamps; pass the same record."
    with refuses(VideoError, said):
        trace_of(fit, record(fit)[5:30])
    assert trace_of(fit, record(fit)).rows == (0, 20)


def test_the_fitted_frames_come_back_from_the_residual() -> None:
    poses = fitted_poses(made_fit())
    assert poses.frame.tolist() == list(range(20))
    assert np.array_equal(poses.time, TIME)
    assert np.flatnonzero(~poses.seen).tolist() == [7]
