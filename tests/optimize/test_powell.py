"""Conjugate directions: known minima, valleys, kinks, the count of evaluations."""

import numpy as np
import pytest

from minima import Counted, beale, booth, himmelblau, powell_singular, rosenbrock
from monodyn.errors import SettingsError
from monodyn.optimize import DirectSettings, powell
from support import refuses


@pytest.mark.parametrize(
    ("function", "start", "truth", "most"),
    [
        (rosenbrock, [-1.2, 1.0], [[1.0, 1.0]], 500),
        (beale, [1.0, 1.0], [[3.0, 0.5]], 350),
        (booth, [0.0, 0.0], [[1.0, 3.0]], 200),
        (
            himmelblau, [0.0, 0.0],
            [[3.0, 2.0], [-2.805118, 3.131312], [-3.77931, -3.283186], [3.584428, -1.848126]], 200,
        ),
    ],
)  # fmt: skip
def test_conjugate_directions_reach_known_minima(function, start, truth, most):
    counted = Counted(function)
    found = powell(counted, np.array(start), 0.5, settings=DirectSettings(1e-5))
    assert found.converged
    assert found.status == "The minimum is reached."
    # lines are searched to 1e-5 of a step of 0.5; the valleys lie across the axes
    assert min(np.abs(found.x - np.array(t)).max() for t in truth) < 1e-4
    assert found.evaluations == counted.calls < most
    assert found.value == min(function(x) for x in counted.places)


def test_the_singular_function_is_lowered_to_nothing():
    """Powell's singular function has a Hessian of rank 2 at its minimum."""
    found = powell(powell_singular, np.array([3.0, -1.0, 0.0, 1.0]), 0.5, settings=DirectSettings(1e-5, 5000))
    assert found.value < 1e-8


def test_a_quadratic_is_minimized_whatever_its_axes_and_units():
    rng = np.random.default_rng(2)
    root = rng.normal(size=(8, 6))
    size = 10.0 ** rng.uniform(-3, 3, 6)
    target = rng.normal(size=6)
    found = powell(
        lambda x: float(np.sum((root @ (x / size - target)) ** 2)),
        np.zeros(6),
        0.5 * size,
        settings=DirectSettings(1e-5),
    )
    np.testing.assert_allclose(found.x / size, target, atol=1e-4)


def test_conjugate_directions_are_found():
    """On a quadratic in two unknowns the third round's line ends at the minimum, however long the valley."""
    found = powell(
        lambda x: (x[0] + x[1]) ** 2 + 1e-4 * (x[0] - x[1] - 8.0) ** 2,
        np.zeros(2),
        1.0,
        settings=DirectSettings(1e-6),
    )
    np.testing.assert_allclose(found.x, [4.0, -4.0], atol=1e-3)
    assert found.evaluations < 300  # by the axes alone it takes some 10^4 rounds


def test_kinks_along_the_axes_are_no_hindrance():
    found = powell(
        lambda x: float(np.sum([1.0, 5.0, 0.2] * np.abs(x - [1.0, -2.0, 0.5]))),
        np.zeros(3),
        0.7,
        settings=DirectSettings(1e-4),
    )
    np.testing.assert_allclose(found.x, [1.0, -2.0, 0.5], atol=1e-4)


def test_history_falls_and_counts():
    counted = Counted(rosenbrock)
    found = powell(counted, np.array([-1.2, 1.0]), 0.5)
    assert found.history[0].tolist() == [1.0, rosenbrock(np.array([-1.2, 1.0]))]
    assert (np.diff(found.history[:, 0]) > 0).all()
    assert (np.diff(found.history[:, 1]) <= 0).all()
    assert found.history[-1, 1] == found.value


@pytest.mark.parametrize("most", [1, 2, 3, 7, 20, 61])
def test_evaluations_are_never_exceeded(most):
    counted = Counted(rosenbrock)
    found = powell(counted, np.array([-1.2, 1.0]), 0.5, settings=DirectSettings(evaluations=most))
    assert found.evaluations == counted.calls <= most
    assert not found.converged
    assert found.status == "The evaluations ran out before the minimum was reached."
    assert found.value == min(rosenbrock(x) for x in counted.places)


def test_one_unknown_takes_one_line():
    found = powell(lambda x: (x[0] - 2.0) ** 2, np.array([0.0]), 1.0)
    assert abs(found.x[0] - 2.0) < 1e-3
    assert len(found.history) == 2


def test_powell_stays_where_the_function_exists():
    found = powell(
        lambda x: x[0] - np.log(x[0]) + x[1] ** 2 if x[0] > 0 else np.nan, np.array([0.1, 1.0]), 0.5
    )
    np.testing.assert_allclose(found.x, [1.0, 0.0], atol=2e-2)
    lost = powell(lambda x: np.nan, np.zeros(2), 0.5)
    assert (lost.converged, lost.evaluations) == (False, 1)
    assert lost.status == "The function is not finite at the start; choose another start."


def test_powell_refuses_a_step_of_nothing():
    with refuses(SettingsError, "unknown 1: expected a step above 0, got 0."):
        powell(rosenbrock, np.zeros(2), np.array([1.0, 0.0]))
