"""Tables and JSON: numbers that read back as they were."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from fits import made_fit, record
from monodyn.results.export import json_text, jsonable, prediction_table, states_table, torque_table
from monodyn.results.predict import predict
from monodyn.results.trace import trace_of


def test_tables_round_trip_and_count_frames() -> None:
    fit = made_fit()
    future = predict(fit, until=1.2)
    trace = trace_of(fit, record(fit), future)
    lines = states_table(["joint1"], [trace]).splitlines()
    assert lines[0] == "frame,time,joint1,joint1_vel,joint1_std"
    assert float(lines[4].split(",")[2]) == trace.states.position[3, 0]
    lines = prediction_table(["joint1"], trace).splitlines()
    assert lines[0] == "frame,time,joint1,joint1_std"
    assert [line.split(",")[0] for line in lines[1:4]] == ["20", "21", "22"]
    assert len(lines) == 1 + len(future.time)
    several = states_table(["joint1"], [trace, trace]).splitlines()
    assert several[0].endswith(",record")
    assert several[-1].endswith(",1")


def test_tables_without_motion_hold_their_header_alone() -> None:
    fit = made_fit()
    assert states_table(["a", "b"], []) == "frame,time,a,b,a_vel,b_vel,a_std,b_std\n"
    assert prediction_table(["a"], None) == "frame,time,a,a_std\n"
    assert torque_table(["joint1"], trace_of(fit, record(fit))) == "frame,time,joint1,joint1_std\n"


def test_whatever_a_document_holds_becomes_json() -> None:
    assert jsonable({1: (np.float64(0.5), np.nan), "path": Path("a"), "array": np.arange(2)}) == {
        "1": [0.5, None],
        "path": "a",
        "array": [0, 1],
    }
    assert jsonable(ValueError) == "<class 'ValueError'>"
    assert json.loads(json_text({"µ": float("inf")})) == {"µ": None}
