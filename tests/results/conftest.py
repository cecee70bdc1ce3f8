"""A fit of the middle third of a motion that is known."""

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.mechanism.simulate import rollout
from monodyn.stages import identify
from monodyn.types import Poses

ALL = np.arange(120) / 30.0
NOISE = 0.002


@pytest.fixture(scope="package")
def truth():
    """Motion of the bundled double pendulum: what is fitted is its middle third."""
    mechanism = load("double")
    q, v = rollout(mechanism.tree, ALL, np.array([0.3, 0.5]), np.array([0.0, 1.0]), substeps=16)
    return mechanism, q, v


@pytest.fixture(scope="package")
def fit(truth):
    mechanism, q, _ = truth
    rows = slice(40, 80)
    position = q[rows] + NOISE * np.random.default_rng(0).normal(size=(40, 2))
    covariance = np.tile(NOISE**2 * np.eye(2), (40, 1, 1))
    poses = Poses(
        ("joint1", "joint2"), np.arange(40, 80), ALL[rows], position, covariance, np.ones(40, dtype=bool)
    )
    return identify(poses, mechanism).check()
