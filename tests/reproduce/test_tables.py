"""The fits and the poses as rows of numbers."""

from __future__ import annotations

import csv
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments import NOISE, evidence, moved, repetition, seen
from monodyn.reproduce.cases import Case
from monodyn.reproduce.claims import claims
from monodyn.reproduce.plans import FitPlan
from monodyn.reproduce.tables import (
    case_row,
    comparable,
    csv_text,
    document,
    gain_row,
    labels,
    legend,
    main_cases,
    plain_rows,
    pose_gain,
)
from monodyn.reproduce.units import units_of


def test_the_table_holds_every_fit_of_every_pendulum() -> None:
    cases = [moved("III", 0.0), replace(moved("I", 1e-3), parameters={"l1": 0.5}), moved("I", 1e-3, start=1)]
    rows = list(csv.DictReader(csv_text([repetition(*cases), repetition(*cases)]).splitlines()))
    assert [(row["pendulum"], row["case"]) for row in rows] == [
        ("0", "III"), ("0", "I"), ("0", "I"), ("1", "III"), ("1", "I"), ("1", "I"),
    ]  # fmt: skip
    assert rows[0]["seed"] == "0"
    assert float(rows[1]["error_joint1_deg"]) == pytest.approx(np.degrees(1e-3), rel=1e-5)
    assert rows[1]["l1_error_percent"] == "50.0"
    assert rows[0]["l1_error_percent"] == ""


def test_the_table_has_the_columns_of_all_pendulums() -> None:
    sized = replace(moved("I", 1e-3), parameters={"l1": 0.5})
    lines = csv_text([repetition(moved("I", 1e-3)), repetition(sized)]).splitlines()
    assert lines[0].endswith(",l1_error_percent,status")
    assert [row["l1_error_percent"] for row in csv.DictReader(lines)] == ["", "50.0"]


def test_what_is_unbounded_is_an_empty_cell() -> None:
    text = csv_text([repetition(replace(moved("I", 1e-3), parameters={"l1": np.inf}))])
    assert [row["l1_error_percent"] for row in csv.DictReader(text.splitlines())] == [""]


def test_the_document_says_what_each_claim_rests_on() -> None:
    found = repetition(moved("I", 1e-3))
    made = document([found], claims([found.evidence]))
    pendulum = made["pendulums"][0]
    assert pendulum["poses"][1]["error_joint1_deg"] == pytest.approx(np.degrees(NOISE), rel=0.2)
    assert pendulum["poses"][0]["status"] == "failed: x"
    assert pendulum["fits"][0]["series"] == ""
    assert pendulum["assumptions"][0]["held"] is False
    close = next(claim for claim in made["claims"] if claim["claim"].startswith("The estimated pose"))
    assert close["fast"]["held"] == close["fast"]["of"] == 1
    assert close["fast"]["rests_on"] == "1 pendulum, 90 frames"


def test_ratios_are_given_where_both_had_the_same_information() -> None:
    default = replace(moved("I", 1e-3), seconds=0.5)
    published = replace(moved("I", 4e-3, method="paper"), seconds=0.25)
    units = units_of(evidence().seen.joints)
    assert comparable([published, default])
    gain = gain_row(case_row(published, units), case_row(default, units))
    assert gain["error_joint1_deg"] == pytest.approx(4.0, rel=1e-5)
    assert gain["ahead_joint2_deg"] == pytest.approx(4.0, rel=1e-5)
    assert gain["seconds"] == pytest.approx(0.5)
    refused = Case(FitPlan("fast", "II", 40, series="alone"), "no period")
    assert not comparable([moved("II", 1e-3, method="paper"), refused])
    assert default.poses is not None
    unseen = default.poses.copy()
    unseen[3] = np.nan
    assert not comparable([published, replace(default, poses=unseen)])
    lost: Any = SimpleNamespace(**{**vars(default.fit), "ok": False})
    assert not comparable([published, replace(default, fit=lost)])


def test_poses_are_compared_over_the_frames_that_both_have_seen() -> None:
    errors = np.full((90, 2), 0.01)
    published, default = errors.copy(), 0.5 * errors
    # the published method has lost the frames in which the other one is far off
    published[:20], default[:20] = np.nan, 1.0
    gain = pose_gain(replace(seen("paper"), errors=published), replace(seen(), errors=default))
    assert gain["error_joint1_deg"] == pytest.approx(2.0)
    untold = pose_gain(replace(seen("paper"), errors=None), seen())
    assert untold["error_joint1_deg"] is None


def test_cases_stand_with_the_methods_side_by_side() -> None:
    published = evidence(moved("I", 4e-3, method="paper"), moved("II", 0.0, method="paper"), method="paper")
    found = repetition(moved("III", 0.0), moved("I", 1e-3), moved("I", 1e-3, start=1), published=published)
    main = main_cases(found)
    assert [(c.plan.case, c.plan.series, c.plan.method) for c in main] == [
        ("I", "", "paper"),
        ("I", "", "fast"),
        ("II", "alone", "paper"),
        ("III", "with-friction", "fast"),
    ]
    columns, rows = plain_rows(found)
    assert columns[6] == "residual [deg]"
    assert rows[0][:4] == ["I", "", "published", "6"]
    assert rows[2][:3] == ["", "", "published / default"]
    assert rows[3][:3] == ["II", "torque alone", "published"]
    assert rows[4][:3] == ["III", "with friction", "default"]


def test_the_terminal_says_what_its_marks_mean() -> None:
    off = moved("I", 1e-3)
    refused: Any = SimpleNamespace(**{**vars(off.fit), "ok": False})
    found = repetition(
        replace(off, fit=refused), Case(FitPlan("fast", "II", 40, series="alone"), "no period")
    )
    assert [row[2] for row in plain_rows(found)[1]] == ["default *", "default"]
    told = (
        "Errors are rms by joint: joint1 · joint2. Published / default: above one the default method is "
        "better."
    )
    assert legend([found]) == [
        told,
        "–: no fit; its reason is on the page.",
        "*: the simulated motion does not follow the poses; claims do not rest on such a fit.",
    ]
    assert legend([repetition(off)]) == [told]


def test_labels_are_lengths_then_masses_then_dampings() -> None:
    case = replace(moved("I", 0.0), parameters={"b1/m1": 0.0, "m2/m1": 0.0, "l2": 0.0, "l1": 0.0})
    assert labels([case]) == ["l1", "l2", "m2/m1", "b1/m1"]
