"""Camera, sizes and poses refined together on drawn masks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from monodyn.mechanism import Mechanism, load
from monodyn.types import Camera
from monodyn.vision.drawing.camera import PARAMETERS
from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.drawing.rig import SHOWN_KINDS, rig_of
from monodyn.vision.locating.bundle import KeyMasks, refine, shifted_rigs
from monodyn.vision.locating.knowledge import size_information
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.variables import SIDES, scene_variables
from pictures import CAMERA, drawn_mask, trusted


def test_refine_recovers_camera_and_size_ratios() -> None:
    start = load("double")
    true = start.with_values(
        {"link1.length": 0.23, "link1.width": 0.036, "link2.length": 0.16, "link2.width": 0.027}
    )
    camera = Camera(320, 240, 300.0, x=0.02, y=-0.03, depth=0.95)
    rng = np.random.default_rng(2)
    poses = np.column_stack([rng.uniform(-2.5, -0.5, 10), rng.uniform(-1.5, 1.5, 10)])
    masks = [drawn_mask(true, camera, q) for q in poses]
    names = [
        "link1.length",
        "link1.width",
        "link1.tail",
        "link1.tip",
        "link2.length",
        "link2.width",
        "link2.tail",
    ]
    near = Camera(320, 240, 300.0, x=0.03, y=-0.02, depth=0.9)
    guess = SceneGuess(start, near, poses + rng.normal(scale=0.05, size=poses.shape), np.zeros(10))
    variables = scene_variables(start, [*names, "camera.x", "camera.y", "camera.depth"])
    reaches = np.array([8.0, 7.0, 6.0, 5.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0])
    bundle = refine(KeyMasks(masks, trusted(true)), guess, variables, EdgeSearch(reaches, 2.0))
    found, wanted = bundle.mechanism.values, true.values
    scale = wanted["link1.length"] / found["link1.length"]
    # 0.05 px on links of 70 and 50 px, and on widths of 10 px
    assert found["link2.length"] * scale == pytest.approx(0.16, rel=2e-3)
    assert found["link1.width"] * scale == pytest.approx(0.036, rel=0.01)
    assert found["link2.width"] * scale == pytest.approx(0.027, rel=0.015)
    assert bundle.camera.x * scale == pytest.approx(0.02, abs=3e-4)
    assert bundle.camera.y * scale == pytest.approx(-0.03, abs=3e-4)
    measured = size_information(bundle, scale_free=True)
    assert measured.names == tuple(names)
    information = measured.information
    # what is left of the common scale; the links' ratio to 0.2 px on 70 and 50 px each
    assert np.abs(information @ np.ones(len(names))).max() < 1e-6 * np.trace(information)
    ratio = np.zeros(len(names))
    ratio[[0, 4]] = 1.0, -1.0
    assert np.sqrt(ratio @ np.linalg.pinv(information) @ ratio) == pytest.approx(5e-3, rel=0.3)


@pytest.mark.parametrize("shrink", [1.0, 3.0])
@pytest.mark.parametrize("about_origin", [False, True])
@pytest.mark.parametrize("model", ["double", "cartpole", "hammer"])
def test_shifted_mechanisms_are_those_of_a_slow_twin(
    tmp_path: Path, model: str, about_origin: bool, shrink: float
) -> None:
    """One mechanism and one camera made for each variable, where the other way makes all of them at once."""
    if model == "hammer":
        (tmp_path / "hammer.xml").write_text(
            '<mujoco><worldbody><body name="a"><joint name="j" axis="0 -1 0"/>'
            '<geom type="box" size=".12 .003 .015" pos=".12 0 0"/>'
            '<geom name="head" type="box" size=".02 .003 .05" pos=".24 0 .01" euler="0 20 0"/>'
            '<body name="b" pos=".24 0 .02"><joint name="k" axis="0 -1 0"/>'
            '<geom type="capsule" fromto="0 0 0 .1 0 .03" size=".01"/></body></body></worldbody></mujoco>'
        )
    mechanism = load(tmp_path / "hammer.xml" if model == "hammer" else model)
    kinds = (*SHOWN_KINDS, SIDES)
    own = [p.name for p in mechanism.parameters if p.kind in kinds and not p.follows]
    variables = replace(scene_variables(mechanism, [*own, *PARAMETERS]), about_origin=about_origin)
    camera = replace(CAMERA, roll=0.1, pitch=-0.05, yaw=0.2)
    rng = np.random.default_rng(5)
    x = variables.read(mechanism, camera)
    x = x + rng.normal(scale=0.03, size=len(x))
    mechanism, camera = variables.write(x, mechanism, camera)
    np.testing.assert_allclose(variables.read(mechanism, camera), x, atol=1e-12)
    rig, shifts = shifted_rigs(variables, x, mechanism, camera, shrink)
    assert len(x) == len(shifts.steps) > 8
    for i, step in enumerate(shifts.steps):
        twin = rig_of(*variables.write(x + step * np.eye(len(x))[i], mechanism, camera), shrink=shrink)
        for name in ("links", "points", "radius", "camera"):
            change = (getattr(shifts, name if name != "camera" else "cameras")[i] - getattr(rig, name)) / step
            wanted = (getattr(twin, name) - getattr(rig, name)) / step
            # rounding over the step
            np.testing.assert_allclose(change, wanted, rtol=1e-6, atol=1e-6 * max(1.0, np.abs(wanted).max()))


def test_nothing_to_refine_but_the_poses() -> None:
    mechanism = load("single")
    truth = np.array([[-0.4], [0.3]])
    masks = KeyMasks([drawn_mask(mechanism, CAMERA, q) for q in truth], trusted(mechanism))
    guess = SceneGuess(mechanism, CAMERA, truth + 0.02, np.zeros(2))
    bundle = refine(masks, guess, scene_variables(mechanism, []), EdgeSearch(np.full(4, 4.0), 2.0))
    # a few hundredths of a pixel over a link of 60 px
    np.testing.assert_allclose(bundle.positions, truth, atol=2e-3)
    assert bundle.mechanism.values == mechanism.values


def test_widths_are_right_where_the_sides_of_the_bodies_show(tmp_path: Path) -> None:
    def pair(thick: float) -> Mechanism:
        box = f'<geom type="box" size=".12 {thick} .015" pos=".12 0 0"/>'
        joint = '<joint name="{}" axis="0 -1 0"/>'
        (tmp_path / "pair.xml").write_text(
            f'<mujoco><worldbody><body name="a">{joint.format("j1")}{box}'
            f'<body name="b" pos=".24 0 0">{joint.format("j2")}{box}</body></body></worldbody></mujoco>'
        )
        return load(tmp_path / "pair.xml")

    # to the left of the middle of a wide picture the right sides of the boxes show, by 3 px where they hang
    true, start = pair(0.02), pair(0.002)
    camera = Camera(480, 240, 300.0, x=0.4, y=-0.03, depth=1.5)
    rng = np.random.default_rng(2)
    poses = np.column_stack([rng.uniform(-3.0, -0.1, 12), rng.uniform(-1.5, 1.5, 12)])
    masks = KeyMasks([drawn_mask(true, camera, q) for q in poses], trusted(true))
    sizes = ["a.length", "a.width", "b.length", "b.width"]
    names = [*sizes, "a.thickness", "b.thickness", "camera.x", "camera.y", "camera.depth"]
    variables = scene_variables(start, names)
    # one variable for all thicknesses: how far the sides show
    assert variables.names == (*sizes, "a.thickness", "camera.x", "camera.y", "camera.depth")
    guess = SceneGuess(start, camera, poses, np.zeros(12))
    found = refine(masks, guess, variables, EdgeSearch(np.full(20, 5.0), 2.0)).mechanism.values
    scale = 0.24 / found["a.length"]
    assert found["b.thickness"] == pytest.approx(found["a.thickness"], rel=1e-9)
    assert found["a.thickness"] * scale == pytest.approx(0.04, rel=0.1)
    # 0.05 px of 6 px; held at the start, the thickness takes 20 % of the widths
    assert found["a.width"] * scale == pytest.approx(0.03, rel=0.01)
    assert found["b.width"] * scale == pytest.approx(0.03, rel=0.01)


def test_only_what_another_geom_may_hide_creeps() -> None:
    names = ["link1.length", "link1.tail", "link1.tip", "camera.x"]
    assert scene_variables(load("double"), names).creeps.tolist() == [True, False, False, True]
    assert scene_variables(load("bob"), ["link1.length", "link1.sphere.width"]).creeps.all()


def test_an_end_that_another_body_hides_is_not_known_better_than_it_is_off() -> None:
    """The file has an end four times as long as it is, which would show: it leaps out, and is drawn back."""
    wide = {"link1.tip": 0.008, "link1.width": 0.02, "link2.width": 0.05, "link2.tail": 0.02}
    true = load("double").with_values(wide)
    start = true.with_values({"link1.tip": 0.03})
    rng = np.random.default_rng(3)
    poses = np.column_stack([rng.uniform(-2.5, -0.5, 12), rng.uniform(-1.5, 1.5, 12)])
    masks = KeyMasks([drawn_mask(true, CAMERA, q) for q in poses], trusted(true))
    names = ["link1.length", "link1.width", "link1.tip", "link2.length", "link2.width", "camera.depth"]
    variables = scene_variables(start, names)
    guess = SceneGuess(start, CAMERA, poses, np.zeros(12))
    # whatever the number of steps: a leap in every second one shows in half of them
    for settle in (5, 6, 7, 8):
        bundle = refine(masks, guess, variables, EdgeSearch(np.full(10, 4.0), 2.0), settle=settle)
        found, wanted = bundle.mechanism.values, true.values
        off = found["link1.tip"] / wanted["link1.tip"] * wanted["link1.length"] / found["link1.length"]
        information = size_information(bundle, scale_free=True).information
        assert abs(np.log(off)) < 3.0 / np.sqrt(information[2, 2])
        # what shows has settled: widths of 7 and 17 px, to a tenth of a pixel
        assert np.abs(bundle.unsettled[[1, 4]]).max() < 0.01
        assert np.sqrt(information[[1, 4], [1, 4]]).min() > 30.0
