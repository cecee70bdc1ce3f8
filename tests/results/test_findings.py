"""The content of fit.json, and the parameters of the first table."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from importlib.resources import files
from typing import Any

import jsonschema
import numpy as np
import pytest

import monodyn
from fits import identified, made_fit, record
from monodyn.estimation.fit import Doubt, Estimate, Fit
from monodyn.results.export import json_text
from monodyn.results.findings import SCHEMA, Findings, fit_document, listed_rows, origin
from monodyn.results.intact import sealed
from monodyn.results.trace import trace_of


def test_json_has_no_infinity() -> None:
    document = json.loads(json_text(fit_document(Findings(made_fit()))))
    damping = document["parameters"][1]
    assert (damping["std"], damping["upper"], damping["lower"]) == (None, None, 0.0)
    start = identified().starts[0]
    (stated,) = document["initial_state"]
    assert stated["velocity"] == {"joint1": start.velocity[0]}
    assert stated["velocity_std"] == {"joint1": pytest.approx(start.covariance[1, 1] ** 0.5)}
    assert document["heldout_rms"] == []


def test_the_form_is_that_of_its_schema() -> None:
    """Against a validator of JSON Schema that we did not write, with a record, without one, and refused."""
    schema = json.loads(files("monodyn.results").joinpath("fit.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["properties"]["schema"]["const"] == SCHEMA
    fit = identified()
    refused = fit.doubted([Doubt("refused", "It is another mechanism.")])
    acting = [Findings(driven(kind)) for kind in ("fourier", "free", "known")]
    for findings in (Findings(fit, [trace_of(fit, record(fit))]), Findings(fit), Findings(refused), *acting):
        jsonschema.validate(json.loads(json_text(written(findings))), schema)
    broken = {**json.loads(json_text(written(Findings(fit)))), "rms": 1.0}
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(broken, schema)


def test_the_schema_says_what_every_field_is() -> None:
    schema = json.loads(files("monodyn.results").joinpath("fit.schema.json").read_text(encoding="utf-8"))
    assert undescribed(schema, "") == []


def undescribed(schema: dict[str, Any], name: str) -> list[str]:
    """Name the fields of a schema, and of what is in them, that have no description."""
    found = []
    for key, field in schema.get("properties", {}).items():
        found += [] if field.get("description") else [f"{name}.{key}"]
        found += undescribed(field, f"{name}.{key}")
    for inner in (schema.get("items"), schema.get("additionalProperties")):
        found += undescribed(inner, f"{name}[]") if isinstance(inner, dict) else []
    return found


def written(findings: Findings) -> dict[str, Any]:
    """Return what a run writes next to its model.xml."""
    return sealed({**fit_document(findings), "model_sha256": "that of a file"})


def driven(kind: str) -> Fit:
    """Return a fit under a torque over time, whose numbers are drawn."""
    base = identified().mechanism.with_values({"time_scale": 0.8})
    moved = base.with_torque(kind, terms=3, period=0.7, knots=np.array([0.1, 0.2, 0.5]))
    rng = np.random.default_rng(2)
    draws = {p.name: rng.normal() for p in moved.parameters if p.kind == "torque"}
    return replace(identified(), mechanism=moved.with_values(draws), torque=kind)


def test_a_drive_is_what_its_formula_says() -> None:
    """Evaluated as another program would, from fit.json alone, against the torques of the dynamics."""
    stamps = np.linspace(-0.2, 1.4, 33)
    for kind in ("fourier", "free"):
        drive = json.loads(json_text(fit_document(Findings(driven(kind)))))["drive"]
        t, row = stamps * drive["time_scale"], drive["joints"]["joint1"]
        if kind == "fourier":
            waves = zip(row["cos"], row["sin"], strict=True)
            angle = 2.0 * np.pi * t / drive["period"]
            found = row["mean"] + sum(
                a * np.cos(k * angle) + b * np.sin(k * angle) for k, (a, b) in enumerate(waves, 1)
            )
            assert len(row["cos"]) == drive["harmonics"] == 3
        else:
            found = np.interp(t, drive["knots"], row["values"], left=0.0, right=0.0)
        true = driven(kind).mechanism.drive.at(t)[:, 0]
        np.testing.assert_allclose(found, true, rtol=1e-9, atol=1e-12)
        assert row["unit"] == "N m"
        assert np.abs(true).max() > 0.1
    known = fit_document(Findings(driven("known")))["drive"]
    assert (known["lag"], known["joints"]) == (0.0, {})
    none = fit_document(Findings(identified()))["drive"]
    assert (none["formula"], none["joints"], none["lag"]) == (None, {}, None)


def test_it_is_said_where_each_value_comes_from() -> None:
    origins = {row["name"]: row["origin"] for row in fit_document(Findings(identified()))["parameters"]}
    assert origins["link1.length"] == "estimated"
    assert origins["link1.mass"] == "derived"
    assert origins["gravity"] == "given"
    held = next(p.name for p in identified().parameters if not p.free and p.unit == "m")
    tied = replace(identified(), tied=((held, "link1.length"),))
    assert origin(tied.parameter(held), tied) == "assumed"


def test_the_ends_of_a_search_are_no_interval() -> None:
    rows = (Estimate("link1.length", 0.2, math.inf, 0.1, 100.0, "m", True, False, False),)
    mechanism = identified().mechanism.with_choices(bounds={"link1.length": (1e-3, 100.0)})
    (row,) = fit_document(Findings(made_fit(parameters=rows, mechanism=mechanism)))["parameters"]
    assert (row["lower"], row["upper"]) == (0.1, None)


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
