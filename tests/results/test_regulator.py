"""The linear-quadratic regulator of an identified mechanism."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_are, solve_discrete_are

from controllable import MOTORS, UPRIGHT, identified, regulated
from monodyn.errors import SettingsError
from monodyn.mechanism import load
from monodyn.results.linear import state_matrices
from monodyn.results.regulator import Allowed, efforts, equilibrium, lqr, off, sampled, turning
from support import refuses

KINDS = ("cartpole", "double")


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_gains_solve_the_riccati_equation(kind: str) -> None:
    found = regulated(kind)
    a, b = sampled(found.linear.system.A, found.linear.system.B, found.rate)
    q, r = found.state_weight / found.rate, found.torque_weight / found.rate
    cost = solve_discrete_are(a, b, q, r)
    gain = np.linalg.solve(r + b.T @ cost @ b, b.T @ cost @ a)
    np.testing.assert_allclose(found.gain, gain, rtol=1e-6)
    np.testing.assert_allclose(found.cost, cost, rtol=1e-6, atol=1e-9 * np.abs(cost).max())
    assert max(found.poles.real) < 0.0


def test_many_measurements_a_second_give_the_gains_of_continuous_time() -> None:
    _, fit = identified("cartpole")
    found = lqr(fit, UPRIGHT, actuated=["slide"], rate=2e4, draws=0)
    a, b = found.linear.system.A, found.linear.system.B
    cost = solve_continuous_are(a, b, found.state_weight, found.torque_weight)
    # what a hold of 50 us changes: its half times the fastest pole
    np.testing.assert_allclose(found.gain, np.linalg.solve(found.torque_weight, b.T @ cost), rtol=5e-3)


def test_a_held_torque_is_integrated_exactly() -> None:
    a, b = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [2.0]])
    ahead, pushed = sampled(a, b, 10.0)
    # a double integrator: q' = q + h v + h^2 / 2 u
    np.testing.assert_allclose(ahead, [[1.0, 0.1], [0.0, 1.0]], atol=1e-15)
    np.testing.assert_allclose(pushed, [[0.01], [0.2]], atol=1e-15)


@pytest.mark.parametrize("kind", KINDS)
def test_what_the_data_allow_is_held_too(kind: str) -> None:
    true, _ = identified(kind)
    found = regulated(kind)
    stability = found.stability
    assert (stability.draws, stability.stable) == (50, 50)
    assert max(found.poles.real) - 1.0 < stability.worst < 0.0
    # the gains are in units of the identified masses: those of the true one are known here
    row = [joint.name for joint in true.joints].index(MOTORS[kind])
    rest = np.zeros(2)
    a, b, _ = state_matrices(true.tree, found.position, rest, rest, [row])
    factor = found.linear.system.B[2 + row, 0] / b[2 + row, 0]
    assert stability.lightest < factor < stability.heaviest
    ahead, pushed = sampled(a, b, found.rate)
    assert np.max(np.abs(np.linalg.eigvals(ahead - pushed @ found.gain))) < 1.0
    # a factor beyond either end is not held
    a, b = found.linear.system.A, found.linear.system.B
    for factor in (0.9 * stability.lightest, 1.1 * stability.heaviest):
        whole = expm(np.block([[a, b / factor], [np.zeros((1, 5))]]) / found.rate)
        assert np.max(np.abs(np.linalg.eigvals(whole[:4, :4] - whole[:4, 4:] @ found.gain))) > 1.0


def test_the_equilibrium_next_to_what_is_asked_for_is_taken() -> None:
    _, fit = identified("double")
    found = lqr(fit, {"joint1": 1.55, "joint2": 0.03}, actuated=["joint1"], draws=0)
    # any lean of the first link can be held, the second stands upright
    assert found.position.sum() == pytest.approx(np.pi / 2.0, abs=1e-9)
    assert found.position[0] == pytest.approx(1.55, abs=0.02)
    assert found.linear.acceleration == pytest.approx([0.0, 0.0], abs=1e-6)
    assert found.stability.draws == 0
    assert found.stability.worst == pytest.approx(max(found.poles.real))
    # all joints have a motor: any position does
    assert equilibrium(fit.mechanism, np.array([0.3, 0.4]), [0, 1]) == pytest.approx([0.3, 0.4])


def test_torque_is_held_at_the_equilibrium_and_whole_turns_do_not_count() -> None:
    found = regulated("double")
    rest = np.zeros(2)
    assert found.torque_at(0.0, found.position, rest) == pytest.approx(found.linear.torque)
    turned = found.position + np.array([2.0 * np.pi, -4.0 * np.pi])
    assert found.torque_at(0.0, turned, rest) == pytest.approx(found.linear.torque, abs=1e-9)
    np.testing.assert_allclose(
        off(np.array([7.0, 7.0]), np.zeros(2), np.array([True, False])), [7.0 - 2.0 * np.pi, 7.0]
    )
    assert turning(load("cartpole")).tolist() == [False, True]


def test_usual_torques_are_those_of_weight() -> None:
    mechanism = load("single")
    link = mechanism.tree.links[0]
    # level it takes m g c, which some pose out of two hundred comes near
    assert efforts(mechanism, [0]) == pytest.approx([link[5] * 9.81 * link[6]], rel=1e-3)
    cart = load("cartpole")
    assert efforts(cart, [0]) == pytest.approx([9.81 * cart.tree.links[:, 5].sum()])
    floating = mechanism.with_values({"gravity": 1e-12})
    assert efforts(floating, [0]) == pytest.approx([10.0 * (link[8] + link[5] * link[6] ** 2)])


def test_less_allowed_is_held_more_firmly() -> None:
    _, fit = identified("cartpole")
    firm = lqr(fit, UPRIGHT, actuated=["slide"], allowed=Allowed(length=0.01), draws=0)
    assert abs(firm.gain[0, 0]) > 3.0 * abs(regulated("cartpole").gain[0, 0])


def test_bad_input_is_refused() -> None:
    _, fit = identified("double")
    with refuses(
        SettingsError,
        "lqr: expected a position that the motors can hold at rest, but at joint1=0.5, joint2=0 joint "
        f"'joint2', which has none, would need {needs(fit):.3g} N m; give one where the joints without a "
        "motor need no torque.",
    ):
        lqr(fit, {"joint1": 0.5}, actuated=["joint1"])
    said = "lqr: expected a number from 1e-05 to 100000 for effort, got 0; change it."
    with refuses(SettingsError, said):
        lqr(fit, UPRIGHT, actuated=["joint1"], allowed=Allowed(effort=0.0))
    with refuses(
        SettingsError, f"lqr: expected an identified mechanism, got a fit without one: {fit.status}"
    ):
        lqr(replace(fit, starts=()), UPRIGHT, actuated=["joint1"])


def needs(fit) -> float:
    """Return what the second hinge would need: the weight of its link times the lever arm."""
    link = fit.mechanism.tree.links[1]
    return link[5] * 9.81 * link[6] * np.cos(0.5)


def test_motors_that_cannot_steer_are_refused() -> None:
    """Without gravity a motor at the second hinge cannot stop both links from turning."""
    _, fit = identified("double")
    loose = {"gravity": 1e-12, "joint1.damping": 0.0, "joint2.damping": 0.0}
    floating = replace(fit, mechanism=fit.mechanism.with_values(loose))
    said = (
        "lqr: expected motors that can steer every joint there, got 'joint2'; add one, or choose another "
        "position."
    )
    with refuses(SettingsError, said):
        lqr(floating, [0.0, 0.0], actuated=["joint2"])


def test_numbers_that_are_none_are_refused() -> None:
    fit, upright, motors = identified("cartpole")[1], UPRIGHT, [MOTORS["cartpole"]]
    for name, value in (("rate", np.nan), ("rate", 1e300), ("rate", 0.0)):
        with refuses(
            SettingsError,
            f"lqr: expected a number from 1e-05 to 100000 for {name}, got {value:g}; change it.",
        ):
            lqr(fit, upright, actuated=motors, rate=value)
    with refuses(SettingsError, "draws: expected 0 to 100, got -1; give a whole number."):
        lqr(fit, upright, actuated=motors, draws=-1)
    with refuses(SettingsError, f"draws: expected 0 to 100, got {2**70}; give a whole number."):
        lqr(fit, upright, actuated=motors, draws=2**70)
    for seed in (-1, 1.5, np.nan):
        with refuses(SettingsError, f"seed: expected 0 or more, got {seed}; give a whole number."):
            lqr(fit, upright, actuated=motors, seed=seed)
    with refuses(SettingsError, "draws: expected 0 to 100, got 1.5; give a whole number."):
        lqr(fit, upright, actuated=motors, draws=1.5)
    with refuses(SettingsError, "actuated: expected a list of joints, got 'joint1'; give ['joint1']."):
        lqr(fit, upright, actuated="joint1")
    with refuses(SettingsError, "at: expected a number within 1e+06 of 0 for joint1, got nan."):
        lqr(fit, {"joint1": np.nan}, actuated=motors)
