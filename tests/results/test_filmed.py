"""The clip that a fit comes from: its camera and poses in metres of the identified scale."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from fits import made_fit
from monodyn.estimation.fit import Estimate
from monodyn.mechanism import load
from monodyn.mechanism.upright import ROLL, with_roll
from monodyn.results.filmed import Filmed, filmed_of
from monodyn.results.findings import Findings, fit_document
from monodyn.results.page import page_text
from monodyn.types import Camera, Poses
from monodyn.vision.drawing.outline import outline
from monodyn.vision.drawing.shutter import Shutter

POSES = Poses(
    ("slider", "hinge"),
    np.arange(2),
    np.arange(2.0),
    np.ones((2, 2)),
    np.ones((2, 2, 2)),
    np.ones(2, bool),
    metric=False,
)


def scene(**changes: Any) -> Any:
    camera = Camera(64, 48, 100.0, x=1.0, y=2.0, depth=3.0, roll=0.5)
    spread = {"camera.depth": 0.1, "camera.roll": 0.2}
    masks = SimpleNamespace(video="the clip")
    found = {"camera": camera, "camera_std": spread, "masks": masks, "shutter": None} | changes
    return SimpleNamespace(**found, mechanism=load("cartpole"))


@pytest.mark.parametrize(("torque", "std"), [("friction", 0.2), ("free", np.inf)])
def test_lengths_grow_with_the_scale_and_angles_do_not(torque: str, std: float) -> None:
    fit = made_fit(mechanism=load("cartpole"), scale=2.0, torque=torque)
    filmed = filmed_of(fit, scene(), POSES)
    camera = filmed.camera
    assert (camera.x, camera.y, camera.depth, camera.roll, camera.focal) == (2.0, 4.0, 6.0, 0.5, 100.0)
    assert filmed.camera_std == {"camera.depth": std, "camera.roll": 0.2}
    assert filmed.tracked.position[0].tolist() == [2.0, 1.0]
    assert filmed.mechanism.values["link1.length"] == fit.mechanism.values["link1.length"]


def test_a_body_is_drawn_as_thick_as_it_was_located() -> None:
    """A fit may make a thickness metres, for a mass; before the camera at 3 m it would be drawn nowhere."""
    heavy = load("cartpole").with_values({"link1.thickness": 9.0})
    filmed = filmed_of(made_fit(mechanism=heavy, scale=2.0), scene(), POSES)
    located = load("cartpole").values["link1.thickness"]
    assert filmed.mechanism.values["link1.thickness"] == 2.0 * located
    assert len(outline(filmed.mechanism, filmed.camera, np.zeros(2))) == len(heavy.shapes.body)


def test_where_nothing_was_identified_the_located_mechanism_is_drawn() -> None:
    found = scene()
    assert filmed_of(made_fit(starts=()), found, POSES).mechanism is found.mechanism


def test_the_way_of_the_camera_is_that_of_the_scene_or_of_the_points() -> None:
    video: Any = SimpleNamespace(camera_path="by the scene", count=7)
    points = SimpleNamespace(camera_path=lambda count: f"by points, {count} frames")
    for sight, way in (
        (None, "by the scene"),
        (SimpleNamespace(points=None), "by the scene"),
        (SimpleNamespace(points=points), "by points, 7 frames"),
    ):
        filmed = Filmed(video, load("double"), Camera(64, 48, 100.0), POSES, sight=cast(Any, sight))
        assert filmed.camera_path == way


def test_the_exposure_is_told_with_the_camera() -> None:
    shutter = Shutter(0.02, 0.001, -0.01, *np.zeros((3, 2, 2)))
    still = SimpleNamespace(video=SimpleNamespace(camera_path=None, times=np.zeros(0)))
    found = scene(shutter=shutter, masks=still)
    filmed = filmed_of(made_fit(mechanism=load("cartpole"), starts=()), found, POSES)
    assert filmed.shutter is shutter
    assert filmed.camera_std["camera.exposure"] == 0.001
    fit = made_fit(mechanism=load("cartpole"), starts=())
    findings = Findings(fit, (), "clip", "", record=POSES, filmed=filmed)
    camera = fit_document(findings)["camera"]
    assert (camera["exposure"], camera["readout"], camera["std"]["camera.exposure"]) == (0.02, -0.01, 0.001)
    page = page_text(findings)
    assert "20 ± 1 ms" in page
    assert "-10 ms" in page
    sharp = replace(findings, filmed=replace(filmed, shutter=None))
    assert (fit_document(sharp)["camera"]["exposure"], fit_document(sharp)["camera"]["readout"]) == (0.0, 0.0)
    assert "readout" not in page_text(sharp)


def test_the_camera_stands_turned_before_the_upright_mechanism() -> None:
    """What is drawn stays where it was: the frame turns with the positions, the picture does not."""
    double, roll = load("double"), 0.2
    found = scene()
    found.mechanism, found.camera = double, Camera(64, 48, 100.0, x=0.1, y=-0.2, depth=3.0)
    estimate = Estimate(ROLL, roll, 0.01, 0.18, 0.22, "rad", True, True, False)
    fit = made_fit(mechanism=with_roll(double, roll, free=True), scale=1.0, parameters=(estimate,))
    poses = Poses(
        ("joint1", "joint2"), np.arange(1), np.zeros(1), np.array([[-1.0, 0.4]]), np.ones((1, 2, 2)),
        np.ones(1, bool), metric=False,
    )  # fmt: skip
    filmed = filmed_of(fit, found, poses)
    assert filmed.camera.roll == pytest.approx(roll)
    assert filmed.camera_std[ROLL] == 0.01
    np.testing.assert_allclose(filmed.tracked.position, [[-0.8, 0.4]])
    before = outline(double, found.camera, poses.position[0])
    after = outline(double, filmed.camera, filmed.tracked.position[0])
    for (body, one), (same, other) in zip(before, after, strict=True):
        assert body == same
        np.testing.assert_allclose(other, one, atol=1e-9)
