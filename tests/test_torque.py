"""Torque models against closed forms, the equations of two links and driven pendulums of known period."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from monodyn.errors import SettingsError
from monodyn.estimation.period import estimate_period, periodic_scale
from monodyn.estimation.torque import (
    fourier_basis,
    fourier_coefficients,
    friction_torque,
    inverse_dynamics,
    torque_of_series,
)
from monodyn.mechanism import load
from monodyn.mechanism.drive import FOURIER, Drive
from monodyn.mechanism.dynamics import accelerations
from monodyn.mechanism.tree import DAMPING, INERTIA, MASS

TIMES = np.arange(200) / 30.0
NOISE = np.radians(0.1)


def test_friction_takes_energy_out():
    rate = np.random.default_rng(0).normal(size=(50, 2))
    tau = friction_torque(rate, np.array([0.5, 0.1]), np.array([0.0, 0.2]))
    assert (tau * rate < 0).all()
    np.testing.assert_allclose(tau[:, 0], -0.5 * rate[:, 0])
    fast = np.abs(rate[:, 1]) > 0.2
    np.testing.assert_allclose(tau[fast, 1], -0.1 * rate[fast, 1] - 0.2 * np.sign(rate[fast, 1]))


def test_friction_is_that_of_the_dynamics():
    mechanism = load("double").with_values({"joint1.friction": 0.02, "joint2.damping": 0.03})
    tree, still = mechanism.tree, np.zeros(2)
    q, v = np.array([0.4, -0.7]), np.array([0.013, -2.0])
    bare = tree.links.copy()
    bare[:, [DAMPING, DAMPING + 1]] = 0.0
    damping, friction = tree.links[:, DAMPING], tree.links[:, DAMPING + 1]
    own = accelerations(tree.parent, tree.kind, tree.links, tree.gravity, q, v, still)
    put = accelerations(
        tree.parent, tree.kind, bare, tree.gravity, q, v, friction_torque(v, damping, friction)
    )
    np.testing.assert_allclose(put, own, rtol=1e-12)


def test_series_is_that_of_the_drive():
    coefficients = np.random.default_rng(1).normal(size=(7, 2))
    drive = Drive(FOURIER, np.array([1.3]), coefficients.T)
    np.testing.assert_allclose(fourier_basis(TIMES, 1.3, 3) @ coefficients, drive.at(TIMES), atol=1e-12)


def test_derivatives_of_the_series():
    """Central differences of order two: relative error (w h)^2 / 6 at the third harmonic."""
    step = 1e-4
    for order in (1, 2):
        ahead, behind = (
            fourier_basis(TIMES + d, 1.3, 3, derivative=order - 1) for d in (0.5 * step, -0.5 * step)
        )
        slope = fourier_basis(TIMES, 1.3, 3, derivative=order)
        np.testing.assert_allclose(slope, (ahead - behind) / step, atol=1e-6 * np.abs(slope).max())


def test_coefficients_are_recovered():
    truth = np.random.default_rng(2).normal(size=(5, 2))
    values = fourier_basis(TIMES, 0.9, 2) @ truth
    values[3:20, 0] = np.nan
    np.testing.assert_allclose(fourier_coefficients(TIMES, values, 0.9, 2), truth, atol=1e-10)


def test_inverse_dynamics_undoes_the_dynamics():
    rng = np.random.default_rng(3)
    for name in ("double", "triple", "cartpole"):
        mechanism = load(name)
        tree, dofs = mechanism.tree, len(mechanism.joints)
        q, v, tau = rng.normal(size=(3, 5, dofs))
        a = [
            accelerations(tree.parent, tree.kind, tree.links, tree.gravity, *row)
            for row in zip(q, v, tau, strict=True)
        ]
        np.testing.assert_allclose(inverse_dynamics(mechanism, q, v, np.array(a)), tau, atol=1e-9)


def test_torque_of_a_single_pendulum():
    """tau = I q'' + b q' + m g c sin q of a rod about its end, with q a cosine."""
    mechanism = load("single")
    values, link = mechanism.values, mechanism.tree.links[0]
    com = np.hypot(values["link1.com_x"], values["link1.com_y"])
    inertia = link[INERTIA] + link[MASS] * com**2
    coefficients = np.array([[0.1], [0.3], [0.0]])
    found = torque_of_series(mechanism, coefficients, 0.8, TIMES)[:, 0]
    w = 2 * np.pi / 0.8
    q = 0.1 + 0.3 * np.cos(w * TIMES)
    # the file's zero is the rod along x, so that its weight pulls by cos q
    weight = link[MASS] * 9.81 * com * np.cos(q)
    expected = (
        -0.3 * inertia * w**2 * np.cos(w * TIMES) - link[DAMPING] * 0.3 * w * np.sin(w * TIMES) + weight
    )
    np.testing.assert_allclose(found, expected, atol=1e-12 + 1e-9 * np.abs(expected).max())


def driven(mechanism, torque, times, start):
    """Integrate a driven mechanism by scipy, lightly damped: its free oscillation is still there."""
    tree, dofs = mechanism.tree, len(mechanism.joints)

    def slope(t, y):
        a = accelerations(
            tree.parent, tree.kind, tree.links, tree.gravity, y[:dofs], y[dofs:], np.array(torque(t))
        )
        return np.concatenate((y[dofs:], a))

    found = solve_ivp(
        slope, (0, times[-1]), [*start, *[0.0] * dofs], t_eval=times, rtol=1e-8, atol=1e-10, max_step=0.01
    )
    return found.y[:dofs].T


def noisy(position, seed=0):
    return position + NOISE * np.random.default_rng(seed).normal(size=position.shape)


@pytest.mark.parametrize("period", [0.6, 1.1, 2.3])
@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_period_of_a_driven_double_pendulum(period, scale):
    """With a mechanism of the right proportions, at any common scale, within half a percent."""
    mechanism = load("double")
    w = 2 * np.pi / period
    position = driven(
        mechanism,
        lambda t: (0.02 * np.sin(w * t) + 0.004 * np.cos(2 * w * t), 0.004 * np.sign(np.cos(w * t))),
        TIMES, [-1.5, 0.1],
    )  # fmt: skip
    lengths = {n: scale * v for n, v in mechanism.values.items() if n.endswith((".length", ".tail", ".tip"))}
    found = estimate_period(TIMES, noisy(position), 5, mechanism=mechanism.with_values(lengths))
    assert found.found, found.status
    assert found.seconds == pytest.approx(period, rel=5e-3)
    assert abs(found.seconds - period) < 5 * found.std + 1e-3 * period
    assert found.scale == pytest.approx(1 / scale, rel=0.05)
    shrunk = mechanism.with_values(lengths)
    assert periodic_scale(TIMES, noisy(position), period, 5, shrunk) == pytest.approx(1 / scale, rel=0.05)


@pytest.mark.skipif("MONODYN_DATA" not in os.environ, reason="MONODYN_DATA is not set: no rendered clips")
@pytest.mark.parametrize("frames", [100, 200, 300])
def test_period_of_a_rendered_clip(frames):
    """Its motion is driven with 1.4286 s and swings freely with 1.05 s; sizes are known up to a scale."""
    truth = json.loads((Path(os.environ["MONODYN_DATA"]) / "rendered" / "double_torque.json").read_text())
    (l1, w1, _), (l2, w2, _) = truth["truth"]["links"]
    seen = {"link1.length": l1, "link1.width": w1, "link2.length": l2, "link2.width": w2}
    mechanism = load("double")
    overhang = {name: 1e-9 for name in mechanism.values if name.endswith((".tail", ".tip"))}
    mechanism = mechanism.with_values({name: 0.7 * value for name, value in seen.items()} | overhang)
    times, position = np.array(truth["times"])[:frames], noisy(np.array(truth["q"])[:frames])
    found = estimate_period(times, position, 7, mechanism=mechanism)
    assert found.seconds == pytest.approx(1 / 0.7, rel=5e-3)
    assert found.scale == pytest.approx(1 / 0.7, rel=0.05)


def test_period_of_periodic_poses():
    """Without a mechanism; a decaying oscillation of another period does not mislead."""
    drive = 0.5 * np.cos(2 * np.pi * TIMES / 1.4) + 0.1 * np.sin(4 * np.pi * TIMES / 1.4)
    free = 0.3 * np.exp(-0.5 * TIMES) * np.cos(2 * np.pi * TIMES / 0.93)
    position = noisy(np.stack((drive + free, 0.4 * drive - free), axis=1))
    position[50:60] = np.nan
    found = estimate_period(TIMES, position, 3)
    assert found.seconds == pytest.approx(1.4, rel=0.02)
    assert found.candidates[0].seconds == found.seconds


@pytest.mark.parametrize(
    ("position", "start"),
    [
        (noisy(np.zeros((200, 2))), "Nothing moves in the record"),
        (np.random.default_rng(3).normal(size=(200, 1)), "No"),
        (0.5 * np.cos(2 * np.pi * TIMES / 5.0)[:, None] * [[1.0, 0.4]], "No period of up to 4.42 s"),
        (np.full((200, 2), np.nan), "A period cannot be told from 0 frames"),
    ],
)
def test_periods_that_cannot_be_told(position, start):
    found = estimate_period(TIMES, position, 3)
    assert not found.found
    assert found.status.startswith(start), found.status
    assert found.status.endswith("give more frames, or the period with --fix torque.period=SECONDS.")


def test_bad_input():
    for call, message in (
        (lambda: fourier_basis(TIMES, 0.0, 3), "period: expected a time above 0 s, got 0."),
        (lambda: fourier_basis(TIMES, 1.0, 0), "terms: expected 1 harmonic or more, got 0."),
        (lambda: estimate_period(TIMES, np.zeros((200, 1)), 0), "terms: expected 1 harmonic or more, got 0."),
        (
            lambda: estimate_period(TIMES, np.zeros(200), 1),
            "period: expected positions (frame, dof), got shape (200,).",
        ),
    ):
        with pytest.raises(SettingsError) as caught:
            call()
        assert str(caught.value) == message
