"""What key frames know: the camera to the common scale, the geoms of a body, and what no picture shows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monodyn.mechanism import Mechanism, load
from monodyn.types import Camera
from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.drawing.rig import longest_reach, rig_of
from monodyn.vision.locating.bundle import Bundle, KeyMasks, refine
from monodyn.vision.locating.knowledge import (
    BENDS,
    STRETCHES,
    camera_std,
    covariance_of,
    hidden_places,
    hinge_px,
    pendant_lengths,
    shifted_turn,
    size_information,
)
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.variables import scene_variables
from pictures import drawn_mask, trusted

CAMERA = Camera(320, 240, 300.0, x=0.02, y=-0.03, depth=0.95)


def test_camera_std_is_held_to_the_common_scale() -> None:
    """Sizes and depth grow together unseen: with the scale held the depth is known better."""
    mechanism = load("single")
    poses = np.linspace(-2.0, 0.5, 6)[:, None]
    masks = KeyMasks([drawn_mask(mechanism, CAMERA, q) for q in poses], trusted(mechanism))
    variables = scene_variables(mechanism, ["link1.length", "link1.width", "camera.x", "camera.depth"])
    search = EdgeSearch(np.array([4.0, 4.0]), 2.0)
    bundle = refine(masks, SceneGuess(mechanism, CAMERA, poses, np.zeros(6)), variables, search)
    held, free = (camera_std(bundle, scale_free=scale_free) for scale_free in (True, False))
    assert set(held) == {"camera.x", "camera.depth"}
    # 0.3 px of noise and a few hundred samples on links of 60 px
    assert held["camera.depth"] < 0.01
    assert free["camera.depth"] > 1.5 * held["camera.depth"]


def test_what_is_hardly_known_is_not_taken_for_well_known() -> None:
    """Edges know sizes far better than anything knows the focal length of a square camera."""
    information = np.diag([1e12, 1e12, 16.0])
    # two sizes grow together unseen, the third is the logarithm of the focal length
    information[:2, :2] -= 1e12 * 0.5
    for sizes in ([True, True, False], [True, False, False]):
        covariance = covariance_of(information, np.array(sizes), scale_free=True)
        assert covariance[2, 2] == pytest.approx(1.0 / 16.0, rel=1e-6)
        assert covariance[0, 0] < 1e-10
    hardly = covariance_of(np.diag([1e13, 1e13, 1e-6]), np.zeros(3, dtype=bool), scale_free=False)
    assert hardly[2, 2] == pytest.approx(1e6, rel=1e-6)


def test_a_shifted_edge_looks_like_a_turn_of_the_camera() -> None:
    """A camera turned by as much, about the hinge, sees the end of the link 0.2 px off."""
    mechanism = load("single")
    bundle = SimpleNamespace(mechanism=mechanism, camera=CAMERA, systematic_px=0.12, sway_px=0.16)
    assert shifted_turn(bundle, "camera.focal") == 0.0
    # the corner of the link
    end = np.hypot(mechanism.values["link1.length"], 0.5 * mechanism.values["link1.width"])
    square = CAMERA.focal * end / CAMERA.depth
    for name in ("camera.yaw", "camera.pitch"):
        angle = shifted_turn(bundle, name)
        aside = CAMERA.focal * end * np.cos(angle) / (CAMERA.depth - end * np.sin(angle))
        assert aside - square == pytest.approx(0.2, rel=0.05)
    assert square * np.tan(shifted_turn(bundle, "camera.roll")) == pytest.approx(0.2, rel=0.05)


def test_of_a_long_thread_the_picture_shows_the_end_alone() -> None:
    mechanism = load("bob").with_values({"link1.length": 50.0})
    bundle = SimpleNamespace(mechanism=mechanism, camera=CAMERA, systematic_px=0.2, sway_px=0.0)
    half = 0.5 * np.hypot(CAMERA.width, CAMERA.height)
    assert shifted_turn(bundle, "camera.roll") == pytest.approx(0.2 / half)
    assert shifted_turn(bundle, "camera.yaw") == pytest.approx(0.2 * CAMERA.focal / half**2)


def test_a_turned_camera_is_told_from_lens_and_thread_within_what_these_leave() -> None:
    half = 0.5 * np.hypot(CAMERA.width, CAMERA.height)
    for name, stretches in (("bob", 0.0), ("ball", STRETCHES)):
        mechanism = load(name).with_values({"link1.length": 50.0})
        bundle = SimpleNamespace(mechanism=mechanism, camera=CAMERA, systematic_px=0.2, sway_px=0.0)
        off = np.linalg.norm([0.2, stretches * half, BENDS * half])
        assert shifted_turn(bundle, "camera.yaw", bent=True) == pytest.approx(off * CAMERA.focal / half**2)
        # neither looks like a turn of the picture, nor do poses depend on which of them it is
        assert shifted_turn(bundle, "camera.roll", bent=True) == pytest.approx(0.2 / half)
        assert shifted_turn(bundle, "camera.yaw") == pytest.approx(0.2 * CAMERA.focal / half**2)
    near = SimpleNamespace(mechanism=load("single"), camera=CAMERA, systematic_px=0.0, sway_px=0.0)
    reach = CAMERA.focal * longest_reach(rig_of(near.mechanism, CAMERA)) / CAMERA.depth
    bent = BENDS * reach * CAMERA.focal / half**2
    assert shifted_turn(near, "camera.pitch", bent=True) == pytest.approx(bent)


def test_from_a_pivot_outside_of_the_picture_its_far_end_alone_is_shown() -> None:
    """A hook that gives way changes the radius of the path, and nobody sees it."""
    rod = load("bob").with_values({"link1.width": 4.0 * CAMERA.depth / CAMERA.focal})
    above, beside = replace(CAMERA, y=-0.45), replace(CAMERA, x=0.6)
    for camera, names in ((CAMERA, []), (above, ["link1.length"]), (beside, ["link1.length"])):
        assert pendant_lengths(rod, camera) == names
        assert pendant_lengths(load("double"), camera) == names
        # a rail is no pivot
        assert pendant_lengths(load("cartpole"), camera) == []


def test_what_holds_a_ball_is_a_thread_or_a_rod() -> None:
    px = CAMERA.depth / CAMERA.focal
    bob = load("bob")
    assert pendant_lengths(load("ball"), CAMERA) == ["link1.length"]
    assert pendant_lengths(bob.with_values({"link1.width": 2.0 * px}), CAMERA) == ["link1.length"]
    assert pendant_lengths(bob.with_values({"link1.width": 4.0 * px}), CAMERA) == []
    assert pendant_lengths(load("double"), CAMERA) == []


def test_a_hinge_is_known_no_better_than_it_holds_still() -> None:
    """Give way by 2 px in step with a swing of 0.2 rad, and the point about which it turns moves by 10 px."""
    swings = np.column_stack([[-0.2, 0.2] * 4, np.zeros(8)])
    names = ["link1.length", "cart.length"]
    bundle: Any = SimpleNamespace(
        mechanism=load("double"), camera=CAMERA, positions=swings, sway_px=2.0,
        variables=SimpleNamespace(names=names),
    )  # fmt: skip
    assert hinge_px(bundle) == pytest.approx(10.0, rel=0.01)
    # what hardly turns shows no hinge, and what is given is known
    bundle.positions = 0.1 * swings
    assert hinge_px(bundle) == 0.0
    bundle.positions, bundle.variables = swings, SimpleNamespace(names=[])
    assert hinge_px(bundle) == 0.0
    bundle.variables = SimpleNamespace(names=names)
    # a rail is no pivot, and of a thread the length is not known so well anyway
    for other in ("cartpole", "ball"):
        bundle.mechanism = load(other)
        assert hinge_px(bundle) == 0.0


def test_the_length_of_a_thread_is_no_better_known_than_threads_stretch() -> None:
    mechanism = load("bob").with_values({"link1.width": 2.0 * CAMERA.depth / CAMERA.focal})
    names = ["link1.length", "link1.sphere.width", "camera.depth"]
    variables = scene_variables(mechanism, names)
    # next to nothing is open but how far threads stretch
    known = SimpleNamespace(
        mechanism=mechanism, camera=CAMERA, variables=variables, information=1e12 * np.eye(3),
        systematic_px=1e-9, alternatives=(), unsettled=np.zeros(0),
    )  # fmt: skip
    measured = size_information(known, scale_free=False)
    std = 1.0 / np.sqrt(np.diag(measured.information))
    assert dict(zip(measured.names, std.tolist(), strict=True)) == {
        "link1.length": pytest.approx(STRETCHES, rel=1e-4),
        "link1.sphere.width": pytest.approx(1e-6, rel=1e-4),
    }


def hammer(folder: Path, *, length: float, head: float, aside: float, short: float = 0.03) -> Mechanism:
    """Return a rod with a head across it, and a peg whose lower end lies inside of the rod."""
    (folder / "hammer.xml").write_text(
        '<mujoco><worldbody><body name="a"><joint name="j" axis="0 -1 0"/>'
        f'<geom type="box" size="{length / 2} .003 .015" pos="{length / 2} 0 0"/>'
        f'<geom name="head" type="box" size=".02 .003 {head / 2}" pos="{length} 0 {aside}"/>'
        f'<geom name="peg" type="box" size=".01 .003 {short / 2}" pos=".1 0 {0.04 - short / 2}"/>'
        "</body></worldbody></mujoco>"
    )
    return load(folder / "hammer.xml")


def refined(true: Mechanism, start: Mechanism) -> Bundle:
    rng = np.random.default_rng(4)
    poses = rng.uniform(-2.5, -0.5, (10, 1))
    masks = [drawn_mask(true, CAMERA, q) for q in poses]
    names = [p.name for p in start.parameters if p.free and p.kind not in ("thickness", "damping")]
    guess = SceneGuess(start, CAMERA, poses + rng.normal(scale=0.03, size=poses.shape), np.zeros(10))
    variables = scene_variables(start, [*names, "camera.x", "camera.y", "camera.depth"])
    reaches = np.array([9.0, 9.0, 8.0, 8.0, 7.0, 6.0, 5.0, 4.0, 4.0, 4.0, 4.0, 4.0])
    return refine(KeyMasks(masks, trusted(true)), guess, variables, EdgeSearch(reaches, 2.0))


def test_places_and_extents_of_geoms_are_found(tmp_path: Path) -> None:
    true = hammer(tmp_path, length=0.24, head=0.1, aside=0.012)
    start = hammer(tmp_path, length=0.24, head=0.08, aside=0.02)
    bundle = refined(true, start)
    found, wanted = bundle.mechanism.values, true.values
    scale = wanted["a.length"] / found["a.length"]
    # 0.05 px on a link of 75 px and a head of 30 px
    for name, error in (("a.head.length", 3e-4), ("a.head.across", 3e-4), ("a.head.width", 5e-4)):
        assert found[name] * scale == pytest.approx(wanted[name], abs=error), name
    # the head stays where the file puts it: across the rod's end
    assert found["a.head.along"] == pytest.approx(found["a.length"], rel=1e-12)


def test_an_end_inside_of_another_geom_is_not_known(tmp_path: Path) -> None:
    true = hammer(tmp_path, length=0.24, head=0.1, aside=0.012)
    bundle = refined(true, true)
    measured = size_information(bundle, scale_free=True)
    assert {"a.length", "a.width", "a.head.length", "a.head.across", "a.peg.along"} <= set(measured.names)
    sizes = np.array([not name.endswith(("across", "along")) for name in measured.names], dtype=float)
    information = measured.information
    # blind to the common scale, in which places, being ratios, have no part
    assert np.abs(information @ sizes).max() < 1e-6 * np.trace(information)
    covariance = np.linalg.pinv(information, hermitian=True)
    std = dict(zip(measured.names, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    # 0.2 px of 75 px at least, and not much more
    assert 2e-3 < std["a.head.across"] < 2e-2
    # middle and extent of the peg move together unseen, by half of the head's width of 40 mm at the most
    assert hidden_places(bundle, scale_free=True) == ["a.peg.across"]
    assert std["a.peg.across"] == pytest.approx(0.02 / 0.24, rel=0.1)
    # its upper end is seen: twice as far on 30 mm
    assert std["a.peg.length"] == pytest.approx(2 * 0.02 / 0.03, rel=0.25)
