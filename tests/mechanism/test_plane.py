"""The plane of motion: from hinges, slides and gravity."""

from pathlib import Path

import numpy as np
import pytest

from models import GEOM, HINGE, body_with, mjcf, read
from monodyn.errors import MechanismError
from monodyn.mechanism.tree import AXIS_X, AXIS_Y, COM_X, COM_Y
from support import refuses


@pytest.mark.parametrize(
    ("axis", "gravity", "point"),
    [
        # A box that reaches along the world's +x (or, hinged about x, along +z) as it lies in the plane.
        ("0 -1 0", "0 0 -9.81", (1, 0)),
        ("0 1 0", "0 0 -9.81", (-1, 0)),
        ("0 0 1", "0 -9.81 0", (1, 0)),
        ("0 0 1", "0 0 -9.81", (1, 0)),
        ("0 -1 0", "0 0 9.81", (-1, 0)),
        ("0 -1 0", "-9.81 0 0", (0, 1)),
        ("0 -1 0", "0 0 0", (1, 0)),
    ],
)
def test_the_plane_follows_hinge_and_gravity(tmp_path, axis: str, gravity: str, point: tuple) -> None:
    body = body_with(f'<joint axis="{axis}"/>')
    mechanism = read(tmp_path, mjcf(body, f'<option gravity="{gravity}"/>'))
    assert mechanism.tree.links[0, [COM_X, COM_Y]] == pytest.approx(0.05 * np.array(point), abs=1e-12)
    pull = 0.0 if gravity == "0 0 0" or (axis, gravity) == ("0 0 1", "0 0 -9.81") else -9.81
    assert mechanism.tree.gravity == pytest.approx([0.0, pull])


@pytest.mark.parametrize(
    ("axis", "direction"),
    [
        ("1 0 0", (1, 0)),
        ("-1 0 0", (-1, 0)),
        ("0 0 1", (0, 1)),
        ("1 0 1", (2**-0.5, 2**-0.5)),
        ("0 1 0", (1, 0)),
    ],
)
def test_slides_alone_are_seen_along_y(tmp_path, axis: str, direction: tuple) -> None:
    mechanism = read(tmp_path, mjcf(body_with(f'<joint type="slide" axis="{axis}"/>')))
    assert mechanism.tree.links[0, [AXIS_X, AXIS_Y]] == pytest.approx(direction, abs=1e-12)
    assert mechanism.tree.gravity == pytest.approx([0.0, -9.81])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            mjcf(body_with(HINGE, f'<body name="b"><joint name="j2" axis="0 -1 .1"/>{GEOM}</body>')),
            "m.xml: joint 'j2': expected a hinge axis parallel to that of 'j1', got 0 -0.995 0.0995 "
            "in the world; only planar mechanisms are supported, so make the axes parallel.",
        ),
        (
            mjcf(
                body_with(HINGE, f'<body name="b"><joint name="s" type="slide" axis="0 1 0"/>{GEOM}</body>')
            ),
            "m.xml: joint 's': expected a slide in the plane square to 0 -1 0, got axis 0 1 0 in the "
            "world; only planar mechanisms are supported, so turn it into the plane.",
        ),
    ],
)
def test_a_joint_that_leaves_the_plane_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with refuses(MechanismError, message):
        read(tmp_path, text)
