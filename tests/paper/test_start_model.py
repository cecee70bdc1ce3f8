"""What the search is given: the start view, and a root's slide in place of the camera's place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import monodyn
from chains import CAMERA
from monodyn.paper.placed import CameraFree, X
from monodyn.paper.start_model import StartModel
from monodyn.paper.subproblems import outline_points


def test_the_first_hinge_starts_in_the_middle_of_the_picture() -> None:
    """The stretched mechanism reaches over 0.3 of the smaller side, 84 px."""
    view = StartModel(monodyn.load("double"), CAMERA, ()).view()
    assert view.free == CameraFree(x=True, y=True, depth=True)
    points = outline_points(view.rig, np.zeros(2)) - [(CAMERA.width - 1) / 2, (CAMERA.height - 1) / 2]
    assert np.hypot(*points.T).max() == pytest.approx(84.0, rel=0.05)


def test_every_size_is_searched_where_the_reference_is_not_held() -> None:
    """Both views draw the same; a pinned coordinate leaves no common scale, and the reference held."""
    model = StartModel(monodyn.load("double"), CAMERA, ())
    held, every = model.view(), model.view(reference_held=False)
    assert held.reference is not None
    assert every.reference is not None
    assert held.reference.name == every.reference.name == "link1.length"
    assert set(every.names) == {*held.names, "link1.length"}
    assert every.free == held.free
    pose = np.array([0.4, -0.7])
    np.testing.assert_allclose(outline_points(every.rig, pose), outline_points(held.rig, pose), atol=1e-9)
    pinned = StartModel(model.mechanism, CAMERA, ("camera.x",))
    assert pinned.view(reference_held=False).names == pinned.view().names


def test_a_pinned_camera_stays() -> None:
    model = StartModel(monodyn.load("double"), CAMERA, ("camera.x", "camera.depth"))
    assert model.camera_free(slide=False) == CameraFree(x=False, y=True, depth=False)
    placed = model.placed(model.view())
    assert (placed.x, placed.depth) == (CAMERA.x, CAMERA.depth)
    assert not model.scale_free
    assert StartModel(model.mechanism, CAMERA, ()).scale_free


def test_a_slide_is_released_without_moving_the_picture() -> None:
    mechanism = monodyn.load("cartpole")
    model = StartModel(mechanism, CAMERA, ())
    assert model.camera_free(slide=True) == CameraFree(x=False, y=True, depth=True)
    start = model.view()
    np.testing.assert_array_equal(start.limits[:, 0], 0.0)
    moved = start.base.camera.copy()
    moved[X] += 0.07
    found = replace(start, position=np.array([0.0, 0.4])).before(moved)
    released = model.released(found)
    assert released.base.camera[X] == pytest.approx(CAMERA.x)
    assert released.position[0] == pytest.approx(CAMERA.x - moved[X])
    assert released.limits[1, 0] > released.limits[0, 0]
    np.testing.assert_allclose(
        outline_points(released.rig, released.position), outline_points(found.rig, found.position), atol=1e-9
    )
