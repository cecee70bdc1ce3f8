"""A window with a belief: against the batch fit, the rows that have left it, and finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.arrays import plain
from monodyn.errors import FitError
from monodyn.estimation.record.samples import cut, prepare
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.shoot import Route, fit_pieces
from monodyn.estimation.shooting.trial import Trial
from monodyn.estimation.verdict.uncertainty import covariance_of, knowledge_at
from monodyn.estimation.window import _inverse, ahead, refit, slid, start_of, window_of
from monodyn.mechanism import load
from monodyn.optimize import SearchSettings
from monodyn.stages import identify
from support import refuses
from swings import TIMES, double_truth, motion, record

EXACT = SearchSettings(evaluations=60, decrease=1e-13, relative=1e-15, damping=1e-9)
FIXED = {"link1.thickness": 0.006, "link1.width": 0.02, "link2.width": 0.02}
"""What the motion determines in ratios alone is given, so that the information is regular."""


@pytest.fixture(scope="module")
def started():
    return load("double").with_choices(fix=FIXED)


@pytest.fixture(scope="module")
def rows():
    truth = double_truth()
    return record(truth, TIMES, motion(truth, TIMES, [0.3, 0.5], [0.0, 1.0]))


@pytest.fixture(scope="module")
def fit(started, rows):
    return identify(rows, started, IdentifySettings(torque="friction"))


@pytest.fixture(scope="module")
def whole(fit, started, rows):
    return optimum(fit, started, rows)


def optimum(fit, started, rows):
    window = window_of(fit, started, rows)
    return refit(window, None, *start_of(fit, window), settings=EXACT)


@pytest.mark.parametrize("moved", [False, True])
def test_without_a_belief_it_is_the_batch_fit(fit, started, rows, moved):
    """Also where something moves all positions together."""
    if moved:
        rows = replace(rows, shifts=0.01 * np.stack([np.sin(rows.position), np.ones_like(rows.position)]))
    whole = optimum(fit, started, rows)
    problem = posed(whole.window.problem.mechanism, prepare([rows], started), near=True)
    begun = Trial(whole.x, whole.state[None], cut(problem.data, 10**6), whole.window.substeps)
    best = fit_pieces(problem, begun, Route(10, 1e-5, EXACT), EXACT, robust=False)
    assert best.trial.substeps == whole.window.substeps
    assert np.allclose(best.x, whole.x, rtol=1e-6, atol=1e-9)
    assert np.allclose(best.trial.states[0], whole.state, rtol=1e-6, atol=1e-9)
    _, jacobian = problem.rows(best.trial)
    known = knowledge_at(problem, best.x, jacobian, best.trial.pieces)
    scale = np.sqrt(np.diag(known.full))
    apart = (whole.covariance - known.full) / np.outer(scale, scale)
    assert np.abs(apart).max() < 1e-6


@pytest.mark.parametrize("row", [1, 7, 30])
def test_rows_that_leave_stay_known(whole, rows, row):
    """What they say, at the optimum of all, makes that the optimum of the rest."""
    later, there = whole.window.on(rows[row:]), ahead(whole, row)
    scale = np.sqrt(np.diag(there.covariance))
    x, state = whole.x + scale[: len(whole.x)], there.state - scale[len(whole.x) :]
    rest = refit(later, slid(whole, row), x, state, settings=EXACT)
    assert whole.window.regrouped
    assert np.abs((rest.x - whole.x) / scale[: len(x)]).max() < 1e-4
    assert np.abs((rest.state - there.state) / scale[len(x) :]).max() < 1e-4
    apart = (rest.covariance - there.covariance) / np.outer(scale, scale)
    assert np.abs(apart).max() < 1e-5


@pytest.mark.parametrize("start", ["few given", "none given"])
def test_a_window_that_slides_frame_by_frame_ends_where_the_batch_fit_does(started, rows, start):
    begun = started if start == "few given" else load("double")
    fit = identify(rows, begun, IdentifySettings(torque="friction"))
    window = window_of(fit, begun, rows)
    batch = refit(window, None, *start_of(fit, window))
    found = refit(window.on(rows[:40]), None, batch.x, batch.state)
    evaluations = []
    for first in range(1, 21):
        arrival, state = slid(found, 1), ahead(found, 1).state
        found = refit(window.on(rows[first : first + 40]), arrival, found.x, state)
        evaluations.append(found.evaluations)
        assert found.converged
    last, now = ahead(batch, -1), ahead(found, -1)
    scale = np.sqrt(np.diag(last.covariance))
    apart = np.concatenate((found.x, now.state)) - np.concatenate((batch.x, last.state))
    assert np.abs(apart / scale).max() < 0.1
    assert np.allclose(np.sqrt(np.diag(now.covariance)) / scale, 1.0, atol=0.03)
    assert np.allclose(nothing_determines(found), nothing_determines(batch), atol=1e-3)
    assert nothing_determines(found).any() == (start == "none given")
    assert np.median(evaluations) <= 4


def nothing_determines(found):
    """Return what projects changes of the unknowns onto those that are left open, (param, param)."""
    _, blind = covariance_of(found.window.problem.unknowns, found.information)
    onto, _ = np.linalg.qr(blind)
    return onto @ onto.T


def test_information_that_rounding_has_lost_is_refused_and_none_is_open(started, rows):
    window = window_of(identify(rows, started, IdentifySettings(torque="friction")), started, rows[:20])
    unknowns, rng = window.problem.unknowns, np.random.default_rng(4)
    count = len(unknowns)
    slopes = rng.normal(size=(60, count + 4))
    # nothing depends on the first one
    slopes[:, 0] = 0.0
    information = slopes.T @ slopes
    covariance, blind = covariance_of(unknowns, information)
    known = np.linalg.inv(information[1:, 1:])
    np.testing.assert_allclose(covariance[1:, 1:], known, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(np.abs(blind), np.eye(count)[:, :1], atol=1e-9)
    # less than what the state takes away of it: of the difference of two large numbers no digit is left
    lost, cross = information.copy(), information[1, count:]
    lost[1, 1] = 0.999 * cross @ np.linalg.solve(information[count:, count:], cross)
    with pytest.raises(ArithmeticError, match="rounding"):
        covariance_of(unknowns, lost)


def test_the_state_ahead_moves_as_its_derivatives_say(started, rows):
    free = started.with_choices(fix={"link1.length": 0.4}, free=["time_scale"])
    fit = identify(rows, free, IdentifySettings(torque="friction"))
    window = window_of(fit, free, rows[:20])
    x, state = start_of(fit, window)
    *_, dq, dv = window.problem.tangents(window.problem.at(x), window.substeps, [(0, 20, plain(state))])
    exact, point = np.concatenate((dq[-1], dv[-1])), np.concatenate((x, state))
    steps = np.where([*window.problem.unknowns.log, *(True for _ in state)], 1e-4, 1e-7)

    def ended(point: np.ndarray) -> np.ndarray:
        at, begun = np.split(point, [len(x)])
        return window.problem.moving(at)([(0, 20, plain(begun))], window.substeps)[-1]

    found = []
    for step in np.diag(steps):
        far, near, behind, farther = (ended(point + by * step) for by in (2.0, 1.0, -1.0, -2.0))
        found.append((8.0 * (near - behind) - (far - farther)) / (12.0 * step.sum()))
    assert "time_scale" in window.problem.unknowns.names
    assert np.all(np.abs(exact - np.transpose(found)) < 1e-6 * np.abs(exact).max(axis=0))


def test_what_changes_unseen_widens_what_is_known_of_the_state(whole):
    arrival, rng = slid(whole, 30), np.random.default_rng(2)
    width, count = len(whole.state), len(arrival.point)
    root = rng.normal(size=(count, count))
    sure = replace(arrival, information=root @ root.T + np.eye(count), gradient=rng.normal(size=count))
    noise = 1e-2 * np.eye(width)
    whole_noise = np.zeros((count, count))
    whole_noise[-width:, -width:] = noise
    wide = sure.widened(noise)
    assert np.allclose(
        np.linalg.inv(wide.information), np.linalg.inv(sure.information) + whole_noise, rtol=1e-6
    )
    best = np.linalg.solve(sure.information, sure.gradient)
    assert np.allclose(np.linalg.solve(wide.information, wide.gradient), best, rtol=1e-6)


def test_a_row_that_is_far_off_is_bounded(whole, rows):
    position = rows.position.copy()
    position[30, 0] += 1.0
    window = whole.window.on(replace(rows, position=position))
    plain_fit = refit(window, None, whole.x, whole.state)
    bounded = refit(window, None, whole.x, whole.state, limit=4.0)
    scale = np.sqrt(np.diag(whole.covariance))[: len(whole.x)]
    off, still = (np.abs((one.x - whole.x) / scale).max() for one in (plain_fit, bounded))
    assert off > 10.0
    assert still < 1.0
    assert plain_fit.sigma > 10.0 * whole.sigma


def test_noise_and_gaps(whole, rows):
    seen = rows.seen.copy()
    seen[[12, 13, 14, 15]] = False
    position = np.where(seen[:, None], rows.position, np.nan)
    window = whole.window.on(replace(rows, position=position, seen=seen), noise=2.0)
    found = refit(window, None, whole.x, whole.state)
    assert np.isnan(found.residual[12:16]).all()
    assert np.isclose(found.sigma, 0.5 * whole.sigma, rtol=0.1)
    ratio = np.sqrt(np.diag(found.covariance) / np.diag(whole.covariance))
    assert np.isclose(ratio[whole.window.problem.unknowns.names.index("link1.length")], 2.0, rtol=0.15)


def test_a_torque_over_time_is_refused(rows):
    fit = identify(rows, load("double"), IdentifySettings(torque="friction"))
    with refuses(
        FitError,
        "window: expected a fit of friction, or of known torques, got the torque 'free'; identify the first "
        "seconds with --identify.torque friction.",
    ):
        window_of(replace(fit, torque="free"), load("double"), rows)


def test_rounding_is_no_derivative_of_what_the_motion_depends_on():
    """A row that is zero but for rounding has no inverse, and changes that of no other."""
    slopes = np.array([[2.0, 0.0], [1e-16, -2e-16], [0.0, 1e-3], [0.0, 0.0]])
    back = _inverse(slopes)
    assert np.allclose(back[:, [0, 2]], [[0.5, 0.0], [0.0, 1e3]], rtol=1e-12)
    assert np.all(back[:, [1, 3]] == 0.0)
