"""Angles that go on: no turn between rows in which a hinge was seen, those of its rates where it was not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.mechanism.simulate import simulate
from monodyn.mechanism.turning import TURN, doubtful_gaps, unwound
from monodyn.types import Poses

ALONE = np.ones(1, dtype=bool)


def filmed(rate: float, away: float, speed: float, hidden: tuple[int, ...]) -> tuple[Poses, np.ndarray]:
    """Return three seconds of the single pendulum as pictures show it, between plus and minus half a turn,
    and as it moves.

    Args:
        rate: Pictures a second.
        away: From where it hangs [rad].
        speed: At the start [rad/s].
        hidden: Rows in which it is not seen.
    """
    time = np.arange(round(3.0 * rate)) / rate
    slippery = load("single").with_values({"joint1.damping": 1e-5})
    truth = simulate(slippery, time, np.array([away - np.pi / 2.0]), np.array([speed])).position
    seen = ~np.isin(np.arange(len(time)), hidden)
    shown = np.where(seen[:, None], np.remainder(truth + np.pi, TURN) - np.pi, np.nan)
    covariance = np.full((len(time), 1, 1), 1e-6)
    return Poses(("joint1",), np.arange(len(time)), time, shown, covariance, seen), truth


def off(poses: Poses, truth: np.ndarray) -> np.ndarray:
    """Return by how many turns the seen rows are off, less those of the first one."""
    rows = poses.seen
    turns = np.round((poses.position[rows, 0] - truth[rows, 0]) / TURN)
    return turns - turns[0]


@pytest.mark.parametrize("rate", [8.0, 12.0, 20.0, 30.0])
@pytest.mark.parametrize("hidden", [(), (13,), (13, 14)])
@pytest.mark.parametrize(
    ("away", "speed"), [(np.radians(50.0), 0.0), (np.radians(110.0), 0.0), (0.0, 20.0), (0.0, -23.0)]
)
def test_swings_make_no_turn_and_turns_are_counted(
    rate: float, hidden: tuple[int, ...], away: float, speed: float
) -> None:
    """Up to two pictures are missing: over three intervals at 8 Hz, 0.375 s, even a swing may go around."""
    if rate == 8.0:
        hidden = hidden[:1]
    poses, truth = filmed(rate, away, speed, hidden)
    assert not off(unwound(poses, ALONE), truth).any()
    assert np.ptp(truth) > 3.0 * TURN or not speed


def test_turns_that_were_invented_between_seen_rows_are_taken_out() -> None:
    """Whatever the tracking made of them, and not those of a joint whose turns are known."""
    poses, truth = filmed(12.0, np.radians(50.0), 0.0, (17, 18, 19))
    position = np.where(np.arange(len(truth))[:, None] >= 22, truth - TURN, truth)
    jumped = replace(poses, position=np.where(poses.seen[:, None], position, np.nan))
    assert off(jumped, truth).any()
    right = unwound(jumped, ALONE)
    assert not off(right, truth).any()
    np.testing.assert_allclose(right.position[poses.seen], truth[poses.seen], atol=1e-12)
    assert np.isnan(right.position[~poses.seen]).all()
    assert off(unwound(jumped, ~ALONE), truth).any()
    # once is enough
    np.testing.assert_array_equal(unwound(right, ALONE).position, right.position)


def test_across_a_long_gap_a_hinge_goes_the_smaller_way_and_leaves_a_doubt() -> None:
    """Half a period at 8 Hz: its rates go with more than one number of turns, and the dynamics decide."""
    poses, truth = filmed(8.0, np.radians(80.0), 0.0, tuple(range(9, 14)))
    found = unwound(poses, ALONE)
    rows = np.flatnonzero(found.seen)
    assert np.abs(np.diff(found.position[rows, 0])).max() <= np.pi
    assert [(gap.before, gap.after) for gap in doubtful_gaps(found, ALONE)] == [(8, 14)]
    # the same doubt whatever turns it was found with
    other = replace(poses, position=np.where(np.arange(len(truth))[:, None] >= 14, truth + TURN, truth))
    assert len(doubtful_gaps(replace(other, seen=poses.seen), ALONE)) == 1


def test_a_joint_that_was_never_or_once_seen_stays_as_it_is() -> None:
    poses, _ = filmed(12.0, 1.0, 0.0, ())
    for count in (0, 1):
        seen = np.arange(len(poses.seen)) < count
        few = replace(poses, seen=seen, position=np.where(seen[:, None], poses.position, np.nan))
        np.testing.assert_array_equal(unwound(few, ALONE).position, few.position)
