"""Frames kept back: the ends of records judge a fit to their beginnings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import monodyn
from monodyn import kept
from monodyn.estimation.fit import Doubt
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


def test_an_end_of_another_kind_is_a_doubt() -> None:
    record, mechanism = swung(90, kick=4.0), load("single")
    # the fit to all of it may be anything: its beginning alone is identified well
    fit = monodyn.identify(swung(90), mechanism, SETTINGS)
    doubts = kept_doubts(fit, [record], mechanism, SETTINGS)
    # it goes another way at once, and leaves its band
    assert sorted(doubt.grade for doubt in doubts) == ["approximate", "refused"]
    for doubt in doubts:
        assert doubt.reason.startswith("Identified without the last 0.6 s of the record: The ")
    # many records say it once
    assert len(kept_doubts(fit, [record, record], mechanism, SETTINGS)) == 2


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
