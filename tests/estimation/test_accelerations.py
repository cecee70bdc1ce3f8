"""Accelerations along a motion that is known: the model's own are those of the motion."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.record.samples import prepare
from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.shooting.accelerations import (
    mismatch_cost,
    mismatch_rows,
    model_accelerations,
    smooth_motion,
    torque_response,
)
from monodyn.estimation.shooting.problem import posed
from monodyn.mechanism import load
from monodyn.mechanism.simulate import rollout
from monodyn.mechanism.upright import with_roll
from swings import TIMES, record

STEP = 1e-4
"""Step of the differences of the simulated rates [s]."""


def exact(mechanism, **seen):
    """Simulate a swing: its problem and its motion, the accelerations by differences of the rates."""
    dense = np.arange(-STEP, TIMES[-1] + 1.5 * STEP, STEP / 2.0)
    q0, v0 = (np.resize(values, len(mechanism.joints)) for values in ((0.3, 0.5), (0.0, 1.0)))
    q, v = rollout(mechanism.tree, dense, q0, v0, substeps=2)
    at = np.searchsorted(dense, TIMES - STEP / 4.0)
    times, acceleration = dense[at], (v[at + 1] - v[at - 1]) / STEP
    std = np.full_like(acceleration, 0.1)
    poses = replace(record(mechanism, times, q[at], metric=not seen), **seen)
    problem = posed(mechanism, prepare([poses], mechanism))
    smoothed = Smoothed(times, q[at], v[at], acceleration, std, np.ones(q.shape[1]), std > 1.0)
    return problem, smooth_motion(problem, (smoothed,))


@pytest.mark.parametrize("name", ["single", "double", "cartpole"])
def test_the_model_has_the_accelerations_of_its_own_motion(name):
    problem, motion = exact(load(name))
    found = model_accelerations(problem, problem.unknowns.x0, motion)
    # the differences leave h^2 / 24 of the third derivative of the rates: 4e-10 s^2 of up to 1e6 rad/s^4
    np.testing.assert_allclose(found, motion.acceleration, atol=1e-3)
    assert mismatch_cost(problem, problem.unknowns.x0, motion) < 1e-3


FILMED = load("cartpole").with_values({"time_scale": 0.8}).with_choices(free=["time_scale"])


@pytest.mark.parametrize(
    ("mechanism", "seen"),
    [(load("double"), {}), (FILMED, {"roll": 0.02}), (with_roll(FILMED, 0.1, free=True), {"roll": 0.02})],
)
def test_the_jacobian_is_that_of_the_rows(mechanism, seen):
    """The whole rows moved by a step of 1e-4: good to 1e-6 of the largest."""
    problem, motion = exact(mechanism, **seen)
    x = problem.unknowns.x0 + 0.05
    rows, jacobian = mismatch_rows(problem, x, motion)
    assert mismatch_cost(problem, x, motion) == pytest.approx(rows @ rows)
    for p in range(len(x)):
        step = 1e-4 * np.eye(len(x))[p]
        ends = [mismatch_rows(problem, x + sign * step, motion)[0] for sign in (1.0, -1.0)]
        slope = (ends[0] - ends[1]) / 2e-4
        np.testing.assert_allclose(jacobian[:, p], slope, atol=1e-5 * max(np.abs(slope).max(), 1.0))


def test_a_torque_adds_its_response():
    """The equations of motion are linear in the torque."""
    problem, motion = exact(load("double"))
    x, torque = problem.unknowns.x0, np.random.default_rng(0).normal(size=motion.position.shape)
    none = model_accelerations(problem, x, motion, np.zeros_like(torque))
    response = torque_response(problem, x, motion)
    added = np.einsum("fij,fj->fi", response, torque)
    np.testing.assert_allclose(model_accelerations(problem, x, motion, torque), none + added, rtol=1e-9)
