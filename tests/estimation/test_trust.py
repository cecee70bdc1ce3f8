"""What is close enough to be used, and the sentence that says so."""

import re
from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.settings import IdentifySettings
from monodyn.mechanism import load
from monodyn.stages import identify
from swings import motion, record


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
