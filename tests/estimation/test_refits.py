"""Intervals from profiles of the cost and from resampled records, next to what is known in closed form."""

from __future__ import annotations

from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest

import monodyn
from monodyn.errors import SettingsError
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.prior import Prior
from monodyn.estimation.shooting.unknowns import assumed_sizes
from monodyn.estimation.verdict import refits
from monodyn.mechanism import load
from monodyn.mechanism.simulate import rollout
from monodyn.optimize import SearchSettings
from monodyn.settings import RunSettings
from monodyn.types import Poses, Progress

TRUTH = {"link1.length": 0.21, "link2.length": 0.17}


def record(seed: int = 0, count: int = 60, noise: float = 2e-3) -> Poses:
    """Record a double pendulum with white noise."""
    mechanism = load("double").with_values(TRUTH)
    time = np.arange(count) / 60.0
    q = rollout(mechanism.tree, time, np.array([-0.4, 0.6]), np.zeros(2), substeps=8)[0]
    q = q + noise * np.random.default_rng(seed).normal(size=q.shape)
    covariance = np.tile(noise**2 * np.eye(2), (count, 1, 1))
    return Poses(("joint1", "joint2"), np.arange(count), time, q, covariance, np.ones(count, dtype=bool))


def fitted(uncertainty: str, poses: Poses, progress: Progress | None = None) -> monodyn.Fit:
    settings = IdentifySettings(uncertainty=uncertainty)  # pyright: ignore[reportArgumentType]
    # with every size given the cost is next to a parabola
    mechanism = load("double")
    given = {p.name: p.value for p in assumed_sizes(mechanism)}
    return monodyn.identify(poses, mechanism.with_choices(fix=given), settings, progress=progress)


@pytest.mark.slow
@pytest.mark.parametrize("uncertainty", ["profile", "bootstrap"])
def test_where_the_cost_is_a_parabola_intervals_are_those_of_the_covariance(uncertainty: str) -> None:
    poses, steps = record(), []
    usual = fitted("linear", poses)
    fit = fitted(uncertainty, poses, lambda step, *_: steps.append(step))
    assert fit.grade == usual.grade == "trusted"
    assert "refit" in steps
    for name in TRUTH:
        one, other = usual.parameter(name), fit.parameter(name)
        assert other.value == one.value
        assert other.upper - other.lower == pytest.approx(one.upper - one.lower, rel=0.25)
        assert other.lower < one.value < other.upper


@pytest.mark.slow
def test_records_that_cannot_be_fitted_leave_the_intervals_of_the_covariance(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    poses = record()
    usual = fitted("linear", poses)
    monkeypatch.setattr(refits, "RECORDS", 6)
    # one evaluation ends no search
    monkeypatch.setattr(refits, "AGAIN", SearchSettings(evaluations=1, decrease=1e-4, relative=1e-7))
    fit = fitted("bootstrap", poses)
    assert fit.grade == "approximate"
    assert fit.status == (
        "Approximate. Of 6 records with the same motion and other noise only 0 could be fitted: the "
        "intervals are those of the covariance, and may be too short; a longer record would help."
    )
    assert fit.parameters == usual.parameters


@pytest.mark.slow
def test_what_the_drawn_records_leave_open_is_not_determined(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(refits, "RECORDS", 6)
    sides = cycle([-2.0, 2.0])

    def settled(self, problem, x, held):
        """End a factor of e^2 away with the first length."""
        at = self.optimum.x.copy()
        at[problem.unknowns.names.index("link1.length")] += next(sides)
        trial = self.optimum.trial
        return replace(self.optimum, trial=trial.at(at, trial.states), converged=True)

    monkeypatch.setattr(refits._Refits, "settled", settled)
    fit = fitted("bootstrap", record())
    assert not fit.parameter("link1.length").identifiable
    assert fit.status == (
        "The motion does not determine link1.length: the error is as large as the value. A longer record or "
        "a livelier motion would help, or a measured length, given with --fix."
    )


def test_a_prior_is_drawn_about_what_is_true() -> None:
    information = np.diag([4.0, 0.0])
    prior = Prior(information, np.zeros(2))
    rng = np.random.default_rng(1)
    drawn = np.array([prior.drawn_about(np.array([0.3, 0.1]), rng).centre for _ in range(2000)])
    np.testing.assert_allclose(drawn.mean(axis=0), [0.3, 0.1], atol=0.04)
    np.testing.assert_allclose(drawn.std(axis=0), [0.5, 0.0], atol=0.03)
    np.testing.assert_allclose(
        replace(prior, centre=np.array([0.3, 0.1])).away(np.array([0.4, 0.0])), [0.1, -0.1]
    )


def test_the_published_method_has_no_other_intervals() -> None:
    with pytest.raises(SettingsError) as refusal:
        RunSettings(method="paper", uncertainty="profile")
    assert str(refusal.value) == (
        "uncertainty: expected linear with the published method, got profile; leave it out."
    )
