"""Bounded least squares: known minima, bounds, bad points, rank, longest steps."""

from itertools import pairwise, product

import numpy as np
import pytest

from monodyn.errors import SettingsError
from monodyn.optimize import SearchSettings, minimize
from support import refuses


def rosenbrock(x):
    residual = np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])
    return residual, np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])


def test_rosenbrock_is_solved():
    found = minimize(rosenbrock, np.array([-1.2, 1.0]))
    assert found.converged
    assert found.status == "The minimum is reached."
    np.testing.assert_allclose(
        found.x, [1.0, 1.0], atol=1e-7
    )  # the cost is quadratic there: sqrt of its rounding


def test_active_bound_gives_the_constrained_minimum():
    """With x0 <= 0.5 the minimum of Rosenbrock's function is (0.5, 0.25)."""
    found = minimize(rosenbrock, np.array([-1.2, 1.0]), (-2.0, np.array([0.5, 2.0])))
    np.testing.assert_allclose(found.x, [0.5, 0.25], atol=1e-7)
    assert found.at_bound.tolist() == [True, False]
    assert found.converged


def test_correlated_bound_is_not_clipped_after_the_fact():
    """The bounded minimum of a correlated quadratic is not the clipped free minimum."""
    jacobian = np.array([[1.0, 0.9], [0.0, 0.3]])
    target = np.array([2.0, -1.0])
    found = minimize(
        lambda x: (jacobian @ (x - target), jacobian), np.zeros(2), (np.full(2, -5.0), np.ones(2))
    )
    slope = jacobian.T @ jacobian
    best = target[1] - slope[1, 0] / slope[1, 1] * (1.0 - target[0])
    np.testing.assert_allclose(found.x, [1.0, best], atol=1e-9)


def test_the_best_step_in_a_box_is_the_one_of_an_exhaustive_search():
    """Random correlated quadratics: of all sets of bounds, the feasible one with the least value."""
    rng = np.random.default_rng(11)
    for _ in range(60):
        rows = rng.normal(size=(5, 4)) * 10.0 ** rng.uniform(-2, 2, size=4)
        target = 3.0 * rng.normal(size=5)
        lower, upper = -rng.uniform(0.0, 1.0, 4), rng.uniform(0.0, 1.0, 4)
        best = np.inf
        for sides in product((None, 0, 1), repeat=4):
            free = np.array([side is None for side in sides])
            x = np.array(
                [(lower, upper, lower)[2 if side is None else side][i] for i, side in enumerate(sides)]
            )
            if free.any():
                rest = target - rows[:, ~free] @ x[~free]
                x[free] = np.linalg.lstsq(rows[:, free], rest, rcond=None)[0]
            if np.all((x >= lower - 1e-12) & (x <= upper + 1e-12)):
                best = min(best, 0.5 * float(np.sum((rows @ x - target) ** 2)))
        found = minimize(lambda x, a=rows, b=target: (a @ x - b, a), np.zeros(4), (lower, upper))
        assert found.converged
        assert found.cost == pytest.approx(best, rel=1e-9)


def test_leaves_a_bound_again():
    found = minimize(rosenbrock, np.array([-2.0, -2.0]), (-2.0, 2.0))
    np.testing.assert_allclose(found.x, [1.0, 1.0], atol=1e-7)
    assert not found.at_bound.any()


def test_points_that_are_nan_are_rejected_steps():
    def residuals(x):
        with np.errstate(invalid="ignore"):
            return np.array([np.log(x[0]) + 3.0]), np.array([[1.0 / x[0]]])

    found = minimize(residuals, np.array([4.0]))
    assert found.x[0] == pytest.approx(np.exp(-3.0), rel=1e-6)


def test_start_that_cannot_be_evaluated_is_said():
    found = minimize(lambda x: (np.array([np.nan]), np.ones((1, 1))), np.zeros(1))
    assert not found.converged
    assert found.status == "The function is not finite at the start; choose another start."


def test_a_derivative_of_the_wrong_sign_is_said_to_lead_nowhere():
    found = minimize(lambda x: (x - 1.0, -np.eye(1)), np.zeros(1))
    assert (found.converged, found.x[0]) == (False, 0.0)
    assert found.status == "No smaller value was found along any step of the search."


def test_rank_deficient_jacobian_moves_only_what_matters():
    found = minimize(
        lambda x: (np.array([x[0] + x[1] - 2.0]), np.array([[1.0, 1.0, 0.0]])), np.array([0.0, 0.0, 7.0])
    )
    np.testing.assert_allclose(found.x, [1.0, 1.0, 7.0], atol=1e-8)


def test_scale_of_the_unknowns_does_not_matter():
    scale = np.array([1e-6, 1e5])

    def residuals(x):
        residual, jacobian = rosenbrock(x / scale)
        return residual, jacobian / scale

    plain, scaled = (
        minimize(rosenbrock, np.array([-1.2, 1.0])),
        minimize(residuals, np.array([-1.2, 1.0]) * scale),
    )
    np.testing.assert_allclose(scaled.x / scale, plain.x, atol=1e-7)
    assert abs(scaled.evaluations - plain.evaluations) <= 1  # the last step is a matter of rounding


def test_no_step_is_longer_than_its_reach():
    """Each point is within reach of one before it, the free unknown makes up for the held one."""
    seen = [np.array([-1.2, 1.0])]
    reach = np.array([0.2, np.inf])

    def residuals(x):
        assert min(abs(x[0] - before[0]) for before in seen) <= reach[0] + 1e-12
        seen.append(x.copy())
        return rosenbrock(x)

    found = minimize(residuals, seen[0], reach=reach)
    assert found.converged
    np.testing.assert_allclose(found.x, [1.0, 1.0], atol=1e-7)
    assert found.evaluations >= 11  # from -1.2 to 1 in steps of 0.2
    assert max(abs(b[1] - a[1]) for a, b in pairwise(seen)) > 0.2


def test_a_logarithm_does_not_run_away():
    """From 1 toward 1e-3 with a poor derivative: the free step is -50, and nothing calls it back."""

    def residuals(x):
        value = np.exp(x[0])
        return np.array([value - 1e-3]), np.array([[0.02 * value if value > 0.5 else value]])

    assert minimize(residuals, np.zeros(1)).x[0] < -45
    found = minimize(residuals, np.zeros(1), reach=1.5)
    assert np.exp(found.x[0]) == pytest.approx(1e-3, rel=1e-6)


def test_a_longest_step_of_nothing_is_refused():
    with refuses(SettingsError, "unknown 1: expected a longest step above 0, got 0."):
        minimize(rosenbrock, np.zeros(2), reach=np.array([1.0, 0.0]))


def test_evaluations_are_limited():
    found = minimize(rosenbrock, np.array([-1.2, 1.0]), settings=SearchSettings(evaluations=3))
    assert found.evaluations == 3
    assert found.status == "The evaluations ran out before the minimum was reached."
