"""What a compiled model may hold: every refusal."""

from pathlib import Path

import pytest

from models import HINGE, SINGLE, body_with, mjcf, read
from monodyn.errors import MechanismError
from monodyn.mechanism import load
from support import refuses

KNEE = '<joint name="j2" axis="0 -1 0"/>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            mjcf('<body name="a"><freejoint name="f"/><geom size=".1"/></body>'),
            "m.xml: joint 'f': expected a hinge or a slide, got a free joint; replace it.",
        ),
        (
            mjcf('<body name="a"><joint name="b" type="ball"/><geom size=".1"/></body>'),
            "m.xml: joint 'b': expected a hinge or a slide, got a ball joint; replace it.",
        ),
        (
            mjcf(""),
            "m.xml: expected at least one joint, got none; add a hinge or a slide.",
        ),
        (
            mjcf(body_with('<joint name="j1" axis="0 -1 0" damping="1 0 2"/>')),
            "m.xml: joint 'j1': expected linear and quadratic damping and linear stiffness, got higher "
            "terms; give one or two numbers of damping and one of stiffness.",
        ),
        (
            mjcf(SINGLE.replace('name="a"', 'name="a" gravcomp="1"')),
            "m.xml: body 'a': gravity compensation is not supported; remove gravcomp.",
        ),
        (
            mjcf(SINGLE, '<option viscosity="0.1"/>'),
            "m.xml: option: forces of a surrounding fluid are not supported; remove density and viscosity.",
        ),
        *(
            (
                mjcf(SINGLE, f'<custom><numeric name="j1.air" data="{data}"/></custom>'),
                "m.xml: custom numeric 'j1.air': expected one number from 0 to 1e+09, the drag of the "
                f"air on its link, got {data}; correct it.",
            )
            for data in ("-0.1", "1 2")
        ),
        *(
            (
                mjcf(SINGLE, f'<custom><numeric name="j1.lead" data="{data}"/></custom>'),
                "m.xml: custom numeric 'j1.lead': expected one number from 0 to 0.05, how far ahead of the "
                f"rate its dry friction turns [s], got {data}; correct it.",
            )
            for data in ("-0.1", "0.06")
        ),
        (
            mjcf(SINGLE, '<option gravity="0 0 1e300"/>'),
            "m.xml: gravity: expected numbers up to 1e+09, got 1e+300; correct it.",
        ),
        (
            mjcf(SINGLE.replace('axis="0 -1 0"', 'axis="0 1e308 0"')),
            "m.xml: joint 'j1': expected an axis with a direction, got one without; correct it.",
        ),
        (
            mjcf(SINGLE.replace('axis="0 -1 0"', 'axis="0 -1 0" damping="0.1 -0.1"')),
            "m.xml: joints: expected damping and stiffness not below 0, got a negative one; correct it.",
        ),
        (
            mjcf(SINGLE.replace('axis="0 -1 0"', 'axis="0 -1 0" damping="-0.1"')),
            "m.xml: joints: expected damping and stiffness not below 0, got a negative one; correct it.",
        ),
    ],
)
def test_what_the_dynamics_do_not_know_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with refuses(MechanismError, message):
        read(tmp_path, text)


@pytest.mark.parametrize("name", ["time", "frame", "seen", "record"])
def test_a_joint_is_not_named_after_a_column(tmp_path: Path, name: str) -> None:
    with refuses(
        MechanismError,
        f"m.xml: joint '{name}': expected a name other than time, frame, seen, record, which are columns "
        "of the tables of positions; rename it.",
    ):
        read(tmp_path, mjcf(body_with(f'<joint name="{name}" axis="0 1 0"/>')))


@pytest.mark.parametrize("ending", ["_vel", "_std", "_vel_std", "_seen", "_excluded", "_torque"])
def test_a_joint_is_not_named_after_a_column_of_another_one(tmp_path: Path, ending: str) -> None:
    second = body_with(f'<joint name="q{ending}" axis="0 1 0"/>', name="b")
    with refuses(
        MechanismError,
        f"m.xml: joint 'q{ending}': expected a name that is not that of a column of joint 'q' in the tables "
        "(q_vel, q_std, q_vel_std, q_seen, q_excluded, q_torque); rename it.",
    ):
        read(tmp_path, mjcf(body_with('<joint name="q" axis="0 1 0"/>', second)))


def test_an_equality_that_is_switched_off_is_refused_too(tmp_path: Path) -> None:
    loop = '<equality><connect body1="a" anchor="0 0 0" active="false"/></equality></mujoco>'
    with refuses(
        MechanismError,
        "m.xml: closed loops and coupled joints are not supported; remove equality and tendon.",
    ):
        read(tmp_path, mjcf(SINGLE).replace("</mujoco>", loop))


def test_more_than_can_be_searched_is_refused(tmp_path) -> None:
    body = '<body><joint type="hinge" axis="0 -1 0"/><geom size=".1"/></body>'
    with refuses(MechanismError, "m.xml: expected at most 30 joints, got 31; leave out what does not move."):
        read(tmp_path, mjcf(31 * body))


def test_hinges_of_a_chain_that_turn_about_one_axis_are_refused(tmp_path: Path) -> None:
    with refuses(
        MechanismError,
        "m.xml: joints 'j1', 'j2': expected hinges in different places, got two that turn about the same "
        "axis; give 'b' a pos, where its hinge is on 'a'; what turns about one axle hangs from the same "
        "body.",
    ):
        read(tmp_path, mjcf(body_with(HINGE, body_with(KNEE, name="b"))))
    with refuses(
        MechanismError,
        "m.xml: joints 'j1', 'j2': expected hinges in different places, got two that turn about the same "
        "axis; only their sum shows, leave one out.",
    ):
        read(tmp_path, mjcf(body_with(HINGE + KNEE)))


@pytest.mark.parametrize(
    "body",
    [
        body_with('<joint name="s" type="slide" axis="1 0 0"/><joint name="h" axis="0 -1 0"/>'),
        body_with('<joint name="s" type="slide" axis="1 0 0"/>', body_with(HINGE, name="b")),
        body_with(HINGE, body_with('<joint name="s" type="slide" axis="1 0 0"/>', name="b")),
        body_with(HINGE) + body_with(KNEE, name="b"),
        body_with(HINGE, body_with('<joint name="j2" axis="0 -1 0" pos="0.001 0 0"/>', name="b")),
        # a hinge on an arm that is welded to the body of the one above
        body_with(HINGE, f'<body pos="0.1 0 0">{body_with(KNEE, name="b")}</body>'),
    ],
)
def test_other_joints_in_one_place_are_read(tmp_path: Path, body: str) -> None:
    assert len(read(tmp_path, mjcf(body)).joints) == 2


@pytest.mark.parametrize("name", ["single", "double", "triple", "bob", "cartpole", "chain:5"])
def test_bundled_models_are_read(name: str) -> None:
    assert load(name).joints
