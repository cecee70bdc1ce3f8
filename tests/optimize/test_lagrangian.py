"""The method of multipliers: known minima with inequalities and bounds, multipliers, what is never called."""

import numpy as np
import pytest

from minima import Counted, rosenbrock
from monodyn.optimize import DirectSettings, augmented_lagrangian, lagrangian, powell

PROBLEMS = {  # Hock and Schittkowski, Test examples for nonlinear programming codes, 1981
    "24": (
        lambda x: ((x[0] - 3.0) ** 2 - 9.0) * x[1] ** 3 / (27.0 * 3.0**0.5), [1.0, 0.5], 0.0,
        lambda x: [x[1] - x[0] / 3.0**0.5, -x[0] - 3.0**0.5 * x[1], x[0] + 3.0**0.5 * x[1] - 6.0],
        [3.0, 3.0**0.5], -1.0,
    ),
    "35": (
        lambda x: 9.0 - 8.0 * x[0] - 6.0 * x[1] - 4.0 * x[2] + 2.0 * x[0] ** 2 + 2.0 * x[1] ** 2 + x[2] ** 2
        + 2.0 * x[0] * x[1] + 2.0 * x[0] * x[2],
        [0.5, 0.5, 0.5], 0.0, lambda x: [x[0] + x[1] + 2.0 * x[2] - 3.0], [4 / 3, 7 / 9, 4 / 9], 1 / 9,
    ),
    "43": (
        lambda x: x[0] ** 2 + x[1] ** 2 + 2.0 * x[2] ** 2 + x[3] ** 2 - 5.0 * x[0] - 5.0 * x[1] - 21.0 * x[2]
        + 7.0 * x[3],
        [0.0, 0.0, 0.0, 0.0], -np.inf,
        lambda x: [
            x @ x + x[0] - x[1] + x[2] - x[3] - 8.0,
            x @ x + x[1] ** 2 + x[3] ** 2 - x[0] - x[3] - 10.0,
            2.0 * x[0] ** 2 + x[1] ** 2 + x[2] ** 2 + 2.0 * x[0] - x[1] - x[3] - 5.0,
        ],
        [0.0, 1.0, 2.0, -1.0], -44.0,
    ),
    "76": (
        lambda x: x[0] ** 2 + 0.5 * x[1] ** 2 + x[2] ** 2 + 0.5 * x[3] ** 2 - x[0] * x[2] + x[2] * x[3] - x[0]
        - 3.0 * x[1] + x[2] - x[3],
        [0.5, 0.5, 0.5, 0.5], 0.0,
        lambda x: [
            x[0] + 2.0 * x[1] + x[2] + x[3] - 5.0, 3.0 * x[0] + x[1] + 2.0 * x[2] - x[3] - 4.0,
            1.5 - x[1] - 4.0 * x[2],
        ],
        [3 / 11, 23 / 11, 0.0, 6 / 11], -103 / 22,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e4])
def test_inequalities_of_hock_and_schittkowski(name, unit):
    function, start, lower, inequalities, truth, value = PROBLEMS[name]
    counted = Counted(lambda x: unit * function(x))
    found = augmented_lagrangian(
        counted,
        np.array(start),
        (lower, np.inf),
        inequalities=inequalities,
        step=0.5,
        settings=DirectSettings(1e-4, 5000),
    )
    assert found.converged, found.status
    # a violation of 1e-4 in constraints whose multipliers are up to 2; the minimum is flat along them
    assert abs(found.value / unit - value) < 1e-3
    np.testing.assert_allclose(found.x, truth, atol=2e-2)
    assert (found.x >= lower).all()
    assert found.violation == max(0.0, *inequalities(found.x))
    assert found.violation <= 1e-4
    assert found.evaluations == counted.calls


def test_multipliers_are_those_of_the_optimality_conditions():
    """At the minimum grad f + sum_j m_j grad g_j = 0, with g of the bounds in steps."""
    function, start, _, inequalities, truth, _ = PROBLEMS["35"]
    found = augmented_lagrangian(
        function,
        np.array(start),
        (0.0, np.inf),
        inequalities=inequalities,
        step=0.5,
        settings=DirectSettings(1e-5, 5000),
    )
    np.testing.assert_allclose(found.multipliers, [0, 0, 0, 0, 0, 0, 2 / 9], atol=2e-3)
    step = np.array([0.5, 0.2])
    bowl = augmented_lagrangian(
        lambda x: (x[0] - 2.0) ** 2 + (x[1] + 1.0) ** 2, np.zeros(2),
        (np.array([-9.0, -0.5]), np.array([1.0, 9.0])), step=step, settings=DirectSettings(1e-5),
    )  # fmt: skip
    np.testing.assert_allclose(bowl.multipliers, [0, 1.0 * step[1], 2.0 * step[0], 0], atol=1e-3)
    assert bowl.x.tolist() == [1.0, -0.5]
    np.testing.assert_allclose(truth, [4 / 3, 7 / 9, 4 / 9])


@pytest.mark.parametrize("offset", [0.0, 1e6])
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e4])
def test_active_bounds_of_a_correlated_quadratic(offset, unit):
    """The bounded minimum is not the clipped free one: with x0 = 1, x1 follows from its own slope alone."""
    hessian = np.array([[2.0, 1.0], [1.0, 2.0]])
    target = np.array([2.0, 0.2])
    best = target[1] - hessian[1, 0] / hessian[1, 1] * (1.0 - target[0])

    def function(x):
        return offset * unit + 0.5 * unit * float((x - target) @ hessian @ (x - target))

    found = augmented_lagrangian(function, np.zeros(2), (-1.0, 1.0), step=0.3)
    assert found.x[0] == 1.0
    assert abs(found.x[1] - best) < 1e-3
    assert found.converged
    assert found.evaluations < 300


def test_without_an_active_constraint_the_first_search_is_the_last():
    def function(x):
        return 1e4 + 1e4 * ((x[0] - 0.1) ** 2 + (x[1] - 0.2) ** 2 + x[0] * x[1])

    free = powell(function, np.zeros(2), 0.3)
    found = augmented_lagrangian(function, np.zeros(2), (-1.0, 1.0), step=0.3)
    assert found.evaluations <= free.evaluations + 4  # the start once more, and one change for each unknown
    assert (found.multipliers == 0.0).all()
    assert found.violation == 0.0
    np.testing.assert_array_equal(found.x, free.x)


def test_the_function_is_never_called_far_outside():
    counted = Counted(lambda x: -float(np.exp(x[0])) + x[1] ** 2)
    found = augmented_lagrangian(counted, np.array([0.5, 0.5]), (-1.0, 1.0), step=0.25)
    assert 1.0 < np.abs(counted.places).max() <= 1.0 + 0.25 + 1e-12
    np.testing.assert_allclose(found.x, [1.0, 0.0], atol=1e-3)


def test_a_function_that_does_not_exist_outside_of_its_bounds():
    found = augmented_lagrangian(
        lambda x: float(np.sqrt(2.0 - x[0])) + x[1] ** 2 if x[0] <= 2.0 else np.nan,
        np.array([0.5, 1.0]), (0.0, 2.0), step=0.4,
    )  # fmt: skip
    assert found.value <= 0.03  # the root of what is left to the bound, 4e-4 by the tolerance
    assert found.x[0] <= 2.0


def test_a_fixed_unknown_stays_and_costs_nothing():
    counted = Counted(lambda x: float((x[0] - 1.0) ** 2 + (x[1] - 1.0) ** 2 + x[2] ** 2))
    found = augmented_lagrangian(
        counted, np.array([0.0, 0.3, 0.2]), (np.array([-2.0, 0.3, -2.0]), np.array([2.0, 0.3, 2.0])), step=0.5
    )
    np.testing.assert_allclose(found.x, [1.0, 0.3, 0.0], atol=1e-3)
    assert all(x[1] == 0.3 for x in counted.places)
    still = augmented_lagrangian(rosenbrock, np.zeros(2), (0.0, 0.0), step=0.5)
    assert (still.converged, still.evaluations, still.value) == (True, 1, 1.0)


@pytest.mark.parametrize("seed", range(8))
def test_a_rough_function_is_never_left_worse_than_it_began(seed):
    """Whole numbers on a rough ground, as a count of pixels is."""
    rng = np.random.default_rng(seed)
    waves = rng.normal(size=(20, 2)) * 8.0

    def function(x):
        return float(np.round(200.0 * np.abs(x - 0.3).sum() + 10.0 * np.sin(waves @ x).sum()))

    start = rng.uniform(-1.0, 1.0, 2)
    counted = Counted(function)
    found = augmented_lagrangian(counted, start, (-1.0, 1.0), step=0.2, settings=DirectSettings(1e-2))
    inside = [function(x) for x in counted.places if np.abs(x).max() <= 1.0]
    assert found.value == function(found.x) == min(inside) <= function(start)
    assert found.evaluations == counted.calls


def test_a_start_outside_of_the_inequalities_is_brought_inside():
    found = augmented_lagrangian(
        lambda x: float(x @ x), np.zeros(2), (-5.0, 5.0), inequalities=lambda x: [3.0 - x[0] - x[1]], step=0.5
    )
    assert found.converged
    np.testing.assert_allclose(found.x, [1.5, 1.5], atol=5e-3)


def test_inequalities_that_contradict_are_said_to():
    found = augmented_lagrangian(
        lambda x: float(x @ x),
        np.zeros(2),
        (-5.0, 5.0),
        inequalities=lambda x: [1.0 - x[0], x[0] + 1.0],
        step=0.5,
    )
    assert not found.converged
    assert found.status == "No point within the inequalities was found; begin from one."
    assert found.violation >= 1.0


def test_multipliers_end_with_their_rounds_and_evaluations(monkeypatch):
    def function(x):
        return float((x[0] - 2.0) ** 2 + x[1] ** 2)

    counted = Counted(function)
    few = DirectSettings(evaluations=20)
    cut = augmented_lagrangian(counted, np.zeros(2), (-1.0, 1.0), step=0.3, settings=few)
    assert cut.evaluations == counted.calls <= 20
    assert cut.status == "The evaluations ran out before the minimum was reached."
    assert cut.value <= function(np.zeros(2))
    monkeypatch.setattr(lagrangian, "ROUNDS", 1)
    short = augmented_lagrangian(function, np.zeros(2), (-1.0, 1.0), step=0.3, settings=DirectSettings(1e-6))
    assert (short.converged, short.x[0]) == (False, 1.0)  # put inside of the bounds all the same
    assert (
        short.status
        == "The rounds of multipliers were over before the constraints were met to the tolerance."
    )


def test_a_step_longer_than_the_box_will_do():
    found = augmented_lagrangian(lambda x: float(np.sum((x - 0.3) ** 2)), np.zeros(2), (-1.0, 1.0), step=7.0)
    np.testing.assert_allclose(found.x, 0.3, atol=7e-3)


def test_a_start_without_a_value_is_said():
    lost = augmented_lagrangian(lambda x: np.nan, np.zeros(2), (-1.0, 1.0), step=0.5)
    assert (lost.converged, lost.evaluations) == (False, 2)
    assert lost.status == "The function is not finite at the start; choose another start."
