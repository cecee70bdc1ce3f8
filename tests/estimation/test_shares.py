"""What is added to intervals: by the rule that they were made by."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.fit import Estimate
from monodyn.estimation.parts import Combination
from monodyn.estimation.record.samples import prepare
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.verdict import summary
from monodyn.estimation.verdict.intervals import widened
from monodyn.estimation.verdict.shares import Share, with_share
from monodyn.stages import identify

QUANTILE = 1.96
VISCOUS = IdentifySettings(torque="friction")


@pytest.fixture(scope="module")
def problem(poses, double):
    return posed(double, prepare([poses], double))


def added(one: Estimate, more: float, problem: Problem) -> Estimate:
    """Return an estimate with something more."""
    return with_share((one,), (), Share({one.name: more}, {}), problem, QUANTILE)[0][0]


def test_what_is_added_leaves_the_interval_of_a_logarithm(fit, problem):
    length = fit.parameter("link1.length")
    wider = added(length, 0.5 * length.value, problem)
    assert wider.std == pytest.approx(0.5 * length.value, rel=1e-2)
    # as far in the logarithm to either side, and never below zero
    down, up = np.log(length.value / wider.lower), np.log(wider.upper / length.value)
    assert down == pytest.approx(up, rel=1e-2)
    assert down == pytest.approx(QUANTILE * 0.5, rel=1e-2)
    assert wider.identifiable


def test_what_is_hardly_known_with_it_is_not_determined(fit, problem):
    length, damping = fit.parameter("link1.length"), fit.parameter("joint1.damping")
    assert length.identifiable
    assert not added(length, 3.0 * length.value, problem).identifiable
    # a damping may be zero: its error is no factor
    known = replace(damping, std=1e-4, lower=0.0, upper=1e-3, identifiable=True)
    wider = added(known, 1e-2, problem)
    assert (wider.identifiable, wider.lower) == (True, 0.0)
    assert wider.upper == pytest.approx(known.value + np.hypot(1e-3 - known.value, QUANTILE * 1e-2))


def test_an_interval_of_draws_becomes_no_shorter_on_either_side(fit, problem):
    length = fit.parameter("link1.length")
    drawn = replace(length, lower=0.5 * length.value, upper=1.1 * length.value, std=0.1 * length.value)
    wider = added(drawn, 0.1 * length.value, problem)
    assert np.log(length.value / wider.lower) == pytest.approx(np.hypot(np.log(2.0), 0.1 * QUANTILE))
    assert np.log(wider.upper / length.value) == pytest.approx(np.hypot(np.log(1.1), 0.1 * QUANTILE))
    ends = widened(1.0, 0.0, np.inf, 0.1, by_factor=True)
    assert ends == (0.0, np.inf)


def test_a_combination_is_widened_about_its_value(problem):
    one = Combination("link1.J / link2.J", 2.0, 0.1, 1.9, 2.4)
    (wider,) = with_share((), (one,), Share({}, {one.name: 0.1}), problem, QUANTILE)[1]
    assert wider.std == pytest.approx(0.1 * np.sqrt(2.0))
    assert wider.lower == pytest.approx(2.0 - np.hypot(0.1, 0.1 * QUANTILE))
    assert wider.upper == pytest.approx(2.0 + np.hypot(0.4, 0.1 * QUANTILE))
    assert with_share((), (one,), Share({}, {}), problem, QUANTILE)[1] == (one,)


@pytest.mark.slow
def test_a_length_that_a_repeating_force_leaves_open_is_refused(poses, double, monkeypatch):
    value = identify(poses, double, VISCOUS).check().parameter("link1.length").value
    share = Share({"link1.length": 3.0 * value}, {})
    monkeypatch.setattr(summary, "repeating_share", lambda *_: share)
    fit = identify(poses, double, VISCOUS)
    assert fit.status.startswith("The motion does not determine link1.length: the error is as large as the")
    assert not fit.parameter("link1.length").identifiable
