"""The stages: methods by name, and what is refused before a method is called."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monodyn import stages
from monodyn.errors import SettingsError, VideoError
from monodyn.mechanism import load
from monodyn.settings import settings_classes
from monodyn.stages import check_camera, identify, locate, track
from monodyn.types import Camera
from monodyn.vision.locating.scene import Scene
from monodyn.vision.settings import METHOD_NAMES, CameraSettings, LocateSettings
from support import refuses
from swings import TIMES, motion, record

CAMERA = "'camera.x', 'camera.y', 'camera.depth', 'camera.roll', 'camera.pitch', 'camera.yaw', 'camera.focal'"


@pytest.mark.parametrize(
    ("method", "fix", "free", "message"),
    [
        ("fast", {"camera.zoom": 1.0}, [],
         f"parameter 'camera.zoom': expected one of the camera's; parameters: {CAMERA}."),
        ("fast", {}, ["link1.length"],
         f"parameter 'link1.length': expected one of the camera's; parameters: {CAMERA}."),
        ("fast", {"camera.x": 0.0}, ["camera.x"],
         "parameter 'camera.x': is both fixed and freed; choose one of them."),
        ("fast", {"camera.focal": np.nan}, [],
         "parameter 'camera.focal': expected a finite number, got nan; give it in px."),
        ("fast", {"camera.depth": 0.0}, [],
         "parameter 'camera.depth': expected a value above 0 m, got 0; correct it."),
        ("fast", {"camera.focal": 1e-300}, [],
         "parameter 'camera.focal': expected 10 to 1e+06 px, got 1e-300; correct it."),
        ("fast", {"camera.x": 1e300}, [],
         "parameter 'camera.x': expected a place within 1e+06 m of the mechanism, got 1e+300; correct it."),
        ("fast", {"camera.depth": 1e-300}, [],
         "parameter 'camera.depth': expected a place within 1e+06 m of the mechanism, got 1e-300; "
         "correct it."),
        ("fast", {"camera.roll": 90.0}, [],
         "parameter 'camera.roll': expected an angle within a turn, got 90 rad; give it in radians."),
        ("fast", {"camera.yaw": -2.0}, [],
         "parameter 'camera.yaw': expected less than a quarter turn, got -2 rad; the camera looks at the "
         "plane, give the angle in radians."),
        ("paper", {}, ["camera.depth", "camera.focal"],
         "parameter 'camera.focal': camera.method paper estimates camera.x, camera.y, camera.depth alone; "
         "leave it out of --free, give the value with --fix, or use camera.method fast."),
    ],
)  # fmt: skip
def test_camera_parameters_that_are_refused(
    method: str, fix: dict[str, float], free: list[str], message: str
) -> None:
    with refuses(SettingsError, message):
        check_camera(load("double"), method, fix, free)


def test_camera_parameters_that_are_taken() -> None:
    check_camera(load("cartpole"), "fast", {"camera.depth": 1.0}, ["camera.roll", "camera.focal"])
    check_camera(load("double"), "paper", {"camera.yaw": 0.1}, ["camera.depth", "camera.roll"])


def test_another_clip_has_another_scene() -> None:
    video = SimpleNamespace(path="other.mp4", width=64, height=48)
    scene: Any = SimpleNamespace(camera=Camera(128, 96, 100.0))
    masks: Any = SimpleNamespace(video=video)
    said = (
        "other.mp4: expected pictures of 128x96 like the scene, got 64x48; locate the mechanism in this clip."
    )
    with refuses(VideoError, said):
        track(masks, scene)


def test_another_clip_of_a_camera_that_moves_has_other_places() -> None:
    video = SimpleNamespace(path="other.mp4", width=128, height=96, camera_path=None)
    moving = SimpleNamespace(video=SimpleNamespace(camera_path=object()))
    scene: Any = SimpleNamespace(camera=Camera(128, 96, 100.0), masks=moving)
    masks: Any = SimpleNamespace(video=video)
    said = (
        "other.mp4: expected the clip in which the scene was located, or one of a camera that stands still "
        "in both, got another one with a camera that moves; locate the mechanism in this clip."
    )
    with refuses(VideoError, said):
        track(masks, scene)


@pytest.mark.parametrize("camera", ["fast", "paper"])
@pytest.mark.parametrize("pose", ["fast", "paper"])
def test_a_method_is_found_by_its_name(camera: Any, pose: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    called, none = [], np.zeros(2)
    masks: Any = object()
    scene = Scene(load("double"), Camera(9, 9, 9.0), masks, 0, none, (), none, {}, 0.0, ())
    table = {
        names: lambda sought, names=names: called.append((names, sought)) or scene
        for names in stages.LOCATE_METHODS
    }
    monkeypatch.setattr(stages, "LOCATE_METHODS", table)
    locate(masks, load("double"), LocateSettings(method=pose), camera=CameraSettings(method=camera))
    ((names, sought),) = called
    assert names == (camera, pose)
    assert (sought.masks, sought.settings.method, sought.fix, sought.free) == (masks, pose, {}, ())


def test_every_method_that_settings_can_name_is_there() -> None:
    from typing import get_args, get_type_hints

    tables = {
        "segment": stages.SEGMENT_METHODS,
        "track": stages.TRACK_METHODS,
        "identify": stages.IDENTIFY_METHODS,
    }
    for stage, kind in settings_classes().items():
        literal = get_args(get_type_hints(kind)["method"])[0]
        names = {pair[stage == "locate"] for pair in stages.LOCATE_METHODS}
        assert set(get_args(literal)) == set(tables.get(stage, names))
    assert set(stages.LOCATE_METHODS) == {(c, p) for c in METHOD_NAMES for p in METHOD_NAMES}


def test_one_record_and_a_list_of_one_are_the_same() -> None:
    mechanism = load("single")
    poses = record(mechanism, TIMES, motion(mechanism, TIMES, [0.5], [0.0]))
    alone, listed = identify(poses, mechanism), identify([poses], mechanism)
    assert alone.parameters == listed.parameters
    assert alone.seconds > 0.0
