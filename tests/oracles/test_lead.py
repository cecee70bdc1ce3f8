"""Dry friction that turns ahead of the rate, against roots of another method, MuJoCo, and its derivatives."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq

from monodyn.mechanism import Mechanism, load, write_mjcf
from monodyn.mechanism.simulate import (
    acceleration_derivatives,
    accelerations,
    rollout,
    rollout_derivatives,
    simulate,
)
from monodyn.mechanism.tree import CREEP, FRICTION, Tree

DEFAULT = 0.95 * 0.02 / 2.0
"""Lead of MuJoCo's friction loss by default: dmax of solimp by the time of solref, halved."""


def rubbing(kind: str, friction: float, lead: float) -> Mechanism:
    """Return a bundled mechanism with the same dry friction at every joint."""
    mechanism = load(kind)
    terms = {"friction": friction, "lead": lead}
    return mechanism.with_values({f"{j.name}.{k}": v for j in mechanism.joints for k, v in terms.items()})


def frictionless(tree: Tree) -> Tree:
    """Return a tree without dry friction."""
    links = tree.links.copy()
    links[:, FRICTION] = 0.0
    return Tree(tree.parent, tree.kind, links, tree.gravity)


def drawn(joints: int, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, rates from a hundredth of the creep on, and torques, each (row, joint)."""
    rng = np.random.default_rng(3)
    rate = rng.normal(size=(rows, joints)) * 10.0 ** rng.uniform(-4.5, 1.0, (rows, 1))
    return rng.uniform(-3.0, 3.0, (rows, joints)), rate, 0.1 * rng.normal(size=(rows, joints))


def test_the_acceleration_of_one_joint_is_the_root_of_its_equation() -> None:
    mechanism = rubbing("single", 0.05, DEFAULT)
    bare = frictionless(mechanism.tree)
    q, v, tau = drawn(1, 200)
    unit = accelerations(bare, q, v, tau + 1.0) - accelerations(bare, q, v, tau)
    start = accelerations(bare, q, v, tau)
    found, turning = accelerations(mechanism.tree, q, v, tau), 0
    for row in range(len(q)):
        free, by_torque, rate = float(start[row, 0]), float(unit[row, 0]), float(v[row, 0])

        def left(a: float, free: float = free, by_torque: float = by_torque, rate: float = rate) -> float:
            return a - free + by_torque * 0.05 * np.tanh((rate + DEFAULT * a) / CREEP[0])

        reach = 0.05 * by_torque + 1.0
        root = brentq(left, free - reach, free + reach, xtol=1e-12, rtol=1e-14)
        turning += abs(rate + DEFAULT * root) < 4.0 * CREEP[0]
        # that of the root
        assert found[row, 0] == pytest.approx(root, rel=1e-11, abs=1e-10)
    assert turning > 40


@pytest.mark.parametrize("kind", ["double", "triple", "cartpole"])
def test_the_accelerations_are_those_under_their_own_friction(kind: str) -> None:
    mechanism = rubbing(kind, 0.05, DEFAULT)
    tree, creep = mechanism.tree, np.array([CREEP[k] for k in mechanism.tree.kind])
    q, v, tau = drawn(len(mechanism.joints), 500)
    found = accelerations(tree, q, v, tau)
    ahead = v + DEFAULT * found
    again = accelerations(frictionless(tree), q, v, tau - 0.05 * np.tanh(ahead / creep))
    # what rounding of the argument, over the creep, leaves
    np.testing.assert_allclose(found, again, rtol=1e-9, atol=1e-9 * np.abs(found).max())
    assert np.mean(np.abs(ahead) < 4.0 * creep) > 0.1


@pytest.mark.parametrize("kind", ["double", "cartpole"])
def test_derivatives_are_those_of_the_complex_step(kind: str) -> None:
    mechanism = rubbing(kind, 0.05, DEFAULT)
    names = [p.name for p in mechanism.parameters if p.kind in ("friction", "lead", "length", "damping")]
    directions, joints = mechanism.directions(names), len(mechanism.joints)
    tree, (q, v, tau) = mechanism.tree, drawn(joints, 200)
    _, slopes = acceleration_derivatives(tree, directions, q, v, tau)
    still = tree.along(directions, 0, 0j)  # the same tree, complex
    for k in range(len(names) + 3 * joints):
        stepped, moved = still, [q + 0j, v + 0j, tau + 0j]
        if k < len(names):
            stepped = tree.along(directions, k, 1e-30j)
        else:
            which, i = divmod(k - len(names), joints)
            moved[which] = moved[which] + 1e-30j * np.eye(joints)[i]
        exact = accelerations(stepped, moved[0], moved[1], moved[2]).imag / 1e-30
        size = max(np.abs(exact).max(), 1.0)
        np.testing.assert_allclose(slopes[:, :, k], exact, rtol=1e-8, atol=1e-9 * size)


def test_a_motion_depends_smoothly_on_friction_and_lead() -> None:
    """Steps are divided where friction turns: how, must not show, or a search stalls on its jumps."""
    mechanism, times = rubbing("double", 0.004, DEFAULT), np.arange(0.0, 3.0, 1 / 60)
    start = np.array([0.61, 0.62]), np.zeros(2)
    for name in ("joint1.friction", "joint2.lead"):
        value = mechanism.values[name]
        directions = mechanism.directions([name])
        q, _, dq, _ = rollout_derivatives(mechanism.tree, directions, times, *start, substeps=8)
        worst = 0.0
        for step in 1e-5 * value * np.linspace(-1.0, 1.0, 21):
            moved = rollout(mechanism.with_values({name: value + step}).tree, times, *start, substeps=8)[0]
            worst = max(worst, float(np.abs(moved - q - dq[:, :, 0] * step).max()))
        # it jumps by 3e-4 where parts of steps leap over a turn that another joint's brings about
        assert worst < 1e-7


def test_parts_of_steps_are_exact() -> None:
    mechanism, times = rubbing("double", 0.004, DEFAULT), np.arange(0.0, 3.0, 1 / 60)
    start = np.array([0.8, -0.5]), np.zeros(2)
    few, many = (rollout(mechanism.tree, times, *start, substeps=n)[0] for n in (8, 256))
    # what a search allows
    assert np.abs(few - many).max() < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "friction"), [("single", 0.003), ("double", 0.004), ("triple", 0.003)])
def test_the_motion_is_that_of_mujocos_default_friction(kind: str, friction: float, tmp_path: Path) -> None:
    mechanism = rubbing(kind, friction, DEFAULT)
    write_mjcf(mechanism, tmp_path / "m.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml"))
    model.opt.timestep = 2e-4
    model.dof_solref[:], model.dof_solimp[:] = [0.02, 1.0], [0.9, 0.95, 0.001, 0.5, 2.0]
    times, theirs = _simulated(model, 3.0)
    start = theirs[0], np.zeros(len(mechanism.joints))
    ours = simulate(mechanism, times, *start).position
    firm = simulate(rubbing(kind, friction, 0.0), times, *start).position
    # MuJoCo's lets a joint that it holds creep by a millisecond of what would move it
    missed, missed_firm = np.abs(ours - theirs).max(), np.abs(firm - theirs).max()
    assert missed < 6e-4
    assert missed < 0.06 * missed_firm


@pytest.mark.parametrize("lead", [0.002, DEFAULT, 0.03])
def test_a_lead_is_written_and_followed_by_mujoco(lead: float, tmp_path: Path) -> None:
    mechanism, path = rubbing("double", 0.004, lead), tmp_path / "m.xml"
    write_mjcf(mechanism, path)
    read = load(path)
    assert [read.values[f"{j.name}.lead"] for j in mechanism.joints] == [lead, lead]
    said = (
        "Dry friction turns ahead of the rate, as a soft constraint of MuJoCo does and no bearing: by "
        "<joint>.lead [s], half of solreffriction."
    )
    assert said in " ".join(path.read_text(encoding="utf-8").split())
    write_mjcf(read, tmp_path / "again.xml")
    assert (tmp_path / "again.xml").read_bytes() == path.read_bytes()
    # as it comes, at the step of the file
    times, theirs = _simulated(mujoco.MjModel.from_xml_path(str(path)), 3.0)
    ours = simulate(mechanism, times, theirs[0], np.zeros(2)).position
    assert np.abs(ours - theirs).max() < 6e-4


def test_a_file_that_says_nothing_of_it_has_none(tmp_path: Path) -> None:
    write_mjcf(rubbing("double", 0.004, 0.0), tmp_path / "m.xml")
    text = (tmp_path / "m.xml").read_text(encoding="utf-8")
    assert "lead" not in text
    for soft in ("0.002 1", "0.02 1", "0.05 1"):
        (tmp_path / "m.xml").write_text(text.replace("0.002 1", soft), encoding="utf-8")
        assert load(tmp_path / "m.xml").values["joint1.lead"] == 0.0


def _simulated(model: mujoco.MjModel, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Return time stamps every 20 ms and the positions there, of a mechanism let go from the side."""
    data = mujoco.MjData(model)
    data.qpos[:] = 0.6 * np.resize([1.0, -0.7], model.nq)
    every, rows = round(0.02 / model.opt.timestep), []
    for _ in range(round(seconds / 0.02)):
        rows.append(data.qpos.copy())
        for _ in range(every):
            mujoco.mj_step(model, data)
    return 0.02 * np.arange(len(rows)), np.array(rows)
