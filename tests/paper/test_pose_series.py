"""The common period of poses: of made series, of swings, of less than one period."""

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.mechanism.drive import fourier_basis
from monodyn.paper.pose_series import MOST_HARMONICS, pose_series
from swings import double_truth, motion

NOISE = np.full(2, 1e-3)
"""Noise of the made poses [rad]."""


def made(times, period, seed=0):
    """Return noisy positions of two joints whose series have one and three harmonics."""
    table = np.zeros((7, 2))
    table[:3, 0] = 0.3, 0.5, -0.2
    table[:, 1] = 0.1, 0.2, 0.1, -0.3, 0.1, 0.2, 0.15
    noise = NOISE * np.random.default_rng(seed).normal(size=(len(times), 2))
    return fourier_basis(times, period, 3) @ table + noise, table


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_period_and_harmonics_of_a_made_series(seed):
    """Two and a half periods with gaps; one joint needs a single harmonic."""
    times = 3.0 + np.arange(80) / 30.0
    values, table = made(times, 1.1, seed)
    values[20:26] = values[50, 1] = np.nan
    found = pose_series(times, values, NOISE)
    assert found.period == pytest.approx(1.1, rel=1e-3)
    assert found.periods == pytest.approx(79 / 30.0 / 1.1, rel=1e-3)
    assert found.harmonics == (1, MOST_HARMONICS)
    np.testing.assert_allclose(found.coefficients, table, atol=0.01)


def test_one_period_of_a_swing_and_less():
    """A pendulum that hardly loses energy: its own period, from zero crossings, within 5 %."""
    truth = load("single")
    long = np.arange(3000) / 1000.0
    swing = motion(truth, long, [-1.0], [0.0])[:, 0]
    down = np.flatnonzero((swing[:-1] > -np.pi / 2) & (swing[1:] <= -np.pi / 2))
    period = float(np.mean(np.diff(long[down])))
    for share in (0.7, 1.2, 2.5):
        times = np.arange(0.0, share * period, 1 / 60.0)
        found = pose_series(times, motion(truth, times, [-1.0], [0.0]), NOISE[:1])
        assert found.period == pytest.approx(period, rel=0.05)
        assert (found.periods < 1.0) == (share < 1.0)


@pytest.mark.slow
def test_a_decaying_double_pendulum():
    """The common period hardly depends on how much of the swing is seen."""
    times = np.arange(160) / 30.0
    position = motion(double_truth(), times, [-1.2, 0.3], [0.0, 0.0])
    found = [pose_series(times[:n], position[:n], NOISE).period for n in (40, 80, 160)]
    np.testing.assert_allclose(found, found[-1], rtol=0.05)


def test_bounds_and_a_known_period():
    times = np.arange(80) / 30.0
    values, table = made(times, 1.1)
    assert pose_series(times, values, NOISE, (1.3, 1.6)).period >= 1.3
    known = pose_series(times, values, NOISE, (1.1, 1.1))
    assert known.period == pytest.approx(1.1, rel=1e-12)
    np.testing.assert_allclose(known.coefficients, table, atol=0.01)
    # ten times the record: no scan reaches it, and it is taken all the same
    beyond = pose_series(times, values, NOISE, (30.0, 40.0))
    assert beyond.period == pytest.approx(30.0)
    assert beyond.harmonics == (1, 1)
