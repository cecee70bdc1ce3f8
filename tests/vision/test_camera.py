"""The pinhole camera and its packed array."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.errors import SettingsError
from monodyn.types import Camera
from monodyn.vision.drawing.camera import (
    CENTRE_X,
    CENTRE_Y,
    DEPTH,
    FOCAL,
    PARAMETERS,
    ROTATION,
    X,
    Y,
    camera_array,
    check_view,
    on_plane,
    pixels,
    rotation,
    shrunk,
    turned,
    value_of,
    with_values,
)
from pictures import CAMERA
from support import refuses


@pytest.mark.parametrize(
    "turn", [{}, {"roll": 0.2}, {"pitch": 0.3}, {"yaw": -0.4}, {"roll": 0.1, "pitch": -0.2, "yaw": 0.3}]
)
def test_camera_turns_as_documented(turn: dict[str, float]) -> None:
    camera = Camera(100, 80, 90.0, depth=2.0, **turn)
    r = rotation(camera)
    np.testing.assert_allclose(r @ r.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(r) == pytest.approx(1.0)
    right, up, middle = pixels(camera, np.array([[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.0]]))
    if "roll" in turn and len(turn) == 1:
        assert right[1] > middle[1]  # clockwise: the right end goes down
    if "pitch" in turn and len(turn) == 1:
        assert middle[1] > 39.5  # looking up: the mechanism moves down
    if "yaw" in turn and len(turn) == 1:
        assert middle[0] > 49.5  # looking left: the mechanism moves right
    if not turn:
        assert right[0] > middle[0]
        assert up[1] < middle[1]


@pytest.mark.parametrize("turn", [{}, {"yaw": -0.4}, {"roll": 0.1, "pitch": -0.2, "yaw": 0.3}])
def test_points_of_the_plane_appear_where_they_are_looked_for(turn: dict[str, float]) -> None:
    camera = Camera(100, 80, 90.0, x=0.3, y=-0.1, depth=2.0, **turn)
    points = np.array([[0.0, 0.0], [0.4, -0.2], [-0.3, 0.5]])
    places = pixels(camera, np.column_stack([points, np.zeros(3)]))
    np.testing.assert_allclose(on_plane(camera_array(camera), places), points, atol=1e-12)


def test_beyond_the_horizon_is_far_away() -> None:
    camera = Camera(100, 80, 90.0, depth=2.0, yaw=1.4)
    assert np.abs(on_plane(camera_array(camera), np.array([[99.0, 40.0]]))).max() > 10.0


def test_reduced_camera_sees_the_centre_of_each_block() -> None:
    whole = camera_array(CAMERA)
    small = shrunk(whole, 4.0)
    # pixel 0 of the reduced picture covers pixels 0..3, whose centre is 1.5
    for whole_px, small_px in ((1.5, 0.0), (5.5, 1.0)):
        assert (whole_px - whole[CENTRE_X]) / whole[FOCAL] == pytest.approx(
            (small_px - small[CENTRE_X]) / small[FOCAL]
        )


def test_the_packed_camera_has_its_parameters_in_named_columns() -> None:
    packed = camera_array(CAMERA)
    np.testing.assert_array_equal(packed[:ROTATION].reshape(3, 3), rotation(CAMERA))
    assert packed[[X, Y, DEPTH, FOCAL]].tolist() == [CAMERA.x, CAMERA.y, CAMERA.depth, CAMERA.focal]
    assert packed[[CENTRE_X, CENTRE_Y]].tolist() == [159.5, 119.5]
    assert len(packed) == CENTRE_Y + 1


def test_parameters_by_name() -> None:
    changed = with_values(CAMERA, {"camera.depth": 2.0, "camera.yaw": 0.1})
    assert (changed.depth, changed.yaw, changed.x) == (2.0, 0.1, CAMERA.x)
    assert [value_of(changed, name) for name in ("camera.depth", "camera.yaw")] == [2.0, 0.1]
    assert all(hasattr(CAMERA, parameter.field) for parameter in PARAMETERS.values())


@pytest.mark.parametrize("turn", [{}, {"roll": 0.3}, {"pitch": -0.2, "yaw": 0.4, "roll": -0.1}])
def test_a_turned_camera_sees_turned_points_where_they_were(turn: dict[str, float]) -> None:
    camera = Camera(720, 480, 700.0, x=0.1, y=-0.2, depth=1.5, **turn)
    points, angle = np.random.default_rng(0).normal(size=(6, 3)) * 0.2, 0.7
    c, s = np.cos(angle), np.sin(angle)
    moved = points.copy()
    moved[:, :2] = points[:, :2] @ np.array([[c, s], [-s, c]])
    found = turned(camera, angle)
    np.testing.assert_allclose(pixels(found, moved), pixels(camera, points), atol=1e-9)
    if not turn:
        assert (found.roll, found.pitch, found.yaw) == pytest.approx((angle, 0.0, 0.0))


def test_a_view_of_nearly_everything_is_refused() -> None:
    check_view(72.0, 720, 480)
    with refuses(
        SettingsError,
        "camera.focal: expected at least 72 px in pictures of 720x480 px, got 71; give it in "
        "pixels of the clip.",
    ):
        check_view(71.0, 720, 480)
