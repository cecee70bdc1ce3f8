"""Identification of simulated motion: estimates, intervals, status, advice, whole messages."""

import re
from dataclasses import replace

import numpy as np
import pytest

from monodyn.errors import FitError, MechanismError, SettingsError, VideoError
from monodyn.estimation.data import prepare
from monodyn.estimation.identify import identify
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.uncertainty import noise_factors
from monodyn.mechanism import Measured, load
from monodyn.mechanism.dynamics import rollout
from monodyn.types import Poses

NOISE = 0.002
TIMES = np.arange(60) / 30.0
SIZES = ("length", "width", "tail", "tip")


def scaled(mechanism, **factors):
    """Change all sizes of a body together, so that the file's proportions are the truth; ``link1=1.5``."""
    values = mechanism.values
    changed = {}
    for name, value in values.items():
        body, kind = name.split(".", 1) if "." in name else (name, "")
        if body in factors and kind in SIZES:
            changed[name] = value * factors[body]
    return mechanism.with_values(changed)


def motion(mechanism, times, q0, v0, steps=16):
    tree = mechanism.tree
    q, _ = rollout(
        tree.parent, tree.kind, tree.links, tree.gravity, np.asarray(times, float), steps,
        np.array(q0, float), np.array(v0, float),
    )  # fmt: skip
    return q


def record(mechanism, times, position, *, noise=NOISE, seed=0, metric=True):
    position = position + noise * np.random.default_rng(seed).normal(size=position.shape)
    names = tuple(joint.name for joint in mechanism.joints)
    covariance = np.tile(noise**2 * np.eye(len(names)), (len(times), 1, 1))
    count = len(times)
    return Poses(names, np.arange(count), times, position, covariance, np.ones(count, dtype=bool), metric)


@pytest.fixture(scope="module")
def double():
    return load("double")


@pytest.fixture(scope="module")
def truth(double):
    values = {"link2.thickness": 0.009, "joint1.damping": 2e-3, "joint2.damping": 1e-3}
    return scaled(double, link1=1.5, link2=0.75).with_values(values)


@pytest.fixture(scope="module")
def poses(truth):
    return record(truth, TIMES, motion(truth, TIMES, [0.3, 0.5], [0.0, 1.0]))


@pytest.fixture(scope="module")
def fit(poses, double):
    return identify(poses, double)


def sigmas(estimate, true):
    return abs(estimate.value - true) / estimate.std


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
        "(see the combinations); one measured mass, thickness or torque, given with --fix, fixes the mass "
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


def test_gross_errors_and_gaps(poses, double, truth):
    position = poses.position.copy()
    position[[7, 20, 33, 34], [0, 1, 0, 1]] += [1.0, -2.0, 0.5, 0.8]
    position[40:44] = np.nan
    position[50, 1] = np.nan
    fit = identify(replace(poses, position=position), double)
    assert sigmas(fit.parameter("link1.length"), truth.values["link1.length"]) < 4.0
    assert "4 of 56 samples were left out as gross errors (frame 7, 20, 33 and 34)." in fit.advice
    assert np.isnan(fit.residual[0][[7, 40, 50], [0, 0, 1]]).all()


def test_a_tail_that_does_not_follow_is_no_gross_error():
    """A pendulum held fast from frame 76 on; what is left out must be short and isolated."""
    single, times = load("single"), np.arange(100) / 30.0
    swing = motion(single, times, [0.9], [0.0])
    swing[76:] = swing[76]
    fit = identify(record(single, times, swing), single)
    assert not fit.ok
    assert not any("gross errors" in line for line in fit.advice)
    assert np.isfinite(fit.residual[0]).all()
    assert fit.advice[0].startswith("The first 50 frames alone do fit, ")


def test_isolated_gross_errors_up_to_a_tenth_are_left_out():
    single, times = load("single"), np.arange(100) / 30.0
    clean = record(single, times, motion(single, times, [0.9], [0.0]))
    position = clean.position.copy()
    rows = [5, 19, 33, 34, 35, 60, 77, 84, 98]
    position[rows, 0] += np.array([1.0, -1.5, 0.8, 0.9, 1.0, -0.7, 2.0, 0.6, -1.0])
    fit = identify(replace(clean, position=position), single)
    assert fit.ok
    assert sigmas(fit.parameter("link1.length"), single.values["link1.length"]) < 4.0
    assert np.flatnonzero(np.isnan(fit.residual[0][:, 0])).tolist() == rows


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


def seen(mechanism, information):
    sizes = ("link1.length", "link2.length")
    return mechanism.with_measured(Measured(sizes, np.array(information)))


@pytest.mark.parametrize("size", [1.0, 1e5, 1e12])
def test_negative_information_of_sizes_is_left_out_and_said(poses, double, fit, size):
    """Eigenvalues 3 and -1: what is below zero would reward sizes for running away."""
    found = identify(poses, seen(double, size * np.array([[1.0, -2.0], [-2.0, 1.0]])))
    assert all(np.isfinite(p.value) for p in found.parameters)
    assert (
        "What the picture knows of the sizes contradicts itself (its information matrix is negative in some "
        "direction); that part was left out, so sizes rest on the motion alone there."
    ) in found.advice
    only = identify(poses, seen(double, size * np.array([[1.5, -1.5], [-1.5, 1.5]])))
    assert found.ok == only.ok
    np.testing.assert_allclose(
        [p.value for p in found.parameters], [p.value for p in only.parameters], rtol=1e-6
    )  # the search stops within 1e-9 of the cost


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


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_information_that_is_no_number_is_a_status(poses, double, value):
    found = identify(poses, seen(double, [[1e4, -1e4], [-1e4, value]]))
    assert not found.ok
    assert found.status == (
        "What the picture knows of link2.length is not a finite number; locate the mechanism in a clearer "
        "part of the clip, or give measured values with --fix."
    )
    assert all(np.isfinite(p.value) for p in found.parameters)
    length = double.values["link2.length"]
    known = seen(double, [[1e4, -1e4], [-1e4, value]]).with_choices(fix={"link2.length": length})
    assert np.isfinite(identify(poses, known).parameter("link1.length").value)


@pytest.mark.parametrize(
    ("change", "status"),
    [
        (
            lambda p: p.part(0, 4),
            "8 measured joint positions cannot determine 10 unknowns (parameters and start states); "
            "give more frames or fix parameters.",
        ),
        (
            lambda p: replace(p, position=np.where(np.arange(60)[:, None] < 40, p.position[:1], np.nan)),
            "Nothing moves in the record: no joint leaves its noise; give frames with motion.",
        ),
        (
            lambda p: replace(p, position=np.where([True, False], p.position, np.nan)),
            "Joint 'joint2' was measured under 5 times in record 0; give more frames.",
        ),
    ],
)
def test_hopeless_records_have_a_status(poses, double, change, status):
    fit = identify(change(poses), double)
    assert not fit.ok
    assert fit.status == status
    with pytest.raises(FitError) as error:
        fit.check()
    assert str(error.value) == status


def test_motion_of_something_else_is_not_trusted(poses, double):
    rng = np.random.default_rng(1)
    fit = identify(
        replace(poses, position=np.cumsum(rng.normal(size=(60, 2)), axis=0)),
        double,
        IdentifySettings(starts=1),
    )
    assert not fit.ok
    assert fit.status.startswith("The simulated motion does not follow the record: typically joint")


@pytest.fixture(scope="module")
def bent():
    """Two swings of a pendulum; from the second second on 0.2 rad of something else lies over them."""
    single, times = load("single"), np.arange(120) / 30.0
    swing = motion(single, times, [0.6], [0.0])
    swing[60:, 0] += 0.2 * np.sin(12.0 * (times[60:] - 2.0))
    return record(single, times, swing, noise=1e-3)


def test_a_loud_and_large_residual_is_not_trusted(bent):
    """Beyond 20 times the noise and 1.5 % of the range; the first half alone is fine, and is said to be."""
    fit = identify(bent, load("single"))
    size = np.ptp(bent.position)
    assert fit.rms["joint1"] > 0.015 * size
    assert not fit.ok
    assert re.fullmatch(
        r"The simulated motion is too far from the record to be used: rms residual of joint1 [\d.]+ deg, "
        r"[\d.]+ % of its range and [\d.]+ times the stated noise; fit fewer frames or let the model have "
        r"what it lacks \(see the advice\)\.",
        fit.status,
    )
    assert re.fullmatch(
        r"The first 60 frames alone do fit, with rms residual 0\.0\d+ deg \(joint1\): --fit-frames 0:60 for "
        r"a clip, or a table that ends there\. Small faults of the model grow along a long or chaotic "
        r"record\.",
        fit.advice[0],
    )
    assert "Bodies were taken to be uniform; if they are not, try --identify.bodies free." in fit.advice
    assert "Dry friction was taken to be zero; --free joint1.friction estimates it." in fit.advice


def test_a_residual_as_large_as_the_noise_is_fine_however_large(bent):
    """The same record that admits to be inexact."""
    fit = identify(replace(bent, covariance=bent.covariance * 50.0**2), load("single"))
    assert fit.ok
    assert fit.rms["joint1"] > 0.015 * np.ptp(bent.position)


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


@pytest.mark.parametrize("bound", [1e-3, 1e-6])
def test_the_integration_keeps_its_bound(poses, double, bound):
    fit = identify(poses, double, IdentifySettings(error_bound=bound))
    start = fit.starts[0]
    exact = motion(fit.mechanism, TIMES, start.position, start.velocity, steps=256)
    error = np.abs(poses.position - fit.residual[0] - exact).max()
    assert error < 1.5 * bound  # the estimate is of leading order
    assert not any("integration steps" in line for line in fit.advice)


def test_an_integration_bound_out_of_reach_is_said(double):
    slow = record(double, 12.0 * TIMES[:24], motion(double, 12.0 * TIMES[:24], [0.3, 0.5], [0.0, 1.0], 512))
    known = double.with_choices(fix={p.name: p.value for p in double.parameters if p.free})
    fit = identify(slow, known, IdentifySettings(starts=1, error_bound=1e-9))
    assert any(
        re.fullmatch(
            r"With 64 integration steps between time stamps, the most there are, the motion is exact to \S+ "
            r"rad \(m for slides\) and not to the 1e-09 asked for; fit fewer frames, or give a larger "
            r"--identify\.error-bound if that is exact enough\.",
            line,
        )
        for line in fit.advice
    )


def test_joint_limits_are_said(poses, double):
    narrow = replace(double, joints=(replace(double.joints[0], lower=-1.0, upper=1.0), double.joints[1]))
    fit = identify(poses, narrow)
    assert any("The motion takes joint1 past its limits, -57.3 deg to 57.3 deg;" in a for a in fit.advice)


def test_bad_input_has_whole_messages(poses, double):
    with pytest.raises(VideoError) as error:
        identify([], double)
    assert str(error.value) == "identify: expected at least one record of joint positions, got none."
    with pytest.raises(VideoError) as error:
        identify(replace(poses, position=np.full((60, 2), np.nan)), double)
    assert str(error.value) == "record 0: expected measured joint positions, got none in 60 rows."
    with pytest.raises(VideoError) as error:
        identify(replace(poses, covariance=0.0 * poses.covariance), double)
    assert str(error.value) == (
        "record 0: the covariance of measured sample 0 is not positive definite; "
        "give each joint a standard deviation above zero."
    )
    with pytest.raises(MechanismError) as error:
        identify(replace(poses, joints=("joint1", "elbw")), double)
    assert str(error.value) == "joint 'elbw' is not in the mechanism; joints: 'joint1', 'joint2'."
    one = Poses(
        ("joint1",), poses.frame, poses.time, poses.position[:, :1], poses.covariance[:, :1, :1], poses.seen
    )
    with pytest.raises(MechanismError) as error:
        identify(one, double)
    assert str(error.value) == (
        "record 0: joint 'joint2' of the mechanism was not measured; joints: 'joint1'."
    )
    with pytest.raises(SettingsError) as error:
        identify(poses, double, IdentifySettings(piece=2))
    assert str(error.value) == "identify.piece: expected 5 to 10000, got 2."
    with pytest.raises(FitError, match=r"^parameter 'x' is not in the fit; parameters: link1\.length, "):
        identify(poses.part(0, 4), double).parameter("x")
