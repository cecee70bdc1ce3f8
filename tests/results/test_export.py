"""Tables and JSON: numbers that read back as they were."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fits import made_fit, record
from monodyn.results.curves import camera_curves
from monodyn.results.export import (
    camera_table,
    json_text,
    jsonable,
    prediction_table,
    states_table,
    torque_table,
)
from monodyn.results.predict import predict
from monodyn.results.torques import Torques
from monodyn.results.trace import trace_of
from monodyn.vision.clip.steady import CameraPath
from monodyn.vision.clip.video import read
from support import ClipMaker


def test_tables_round_trip_and_count_frames() -> None:
    fit = made_fit()
    future = predict(fit, until=1.2)
    trace = trace_of(fit, record(fit), future)
    lines = states_table(["joint1"], [trace]).splitlines()
    assert lines[0] == "frame,time,joint1,joint1_vel,joint1_std,joint1_vel_std"
    assert float(lines[4].split(",")[2]) == trace.states.position[3, 0]
    assert float(lines[4].split(",")[5]) == trace.states.velocity_std[3, 0]
    lines = prediction_table(["joint1"], [trace]).splitlines()
    assert lines[0] == "frame,time,joint1,joint1_std"
    assert [line.split(",")[0] for line in lines[1:4]] == ["20", "21", "22"]
    assert len(lines) == 1 + len(future.time)
    course = Torques(
        np.array([0.0, 0.01, 1 / 30]), np.array([[0.1], [0.2], [np.nan]]), np.full((3, 1), np.inf)
    )
    twice = [trace, replace(trace, future=None)]
    tables = states_table(["joint1"], twice), torque_table(["joint1"], twice, [course, course])
    for table in (*tables, prediction_table(["joint1"], [twice[1], twice[0]])):
        assert table.splitlines()[0].endswith(",record")
        assert table.splitlines()[-1].endswith(",1")
    # a row between two frames has no number, and nothing stands where nothing is known
    assert tables[1].splitlines()[1:4] == ["0,0.0,0.1,,0", ",0.01,0.2,,0", f"1,{1 / 30!r},,,0"]


def test_columns_are_quoted_and_read_back_by_any_reader() -> None:
    fit = made_fit()
    trace = trace_of(fit, record(fit), predict(fit, until=1.2))
    name = 'left, "first"'
    for text in (states_table([name], [trace]), prediction_table([name], [trace])):
        rows = list(csv.DictReader(text.splitlines()))
        assert name in rows[0]
        assert f"{name}_std" in rows[0]
        assert None not in rows[0]


def test_tables_without_motion_hold_their_header_alone() -> None:
    fit = made_fit()
    assert states_table(["a", "b"], []) == "frame,time,a,b,a_vel,b_vel,a_std,b_std,a_vel_std,b_vel_std\n"
    assert prediction_table(["a"], []) == "frame,time,a,a_std\n"
    assert prediction_table(["joint1"], [trace_of(fit, record(fit))]) == "frame,time,joint1,joint1_std\n"


def test_the_way_of_the_camera_reads_back(make_clip: ClipMaker) -> None:
    video = read(make_clip(count=3))
    header = "frame,time,registered,x_px,y_px,turn,zoom,std_px,stretch,shear,lean_x,lean_y\n"
    assert camera_table(video.times, None) == header
    c, s = 1.1 * np.cos(0.02), 1.1 * np.sin(0.02)
    at = np.array([[c, -s, 2.5], [s, c, -1.25], [0.0, 0.0, 1.0]])
    maps = np.array([np.eye(3), at, np.full((3, 3), np.nan)])
    frame = next(iter(video.frames()))
    moving = replace(video, camera_path=CameraPath(maps, np.array([0.0, 0.05, np.nan]), frame))
    rows = [line.split(",") for line in camera_table(moving.times, moving.camera_path).splitlines()[1:]]
    assert rows[0] == ["0", "0.0", "1", "0.0", "0.0", "-0.0", "1.0", "0.0", *["0.0"] * 4]
    assert [float(value) for value in rows[1]] == pytest.approx(
        [1, 1 / 30, 1, 2.5, -1.25, -0.02, 1.1, 0.05, 0, 0, 0, 0]
    )
    assert rows[2][2:] == ["0", *[""] * 9]
    plots = camera_curves(moving.times, moving.camera_path)
    assert [(plot["title"], plot["unit"]) for plot in plots] == [
        ("still scene, to the right", "px"),
        ("still scene, down", "px"),
        ("turn of the still scene", "deg"),
        ("zoom", "%"),
    ]
    assert plots[0]["fitted"]["value"] == [0.0, 2.5, None]
    assert plots[3]["fitted"]["value"] == [100.0, 110.0, None]
    assert camera_curves(video.times, None) == []


def test_the_columns_of_the_camera_are_its_map(make_clip: ClipMaker) -> None:
    """The documented formula against the map, with turn, zoom, perspective and what goes with it."""
    video = read(make_clip(count=2))
    at = np.array([[1.08, 0.05, 2.5], [-0.11, 0.97, -1.25], [2e-3, -1.5e-3, 1.0]])
    path = CameraPath(np.array([np.eye(3), at]), np.array([0.0, 0.05]), next(iter(video.frames())))
    lines = camera_table(video.times, path).splitlines()
    row = dict(zip(lines[0].split(","), map(float, lines[2].split(",")), strict=True))
    centre = 0.5 * (np.array([video.width, video.height]) - 1.0)
    d = np.random.default_rng(1).uniform(-30.0, 30.0, (9, 2))
    cos, sin = np.cos(row["turn"]), np.sin(row["turn"])
    turned = row["zoom"] * d @ np.array([[cos, sin], [-sin, cos]]).T
    bent = d @ np.array([[row["stretch"], row["shear"]], [row["shear"], -row["stretch"]]])
    below = 1.0 + row["lean_x"] * d[:, 0] + row["lean_y"] * d[:, 1]
    shown = centre + (turned + bent + [row["x_px"], row["y_px"]]) / below[:, None]
    place = path.at(1)
    assert place is not None
    assert shown == pytest.approx(place.of(centre + d), abs=1e-9)


def test_whatever_a_document_holds_becomes_json() -> None:
    assert jsonable({1: (np.float64(0.5), np.nan), "path": Path("a"), "array": np.arange(2)}) == {
        "1": [0.5, None],
        "path": "a",
        "array": [0, 1],
    }
    assert jsonable(ValueError) == "<class 'ValueError'>"
    assert json.loads(json_text({"µ": float("inf")})) == {"µ": None}
