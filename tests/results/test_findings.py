"""The content of fit.json, and the parameters of the first table."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import monodyn
from fits import identified, made_fit, record
from monodyn.estimation.fit import Estimate
from monodyn.results.export import json_text
from monodyn.results.findings import Findings, fit_document, listed_rows
from monodyn.results.trace import trace_of


def test_json_has_no_infinity() -> None:
    document = json.loads(json_text(fit_document(Findings(made_fit()))))
    damping = document["parameters"][1]
    assert (damping["std"], damping["upper"], damping["lower"]) == (None, None, 0.0)
    start = identified().starts[0]
    assert document["initial_state"]["velocity"] == {"joint1": start.velocity[0]}
    assert document["initial_state"]["velocity_std"] == {
        "joint1": pytest.approx(start.covariance[1, 1] ** 0.5)
    }
    assert document["heldout_rms"] == {"joint1": None}


def test_notes_follow_the_advice_and_the_frames_are_those_of_the_record() -> None:
    fit = made_fit()
    trace = trace_of(fit, record(fit))
    document = fit_document(Findings(fit, [trace], notes=("Light it better.",)))
    assert document["advice"] == ["Measure <b>one</b> mass & be done.", "Light it better."]
    assert document["fit_frames"] == [0, 20]
    assert fit_document(Findings(fit, [trace], fit_frames=(3, 9)))["fit_frames"] == [3, 9]
    assert fit_document(Findings(fit))["fit_frames"] is None


def test_several_records_have_a_start_each() -> None:
    fit = made_fit(starts=identified().starts * 2)
    assert [start["time"] for start in fit_document(Findings(fit))["initial_state"]] == [0.0, 0.0]


def test_single_torques_are_not_listed_but_what_free_torques_hold_is() -> None:
    mechanism = monodyn.load("single").with_torque("free", knots=np.arange(3) / 30.0)

    def row(name: str, unit: str, *, free: bool, identifiable: bool) -> Estimate:
        return Estimate(name, 1.0, math.inf, 0.0, 2.0, unit, free, identifiable, False)

    rows = (
        row("joint1.torque.0", "N m", free=True, identifiable=True),
        row("link1.length", "m", free=False, identifiable=False),
        row("link1.width", "m", free=False, identifiable=True),
        row("joint1.damping", "N m s/rad", free=False, identifiable=False),
    )
    free = made_fit(torque="free", parameters=rows, mechanism=mechanism)
    assert [row.name for row in listed_rows(free)] == ["link1.length"]
    assert [row.name for row in listed_rows(made_fit(parameters=rows))] == ["joint1.torque.0"]
