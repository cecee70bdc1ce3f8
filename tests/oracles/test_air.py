"""The drag of the air on links, against forces that MuJoCo is given at their centres of oscillation."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from zoo import ZOO

from monodyn.mechanism import Mechanism, load
from monodyn.mechanism.simulate import accelerations, energy, rollout, rollout_derivatives
from monodyn.mechanism.tree import AIR, MASS

SEED = 20260111
CASES = ("double", "chain", "tree", "cartpole", "cart_branches")
"""Mechanisms each of whose bodies has one joint and none welded to it."""


def windy(text: str, folder: Path) -> tuple[Mechanism, np.random.Generator]:
    """Return a mechanism whose links feel the air, each another one."""
    (folder / "m.xml").write_text(text)
    mechanism, rng = load(folder / "m.xml"), np.random.default_rng(SEED)
    return mechanism.with_values({f"{j.name}.air": rng.uniform(1e-5, 1e-4) for j in mechanism.joints}), rng


def pushed(model: mujoco.MjModel, data: mujoco.MjData, drag: np.ndarray) -> np.ndarray:
    """Return the joint forces of the air in MuJoCo's state, (dof,)."""
    force = np.zeros(model.nv)
    for j, c in enumerate(drag):
        body, anchor, axis = int(model.jnt_bodyid[j]), data.xanchor[j], data.xaxis[j]
        arm, along = 1.0, axis
        if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE:
            frame = data.ximat[body].reshape(3, 3)
            out = data.xipos[body] - anchor
            out -= axis * (axis @ out)
            radius = np.linalg.norm(out)
            inertia = axis @ (frame * model.body_inertia[body]) @ frame.T @ axis
            arm = inertia / (model.body_mass[body] * radius) + radius
            anchor, along = anchor + arm * out / radius, np.cross(axis, out / radius)
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jacobian, None, anchor, body)
        z = along @ jacobian @ data.qvel / arm
        mujoco.mj_applyFT(model, data, -c * abs(z) * z / arm * along, np.zeros(3), anchor, body, force)
    return force


@pytest.mark.parametrize("name", CASES)
def test_the_air_pushes_at_the_centre_of_oscillation(name: str, tmp_path: Path) -> None:
    mechanism, rng = windy(ZOO[name], tmp_path)
    model = mujoco.MjModel.from_xml_string(ZOO[name])
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT)
    assert model.njnt == model.nbody - 1
    data, drag = mujoco.MjData(model), mechanism.tree.links[:, AIR]
    damping = dict(zip((f"{j.name}.damping" for j in mechanism.joints), model.dof_damping, strict=True))
    mechanism = mechanism.with_values(damping)
    for _ in range(20):
        data.qpos[:], data.qvel[:] = rng.uniform(-3, 3, model.nq), rng.uniform(-8, 8, model.nv)
        mujoco.mj_forward(model, data)
        data.qfrc_applied[:] = pushed(model, data, drag)
        mujoco.mj_forward(model, data)
        ours = accelerations(mechanism.tree, data.qpos[None], data.qvel[None], np.zeros((1, model.nv)))[0]
        np.testing.assert_allclose(ours, data.qacc, rtol=1e-9, atol=1e-9 * np.abs(data.qacc).max())


def test_on_a_link_that_hangs_from_the_wall_it_is_the_drag_of_its_joint() -> None:
    single, state = load("single"), (np.array([[0.4]]), np.array([[-3.0]]))
    found = [
        accelerations(single.with_values({f"joint1.{kind}": 0.01}).tree, *state, np.zeros((1, 1)))
        for kind in ("air", "drag")
    ]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-12)


def test_a_rod_meets_what_its_points_meet() -> None:
    """Each point is resisted by the square of its own speed: about that, where the tip is no slower."""
    double = load("double")
    thin = double.with_values({"link2.width": 1e-4, "link2.length": 0.2, "joint2.air": 0.01})
    c, (l1, l2) = 0.01, (thin.values["link1.length"], 0.2)
    bare = thin.with_values({"joint2.air": 0.0})
    for q, v in (([0.3, 0.5], [4.0, 3.0]), ([-0.7, 1.2], [5.0, -2.0]), ([0.2, -0.4], [-6.0, -5.0])):
        q, v = np.array([q]), np.array([v])
        at = (np.arange(400) + 0.5) / 400 * l2
        speed = l1 * np.cos(q[0, 1]) * v[0, 0] + at * v.sum()
        force = -4.0 * c / l2**4 * np.abs(speed) * speed * l2 / 400
        tau = np.array([[force @ (at + l1 * np.cos(q[0, 1])), force @ at]])
        theirs = accelerations(bare.tree, q, v, tau) - accelerations(bare.tree, q, v, 0.0 * tau)
        ours = accelerations(thin.tree, q, v, 0.0 * tau) - accelerations(bare.tree, q, v, 0.0 * tau)
        np.testing.assert_allclose(ours, theirs, rtol=0.1, atol=0.1 * np.abs(theirs).max())


@pytest.mark.parametrize("name", ZOO)
def test_it_takes_energy_out(name: str, tmp_path: Path) -> None:
    mechanism, rng = windy(ZOO[name], tmp_path)
    held = {p.name: 0.0 for p in mechanism.parameters if p.kind in ("damping", "friction", "drag")}
    tree = mechanism.with_values(held).tree
    q0, v0 = rng.uniform(-1, 1, len(tree.parent)), rng.uniform(-5, 5, len(tree.parent))
    q, v = rollout(tree, np.linspace(0.0, 0.3, 31), q0, v0, substeps=16)
    assert (np.diff(energy(tree, q, v)) < 0.0).all()


@pytest.mark.parametrize("name", ZOO)
def test_derivatives_are_those_of_the_complex_step(name: str, tmp_path: Path) -> None:
    mechanism, rng = windy(ZOO[name], tmp_path)
    mechanism = mechanism.with_bodies("free")
    names = [p.name for p in mechanism.parameters if p.kind in ("mass", "com_x", "com_y", "inertia", "air")]
    names += [p.name for p in mechanism.parameters if p.kind in ("length", "gravity")]
    tree, directions, times = mechanism.tree, mechanism.directions(names), np.linspace(0.0, 0.06, 4)
    assert (tree.links[:, AIR] > 0.0).all()
    assert (tree.links[:, MASS] > 0.0).any()
    q0, v0 = rng.uniform(-1, 1, len(tree.parent)), rng.uniform(-5, 5, len(tree.parent))
    _, _, dq, _ = rollout_derivatives(tree, directions, times, q0, v0, substeps=2)
    for k, what in enumerate(names):
        stepped = tree.along(directions, k, 1e-30j)
        theirs = rollout(stepped, times, q0, v0, substeps=2)[0].imag / 1e-30
        np.testing.assert_allclose(
            dq[:, :, k], theirs, rtol=1e-8, atol=1e-10 * np.abs(theirs).max() + 1e-12, err_msg=what
        )
    for i in range(len(q0)):
        moving = tree.along(directions, 0, 0j)
        for at, (dx, du) in enumerate(((1e-30j, 0.0), (0.0, 1e-30j))):
            ahead = np.eye(len(q0))[i]
            theirs = rollout(moving, times, q0 + dx * ahead, v0 + du * ahead, substeps=2)[0].imag / 1e-30
            np.testing.assert_allclose(
                dq[:, :, len(names) + at * len(q0) + i], theirs, rtol=1e-8, atol=1e-9 * np.abs(theirs).max()
            )
