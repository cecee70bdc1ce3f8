"""Torque models against closed forms and the equations of two links."""

from dataclasses import replace

import numpy as np

from monodyn.errors import SettingsError
from monodyn.mechanism import load
from monodyn.mechanism.drive import FOURIER, Drive
from monodyn.mechanism.simulate import accelerations
from monodyn.mechanism.tree import CREEP, DAMPING, HINGE, INERTIA, MASS
from monodyn.paper.torque import (
    fourier_basis,
    fourier_coefficients,
    inverse_dynamics,
    torque_of_series,
)
from support import refuses

TIMES = np.arange(200) / 30.0


def friction_torque(rate, damping, friction):
    """Return the torque of eq. (9), -b v - f sign(v): against the motion, where the paper prints b v."""
    return -damping * rate - friction * np.tanh(rate / CREEP[HINGE])


def test_friction_is_that_of_the_dynamics():
    mechanism = load("double").with_values({"joint1.friction": 0.02, "joint2.damping": 0.03})
    tree, still = mechanism.tree, np.zeros((1, 2))
    q, v = np.array([[0.4, -0.7]]), np.array([[0.013, -2.0]])
    links = tree.links.copy()
    links[:, [DAMPING, DAMPING + 1]] = 0.0
    bare = replace(tree, links=links)
    damping, friction = tree.links[:, DAMPING], tree.links[:, DAMPING + 1]
    own = accelerations(tree, q, v, still)
    put = accelerations(bare, q, v, friction_torque(v, damping, friction))
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
        dofs = len(mechanism.joints)
        q, v, tau = rng.normal(size=(3, 5, dofs))
        a = accelerations(mechanism.tree, q, v, tau)
        np.testing.assert_allclose(inverse_dynamics(mechanism, q, v, a), tau, atol=1e-9)


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


def test_rates_without_a_mass_matrix():
    """Rates whose accelerations drown a unit torque leave no torque, and no exception."""
    double, table = load("double"), np.array([[0.3, 0.2], [0.3, 0.2]])
    rates = np.array([[1.0, 1.0], [1e150, 1e150]])
    found = inverse_dynamics(double, table, rates, np.zeros((2, 2)))
    assert np.isfinite(found[0]).all()
    assert not np.isfinite(found[1]).any()


def test_bad_input():
    for call, message in (
        (lambda: fourier_basis(TIMES, 0.0, 3), "period: expected a time above 0 s, got 0."),
        (lambda: fourier_basis(TIMES, 1.0, 0), "terms: expected 1 harmonic or more, got 0."),
    ):
        with refuses(SettingsError, message):
            call()
