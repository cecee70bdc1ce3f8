"""Logs of torques on the knots of an integration, against integrals and finite differences."""

import numpy as np
import pytest
from scipy.integrate import quad

from monodyn.mechanism.logged import logged, on_knots
from monodyn.types import TorqueLog

RNG = np.random.default_rng(3)
TIME = np.sort(RNG.uniform(-0.1, 1.1, 61))
LOG = TorqueLog(("joint2",), TIME, RNG.normal(size=(61, 1)))


def test_a_log_on_its_own_rows_stays_as_it_is() -> None:
    values, _ = on_knots(LOG, TIME, 0.0)
    assert np.allclose(values, LOG.torque, atol=1e-10)


@pytest.mark.parametrize("lag", [0.0, 0.037])
def test_knots_have_the_impulse_of_the_log_about_each_of_them(lag: float) -> None:
    knots = np.linspace(0.0, 1.0, 21)
    values, _ = on_knots(LOG, knots, lag)
    bends = np.concatenate((knots, TIME + lag))
    for k in range(len(knots)):
        hat = np.eye(len(knots))[k]

        def missing(time: float, hat: np.ndarray = hat) -> float:
            torque = np.interp(time - lag, TIME, LOG.torque[:, 0])
            return (np.interp(time, knots, values[:, 0]) - torque) * np.interp(time, knots, hat)

        low, high = knots[max(k - 1, 0)], knots[min(k + 1, 20)]
        inside = np.sort(bends[(bends > low) & (bends < high)])
        assert abs(quad(missing, low, high, points=inside, limit=200)[0]) < 1e-9


def test_the_derivative_by_the_lag_is_that_of_finite_differences() -> None:
    knots, step = np.linspace(0.0, 1.0, 21), 1e-6
    _, slopes = on_knots(LOG, knots, 0.02)
    ahead, behind = (on_knots(LOG, knots, 0.02 + s)[0] for s in (step, -step))
    # the torque's slope jumps at its rows, which pass at most one hat's bend within a step
    assert np.allclose(slopes, (ahead - behind) / (2 * step), rtol=1e-3, atol=1e-2)


def test_steps_end_at_the_knots_of_a_log_that_is_faster_than_the_record() -> None:
    times = np.arange(10) / 30
    fast = TorqueLog(("joint2",), np.arange(-0.1, 1, 1 / 120), np.ones((132, 1)))
    known = logged(fast, ("joint1", "joint2"), times)
    assert known.parts == 4
    assert len(known.knots) == 9 * 4 + 1
    whole = known.drive(0.0, 2.0)
    assert np.allclose(whole.times, 2.0 * known.knots)
    assert np.allclose(whole.table, [[0.0], [1.0]])
    part = known.drive(0.0, 1.0, 3, 5)
    assert np.allclose(part.times, known.knots[12:17])
    values, slopes = known.at(0.0)
    assert np.allclose(values, [0.0, 1.0])
    assert np.allclose(slopes, 0.0)
    assert known.drive(0.0, 1.0, 3, 4).table.shape == (2, 0)
