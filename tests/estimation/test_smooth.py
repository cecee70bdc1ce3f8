"""Local cubics: exact on cubics, close on a swing, gaps and gross errors."""

import numpy as np
import pytest

from monodyn.estimation.record.smooth import motion_size, smooth
from swings import white


def record(time, position, seen=None):
    position = np.asarray(position, dtype=float).reshape(len(time), -1)
    names = tuple(f"joint{i + 1}" for i in range(position.shape[1]))
    return white(names, time, position, 1e-3, seen=seen)


def test_a_cubic_is_met_exactly_at_uneven_times():
    time = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.05, 40))
    found = smooth(record(time, 1.0 + 2.0 * time - 3.0 * time**2 + 4.0 * time**3))
    np.testing.assert_allclose(found.velocity[:, 0], 2.0 - 6.0 * time + 12.0 * time**2, rtol=1e-6)
    np.testing.assert_allclose(found.acceleration[:, 0], -6.0 + 24.0 * time, rtol=1e-5)


def test_a_swing_with_noise():
    """1 rad at 1 Hz, 30 Hz, 2 mrad: the rate is known to a few times noise / spacing / sqrt(neighbours)^3."""
    time = np.arange(60) / 30.0
    rng = np.random.default_rng(2)
    found = smooth(record(time, np.sin(2 * np.pi * time) + 0.002 * rng.normal(size=60)))
    assert np.std(found.velocity[3:-3, 0] - 2 * np.pi * np.cos(2 * np.pi * time)[3:-3]) < 0.1
    assert 0.001 < found.noise[0] < 0.004
    assert not found.outlier.any()


def test_gaps_and_gross_errors():
    time = np.arange(80) / 30.0
    truth = np.sin(2 * np.pi * time)
    position = truth + 0.001 * np.random.default_rng(3).normal(size=80)
    position[[17, 40]] += [0.8, -2.0]
    position[50:54] = np.nan
    seen = np.ones(80, dtype=bool)
    seen[60:63] = False
    found = smooth(record(time, position, seen))
    far = np.flatnonzero(found.outlier[:, 0])
    assert {17, 40} <= set(far.tolist())
    assert len(far) <= 4  # a sample at the edge of a gap may look far off too
    # in the gap a cubic spans the samples on either side: h^4/4! of the fourth derivative with h = 0.12 s
    np.testing.assert_allclose(found.position[:, 0], truth, atol=0.05)


def test_too_few_samples_give_nan():
    found = smooth(record(np.arange(4.0), np.arange(4.0)))
    assert np.isnan(found.position).all()


@pytest.mark.parametrize("count", [5, 6, 8])
def test_short_records_work(count):
    time = np.arange(count) * 0.1
    np.testing.assert_allclose(smooth(record(time, 3.0 * time)).velocity, 3.0, atol=1e-6)


@pytest.mark.parametrize("position", [(0, 0, 0, 0.5, 2), (0, 0, 0.5, 1, 1), (0, 0, 1, 2, 2)])
def test_five_samples_have_none_that_is_far_off(position):
    """With fewer than five samples left there is no cubic to tell what is far off."""
    found = smooth(record(np.arange(5) * 0.1, position))
    assert np.isfinite(found.acceleration).all()
    assert not found.outlier.any()


def test_no_gross_error_makes_a_motion_larger():
    """A sine of one half has the deviation 0.5 / sqrt(2), whatever one sample in forty says."""
    values = 0.5 * np.sin(np.linspace(0.0, 8.0 * np.pi, 400, endpoint=False))
    assert motion_size(values) == pytest.approx(0.5 / np.sqrt(2.0), rel=1e-9)
    values[::50] = 1e20
    assert motion_size(values) == pytest.approx(0.5 / np.sqrt(2.0), rel=0.2)
    assert motion_size(values[:0]) == 0.0
