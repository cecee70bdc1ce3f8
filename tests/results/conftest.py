"""A fit of the middle third of a motion that is known."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.mechanism.simulate import rollout
from monodyn.stages import identify
from swings import record

ALL = np.arange(120) / 30.0


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
    poses = replace(record(mechanism, ALL[rows], q[rows]), frame=np.arange(40, 80))
    return identify(poses, mechanism).check()
