"""The mechanism in other units: the same picture from a camera in the same units, and back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from models import read
from monodyn.mechanism import load
from monodyn.vision.drawing.outline import outline
from monodyn.vision.locating.unit import growth, in_usual_proportions, scaled, units_per_metre
from pictures import CAMERA

APART = """<mujoco><worldbody><body name="a" pos="0.3 0 0.1"><joint name="ja" axis="0 -1 0"/>
<geom type="box" size="0.1 0.004 0.01" pos="0.1 0 0"/></body><body name="b" pos="0.1 0.01 0">
<joint name="jb" type="slide" axis="1 0 0" range="-1 2"/><geom type="sphere" size="0.02"/></body></worldbody>
</mujoco>"""
"""Places in the world that follow no parameter, a slide with limits, a ball without a length."""


@pytest.mark.parametrize("factor", [1e-3, 7.0])
def test_the_picture_does_not_depend_on_the_unit(factor: float, tmp_path: Path) -> None:
    mechanism = read(tmp_path, APART)
    other = scaled(mechanism, factor)
    camera = replace(CAMERA, x=CAMERA.x * factor, y=CAMERA.y * factor, depth=CAMERA.depth * factor)
    here = outline(mechanism, CAMERA, np.array([0.4, 0.1]))
    there = outline(other, camera, np.array([0.4, 0.1 * factor]))
    for (_, one), (_, two) in zip(here, there, strict=True):
        np.testing.assert_allclose(two, one, atol=1e-9)
    assert [(joint.lower, joint.upper) for joint in other.joints][1] == (-factor, 2.0 * factor)
    assert growth(other, mechanism) == pytest.approx(factor)


def test_the_scale_is_that_of_what_is_fixed() -> None:
    file = load("double")
    found = scaled(file, 3.0).with_values({"link1.length": 1.2, "link2.width": 0.3})
    assert units_per_metre(found, CAMERA, file, {}, ()) == pytest.approx(3.0 * np.sqrt(2.0))
    assert units_per_metre(found, CAMERA, file, {}, {"link2.width"}) == pytest.approx(10.0)
    depth = {"camera.depth": 0.5 * CAMERA.depth}
    assert units_per_metre(found, CAMERA, file, depth, {"link2.width"}) == pytest.approx(2.0)


ELL = """<mujoco><worldbody><body name="a"><joint name="ja" axis="0 -1 0"/>
<geom type="box" size="0.05 0.005 0.01" pos="0.05 0 0"/>
<geom name="arm" type="box" size="0.02 0.005 0.01" pos="0.09 0 0.03" euler="0 90 0"/></body></worldbody>
</mujoco>"""
"""A body with a second part across."""


def test_a_further_part_is_not_longer_than_its_body(tmp_path: Path) -> None:
    file = read(tmp_path, ELL)
    assert in_usual_proportions(file, ()) is file
    long = file.with_values({"a.arm.length": 0.24})
    usual = in_usual_proportions(long, ())
    assert usual.values["a.arm.length"] == pytest.approx(0.05)
    assert usual.values["a.length"] == file.values["a.length"]
    assert in_usual_proportions(long, {"a.arm.length"}) is long


def test_widths_change_nothing_in_what_is_searched(tmp_path: Path) -> None:
    """The search takes them from the masks: to search again with others would find the same."""
    wide = read(tmp_path, ELL).with_values({"a.width": 0.09, "a.arm.width": 0.09})
    assert in_usual_proportions(wide, ()) is wide
