"""The paper's double pendulum against the general dynamics, MuJoCo and the work that its torques do."""

import mujoco
import numpy as np
import pytest

from monodyn.errors import MechanismError
from monodyn.mechanism import load, simulate
from monodyn.paper.two_link import (
    TwoLink,
    accelerations,
    coriolis,
    friction,
    gravity,
    inertia_matrix,
    inverse_dynamics,
)

SEED = 20120805
PENDULUM = TwoLink([0.21, 0.17], [0.15, 0.2], [0.006, 0.004], [2700.0, 1200.0], 9.79)

MJCF = """<mujoco><option gravity="0 0 -9.79"/><default>
  <joint type="hinge" axis="0 -1 0"/><geom type="box" contype="0" conaffinity="0"/></default><worldbody>
  <body><joint/><geom size="0.105 0.003 0.01575" pos="0.105 0 0" density="2700"/>
    <body pos="0.21 0 0"><joint/><geom size="0.085 0.002 0.017" pos="0.085 0 0" density="1200"/></body>
  </body></worldbody></mujoco>"""


def _states(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return angles, rates and torques, each (count, 2)."""
    rng = np.random.default_rng(SEED)
    scale = (3.0, 9.0, 0.1)
    theta, rate, torque = (rng.uniform(-s, s, (count, 2)) for s in scale)
    return theta, rate, torque


def test_is_the_general_engine() -> None:
    sizes = {}
    for i, link in enumerate(("link1", "link2")):
        sizes |= {f"{link}.length": PENDULUM.length[i], f"{link}.width": PENDULUM.width[i]}
        sizes |= {f"{link}.thickness": PENDULUM.thickness[i], f"{link}.density": PENDULUM.density[i]}
        sizes |= {f"{link}.tail": 0.0, f"joint{i + 1}.damping": 2e-3}
    # Without the ends beyond the hinges, which the paper's bars do not have.
    tree = load("double").with_values(sizes | {"link1.tip": 0.0, "gravity": PENDULUM.gravity}).tree
    theta, rate, torque = _states(50)
    ours = accelerations(PENDULUM, theta, rate, torque + friction(np.full(2, 2e-3), rate))
    theirs = simulate.accelerations(tree, theta, rate, torque)
    # Both are exact up to rounding.
    assert np.allclose(ours, theirs, rtol=1e-10, atol=1e-10 * np.abs(theirs).max())


def test_is_mujoco() -> None:
    model = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)
    for theta, rate, torque in zip(*_states(20), strict=True):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = theta, rate, torque
        mujoco.mj_forward(model, data)
        full = np.zeros((2, 2))
        mujoco.mj_fullM(model, data, full)
        # Exact up to rounding; the rates make accelerations of 1e4.
        assert np.allclose(inertia_matrix(PENDULUM, theta), full, rtol=1e-10, atol=0)
        ours = accelerations(PENDULUM, theta, rate, torque)
        assert np.allclose(ours, data.qacc, rtol=1e-10, atol=1e-10 * np.abs(data.qacc).max())
        bias = coriolis(PENDULUM, theta, rate) @ rate + gravity(PENDULUM, theta)
        assert np.allclose(bias, data.qfrc_bias, rtol=1e-10, atol=1e-12)


def test_inverse_dynamics_undoes_the_accelerations() -> None:
    theta, rate, torque = _states(50)
    found = inverse_dynamics(PENDULUM, theta, rate, accelerations(PENDULUM, theta, rate, torque))
    # Rounding, relative to the largest term of the sum.
    assert np.allclose(found, torque, rtol=0, atol=1e-12)


def test_inertia_changes_as_the_coriolis_torques_say() -> None:
    """dH/dt - 2 C is skew, so that torques are all that changes the energy."""
    theta, rate, _ = _states(20)
    step = 1e-6
    change = inertia_matrix(PENDULUM, theta + step * rate) - inertia_matrix(PENDULUM, theta - step * rate)
    rest = change / (2 * step) - 2 * coriolis(PENDULUM, theta, rate)
    # Central differences of numbers of 1e-3: 1e-12 of truncation and 1e-13 of rounding.
    assert np.allclose(rest, -np.swapaxes(rest, -1, -2), rtol=0, atol=1e-9)


def test_gravity_is_the_slope_of_the_height_energy() -> None:
    theta, _, _ = _states(20)

    def height(at: np.ndarray) -> np.ndarray:
        first, second = np.sin(at[:, 0]), np.sin(at.sum(axis=1))
        y1, y2 = PENDULUM.centre[0] * first, PENDULUM.length[0] * first + PENDULUM.centre[1] * second
        return PENDULUM.gravity * (PENDULUM.mass[0] * y1 + PENDULUM.mass[1] * y2)

    for i in range(2):
        step = 1e-6 * np.eye(2)[i]
        slope = (height(theta + step) - height(theta - step)) / 2e-6
        assert np.allclose(gravity(PENDULUM, theta)[:, i], slope, rtol=0, atol=1e-9)


def test_friction_takes_energy() -> None:
    _, rate, _ = _states(20)
    power = np.sum(friction(np.array([1e-3, 2e-3]), rate) * rate, axis=1)
    assert power == pytest.approx(-(1e-3 * rate[:, 0] ** 2 + 2e-3 * rate[:, 1] ** 2), rel=1e-12)


def test_a_bar_without_size_is_refused() -> None:
    with pytest.raises(MechanismError) as caught:
        TwoLink([0.2, 0.2], [0.1, 0.0], [0.006, 0.006], [2700.0, 2700.0])
    assert str(caught.value) == "TwoLink.aspect: expected two values above 0, got [0.1, 0.0]."
