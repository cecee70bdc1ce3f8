"""The linear system about a state, against finite differences, MuJoCo and draws of the covariance."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from controllable import MOTORS, UPRIGHT, identified
from fits import identified as single
from monodyn.errors import SettingsError
from monodyn.mechanism import write_mjcf
from monodyn.mechanism.simulate import accelerations
from monodyn.results.draws import Response, drawn
from monodyn.results.linear import linearize, needed, state_matrices, without_dry_friction
from support import refuses

KINDS = ("cartpole", "double")


@pytest.mark.parametrize("kind", KINDS)
def test_the_system_is_that_of_finite_differences_in_any_state(kind: str) -> None:
    _, fit = identified(kind)
    tree, rng = fit.mechanism.tree, np.random.default_rng(3)
    q, v, u = rng.normal(size=(3, 2))
    u = 0.1 * u
    found = linearize(fit, q, v, torque=u)
    step = 1e-3
    for k in range(6):
        moved = np.zeros(6)
        moved[k] = step
        far, near, behind, farther = (
            accelerations(tree, *(part[None] for part in np.split(np.concatenate((q, v, u)) + by * moved, 3)))
            for by in (2.0, 1.0, -1.0, -2.0)
        )
        slope = (8.0 * (near - behind) - (far - farther))[0] / (12.0 * step)
        column = np.hstack((found.system.A, found.system.B))[2:, k]
        # central differences of five points: the fourth power of the step, and rounding over the step
        np.testing.assert_allclose(column, slope, rtol=1e-6, atol=1e-6 * np.abs(slope).max() + 1e-8)
    assert found.acceleration == pytest.approx(accelerations(tree, q[None], v[None], u[None])[0])
    np.testing.assert_array_equal(found.system.A[:2], np.eye(4)[2:])


@pytest.mark.parametrize("kind", KINDS)
def test_the_system_is_that_of_mujoco(kind: str, tmp_path: Path) -> None:
    _, fit = identified(kind)
    path, joint = tmp_path / "model.xml", MOTORS[kind]
    write_mjcf(fit.mechanism, path)
    text = path.read_text().replace(
        "</mujoco>", f'<actuator><motor joint="{joint}" gear="1"/></actuator></mujoco>'
    )
    body = mujoco.MjModel.from_xml_string(text)
    # a step of the simplest kind: v' = v + h a(q, v), q' = q + h v'
    body.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    body.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    data = mujoco.MjData(body)
    q, v, u = np.array([0.2, 1.3]), np.array([0.4, -0.7]), np.array([0.05])
    data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, u
    a, b = np.zeros((4, 4)), np.zeros((4, 1))
    mujoco.mjd_transitionFD(body, data, 1e-6, 1, a, b, None, None)
    found = linearize(fit, q, v, actuated=[joint], torque=u)
    h = body.opt.timestep
    # rounding of MuJoCo's differences, 1e-16 / 1e-6, over the step
    np.testing.assert_allclose((a[2:] - np.eye(4)[2:]) / h, found.system.A[2:], rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(b[2:] / h, found.system.B[2:], rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_the_covariance_is_carried_from_the_parameters(kind: str) -> None:
    _, fit = identified(kind)
    q, v = np.array([0.3, 1.2]), np.array([0.5, -1.0])
    motor = [MOTORS[kind]]
    found = linearize(fit, q, v, actuated=motor)
    rows = [[joint.name for joint in fit.mechanism.joints].index(MOTORS[kind])]
    tau = np.zeros(2)
    tau[rows] = found.torque
    columns, best = [], fit.mechanism.values
    for name in fit.shared:
        step = 1e-6 * (abs(best[name]) or 1e-3)
        entries = []
        for sign in (step, -step):
            values = {name: best[name] + sign}
            values |= {size: best[size] * values[length] / best[length]
                       for size, length in fit.tied if length == name}  # fmt: skip
            tree = fit.mechanism.with_values(values).tree
            entries.append(np.hstack(state_matrices(tree, q, v, tau, rows)[:2]))
        change = (entries[0] - entries[1]) / (2.0 * step)
        # B is told in units of what the motor does to its own joint
        row = 2 + rows[0]
        change[:, 4:] -= found.system.B * change[row, 4] / found.system.B[row, 0]
        columns.append(change.ravel())
    slopes = np.stack(columns, axis=1)
    expected = slopes @ fit.shared_covariance @ slopes.T
    # differences of second derivatives: 1e-6 of the largest entry
    size = np.sqrt(np.abs(np.diag(expected)).max())
    np.testing.assert_allclose(
        found.std.ravel(), np.sqrt(np.abs(np.diag(expected))), rtol=1e-3, atol=1e-4 * size
    )
    assert np.all(np.linalg.eigvalsh(found.covariance) > -1e-9 * size**2)


def test_draws_scatter_as_the_covariance_says() -> None:
    _, fit = identified("double")
    q, rest = np.array([np.pi / 2.0, 0.0]), np.zeros(2)
    found = linearize(fit, q, actuated=["joint1"])
    others = [one for seed in (0, 1) for one in drawn(fit, 100, seed=seed, response=Response(q, 0))]
    entries = np.array([np.hstack(state_matrices(one.tree, q, rest, rest, [0])[:2]) for one in others])
    ratio = entries.std(axis=0)[2:, :4] / found.std[2:, :4]
    # 200 draws know a deviation within 5 %, four times that are allowed; the second order adds little
    assert np.all((ratio > 0.8) & (ratio < 1.2)), ratio
    np.testing.assert_allclose(entries[:, 2, 4], found.system.B[2, 0], rtol=2e-3)


def test_states_inputs_and_outputs_have_names() -> None:
    _, fit = identified("cartpole")
    found = linearize(fit, UPRIGHT, actuated=["slide"])
    assert found.system.state_labels == ["slide", "joint1", "slide_vel", "joint1_vel"]
    assert found.system.input_labels == ["slide_torque"]
    assert found.system.output_labels == found.system.state_labels
    assert found.torque == pytest.approx([0.0], abs=1e-9)
    assert max(found.system.poles().real) > 5.0


def test_the_holding_torque_is_the_default() -> None:
    true, fit = identified("double")
    q = np.array([0.4, 0.3])
    found = linearize(fit, q)
    # the weight of both links, by MuJoCo's formula in closed form: sum of m g times the lever arms
    tree = fit.mechanism.tree
    m, c, length = tree.links[:, 5], tree.links[:, 6], tree.links[1, 0]
    second = m[1] * 9.81 * c[1] * np.cos(0.7)
    first = 9.81 * (m[0] * c[0] + m[1] * length) * np.cos(0.4) + second
    assert found.torque == pytest.approx([first, second], rel=1e-9)
    assert needed(tree, q) == pytest.approx([first, second], rel=1e-9)
    assert found.acceleration == pytest.approx([0.0, 0.0], abs=1e-9)
    assert true.joints[0].name == "joint1"


def test_notes_say_what_is_left_out_and_in_which_units_torques_are() -> None:
    _, fit = identified("cartpole")
    assert linearize(fit, UPRIGHT, actuated=["slide"]).notes == (
        "Masses are known up to one factor: torques are those of a mechanism in which the motor at slide "
        f"moves {1.0 / linearize(fit, UPRIGHT).system.B[2, 0]:.3g} kg there; where that is k times as much, "
        "every torque is k times as large.",
    )
    rubbing = replace(
        fit, mechanism=fit.mechanism.with_values({"slide.friction": 0.1, "joint1.friction": 1e-3})
    )
    found = linearize(rubbing, UPRIGHT, actuated=["slide"])
    assert found.notes[0] == "Dry friction is left out of the linear system: it acts at slide and joint1."
    np.testing.assert_allclose(found.system.A, linearize(fit, UPRIGHT).system.A)
    assert not without_dry_friction(rubbing.mechanism.tree).links[:, 10].any()
    driven = replace(fit, mechanism=fit.mechanism.with_torque("fourier", terms=1, period=1.0))
    said = (
        "Torques over time that were identified are left out, of the linear system as of the closed loop in "
        "MuJoCo."
    )
    assert linearize(driven, UPRIGHT).notes[0] == said
    known = [replace(p, std=0.01) if p.name == "cart.mass" else p for p in fit.parameters]
    assert linearize(replace(fit, parameters=tuple(known)), UPRIGHT).notes == ()


def test_a_fit_without_a_covariance_leaves_the_entries_open() -> None:
    _, fit = identified("cartpole")
    found = linearize(replace(fit, covariance=np.full_like(fit.covariance, np.nan)), UPRIGHT)
    assert np.isinf(found.std).any()
    assert drawn(replace(fit, covariance=np.full_like(fit.covariance, np.nan)), 3) == []


def test_bad_input_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    fit = single()
    with refuses(SettingsError, "q: joint 'elbow' is not in the mechanism; joints: 'joint1'."):
        linearize(fit, {"elbow": 1.0})
    said = "q: expected a finite value for each of 1 joints, got [1.0, 2.0]; joints: 'joint1'."
    with refuses(SettingsError, said):
        linearize(fit, [1.0, 2.0])
    with refuses(SettingsError, "actuated: joint 'slide' is not in the mechanism; joints: 'joint1'."):
        linearize(fit, [0.0], actuated=["slide"])
    said = "actuated: expected one or more joints, each once, got none; joints: 'joint1'."
    with refuses(SettingsError, said):
        linearize(fit, [0.0], actuated=[])
    with refuses(SettingsError, "torque: expected one for each of the joints 'joint1', got [1.0, 2.0]."):
        linearize(fit, [0.0], torque=[1.0, 2.0])
    with refuses(
        SettingsError,
        f"linearize: expected an identified mechanism, got a fit without one: {fit.status}",
    ):
        linearize(replace(fit, starts=()), [0.0])
    monkeypatch.setitem(sys.modules, "control", None)
    said = (
        "control: expected the package 'control', which is not installed; install it with "
        "pip install 'monodyn[control]'."
    )
    with refuses(SettingsError, said):
        linearize(fit, [0.0])
