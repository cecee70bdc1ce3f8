"""Integration steps keep their bound, or it is said."""

import re
from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.record.samples import cut, ordered, prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.shoot import FIXED_WORK, ROUGH, Route, fit_pieces, limited, multiple_shooting
from monodyn.mechanism import variational
from monodyn.optimize import SearchSettings
from monodyn.stages import identify
from support import slow
from swings import TIMES, motion, record


@pytest.mark.parametrize("bound", [1e-3, slow(1e-6)])
def test_the_integration_keeps_its_bound(poses, double, bound):
    fit = identify(poses, double, IdentifySettings(error_bound=bound))
    start = fit.starts[0]
    exact = motion(fit.mechanism, TIMES, start.position, start.velocity, steps=256)
    error = np.abs(poses.position - fit.residual[0] - exact).max()
    assert error < 1.5 * bound  # the estimate is of leading order
    assert not any("integration steps" in line for line in fit.advice)


def test_an_integration_bound_out_of_reach_is_said(double):
    slow = record(double, 5.0 * TIMES[:24], motion(double, 5.0 * TIMES[:24], [0.3, 0.5], [0.0, 1.0], 512))
    known = double.with_choices(fix={p.name: p.value for p in double.parameters if p.free})
    fit = identify(slow, known, IdentifySettings(starts=1, error_bound=1e-10))
    assert any(
        re.fullmatch(
            r"With 64 integration steps between time stamps, the most there are, the motion is exact to \S+ "
            r"rad \(m for slides\) and not to the required 1e-10; fit a shorter record, or give a larger "
            r"--identify\.error-bound if that is exact enough\.",
            doubt.reason,
        )
        for doubt in fit.doubts
    )


def test_steps_are_as_exact_as_the_residuals_require(poses, double, truth):
    """A lively motion of a wrong mechanism is integrated roughly, that of the right one to its bound."""
    search = SearchSettings(evaluations=1)
    exact = Route(10, 1e-8, search)
    rough = replace(exact, share=0.01)
    smoothed = (smooth(poses),)

    def steps(mechanism, route):
        problem = posed(mechanism, prepare((poses,), mechanism))
        start = problem.started(problem.unknowns.x0, cut(problem.data, 10**9), smoothed)
        return fit_pieces(problem, start, route, search).trial.substeps

    assert steps(double, rough) <= steps(truth, rough) < steps(truth, exact)
    # where the bound is coarser than what the residuals require it counts
    assert steps(truth, replace(rough, error_bound=1e-2)) == steps(truth, replace(exact, error_bound=1e-2))


def test_rates_of_a_motion_are_the_slopes_of_its_positions(poses, truth):
    times = np.arange(200) / 1000.0
    fine = record(truth, times, motion(truth, times, [0.3, 0.5], [0.0, 1.0]))
    problem = posed(truth, prepare((fine,), truth))
    states = problem.moving(problem.unknowns.x0)([(0, 200, np.array([0.3, 0.5, 0.0, 1.0]))], 1)
    slopes = np.gradient(states[:, :2], times, axis=0, edge_order=2)
    # central differences are off by h^2 / 6 times the third derivative, up to 2000 rad/s^3
    np.testing.assert_allclose(states[1:-1, 2:], slopes[1:-1], atol=5e-4)


def test_a_search_ends_where_the_exact_derivatives_lead(poses, double, monkeypatch):
    """The search takes the derivatives of the motion, which are not those of the very rollout."""
    fits = [identify(poses, double)]
    monkeypatch.setattr(variational, "derivatives", lambda *_: None)
    fits.append(identify(poses, double))
    ours, exact = ({p.name: p for p in fit.parameters if p.free} for fit in fits)
    assert ours.keys() == exact.keys()
    assert any(p.value != exact[name].value for name, p in ours.items())
    for name, p in ours.items():
        assert abs(p.value - exact[name].value) < 0.02 * exact[name].std, name
        assert p.std == pytest.approx(exact[name].std, rel=0.01), name


@pytest.mark.parametrize(("decrease", "asked"), [(1e-2, [0.15]), (1e-4, [0.015]), (0.0, [])])
def test_derivatives_are_as_exact_as_the_end_of_a_search_asks(poses, double, monkeypatch, decrease, asked):
    allowed = set()

    def counted(*given):
        allowed.add(given[-1])

    monkeypatch.setattr(variational, "derivatives", counted)
    problem = posed(double, prepare((poses,), double))
    start = problem.started(problem.unknowns.x0, cut(problem.data, 10), (smooth(poses),))
    settings = SearchSettings(evaluations=3, decrease=decrease)
    fit_pieces(problem, start, Route(10, 1e-5, settings), settings)
    assert sorted(allowed) == pytest.approx(asked)


def test_a_search_that_makes_no_way_goes_on_with_the_exact_derivatives(poses, double, monkeypatch):
    """Along derivatives of the wrong sign no step brings what it promises."""
    exact, right = variational.derivatives, []

    def wrong(*given):
        found = exact(*given)
        if found is None:
            return None
        right.append(given[-1])
        q, v, dq, dv = found
        return q, v, -dq, dv

    problem = posed(double, prepare((poses,), double))
    start = problem.started(problem.unknowns.x0, cut(problem.data, 10), (smooth(poses),))
    route, search = Route(10, 1e-5, SearchSettings()), SearchSettings(decrease=1e-4, relative=1e-7)
    monkeypatch.setattr(variational, "derivatives", wrong)
    found = fit_pieces(problem, start, route, search)
    assert right
    monkeypatch.setattr(variational, "derivatives", lambda *_: None)
    expected = fit_pieces(problem, start, route, search)
    assert found.converged
    assert expected.converged
    assert found.trial.most_off == 0.0
    assert found.cost == pytest.approx(expected.cost, abs=1e-3)
    assert found.evaluations > expected.evaluations


def test_searches_share_what_they_may_evaluate(poses, double):
    """Each ends where it stands once that is spent."""
    route = Route(10, 1e-3, ROUGH)
    problem = posed(double, prepare((poses,), double))
    start = problem.started(problem.unknowns.x0, cut(problem.data, 10), (smooth(poses),))
    free = fit_pieces(problem, start, route, ROUGH)
    each = FIXED_WORK + len(poses) * free.trial.substeps * (len(problem.unknowns) + 4)
    assert free.evaluations > 4
    with limited(3 * each) as budget:
        first, second = (fit_pieces(problem, start, route, ROUGH) for _ in range(2))
    assert (first.evaluations, second.evaluations) == (3, 1)
    assert budget.remaining == -each
    assert fit_pieces(problem, start, route, ROUGH).evaluations == free.evaluations


def test_a_search_without_patience_ends_at_the_first_hopeless_stage(poses, double):
    # of another mechanism, which no longer piece is near
    exchanged = replace(poses, joints=poses.joints[::-1])
    problem, seen = posed(double, prepare((exchanged,), double)), []

    def hopeless(stage):
        seen.append(len(stage.trial.states))
        return len(seen) == 2

    route = Route(5, 1e-3, ROUGH)
    arguments = problem, problem.unknowns.x0, (smooth(ordered(exchanged, double)),), route, None, hopeless
    found = multiple_shooting(*arguments, patient=False)
    assert len(seen) == 2
    assert seen[0] > seen[1] == len(found.trial.states) > 1
    seen.clear()
    assert multiple_shooting(*arguments).complete
    assert len(seen) == 1
