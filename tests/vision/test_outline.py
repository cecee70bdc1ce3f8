"""Outlines of bodies in the picture."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from monodyn.errors import MechanismError
from monodyn.mechanism import Mechanism, load
from monodyn.types import Camera
from monodyn.vision.drawing.camera import pixels
from monodyn.vision.drawing.outline import _placed, _visible, check_told_apart, covered_pixels, outline
from monodyn.vision.drawing.rig import rig_of
from pictures import CAMERA
from support import refuses


def test_covered_pixels_grow() -> None:
    mechanism = load("single")
    inner = covered_pixels(mechanism, CAMERA, np.array([0.3]), margin=0.0)
    outer = covered_pixels(mechanism, CAMERA, np.array([0.3]), margin=3.0)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    assert (cv2.dilate(inner.astype(np.uint8), kernel) <= outer).all()
    assert outer.sum() < 2.0 * inner.sum()


def test_outline_behind_the_camera_is_empty() -> None:
    assert outline(load("single"), Camera(320, 240, 300.0, depth=-1.0), np.array([0.0])) == []


def slab(thickness: float) -> Mechanism:
    """Return the bundled pendulum made so thick along the line of sight."""
    return load("single").with_values({"link1.thickness": thickness})


def test_a_body_that_reaches_behind_the_camera_is_cut_there() -> None:
    # to the right of the camera, 1 m before it: the near end of a slab of 4 m lies behind the camera
    camera = Camera(320, 240, 300.0, x=-0.3, depth=1.0)
    ((body, polygon),) = outline(slab(4.0), camera, np.array([0.0]))
    assert body == "link1"
    # its far face is as it would be for a thinner slab whose far face is there
    far = np.array([[0.0, 0.0, -2.0], [0.2, 0.0, -2.0]])
    assert polygon[:, 0].min() == pytest.approx(pixels(camera, far)[:, 0].min(), abs=8.0)
    # and from there it runs out of the picture to the right
    assert polygon[:, 0].max() > 320


def test_the_cut_outline_is_the_usual_one_where_all_is_before_the_camera() -> None:
    """The hull of the points on the cut path, against the outlines that the kernels draw."""
    mechanism, q = load("bob"), np.array([0.4])
    camera = Camera(320, 240, 300.0, x=0.05, y=-0.1, depth=0.9)
    usual = outline(mechanism, camera, q)
    rig = rig_of(mechanism, camera)
    for (_, polygon), points in zip(usual, _placed(rig, q), strict=True):
        cut = _visible(points, camera)
        area = [cv2.contourArea(p.astype(np.float32)) for p in (polygon, cut)]
        # a ball is sampled in 98 directions here
        assert area[1] == pytest.approx(area[0], rel=0.06)
        assert cut.mean(axis=0) == pytest.approx(polygon.mean(axis=0), abs=3.0)


SLIDES = """<mujoco><option gravity="0 0 -9.81"/><worldbody>
<body><joint name="near" type="slide" axis="1 0 0"/>{first}
<body><joint name="far" type="slide" axis="1 0 0"/><geom type="box" size="0.1 0.05 0.05"/></body>
</body></worldbody></mujoco>"""
BARE = '<inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>'


def test_joints_that_no_picture_tells_apart_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "slides.xml"
    file.write_text(SLIDES.format(first=BARE))
    with refuses(
        MechanismError,
        "joints 'near', 'far': expected each to move what can be seen in its own way, got some that no "
        "picture tells apart; give the bodies between them a geom, or leave joints out.",
    ):
        check_told_apart(load(file))
    file.write_text(SLIDES.format(first='<geom type="box" size="0.02 0.02 0.02"/>'))
    check_told_apart(load(file))


@pytest.mark.parametrize("name", ["single", "double", "triple", "bob", "cartpole", "chain:10"])
def test_every_bundled_mechanism_is_told_apart(name: str) -> None:
    check_told_apart(load(name))
