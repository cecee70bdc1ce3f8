"""The roll of a camera: which joints it moves, and when a motion feels it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.mechanism.upright import ROLL, ROLL_STD, by_roll, feels_roll, with_roll
from support import DEMO


def test_only_the_hinge_of_the_world_depends_on_what_is_upright() -> None:
    assert by_roll(load("double")).tolist() == [1.0, 0.0]
    # the rail of a cart shows the roll in the picture
    assert by_roll(load("cartpole")).tolist() == [0.0, 0.0]


def test_a_hinge_that_turns_the_other_way_counts_the_other_way(tmp_path: Path) -> None:
    text = (DEMO / "double.xml").read_text(encoding="utf-8")
    assert text.count('axis="0 -1 0"') == 2
    # the first hinge defines the side from which the plane is seen, so that a sign shows at a later one only
    (tmp_path / "other.xml").write_text(text.replace('axis="0 -1 0"', 'axis="0 1 0"', 1), encoding="utf-8")
    mechanism = load(tmp_path / "other.xml")
    assert [joint.sign for joint in mechanism.joints] == [1, -1]
    assert by_roll(mechanism).tolist() == [1.0, 0.0]


def test_gravity_and_a_spring_at_the_first_hinge_feel_the_roll(tmp_path: Path) -> None:
    text = (DEMO / "double.xml").read_text(encoding="utf-8")
    assert text.count('gravity="0 0 -9.81"') == 1
    (tmp_path / "flat.xml").write_text(text.replace("-9.81", "0"), encoding="utf-8")
    flat = load(tmp_path / "flat.xml")
    assert feels_roll(load("double"))
    assert not feels_roll(load("cartpole"))
    assert not feels_roll(flat)
    assert feels_roll(flat.with_choices(free=["gravity"]))
    assert feels_roll(flat.with_choices(fix={"joint1.stiffness": 0.1}))
    assert feels_roll(flat.with_choices(free=["joint1.stiffness"]))
    assert not feels_roll(flat.with_choices(free=["joint2.stiffness"]))


def test_a_roll_may_be_assumed_or_chosen() -> None:
    double = load("double")
    assert not double.parameter(ROLL).free
    free = with_roll(double, 0.1, free=True)
    assert (free.parameter(ROLL).value, free.parameter(ROLL).free) == (0.1, True)
    assert ROLL not in free.chosen
    assert ROLL in with_roll(double, 0.1, free=True, assumed=False).chosen
    # what bodies are is no matter of the camera
    assert free.with_bodies("free").parameter(ROLL).free
    assert pytest.approx(np.pi / 60) == ROLL_STD
