"""The period of a torque, from accelerations alone."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from driven import (
    DOUBLE,
    NOISE,
    PERIOD,
    THICKNESS,
    simulated,
    started,
)
from monodyn.estimation.record.samples import prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.shooting import starts
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.torque.periods import PeriodSearch
from monodyn.mechanism import load
from monodyn.types import Poses
from support import slow
from swings import white


def guessed(record, mechanism, terms=0):
    search = PeriodSearch.of(mechanism, prepare((record,), mechanism), (smooth(record),))
    return search, search.guesses(terms)


@pytest.mark.slow
@pytest.mark.parametrize("period", [slow(0.6), 1.1, 2.3])
@pytest.mark.parametrize("factor", [0.5, slow(2.0)])
def test_the_period_is_guessed_at_any_scale(period, factor, tmp_path):
    """Within a percent from accelerations alone; peaks are smoothed away, so sizes come out less exactly."""

    def push(time):
        turn = 2 * np.pi * time / period
        return np.array([0.03 * np.sin(turn) + 0.006 * np.cos(2 * turn), 0.004 * np.cos(turn)])

    record, _ = simulated(DOUBLE, [-1.5, 0.1], 200, push)
    start = started(DOUBLE, tmp_path, factor, **THICKNESS)
    search, guesses = guessed(record, start)
    assert guesses[0].period == pytest.approx(period, rel=0.01)
    driven = posed(start.with_torque("fourier", terms=5, period=guesses[0].period), prepare((record,), start))
    found = driven.mechanism_at(search.start(guesses[0], driven))
    assert found.values["link1.length"] == pytest.approx(0.23, rel=0.35)
    table = guesses[0].table
    np.testing.assert_array_equal(found.drive.table[:, : table.shape[1]], table)
    assert not found.drive.table[:, table.shape[1] :].any()


@pytest.mark.skipif("MONODYN_DATA" not in os.environ, reason="MONODYN_DATA is not set: no rendered clips")
@pytest.mark.parametrize("frames", [100, 200, 300])
def test_the_period_of_a_rendered_clip(frames):
    """Its motion is driven with 1.4286 s and swings freely with 1.05 s; sizes are known up to a scale."""
    truth = json.loads((Path(os.environ["MONODYN_DATA"]) / "rendered" / "double_torque.json").read_text())
    (l1, w1, _), (l2, w2, _) = truth["truth"]["links"]
    seen = {"link1.length": l1, "link1.width": w1, "link2.length": l2, "link2.width": w2}
    mechanism = load("double")
    overhang = {name: 1e-9 for name in mechanism.values if name.endswith((".tail", ".tip"))}
    mechanism = mechanism.with_values({name: 0.7 * value for name, value in seen.items()} | overhang)
    position = np.array(truth["q"])[:frames]
    position = position + NOISE * np.random.default_rng(0).normal(size=position.shape)
    record = white(("joint1", "joint2"), np.array(truth["times"])[:frames], position, NOISE)
    _, guesses = guessed(record, mechanism)
    assert guesses[0].period == pytest.approx(1 / 0.7, rel=5e-3)
    # the motion has one harmonic; what it is compared with has two at least
    assert guesses[0].terms == 2


@pytest.mark.parametrize(("lower", "upper"), [(2.0, 2.5), (2.29, 2.295), (1.8, 2.2), (1e-3, 2.0)])
def test_periods_stay_within_bounds(lower, upper, driven, tmp_path):
    start = started(DOUBLE, tmp_path, 0.5, **THICKNESS).with_torque("fourier", terms=1, period=lower)
    _, guesses = guessed(driven[0], start.with_choices(bounds={"torque.period": (lower, upper)}), 1)
    assert guesses
    assert all(lower <= guess.period <= upper for guess in guesses)
    if lower < PERIOD < upper:
        # the scan goes by a tenth of a turn over the record
        assert abs(1 / guesses[0].period - 1 / PERIOD) < 0.05 / (driven[0].time[-1] - driven[0].time[0])


def test_bounds_between_which_the_record_shows_nothing_give_no_period(driven, tmp_path):
    start = started(DOUBLE, tmp_path, 0.5, **THICKNESS)
    search = PeriodSearch.of(start, prepare(driven[:1], start), (smooth(driven[0]),))
    for bounds in ((1e-9, 1e-8), (1e7, 1e8)):
        assert replace(search, bounds=bounds).guesses(0) == []


def test_a_scale_at_which_no_torque_moves_anything_is_not_taken(driven, tmp_path, monkeypatch):
    """As where half of a record is in seconds and the other half in microseconds."""
    start = started(DOUBLE, tmp_path, 0.5, **THICKNESS)
    search = PeriodSearch.of(start, prepare(driven[:1], start), (smooth(driven[0]),))
    scales, usual = starts.starts_of_scales(search.problem, starts.FINE_FACTORS), starts.torque_response

    def response(problem, x, motion):
        found = usual(problem, x, motion)
        return found if np.array_equal(x, scales[3]) else 0.0 * found

    monkeypatch.setattr(starts, "torque_response", response)
    np.testing.assert_array_equal(starts.least_driven(search.problem, search.motion), scales[3])


def test_rows_without_a_joint_tell_no_period(driven, tmp_path):
    position = driven[0].position.copy()
    position[::2, 0] = position[1::2, 1] = np.nan
    holes = Poses(
        driven[0].joints, driven[0].frame, driven[0].time, position, driven[0].covariance, driven[0].seen
    )
    assert guessed(holes, started(DOUBLE, tmp_path, 0.5, **THICKNESS))[1] == []
