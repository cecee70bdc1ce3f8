"""Searches without derivatives, the method of multipliers, BFGS, evolution: known minima."""

import numpy as np
import pytest

from monodyn.errors import SettingsError
from monodyn.optimize import (
    augmented_lagrangian,
    bounded_bfgs,
    evolve,
    golden_section,
    line_search,
    powell,
    swann,
)


class Counted:
    """A function and the number of its calls; remembers where it was called."""

    def __init__(self, function):
        self.function, self.calls, self.places = function, 0, []

    def __call__(self, x):
        self.calls += 1
        self.places.append(np.array(x))
        return self.function(x)


def rosenbrock(x):
    return 100.0 * (x[1] - x[0] ** 2) ** 2 + (1.0 - x[0]) ** 2


def rosenbrock_residuals(x):
    return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])


def himmelblau(x):
    return (x[0] ** 2 + x[1] - 11.0) ** 2 + (x[0] + x[1] ** 2 - 7.0) ** 2


def beale(x):
    return sum((c - x[0] + x[0] * x[1] ** k) ** 2 for k, c in enumerate((1.5, 2.25, 2.625), start=1))


def booth(x):
    return (x[0] + 2.0 * x[1] - 7.0) ** 2 + (2.0 * x[0] + x[1] - 5.0) ** 2


def powell_singular(x):
    return (x[0] + 10 * x[1]) ** 2 + 5 * (x[2] - x[3]) ** 2 + (x[1] - 2 * x[2]) ** 4 + 10 * (x[0] - x[3]) ** 4


def rastrigin(x):
    return 10.0 * len(x) + np.sum(x * x - 10.0 * np.cos(2.0 * np.pi * x), axis=0)


# the line


def test_swann_doubles_its_steps_until_the_function_rises():
    function = Counted(lambda x: (x - 12.0) ** 2)
    found = swann(function, 0.0, 1.0)
    assert [float(x) for x in function.places] == [0.0, 1.0, 3.0, 7.0, 15.0, 31.0]
    assert (found.low, found.middle, found.high, found.value) == (7.0, 15.0, 31.0, 9.0)
    assert found.closed
    assert found.evaluations == function.calls


@pytest.mark.parametrize("target", [-37.3, -0.2, 0.0, 0.4, 5.0, 1e4])
def test_swann_encloses_the_minimum(target):
    found = swann(lambda x: abs(x - target), 0.0, 0.5)
    assert found.low <= target <= found.high
    assert found.low <= found.middle <= found.high
    assert found.value <= min(abs(found.low - target), abs(found.high - target))


def test_swann_ends_on_a_bound_and_never_calls_beyond():
    function = Counted(lambda x: -x)
    found = swann(function, 0.0, 1.0, -5.0, 10.0)
    assert found.middle == found.high == 10.0
    assert max(function.places) <= 10.0
    assert found.evaluations == function.calls


def test_swann_says_when_the_function_falls_for_ever():
    function = Counted(lambda x: -x)
    found = swann(function, 0.0, 1.0, most=9)
    assert not found.closed
    assert found.evaluations == function.calls == 9
    assert found.value == -found.middle == min(-x for x in function.places)


def test_the_golden_section_takes_the_evaluations_of_its_ratio():
    """Each evaluation keeps 0.618 of the interval; one more is spent on the first point."""
    function = Counted(lambda x: (x - 2.2) ** 2)
    found = golden_section(function, 0.0, 5.0, 1e-4)
    expected = int(np.ceil(np.log(1e-4 / 5.0) / np.log((5.0**0.5 - 1.0) / 2.0))) + 1
    assert found.evaluations == function.calls == expected
    assert abs(found.x - 2.2) <= 1e-4


@pytest.mark.parametrize("seed", range(5))
def test_a_line_search_gives_the_best_point_it_ever_evaluated(seed):
    """Rough functions have no single valley; the answer is still the least value seen."""
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0.0, 6.0, 8)
    function = Counted(lambda x: 0.01 * x * x + float(np.sum(np.sin(np.arange(1, 9) * x + phases))))
    found = line_search(function, 1.0, 0.3, -6.0, 6.0, 1e-3)
    values = [function.function(x) for x in function.places]
    assert found.value == min(values) <= values[0]
    assert found.evaluations == function.calls


def test_a_minimum_on_the_bound_is_exact():
    assert line_search(lambda x: (x - 3.0) ** 2, 0.0, 0.4, -1.0, 2.0, 1e-3).x == 2.0
    assert line_search(lambda x: (x + 3.0) ** 2, 0.0, 0.4, -1.0, 2.0, 1e-3).x == -1.0


def test_nan_on_a_line_counts_as_infinite():
    found = line_search(lambda x: x * x - 4.0 * x if x < 1.5 else np.nan, 0.0, 0.5, tolerance=1e-4)
    assert 1.4999 < found.x < 1.5


def test_lines_refuse_what_they_cannot_use():
    with pytest.raises(SettingsError, match=r"^swann: expected a step above 0, got 0\.$"):
        swann(abs, 0.0, 0.0)
    with pytest.raises(
        SettingsError, match=r"^swann: the start 3 is outside its bounds 0 to 1; move it inside\.$"
    ):
        swann(abs, 3.0, 1.0, 0.0, 1.0)
    with pytest.raises(
        SettingsError, match=r"^golden_section: expected 2 <= 1\.\d+ <= 1; order the points\.$"
    ):
        golden_section(abs, 2.0, 1.0, 0.1)


# conjugate directions


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
    found = powell(counted, np.array(start), 0.5, tolerance=1e-5)
    assert found.converged
    assert found.status == "The minimum is reached."
    # lines are searched to 1e-5 of a step of 0.5; the valleys lie across the axes
    assert min(np.abs(found.x - np.array(t)).max() for t in truth) < 1e-4
    assert found.evaluations == counted.calls < most
    assert found.value == min(function(x) for x in counted.places)


def test_the_singular_function_is_lowered_to_nothing():
    """Powell's singular function has a Hessian of rank 2 at its minimum."""
    found = powell(powell_singular, np.array([3.0, -1.0, 0.0, 1.0]), 0.5, tolerance=1e-5, most=5000)
    assert found.value < 1e-8


def test_a_quadratic_is_minimized_whatever_its_axes_and_units():
    rng = np.random.default_rng(2)
    root = rng.normal(size=(8, 6))
    size = 10.0 ** rng.uniform(-3, 3, 6)
    target = rng.normal(size=6)
    found = powell(
        lambda x: float(np.sum((root @ (x / size - target)) ** 2)), np.zeros(6), 0.5 * size, tolerance=1e-5
    )
    np.testing.assert_allclose(found.x / size, target, atol=1e-4)


def test_conjugate_directions_are_found():
    """On a quadratic in two unknowns the third round's line ends at the minimum, however long the valley."""
    found = powell(
        lambda x: (x[0] + x[1]) ** 2 + 1e-4 * (x[0] - x[1] - 8.0) ** 2, np.zeros(2), 1.0, tolerance=1e-6
    )
    np.testing.assert_allclose(found.x, [4.0, -4.0], atol=1e-3)
    assert found.evaluations < 300  # by the axes alone it takes some 10^4 rounds


def test_kinks_along_the_axes_are_no_hindrance():
    found = powell(
        lambda x: float(np.sum([1.0, 5.0, 0.2] * np.abs(x - [1.0, -2.0, 0.5]))),
        np.zeros(3),
        0.7,
        tolerance=1e-4,
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
    found = powell(counted, np.array([-1.2, 1.0]), 0.5, most=most)
    assert found.evaluations == counted.calls <= most
    assert not found.converged
    assert found.status == "The evaluations ran out before the minimum was reached."
    assert found.value == min(rosenbrock(x) for x in counted.places)


def test_one_unknown_takes_one_line():
    found = powell(lambda x: (x[0] - 2.0) ** 2, np.array([0.0]), 1.0, tolerance=1e-3)
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
    with pytest.raises(SettingsError, match=r"^unknown 1: expected a step above 0, got 0\.$"):
        powell(rosenbrock, np.zeros(2), np.array([1.0, 0.0]))


# multipliers

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
        lower,
        np.inf,
        inequalities=inequalities,
        step=0.5,
        tolerance=1e-4,
        most=5000,
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
        function, np.array(start), 0.0, np.inf, inequalities=inequalities, step=0.5, tolerance=1e-5, most=5000
    )
    np.testing.assert_allclose(found.multipliers, [0, 0, 0, 0, 0, 0, 2 / 9], atol=2e-3)
    step = np.array([0.5, 0.2])
    bowl = augmented_lagrangian(
        lambda x: (x[0] - 2.0) ** 2 + (x[1] + 1.0) ** 2, np.zeros(2), [-9.0, -0.5], [1.0, 9.0], step=step,
        tolerance=1e-5,
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

    found = augmented_lagrangian(function, np.zeros(2), -1.0, 1.0, step=0.3, tolerance=1e-3)
    assert found.x[0] == 1.0
    assert abs(found.x[1] - best) < 1e-3
    assert found.converged
    assert found.evaluations < 300


def test_without_an_active_constraint_the_first_search_is_the_last():
    def function(x):
        return 1e4 + 1e4 * ((x[0] - 0.1) ** 2 + (x[1] - 0.2) ** 2 + x[0] * x[1])

    free = powell(function, np.zeros(2), 0.3)
    found = augmented_lagrangian(function, np.zeros(2), -1.0, 1.0, step=0.3)
    assert found.evaluations <= free.evaluations + 4  # the start once more, and one change for each unknown
    assert (found.multipliers == 0.0).all()
    assert found.violation == 0.0
    np.testing.assert_array_equal(found.x, free.x)


def test_the_function_is_never_called_far_outside():
    counted = Counted(lambda x: -float(np.exp(x[0])) + x[1] ** 2)
    found = augmented_lagrangian(counted, np.array([0.5, 0.5]), -1.0, 1.0, step=0.5, outside=0.25)
    assert np.abs(counted.places).max() <= 1.0 + 0.25 * 0.5 + 1e-12
    np.testing.assert_allclose(found.x, [1.0, 0.0], atol=1e-3)


def test_a_function_that_does_not_exist_outside_of_its_bounds():
    found = augmented_lagrangian(
        lambda x: float(np.sqrt(2.0 - x[0])) + x[1] ** 2 if x[0] <= 2.0 else np.nan,
        np.array([0.5, 1.0]), 0.0, 2.0, step=0.4,
    )  # fmt: skip
    assert found.value <= 0.03  # the root of what is left to the bound, 4e-4 by the tolerance
    assert found.x[0] <= 2.0


def test_a_fixed_unknown_stays_and_costs_nothing():
    counted = Counted(lambda x: float((x[0] - 1.0) ** 2 + (x[1] - 1.0) ** 2 + x[2] ** 2))
    found = augmented_lagrangian(
        counted, np.array([0.0, 0.3, 0.2]), [-2.0, 0.3, -2.0], [2.0, 0.3, 2.0], step=0.5
    )
    np.testing.assert_allclose(found.x, [1.0, 0.3, 0.0], atol=1e-3)
    assert all(x[1] == 0.3 for x in counted.places)
    still = augmented_lagrangian(rosenbrock, np.zeros(2), 0.0, 0.0, step=0.5)
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
    found = augmented_lagrangian(counted, start, -1.0, 1.0, step=0.2, tolerance=1e-2)
    inside = [function(x) for x in counted.places if np.abs(x).max() <= 1.0]
    assert found.value == function(found.x) == min(inside) <= function(start)
    assert found.evaluations == counted.calls


def test_a_start_outside_of_the_inequalities_is_brought_inside():
    found = augmented_lagrangian(
        lambda x: float(x @ x), np.zeros(2), -5.0, 5.0, inequalities=lambda x: [3.0 - x[0] - x[1]], step=0.5
    )
    assert found.converged
    np.testing.assert_allclose(found.x, [1.5, 1.5], atol=5e-3)


def test_inequalities_that_contradict_are_said_to():
    found = augmented_lagrangian(
        lambda x: float(x @ x),
        np.zeros(2),
        -5.0,
        5.0,
        inequalities=lambda x: [1.0 - x[0], x[0] + 1.0],
        step=0.5,
    )
    assert not found.converged
    assert found.status == "No point within the inequalities was found; begin from one."
    assert found.violation >= 1.0


def test_multipliers_end_with_their_rounds_and_evaluations():
    def function(x):
        return float((x[0] - 2.0) ** 2 + x[1] ** 2)

    short = augmented_lagrangian(function, np.zeros(2), -1.0, 1.0, step=0.3, tolerance=1e-6, rounds=1)
    assert (short.converged, short.x[0]) == (False, 1.0)  # put inside of the bounds all the same
    assert (
        short.status
        == "The rounds of multipliers were over before the constraints were met to the tolerance."
    )
    counted = Counted(function)
    cut = augmented_lagrangian(counted, np.zeros(2), -1.0, 1.0, step=0.3, most=20)
    assert cut.evaluations == counted.calls <= 20
    assert cut.status == "The evaluations ran out before the minimum was reached."
    assert cut.value <= function(np.zeros(2))


def test_a_step_longer_than_the_box_will_do():
    found = augmented_lagrangian(lambda x: float(np.sum((x - 0.3) ** 2)), np.zeros(2), -1.0, 1.0, step=7.0)
    np.testing.assert_allclose(found.x, 0.3, atol=7e-3)


def test_multipliers_refuse_bad_bounds():
    with pytest.raises(
        SettingsError, match=r"^unknown 1: the start 2 is outside its bounds -1 to 1; move it inside\.$"
    ):
        augmented_lagrangian(rosenbrock, np.array([0.0, 2.0]), -1.0, 1.0, step=0.5)
    with pytest.raises(
        SettingsError,
        match=r"^unknown 0: expected a lower bound below the upper one, got 1 and -1; swap them\.$",
    ):
        augmented_lagrangian(rosenbrock, np.zeros(2), 1.0, -1.0, step=0.5)
    lost = augmented_lagrangian(lambda x: np.nan, np.zeros(2), -1.0, 1.0, step=0.5)
    assert (lost.converged, lost.status[:23]) == (False, "The function is not fin")


# least squares by BFGS


@pytest.mark.parametrize("norm", [False, True])
def test_bfgs_reaches_active_bounds_exactly(norm):
    """With x0 <= 0.5 the minimum of Rosenbrock's function is (0.5, 0.25)."""
    counted = Counted(rosenbrock_residuals)
    found = bounded_bfgs(counted, np.array([-1.2, 1.0]), -2.0, [0.5, 2.0], norm=norm)
    np.testing.assert_allclose(found.x, [0.5, 0.25], atol=1e-5)
    assert found.x[0] == 0.5
    assert found.value == pytest.approx(0.5 if norm else 0.125, abs=1e-9)
    assert found.evaluations == counted.calls
    assert max(x[0] for x in counted.places) <= 0.5


@pytest.mark.parametrize("count", [6, 84])
def test_bfgs_agrees_with_a_trust_region_method(count):
    """Unknowns of sizes from 1e-3 to 1e3, some of them on their bounds."""
    from scipy.optimize import least_squares

    rng = np.random.default_rng(count)
    root = rng.normal(size=(3 * count, count))
    size = 10.0 ** rng.uniform(-3, 3, count)
    target = rng.normal(size=count)

    def residuals(x):
        linear = root @ (x / size - target)
        return linear + 0.02 * linear**2

    def jacobian(x):
        return (1.0 + 0.04 * (root @ (x / size - target)))[:, None] * root / size

    truth = least_squares(
        lambda z: residuals(z * size), np.zeros(count), bounds=(-0.8, 0.8), xtol=1e-12, ftol=1e-12
    )
    counted = Counted(residuals)
    found = bounded_bfgs(counted, np.zeros(count), -0.8 * size, 0.8 * size, scale=size, jacobian=jacobian)
    assert found.converged
    assert found.value == pytest.approx(truth.cost, rel=1e-6)
    assert found.evaluations == counted.calls
    np.testing.assert_allclose(found.x / size, truth.x, atol=2e-3)
    on_bound = np.abs(truth.x) > 0.8 - 1e-9
    assert on_bound.any()
    assert (np.abs(found.x / size)[np.abs(truth.x) > 0.8 - 1e-9] > 0.8 - 1e-9).all()


def test_differences_stay_inside_and_agree_with_the_jacobian():
    counted = Counted(rosenbrock_residuals)
    start = np.array([0.5, 2.0])
    by_differences = bounded_bfgs(counted, start, -2.0, [0.5, 2.0])
    given = bounded_bfgs(
        rosenbrock_residuals,
        start,
        -2.0,
        [0.5, 2.0],
        jacobian=lambda x: np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]]),
    )
    np.testing.assert_allclose(by_differences.x, given.x, atol=1e-5)
    assert given.evaluations < by_differences.evaluations
    assert (np.array(counted.places) <= [0.5, 2.0]).all()


def only_where(edge):
    """Give residuals that exist for x0 >= 0.2 and x1 <= edge; they vanish at (e + 0.2, 3 / (e + 0.2))."""

    def residuals(x):
        if x[0] < 0.2:
            raise ValueError("not a system")
        return np.full(2, np.nan) if x[1] > edge else np.array([np.log(x[0] - 0.2) - 1.0, x[0] * x[1] - 3.0])

    return residuals


@pytest.mark.parametrize("norm", [False, True])
@pytest.mark.parametrize("start", [[0.25, 1.0], [1.0, 0.2]])
def test_infeasible_regions_are_penalised_and_left(norm, start):
    """The first steps lead to where nothing can be computed."""
    counted = Counted(only_where(1.5))
    found = bounded_bfgs(counted, np.array(start), -5.0, 50.0, norm=norm)
    np.testing.assert_allclose(found.x, [np.e + 0.2, 3.0 / (np.e + 0.2)], atol=1e-4)
    assert found.converged
    assert any(x[0] < 0.2 or x[1] > 1.5 for x in counted.places)
    assert found.evaluations == counted.calls


def test_a_minimum_at_the_edge_of_the_feasible_region_is_approached():
    """x is wanted at 3, nothing exists beyond 2: the best feasible point seen is returned."""
    found = bounded_bfgs(
        lambda x: np.array([x[0] - 3.0]) if x[0] <= 2.0 else np.array([np.inf]), np.zeros(1), -9.0, 9.0
    )
    assert 1.5 < found.x[0] <= 2.0
    assert found.value == 0.5 * (found.x[0] - 3.0) ** 2
    assert (found.converged, found.status[:44]) == (False, "The search ended at the edge of where the re")


@pytest.mark.parametrize("most", [1, 5, 30])
def test_bfgs_ends_when_its_evaluations_are_over(most):
    counted = Counted(rosenbrock_residuals)
    found = bounded_bfgs(counted, np.array([-1.2, 1.0]), -2.0, 2.0, most=most)
    assert found.evaluations == counted.calls == most
    assert (found.converged, found.status) == (
        False,
        "The evaluations ran out before the minimum was reached.",
    )
    assert found.value <= 0.5 * rosenbrock(np.array([-1.2, 1.0]))


def test_bfgs_refuses_bad_input():
    with pytest.raises(
        SettingsError, match=r"^unknown 0: the start 3 is outside its bounds -2 to 2; move it inside\.$"
    ):
        bounded_bfgs(rosenbrock_residuals, np.array([3.0, 0.0]), -2.0, 2.0)
    with pytest.raises(SettingsError, match=r"^unknown 1: expected a scale above 0, got -1\.$"):
        bounded_bfgs(rosenbrock_residuals, np.zeros(2), scale=np.array([1.0, -1.0]))
    lost = bounded_bfgs(lambda x: np.array([np.nan]), np.zeros(1))
    assert (lost.converged, lost.evaluations) == (False, 1)
    assert lost.status == "The function is not finite at the start; choose another start."


# evolution


@pytest.mark.parametrize("many", [False, True])
def test_evolution_finds_the_lowest_of_many_minima(many):
    """Rastrigin's function has 11^3 minima in the box; the next lowest is at 0.995."""
    counted = Counted(rastrigin)
    box = np.full(3, 5.12)
    found = evolve(counted, -box, box, seed=4, population=60, generations=150, many=many)
    assert np.abs(found.x).max() < 0.05
    assert found.evaluations == (sum(x.shape[1] for x in counted.places) if many else counted.calls)
    assert (np.diff(found.history[:, 1]) <= 0).all()
    again = evolve(rastrigin, -box, box, seed=4, population=60, generations=150, many=many)
    np.testing.assert_array_equal(found.x, again.x)
    other = evolve(rastrigin, -box, box, seed=5, population=60, generations=150, many=many)
    assert not np.array_equal(found.x, other.x)


def test_evolution_stays_in_the_box_and_begins_with_the_start():
    counted = Counted(rosenbrock)
    start = np.array([0.9, 0.8])
    found = evolve(counted, np.zeros(2), np.array([1.0, 2.0]), seed=1, generations=3, start=start)
    places = np.array(counted.places)
    assert (places >= 0.0).all()
    assert (places <= [1.0, 2.0]).all()
    np.testing.assert_allclose(places[0], start)
    assert found.value <= rosenbrock(start)
    assert found.evaluations == counted.calls == 40 * 4


def test_evolution_lives_with_nan_and_with_a_fixed_unknown():
    found = evolve(
        lambda x: float((x[0] - 1.0) ** 2 + x[1]) if x[0] > 0.5 else np.nan,
        np.array([-4.0, 2.0]), np.array([4.0, 2.0]), seed=1,
    )  # fmt: skip
    np.testing.assert_allclose(found.x, [1.0, 2.0], atol=1e-2)
    lost = evolve(lambda x: np.nan, np.zeros(2), np.ones(2), seed=1, generations=2)
    assert (lost.converged, lost.value) == (False, np.inf)
    assert lost.status == "The function is not finite at any candidate; choose other bounds."


def test_evolution_refuses_what_it_cannot_use():
    with pytest.raises(
        SettingsError, match=r"^unknown 1: expected finite bounds, got 0 and inf; bound the search\.$"
    ):
        evolve(rastrigin, np.zeros(2), np.array([1.0, np.inf]), seed=1)
    with pytest.raises(SettingsError, match=r"^evolve: expected a population of 5 or more, got 3\.$"):
        evolve(rastrigin, np.zeros(2), np.ones(2), seed=1, population=3)
    with pytest.raises(
        SettingsError, match=r"^unknown 0: the start 2 is outside its bounds 0 to 1; move it inside\.$"
    ):
        evolve(rastrigin, np.zeros(2), np.ones(2), seed=1, start=np.array([2.0, 0.0]))
