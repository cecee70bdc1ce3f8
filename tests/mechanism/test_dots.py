"""What of a mechanism is seen as dots alone, and what its bodies are taken to be then."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dotted import BALLS
from monodyn.mechanism import load
from monodyn.mechanism.dots import as_rods, chosen_bodies, dots_of, mass_notes, shows_dots

HEAD = '<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>'
MASS = '<inertial pos="0.05 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>'
HINGE = '<joint name="{0}" type="hinge" axis="0 -1 0"/>'
TAIL = "</body></worldbody></mujoco>"


def arm(geoms: str) -> str:
    """Return a single link with geoms, sites and inertials."""
    return f'{HEAD}<body name="arm">{HINGE.format("pin")}{geoms}{TAIL}'


def read(text: str, folder: Path):
    path = folder / "dots.xml"
    path.write_text(text, encoding="utf-8")
    return load(path)


def test_balls_on_links_are_dots(tmp_path: Path) -> None:
    mechanism = read(BALLS, tmp_path)
    dots = dots_of(mechanism)
    assert [(dot.name, dot.link) for dot in dots] == [("link1_dot", 0), ("tip", 1)]
    np.testing.assert_allclose([dot.place for dot in dots], [[0.1, 0.0], [0.1, 0.0]], atol=1e-12)
    assert shows_dots(mechanism)
    assert chosen_bodies(mechanism, "auto") == "free"


def test_sites_are_dots_where_nothing_is_drawn(tmp_path: Path) -> None:
    mechanism = read(arm(MASS + '<site name="a" pos="0.1 -0.02 0"/><site name="b" pos="0.2 0 0"/>'), tmp_path)
    assert [(dot.name, round(dot.ahead, 9)) for dot in dots_of(mechanism)] == [("a", 0.02), ("b", 0.0)]
    # without geoms the body is as long as to its farthest site
    assert mechanism.values["arm.length"] == pytest.approx(0.2)
    assert shows_dots(mechanism)


def test_what_is_without_opacity_is_not_seen(tmp_path: Path) -> None:
    rod = '<geom type="capsule" size="0.01" fromto="0 0 0 0.2 0 0" rgba="0 0 0 {}"/>'
    site = '<site name="knob" pos="0.15 0 0"/>'
    assert [dot.name for dot in dots_of(read(arm(rod.format(0) + site), tmp_path))] == ["knob"]
    assert dots_of(read(arm(rod.format(1) + site), tmp_path)) == ()


def test_a_ball_alone_is_followed_by_its_outline(tmp_path: Path) -> None:
    mechanism = read(arm('<geom type="sphere" size="0.02" pos="0.2 0 0"/>'), tmp_path)
    assert len(dots_of(mechanism)) == 1
    assert not shows_dots(mechanism)
    assert chosen_bodies(mechanism, "auto") == "uniform"


def test_a_wheel_about_its_hinge_is_no_dot(tmp_path: Path) -> None:
    wheel = '<geom type="sphere" size="0.1" pos="0.05 0 0"/><geom type="sphere" size="0.01" pos="0.2 0 0"/>'
    assert dots_of(read(arm(wheel), tmp_path)) == ()
    assert dots_of(load("double")) == ()


def test_a_dot_about_a_hinge_moves_with_the_link_before(tmp_path: Path) -> None:
    knee = f'<body name="leg" pos="0.1 -0.01 0">{HINGE.format("knee")}<geom type="sphere" size="0.01"/>'
    knee += '<geom name="pin" type="sphere" size="0.01" pos="0.1 0 0"/></body>'
    pivot = '<geom type="sphere" size="0.01"/>'
    dots = dots_of(read(arm(pivot + MASS + knee), tmp_path))
    # the one about the pivot does not move; a name that a joint has is another one
    assert [(dot.name, dot.link) for dot in dots] == [("leg_dot1", 0), ("pin_dot", 1)]
    np.testing.assert_allclose([*dots[0].place, dots[0].ahead], [0.1, 0.0, 0.01], atol=1e-12)


def test_of_equal_balls_the_farthest_ends_the_body(tmp_path: Path) -> None:
    ball = '<geom type="sphere" size="0.01" pos="{} 0 0"/>'
    mechanism = read(arm(ball.format(0.1) + ball.format(0.3) + ball.format(0.2)), tmp_path)
    assert mechanism.values["arm.length"] == pytest.approx(0.3)


def test_free_bodies_start_as_rods(tmp_path: Path) -> None:
    mechanism = read(BALLS, tmp_path).with_bodies("free")
    rods = as_rods(mechanism).values
    for body in ("link1", "link2"):
        mass = rods[f"{body}.mass"]
        assert rods[f"{body}.com_x"] == pytest.approx(0.075)
        # a rod of half the mass about its middle, both halves away from the common centre
        apart = mass * 0.025**2
        assert rods[f"{body}.inertia"] == pytest.approx(0.5 * mass * 0.1**2 / 12 + apart)
    # what the file states of the masses stays, and so does a mechanism with an outline
    given = read(arm(MASS + '<site name="a" pos="0.1 0 0"/>'), tmp_path).with_bodies("free")
    assert as_rods(given).values == given.values
    double = load("double").with_bodies("free")
    assert as_rods(double) is double


def test_a_ball_that_is_all_that_weighs_is_noted(tmp_path: Path) -> None:
    model = tmp_path / "ball.xml"
    model.write_text(
        '<mujoco><worldbody><body name="bob"><joint name="j" axis="0 -1 0"/>'
        '<geom type="sphere" size="0.02" pos="0.2 0 0"/></body></worldbody></mujoco>'
    )
    ball = load(model)
    assert mass_notes(ball, "uniform") == [
        "All of the mass of 'bob' is taken to be in what is seen of it, as the file has it; where a rod that "
        "cannot be seen weighs as well, lengths come out too short: give the file its mass, or a length with "
        "--fix."
    ]
    assert mass_notes(ball, "free") == []
    assert mass_notes(load("double"), "uniform") == []
