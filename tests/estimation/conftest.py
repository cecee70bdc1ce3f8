"""Records and fits that several modules of the room look at."""

import pytest

from driven import DOUBLE, simulated, wave
from monodyn.mechanism import load
from monodyn.stages import identify
from swings import TIMES, double_truth, motion, record


@pytest.fixture(scope="session")
def double():
    return load("double")


@pytest.fixture(scope="session")
def truth():
    return double_truth()


@pytest.fixture(scope="session")
def poses(truth):
    return record(truth, TIMES, motion(truth, TIMES, [0.3, 0.5], [0.0, 1.0]))


@pytest.fixture(scope="session")
def fit(poses, double):
    return identify(poses, double)


@pytest.fixture(scope="session")
def driven():
    return simulated(DOUBLE, [-1.5, 0.3], 150, wave)


@pytest.fixture(scope="session")
def passive():
    return simulated(DOUBLE, [-0.8, 0.4], 120)
