"""Every parameter of a joint, from file to derivative: a step that is forgotten for a new one fails here."""

from pathlib import Path

import numpy as np
import pytest
from zoo import ZOO

from monodyn.mechanism import Mechanism, load, write_mjcf, write_urdf
from monodyn.mechanism.dimensions import DIMENSIONS, SLIDE_DIMENSIONS
from monodyn.mechanism.plan import JOINT, JOINT_COLUMNS
from monodyn.mechanism.simulate import accelerations, rollout, rollout_derivatives, rollouts_derivatives
from monodyn.mechanism.tree import ARMATURE, COLUMNS, DAMPING, LEAD, PASSIVE, REST
from monodyn.mechanism.urdf import NOT_IN_URDF

VALUE, WITH = 0.0123, {"rest": {"stiffness": 0.2}, "lead": {"friction": 0.2}}
STATE = np.array([[0.3, -0.4]]), np.array([[1.7, -2.1]])
"""A slide and a hinge off their rest, moving up and down: no term is zero, rates have both signs."""
NEAR_REST = np.array([[0.3, -0.4]]), np.array([[1.7e-3, -2.1e-3]])
"""The same where dry friction changes its sign: elsewhere it makes no difference when it does."""


def state(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and rates at which a term acts."""
    return NEAR_REST if kind == "lead" else STATE


def cartpole(kind: str = "", value: float = VALUE) -> Mechanism:
    """Return a cart and a pendulum whose joints have one term alone; a rest has a spring to it, and a lead
    the friction that leads."""
    mechanism, other = load("cartpole"), WITH.get(kind, {})
    terms = dict.fromkeys(JOINT, 0.0) | other | ({kind: value} if kind else {})
    return mechanism.with_values({f"{j.name}.{k}": v for j in mechanism.joints for k, v in terms.items()})


def test_every_column_of_a_joint_is_a_parameter() -> None:
    assert sorted(JOINT_COLUMNS) == list(range(DAMPING, COLUMNS))
    assert set(PASSIVE) == {*JOINT_COLUMNS} - {ARMATURE, REST, LEAD}


@pytest.mark.parametrize("kind", JOINT)
def test_a_term_stands_in_its_column_and_has_dimensions(kind: str) -> None:
    assert (cartpole(kind).tree.links[:, JOINT[kind].column] == VALUE).all()
    assert kind in DIMENSIONS
    assert kind in SLIDE_DIMENSIONS


@pytest.mark.parametrize("kind", JOINT)
def test_a_term_acts_on_the_motion_of_both_joints(kind: str) -> None:
    bare, none = cartpole(kind, 0.0), np.zeros((1, 2))
    for i in range(2):
        tree = bare.with_values({f"{bare.joints[i].name}.{kind}": VALUE}).tree
        change = accelerations(tree, *state(kind), none) - accelerations(bare.tree, *state(kind), none)
        assert np.abs(change).max() > 1e-4


@pytest.mark.parametrize("kind", JOINT)
@pytest.mark.parametrize("value", [0.0, VALUE])
def test_the_derivative_by_a_term_is_that_of_the_complex_step(kind: str, value: float) -> None:
    mechanism = cartpole(kind, value)
    names = [f"{j.name}.{kind}" for j in mechanism.joints]
    directions, times = mechanism.directions(names), np.linspace(0.0, 0.1, 4)
    q0, v0 = state(kind)[0][0], state(kind)[1][0]
    _, _, dq, _ = rollout_derivatives(mechanism.tree, directions, times, q0, v0, substeps=2)
    for k in range(2):
        stepped = mechanism.tree.along(directions, k, 1e-30j)
        theirs = rollout(stepped, times, q0, v0, substeps=2)[0].imag / 1e-30
        assert np.abs(theirs).max() > 1e-9
        # both are exact derivatives: rounding
        np.testing.assert_allclose(dq[:, :, k], theirs, rtol=1e-9, atol=1e-12 * np.abs(theirs).max())


@pytest.mark.parametrize("kind", JOINT)
def test_where_a_term_jumps_a_search_takes_the_derivatives_of_the_rollout(kind: str) -> None:
    """Of what is smooth the derivatives of the motion are as good, however far off they may be; the second
    joint turns round here, under friction both do."""
    mechanism, times = cartpole(kind), np.linspace(0.0, 1.0, 31)
    directions = mechanism.directions([f"{j.name}.{kind}" for j in mechanism.joints])
    first, start = np.array([0, 31]), np.array([[0.1, 0.5, 0.3, 1.0]])
    exact, found = (
        rollouts_derivatives(mechanism.tree, directions, times, first, start, substeps=16, most_off=most_off)[
            2
        ]
        for most_off in (0.0, np.inf)
    )
    assert np.abs(found - exact).max() < 1e-3 * np.abs(exact).max()


@pytest.mark.parametrize("kind", JOINT)
def test_the_derivative_by_the_state_knows_a_term(kind: str) -> None:
    mechanism, step = cartpole(kind), 1e-30j
    times, q0, v0 = np.linspace(0.0, 0.1, 4), state(kind)[0][0], state(kind)[1][0]
    tree = mechanism.tree
    _, _, dq, _ = rollout_derivatives(tree, mechanism.directions([]), times, q0, v0, substeps=2)
    moving = tree.along(mechanism.directions(["time_scale"]), 0, 0j)  # the same tree, complex
    for i in range(2):
        ahead = v0 + step * np.eye(2)[i]
        theirs = rollout(moving, times, q0 + 0j, ahead, substeps=2)[0].imag / 1e-30
        np.testing.assert_allclose(dq[:, :, 2 + i], theirs, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("kind", JOINT)
def test_a_term_is_written_and_read(kind: str, tmp_path: Path) -> None:
    mechanism, column = cartpole(kind), JOINT[kind].column
    write_mjcf(mechanism, tmp_path / "m.xml")
    assert load(tmp_path / "m.xml").tree.links[:, column].tolist() == [VALUE, VALUE]
    write_urdf(mechanism, tmp_path / "m.urdf")
    if kind == "rest":
        text = (tmp_path / "m.urdf").read_text()
        assert f"about {VALUE:g} rad" in text
        assert f"about {VALUE:g} m" in text
    elif kind in NOT_IN_URDF:
        assert f"not in URDF: {kind} {VALUE:g} " in (tmp_path / "m.urdf").read_text()
    else:
        assert load(tmp_path / "m.urdf").tree.links[:, column].tolist() == [VALUE, VALUE]


@pytest.mark.parametrize("kind", JOINT)
def test_what_a_file_has_of_a_term_begins_the_fit(kind: str, tmp_path: Path) -> None:
    write_mjcf(cartpole(kind), tmp_path / "m.xml")
    mechanism = load(tmp_path / "m.xml")
    for joint in mechanism.joints:
        parameter = mechanism.parameter(f"{joint.name}.{kind}")
        assert (parameter.value, parameter.kind, parameter.owner) == (VALUE, kind, joint.name)
        # a hinge's spring is slack within two turns
        within = 4.0 * np.pi if joint.kind == "hinge" else np.inf
        assert parameter.lower == (-within if kind == "rest" else 0.0)
        assert parameter.free == (kind not in ("armature", "rest", "lead"))


def test_the_zoo_has_no_drag_unless_it_says_so(tmp_path: Path) -> None:
    (tmp_path / "m.xml").write_text(ZOO["chain"])
    for parameter in load(tmp_path / "m.xml").parameters:
        assert parameter.kind != "drag" or (parameter.value, parameter.free) == (0.0, False)


def test_where_a_spring_would_be_slack_is_written_without_one(tmp_path: Path) -> None:
    write_mjcf(cartpole().with_values({"joint1.rest": 0.4}), tmp_path / "m.xml")
    assert load(tmp_path / "m.xml").values["joint1.rest"] == 0.4
