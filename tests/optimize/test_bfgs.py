"""Bounded least squares by BFGS: active bounds, regions without residuals, the count of evaluations."""

import numpy as np
import pytest

from minima import Counted, rosenbrock_residuals
from monodyn.optimize import Exhausted, bounded_bfgs


def test_bfgs_reaches_active_bounds_exactly():
    """With x0 <= 0.5 the minimum of Rosenbrock's function is (0.5, 0.25)."""
    counted = Counted(rosenbrock_residuals)
    found = bounded_bfgs(counted, np.array([-1.2, 1.0]), (-2.0, np.array([0.5, 2.0])))
    np.testing.assert_allclose(found.x, [0.5, 0.25], atol=1e-5)
    assert found.x[0] == 0.5
    assert found.value == pytest.approx(0.125, abs=1e-9)
    assert found.evaluations == counted.calls
    assert max(x[0] for x in counted.places) <= 0.5


@pytest.mark.parametrize("count", [6, 40])
def test_bfgs_agrees_with_a_trust_region_method(count):
    """Correlated unknowns, some of them on their bounds."""
    from scipy.optimize import least_squares

    rng = np.random.default_rng(count)
    root = rng.normal(size=(3 * count, count))
    target = rng.normal(size=count)

    def residuals(x):
        linear = root @ (x - target)
        return linear + 0.02 * linear**2

    truth = least_squares(residuals, np.zeros(count), bounds=(-0.8, 0.8), xtol=1e-12, ftol=1e-12)
    counted = Counted(residuals)
    found = bounded_bfgs(counted, np.zeros(count), (-0.8, 0.8))
    assert found.converged
    assert found.status == "The minimum is reached."
    assert found.value == pytest.approx(truth.cost, rel=1e-6)
    assert found.evaluations == counted.calls
    np.testing.assert_allclose(found.x, truth.x, atol=2e-3)
    on_bound = np.abs(truth.x) > 0.8 - 1e-9
    assert on_bound.any()
    assert (np.abs(found.x)[on_bound] > 0.8 - 1e-9).all()


def test_differences_stay_inside():
    counted = Counted(rosenbrock_residuals)
    bounded_bfgs(counted, np.array([0.5, 2.0]), (-2.0, np.array([0.5, 2.0])))
    assert (np.array(counted.places) <= [0.5, 2.0]).all()


def only_where(edge):
    """Give residuals that exist for x0 >= 0.2 and x1 <= edge; they vanish at (e + 0.2, 3 / (e + 0.2))."""

    def residuals(x):
        if x[0] < 0.2:
            raise ValueError("not a system")
        return np.full(2, np.nan) if x[1] > edge else np.array([np.log(x[0] - 0.2) - 1.0, x[0] * x[1] - 3.0])

    return residuals


@pytest.mark.parametrize("start", [[0.25, 1.0], [1.0, 0.2]])
def test_infeasible_regions_are_penalised_and_left(start):
    """The first steps lead to where nothing can be computed."""
    counted = Counted(only_where(1.5))
    found = bounded_bfgs(counted, np.array(start), (-5.0, 50.0))
    np.testing.assert_allclose(found.x, [np.e + 0.2, 3.0 / (np.e + 0.2)], atol=1e-4)
    assert found.converged
    assert any(x[0] < 0.2 or x[1] > 1.5 for x in counted.places)
    assert found.evaluations == counted.calls


def test_a_minimum_at_the_edge_of_the_feasible_region_is_approached():
    """x is wanted at 3, nothing exists beyond 2: the best feasible point seen is returned."""
    found = bounded_bfgs(
        lambda x: np.array([x[0] - 3.0]) if x[0] <= 2.0 else np.array([np.inf]), np.zeros(1), (-9.0, 9.0)
    )
    assert 1.5 < found.x[0] <= 2.0
    assert found.value == 0.5 * (found.x[0] - 3.0) ** 2
    assert not found.converged
    assert found.status == "The search ended at the edge of where the residuals exist; choose another start."


@pytest.mark.parametrize("most", [1, 5, 30])
def test_bfgs_ends_when_its_evaluations_are_over(most):
    counted = Counted(rosenbrock_residuals)
    found = bounded_bfgs(counted, np.array([-1.2, 1.0]), (-2.0, 2.0), most=most)
    assert found.evaluations == counted.calls == most
    assert not found.converged
    assert found.status == "The evaluations ran out before the minimum was reached."
    assert found.value <= 0.5 * float(np.sum(rosenbrock_residuals(np.array([-1.2, 1.0])) ** 2))


def test_a_search_that_gives_up_is_not_converged(monkeypatch):
    """Which searches SLSQP gives up depends on its release; that it may is what counts."""
    import scipy.optimize

    monkeypatch.setattr(
        scipy.optimize, "minimize", lambda *_, **__: scipy.optimize.OptimizeResult(success=False)
    )
    found = bounded_bfgs(rosenbrock_residuals, np.zeros(2))
    assert not found.converged
    assert found.status == "No smaller value was found along any step of the search."


def test_bfgs_says_that_its_start_has_no_residuals():
    lost = bounded_bfgs(lambda x: np.array([np.nan]), np.zeros(1))
    assert (lost.converged, lost.evaluations) == (False, 1)
    assert lost.status == "The function is not finite at the start; choose another start."


def test_a_jacobian_takes_the_place_of_differences():
    def slopes(x):
        return np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])

    def valley(x):
        return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])

    plain = bounded_bfgs(valley, np.zeros(2), (-2.0, 2.0))
    exact = bounded_bfgs(valley, np.zeros(2), (-2.0, 2.0), jacobian=slopes)
    np.testing.assert_allclose(exact.x, 1.0, atol=1e-4)
    assert exact.evaluations < plain.evaluations
    # where derivatives overflow, differences take over
    lost = bounded_bfgs(valley, np.zeros(2), (-2.0, 2.0), jacobian=lambda x: np.full((2, 2), np.nan))
    np.testing.assert_allclose(lost.x, plain.x)


def test_jacobians_count_as_evaluations():
    """None is asked for once the evaluations are over; what is counted is what was called."""
    steep = Counted(rosenbrock_residuals)
    slopes = Counted(lambda x: np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]]))
    for most in range(1, 12):
        steep.places.clear(), slopes.places.clear()
        found = bounded_bfgs(steep, np.array([-1.2, 1.0]), (-2.0, 2.0), most=most, jacobian=slopes)
        assert found.evaluations == len(steep.places) + len(slopes.places) == most
        assert found.status == "The evaluations ran out before the minimum was reached."


def test_who_gives_a_jacobian_may_end_the_search():
    def none_left(x):
        raise Exhausted

    found = bounded_bfgs(rosenbrock_residuals, np.array([-1.2, 1.0]), (-2.0, 2.0), jacobian=none_left)
    assert (found.x.tolist(), found.converged) == ([-1.2, 1.0], False)
    assert found.status == "The evaluations ran out before the minimum was reached."
