"""The fits and the poses as rows of numbers."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from experiments import FAILED, JOINTS, NOISE, moved, seen
from monodyn.reproduce.tables import csv_text, document, main_cases, plain_rows


def test_the_table_holds_every_fit() -> None:
    cases = [moved("III", 0.0), moved("I", 1e-3), moved("I", 2e-3, "filtered"), moved("II", 5e-3)]
    rows = list(csv.DictReader(csv_text(cases, JOINTS).splitlines()))
    assert [row["case"] for row in rows] == ["III", "I", "I", "II"]
    assert float(rows[1]["error_joint1_deg"]) == pytest.approx(np.degrees(1e-3), rel=1e-5)
    assert [case.plan.case for case in main_cases(cases)] == ["I", "I", "II", "III"]
    columns, plain = plain_rows(cases, JOINTS)
    assert len(columns) == len(plain[0])
    assert plain[0][:4] == ["I", "measured", "default", "6"]
    made = document({"fast": seen(), "paper": FAILED}, cases, [], JOINTS)
    assert made["poses"][1]["error_joint1_deg"] == pytest.approx(np.degrees(NOISE), rel=0.2)
    assert made["poses"][0]["status"] == "failed: x"
