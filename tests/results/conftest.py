"""A fit of the middle third of a motion that is known, and a film of a chain."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from films import film
from monodyn.mechanism import load
from monodyn.mechanism.simulate import rollout
from monodyn.stages import identify
from monodyn.types import Poses
from monodyn.vision.locating.scene import Scene
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


@pytest.fixture(scope="package")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Scene, Poses]:
    """Film a swinging chain: its scene and its poses as they are in truth."""
    folder: Path = tmp_path_factory.mktemp("chain")
    return film(folder)
