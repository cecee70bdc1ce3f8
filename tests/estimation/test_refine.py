"""Gross errors are left out where they are short and isolated."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from monodyn.estimation.record.samples import cut, prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.common import common_error
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.shoot import Optimum, typical
from monodyn.estimation.torque.evidence import cleared
from monodyn.estimation.verdict.refine import COMMON_ROUNDS, NOISE_ROUNDS, _as_seen, refine
from monodyn.estimation.verdict.uncertainty import NoiseFactors
from monodyn.mechanism import load
from monodyn.mechanism.tree import Measured
from monodyn.stages import identify
from swings import TIMES, leaning, motion, record, sigmas

VISCOUS = IdentifySettings(torque="friction", starts=1)


def test_gross_errors_and_gaps(poses, double, truth):
    position = poses.position.copy()
    position[[7, 20, 33, 34], [0, 1, 0, 1]] += [1.0, -2.0, 0.5, 0.8]
    position[40:44] = np.nan
    position[50, 1] = np.nan
    fit = identify(replace(poses, position=position), double)
    assert sigmas(fit.parameter("link1.length"), truth.values["link1.length"]) < 4.0
    assert "4 of 56 samples were left out as gross errors (frame 7, 20, 33 and 34)." in fit.advice
    assert np.isnan(fit.residual[0][[7, 40, 50], [0, 0, 1]]).all()


@pytest.mark.slow
def test_a_record_with_what_no_motion_reaches_is_damaged(poses, double):
    """One sample of 1e20: whatever wrote it may have written others."""
    position = poses.position.copy()
    position[20, 1] = 1e20
    fit = identify(replace(poses, position=position), double)
    assert fit.grade == "approximate"
    assert fit.doubts[0].reason == (
        "The record is damaged: 1 of its rows have positions that no motion reaches, up to 1e+20 of joint2. "
        "They were left out; look whether the others are right."
    )


@pytest.mark.slow
def test_a_tail_that_does_not_follow_is_no_gross_error():
    """A pendulum held fast from frame 76 on; what is left out must be short and isolated."""
    single, times = load("single"), np.arange(100) / 30.0
    swing = motion(single, times, [0.9], [0.0])
    swing[76:] = swing[76]
    fit = identify(record(single, times, swing), single)
    assert not fit.ok
    assert not any("gross errors" in line for line in fit.advice)
    assert np.isfinite(fit.residual[0]).all()
    assert fit.advice[0].startswith("The first 50 frames alone do fit, ")


def test_isolated_gross_errors_up_to_a_tenth_are_left_out():
    single, times = load("single"), np.arange(100) / 30.0
    clean = record(single, times, motion(single, times, [0.9], [0.0]))
    position = clean.position.copy()
    rows = [5, 19, 33, 34, 35, 60, 77, 84, 98]
    position[rows, 0] += np.array([1.0, -1.5, 0.8, 0.9, 1.0, -0.7, 2.0, 0.6, -1.0])
    fit = identify(replace(clean, position=position), single)
    assert fit.ok
    assert sigmas(fit.parameter("link1.length"), single.values["link1.length"]) < 4.0
    assert np.flatnonzero(np.isnan(fit.residual[0][:, 0])).tolist() == rows


SIZES = ("link1.length", "link2.length", "link1.width", "link2.width")


def ended(mechanism, poses, factors):
    """Return a problem, and a search through it that has ended where some sizes are larger by factors; the
    picture knows proportions of the sizes to half a percent, and nothing of their common scale."""
    seen = mechanism.with_measured(Measured(SIZES, (np.eye(4) - 0.25) / 0.005**2))
    problem = posed(seen, prepare([poses], seen))
    x = problem.unknowns.x0.copy()
    for name, factor in factors.items():
        x[problem.unknowns.names.index(name)] += np.log(factor)
    trial = problem.started(x, cut(problem.data, 10**9), (smooth(poses),))
    rows = problem.residuals(trial)
    sigma = typical(rows, problem.data.measured)
    return problem, Optimum(trial, rows, 0.0, sigma, 1, True, np.zeros(len(x), dtype=bool))


@pytest.fixture(scope="module")
def mirrored():
    """Many turns with one of the angles mirrored: no mechanism moves so, and a search ends anywhere."""
    double, times = load("double"), np.arange(200) / 30.0
    return record(double, times, motion(double, times, [2.6, 1.0], [0.0, 0.0]) * [1.0, -1.0])


@pytest.mark.parametrize("factor", [0.5, 3.0])
def test_sizes_keep_the_proportions_of_the_picture_where_the_motion_is_not_followed(double, mirrored, factor):
    problem, optimum = ended(double, mirrored, {"link2.length": factor})
    found = refine(problem, optimum, IdentifySettings())
    values = found.problem.mechanism_at(found.optimum.x).values
    assert values["link2.length"] / values["link1.length"] == pytest.approx(
        double.values["link2.length"] / double.values["link1.length"], rel=0.01
    )


@pytest.mark.parametrize("given", [False, True])
def test_proportions_are_taken_at_the_scale_of_the_sizes(double, mirrored, given):
    """All sizes twice as large, one of them much more; given sizes are those of the start."""
    mechanism = double.with_choices(fix={"link1.length": double.values["link1.length"]}) if given else double
    larger = dict.fromkeys(SIZES[1:] if given else SIZES, 2.0) | {"link2.length": 6.0}
    problem, optimum = ended(mechanism, mirrored, larger)
    seen = problem.mechanism_at(_as_seen(problem, optimum).x).values
    # the common scale is the mean of the logarithms, all equally well known
    scale = 1.0 if given else 2.0 * 3.0**0.25
    assert [seen[name] for name in SIZES] == pytest.approx([scale * double.values[name] for name in SIZES])


def test_a_motion_that_is_followed_says_what_the_proportions_are(poses, double, truth):
    """The picture has them wrong by 15 %, and the motion is followed."""
    seen = double.with_measured(Measured(SIZES, (np.eye(4) - 0.25) / 0.1**2))
    fit = identify(poses, seen)
    assert fit.ok
    assert sigmas(fit.parameter("link2.length"), truth.values["link2.length"]) < 4.0


def test_what_needs_more_integration_steps_is_fitted_with_them(poses, truth, monkeypatch):
    """As if the first optimum needed twice the steps of the search."""
    asked = []

    def needed(problem, trial, bound):
        asked.append(trial.substeps)
        return ((1 if len(asked) > 1 else 2) * trial.substeps, 1e-5)

    monkeypatch.setattr("monodyn.estimation.shooting.shoot.choose_substeps", needed)
    assert identify(poses, truth, IdentifySettings(starts=1)).ok
    assert asked[1] == 2 * asked[0]


@pytest.mark.parametrize(("stays", "rounds"), [(True, NOISE_ROUNDS), (False, COMMON_ROUNDS)])
def test_noise_is_taken_from_residuals_until_it_stays(truth, monkeypatch, stays, rounds):
    """Positions that a camera moves all together, by little."""
    position = motion(truth, TIMES, [0.3, 0.5], [0.0, 1.0])
    shifts = leaning(position)
    taken = []

    def counted(problem, trial, mean):
        taken.append(mean)
        return common_error(problem, trial, mean)

    monkeypatch.setattr("monodyn.estimation.verdict.refine.common_error", counted)
    if not stays:
        monkeypatch.setattr(NoiseFactors, "is_about", lambda *_: False)
    fit = identify(replace(record(truth, TIMES, position), shifts=shifts), truth, IdentifySettings(starts=1))
    assert fit.ok
    assert len(taken) == rounds


@pytest.mark.slow
def test_noise_that_holds_errors_of_a_camera_gives_way_to_them(truth, double, monkeypatch) -> None:
    """Two ways to stand wrong by 2.6 and 0.4 deviations: from noise as large the search ends on the way."""
    times = np.arange(240) / 60.0
    position, off = motion(truth, times, [1.1, 0.5], [0.0, 1.0]), np.array([-2.6, 0.4])
    shifts = leaning(position)
    wrong = record(truth, times, position + np.tensordot(off, shifts, axes=1))
    poses = replace(wrong, shifts=shifts)

    def missed() -> float:
        common = identify(poses, double, VISCOUS).common_of(0)
        assert common is not None
        return float(np.abs(common.mean - off).max())

    assert missed() < 0.2
    taken: list[int] = []

    def counting(*given: Any) -> Any:
        found = cleared(*given)
        taken.append(found.optimum.evaluations)
        return found

    monkeypatch.setattr("monodyn.estimation.verdict.refine.cleared", counting)
    counted = identify(poses, double, VISCOUS).evaluations
    # what is taken off is found by a search of its own, which counts
    monkeypatch.setattr(
        "monodyn.estimation.verdict.refine.cleared",
        lambda *given: _free_of_charge(cleared(*given)),
    )
    assert counted == identify(poses, double, VISCOUS).evaluations + taken[0]
    asked = []
    monkeypatch.setattr("monodyn.estimation.verdict.refine.cleared", lambda *_: asked.append(_))
    # where nothing but noise is left over there is nothing to give way
    assert identify(replace(record(truth, times, position), shifts=shifts), double, VISCOUS).ok
    assert not asked
    monkeypatch.setattr("monodyn.estimation.verdict.refine.cleared", lambda *_: None)
    assert missed() > 0.8


def _free_of_charge(found: Any) -> Any:
    return found._replace(optimum=replace(found.optimum, evaluations=0))
