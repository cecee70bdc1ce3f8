"""Identification of simulated motion: estimates, intervals, what stays open."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.record.samples import cut, prepare
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.trial import Trial
from monodyn.estimation.verdict.uncertainty import noise_factors
from monodyn.mechanism import Measured, load
from monodyn.stages import identify
from monodyn.types import Poses
from swings import NOISE, SIZES, TIMES, double_truth, motion, record, scaled, sigmas


@pytest.fixture(scope="module")
def double():
    return load("double")


@pytest.fixture(scope="module")
def truth():
    return double_truth()


@pytest.fixture(scope="module")
def poses(truth):
    return record(truth, TIMES, motion(truth, TIMES, [0.3, 0.5], [0.0, 1.0]))


@pytest.fixture(scope="module")
def fit(poses, double):
    return identify(poses, double)


def test_lengths_and_ratios_lie_in_their_intervals(fit, truth):
    assert fit.ok
    assert fit.check() is fit
    for name in ("link1.length", "link2.length"):
        estimate = fit.parameter(name)
        assert sigmas(estimate, truth.values[name]) < 4.0  # four standard deviations, one seed
        assert estimate.std < 0.002 * estimate.value
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


def test_what_follows_is_known_as_well_as_what_it_follows_from(fit, truth):
    """Masses are open with the thickness; the centre of mass keeps its proportion to the length."""
    for body in ("link1", "link2"):
        for name in (f"{body}.mass", f"{body}.inertia"):
            assert np.isinf(fit.parameter(name).std)
            assert not fit.parameter(name).identifiable
        length, centre = fit.parameter(f"{body}.length"), fit.parameter(f"{body}.com_x")
        assert centre.std / centre.value == pytest.approx(length.std / length.value, rel=1e-6)
        assert centre.lower < truth.values[f"{body}.com_x"] < centre.upper
        assert fit.parameter(f"{body}.com_y").std == 0.0


def test_values_of_the_picture_alone_have_no_interval(poses, double):
    """An offset does not move anything; it follows the length of its body, and is not among the unknowns."""
    seen_so = double.with_values({"link2.offset": -0.008})
    fit = identify(poses, seen_so)
    scale = fit.parameter("link2.length").value / double.values["link2.length"]
    assert ("link2.offset", "link2.length") in fit.tied
    assert fit.parameter("link2.offset").value == pytest.approx(-0.008 * scale, rel=1e-12)
    estimate = fit.parameter("link2.offset")
    assert (estimate.std, estimate.free, estimate.identifiable) == (np.inf, False, False)
    assert estimate.lower < estimate.value < estimate.upper
    assert not any("link2.offset" in line for line in fit.advice)
    known = identify(poses, seen_so.with_choices(fix={"link2.offset": -0.008})).parameter("link2.offset")
    assert (known.value, known.std, known.identifiable) == (-0.008, 0.0, True)


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


def test_free_bodies_give_the_regrouped_inertias(double, truth):
    records = [
        record(truth, TIMES, motion(truth, TIMES, start, rate), seed=seed)
        for seed, (start, rate) in enumerate([([0.3, 0.5], [0.0, 1.0]), ([-2.0, 0.2], [1.0, 0.0])])
    ]
    fit = identify(records, double, IdentifySettings(bodies="free"))
    assert fit.ok
    assert len(fit.starts) == 2
    links = truth.tree.links
    mass, com, inertia = links[:, 5], links[:, 6], links[:, 8]
    about = inertia + mass * com**2 + np.array([mass[1] * links[1, 0] ** 2, 0.0])
    first = mass * com + np.array([mass[1] * links[1, 0], 0.0])
    found = {c.name: c for c in fit.combinations}
    assert sigmas(found["link1.J / link2.J"], about[0] / about[1]) < 4.0
    assert sigmas(found["link1.mx * gravity / link2.J"], 9.81 * first[0] / about[1]) < 4.0
    assert sigmas(found["link1.length * link2.mx / link2.J"], links[1, 0] * first[1] / about[1]) < 4.0
    assert sigmas(found["joint1.damping / link1.J"], 2e-3 / about[0]) < 4.0
    assert sigmas(fit.parameter("link1.length"), truth.values["link1.length"]) < 4.0


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


def test_a_size_the_picture_hardly_knows_keeps_its_proportion(poses, double):
    """Known to a quarter or better counts as measured; motion alone would trade a tail for a thickness."""
    sizes = ("link1.length", "link2.length", "link1.tail", "link2.tail")
    information = np.zeros((4, 4))
    information[:2, :2] = [[100.0, -100.0], [-100.0, 100.0]]
    information[2, 2], information[3, 3] = 15.0, 400.0
    found = identify(poses, double.with_measured(Measured(sizes, information)))
    free = {p.name: p.free for p in found.parameters}
    assert (free["link1.tail"], free["link2.tail"]) == (False, True)
    assert found.parameter("link1.tail").std == np.inf
    assert found.parameter("link2.tail").std < 0.1 * found.parameter("link2.tail").value
    assert any(line.startswith("Nothing tells link1.tail, link1.tip, ") for line in found.advice)


def test_one_size_that_nothing_tells_is_one(poses, double):
    rest = {name: value for name, value in double.values.items() if name.split(".")[-1] in SIZES[1:]}
    del rest["link1.tail"]
    fit = identify(poses, double.with_choices(fix=rest))
    assert (
        "Nothing tells link1.tail; it keeps its proportion to the length of its body, and the intervals take "
        "that for exact. Give a measured value with --fix where its share of the inertia counts."
    ) in fit.advice


def test_correlated_noise_is_judged_by_joint(truth, double):
    """Joints that err together, two and three times as much as stated: that is what comes out."""
    stated, share = np.array([0.001, 0.003]), np.array([[1.0, -0.98], [-0.98, 1.0]])
    covariance = np.outer(stated, stated) * share
    times = np.arange(200) / 30.0
    clean = record(truth, times, motion(truth, times, [0.3, 0.5], [0.0, 1.0]), noise=0.0)
    rng = np.random.default_rng(4)
    noise = 2.0 * rng.multivariate_normal(np.zeros(2), covariance, size=200)
    noise[:, 1] *= 1.5
    noisy = replace(clean, position=clean.position + noise, covariance=np.tile(covariance, (200, 1, 1)))
    data = prepare([noisy], double)
    np.testing.assert_allclose(data.std, np.tile(stated, (200, 1)), rtol=1e-9)
    size, _ = noise_factors(data, noise, 0)
    np.testing.assert_allclose(size, [2.0, 3.0], rtol=0.2)  # 200 samples: 1/sqrt(400) = 5 %, four times that
    fit = identify(noisy, double)
    assert fit.ok
    assert sigmas(fit.parameter("link1.length"), truth.values["link1.length"]) < 4.0


@pytest.mark.parametrize("stamped", [1.0, 3.0])
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
    assert held.std < 0.002 * held.value
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


@pytest.mark.parametrize("model", ["double", "cartpole"])
def test_the_derivative_by_the_time_scale_is_exact(model):
    """Against a central difference of the residuals themselves, slides in the scale of the picture."""
    start = load(model).with_values({"time_scale": 0.7}).with_choices(free=["time_scale"])
    damped = start.with_values({p.name: 0.01 for p in start.parameters if p.name.endswith(".damping")})
    swing = motion(damped, TIMES, [0.1, 0.5], [0.2, 1.0])
    data = prepare([record(damped, TIMES, swing, metric=False)], damped)
    problem = posed(damped, data)
    unknowns = problem.unknowns
    pieces, at = cut(data, 20), unknowns.names.index("time_scale")
    states = np.tile([0.1, 0.5, 0.2, 1.0], (len(pieces.record), 1))
    step, trial = 1e-5 * np.eye(len(unknowns))[at], Trial(unknowns.x0, states, pieces, 4)
    ends = [problem.residuals(trial.at(trial.x + sign * step, states)) for sign in (1.0, -1.0)]
    _, jacobian = problem.rows(trial)
    slope = (ends[0] - ends[1]) / 2e-5
    # the difference is good to 1e-10 by its step and to 1e-11 of the residuals by rounding
    np.testing.assert_allclose(jacobian[:, :, at], slope, rtol=0, atol=1e-7 * np.abs(slope).max())


@pytest.mark.parametrize("model", ["single", "cartpole"])
def test_an_open_time_scale_stays_at_the_start(model):
    """With dry friction, whose smooth sign does not scale, and with slides in the scale of the picture."""
    start, times = load(model).with_values({"time_scale": 0.5}), np.arange(150) / 30.0
    true = scaled(load(model), cart=1.6, link1=1.6).with_values({"joint1.friction": 2e-4})
    slides = [joint.kind == "slide" for joint in true.joints]
    swing = motion(true, times, [0.0, 0.9][-len(slides) :], [0.2, 0.0][-len(slides) :])
    slow = record(start, 3.0 * times, np.where(slides, swing / 1.6, swing), noise=5e-4, metric=False)
    fit = identify(slow, start.with_choices(free=["time_scale", "joint1.friction"]))
    assert fit.ok
    assert np.isinf(fit.parameter("time_scale").std)
    assert fit.parameter("time_scale").value == pytest.approx(0.5, rel=1e-3)  # kept near the start
    length = {c.name: c for c in fit.combinations}[f"{true.joints[0].body}.length / time_scale^2"]
    assert sigmas(length, 9.0 * true.values[f"{true.joints[0].body}.length"]) < 4.0


def test_gravity_against_the_time_scale(poses, double, truth):
    known = {name: value for name, value in truth.values.items() if name.rsplit(".", 1)[-1] in SIZES}
    fit = identify(poses, double.with_choices(fix=known, free=["time_scale", "gravity"]))
    assert sigmas({c.name: c for c in fit.combinations}["time_scale^2 * gravity"], 9.81) < 4.0
    assert (
        "The data do not fix gravity and time_scale one by one; the true frame rate (--rate for a clip, or "
        "--fix time_scale=VALUE) or the value of gravity would fix the rest."
    ) in fit.advice
