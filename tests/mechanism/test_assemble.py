"""Masses and inertias of solids against those that MuJoCo compiles, and their derivatives."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from models import mjcf, read
from monodyn.arrays import plain
from monodyn.mechanism.assemble import derivatives, links_of
from monodyn.mechanism.assembled import links_of_many, over
from monodyn.mechanism.tree import COM_X, COM_Y, INERTIA, MASS

SOLIDS = {
    "box": '<geom type="box" size="0.05 0.003 0.01" pos="0.05 0 0.002" density="2700"/>',
    "turned box": '<geom type="box" size="0.05 0.003 0.01" pos="0.05 0 0" euler="0 30 0" mass="0.2"/>',
    "cylinder along": '<geom type="cylinder" size="0.008" fromto="0 0 0 0.1 0 0.03" density="1200"/>',
    "cylinder across": '<geom type="cylinder" size="0.02 0.004" pos="0.05 0 0" euler="90 0 0"/>',
    "capsule along": '<geom type="capsule" size="0.006" fromto="-0.02 0 0 0.09 0 0.03" density="2700"/>',
    "capsule askew": '<geom type="capsule" size="0.01" fromto="0 -0.02 0 0.15 0.03 0" mass="0.3"/>',
    "sphere": '<geom type="sphere" size="0.015" pos="0.1 0 -0.01" density="3000"/>',
    "two parts": '<geom type="box" size="0.05 0.003 0.01" pos="0.05 0 0" density="2700"/>'
    '<geom type="sphere" size="0.015" pos="0.1 0 0.02" density="3000"/>',
}


def body(solid: str) -> str:
    return mjcf(f'<body name="a"><joint name="j" axis="0 -1 0"/>{SOLIDS[solid]}</body>')


@pytest.mark.parametrize("solid", SOLIDS)
def test_mass_and_inertia_are_those_of_mujoco(solid: str, tmp_path: Path) -> None:
    mechanism = read(tmp_path, body(solid))
    plan = mechanism.plan
    links = links_of(plan, mechanism.plan_numbers, np.zeros(len(mechanism.plan_numbers), bool))
    model = mujoco.MjModel.from_xml_string(body(solid))
    principal = np.empty(9)
    mujoco.mju_quat2Mat(principal, model.body_iquat[1])
    turn = principal.reshape(3, 3)
    inertia = turn @ np.diag(model.body_inertia[1]) @ turn.T
    assert links[0, MASS] == pytest.approx(model.body_mass[1], rel=1e-12)
    # the plane's normal is MuJoCo's -y
    assert links[0, INERTIA] == pytest.approx(inertia[1, 1], rel=1e-9)
    x, _, z = model.body_ipos[1]
    assert np.hypot(links[0, COM_X], links[0, COM_Y]) == pytest.approx(np.hypot(x, z), rel=1e-9)


@pytest.mark.parametrize("solid", SOLIDS)
def test_complex_steps_are_central_differences(solid: str, tmp_path: Path) -> None:
    mechanism = read(tmp_path, body(solid))
    plan, values = mechanism.plan, mechanism.plan_numbers
    own, rows = np.zeros(len(values), bool), np.arange(len(values))
    links, gravity = derivatives(plan, values, own, rows, np.eye(len(rows)))
    assert gravity[:, plan.index["gravity"]].tolist() == [0.0, -1.0]
    for row in rows:
        step = 1e-6 * max(abs(values[row]), 1e-3)
        ends = [links_of(plan, values + sign * step * (rows == row), own) for sign in (1.0, -1.0)]
        slope = (ends[0] - ends[1]) / (2.0 * step)
        np.testing.assert_allclose(
            links[..., row], slope, rtol=1e-5, atol=1e-6 * max(np.abs(slope).max(), 1e-9)
        )


@pytest.mark.parametrize("given", [(), ("a.mass",), ("a.mass", "a.inertia"), ("a.com_x", "a.com_y")])
@pytest.mark.parametrize("solid", SOLIDS)
def test_many_trees_are_those_one_by_one(solid: str, given: tuple[str, ...], tmp_path: Path) -> None:
    mechanism, rng = read(tmp_path, body(solid)), np.random.default_rng(1)
    plan, own = mechanism.plan, np.zeros(len(mechanism.plan_numbers), bool)
    values = mechanism.plan_numbers[:, None] * rng.uniform(0.5, 2.0, (len(own), 5))
    for name in given:
        row = plan.index[name]
        own[row], values[row] = True, rng.uniform(0.5, 2.0, 5)
    many = links_of_many(plan.packed, values, plain(own))
    one = np.stack([links_of(plan, draw, own) for draw in values.T], axis=-1)
    np.testing.assert_allclose(many, one, rtol=1e-12, atol=1e-15)


def test_a_number_over_itself_has_no_derivative() -> None:
    """The rounding of one in three complex quotients looks like one."""
    drawn = np.random.default_rng(0).uniform(0.1, 10.0, (1000, 2))
    numbers = drawn[:, 0] * 1e-4 + 1e-30j * drawn[:, 1]
    assert all(over(number, number) == 1.0 for number in numbers)
    assert np.isnan(over(1.0 + 1e-30j, 0.0j))
