"""Frames kept back: the ends of records judge a fit to their beginnings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import monodyn
from monodyn import kept
from monodyn.errors import VideoError
from monodyn.estimation.fit import Doubt, Fit
from monodyn.estimation.settings import IdentifySettings
from monodyn.kept import kept_doubts
from monodyn.mechanism import load
from monodyn.mechanism.simulate import simulate
from monodyn.types import Poses

SETTINGS = IdentifySettings()
NOISE = 1e-3


def swung(count: int, *, kick: float = 0.0, seed: int = 3) -> Poses:
    """Record a single pendulum that is kicked [rad/s] before the last tenth of its frames."""
    mechanism, time = load("single"), np.arange(count) / 30.0
    position = simulate(mechanism, time, np.array([-1.0]), np.array([0.5])).position.copy()
    at = count - count // 10
    position[at:, 0] += kick * (time[at:] - time[at - 1])
    position += NOISE * np.random.default_rng(seed).standard_normal((count, 1))
    covariance = np.full((count, 1, 1), NOISE**2)
    return Poses(("joint1",), np.arange(count), time, position, covariance, np.ones(count, dtype=bool))


def test_a_motion_that_goes_on_leaves_no_doubt() -> None:
    record, mechanism = swung(90), load("single")
    fit = monodyn.identify(record, mechanism, SETTINGS)
    assert fit.ok
    assert kept_doubts(fit, [record], mechanism, SETTINGS) == []


@pytest.mark.slow
def test_angles_that_count_from_hanging_go_on_too() -> None:
    """As encoders count: a quarter turn from what the mechanism's angles begin with."""
    start, time = (
        load("double").with_values({"joint1.damping": 1e-4, "joint2.damping": 1e-4}),
        np.arange(150) / 60.0,
    )
    position = simulate(start, time, np.array([-0.6, 0.4]), np.array([0.5, -1.0])).position
    position = position + NOISE * np.random.default_rng(1).standard_normal(position.shape)
    position[:, 0] += 0.5 * np.pi
    covariance, seen = np.tile(NOISE**2 * np.eye(2), (150, 1, 1)), np.ones(150, dtype=bool)
    record = Poses(("joint1", "joint2"), np.arange(150), time, position, covariance, seen)
    lost = monodyn.identify(record, load("double"), SETTINGS)
    assert not lost.ok
    assert any("--free camera.roll estimates the tilt" in sentence for sentence in lost.advice)
    free = load("double").with_choices(free=["camera.roll"])
    fit = monodyn.identify(record, free, SETTINGS)
    assert fit.parameter("camera.roll").value == pytest.approx(-0.5 * np.pi, abs=0.02)
    assert [doubt for doubt in kept_doubts(fit, [record], free, SETTINGS) if doubt.grade == "refused"] == []


def test_an_end_of_another_kind_is_a_doubt() -> None:
    record, mechanism = swung(90, kick=4.0), load("single")
    # the fit to all of it may be anything: its beginning alone is identified well
    fit = monodyn.identify(swung(90), mechanism, SETTINGS)
    doubts = kept_doubts(fit, [record], mechanism, SETTINGS)
    assert [doubt.grade for doubt in doubts] == ["refused"]
    for doubt in doubts:
        assert doubt.reason.startswith("Identified without the last 0.6 s of the record: The ")
    # many records say it once
    many = monodyn.identify([swung(90), swung(90)], mechanism, SETTINGS)
    assert len(kept_doubts(many, [record, record], mechanism, SETTINGS)) == 1


def test_the_gravest_is_kept() -> None:
    """One record goes on for a while but farther off than its band, another one goes another way at once."""
    records, mechanism = [swung(90, kick=1.2), swung(90, kick=4.0)], load("single")
    fit = monodyn.identify([swung(90), swung(90)], mechanism, SETTINGS)
    apart = [kept_doubts(fit, [record, swung(90)], mechanism, SETTINGS) for record in records]
    assert [doubt.grade for doubt in apart[0]] == ["approximate"]
    assert " standard deviations from their prediction " in apart[0][0].reason
    assert [doubt.grade for doubt in apart[1]] == ["refused"]
    both = kept_doubts(fit, records, mechanism, SETTINGS)
    assert both == apart[1]
    assert " The motion does not go on as identified: " in both[0].reason


def test_a_fit_that_rests_on_the_end_of_its_record_is_doubted(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pendulum that hangs at rest until it is pushed at last."""
    record, mechanism = swung(90), load("single")
    fit, rest = monodyn.identify(record, mechanism, SETTINGS), int(0.8 * 90)
    position = record.position.copy()
    position[:rest] = -0.5 * np.pi + NOISE * np.random.default_rng(0).standard_normal((rest, 1))
    still = replace(record, position=position)
    assert kept_doubts(fit, [still], mechanism, SETTINGS) == [
        Doubt(
            "approximate",
            "Without the last 20% of what was measured, kept back to judge the fit by, the mechanism cannot "
            "be identified: Nothing moves in the record: no joint leaves its noise; give frames with motion.",
        )
    ]

    def unusable(*args: object, **kwargs: object) -> Fit:
        raise VideoError("record 0: no.")

    monkeypatch.setattr(kept, "identify", unusable)
    assert kept_doubts(fit, [record], mechanism, SETTINGS) == [
        Doubt(
            "approximate",
            "Without the last 20% of what was measured, kept back to judge the fit by, the mechanism cannot "
            "be identified: record 0: no.",
        )
    ]
    # where the rows that would be kept back are too few nothing is tried
    unseen = replace(record, seen=np.arange(90) >= 45)
    assert kept_doubts(fit, [unseen], mechanism, SETTINGS) == []


def test_where_enough_is_left_after_the_fitted_rows_nothing_is_kept_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    record, mechanism, given = swung(90), load("single"), []
    fits = [monodyn.identify(record[:stop], mechanism, SETTINGS) for stop in (81, 80)]

    def noted(records, mechanism, settings, progress=None):
        given.append([len(one) for one in records])
        return monodyn.identify(records, mechanism, settings)

    monkeypatch.setattr(kept, "identify", noted)
    # nine rows say nothing, ten do; and of what was not fitted nothing is fitted now
    for fit in fits:
        assert kept_doubts(fit, [record], mechanism, SETTINGS) == []
    assert given == [[65]]


def test_a_short_record_keeps_nothing_back(monkeypatch: pytest.MonkeyPatch) -> None:
    record, mechanism = swung(40), load("single")
    fit = monodyn.identify(record, mechanism, SETTINGS)
    monkeypatch.setattr(kept, "identify", None)
    assert kept_doubts(fit, [record], mechanism, SETTINGS) == []


def test_a_refused_fit_is_not_judged_again(monkeypatch: pytest.MonkeyPatch) -> None:
    record, mechanism = swung(90), load("single")
    fit = monodyn.identify(record, mechanism, SETTINGS).doubted([Doubt("refused", "No.")])
    monkeypatch.setattr(kept, "identify", None)
    assert kept_doubts(fit, [record], mechanism, SETTINGS) == []


def test_intervals_of_many_fits_are_not_made_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    record, mechanism = swung(90), load("single")
    fit = monodyn.identify(record, mechanism, SETTINGS)
    asked = []

    def noted(records, mechanism, settings, progress=None):
        asked.append(settings)
        return fit

    monkeypatch.setattr(kept, "identify", noted)
    kept_doubts(fit, [record], mechanism, replace(SETTINGS, uncertainty="bootstrap"))
    assert [(one.starts, one.uncertainty) for one in asked] == [(1, "linear")]


def test_the_kind_of_torque_is_that_of_the_whole_record(monkeypatch: pytest.MonkeyPatch) -> None:
    record, mechanism = swung(90), load("single")
    fit = monodyn.identify(record, mechanism, SETTINGS)
    asked = []

    def noted(records, mechanism, settings, progress=None):
        drags = [p.name for p in mechanism.parameters if p.kind == "drag" and p.free]
        asked.append((settings.torque, settings.terms, drags))
        return fit

    monkeypatch.setattr(kept, "identify", noted)
    braked = monodyn.identify(record, mechanism.with_choices(free=["joint1.drag"]), SETTINGS)
    periodic = replace(fit, torque="fourier", mechanism=mechanism.with_torque("fourier", terms=3, period=1.0))
    for one, settings in ((fit, SETTINGS), (braked, SETTINGS), (periodic, SETTINGS)):
        kept_doubts(one, [record], mechanism, settings)
    kept_doubts(periodic, [record], mechanism, replace(SETTINGS, torque="friction"))
    assert asked == [
        ("friction", 0, []),
        ("friction", 0, ["joint1.drag"]),
        ("fourier", 3, []),
        ("friction", 0, []),
    ]
