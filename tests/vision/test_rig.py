"""A mechanism before a camera as plain arrays, and what can be read off them."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.vision.drawing.camera import X
from monodyn.vision.drawing.rig import SIZE_KINDS, joint_limits, longest_reach, rig_of, root_slides
from pictures import CAMERA


def test_the_longest_reach_is_that_of_the_stretched_chain() -> None:
    mechanism = load("chain:3")
    values = mechanism.values
    lengths = [values[f"link{i}.length"] for i in (1, 2, 3)]
    half_width = 0.5 * values["link3.width"]
    tip = values.get("link3.tip", 0.0)
    # the corner of the last link, the links before it in a line
    expected = sum(lengths[:2]) + float(np.hypot(lengths[2] + tip, half_width))
    assert longest_reach(rig_of(mechanism, CAMERA)) == pytest.approx(expected)


def test_a_cart_slides_along_the_cameras_x() -> None:
    assert root_slides(load("cartpole")) == [(0, X)]
    assert root_slides(load("double")) == []


def test_sizes_have_the_kinds_that_a_picture_shows() -> None:
    kinds = {p.name: p.kind for p in load("double").parameters}
    assert {name for name, kind in kinds.items() if kind in SIZE_KINDS} == {
        name for name in kinds if name.endswith((".length", ".width", ".tail", ".tip"))
    }


def test_a_rig_may_be_written_to_and_leaves_the_mechanism_alone() -> None:
    mechanism = load("double")
    rig = rig_of(mechanism, CAMERA)
    rig.links[:] = 0.0
    assert mechanism.tree.links.any()
    assert rig.before(2.0 * rig.camera).camera[X] == 2.0 * rig.camera[X]


def test_joints_without_limits_have_infinite_ones() -> None:
    lower, upper = joint_limits(load("double"))
    assert (lower == -np.inf).all()
    assert (upper == np.inf).all()
