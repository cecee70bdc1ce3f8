"""Torques that lead from one state to another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.mechanism.drive import KNOTS, Drive
from monodyn.mechanism.simulate import rollout
from monodyn.results.shot import Shot, _Layout, along, shoot

FREE = np.array([np.inf, np.inf])


def pendubot(**changes: object) -> Shot:
    start, goal = np.array([-np.pi / 2.0, 0.0, 0.0, 0.0]), np.array([np.pi / 2.0, 0.0, 0.0, 0.0])
    shot = Shot(load("double").tree, (0,), start, goal, 2.0, np.array([0.4]), -FREE, FREE, intervals=10)
    return replace(shot, **changes)


def test_the_derivatives_of_the_gaps_are_exact() -> None:
    layout = _Layout(pendubot(rows=(0, 1), limit=np.array([0.4, 0.1])))
    x = layout.guess(3)
    _, slopes = layout.gaps(x)
    rng, step = np.random.default_rng(0), 1e-6
    for _ in range(5):
        way = rng.normal(size=len(x))
        change = (layout.gaps(x + step * way)[0] - layout.gaps(x - step * way)[0]) / (2.0 * step)
        # central differences: the square of the step times third derivatives, and rounding
        np.testing.assert_allclose(slopes @ way, change, atol=1e-6 * np.abs(change).max())


def test_a_turn_from_rest_to_rest_takes_the_least_torque() -> None:
    """u(t) = 6 J theta / T^2 (1 - 2 t / T) turns an inertia J by theta in T with the least mean square."""
    loose = {"gravity": 1e-12, "joint1.damping": 0.0}
    tree = load("single").with_values(loose).tree
    inertia = tree.links[0, 8] + tree.links[0, 5] * tree.links[0, 6] ** 2
    largest = 6.0 * inertia * 1.5 / 0.8**2
    shot = Shot(
        tree, (0,), np.zeros(2), np.array([1.5, 0.0]), 0.8, np.array([2.0 * largest]), -FREE[:1], FREE[:1]
    )
    found = shoot(shot, seed=1)
    assert found.gap < 1e-6
    expected = largest * (1.0 - 2.0 * shot.knots / shot.seconds)
    # the optimiser ends where the cost changes by 1e-6: ripples of 3 % of the torque cost as little
    np.testing.assert_allclose(found.torque[0], expected, atol=0.05 * largest)
    assert found.cost == pytest.approx(1.0 / 12.0, rel=1e-3)


@pytest.mark.slow
def test_what_is_found_leads_there_and_is_followed_at_every_measurement() -> None:
    shot = pendubot(intervals=25)
    found = shoot(shot, seed=0)
    assert found.gap < 1e-3
    assert np.abs(found.torque).max() <= 0.4 * (1.0 + 1e-9)
    states, torque, slopes = along(shot, found, 16)
    assert states.shape == (401, 4)
    assert torque.shape == (400, 1)
    assert slopes.shape == (400, 4, 5)
    np.testing.assert_allclose(states[0], shot.start)
    np.testing.assert_allclose(states[-1], shot.goal)
    # the whole motion by other steps, from a state on the way: an upright start would go astray
    drive = Drive(KNOTS, shot.knots, np.vstack((found.torque, np.zeros((1, len(shot.knots))))))
    times = shot.knots[:11]
    q, _ = rollout(shot.tree, times, shot.start[:2], shot.start[2:], substeps=64, drive=drive)
    np.testing.assert_allclose(q[-1], states[80, :2], atol=1e-3)
    # the derivatives of a step, by differences
    step, row = 1e-6, 100
    stamps = np.array([0.0, 1.0 / 200.0])

    def ahead(state: np.ndarray, push: float) -> np.ndarray:
        drive = Drive(KNOTS, stamps, np.array([[push, push], [0.0, 0.0]]))
        return np.hstack(rollout(shot.tree, stamps, state[:2], state[2:], substeps=1, drive=drive))[1]

    for k, way in enumerate(step * np.eye(5)):
        change = ahead(states[row] + way[:4], torque[row, 0] + way[4])
        change -= ahead(states[row] - way[:4], torque[row, 0] - way[4])
        np.testing.assert_allclose(slopes[row, :, k], change / (2.0 * step), rtol=1e-5, atol=1e-7)


def test_bounds_are_kept_and_what_cannot_be_done_leaves_a_gap() -> None:
    layout = _Layout(pendubot(lower=np.array([-2.0, -np.inf]), upper=np.array([np.inf, 0.5])))
    assert layout.bounds[:4] == [(-2.0, None), (None, 0.5), (None, None), (None, None)]
    assert layout.bounds[-1] == (-1.0, 1.0)
    for seed in (0, 1):
        x = layout.guess(seed)
        for value, (low, high) in zip(x, layout.bounds, strict=True):
            assert low is None or value >= low
            assert high is None or value <= high
    # hardly any torque, and no time
    assert shoot(pendubot(limit=np.array([1e-3]), seconds=0.3, intervals=4), seed=0).gap > 0.1
