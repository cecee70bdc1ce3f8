"""Bodies of several geoms: which sizes and places follow, masses against MuJoCo, derivatives, pictures."""

from __future__ import annotations

from pathlib import Path

import cv2
import mujoco
import numpy as np
import pytest

from monodyn.mechanism import Mechanism, load
from monodyn.mechanism.assemble import following_slopes
from monodyn.mechanism.mjcf import write_mjcf
from monodyn.mechanism.tree import COM_X, COM_Y, INERTIA, MASS
from monodyn.mechanism.urdf import write_urdf

BAR = '<geom type="box" size="{0} .003 .01" pos="{0} 0 0"/>'
"""A box from the hinge along x, of this half length."""
ELL = BAR.format(0.1) + '<geom name="arm" type="box" size=".01 .003 .03" pos=".19 0 .04"/>'
TEE = BAR.format(0.1) + '<geom name="bar" type="box" size=".012 .003 .05" pos=".212 0 0"/>'
DISC = BAR.format(0.1) + '<geom name="disc" type="cylinder" size=".03 .004" pos=".2 0 0" euler="90 0 0"/>'
COUNTER = (
    BAR.format(0.1) + '<geom name="disc" type="cylinder" size=".03 .004" pos="-.06 0 0" euler="90 0 0"/>'
)
HAMMER = (
    '<geom type="capsule" size=".008" fromto="0 0 0 .2 0 0"/>'
    '<geom name="head" type="box" size=".02 .015 .045" pos=".2 0 .01"/>'
)
TRIANGLE = (
    '<geom type="capsule" size=".008" fromto="0 0 0 .2 0 0"/>'
    '<geom name="up" type="capsule" size=".008" fromto="0 0 0 .1 0 .13"/>'
    '<geom name="down" type="cylinder" size=".008" fromto=".2 0 0 .1 0 .13"/>'
)
BODIES = {
    "ell": ELL, "tee": TEE, "disc": DISC, "counter": COUNTER, "hammer": HAMMER, "triangle": TRIANGLE
}  # fmt: skip


def body(geoms: str, folder: Path) -> Mechanism:
    path = folder / "body.xml"
    path.write_text(
        '<mujoco><option gravity="0 0 -9.81"/><worldbody><body name="a"><joint name="j" axis="0 -1 0"/>'
        f"{geoms}</body></worldbody></mujoco>"
    )
    return load(path)


def following(mechanism: Mechanism) -> set[str]:
    kinds = ("width", "extent", "along", "across", "turn")
    return {p.name for p in mechanism.parameters if p.follows and p.kind in kinds}


def estimated(mechanism: Mechanism) -> set[str]:
    return {
        p.name for p in mechanism.parameters if p.free and p.kind in ("extent", "along", "across", "turn")
    }


def test_what_touches_another_part_stays_there(tmp_path: Path) -> None:
    ell = body(ELL, tmp_path)
    assert following(ell) == {"a.arm.along", "a.arm.across", "a.arm.turn"}
    changed = ell.with_values(
        {"a.length": 0.3, "a.width": 0.05, "a.arm.width": 0.016, "a.arm.length": 0.1}
    ).values
    # flush with the end of the link, and standing on its upper side
    assert changed["a.arm.along"] == pytest.approx(0.3 - 0.008, rel=1e-12)
    assert changed["a.arm.across"] == pytest.approx(0.025 + 0.05, rel=1e-12)
    tee = body(TEE, tmp_path)
    assert following(tee) == {"a.bar.along", "a.bar.across", "a.bar.turn"}
    values = tee.with_values({"a.length": 0.3, "a.bar.width": 0.04}).values
    assert (values["a.bar.along"], values["a.bar.across"]) == pytest.approx((0.32, 0.0), abs=1e-12)
    disc = body(DISC, tmp_path).with_values({"a.length": 0.25})
    assert following(disc) == {"a.disc.along", "a.disc.across"}
    assert disc.values["a.disc.along"] == pytest.approx(0.25, rel=1e-12)


def test_what_stands_alone_is_estimated(tmp_path: Path) -> None:
    assert estimated(body(COUNTER, tmp_path)) == {"a.disc.along"}
    assert estimated(body(HAMMER, tmp_path)) == {"a.head.length", "a.head.across"}
    triangle = estimated(body(TRIANGLE, tmp_path))
    assert triangle == {f"a.{rod}.{what}" for rod in ("up", "down") for what in (
        "length", "along", "across", "turn"
    )}  # fmt: skip


def test_a_geom_as_long_as_its_link_stays_so(tmp_path: Path) -> None:
    mechanism = body(
        BAR.format(0.1) + '<geom name="b" type="box" size=".1 .003 .004" pos=".1 -.01 0"/>', tmp_path
    )
    assert following(mechanism) == {"a.b.length", "a.b.along", "a.b.across", "a.b.turn"}
    assert mechanism.with_values({"a.length": 0.26}).values["a.b.length"] == pytest.approx(0.26, rel=1e-12)


def test_a_main_geom_off_its_axis_has_a_place(tmp_path: Path) -> None:
    beside = body('<geom name="bar" type="box" size=".1 .003 .01" pos=".1 0 .03"/>', tmp_path)
    assert estimated(beside) == {"a.bar.across"}
    moved = beside.with_values({"a.bar.across": -0.04})
    assert moved.tree.links[0, COM_Y] == pytest.approx(-0.04, rel=1e-12)


def test_a_followed_place_can_be_fixed_and_freed(tmp_path: Path) -> None:
    ell = body(ELL, tmp_path)
    fixed = ell.with_choices(fix={"a.arm.across": 0.05})
    assert not fixed.parameter("a.arm.across").follows
    assert fixed.with_values({"a.arm.length": 0.2}).values["a.arm.across"] == 0.05
    freed = ell.with_values({"a.width": 0.04}).with_choices(free=["a.arm.across", "a.arm.turn"])
    # it begins where it was, and goes its own way
    assert freed.parameter("a.arm.across").value == pytest.approx(0.05, rel=1e-12)
    assert freed.parameter("a.arm.turn").free


def wrong(mechanism: Mechanism, seed: int) -> Mechanism:
    """Return the mechanism with every size and place changed by a factor of its own, 0.5 to 2."""
    rng = np.random.default_rng(seed)
    values = {
        p.name: p.value * float(np.exp(rng.uniform(-0.7, 0.7)))
        for p in mechanism.parameters
        if p.kind in ("length", "width", "extent", "along", "across", "thickness") and not p.follows
    }
    return mechanism.with_values(values)


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("free", [False, True])
def test_masses_are_those_of_mujoco_at_any_sizes(name: str, free: bool, tmp_path: Path) -> None:
    """The written geoms, given their density again, have the mass, centre and inertia that are simulated."""
    mechanism = body(BODIES[name], tmp_path)
    if free:
        mechanism = mechanism.with_choices(free=sorted(following(mechanism)))
    mechanism = wrong(mechanism, 3)
    if free:
        turns = [p.name for p in mechanism.parameters if p.kind == "turn"]
        mechanism = mechanism.with_values({turn: mechanism.values[turn] + 0.4 for turn in turns})
    path = tmp_path / "model.xml"
    write_mjcf(mechanism, path)
    spec = mujoco.MjSpec.from_file(str(path))
    written = spec.compile()
    row = mechanism.tree.links[0]
    assert written.body_mass[1] == pytest.approx(row[MASS], rel=1e-9)
    spec.body("a").explicitinertial = False
    model = spec.compile()
    assert model.body_mass[1] == pytest.approx(row[MASS], rel=1e-6)
    assert model.body_ipos[1][[0, 2]] == pytest.approx(row[[COM_X, COM_Y]], rel=1e-6, abs=1e-9)
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[1])
    about = float(turn.reshape(3, 3)[1] ** 2 @ model.body_inertia[1])
    assert about == pytest.approx(row[INERTIA], rel=1e-6)


def disarranged(name: str, folder: Path) -> Mechanism:
    """Return a body every part of which has a size, a place and a turn of its own."""
    mechanism = body(BODIES[name], folder)
    mechanism = wrong(mechanism.with_choices(free=sorted(following(mechanism))), 5)
    turns = [p.name for p in mechanism.parameters if p.kind == "turn"]
    return mechanism.with_values({turn: mechanism.values[turn] - 0.5 for turn in turns})


@pytest.mark.parametrize("name", BODIES)
def test_written_geoms_look_the_same(name: str, tmp_path: Path) -> None:
    mechanism = disarranged(name, tmp_path)
    write_mjcf(mechanism, tmp_path / "model.xml")
    ours, theirs = mechanism.shapes, load(tmp_path / "model.xml").shapes
    for g in range(len(ours.body)):
        a, b = (s.points[s.first[g] : s.first[g + 1]] for s in (ours, theirs))
        # a cylinder's rim begins elsewhere once it is turned: its hull is the same to a 24th of a circle
        near = 2e-4 if len(a) > 8 else 1e-9
        assert a.mean(axis=0) == pytest.approx(b.mean(axis=0), abs=1e-9)
        for point in a:
            assert np.min(np.linalg.norm(b - point, axis=1)) < near
        assert ours.radius[g] == pytest.approx(theirs.radius[g], rel=1e-9)


def shadow(mechanism: Mechanism) -> np.ndarray:
    """Return the cells of half a millimetre that a body covers, seen along the hinge axis."""
    shapes, mask = mechanism.shapes, np.zeros((1600, 1600), np.uint8)
    turn = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    for g in range(len(shapes.body)):
        points = shapes.points[shapes.first[g] : shapes.first[g + 1], :2]
        around = (points[:, np.newaxis] + shapes.radius[g] * circle).reshape(-1, 2)
        corners = cv2.convexHull((around / 5e-4 + 800.0).astype(np.float32))
        cv2.fillConvexPoly(mask, np.round(corners * 16).astype(np.int32), 1, cv2.LINE_8, 4)
    return mask > 0


@pytest.mark.parametrize("name", BODIES)
def test_a_urdf_shows_the_same_body_with_the_same_inertia(name: str, tmp_path: Path) -> None:
    mechanism = disarranged(name, tmp_path)
    write_urdf(mechanism, tmp_path / "model.urdf")
    again = load(tmp_path / "model.urdf")
    ours, theirs = shadow(mechanism), shadow(again)
    # a capsule is written as a cylinder and two balls; the rest is the rounding to cells along the outline
    assert np.sum(ours != theirs) < 0.02 * np.sum(ours)
    columns = [MASS, COM_X, COM_Y, INERTIA]
    np.testing.assert_allclose(again.tree.links[0, columns], mechanism.tree.links[0, columns], rtol=1e-6)


def test_a_urdf_has_places_and_turns(tmp_path: Path) -> None:
    """What a URDF puts onto another part follows it, as in MJCF; a turned box has a turn."""
    mechanism = body(ELL + DISC.removeprefix(BAR.format(0.1)), tmp_path)
    write_urdf(mechanism, tmp_path / "model.urdf")
    again = load(tmp_path / "model.urdf")
    assert {p.kind: p.follows for p in again.parameters if p.kind in ("along", "across", "turn")} == {
        "along": True, "across": True, "turn": True
    }  # fmt: skip
    kinds = ("length", "width", "extent", "along", "across", "turn")
    ours, theirs = ([p for p in m.parameters if p.kind in kinds] for m in (mechanism, again))
    assert [p.kind for p in ours] == [p.kind for p in theirs]
    assert [p.value for p in ours] == pytest.approx([p.value for p in theirs], abs=1e-6)
    turned = mechanism.with_choices(free=["a.arm.turn"]).with_values({"a.arm.turn": 1.0})
    write_urdf(turned, tmp_path / "model.urdf")
    turn = next(p for p in load(tmp_path / "model.urdf").parameters if p.kind == "turn")
    assert turn.free
    assert turn.value == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("free", [False, True])
def test_derivatives_are_those_of_finite_differences(name: str, free: bool, tmp_path: Path) -> None:
    mechanism = body(BODIES[name], tmp_path)
    if free:
        mechanism = mechanism.with_choices(free=sorted(following(mechanism)))
    mechanism = wrong(mechanism, 7)
    names = [
        p.name
        for p in mechanism.parameters
        if p.kind in ("length", "width", "extent", "along", "across", "turn") and not p.follows
    ]
    directions = mechanism.directions(names)
    for k, size in enumerate(names):
        value = mechanism.values[size]
        high, low = (mechanism.with_values({size: value + s}).tree.links for s in (1e-5, -1e-5))
        # central differences of quantities up to cubes of 0.1 m: truncation 1e-9 of them, rounding less
        assert np.allclose(directions.links[:, :, k], (high - low) / 2e-5, rtol=1e-6, atol=1e-9), size


def test_slopes_of_what_follows(tmp_path: Path) -> None:
    ell = body(ELL, tmp_path)
    slopes = following_slopes(ell.plan, ell.own)
    across = slopes[ell.row("a.arm.across")]
    assert across[ell.row("a.width")] == pytest.approx(0.5, rel=1e-12)
    assert across[ell.row("a.arm.length")] == pytest.approx(0.5, rel=1e-12)
    assert np.count_nonzero(np.abs(across) > 1e-15) == 2
    freed = ell.with_choices(free=["a.arm.across"])
    assert following_slopes(freed.plan, freed.own)[ell.row("a.arm.across"), ell.row("a.arm.across")] == 1.0


def test_places_scale_with_the_picture(tmp_path: Path) -> None:
    """All sizes, places and offsets k times as large: the same outline k times as large."""
    for geoms in BODIES.values():
        mechanism = wrong(body(geoms, tmp_path), 11)
        kinds = ("length", "width", "tail", "tip", "extent", "along", "across", "offset")
        larger = mechanism.with_values(
            {p.name: 1.7 * p.value for p in mechanism.parameters if p.kind in kinds and not p.follows}
        )
        flat = (slice(None), slice(2))
        assert np.allclose(larger.shapes.points[flat], 1.7 * mechanism.shapes.points[flat], atol=1e-12)
        assert np.allclose(larger.shapes.radius, 1.7 * mechanism.shapes.radius, rtol=1e-12)
