"""Start states that are given: the Jacobian against the tangents, joints that are seen late."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.record.samples import prepare
from monodyn.estimation.shooting.problem import posed
from monodyn.mechanism import load
from monodyn.paper.filter import Gains, filtered
from monodyn.paper.fixed_start import FixedStart, start_states, targets
from swings import TIMES, record
from waves import driven


def fixed_start(mechanism, poses):
    problem = posed(replace(mechanism, measured=None), prepare((poses,), mechanism))
    states = (filtered(poses.time, poses.position, Gains(), poses.covariance),)
    return FixedStart(
        problem=problem, start=start_states(problem.data, states),
        target=targets(problem.data, states, "measured", False)[0], white=None,
        scale=np.ones(len(problem.unknowns)), substeps=8,
    )  # fmt: skip


@pytest.mark.parametrize("model", ["friction", "fourier", "free"])
def test_jacobian_against_the_tangents(model):
    """Along the rollout and by central differences, which are exact to 1e-4 of the largest entry."""
    mechanism = load("double").with_torque(model, terms=2, period=0.9, knots=TIMES[:8])
    names = [name for name in mechanism.values if ".torque." in name]
    mechanism = mechanism.with_values(dict.fromkeys(names, 0.01))
    poses = record(mechanism, TIMES[:8], driven(mechanism, TIMES[:8], [0.5, 0.1]), noise=1.0)
    fixed = fixed_start(mechanism, poses)
    x = fixed.problem.unknowns.x0
    exact, expected = fixed.jacobian(x), fixed.differences(x)
    scale = np.maximum(np.abs(expected).max(axis=(0, 1)), 1e-9)
    assert np.abs((exact - expected) / scale).max() < 1e-4
    # what is not compared has no slope, and a filter is differentiated as a whole
    holes = replace(fixed, target=np.where(np.arange(8)[:, None] < 4, fixed.target, np.nan))
    assert not holes.jacobian(x)[4:].any()
    np.testing.assert_allclose(holes.jacobian(x)[:4], exact[:4], atol=1e-9)


def test_a_joint_seen_late_starts_by_its_acceleration():
    """Exact for constant accelerations, which the filter follows exactly."""
    times = np.arange(12) / 30.0
    position = np.stack((0.1 + times, 0.3 - times + 2.0 * times**2), axis=1)
    poses = record(load("double"), times, position, noise=0.0)
    holes = position.copy()
    holes[:3, 1] = np.nan
    poses = replace(poses, position=holes, covariance=np.tile(np.eye(2), (12, 1, 1)))
    fixed = fixed_start(load("double"), poses)
    np.testing.assert_allclose(fixed.start, [[0.1, 0.3, 1.0, -1.0]], atol=1e-10)
