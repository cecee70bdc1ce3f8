"""A periodic torque: found without a hint, or refused with what to do."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from driven import (
    CART,
    DOUBLE,
    GEOM,
    MASSIVE,
    PERIOD,
    SERIES,
    THICKNESS,
    misses,
    simulated,
    started,
    task_of,
    two_waves,
    wave,
)  # fmt: skip
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.shoot import fit_pieces
from monodyn.estimation.torque import fourier
from monodyn.estimation.torque.evidence import EVIDENCE
from monodyn.estimation.torque.free import residual_rms
from monodyn.estimation.torque.periods import PeriodSearch
from monodyn.mechanism import load
from monodyn.results.predict import predict
from monodyn.results.torques import torques
from monodyn.stages import identify

NO_PERIOD = (
    "The period of the torque cannot be estimated: no period that the record shows more than once explains "
    "the motion better than friction alone. Give more frames, or the period with "
    "--fix torque.period=SECONDS, or leave out --identify.torque fourier."
)


@pytest.fixture(scope="module")
def series(driven, tmp_path_factory):
    start = started(DOUBLE, tmp_path_factory.mktemp("series"), 0.5, **MASSIVE)
    return identify(driven[0], start, IdentifySettings(torque="fourier"))


def test_a_periodic_torque_is_found_without_a_hint(series, driven):
    assert series.ok, series.status
    assert series.torque == "fourier"
    period = series.parameter("torque.period")
    assert abs(period.value - PERIOD) < min(4 * period.std, 0.005 * PERIOD)
    assert series.mechanism.drive.table.shape == (2, 3)
    assert misses(series, *driven).max() < 0.02
    for name, true in (("link1.length", 0.23), ("link2.length", 0.17), ("joint2.damping", 5e-4)):
        assert abs(series.parameter(name).value - true) < 4 * series.parameter(name).std


def test_the_band_of_a_torque_covers_the_truth(series, driven):
    found = torques(series, driven[0].time)
    error = np.abs(found.torque - driven[1]) / found.std
    assert np.percentile(error, 90) < 3.0


def test_a_periodic_torque_predicts(series, tmp_path):
    longer, _ = simulated(DOUBLE, [-1.5, 0.3], 210, wave)
    future = predict(series, times=longer.time[150:])
    assert np.degrees(np.abs(future.position - longer.position[150:])).max() < 1.0


@pytest.mark.slow
def test_harmonics_are_counted(tmp_path):
    record, applied = simulated(DOUBLE, [-1.5, 0.3], 180, two_waves)
    fit = identify(record, started(DOUBLE, tmp_path, 2.0, **THICKNESS), IdentifySettings(torque="fourier"))
    assert fit.ok, fit.status
    assert (fit.mechanism.drive.table.shape[1] - 1) // 2 == 3
    assert misses(fit, record, applied).max() < 0.03


def test_a_guess_whose_linear_step_led_far_off_is_brought_back(driven, tmp_path):
    """The step is linear, from masses that may be far from the true ones: dampings come out absurd."""
    start = started(DOUBLE, tmp_path, 0.5, **MASSIVE)
    task = task_of([driven[0]], start)
    periods = PeriodSearch.of(start, task.data, task.smoothed)
    guess = periods.guesses(1)[0]
    brakes = periods.problem.unknowns.of_kind("damping")
    assert brakes.sum() == 2
    absurd = replace(guess, change=np.where(brakes, 300.0, guess.change))
    problem, optimum = fourier._in_pieces(start, task, periods, absurd)
    assert residual_rms(problem, optimum) < 1.3


@pytest.mark.slow
def test_a_force_at_a_slide(tmp_path):
    record, applied = simulated(
        CART, [0.0, -1.0], 150, lambda t: np.array([0.5 * np.sin(2 * np.pi * t / 1.1), 0.0])
    )
    start = started(CART, tmp_path, 0.7, **{"pole.thickness": 0.006})
    fit = identify(record, start, IdentifySettings(torque="fourier", terms=1))
    assert fit.ok, fit.status
    assert fit.parameter("torque.period").value == pytest.approx(1.1, rel=2e-3)
    error = torques(fit, record.time).torque - applied
    assert np.sqrt(np.mean(error[:, 0] ** 2)) < 0.02 * np.sqrt(np.mean(applied[:, 0] ** 2))
    assert fit.parameter("slider.torque.sin1").unit == "N"


@pytest.mark.slow
def test_without_a_mass_torques_are_ratios(driven, tmp_path):
    fit = identify(driven[0], started(DOUBLE, tmp_path, 0.5), IdentifySettings(torque="fourier", terms=1))
    assert fit.ok, fit.status
    assert not fit.parameter("joint1.torque.sin1").identifiable
    ratio = next(c for c in fit.combinations if c.name == "joint1.torque.sin1 / link1.thickness")
    assert abs(ratio.value - 0.04 / 0.006) < 4 * ratio.std
    assert any("mass scale" in sentence for sentence in fit.advice)


def test_the_paper_s_series_stands_alone(tmp_path):
    frictionless = DOUBLE.replace('damping="0.001"', "").replace('damping="0.0005"', "")
    record, applied = simulated(frictionless, [-1.5, 0.3], 150, wave)
    start = started(DOUBLE, tmp_path, 0.5, **MASSIVE)
    fit = identify(record, start, IdentifySettings(torque="fourier", series="alone", terms=3))
    assert fit.ok, fit.status
    assert fit.parameter("joint1.damping").value == 0.0
    assert not fit.parameter("joint1.damping").free
    assert len([n for n in fit.names if ".torque." in n]) == 14
    assert misses(fit, record, applied).max() < 0.03


def test_no_period_is_said_with_what_to_do(passive, tmp_path):
    start = started(DOUBLE, tmp_path, 0.5, **THICKNESS)
    fit = identify(passive[0], start, IdentifySettings(torque="fourier"))
    assert not fit.ok
    assert fit.status == NO_PERIOD


@pytest.mark.slow
def test_a_period_longer_than_the_record_is_not_guessed(tmp_path):
    """Half a period of the torque looks like a shorter one to a model that may choose its sizes."""
    for first in (0, 30, 60):
        record, _ = simulated(DOUBLE, [-1.5, 0.3], 120, wave)
        fit = identify(record[first : first + 36], started(DOUBLE, tmp_path, 0.5), SERIES)
        assert not fit.ok
        assert fit.status == NO_PERIOD


@pytest.mark.slow
def test_what_the_model_lacks_is_no_periodic_torque(passive, tmp_path):
    """A passive record with a small fault that follows the motion: angles read 0.2 % too large."""
    record = replace(passive[0], position=1.002 * passive[0].position)
    fit = identify(record, started(DOUBLE, tmp_path, 0.5, **THICKNESS), SERIES)
    assert not fit.ok
    assert fit.status == NO_PERIOD


@pytest.mark.slow
def test_a_given_thickness_without_use_is_said(driven, tmp_path):
    inertial = DOUBLE.replace(GEOM, GEOM.replace('density="2700"', 'mass="0.1"'))
    start = started(inertial, tmp_path, 1.0, **THICKNESS)
    fit = identify(driven[0], start, IdentifySettings(torque="fourier", terms=1))
    assert (
        "link1.thickness and link2.thickness were given, but the motion of this mechanism does not depend on "
        "them: its file states masses; give those."
    ) in fit.advice


def test_a_known_period_is_kept(passive, tmp_path):
    start = started(DOUBLE, tmp_path, 0.5, **THICKNESS).with_torque("fourier", terms=1, period=1.0)
    start = start.with_choices(fix={"torque.period": 0.9})
    fit = identify(passive[0], start, IdentifySettings(torque="fourier", terms=1))
    assert fit.ok, fit.status
    assert fit.parameter("torque.period").value == 0.9
    sine = fit.parameter("joint1.torque.sin1")
    assert abs(sine.value) < 4 * sine.std
    assert fit.advice[0] == (
        "A torque of period 0.9 s is under a hundredth of weight and inertia at every joint: it may be what "
        "the model lacks; nothing periodic need act."
    )


def test_more_unknowns_than_samples_is_refused(driven, tmp_path):
    settings = IdentifySettings(torque="fourier", terms=12)
    fit = identify(driven[0][:20], started(DOUBLE, tmp_path, 0.5), settings)
    assert not fit.ok
    assert fit.status == (
        "40 measured joint positions cannot determine 61 unknowns (parameters and start states); give more "
        "frames or fix parameters."
    )


def test_of_series_that_explain_as_much_the_simplest_is_taken():
    """A tenth of what an unknown must gain decides nothing; harmonics count before the period."""

    def tried(terms, period, cost):
        mechanism = load("double").with_torque("fourier", terms=terms, period=period)
        problem = SimpleNamespace(
            unknowns=range(10),
            data=SimpleNamespace(samples=300),
            mechanism_at=lambda _: mechanism,
            rows=lambda _: None,
            model=lambda *_: SimpleNamespace(cost=cost),
        )
        return problem, SimpleNamespace(sigma=1.0, x=None, trial=SimpleNamespace(pieces=None))

    little = 0.05 * EVIDENCE
    series = [tried(2, 1.0, 150.0 - little), tried(1, 2.0, 150.0 - little), tried(1, 1.0, 150.0)]
    assert fourier._simplest(series) is series[2]
    series[1] = tried(1, 2.0, 150.0 - 1.01 * EVIDENCE)
    assert fourier._simplest(series) is series[1]


def test_fits_compare_wherever_they_began(driven, tmp_path):
    """The loss has a limit in units of the typical residual, which is large far from the record."""
    start = started(DOUBLE, tmp_path, 0.5, **MASSIVE)
    task = task_of([driven[0]], start)
    periods = PeriodSearch.of(start, task.data, task.smoothed)
    problem, ended = fourier._in_pieces(start, task, periods, periods.guesses(1)[0])
    route = replace(task.search(problem).route, share=0.0)
    near = fit_pieces(problem, ended.trial, route, route.fine)
    far = fit_pieces(problem, near.trial.at(near.x, near.trial.states + 0.05), route, route.fine)
    # the very cost is larger by 4 % where there was no limit to speak of
    assert far.cost > 1.02 * near.cost
    one, other = fourier._criteria([(problem, near), (problem, far)])
    assert other == pytest.approx(one, abs=0.1 * EVIDENCE)


@pytest.mark.slow
def test_a_period_is_found_where_smoothing_hides_what_the_torque_does(tmp_path):
    """A lively swing under a torque with two harmonics at the first joint, 200 rows at 30 a second."""

    def push(time):
        turn = 2 * np.pi * time / 1.25
        return np.array([0.05 * np.sin(turn + 0.4) + 0.03 * np.sin(2 * turn + 1.0), 0.0])

    record, _ = simulated(DOUBLE, [-0.4, 0.9], 200, push)
    fit = identify(record, started(DOUBLE, tmp_path, 0.6, **THICKNESS), IdentifySettings(torque="fourier"))
    assert fit.ok, fit.status
    assert fit.parameter("torque.period").value == pytest.approx(1.25, rel=5e-3)
    assert (fit.mechanism.drive.table.shape[1] - 1) // 2 == 2
    for name, true in (("link1.length", 0.23), ("link2.length", 0.17)):
        assert fit.parameter(name).value == pytest.approx(true, rel=0.02)
