"""Identification of simulated motion: estimates, intervals, what stays open."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.shoot import ROUGH, Route, fit_pieces
from monodyn.estimation.verdict.summary import summarize
from monodyn.mechanism import load
from monodyn.stages import identify
from monodyn.types import Poses
from support import slow
from swings import NOISE, TIMES, motion, record, scaled, sigmas


def test_lengths_and_ratios_lie_in_their_intervals(fit, truth):
    assert fit.ok
    assert fit.check() is fit
    # the motion of one body shows how far the other's hinge is; of the last one, whose ends nothing shows,
    # it shows the inertia
    for name, share in (("link1.length", 0.002), ("link2.length", 0.02)):
        estimate = fit.parameter(name)
        assert sigmas(estimate, truth.values[name]) < 4.0  # four standard deviations, one seed
        assert estimate.std < share * estimate.value
        assert estimate.identifiable
    found = {c.name: c for c in fit.combinations}
    assert sigmas(found["link2.thickness / link1.thickness"], 1.5) < 4.0
    assert sigmas(found["joint2.damping / link1.thickness"], 1e-3 / 0.006) < 4.0


def test_mass_scale_is_open_and_said(fit):
    for name in ("link1.thickness", "link2.thickness", "joint1.damping", "joint2.damping"):
        estimate = fit.parameter(name)
        assert np.isinf(estimate.std)
        assert not estimate.identifiable
    assert fit.advice[0] == (
        "The motion fixes link1.thickness, link2.thickness, joint1.damping and joint2.damping only in ratios "
        "(see the combinations); one of them, measured and given with --fix, fixes the mass "
        "scale."
    )
    assert np.isfinite(fit.covariance).all()


def test_residual_rms_and_start_state(fit, poses):
    assert fit.rms["joint1"] == pytest.approx(
        NOISE, rel=0.4
    )  # 60 samples: 1/sqrt(120) = 9 %, four times that
    assert fit.residual[0].shape == poses.position.shape
    start = fit.starts[0]
    assert np.all(np.abs(start.position - [0.3, 0.5]) < 4.0 * np.sqrt(np.diag(start.covariance)[:2]))
    assert np.all(np.abs(start.velocity - [0.0, 1.0]) < 4.0 * np.sqrt(np.diag(start.covariance)[2:]))
    assert len(fit.names) == len(fit.covariance)
    assert fit.names[-2:] == ("record0.joint1_vel", "record0.joint2_vel")
    assert fit.torque == "friction"


def test_same_input_same_fit(fit, poses, double):
    again = identify(poses, double)
    assert again.parameters == fit.parameters
    np.testing.assert_array_equal(again.covariance, fit.covariance)


def test_one_thickness_fixes_the_mass_scale(poses, double):
    fit = identify(poses, double.with_choices(fix={"link1.thickness": 0.006}))
    assert sigmas(fit.parameter("joint2.damping"), 1e-3) < 4.0
    assert sigmas(fit.parameter("link2.thickness"), 0.009) < 4.0
    assert fit.parameter("link1.thickness").std == 0.0
    assert not any("mass scale" in line for line in fit.advice)


def test_slow_motion_gives_long_lengths(poses, double, truth):
    """Ten times slower time stamps look like lengths a hundred times as long."""
    fit = identify(replace(poses, time=10.0 * poses.time), double)
    assert fit.parameter("link1.length").value == pytest.approx(100 * truth.values["link1.length"], rel=0.005)
    assert any("k^2 times too long" in line for line in fit.advice)


def test_time_scale_is_found_when_lengths_are_known(poses, double, truth):
    names = ("length", "width", "tail", "tip")
    known = {name: value for name, value in truth.values.items() if name.rsplit(".", 1)[-1] in names}
    slow = replace(poses, time=10.0 * poses.time)
    fit = identify(slow, double.with_choices(fix=known, free=["time_scale"]))
    assert sigmas(fit.parameter("time_scale"), 0.1) < 4.0
    assert fit.parameter("time_scale").std < 1e-4


def test_gravity_and_lengths_together_are_open(poses, double):
    fit = identify(poses, double.with_choices(free=["gravity"]))
    for name in ("gravity", "link1.length", "link2.length"):
        assert np.isinf(fit.parameter(name).std)
    names = [c.name for c in fit.combinations]
    assert "gravity / link1.length" in names
    assert "link2.length / link1.length" in names
    assert fit.parameter("gravity").value == pytest.approx(9.81, rel=0.01)  # kept near the start


@pytest.mark.slow
def test_frictionless_joint_ends_on_its_bound(double, truth):
    still = truth.with_values({"joint1.damping": 0.0, "joint2.damping": 0.0})
    fit = identify(record(truth, TIMES, motion(still, TIMES, [0.3, 0.5], [0.0, 1.0]), seed=2), double)
    bound = [p for p in fit.parameters if p.at_bound]
    assert bound
    assert all(p.value == 0.0 and p.lower == 0.0 for p in bound)
    assert any("came out as zero, the smallest value allowed: too small to be seen." in a for a in fit.advice)


def test_cart_in_the_scale_of_the_picture():
    """A slide measured in units of the start: the scale comes from gravity and carries the slide along."""
    start = load("cartpole")
    truth = scaled(start, cart=1.6, link1=1.6).with_values({"cart.mass": 0.3, "slide.damping": 0.05})
    position = motion(truth, TIMES, [0.0, 0.5], [0.2, 0.0]) / [1.6, 1.0]
    fit = identify(record(start, TIMES, position, noise=5e-4, metric=False), start)
    assert fit.ok
    assert fit.scale == pytest.approx(1.6, rel=0.01)
    assert sigmas(fit.parameter("link1.length"), truth.values["link1.length"]) < 4.0
    assert fit.rms["slide"] == pytest.approx(1.6 * 5e-4, rel=0.4)  # metres of the identified scale


def test_two_joints_in_the_other_order(poses, double, fit):
    order = [1, 0]
    swapped = Poses(
        ("joint2", "joint1"), poses.frame, poses.time, poses.position[:, order],
        poses.covariance[:, order][:, :, order], poses.seen,
    )  # fmt: skip
    assert identify(swapped, double).parameters == fit.parameters


@pytest.mark.parametrize("stamped", [slow(1.0), 3.0])
@pytest.mark.parametrize("model", ["single", "double"])
def test_time_scale_and_lengths_together_are_open(model, stamped):
    """Stamped three times slower, lengths come out nine times as long, and nothing says that they are."""
    start = load(model)
    true = scaled(start, link1=1.5).with_values({"joint1.damping": 2e-3})
    joints = len(true.joints)
    swing = motion(true, TIMES, [0.9, 0.5][:joints], [0.0, 1.0][:joints])
    slow = replace(record(true, TIMES, swing), time=stamped * TIMES)
    fit = identify(slow, start.with_choices(free=["time_scale"]))
    assert fit.ok
    lengths = [f"{link}.length" for link in ("link1", "link2")[:joints]]
    for name in ("time_scale", "joint1.damping", *lengths):
        assert np.isinf(fit.parameter(name).std)
        assert not fit.parameter(name).identifiable
    assert fit.parameter("time_scale").value == pytest.approx(1.0, rel=1e-3)  # kept near the start
    found = {c.name: c for c in fit.combinations}
    held = found["link1.length / time_scale^2"]
    assert sigmas(held, stamped**2 * true.values["link1.length"]) < 4.0
    # of a single pendulum nothing but its inertia shows the length
    assert held.std < {"single": 0.02, "double": 0.002}[model] * held.value
    assert "joint1.damping / link1.thickness / link1.length^(7/2)" in found
    assert (
        f"The data do not fix {', '.join(lengths)} and time_scale one by one: lengths are only known up to "
        "the time scale (see the combinations). A measured length, given with --fix, or the true frame rate "
        "(--rate for a clip, or --fix time_scale=VALUE) would fix them."
    ) in fit.advice
    assert any("k^2 times too long" in line for line in fit.advice)
    assert not any("longer record" in line for line in fit.advice)


def test_one_length_fixes_the_time_scale(poses, double, truth):
    known = {"link1.length": truth.values["link1.length"]}
    slow = replace(poses, time=3.0 * poses.time)
    fit = identify(slow, double.with_choices(fix=known, free=["time_scale"]))
    assert sigmas(fit.parameter("time_scale"), 1.0 / 3.0) < 4.0
    assert sigmas(fit.parameter("link2.length"), truth.values["link2.length"]) < 4.0
    assert not any("k^2" in line or "one by one" in line for line in fit.advice)


@pytest.mark.slow
def test_a_rate_that_contradicts_gravity_and_a_length_is_named():
    single = load("single")
    times = np.arange(60) / 120.0
    slow = record(single, 4.0 * times, motion(single, times, [0.5], [0.0]), noise=1e-3)
    given = single.with_choices(fix={"link1.length": single.values["link1.length"]})
    fit = identify(slow, given)
    assert not fit.ok
    assert fit.advice[0] == (
        "Gravity and link1.length, as given, contradict the time stamps; the motion fits at 120 samples a "
        "second (time_scale 0.25). Give the true rate (--rate for a clip, --free time_scale for a table), or "
        "correct the length."
    )
    # with the clock open the length is found to be right
    assert identify(slow, given.with_choices(free=["time_scale"])).ok


def test_a_search_that_is_cut_short_says_so(poses, double, monkeypatch):
    monkeypatch.setattr("monodyn.estimation.identify.TORQUE_WORK", 1.0)
    exchanged = replace(poses, joints=poses.joints[::-1])
    fit = identify(exchanged, double, IdentifySettings(starts=1))
    assert fit.grade == "refused"
    assert fit.advice[-1] == (
        "The search for what acts ended before every kind of torque and every start had been followed to its "
        "end: nothing until then came near the record. --identify.torque names the kind to search for "
        "without this limit."
    )


def test_what_was_found_is_refined_and_judged_whatever_the_search_has_spent(poses, double, monkeypatch):
    """Else intervals from many fits would end at once, and in whatever order threads take them."""
    monkeypatch.setattr("monodyn.estimation.identify.TORQUE_WORK", 1.0)
    left = []

    def judged(*arguments):
        problem, optimum = arguments[0].problem, arguments[0].optimum
        start = optimum.trial.at(problem.unknowns.x0, optimum.trial.states)
        left.append(fit_pieces(problem, start, Route(10, 1e-3, ROUGH), ROUGH).evaluations)
        return summarize(*arguments)

    monkeypatch.setattr("monodyn.estimation.identify.summarize", judged)
    identify(poses, double)
    assert left[0] > 3


def test_a_torque_that_is_named_is_searched_to_the_end(poses, double, monkeypatch):
    expected = identify(poses, double, IdentifySettings(torque="friction"))
    monkeypatch.setattr("monodyn.estimation.identify.TORQUE_WORK", 1.0)
    found = identify(poses, double, IdentifySettings(torque="friction"))
    assert found.evaluations == expected.evaluations
    assert identify(poses, double).evaluations < expected.evaluations
