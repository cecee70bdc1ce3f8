"""Reading mechanism files: what they become, and every refusal."""

from pathlib import Path

import numpy as np
import pytest

from monodyn.errors import MechanismError
from monodyn.mechanism import Mechanism, load

GEOM = '<geom type="box" size="0.05 0.0025 0.01" pos="0.05 0 0"/>'


def _mjcf(body: str, before: str = '<option gravity="0 0 -9.81"/>') -> str:
    return f"<mujoco>{before}<worldbody>{body}</worldbody></mujoco>"


def _body(joint: str, inner: str = "", name: str = "a") -> str:
    return f'<body name="{name}">{joint}{GEOM}{inner}</body>'


HINGE = '<joint name="j1" axis="0 -1 0"/>'
SINGLE = _body(HINGE)


def _load(tmp_path: Path, text: str, name: str = "m.xml") -> Mechanism:
    (tmp_path / name).write_text(text)
    return load(tmp_path / name)


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
    body = _body(f'<joint axis="{axis}"/>')
    mechanism = _load(tmp_path, _mjcf(body, f'<option gravity="{gravity}"/>'))
    assert mechanism.tree.links[0, 6:8] == pytest.approx(0.05 * np.array(point), abs=1e-12)
    pull = 0.0 if gravity == "0 0 0" or (axis, gravity) == ("0 0 1", "0 0 -9.81") else -9.81
    assert mechanism.tree.gravity == pytest.approx([0.0, pull])


def test_the_gravity_switch_counts(tmp_path) -> None:
    mechanism = _load(tmp_path, _mjcf(SINGLE, '<option><flag gravity="disable"/></option>'))
    assert mechanism.values["gravity"] == 0.0


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
    mechanism = _load(tmp_path, _mjcf(_body(f'<joint type="slide" axis="{axis}"/>')))
    assert mechanism.tree.links[0, 3:5] == pytest.approx(direction, abs=1e-12)
    assert mechanism.tree.gravity == pytest.approx([0.0, -9.81])


def test_order_sign_limits_and_names(tmp_path) -> None:
    second = (
        '<body pos=".1 -.01 0" name="b"><joint axis="0 1 0" range="-90 45" damping=".02" frictionloss=".03" '
        f'stiffness=".04" springref="10" armature=".05"/>{GEOM}</body>'
    )
    mechanism = _load(tmp_path, _mjcf(f"<body>{HINGE}{GEOM}{second}</body>"))
    assert [j.name for j in mechanism.joints] == ["j1", "joint2"]
    assert mechanism.bodies == ("body1", "b")
    joint = mechanism.joints[1]
    assert (joint.lower, joint.upper, joint.sign) == pytest.approx((-np.pi / 2, np.pi / 4, -1))
    assert mechanism.tree.links[1, [3, 9, 10, 11, 12, 13]] == pytest.approx(
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
    mechanism = _load(tmp_path, _mjcf(stand + _body(HINGE, fixed)))
    assert mechanism.bodies == ("a",)
    assert mechanism.shapes.body == ("a", "tool")
    assert mechanism.shapes.points[-1] == pytest.approx((0.08, 0, 0))
    assert "tool.width" in mechanism.values


URDF = """<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.1 0 0"/><mass value="0.3"/>
<inertia ixx="1e-3" iyy="2e-3" izz="2e-3" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><origin xyz="0.1 0 0"/><geometry><box size="0.2 0.01 0.03"/></geometry><material name="red"/></visual>
<collision><origin xyz="0.1 0 0"/><geometry><box size="0.3 0.05 0.05"/></geometry></collision></link>
<link name="lower"><visual><origin xyz="0 0 -0.1"/>
<geometry><cylinder radius="0.01" length="0.2"/></geometry></visual>
</link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 -1 0"/>
<limit lower="-1" upper="2" effort="1" velocity="1"/><dynamics damping="0.01" friction="0.02"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><origin xyz="0.2 -0.02 0"/>
<axis xyz="0 -1 0"/></joint>{}</robot>"""


def test_urdf(tmp_path) -> None:
    with pytest.raises(MechanismError, match="mjMINVAL"):
        # MuJoCo gives visual geometry no mass.
        _load(tmp_path, URDF.format(""))
    text = URDF.format("").replace(
        '<link name="lower">',
        '<link name="lower"><inertial><origin xyz="0 0 -0.1"/><mass value="0.1"/>'
        '<inertia ixx="1e-4" iyy="1e-4" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial>',
    )
    mechanism = _load(tmp_path, text)
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
    assert mechanism.tree.links[0, 9:11].tolist() == [0.01, 0.02]


def test_meshes_and_includes_of_the_folder_are_read(tmp_path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "tip.obj").write_text(PYRAMID)
    geom = '<geom type="mesh" mesh="tip"/></body>'
    (tmp_path / "body.xml").write_text(f'<mujocoinclude><body name="a">{HINGE}{geom}</mujocoinclude>')
    asset = '<compiler meshdir="parts"/><asset><mesh file="tip.obj"/></asset>'
    mechanism = _load(tmp_path, _mjcf('<include file="body.xml"/>', asset))
    # The corners of a mesh are single precision in MuJoCo.
    assert mechanism.values["a.length"] == pytest.approx(0.1, rel=1e-6)


PYRAMID = """v 0 -.01 -.01
v 0 .01 -.01
v 0 .01 .01
v 0 -.01 .01
v .1 0 0
f 1 3 2
f 1 4 3
f 1 2 5
f 2 3 5
f 3 4 5
f 4 1 5
"""

WHERE = "m.xml: "
NAMES = "'single', 'double', 'triple', 'bob', 'cartpole', 'chain:N'"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            _mjcf('<body name="a"><freejoint name="f"/><geom size=".1"/></body>'),
            "joint 'f': expected a hinge or a slide, got a free joint; replace it.",
        ),
        (
            _mjcf('<body name="a"><joint name="b" type="ball"/><geom size=".1"/></body>'),
            "joint 'b': expected a hinge or a slide, got a ball joint; replace it.",
        ),
        (
            _mjcf(_body(HINGE, f'<body name="b"><joint name="j2" axis="0 -1 .1"/>{GEOM}</body>')),
            "joint 'j2': expected a hinge axis parallel to that of 'j1', got 0 -0.995 0.0995 in the world; "
            "only "
            "planar mechanisms are supported, so make the axes parallel.",
        ),
        (
            _mjcf(_body(HINGE, f'<body name="b"><joint name="s" type="slide" axis="0 1 0"/>{GEOM}</body>')),
            "joint 's': expected a slide in the plane square to 0 -1 0, got axis 0 1 0 in the world; only "
            "planar "
            "mechanisms are supported, so turn it into the plane.",
        ),
        (
            _mjcf(SINGLE).replace(
                "</mujoco>", '<equality><connect name="loop" body1="a" anchor="0 0 0"/></equality></mujoco>'
            ),
            "equality <connect> 'loop': closed loops and coupled joints are not supported; remove it.",
        ),
        (
            _mjcf(SINGLE).replace("</mujoco>", '<equality><weld body1="a"/></equality></mujoco>'),
            "equality <weld> 'a': closed loops and coupled joints are not supported; remove it.",
        ),
        (
            _mjcf(SINGLE).replace(
                "</mujoco>", '<tendon><fixed name="t"><joint joint="j1" coef="1"/></fixed></tendon></mujoco>'
            ),
            "tendon 't': tendons are not supported; remove them.",
        ),
        (_mjcf(""), "expected at least one joint, got none; add a hinge or a slide."),
        (
            _mjcf(_body('<joint name="j1" axis="0 -1 0" damping="1 2 0"/>')),
            "joint 'j1': expected linear damping and stiffness, got higher terms; give one number each.",
        ),
        (
            _mjcf(SINGLE.replace('name="a"', 'name="a" gravcomp="1"')),
            "body 'a': gravity compensation is not supported; remove gravcomp.",
        ),
        (
            _mjcf(SINGLE, '<option viscosity="0.1"/>'),
            "option: forces of a surrounding fluid are not supported; remove density and viscosity.",
        ),
        (
            _mjcf(SINGLE, '<compiler settotalmass="7"/>'),
            "body 'a': expected the mass and inertia of solid convex geoms (0.01 kg, 8.66667e-06 kg m^2), "
            "got 7 kg, "
            "0.00606667 kg m^2 by the file's settings; state them with <inertial>.",
        ),
        (
            _mjcf("<replicate count='100'><replicate count='11'>" + SINGLE + "</replicate></replicate>"),
            "<replicate>: expected a count from 1 to 1000, got '11'; correct it.",
        ),
        (
            "<mujoco>" + "<body>" * 2000 + "</body>" * 2000 + "</mujoco>",
            "expected at most 100 elements inside one another, got more; simplify the file.",
        ),
        (
            _mjcf(SINGLE, '<option gravity="0 0 1e300"/>'),
            "gravity: expected numbers up to 1e+09, got 1e+300; correct it.",
        ),
        (
            _mjcf(SINGLE.replace('axis="0 -1 0"', 'axis="0 1e308 0"')),
            "joint 'j1': expected an axis with a direction, got one without; correct it.",
        ),
        (
            _mjcf(SINGLE.replace('axis="0 -1 0"', 'axis="0 nan 0"')),
            "<joint>: expected numbers in 'axis', got nan; correct it.",
        ),
        (
            _mjcf(SINGLE.replace('axis="0 -1 0"', 'axis="0 -1 0" damping="-0.1"')),
            "joints: expected damping and stiffness not below 0, got a negative one; correct it.",
        ),
        (
            _mjcf(SINGLE, '<extension><plugin plugin="x"/></extension>'),
            "<extension>: plugins are not supported; remove them.",
        ),
        (
            _mjcf('<replicate count="1000000000">' + SINGLE + "</replicate>"),
            "<replicate>: expected a count from 1 to 1000, got '1000000000'; correct it.",
        ),
        (
            _mjcf(SINGLE, '<asset><hfield name="h" file="/etc/passwd"/></asset>'),
            "<hfield>: height fields are not supported; remove them.",
        ),
        (
            "<sdf/>",
            "expected the root element <mujoco> (MJCF) or <robot> (URDF), got <sdf>; give an MJCF or URDF "
            "file.",
        ),
        (
            "<mujoco>",
            "expected MJCF or URDF text, got text that is not XML (no element found: line 1, column 8); "
            "correct the "
            "file.",
        ),
        (
            '<!DOCTYPE x [<!ENTITY a "b">]><mujoco/>',
            "document types and entities are not supported; remove <!DOCTYPE>.",
        ),
        (
            _mjcf("<bodi/>"),
            "MuJoCo cannot read it (XML Error: Schema violation: unrecognized element Element 'bodi', line "
            "1); "
            "correct the file.",
        ),
    ],
)
def test_refusals_of_files(tmp_path, text: str, message: str) -> None:
    with pytest.raises(MechanismError) as caught:
        _load(tmp_path, text)
    assert str(caught.value) == WHERE + message


@pytest.mark.parametrize(
    ("asset", "message"),
    [
        (
            '<mesh name="m" file="../secret.stl"/>',
            "file '../secret.stl': expected a file in the mechanism's own folder, got a path that leads out "
            "of it; "
            "copy the file there.",
        ),
        (
            '<mesh name="m" file="/etc/passwd"/>',
            "file '/etc/passwd': expected a file in the mechanism's own folder, got a path that leads out "
            "of it; "
            "copy the file there.",
        ),
        (
            '<mesh name="m" file="none.stl"/>',
            "mesh 'none.stl': expected a file, got no such file; check the path.",
        ),
        (
            '<mesh name="m" file="link.stl"/>',
            "file 'link.stl': expected a file in the mechanism's own folder, got a path that leads out of "
            "it; "
            "copy the file there.",
        ),
    ],
)
def test_files_outside_the_folder_are_not_read(tmp_path, asset: str, message: str) -> None:
    folder = tmp_path / "mechanism"
    folder.mkdir()
    (tmp_path / "secret.stl").write_text("solid")
    (folder / "link.stl").symlink_to(tmp_path / "secret.stl")
    with pytest.raises(MechanismError) as caught:
        _load(folder, _mjcf(SINGLE, f"<asset>{asset}</asset>"))
    assert str(caught.value).endswith(message)


def test_meshdir_does_not_lead_out_either(tmp_path) -> None:
    folder = tmp_path / "mechanism"
    folder.mkdir()
    (tmp_path / "secret.stl").write_text("solid")
    for compiler in ('<compiler meshdir=".."/>', f'<compiler assetdir="{tmp_path}"/>'):
        with pytest.raises(MechanismError, match="leads out of it"):
            _load(folder, _mjcf(SINGLE, compiler + '<asset><mesh file="secret.stl"/></asset>'))


def test_includes_do_not_lead_out_or_round_in_circles(tmp_path) -> None:
    with pytest.raises(MechanismError) as caught:
        _load(tmp_path, _mjcf('<include file="../other.xml"/>'))
    assert str(caught.value) == (
        "file '../other.xml': expected a file in the mechanism's own folder, got a path that leads out of "
        "it; copy "
        "the file there."
    )
    with pytest.raises(MechanismError) as caught:
        _load(tmp_path, _mjcf('<include file="m.xml"/>'))
    assert str(caught.value) == (
        "include: expected at most 64 included files, got more; check for a file that includes itself."
    )


def test_urdf_mimic_and_package_paths(tmp_path) -> None:
    with pytest.raises(MechanismError) as caught:
        _load(tmp_path, URDF.format("").replace("</joint>", '<mimic joint="elbow"/></joint>', 1), "m.xml")
    assert str(caught.value) == (
        "m.xml: joint 'shoulder': mimic joints couple joints and are not supported; remove <mimic>."
    )
    mesh = '<geometry><mesh filename="package://arm/../../x.stl"/></geometry>'
    with pytest.raises(MechanismError) as caught:
        _load(
            tmp_path,
            URDF.format("").replace('<geometry><box size="0.2 0.01 0.03"/></geometry>', mesh),
            "m.xml",
        )
    assert str(caught.value) == (
        "file 'package://arm/../../x.stl': expected a file in the mechanism's own folder, got a path that "
        "leads out "
        "of it; copy the file there."
    )


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (
            "quadruple",
            f"mechanism 'quadruple': expected an MJCF or URDF file or a bundled name, got no such file; "
            f"bundled "
            f"names: {NAMES}.",
        ),
        ("chain:0", "mechanism 'chain:0': expected 1 to 10 links, got '0'; write for example 'chain:4'."),
        ("chain:11", "mechanism 'chain:11': expected 1 to 10 links, got '11'; write for example 'chain:4'."),
        (
            "chain:two",
            "mechanism 'chain:two': expected 1 to 10 links, got 'two'; write for example 'chain:4'.",
        ),
    ],
)
def test_refusals_of_names(source: str, message: str) -> None:
    with pytest.raises(MechanismError) as caught:
        load(source)
    assert str(caught.value) == message


def test_two_parts_of_one_name_are_refused(tmp_path) -> None:
    # The second geom of body 'a' is called 'b', and so is the body 'a.b'.
    second = '<geom name="b" size=".01"/>' + _body('<joint name="j2" axis="0 -1 0"/>', name="a.b")
    with pytest.raises(MechanismError) as caught:
        _load(tmp_path, _mjcf(_body(HINGE, second)))
    assert str(caught.value) == (
        "parameter 'a.b.width': expected one part of that name, got two; rename a body, geom or joint."
    )


def test_a_folder_and_a_picture_are_refused(tmp_path) -> None:
    with pytest.raises(MechanismError) as caught:
        load(tmp_path)
    assert str(caught.value) == f"{tmp_path.name}: expected a file, got a folder; check the path."
    (tmp_path / "clip.mp4").write_bytes(bytes(range(256)))
    with pytest.raises(MechanismError, match="text that is not XML"):
        load(tmp_path / "clip.mp4")


@pytest.mark.parametrize("name", ["time", "frame", "seen"])
def test_a_joint_is_not_named_after_a_column(tmp_path: Path, name: str) -> None:
    path = tmp_path / "model.xml"
    path.write_text(
        f'<mujoco><worldbody><body><joint name="{name}" axis="0 1 0"/><geom size="0.1"/>'
        "</body></worldbody></mujoco>",
        encoding="utf-8",
    )
    with pytest.raises(MechanismError, match=f"joint '{name}': expected a name other than time, frame, seen"):
        load(path)


def test_a_floating_joint_is_named(tmp_path: Path) -> None:
    path = tmp_path / "model.urdf"
    path.write_text(
        '<robot name="r"><link name="w"/><link name="a"/><joint name="j" type="floating">'
        '<parent link="w"/><child link="a"/></joint></robot>',
        encoding="utf-8",
    )
    with pytest.raises(MechanismError, match=r"joint 'j': .*, got a floating one"):
        load(path)
