"""What is close enough to be used, and the sentence that says so."""

import re
from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.record.samples import Pieces, prepare
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.shoot import Optimum
from monodyn.estimation.shooting.trial import Trial
from monodyn.estimation.verdict.trust import identified, moves_evenly, verdict
from monodyn.estimation.verdict.uncertainty import NoiseFactors
from monodyn.mechanism import load
from monodyn.stages import identify
from swings import motion, record, white


@pytest.mark.slow
def test_motion_of_something_else_is_not_trusted(poses, double):
    rng = np.random.default_rng(1)
    fit = identify(
        replace(poses, position=np.cumsum(rng.normal(size=(60, 2)), axis=0)),
        double,
        IdentifySettings(starts=1),
    )
    assert not fit.ok
    found = re.search(r"typically (joint\d) is off by (\S+) deg, (\S+) % of its motion", fit.status)
    assert found
    joint, off, share = found.groups()
    assert fit.status == (
        f"The simulated motion does not follow the record: typically {joint} is off by {off} deg, {share} % "
        "of its motion; check that the mechanism is the one in the record and that no other force acts on it."
    )
    assert float(share) > 10.0


@pytest.fixture(scope="module")
def bent():
    """Two swings of a pendulum; from the second second on 0.2 rad of something else lies over them."""
    single, times = load("single"), np.arange(120) / 30.0
    swing = motion(single, times, [0.6], [0.0])
    swing[60:, 0] += 0.2 * np.sin(12.0 * (times[60:] - 2.0))
    return record(single, times, swing, noise=1e-3)


@pytest.mark.slow
def test_a_loud_and_large_residual_is_not_trusted(bent):
    """Beyond 20 times the noise and 1.5 % of the range; the first half alone is fine, and is said to be."""
    fit = identify(bent, load("single"))
    size = np.ptp(bent.position)
    assert fit.rms["joint1"] > 0.015 * size
    assert not fit.ok
    found = re.search(r"joint1 (\S+) deg, (\S+) % of its range and (\S+) times", fit.status)
    assert found
    rms, share, noise = found.groups()
    assert fit.status == (
        f"The simulated motion is too far from the record to be used: rms residual of joint1 {rms} deg, "
        f"{share} % of its range and {noise} times the noise of its samples; the advice says what model or "
        "record may lack."
    )
    assert float(rms) == pytest.approx(np.degrees(fit.rms["joint1"]), rel=1e-2)
    assert re.fullmatch(
        r"The first 60 frames alone do fit, with rms residual 0\.0\d+ deg \(joint1\): --fit-frames 0:60 for "
        r"a clip, or a table that ends there\. Small faults of the model grow along a long or chaotic "
        r"record\.",
        fit.advice[0],
    )
    # free bodies were tried, where they were open
    said = "Bodies were taken to be uniform; if they are not, try --identify.bodies free."
    assert said not in fit.advice
    assert said in identify(bent, load("single"), IdentifySettings(bodies="uniform")).advice


@pytest.mark.slow
def test_a_misfit_may_be_a_tilt(bent):
    """Angles of an encoder count from a zero, those of pictures from a vertical, that may be another."""
    told = (
        "Gravity was taken to act straight down where the angles are measured; where it does not (a camera "
        "out of level, the zero of an encoder), --free camera.roll estimates the tilt and --fix "
        "camera.roll=VALUE [rad] gives it (positive turns the picture of the mechanism clockwise)."
    )
    assert told in identify(bent, load("single")).advice
    # a record against gravity has no such doubt, and neither has one that gravity's direction was given for
    assert told not in identify(replace(bent, roll=None), load("single")).advice
    assert told not in identify(bent, load("single").with_choices(fix={"camera.roll": 0.0})).advice
    assert told not in identify(bent[:60], load("single")).advice


def test_a_residual_as_large_as_the_noise_is_fine_however_large(bent):
    """The same record that admits to be inexact."""
    fit = identify(replace(bent, covariance=bent.covariance * 50.0**2), load("single"))
    assert fit.ok
    assert fit.rms["joint1"] > 0.015 * np.ptp(bent.position)


@pytest.mark.parametrize(
    ("share", "noise", "correlation", "grade"),
    [
        (0.016, 21.0, 1.0, "refused"),
        (0.014, 30.0, 1.0, "approximate"),
        (0.016, 19.0, 1.0, "approximate"),
        (0.005, 3.1, 1.0, "approximate"),
        (0.005, 2.9, 1.0, None),
        (0.003, 30.0, 1.0, None),
        (0.003, 30.0, 2.0, "approximate"),
        (0.003, 19.0, 2.0, None),
    ],
)
def test_a_fit_is_doubted_only_where_it_misses_by_both_measures(share, noise, correlation, grade):
    """More than 1.5 % of the range of motion and twenty times the stated noise; or 0.4 % and three times; or
    twenty times what the noise is, changing slowly."""
    single, times = load("single"), np.arange(60) / 30.0
    poses = record(single, times, motion(single, times, [0.6], [0.0]), noise=1e-4)
    problem = posed(single, prepare([poses], single))
    trial = Trial(problem.unknowns.x0, np.array([[0.6, 0.0]]), Pieces(np.array([0, 60]), np.array([0])), 8)
    optimum = Optimum(trial, problem.residuals(trial), 0.0, 1.0, 1, True, np.zeros(1, dtype=bool))
    rms = share * float(np.ptp(poses.position))
    missed = verdict(
        problem, optimum, {"joint1": rms}, NoiseFactors(np.array([noise]), np.array([correlation]))
    )
    assert (None if missed is None else missed.grade) == grade
    if missed is not None and missed.grade == "approximate":
        assert missed.reason == (
            "The simulated motion misses the record by what noise does not explain: rms residual of joint1 "
            f"{np.degrees(rms):.3g} deg, {100.0 * share:.2g} % of its range and {noise:.3g} times the noise "
            "of its samples. The model lacks something, and parameters may be off by more than their "
            "intervals say."
        )
    said = f"Identified from 60 frames; rms residual {np.degrees(rms):.3g} deg (joint1)."
    assert identified(problem, {"joint1": rms}) == said


@pytest.mark.slow
def test_a_straight_line_is_no_motion_of_a_pendulum():
    """It is followed exactly, by links as long or as light as they may be."""
    times = np.arange(150) / 50.0
    for slopes in ((0.5, 1.0), (1.0, -0.5)):
        line = white(("joint1", "joint2"), times, np.outer(times, slopes) - 1.0, 1e-4)
        fit = identify(line, load("double"))
        assert fit.grade == "refused"
        assert fit.status == (
            "The joints move evenly, or not at all: no force shows in the record, and nothing can be told by "
            "it. Record a free swing."
        )


def test_what_moves_evenly():
    """A line with noise does, a slow swing that bends by more does not."""
    single, times = load("single"), np.arange(60) / 30.0
    noisy = 0.3 * times + 3e-4 * np.random.default_rng(0).normal(size=60)
    even = white(("joint1",), times, noisy[:, None], 3e-4)
    assert moves_evenly(prepare([even], single))
    bent = white(("joint1",), times, (noisy + 0.01 * times**2)[:, None], 1e-3)
    assert not moves_evenly(prepare([bent], single))
    assert not moves_evenly(prepare([even, bent], single))
