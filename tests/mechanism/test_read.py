"""Reading mechanism files: what they become."""

from pathlib import Path

import numpy as np
import pytest

from models import GEOM, HINGE, SINGLE, URDF, body_with, mjcf, read
from monodyn.errors import MechanismError
from monodyn.mechanism.tree import ARMATURE, AXIS_X, DAMPING, FRICTION, REST, STIFFNESS
from support import refuses


def test_the_gravity_switch_counts(tmp_path) -> None:
    mechanism = read(tmp_path, mjcf(SINGLE, '<option><flag gravity="disable"/></option>'))
    assert mechanism.values["gravity"] == 0.0


def test_order_sign_limits_and_names(tmp_path) -> None:
    second = (
        '<body pos=".1 -.01 0" name="b"><joint axis="0 1 0" range="-90 45" damping=".02" frictionloss=".03" '
        f'stiffness=".04" springref="10" armature=".05"/>{GEOM}</body>'
    )
    mechanism = read(tmp_path, mjcf(f"<body>{HINGE}{GEOM}{second}</body>"))
    assert [j.name for j in mechanism.joints] == ["j1", "joint2"]
    assert mechanism.bodies == ("body1", "b")
    joint = mechanism.joints[1]
    assert (joint.lower, joint.upper, joint.sign) == pytest.approx((-np.pi / 2, np.pi / 4, -1))
    assert mechanism.tree.links[1, [AXIS_X, DAMPING, FRICTION, STIFFNESS, REST, ARMATURE]] == pytest.approx(
        [-1, 0.02, 0.03, 0.04, np.deg2rad(10), 0.05]
    )
    free = {p.name for p in mechanism.parameters if p.free}
    assert {"joint2.damping", "joint2.friction", "joint2.stiffness", "b.offset"} <= free
    assert "j1.friction" not in free
    # A file without damping gets a start value.
    assert mechanism.values["j1.damping"] == 1e-3


def test_fixed_bodies_join_their_parent_and_the_background_is_left_out(tmp_path) -> None:
    fixed = '<body name="tool" pos=".08 0 0"><geom type="sphere" size=".01"/></body>'
    stand = '<body name="stand"><geom type="box" size="1 1 1"/></body><geom type="plane" size="1 1 1"/>'
    mechanism = read(tmp_path, mjcf(stand + body_with(HINGE, fixed)))
    assert mechanism.bodies == ("a",)
    assert mechanism.shapes.body == ("a", "tool")
    assert mechanism.shapes.points[-1] == pytest.approx((0.08, 0, 0))
    assert "tool.width" in mechanism.values


def test_urdf(tmp_path) -> None:
    with pytest.raises(MechanismError, match="mjMINVAL"):
        # MuJoCo gives visual geometry no mass.
        read(tmp_path, URDF.format(""))
    text = URDF.format("").replace(
        '<link name="lower">',
        '<link name="lower"><inertial><origin xyz="0 0 -0.1"/><mass value="0.1"/>'
        '<inertia ixx="1e-4" iyy="1e-4" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial>',
    )
    mechanism = read(tmp_path, text)
    assert mechanism.name == "arm"
    assert [(j.name, j.body, j.lower) for j in mechanism.joints] == [
        ("shoulder", "upper", -1.0),
        ("elbow", "lower", -np.inf),
    ]
    value = mechanism.values
    assert value["upper.mass"] == 0.3
    assert value["upper.inertia"] == pytest.approx(2e-3)
    assert value["upper.width"] == pytest.approx(0.03)
    assert value["upper.length"] == pytest.approx(0.2)
    assert value["lower.length"] == pytest.approx(0.2)
    assert value["lower.width"] == pytest.approx(0.02)
    # Of visual and collision geometry only what can be seen is drawn.
    assert mechanism.shapes.body == ("upper", "lower")
    assert mechanism.tree.links[0, [DAMPING, FRICTION]].tolist() == [0.01, 0.02]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            mjcf(SINGLE, '<compiler settotalmass="7"/>'),
            "m.xml: body 'a': expected the mass and inertia of solid convex geoms (0.01 kg, "
            "8.66667e-06 kg m^2), got 7 kg, 0.00606667 kg m^2 by the file's settings; state them "
            "with <inertial>.",
        ),
        (
            mjcf("<bodi/>"),
            "m.xml: MuJoCo cannot read it (XML Error: Schema violation: unrecognized element Element "
            "'bodi', line 1); correct the file.",
        ),
    ],
)
def test_what_mujoco_makes_otherwise_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with refuses(MechanismError, message):
        read(tmp_path, text)


def test_two_parts_of_one_name_are_refused(tmp_path) -> None:
    # The second geom of body 'a' is called 'b', and so is the body 'a.b'.
    second = '<geom name="b" size=".01"/>' + body_with(
        '<joint name="j2" axis="0 -1 0" pos="0.1 0 0"/>', name="a.b"
    )
    with pytest.raises(MechanismError) as caught:
        read(tmp_path, mjcf(body_with(HINGE, second)))
    assert str(caught.value) == (
        "parameter 'a.b.width': expected one part of that name, got two; rename a body, geom or joint."
    )


def test_geoms_without_an_outline_are_refused(tmp_path: Path) -> None:
    ball = '<asset><mesh name="m" builtin="sphere" params="1"/></asset>'
    with refuses(
        MechanismError,
        "m.xml: body 'a': expected geoms that are box, capsule, cylinder, sphere, ellipsoid or mesh, got "
        "type 'sdf'; replace it.",
    ):
        read(tmp_path, mjcf(body_with(HINGE, '<geom type="sdf" mesh="m"/>'), ball))
