"""A mechanism that begins elsewhere: the same motion with the same bands, or what the dynamics give."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import monodyn
from fits import identified
from monodyn.errors import SettingsError
from monodyn.estimation.parts import Common, Unmodelled
from monodyn.mechanism import load
from monodyn.mechanism.simulate import simulate
from monodyn.results.fill import fill
from monodyn.results.predict import predict
from monodyn.results.restart import acting, restart
from support import refuses


def test_from_a_moment_the_motion_goes_on_as_it_would_have():
    fit, later = identified(), np.linspace(0.31, 1.5, 20)
    begun = restart(fit, at=0.3)
    there, here = fill(fit, later), fill(begun, later)
    np.testing.assert_allclose(here.position, there.position, atol=1e-6)
    np.testing.assert_allclose(here.std, there.std, rtol=1e-4)
    np.testing.assert_allclose(here.velocity_std, there.velocity_std, rtol=1e-4)
    assert begun.time[0][-1] == 0.3


def test_without_a_time_a_record_goes_on_from_its_last_fitted_frame():
    fit = identified()
    end = float(fit.time[0][-1])
    assert restart(fit).starts[0].time == end
    np.testing.assert_allclose(
        predict(restart(fit), until=end + 0.5).position, predict(fit, until=end + 0.5).position, atol=1e-6
    )


def test_what_the_model_lacks_goes_on_after_the_fitted_frames():
    fit = replace(identified(), unmodelled=Unmodelled(np.array([0.01]), np.diag([1e-6, 1e-4])))
    end = float(fit.time[0][-1])
    there = fill(fit, np.array([end + 0.5]))
    start = restart(fit, at=end + 0.5).starts[0]
    np.testing.assert_allclose(
        np.sqrt(np.diag(start.covariance)), [there.std[0, 0], there.velocity_std[0, 0]]
    )


def test_a_given_state_is_exact_and_the_parameters_are_not():
    """Against simulations with the parameters moved along each direction of their covariance."""
    fit, times = identified(), np.linspace(0.0, 1.0, 11)
    begun = restart(fit, {"joint1": 1.2}, {"joint1": -2.0})
    state = np.array([1.2]), np.array([-2.0])
    found = fill(begun, times)
    np.testing.assert_allclose(found.position, simulate(fit.mechanism, times, *state).position, atol=1e-5)
    power, along = np.linalg.eigh(fit.shared_covariance)
    values, variance = fit.mechanism.values, np.zeros(11)
    for std, axis in zip(np.sqrt(np.maximum(power, 0.0)), along.T, strict=True):
        ends = [
            simulate(
                fit.mechanism.with_values(
                    {n: values[n] + sign * 0.01 * std * a for n, a in zip(fit.shared, axis, strict=True)}
                ),
                times, *state, tolerance=1e-9,
            ).position[:, 0]
            for sign in (1.0, -1.0)
        ]  # fmt: skip
        variance += ((ends[0] - ends[1]) / 0.02) ** 2
    np.testing.assert_allclose(found.std[:, 0], np.sqrt(variance), rtol=0.01, atol=1e-6)
    assert begun.starts[0].time == 0.0
    assert restart(fit, {"joint1": 0.0}, at=0.2).starts[0].time == 0.2


def test_a_parameter_that_is_fixed_is_another_one_exactly():
    fit, times = identified(), np.linspace(0.0, 1.0, 11)
    moon = restart(fit, {"joint1": 1.2}, fix={"gravity": 1.62, "joint1.damping": 0.0})
    slow = fit.mechanism.with_values({"gravity": 1.62, "joint1.damping": 0.0})
    expected = simulate(slow, times, np.array([1.2]), np.zeros(1)).position
    np.testing.assert_allclose(fill(moon, times).position, expected, atol=1e-5)
    assert moon.parameter("joint1.damping").std == 0.0
    assert "joint1.damping" not in moon.shared
    assert len(moon.covariance) == len(fit.covariance) - ("joint1.damping" in fit.shared)


@pytest.mark.parametrize("name", ["double", "cartpole", "bob"])
def test_what_acts_is_what_changes_a_simulation(name):
    mechanism, times = monodyn.load(name), np.linspace(0.0, 0.5, 6)
    # with springs, so that where they are slack counts; a coefficient of a series counts too
    springs = {f"{joint.name}.stiffness": 0.05 for joint in mechanism.joints}
    mechanism = mechanism.with_values(springs).with_torque("fourier", terms=1, period=0.3)
    names = [p.name for p in mechanism.parameters if not p.follows]
    state = np.linspace(0.4, 1.1, len(mechanism.joints)), np.linspace(1.0, 2.0, len(mechanism.joints))

    def moved(changed):
        clock = times * changed.values["time_scale"]
        return simulate(changed, clock, *state, tolerance=1e-10).position

    pushed = {n: 0.02 for n in names if n.endswith((".cos1", ".sin1"))}
    mechanism = mechanism.with_values(pushed)
    there = moved(mechanism)
    changing = {
        name
        for name in names
        if np.any(moved(mechanism.with_values({name: 1.05 * mechanism.values[name] + 1e-3})) != there)
    }
    assert acting(mechanism, names) == changing
    assert {"camera.roll", f"{mechanism.bodies[-1]}.offset"} & set(names) <= set(names) - changing


def test_a_parameter_without_effect_on_the_motion_is_refused():
    fit = identified()
    useful = [p.name for p in fit.mechanism.parameters if not p.follows]
    useful = [name for name in useful if name in acting(fit.mechanism, useful)]
    assert {"gravity", "link1.length", "joint1.damping", "time_scale"} <= set(useful)
    for fix, got, it in (
        ({"camera.roll": 0.2}, "camera.roll", "it"),
        (
            {"camera.roll": 0.2, "gravity": 1.62, "joint1.rest": 0.1},
            "camera.roll and joint1.rest",
            "them",
        ),
    ):
        with refuses(
            SettingsError,
            f"fix: expected parameters on which the motion depends ({', '.join(useful)}), got {got}; leave "
            f"{it} out.",
        ):
            restart(fit, fix=fix)


def test_a_lead_acts_where_there_is_friction():
    mechanism = load("double").with_values({"joint1.friction": 0.01})
    for lead in (0.0, 5e-3):
        led = mechanism.with_values({"joint1.lead": lead, "joint2.lead": lead})
        assert acting(led, ["joint1.lead", "joint2.lead"]) == {"joint1.lead"}


def test_a_record_keeps_what_its_own_positions_have_in_common():
    fit = identified()
    common = (Common(np.zeros(1), np.eye(1)), None)
    two = replace(
        fit, starts=fit.starts * 2, time=fit.time * 2, residual=fit.residual * 2, common=common,
        covariance=np.zeros((len(fit.shared) + 8,) * 2),
    )  # fmt: skip
    assert restart(two, record=0).common == common[:1]
    assert restart(two, record=1).common == (None,)


def test_what_cannot_be_is_refused():
    fit = identified()
    for given, message in [
        (
            ({"joint2": 1.0},),
            "restart: joint 'joint2' is not in the mechanism; did you mean 'joint1'?",
        ),
        (({"hip": 1.0},), "restart: joint 'hip' is not in the mechanism; joints: 'joint1'."),
        (
            ({"joint1": np.inf},),
            "restart: expected a number within 1e+06 of 0 for joint1, got inf; correct it.",
        ),
        (
            ({},),
            "restart: expected a position of every joint, got none of joint1; give all of them, as joint1=0.",
        ),
        (
            (None, {"joint1": 1.0}),
            "restart: expected rates together with positions, got rates alone; give both, or neither.",
        ),
    ]:
        with refuses(SettingsError, message):
            restart(fit, *given)
    for given in ([0.5, 0.0], 0.5):
        said = f"restart: expected numbers by name, got {given}; name them, as {{'joint1': 0.5}}."
        with refuses(SettingsError, said):
            restart(fit, given)
        with refuses(SettingsError, said):
            restart(fit, {"joint1": 0.5}, given)
        with refuses(SettingsError, said.replace("joint1", "gravity")):
            restart(fit, fix=given)
    with refuses(SettingsError, "restart: expected a record from 0 to 0, got 1."):
        restart(fit, record=1)
    for at in (1e9, np.nan):
        with refuses(
            SettingsError,
            f"restart: expected a time stamp near the record, which begins at 0 s, got {at:g}; give one of "
            "the clip's clock.",
        ):
            restart(fit, at=at)
    nothing = replace(fit, starts=(), status="Nothing moves.")
    with refuses(
        SettingsError, "restart: expected an identified mechanism, got a fit without one: Nothing moves."
    ):
        monodyn.restart(nothing)
    with pytest.raises(monodyn.MechanismError):
        restart(fit, fix={"nothing": 1.0})
