"""The report page: what it says first, that it needs no network, and that foreign text stays text."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import monodyn
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Combination, Estimate, Fit
from monodyn.estimation.record.tables import read_poses
from monodyn.mechanism import load
from monodyn.mechanism.simulate import simulate
from monodyn.results.export import Trace, fit_document, json_text, prediction_table, rms_of, states_table
from monodyn.results.fill import States, fill
from monodyn.results.page import Page, number, page_text, short
from monodyn.results.predict import predict
from monodyn.results.report import counted, frame_numbers, metric, trace_of
from monodyn.types import Poses
from support import Done

TIME = np.arange(20) / 30.0


@lru_cache
def identified() -> Fit:
    """Identify the bundled single pendulum from 20 simulated frames, one of them not seen."""
    mechanism = load("single")
    rng = np.random.default_rng(5)
    position = simulate(mechanism, TIME, np.array([-1.0]), np.array([0.5])).position
    position = position + 1e-3 * rng.standard_normal((20, 1))
    seen = np.ones(20, bool)
    seen[7] = False
    position[7] = np.nan
    covariance = np.full((20, 1, 1), 1e-6)
    return monodyn.identify(Poses(("joint1",), np.arange(20), TIME, position, covariance, seen), mechanism)


def made_fit(**changes: Any) -> Fit:
    """Return that fit with some of what it says replaced."""
    said = {
        "status": "Identified from 20 frames.",
        "ok": True,
        "advice": ("Measure <b>one</b> mass & be done.",),
        "parameters": (
            Estimate("link1.length", 0.2, 1e-3, 0.198, 0.202, "m", True, True, False),
            Estimate("joint1.damping", 1e-3, math.inf, 0.0, math.inf, "N m s/rad", True, False, False),
            Estimate("gravity", 9.81, 0.0, 9.81, 9.81, "m/s^2", False, True, False),
        ),
        "combinations": (Combination("joint1.damping / link1.J", 0.123456, 0.00123),),
    }
    return replace(identified(), **{**said, **changes})


def record(fit: Fit, count: int = 30) -> Poses:
    """Return a record that is 1 mrad above the fitted motion."""
    time = np.arange(count) / 30.0
    position = fill(fit, time).position + 1e-3
    seen = np.ones(count, bool)
    seen[7] = False
    return Poses(("joint1",), np.arange(count), time, position, np.zeros((count, 1, 1)), seen)


def test_page_says_status_and_advice_first_and_escapes() -> None:
    fit = made_fit()
    trace = trace_of(fit, record(fit), predict(fit, until=1.2), name="<i>clip</i>")
    text = page_text(fit, [trace], Page("<script>alert(1)</script>", notes=("A & B",)))
    assert text.index("Identified from 20 frames.") < text.index("Parameters")
    assert "Measure &lt;b&gt;one&lt;/b&gt; mass &amp; be done." in text
    assert "<script>alert(1)" not in text
    assert "A &amp; B" in text
    assert "not determined by this motion" in text
    assert "<code>joint1.damping / link1.J</code></td><td>0.1235</td>" in text


def test_page_needs_no_network() -> None:
    fit = made_fit()
    text = page_text(fit, [trace_of(fit, record(fit))], Page("x"))
    assert not re.search(r"<(?:script|link|img|iframe)[^>]*(?:src|href)=[\"']?(?:https?:)?//", text)
    assert text.count("<script>") == text.count("</script>") == 2


def test_plots_hold_the_curves() -> None:
    fit = made_fit()
    poses = record(fit)
    text = page_text(fit, [trace_of(fit, poses, predict(fit, times=poses.time[20:]))], Page("x"))
    (plot,) = json.loads(re.search(r"const PLOTS = (\[.*\]);\n", text)[1])  # type: ignore[index]
    assert plot["unit"] == "deg"
    assert len(plot["observed"]) == 30
    assert plot["observed"][7] is None
    assert plot["window"] == [0.0, pytest.approx(19 / 30)]
    assert len(plot["predicted"]["time"]) == 10
    assert plot["predicted"]["error"] == pytest.approx([-0.0573] * 10, abs=1e-3)  # 1 mrad, six digits kept
    assert plot["predicted"]["upper"][3] > plot["predicted"]["value"][3]


def test_page_of_a_fit_that_failed() -> None:
    fit = made_fit(ok=False, status="Too few frames.", starts=())
    text = page_text(fit, [], Page("x"))
    assert 'class="status bad"' in text
    assert "Plotly" not in text


def test_numbers_keep_the_digits_that_their_deviation_leaves() -> None:
    assert number(0.2345678, 0.0012) == "0.2346"
    assert number(-123.456, 10.0) == "−123"
    assert number(0.2345678) == "0.23457"
    assert number(math.inf) == "∞"
    assert number(None) == "unknown"
    assert short(0.0012345) == "0.0012"


def test_json_has_no_infinity() -> None:
    document = json.loads(json_text(fit_document(made_fit())))
    damping = document["parameters"][1]
    assert (damping["std"], damping["upper"], damping["lower"]) == (None, None, 0.0)
    start = identified().starts[0]
    assert document["initial_state"]["velocity"] == {"joint1": start.velocity[0]}
    assert document["initial_state"]["velocity_std"] == {
        "joint1": pytest.approx(start.covariance[1, 1] ** 0.5)
    }
    assert document["heldout_rms"] == {"joint1": None}


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


def test_heldout_counts_seen_and_predicted_rows_alone() -> None:
    fit = made_fit()
    poses = record(fit)
    trace = trace_of(fit, poses, predict(fit, times=poses.time[20:25]))
    assert trace.heldout() == {"joint1": pytest.approx(1e-3, rel=1e-3)}  # the record is 1 mrad off
    assert trace_of(fit, poses).heldout() == {"joint1": None}
    assert rms_of(["a", "b"], np.array([[3.0, np.nan], [4.0, np.nan]])) == {"a": math.sqrt(12.5), "b": None}


def test_frame_numbers_go_on_beyond_the_record() -> None:
    known, numbers = np.array([0.0, 0.1, 0.2, 0.4]), np.array([0, 1, 2, 4])
    assert frame_numbers(np.array([0.2, 0.4, 0.5, 0.6]), known, numbers).tolist() == [2, 4, 5, 6]


def test_slides_become_metric() -> None:
    mechanism = load("cartpole")
    joints = tuple(joint.name for joint in mechanism.joints)
    poses = Poses(
        joints,
        np.arange(2),
        np.arange(2.0),
        np.ones((2, 2)),
        np.ones((2, 2, 2)),
        np.ones(2, bool),
        metric=False,
    )
    found = metric(poses, mechanism, 0.5)
    slide = [joint.kind for joint in mechanism.joints].index("slide")
    assert found.metric
    assert found.position[0, slide] == 0.5
    assert found.position[0, 1 - slide] == 1.0
    assert found.covariance[0, slide, slide] == 0.25
    assert metric(found, mechanism, 0.5) is found


def test_report_writes_from_the_fit_alone(tmp_path: Path) -> None:
    fit = made_fit()
    page = monodyn.report(fit, predict(fit, until=1.0), to=tmp_path / "run")
    assert page == tmp_path / "run" / "report.html"
    names = {"fit.json", "model.xml", "model.urdf", "states.csv", "prediction.csv", "report.html"}
    assert {path.name for path in page.parent.iterdir()} == names
    with pytest.raises(SettingsError) as error:
        monodyn.report(fit, to=tmp_path / "run")
    assert str(error.value) == (
        f"out '{tmp_path / 'run'}': expected a folder without a run, it holds states.csv; "
        "give another folder, or --force to replace the run."
    )


def test_what_urdf_cannot_hold_is_said(tmp_path: Path) -> None:
    said = "URDF has no place for joint1.stiffness, joint1.armature: "
    fit = made_fit()
    monodyn.report(fit, to=tmp_path / "plain")
    assert "URDF has no place" not in (tmp_path / "plain" / "fit.json").read_text()
    sprung = fit.mechanism.with_values({"joint1.stiffness": 0.1, "joint1.armature": 1e-4})
    monodyn.report(replace(fit, mechanism=sprung), to=tmp_path / "sprung")
    advice = json.loads((tmp_path / "sprung" / "fit.json").read_text())["advice"]
    assert [sentence for sentence in advice if sentence.startswith(said)]
    assert said in (tmp_path / "sprung" / "report.html").read_text(encoding="utf-8")


def test_report_keeps_frame_numbers_and_poses(tmp_path: Path) -> None:
    mechanism = load("single")
    rng = np.random.default_rng(5)
    frame = np.arange(50, 150)
    time = frame / 30.0
    position = simulate(mechanism, time, np.array([-1.0]), np.array([0.5])).position
    position = position + 1e-3 * rng.standard_normal((100, 1))
    covariance = np.full((100, 1, 1), 1e-6)
    poses = Poses(("joint1",), frame, time, position, covariance, np.ones(100, bool))
    fit = monodyn.identify(poses, mechanism)
    for name, given in (("alone", None), ("poses", poses)):
        monodyn.report(fit, predict(fit, until=5.5), to=tmp_path / name, poses=given)
        assert json.loads((tmp_path / name / "fit.json").read_text())["fit_frames"] == [50, 150]
        rows = (tmp_path / name / "prediction.csv").read_text().splitlines()
        assert rows[1].startswith("150,")
    assert not (tmp_path / "alone" / "poses.csv").exists()
    again = read_poses(tmp_path / "poses" / "poses.csv", mechanism)
    assert again.frame.tolist() == frame.tolist()
    # as many digits as poses.csv is written with
    assert np.allclose(again.position, position, rtol=0.0, atol=1e-6)


def test_frames_without_numbers_are_counted_where_the_stamps_tell() -> None:
    assert counted(np.arange(50, 60) / 30.0).tolist() == list(range(50, 60))
    assert counted(np.round(np.arange(50, 60) / 30.0, 3)).tolist() == list(range(50, 60))
    assert counted(np.arange(10) * 0.1 + 0.05).tolist() == list(range(10))
    assert counted(np.array([1.0, 1.1, 1.3])).tolist() == [0, 1, 2]


def test_report_of_the_demo_shows_pictures_and_camera(demo: Done) -> None:
    text = (demo.folder / "report.html").read_text(encoding="utf-8")
    assert text.count("data:image/jpeg;base64,") == 3
    assert "Camera" in text
    assert "210 of 210" in text


def test_states_and_trace_must_belong_together() -> None:
    fit = made_fit()
    poses = record(fit).part(5, 30)
    with pytest.raises(monodyn.VideoError) as error:
        trace_of(fit, poses)
    assert str(error.value) == (
        "poses: expected the record that was fitted, got other time stamps; pass the same record."
    )
    assert isinstance(trace_of(fit, record(fit)), Trace)
    assert isinstance(fill(fit, TIME), States)
