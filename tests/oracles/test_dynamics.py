"""Planar dynamics against MuJoCo, the closed form, energy and finite differences."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from zoo import FRICTION, ZOO

from monodyn.mechanism import Mechanism, load
from monodyn.mechanism.drive import FOURIER, KNOTS, Drive
from monodyn.mechanism.simulate import (
    accelerations,
    energy,
    rollout,
    rollout_derivatives,
)
from monodyn.mechanism.tree import DAMPING, STIFFNESS, Directions, Tree

SEED = 20120801


def _both(text: str, folder: Path) -> tuple[Mechanism, mujoco.MjModel, mujoco.MjData]:
    """Return our mechanism and MuJoCo's model of the same text, contacts and limits off."""
    path = folder / "mechanism.xml"
    path.write_text(text)
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(
        mujoco.mjtDisableBit.mjDSBL_LIMIT
    )
    mechanism = load(path)
    # A file without damping gets a start value; here the model counts.
    damping = {
        f"{j.name}.damping": float(d) for j, d in zip(mechanism.joints, model.dof_damping, strict=True)
    }
    return mechanism.with_values(damping), model, mujoco.MjData(model)


def _accelerations(mechanism: Mechanism, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Return the accelerations in one state."""
    return accelerations(mechanism.tree, q[None], v[None], tau[None])[0]


@pytest.mark.parametrize("name", ZOO)
def test_accelerations_are_those_of_mujoco(name: str, tmp_path: Path) -> None:
    mechanism, model, data = _both(ZOO[name], tmp_path)
    rng = np.random.default_rng(SEED)
    for _ in range(20):
        data.qpos[:] = rng.uniform(-3, 3, model.nq)
        data.qvel[:] = rng.uniform(-8, 8, model.nv)
        tau = rng.uniform(-0.1, 0.1, model.nv)
        data.qfrc_applied[:] = tau
        mujoco.mj_forward(model, data)
        ours = _accelerations(mechanism, data.qpos, data.qvel, tau)
        # Both are exact up to rounding; 1e-9 leaves room for the conditioning of the inertia matrix.
        assert np.allclose(ours, data.qacc, rtol=1e-9, atol=1e-9 * np.abs(data.qacc).max())


@pytest.mark.parametrize("name", ZOO)
def test_rollout_takes_the_steps_of_mujoco(name: str, tmp_path: Path) -> None:
    mechanism, model, data = _both(ZOO[name], tmp_path)
    rng = np.random.default_rng(SEED)
    q0, v0 = rng.uniform(-1, 1, model.nq), rng.uniform(-3, 3, model.nv)
    data.qpos[:], data.qvel[:] = q0, v0
    theirs = [q0]
    for _ in range(50):
        for _ in range(5):
            mujoco.mj_step(model, data)
        theirs.append(data.qpos.copy())
    times = np.arange(51) * 5 * model.opt.timestep
    q, v = rollout(mechanism.tree, times, q0, v0, substeps=5)
    # Same method and step: rounding, grown by 250 steps of a motion that may be chaotic.
    assert np.allclose(q, theirs, rtol=0, atol=1e-8)
    assert np.allclose(v[-1], data.qvel, rtol=0, atol=1e-7)


def test_friction_loss_is_that_of_mujoco_on_fast_motion(tmp_path: Path) -> None:
    mechanism, model, data = _both(FRICTION, tmp_path)
    # MuJoCo's friction is a soft constraint: make it as hard as it gets, and saturated by the high rates.
    model.dof_solimp[:] = [0.9999, 0.9999, 0.001, 0.5, 2]
    model.dof_solref[:] = [0.004, 1]
    model.opt.tolerance = 0
    model.opt.iterations = 200
    rng = np.random.default_rng(SEED)
    for _ in range(20):
        data.qpos[:] = rng.uniform(-3, 3, model.nq)
        data.qvel[:] = rng.choice([-1, 1], model.nv) * rng.uniform(5, 9, model.nv)
        mujoco.mj_forward(model, data)
        ours = _accelerations(mechanism, data.qpos, data.qvel, np.zeros(2))
        # Saturated, both apply the same force; 1e-7 is the solver's tolerance.
        assert np.allclose(ours, data.qacc, rtol=1e-7, atol=1e-7 * np.abs(data.qacc).max())


@pytest.mark.parametrize("name", ["double", "cart_branches"])
def test_drag_is_a_force_that_mujoco_is_given(name: str, tmp_path: Path) -> None:
    """tau = -c |v| v, written into MuJoCo's applied forces at every stage of its steps."""
    mechanism, model, data = _both(ZOO[name], tmp_path)
    rng = np.random.default_rng(SEED)
    drag = rng.uniform(1e-4, 1e-3, model.nv)
    q0, v0 = rng.uniform(-1, 1, model.nq), rng.uniform(-8, 8, model.nv)
    data.qpos[:], data.qvel[:] = q0, v0

    def hold(_: mujoco.MjModel, now: mujoco.MjData) -> None:
        now.qfrc_applied[:] = -drag * np.abs(now.qvel) * now.qvel

    mujoco.set_mjcb_control(hold)
    try:
        theirs = [q0]
        for _ in range(50):
            for _ in range(5):
                mujoco.mj_step(model, data)
            theirs.append(data.qpos.copy())
    finally:
        mujoco.set_mjcb_control(None)
    dragged = mechanism.with_values(
        {f"{j.name}.drag": float(c) for j, c in zip(mechanism.joints, drag, strict=True)}
    )
    times = np.arange(51) * 5 * model.opt.timestep
    q, _ = rollout(dragged.tree, times, q0, v0, substeps=5)
    # Same method and step: rounding, grown by 250 steps of a motion that may be chaotic.
    assert np.allclose(q, theirs, rtol=0, atol=1e-8)
    assert np.abs(q - rollout(mechanism.tree, times, q0, v0, substeps=5)[0]).max() > 1e-3


def test_double_pendulum_is_the_closed_form() -> None:
    """Eq. (8) of the 2012 paper, with cos(theta1 + theta2) in g1 and g2 and tau_i = -b_i rate_i."""
    mechanism = load("double").with_values(
        {"link1.width": 0.04, "link2.length": 0.17, "joint2.damping": 2e-3}
    )
    value = mechanism.values
    l1, g = value["link1.length"], value["gravity"]
    m1, a1, i1 = value["link1.mass"], value["link1.com_x"], value["link1.inertia"]
    m2, a2, i2 = value["link2.mass"], value["link2.com_x"], value["link2.inertia"]
    damping = np.array([value["joint1.damping"], value["joint2.damping"]])
    rng = np.random.default_rng(SEED)
    for _ in range(50):
        q, v, tau = rng.uniform(-3, 3, 2), rng.uniform(-9, 9, 2), rng.uniform(-0.1, 0.1, 2)
        c2, s2 = np.cos(q[1]), np.sin(q[1])
        h11 = m1 * a1**2 + i1 + m2 * (l1**2 + a2**2 + 2 * l1 * a2 * c2) + i2
        h12 = m2 * l1 * a2 * c2 + m2 * a2**2 + i2
        h22 = m2 * a2**2 + i2
        h = m2 * l1 * a2 * s2
        coriolis = np.array([[-h * v[1], -h * v[0] - h * v[1]], [h * v[0], 0.0]])
        g2 = m2 * a2 * g * np.cos(q[0] + q[1])
        g1 = m1 * a1 * g * np.cos(q[0]) + m2 * g * l1 * np.cos(q[0]) + g2
        right = tau - damping * v - coriolis @ v - np.array([g1, g2])
        closed = np.linalg.solve(np.array([[h11, h12], [h12, h22]]), right)
        # Both are exact up to rounding.
        assert np.allclose(_accelerations(mechanism, q, v, tau), closed, rtol=1e-11, atol=1e-9)


@pytest.mark.parametrize("name", ["triple", "tree", "cart_branches", "planar_body", "chain"])
def test_energy_stays_without_friction(name: str, tmp_path: Path) -> None:
    mechanism, *_ = _both(ZOO[name], tmp_path)
    mechanism = mechanism.with_values({f"{j.name}.damping": 0.0 for j in mechanism.joints})
    rng = np.random.default_rng(SEED)
    n = len(mechanism.joints)
    times = np.linspace(0, 2, 61)
    start = rng.uniform(-1, 1, n)
    q, v = rollout(mechanism.tree, times, start, np.zeros(n), substeps=256)
    total = energy(mechanism.tree, q, v)
    moved = energy(mechanism.tree, q, np.zeros_like(v))
    # RK4 at 0.13 ms loses about (rate * step)^4 of the energy that is exchanged.
    assert np.ptp(moved) > 1e-2
    assert np.ptp(total) < 1e-8 * np.ptp(moved)


def test_energy_falls_by_what_damping_takes() -> None:
    mechanism = load("double")
    times = np.linspace(0, 1, 2001)
    q, v = rollout(mechanism.tree, times, np.array([0.3, 0.8]), np.zeros(2), substeps=1)
    total = energy(mechanism.tree, q, v)
    power = (v**2) @ mechanism.tree.links[:, DAMPING]
    taken = np.trapezoid(power, times)
    # The trapezoid rule over 0.5 ms leaves about 1e-6 of the integral.
    assert total[0] - total[-1] == pytest.approx(taken, rel=1e-5)


@pytest.mark.parametrize("name", [*ZOO, "friction"])
def test_sensitivities_are_exact(name: str, tmp_path: Path) -> None:
    """Against the complex step, and against central differences, of the plain rollout."""
    mechanism, *_ = _both({**ZOO, "friction": FRICTION}[name], tmp_path)
    names = [p.name for p in mechanism.parameters if not p.follows]
    directions = mechanism.directions(names)
    n = len(mechanism.joints)
    times = np.array([0.0, 0.02, 0.05, 0.06, 0.1])
    rng = np.random.default_rng(SEED)
    q0, v0 = rng.uniform(-1, 1, n), rng.uniform(-2, 2, n)
    q, v, dq, dv = rollout_derivatives(mechanism.tree, directions, times, q0, v0, substeps=3)
    assert dq.shape == dv.shape == (5, n, len(names) + 2 * n)
    plain = rollout(mechanism.tree, times, q0, v0, substeps=3)
    assert np.array_equal(q, plain[0])
    assert np.array_equal(v, plain[1])
    step = 1e-30
    for k in range(dq.shape[2]):
        tree, in_q, in_v = _complex_step(mechanism.tree, directions, k, step)
        qc, vc = rollout(tree, times, q0 + in_q, v0 + in_v, substeps=3)
        # Both are exact derivatives: rounding, relative to the largest entry.
        assert np.allclose(
            dq[:, :, k], qc.imag / step, rtol=1e-9, atol=1e-11 * (1 + np.abs(qc.imag).max() / step)
        )
        assert np.allclose(
            dv[:, :, k], vc.imag / step, rtol=1e-9, atol=1e-11 * (1 + np.abs(vc.imag).max() / step)
        )


def _complex_step(
    tree: Tree, directions: Directions, k: int, step: float
) -> tuple[Tree, np.ndarray, np.ndarray]:
    """Return tree and start state with an imaginary step along one column of the derivatives."""
    n, params = len(tree.parent), directions.links.shape[2]
    in_q, in_v = np.zeros(n, complex), np.zeros(n, complex)
    if k < params:
        return tree.along(directions, k, 1j * step), in_q, in_v
    (in_q if k < params + n else in_v)[(k - params) % n] = 1j * step
    return replace(tree, links=tree.links.astype(complex)), in_q, in_v


@pytest.mark.parametrize("name", ["double", "cart_branches", "shapes"])
def test_sensitivities_are_those_of_finite_differences(name: str, tmp_path: Path) -> None:
    mechanism, *_ = _both(ZOO[name], tmp_path)
    names = [p.name for p in mechanism.parameters if not p.follows and p.value > 0 and p.name != "time_scale"]
    n = len(mechanism.joints)
    times = np.linspace(0, 0.3, 10)
    rng = np.random.default_rng(SEED)
    q0, v0 = rng.uniform(-1, 1, n), rng.uniform(-2, 2, n)
    directions = mechanism.directions(names)
    _, _, dq, _ = rollout_derivatives(mechanism.tree, directions, times, q0, v0, substeps=4)
    for k, parameter in enumerate(names):
        value = mechanism.parameter(parameter).value
        step = 1e-5 * value
        high, low = (
            rollout(mechanism.with_values({parameter: value + s}).tree, times, q0, v0, substeps=4)[0]
            for s in (step, -step)
        )
        # Central differences: 1e-10 of truncation and 1e-11 of rounding, relative to the whole effect.
        assert np.allclose(dq[:, :, k] * value, (high - low) / 2e-5, rtol=1e-6, atol=1e-7)


def _drive(mode: int, dofs: int, rng: np.random.Generator) -> Drive:
    """Return a drive that starts and ends within 0.1 s, at no stamp of the tests."""
    if mode == FOURIER:
        return Drive(FOURIER, np.array([0.0713]), rng.uniform(-0.1, 0.1, (dofs, 7)))
    return Drive(KNOTS, 0.0031 + 0.0137 * np.arange(7), rng.uniform(-0.1, 0.1, (dofs, 7)))


@pytest.mark.parametrize("mode", [FOURIER, KNOTS])
@pytest.mark.parametrize("name", ZOO)
def test_driven_rollout_takes_the_steps_of_mujoco(name: str, mode: int, tmp_path: Path) -> None:
    mechanism, model, data = _both(ZOO[name], tmp_path)
    rng = np.random.default_rng(SEED)
    drive = _drive(mode, model.nv, rng)
    q0, v0 = rng.uniform(-1, 1, model.nq), rng.uniform(-3, 3, model.nv)
    data.qpos[:], data.qvel[:] = q0, v0
    model.opt.timestep = 0.0004

    def push(_: mujoco.MjModel, now: mujoco.MjData) -> None:
        now.qfrc_applied[:] = drive.at(np.array([now.time]))[0]

    mujoco.set_mjcb_control(push)
    try:
        theirs = [q0]
        for _ in range(50):
            for _ in range(5):
                mujoco.mj_step(model, data)
            theirs.append(data.qpos.copy())
    finally:
        mujoco.set_mjcb_control(None)
    times = np.arange(51) * 0.002
    q, v = rollout(mechanism.tree, times, q0, v0, substeps=5, drive=drive)
    # Same method and step, the torque at every stage's time: rounding, grown by 250 steps.
    assert np.allclose(q, theirs, rtol=0, atol=1e-9)
    assert np.allclose(v[-1], data.qvel, rtol=0, atol=1e-7)
    assert np.abs(q - rollout(mechanism.tree, times, q0, v0, substeps=5)[0]).max() > 1e-4


DRIVEN = [("double", "fourier"), ("double", "knots"), ("double", "knots at stamps"), ("tree", "knots"),
          ("cart_branches", "fourier"), ("cart_branches", "knots at stamps")]  # fmt: skip


@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize(("name", "torque"), DRIVEN)
def test_driven_sensitivities_are_exact(name: str, torque: str, back: bool, tmp_path: Path) -> None:
    """Sizes, masses, start state and every entry of the table against the complex step."""
    mechanism, *_ = _both(ZOO[name], tmp_path)
    names = [p.name for p in mechanism.parameters if not p.follows]
    tree, sized = mechanism.tree, mechanism.directions(names)
    n, rng = len(tree.parent), np.random.default_rng(SEED)
    drive = _drive(FOURIER if torque == "fourier" else KNOTS, n, rng)
    times = np.array([0.02, 0.03, 0.05, 0.055, 0.06])
    if torque == "knots at stamps":
        drive = Drive(KNOTS, times, drive.table[:, :5])
    # One entry is nobody's; the parameters are in no order of time.
    count = drive.table.size - 1
    entry = len(names) + np.append(rng.permutation(count), 0).reshape(drive.table.shape)
    entry[-1, -1] = -1
    dlinks = np.concatenate((sized.links, np.zeros((*tree.links.shape, count))), axis=2)
    # Every third is a joint's damping as well, and acts from the start.
    dlinks[0, DAMPING, -1::-3] = 1.0
    dgravity = np.concatenate((sized.gravity, np.zeros((2, count))), axis=1)
    directions = Directions(dlinks, dgravity, entry, *np.zeros((3, len(names) + count)))
    times = times[:: -1 if back else 1]
    q0, v0 = rng.uniform(-1, 1, n), rng.uniform(-2, 2, n)
    q, v, dq, dv = rollout_derivatives(tree, directions, times, q0, v0, substeps=3, drive=drive)
    plain = rollout(tree, times, q0, v0, substeps=3, drive=drive)
    assert np.array_equal(q, plain[0])
    assert np.array_equal(v, plain[1])
    step = 1e-30
    for k in range(dq.shape[2]):
        stepped, in_q, in_v = _complex_step(tree, directions, k, step)
        moved = Drive(drive.mode, drive.times, drive.table + 1j * step * (entry == k))
        qc, vc = rollout(stepped, times, q0 + in_q, v0 + in_v, substeps=3, drive=moved)
        # Both are exact derivatives: rounding, relative to the largest entry.
        for ours, theirs in ((dq[:, :, k], qc.imag / step), (dv[:, :, k], vc.imag / step)):
            assert np.allclose(ours, theirs, rtol=1e-9, atol=1e-11 * (1 + np.abs(theirs).max()))


@pytest.mark.parametrize("name", ["double", "cart_branches"])
def test_derivative_by_the_period_is_that_of_finite_differences(name: str, tmp_path: Path) -> None:
    mechanism, *_ = _both(ZOO[name], tmp_path)
    n, rng = len(mechanism.joints), np.random.default_rng(SEED)
    period, table = 0.31, rng.uniform(-0.01, 0.01, (n, 7))
    times, q0, v0 = np.linspace(0.2, 0.4, 7), rng.uniform(-1, 1, n), rng.uniform(-2, 2, n)
    tree = mechanism.tree
    by_period = Directions(
        np.zeros((*tree.links.shape, 1)), np.zeros((2, 1)), np.full((n, 7), -1), np.zeros(1),
        np.array([-1 / period]), np.zeros(1),
    )  # fmt: skip
    drive = Drive(FOURIER, np.array([period]), table)
    _, _, dq, dv = rollout_derivatives(tree, by_period, times, q0, v0, substeps=4, drive=drive)
    step = 1e-6
    high, low = (
        rollout(tree, times, q0, v0, substeps=4, drive=Drive(FOURIER, np.array([period + s]), table))
        for s in (step, -step)
    )
    for ours, up, down in zip((dq, dv), high, low, strict=True):
        theirs = (up - down) / (2 * step)
        # Central differences: 1e-9 of truncation and 1e-10 of rounding, relative to the largest entry.
        assert np.abs(theirs).max() > 1e-2
        assert np.allclose(ours[:, :, 0], theirs, rtol=1e-6, atol=1e-7 * np.abs(theirs).max())


@pytest.mark.parametrize("mode", [FOURIER, KNOTS])
@pytest.mark.parametrize("name", ["double", "cart_branches"])
def test_derivative_by_the_time_scale_is_that_of_finite_differences(
    name: str, mode: int, tmp_path: Path
) -> None:
    """q(s t; s^2 gravity, s damping, s^2 torque, ..., s v0) is q at the stretched stamps, so that one has
    load = 2 and clock = 1 by log s."""
    mechanism, *_ = _both(ZOO[name], tmp_path)
    n, rng = len(mechanism.joints), np.random.default_rng(SEED)
    drive = _drive(mode, n, rng)
    stamps, q0, v0 = np.linspace(0.02, 0.07, 8), rng.uniform(-1, 1, n), rng.uniform(-2, 2, n)
    tree = mechanism.tree
    power = np.zeros(tree.links.shape[1])
    power[[DAMPING, STIFFNESS]] = 1.0, 2.0
    by_scale = Directions(
        (power * tree.links)[:, :, None], 2 * tree.gravity[:, None], np.full(drive.table.shape, -1),
        np.array([2.0]), np.array([1.0]), np.zeros(1),
    )  # fmt: skip
    _, _, dq, _ = rollout_derivatives(tree, by_scale, stamps, q0, v0, substeps=4, drive=drive)
    ours = dq[:, :, 0] + dq[:, :, 1 + n :] @ v0
    step = 1e-7
    high, low = (rollout(tree, stamps * np.exp(s), q0, v0, substeps=4, drive=drive)[0] for s in (step, -step))
    theirs = (high - low) / (2 * step)
    # Central differences: rounding of 1e-16 / 1e-7; the stretch is small enough that no stage passes a knot.
    assert np.allclose(ours, theirs, rtol=1e-5, atol=1e-7 * (1 + np.abs(theirs).max()))
    undriven = rollout(tree, stamps * np.exp(step), q0, v0, substeps=4)[0]
    assert np.abs(undriven - high).max() > 1e-5
