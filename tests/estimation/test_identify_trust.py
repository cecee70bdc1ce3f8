"""Records that are odd, wrong or too little: gross errors, status, advice, whole messages."""

import re
from dataclasses import replace

import numpy as np
import pytest

from monodyn.errors import FitError, MechanismError, SettingsError, VideoError
from monodyn.estimation.settings import IdentifySettings
from monodyn.mechanism import Measured, load
from monodyn.stages import identify
from monodyn.types import Poses
from swings import TIMES, double_truth, motion, record, sigmas


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
        r"[\d.]+ % of its range and [\d.]+ times the stated noise; fit a shorter record or let the model "
        r"have what it lacks \(see the advice\)\.",
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
    assert not any("camera.roll" in line for line in fit.advice)


def test_a_misfit_of_pictures_may_be_a_tilted_camera(bent):
    """Angles of an encoder have no camera; those of pictures count from a vertical that may not be one."""
    told = (
        "Gravity was taken straight down in the picture; where the camera was not level, give its tilt with "
        "--fix camera.roll=VALUE [rad] (positive turns the picture of the mechanism clockwise)."
    )
    assert told in identify(replace(bent, metric=False), load("single")).advice
    fine = replace(bent.part(0, 60), metric=False)
    assert told not in identify(fine, load("single")).advice


def test_a_residual_as_large_as_the_noise_is_fine_however_large(bent):
    """The same record that admits to be inexact."""
    fit = identify(replace(bent, covariance=bent.covariance * 50.0**2), load("single"))
    assert fit.ok
    assert fit.rms["joint1"] > 0.015 * np.ptp(bent.position)


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
            r"rad \(m for slides\) and not to the 1e-09 asked for; fit a shorter record, or give a larger "
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
