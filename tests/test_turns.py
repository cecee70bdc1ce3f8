"""Whole turns lost in gaps: a double pendulum whose second link spins, out of sight for a time."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.settings import IdentifySettings
from monodyn.mechanism import load
from monodyn.mechanism.simulate import simulate
from monodyn.mechanism.turning import Gap, doubtful_gaps
from monodyn.turns import with_right_turns
from monodyn.types import Poses
from support import slow

FREE = np.array([True, True])


def spun(hidden, turns, count=120, rate=14.0):
    """Return a record whose second joint is not measured in some rows and ``turns`` off after them."""
    time = np.arange(count) / 30.0
    motion = simulate(load("double"), time, np.array([0.4, 0.3]), np.array([1.0, rate]))
    truth = motion.position
    noise = 1e-3 * np.random.default_rng(3).normal(size=truth.shape)
    joint_seen = np.ones(truth.shape, dtype=bool)
    joint_seen[hidden, 1] = False
    position = np.where(joint_seen, truth + noise, np.nan)
    position[hidden.stop :, 1] += 2 * np.pi * turns
    covariance = np.tile(1e-6 * np.eye(2), (count, 1, 1))
    names = ("joint1", "joint2")
    whole = joint_seen.all(axis=1)
    return Poses(names, np.arange(count), time, position, covariance, whole, joint_seen=joint_seen), truth


@pytest.mark.parametrize("turns", [slow(-2), -1, slow(0), slow(1)])
def test_the_dynamics_find_the_turns(turns):
    poses, truth = spun(slice(50, 63), turns)
    assert doubtful_gaps(poses, FREE) == [Gap(1, 49, 63)]
    found, notes = with_right_turns(poses, (0, 120), load("double"), IdentifySettings())
    assert notes == []
    np.testing.assert_allclose(np.where(poses.measured, found.position - truth, 0.0), 0.0, atol=0.01)


def test_a_short_gap_leaves_no_doubt():
    poses, _ = spun(slice(50, 52), 0)
    assert doubtful_gaps(poses, FREE) == []
    assert with_right_turns(poses, (0, 120), load("double"), IdentifySettings())[0] is poses


@pytest.mark.slow
def test_a_short_gap_with_a_turn_too_much_does():
    poses, truth = spun(slice(50, 52), 1)
    assert doubtful_gaps(poses, FREE) == [Gap(1, 49, 52)]
    found, _ = with_right_turns(poses, (0, 120), load("double"), IdentifySettings())
    np.testing.assert_allclose(np.where(poses.measured, found.position - truth, 0.0), 0.0, atol=0.01)


def test_noise_and_gaps_on_either_side_leave_no_doubt():
    poses, truth = spun(slice(50, 51), 0, rate=6.0)
    noise = np.radians(1.0) * np.random.default_rng(1).normal(size=truth.shape)
    covariance = np.tile(np.radians(1.0) ** 2 * np.eye(2), (len(truth), 1, 1))
    joint_seen = poses.measured.copy()
    joint_seen[[1, 9, 40, 43, 46, 53, 90], 1] = False
    noisy = replace(
        poses, position=np.where(joint_seen, truth + noise, np.nan), covariance=covariance,
        seen=joint_seen.all(axis=1), joint_seen=joint_seen,
    )  # fmt: skip
    assert doubtful_gaps(noisy, FREE) == []


def test_a_gap_after_the_fitted_rows_is_crossed_by_prediction():
    poses, truth = spun(slice(80, 92), -1)
    found, notes = with_right_turns(poses, (0, 70), load("double"), IdentifySettings())
    assert notes == []
    np.testing.assert_allclose(np.where(poses.measured, found.position - truth, 0.0), 0.0, atol=0.01)


def test_what_stays_open_is_said():
    poses, _ = spun(slice(5, 30), 0, count=40)
    part = replace(poses, metric=True)
    found, notes = with_right_turns(part, (0, 9), load("double"), IdentifySettings())
    assert found is part
    assert notes == [
        "The whole turns of 'joint2' from frame 30 on are not certain: it was out of sight too long, and the "
        "motion before does not determine them."
    ]


def test_pictures_that_are_missing_at_every_other_time_are_no_gap():
    poses, _ = spun(slice(50, 50), 0)
    joint_seen = np.ones(poses.position.shape, dtype=bool)
    joint_seen[1::2] = False
    half = replace(poses, seen=joint_seen.all(axis=1), joint_seen=joint_seen)
    assert doubtful_gaps(half, FREE) == []
