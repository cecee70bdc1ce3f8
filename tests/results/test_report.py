"""The files that follow from a fit."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import monodyn
from fits import identified, made_fit, record
from monodyn import reported
from monodyn.errors import SettingsError
from monodyn.estimation.record.tables import read_poses
from monodyn.mechanism import load, write_mjcf
from monodyn.mechanism.simulate import simulate
from monodyn.results import findings, gaps, report
from monodyn.results.fill import fill
from monodyn.results.findings import Findings
from monodyn.results.folder import RunFolder
from monodyn.results.predict import predict
from monodyn.results.report import lost_in_urdf, write_results
from monodyn.results.trace import trace_of
from monodyn.settings import RunSettings
from monodyn.types import Poses
from monodyn.vision.locating.scene import Scene
from support import refuses


def test_report_writes_from_the_fit_alone(tmp_path: Path) -> None:
    fit = made_fit()
    page = monodyn.report(fit, predict(fit, until=1.0), to=tmp_path / "run")
    assert page == tmp_path / "run" / "report.html"
    names = {"fit.json", "model.xml", "model.urdf", "states.csv", "prediction.csv", "report.html", "run.json"}
    assert {path.name for path in page.parent.iterdir()} == names
    said = (
        f"out '{tmp_path / 'run'}': expected a folder without a run, it holds states.csv; "
        "give another folder, or --force to replace the run."
    )
    with refuses(SettingsError, said):
        monodyn.report(fit, to=tmp_path / "run")


@pytest.mark.parametrize("part", ["_write_documents", "_write_diagnosis", "next_steps", "template"])
def test_an_error_in_any_part_is_that_of_the_whole(
    part: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever thread makes it."""

    def broken(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(report, part, broken)
    for number in range(3):
        with pytest.raises(ZeroDivisionError):
            monodyn.report(made_fit(), to=tmp_path / str(number))


def test_what_urdf_cannot_hold_is_said(tmp_path: Path) -> None:
    said = (
        "URDF has no place for joint1.stiffness, joint1.armature, which model.urdf leaves out; "
        "simulate model.xml instead."
    )
    fit = made_fit()
    assert lost_in_urdf(fit.mechanism) == []
    sprung = fit.mechanism.with_values({"joint1.stiffness": 0.1, "joint1.armature": 1e-4})
    monodyn.report(replace(fit, mechanism=sprung), to=tmp_path / "sprung")
    assert json.loads((tmp_path / "sprung" / "fit.json").read_text())["advice"][-1] == said
    assert said in (tmp_path / "sprung" / "report.html").read_text(encoding="utf-8")


def test_what_does_not_act_in_mujoco_either_is_said(tmp_path: Path) -> None:
    """``model.xml`` has the air's drag as a number: MuJoCo moves as if there were none."""
    double = load("double")
    aired = double.with_values({"joint1.drag": 1e-3, "joint2.air": 1e-2})
    assert lost_in_urdf(aired) == [
        "URDF has no place for joint1.drag, joint2.air, which model.urdf leaves out; nor does joint2.air act "
        "in MuJoCo, where model.xml has it as a number alone: monodyn predict has the motion with all of "
        "them."
    ]
    moved = []
    for air in (0.0, 1e-2):
        write_mjcf(double.with_values({"joint2.air": air}), tmp_path / "model.xml")
        body = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
        data = mujoco.MjData(body)
        mujoco.mj_step(body, data, 500)
        moved.append(data.qpos.copy())
    np.testing.assert_array_equal(*moved)


@pytest.mark.slow
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


@pytest.mark.slow
def test_an_ensemble_moves_as_the_record_and_stands_in_the_folder(tmp_path):
    """Each drawn model is another one, and follows the record as closely as its noise allows."""
    fit = identified()
    folder = RunFolder(tmp_path / "run")
    write_results(folder, Findings(fit, [trace_of(fit, record(fit))], drawn=5))
    folder.finish()
    names = sorted(path.name for path in (tmp_path / "run").glob("ensemble_*.xml"))
    assert names == [f"ensemble_{k:02d}.xml" for k in range(5)]
    models = [monodyn.load(tmp_path / "run" / name) for name in names]
    lengths = [one.values["link1.length"] for one in models]
    std = fit.parameter("link1.length").std
    assert 0.0 < np.std(lengths) < 4.0 * std
    start = fit.starts[0]
    for one in models:
        moved = simulate(one, fit.time[0], start.position, start.velocity).position
        assert np.abs(moved - fill(fit, fit.time[0]).position).max() < 0.02


def test_an_ensemble_that_cannot_be_drawn_is_said():
    fit = identified()
    unknown = replace(fit, covariance=np.full_like(fit.covariance, np.nan))
    assert Findings(unknown, drawn=3).advice[-1] == (
        "0 of 3 models of the ensemble were drawn: the fit does not say well enough what the mechanism "
        "may be, or nearly all that it allows lies beyond the bounds of the parameters."
    )
    with refuses(SettingsError, "ensemble: expected 0 to 100 models, got 101; give a number in between."):
        RunSettings(ensemble=101)


@pytest.mark.slow
def test_a_motion_and_its_horizon_are_worked_out_once(
    filmed: tuple[Scene, Poses], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """For tables, page and film alike, although notes come in between."""
    scene, poses = filmed
    # whatever speaks against it: of a refused fit nothing is drawn
    fit = replace(monodyn.identify(poses, scene.mechanism), doubts=())
    monkeypatch.setattr(reported, "redrawn", lambda fit, *_: fit)
    done = []
    for module, name in ((findings, "filled"), (gaps, "filled"), (findings, "horizon_of")):
        usual = getattr(module, name)
        monkeypatch.setattr(
            module, name, lambda *a, _usual=usual, _name=name, **k: (done.append(_name), _usual(*a, **k))[1]
        )
    monodyn.report(fit, to=tmp_path / "run", poses=poses, scene=scene)
    assert (tmp_path / "run" / "overlay.mp4").exists()
    assert sorted(done) == ["filled", "horizon_of"]
