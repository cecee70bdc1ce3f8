"""The closed form in place of a record: its residuals against those of the record."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.estimation.record.samples import cut, prepare
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.shoot import Route, fit_pieces
from monodyn.estimation.shooting.trial import Trial
from monodyn.estimation.verdict.surrogate import surrogate_of
from monodyn.mechanism import load
from monodyn.optimize import SearchSettings, randomized
from swings import TIMES, motion, record

SEARCH = SearchSettings(evaluations=40, decrease=1e-6, relative=1e-9)
STARTS = {"double": ([0.3, 0.5], [0.0, 1.0]), "triple": ([0.3, 0.5, -0.2], [0.0, 1.0, 0.0])}


def settled(problem: Problem, trial: Trial) -> Trial:
    """Fit the start states alone."""
    return fit_pieces(problem, trial, Route(10, 1e-7, SEARCH), SEARCH, robust=False, held=True).trial


def cost(problem: Problem, trial: Trial) -> float:
    return float(np.sum(problem.residuals(trial) ** 2))


@pytest.mark.parametrize("name", ["double", "triple"])
def test_far_along_a_bent_valley_the_closed_form_costs_what_the_record_does(name: str) -> None:
    mechanism = load(name)
    start, rate = STARTS[name]
    poses = record(mechanism, TIMES, motion(mechanism, TIMES, start, rate))
    data = prepare((poses,), mechanism)
    problem = posed(mechanism, data, near=True)
    first = Trial(problem.unknowns.x0, np.array([[*start, *rate]], float), cut(data, len(data.times)))
    trial = settled(problem, first)
    surrogate = surrogate_of(problem, trial, np.zeros(len(trial.x), bool))
    assert surrogate is not None
    measured = len(surrogate.level)
    # what is assumed of the sizes is off by two standard deviations; the record is as it is
    noise = np.zeros((1, measured + len(surrogate.aims)))
    noise[:, measured:] = 2.0 * np.sign(np.random.default_rng(4).normal(size=len(surrogate.aims)))
    best = surrogate.peak()
    point = randomized(surrogate.rows, best, noise, reach=surrogate.reach).points[0]
    trials = [trial]
    for where in (best, point):
        x = problem.unknowns.coordinates(surrogate.sizes.unknowns(where[None])[0])
        trials.append(settled(problem, trial.at(x, trial.states)))
    true = np.array([cost(problem, one) for one in trials])
    points = np.array([surrogate.start, best, point])
    found = np.sum(surrogate.rows(points)[0][:, :measured] ** 2, axis=1)
    np.testing.assert_allclose(true - true[0], found - found[0], atol=0.5)
    # the same way along a straight line costs far more
    _, jacobian = surrogate.rows(best[None])
    straight = best + np.linalg.lstsq(jacobian[0], noise[0], rcond=1e-9)[0]
    assert np.sum(surrogate.rows(straight[None])[0][0, :measured] ** 2) > found[2] + 10.0


def test_derivatives_are_those_of_the_residuals() -> None:
    mechanism = load("double")
    poses = record(mechanism, TIMES, motion(mechanism, TIMES, *STARTS["double"]))
    data = prepare((poses,), mechanism)
    problem = posed(mechanism, data, near=True)
    trial = Trial(problem.unknowns.x0, np.array([[0.3, 0.5, 0.0, 1.0]]), cut(data, len(data.times)), 4)
    surrogate = surrogate_of(problem, trial, np.zeros(len(trial.x), bool))
    assert surrogate is not None
    point, count = surrogate.start + 0.01, len(trial.x)
    slopes = surrogate.rows(point[None])[1][0]
    step = 1e-5 * np.where(problem.unknowns.of_kind("damping"), 1e-3, 1.0)
    ahead, behind = (surrogate.rows(point + sign * np.diag(step))[0] for sign in (1.0, -1.0))
    by_difference = ((ahead - behind) / (2.0 * step[:, None])).T
    np.testing.assert_allclose(slopes, by_difference, rtol=1e-5, atol=1e-5 * np.abs(slopes).max())
    assert slopes.shape[1] == count


def test_what_slides_on_a_hinged_body_has_no_closed_form(tmp_path) -> None:
    (tmp_path / "arm.xml").write_text(
        '<mujoco><worldbody><body name="a"><joint name="j" axis="0 -1 0"/>'
        '<geom type="box" size=".1 .003 .01" pos=".1 0 0"/>'
        '<body name="b" pos=".2 0 0"><joint name="s" type="slide" axis="1 0 0" stiffness="5"/>'
        '<geom type="box" size=".02 .02 .02"/></body></body></worldbody></mujoco>'
    )
    mechanism = load(tmp_path / "arm.xml")
    start = np.array([[0.4, 0.0, 0.0, 0.0]])
    poses = record(mechanism, TIMES, motion(mechanism, TIMES, [0.4, 0.0], [0.0, 0.0]))
    data = prepare((poses,), mechanism)
    problem = posed(mechanism, data, near=True)
    trial = Trial(problem.unknowns.x0, start, cut(data, len(data.times)), 4)
    assert surrogate_of(problem, trial, np.zeros(len(trial.x), bool)) is None
