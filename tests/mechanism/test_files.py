"""The text of mechanism files and what they name: what is read, dropped and refused."""

from pathlib import Path

import pytest

from models import HINGE, SINGLE, URDF, mjcf, read
from monodyn.errors import MechanismError
from monodyn.mechanism import load
from support import refuses


def test_meshes_and_includes_of_the_folder_are_read(tmp_path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "tip.obj").write_text(PYRAMID)
    geom = '<geom type="mesh" mesh="tip"/></body>'
    (tmp_path / "body.xml").write_text(f'<mujocoinclude><body name="a">{HINGE}{geom}</mujocoinclude>')
    asset = '<compiler meshdir="parts"/><asset><mesh file="tip.obj"/></asset>'
    mechanism = read(tmp_path, mjcf('<include file="body.xml"/>', asset))
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


def ended(last: str) -> str:
    """Return the text of a pendulum with an element at its end."""
    return mjcf(SINGLE).replace("</mujoco>", f"{last}</mujoco>")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            ended('<equality><connect name="loop" body1="a" anchor="0 0 0"/></equality>'),
            "m.xml: equality <connect> 'loop': closed loops and coupled joints are not supported; remove it.",
        ),
        (
            ended('<equality><weld body1="a"/></equality>'),
            "m.xml: equality <weld> 'a': closed loops and coupled joints are not supported; remove it.",
        ),
        (
            ended('<tendon><fixed name="t"><joint joint="j1" coef="1"/></fixed></tendon>'),
            "m.xml: tendon 't': tendons are not supported; remove them.",
        ),
        (
            mjcf("<replicate count='100'><replicate count='11'>" + SINGLE + "</replicate></replicate>"),
            "m.xml: <replicate>: expected a count from 1 to 1000, got '11'; correct it.",
        ),
        (
            "<mujoco>" + "<body>" * 2000 + "</body>" * 2000 + "</mujoco>",
            "m.xml: expected at most 100 elements inside one another, got more; simplify the file.",
        ),
        (
            mjcf(SINGLE.replace('axis="0 -1 0"', 'axis="0 nan 0"')),
            "m.xml: <joint>: expected numbers in 'axis', got nan; correct it.",
        ),
        *(
            (
                mjcf(SINGLE.replace("<geom", f'<geom density="{nan}"')),
                "m.xml: <geom>: expected numbers in 'density', got nan; correct it.",
            )
            for nan in ("-nan", "+NaN", "nan(3)")
        ),
        (
            mjcf(SINGLE.replace("<geom", '<geom euler="inf 0 0"')),
            "m.xml: orientations: expected numbers up to 1e+09, got nan; correct it.",
        ),
        (
            mjcf(SINGLE, '<extension><plugin plugin="x"/></extension>'),
            "m.xml: <extension>: plugins are not supported; remove them.",
        ),
        (
            mjcf('<replicate count="1000000000">' + SINGLE + "</replicate>"),
            "m.xml: <replicate>: expected a count from 1 to 1000, got '1000000000'; correct it.",
        ),
        (
            mjcf(SINGLE, '<asset><hfield name="h" file="/etc/passwd"/></asset>'),
            "m.xml: <hfield>: height fields are not supported; remove them.",
        ),
        (
            "<sdf/>",
            "m.xml: expected the root element <mujoco> (MJCF) or <robot> (URDF), got <sdf>; give an "
            "MJCF or URDF file.",
        ),
        (
            "<mujoco>",
            "m.xml: expected MJCF or URDF text, got text that is not XML (no element found: line 1, "
            "column 8); correct the file.",
        ),
        (
            '<!DOCTYPE x [<!ENTITY a "b">]><mujoco/>',
            "m.xml: document types and entities are not supported; remove <!DOCTYPE>.",
        ),
        (
            f"<mujoco {' '.join(f'a{k}={chr(34)}{chr(34)}' for k in range(101))}/>",
            "m.xml: <mujoco>: expected at most 100 attributes, got 101; leave out what it does not need.",
        ),
        (
            mjcf(SINGLE + 5000 * '<site pos="0 0 0"/>'),
            "m.xml: expected at most 5000 elements, those of every <replicate> and <include> counted, got "
            "more; leave out what does not move.",
        ),
        (
            mjcf(f"<replicate count='900'>{6 * '<site/>'}</replicate>"),
            "m.xml: expected at most 5000 elements, those of every <replicate> and <include> counted, got "
            "more; leave out what does not move.",
        ),
    ],
)
def test_what_a_text_must_not_hold_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with refuses(MechanismError, message):
        read(tmp_path, text)


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
    with refuses(MechanismError, message):
        read(folder, mjcf(SINGLE, f"<asset>{asset}</asset>"))


def test_meshdir_does_not_lead_out_either(tmp_path) -> None:
    folder = tmp_path / "mechanism"
    folder.mkdir()
    (tmp_path / "secret.stl").write_text("solid")
    for compiler in ('<compiler meshdir=".."/>', f'<compiler assetdir="{tmp_path}"/>'):
        with pytest.raises(MechanismError, match="leads out of it"):
            read(folder, mjcf(SINGLE, compiler + '<asset><mesh file="secret.stl"/></asset>'))


def test_includes_do_not_lead_out_or_round_in_circles(tmp_path: Path) -> None:
    with refuses(
        MechanismError,
        "file '../other.xml': expected a file in the mechanism's own folder, got a path that leads out of "
        "it; copy the file there.",
    ):
        read(tmp_path, mjcf('<include file="../other.xml"/>'))
    with refuses(
        MechanismError,
        "include: expected at most 64 included files, got more; check for a file that includes itself.",
    ):
        read(tmp_path, mjcf('<include file="m.xml"/>'))


def test_includes_do_not_add_up_to_more_depth_than_one_file_may_have(tmp_path: Path) -> None:
    deep = "<body>" * 60, "</body>" * 60
    (tmp_path / "inner.xml").write_text(f"<mujocoinclude>{SINGLE.join(deep)}</mujocoinclude>")
    with refuses(
        MechanismError,
        "include: expected at most 100 elements inside one another, got more; simplify the files.",
    ):
        read(tmp_path, mjcf('<include file="inner.xml"/>'.join(deep)))


def test_files_too_big_or_unreadable_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "m.xml").write_text(mjcf(SINGLE))

    def deny(_: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "read_bytes", deny)
        with refuses(
            MechanismError,
            "m.xml: expected a readable file, got 'Permission denied'; check the path and its permissions.",
        ):
            load(tmp_path / "m.xml")
    with (tmp_path / "m.xml").open("ab") as file:
        file.truncate(20_000_000)  # a hole, which takes no room on the disk
    with refuses(MechanismError, "m.xml: expected at most 4 MB, got 20 MB; give a smaller file."):
        load(tmp_path / "m.xml")


def test_a_file_that_is_no_mesh_is_not_read(tmp_path: Path) -> None:
    with refuses(MechanismError, "m.xml: <model>: attached models are not supported; remove them."):
        read(tmp_path, mjcf(SINGLE, '<asset><model name="other" file="other.xml"/></asset>'))
    with refuses(MechanismError, "m.xml: <geom>: files are read for meshes only; remove it."):
        read(tmp_path, mjcf(SINGLE.replace("<geom ", '<geom file="other.xml" ')))


def test_urdf_mimic_and_package_paths(tmp_path: Path) -> None:
    with refuses(
        MechanismError,
        "m.xml: joint 'shoulder': mimic joints couple joints and are not supported; remove <mimic>.",
    ):
        read(tmp_path, URDF.format("").replace("</joint>", '<mimic joint="elbow"/></joint>', 1))
    mesh = '<geometry><mesh filename="package://arm/../../x.stl"/></geometry>'
    with refuses(
        MechanismError,
        "file 'package://arm/../../x.stl': expected a file in the mechanism's own folder, got a path that "
        "leads out of it; copy the file there.",
    ):
        read(tmp_path, URDF.format("").replace('<geometry><box size="0.2 0.01 0.03"/></geometry>', mesh))


def test_a_folder_and_a_picture_are_refused(tmp_path: Path) -> None:
    with refuses(MechanismError, f"{tmp_path.name}: expected a file, got a folder; check the path."):
        load(tmp_path)
    (tmp_path / "clip.mp4").write_bytes(bytes(range(256)))
    with refuses(
        MechanismError,
        "clip.mp4: expected MJCF or URDF text, got text that is not XML (not well-formed (invalid token): "
        "line 1, column 0); correct the file.",
    ):
        load(tmp_path / "clip.mp4")


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_a_joint_of_urdf_alone_is_refused_by_its_name(tmp_path: Path, kind: str) -> None:
    text = (
        f'<robot name="r"><link name="w"/><link name="a"/><joint name="j" type="{kind}">'
        '<parent link="w"/><child link="a"/></joint></robot>'
    )
    with refuses(
        MechanismError,
        "m.urdf: joint 'j': expected a revolute, continuous, prismatic or fixed joint, got a "
        f"{kind} one; replace it.",
    ):
        read(tmp_path, text, "m.urdf")


def test_what_is_dropped_does_not_count(tmp_path: Path) -> None:
    mechanism = read(tmp_path, mjcf(6000 * "<camera/>" + SINGLE + 6000 * "<light/>"))
    assert len(mechanism.joints) == 1
