"""What the files of the mechanism state beside it: start, camera, and what is known of their numbers."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import monodyn
from fits import made_fit
from monodyn.estimation.fit import Estimate, Fit
from monodyn.estimation.parts import Combination
from monodyn.mechanism import load, write_mjcf
from monodyn.results.fill import fill
from monodyn.results.filmed import filmed_of
from monodyn.results.findings import Findings
from monodyn.results.folder import RunFolder
from monodyn.results.models import eye_of, keyframes, what_is_known, write_models
from monodyn.types import Camera, Poses
from monodyn.vision.clip.steady import CameraPath
from monodyn.vision.drawing.camera import pixels
from monodyn.vision.locating.scene import Scene


def _remarks(path: Path) -> str:
    return " ".join(path.read_text(encoding="utf-8").split())


def _written(folder: Path, fit: Fit, **further: object) -> Path:
    write_models(RunFolder(folder), Findings(fit, **further))  # type: ignore[arg-type]
    return folder / "unfinished" / "model.xml" if (folder / "unfinished").exists() else folder / "model.xml"


@pytest.mark.slow
def test_mujoco_begins_where_the_fit_does_and_follows_it(fit: Fit, tmp_path: Path) -> None:
    monodyn.report(fit, to=tmp_path / "run")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "run" / "model.xml"))
    model.opt.timestep = 1.0 / 30.0 / 100.0
    data, start = mujoco.MjData(model), fit.starts[0]
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    assert (data.time, data.qpos.tolist()) == (start.time, start.position.tolist())
    assert data.qvel.tolist() == start.velocity.tolist()
    times, theirs = start.time + np.arange(40) / 30.0, []
    for _ in times:
        theirs.append(data.qpos.copy())
        mujoco.mj_step(model, data, 100)
    # 1e-4 deg
    assert np.abs(fill(fit, times).position - theirs).max() < 1.7e-6


def test_every_record_has_a_keyframe_on_the_clock_of_the_dynamics(fit: Fit) -> None:
    slow = replace(fit, mechanism=fit.mechanism.with_values({"time_scale": 0.5}), starts=fit.starts * 2)
    keys = keyframes(slow)
    assert [key.name for key in keys] == ["start0", "start1"]
    assert keys[0].time == 0.5 * fit.starts[0].time


def test_mujoco_sees_a_point_where_the_camera_does(filmed: tuple[Scene, Poses], tmp_path: Path) -> None:
    """By the frame that MuJoCo gives its camera and by the field of view, as its renderers take them."""
    scene, poses = filmed
    camera = Camera(640, 360, 700.0, x=0.13, y=-0.07, depth=1.7, roll=0.2, pitch=-0.15, yaw=0.1)
    seen = filmed_of(made_fit(mechanism=scene.mechanism), replace(scene, camera=camera), poses)
    seen = replace(seen, camera=camera)
    path = tmp_path / "m.xml"
    write_mjcf(scene.mechanism, path, camera=eye_of(seen))
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qpos[:] = [0.4, -0.9]
    mujoco.mj_forward(model, data)
    assert model.cam_resolution[0].tolist() == [640, 360]
    focal = 180.0 / np.tan(np.radians(model.cam_fovy[0]) / 2.0)
    points = data.xpos[1:]
    local = (points - data.cam_xpos[0]) @ data.cam_xmat[0].reshape(3, 3)
    # MuJoCo's camera looks along its -z; the middle of the picture is between two pixels
    theirs = np.array([319.5, 179.5]) + focal * local[:, :2] * [1.0, -1.0] / -local[:, 2:]
    plane = np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)
    np.testing.assert_allclose(theirs, pixels(camera, plane), atol=1e-6)
    # keyframes, camera and drive are for MuJoCo: what is read is the mechanism, and is written as such
    write_mjcf(scene.mechanism, tmp_path / "alone.xml")
    write_mjcf(load(path), tmp_path / "again.xml")
    assert (tmp_path / "again.xml").read_bytes() == (tmp_path / "alone.xml").read_bytes()


def test_a_filmed_mechanism_has_its_camera(filmed: tuple[Scene, Poses], tmp_path: Path) -> None:
    scene, poses = filmed
    seen = filmed_of(made_fit(mechanism=scene.mechanism), scene, poses)
    still = _written(tmp_path / "still", made_fit(mechanism=scene.mechanism), filmed=seen)
    model = mujoco.MjModel.from_xml_path(str(still))
    place = [seen.camera.x, -seen.camera.depth, seen.camera.y]
    assert model.cam("clip").pos == pytest.approx(place, rel=1e-12)
    said = "The camera moved: it stands in its mean place here, and camera.csv has its way."
    assert said not in _remarks(still)
    way = CameraPath(np.tile(np.eye(3), (40, 1, 1)), np.zeros(40), next(iter(seen.video.frames())))
    moved = replace(seen, video=replace(seen.video, camera_path=way))
    moving = _written(tmp_path / "moving", made_fit(mechanism=scene.mechanism), filmed=moved)
    assert said in _remarks(moving)


@pytest.mark.slow
def test_the_files_say_what_is_up_to_a_factor(fit: Fit, tmp_path: Path) -> None:
    absolute = "masses, inertias, frictions, springs and torques"
    said = what_is_known(made_fit())
    assert said[:3] == [
        "Trusted: Identified from 20 frames.",
        f"Only ratios show: {absolute} are known up to one common factor, that of the file that the run "
        "began with. A known torque or one measured mass makes them absolute.",
        "Lengths rest on gravity, which was taken as 9.81 m/s^2.",
    ]
    # its ratio to an inertia is known
    assert said[3:] == ["Known up to that factor: joint1.damping."]
    assert what_is_known(made_fit(combinations=()))[3:] == ["Not determined by the motion: joint1.damping."]
    row, clock = made_fit().parameters[0], Combination("link1.length / time_scale^2", 0.2, 1e-3, 0.1, 0.3)
    open_length = replace(row, std=math.inf, identifiable=False)
    assert what_is_known(made_fit(parameters=(open_length,), combinations=(clock,)))[3:] == [
        "Known in combinations with one another alone, which fit.json has: link1.length."
    ]
    # with the scale, nothing that has one is open
    rows = tuple(replace(p, std=0.01 * abs(p.value)) if math.isinf(p.std) else p for p in fit.parameters)
    rows += (Estimate("link1.mass", 0.1, 1e-3, 0.098, 0.102, "kg", False, True, False),)
    weighed = fit.mechanism.with_choices(fix={"link1.thickness": 0.004}, free=["gravity"])
    said = what_is_known(replace(fit, mechanism=weighed, parameters=rows))
    assert f"{absolute.capitalize()} are in SI units, as exactly as link1.thickness was given." in said
    assert not [sentence for sentence in said if "gravity" in sentence]
    # a capsule's volume is in the picture: its mass is known with nothing given but what the file says
    said = what_is_known(replace(fit, parameters=rows))
    assert (
        f"{absolute.capitalize()} are in SI units, as exactly as the mechanism file states densities." in said
    )
    run = tmp_path / "run"
    monodyn.report(fit, to=run)
    for name in ("model.xml", "model.urdf"):
        assert all(sentence in _remarks(run / name) for sentence in what_is_known(fit))


def test_known_torques_and_another_clock_are_said(fit: Fit, tmp_path: Path) -> None:
    mechanism = fit.mechanism.with_values({"time_scale": 0.5})
    said = _remarks(_written(tmp_path / "slow", replace(fit, mechanism=mechanism)))
    assert (
        "Keyframes are the states at the first fitted frame of each record, their time that of the tables: "
        "mujoco.mj_resetDataKeyframe(model, data, 0) begins there." in said
    )
    assert "data.time is the time of the tables times 0.5, the time scale." in said
    known = _remarks(_written(tmp_path / "known", replace(fit, torque="known")))
    assert "torques.csv has the known torques: data.ctrl by joint, linear between the rows." in known
    assert "time scale" not in known


def test_known_torques_make_the_numbers_absolute() -> None:
    rows = (*made_fit().parameters, Estimate("link1.mass", 0.1, 1e-3, 0.098, 0.102, "kg", False, True, False))
    heavy = made_fit(parameters=rows, torque="known")
    said = "Known torques determine masses, inertias, frictions, springs and torques: they are in SI units."
    assert said in what_is_known(heavy)


def test_a_run_without_a_fit_writes_a_mechanism_without_a_start(tmp_path: Path) -> None:
    path = _written(tmp_path / "none", made_fit(starts=(), status="Too few frames."))
    assert "keyframe" not in path.read_text().lower()
