"""Torque models of the paper: unknowns, periods, what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.errors import SettingsError
from monodyn.estimation.record.samples import prepare
from monodyn.mechanism import load
from monodyn.paper.identify import identify_published
from monodyn.paper.torque_model import torque_model
from support import refuses, slow
from swings import TIMES, double_truth, motion, record
from waves import PAPER, SMALL, fourier_truth


@pytest.mark.slow
@pytest.mark.parametrize(("series", "count"), [slow("with-friction", 36), ("alone", 34)])
def test_unknowns_of_case_two(series, count):
    """Seven harmonics: 4 sizes, 2 (2 7 + 1) coefficients and, in the paper's count of 36, 2 dampings."""
    times = np.arange(60) / 30.0
    _, poses = fourier_truth(times)
    start = load("double").with_torque("fourier", terms=1, period=1.0)
    start = start.with_choices(fix={"torque.period": 1.1})
    settings = replace(PAPER, torque="fourier", series=series, evaluations=5, starts=1)
    fit = identify_published([poses], start, settings)
    assert len(fit.names) - 4 == count
    assert fit.mechanism.values["torque.period"] == 1.1
    assert (fit.mechanism.values["joint1.damping"] == 0.0) == (series == "alone")


@pytest.mark.parametrize(
    ("frames", "settings", "status"),
    [
        (
            8, replace(PAPER, torque="fourier"),
            "16 measured values cannot determine 34 unknowns; give more frames, fix parameters, or take "
            "fewer harmonics with --identify.terms.",
        ),
        (2, PAPER, "Joint 'joint1' was measured 2 times, 5 are needed; give more frames."),
    ],
)  # fmt: skip
def test_too_few_samples(frames, settings, status):
    _, poses = fourier_truth(TIMES)
    start = load("double").with_torque("fourier", terms=1, period=1.0)
    fit = identify_published([poses[:frames]], start.with_choices(fix={"torque.period": 1.1}), settings)
    assert fit.status == status
    assert not fit.ok
    assert fit.starts == ()
    assert fit.torque == settings.torque


def test_a_joint_seen_three_times_and_too_many_torques():
    truth = double_truth()
    times = np.arange(201) / 30.0
    poses = record(truth, times, motion(truth, times, [0.9, 0.6], [0.0, 0.0]), noise=SMALL)
    holes = poses.position.copy()
    holes[3:, 0] = np.nan
    fit = identify_published([replace(poses, position=holes)], load("double"), PAPER)
    assert fit.status == "Joint 'joint1' was measured 3 times, 5 are needed; give more frames."
    fit = identify_published([poses], load("double"), replace(PAPER, torque="free"))
    assert fit.status == (
        "402 torques, one a joint and time stamp, are too many for the published method; fit at most 200 "
        "frames."
    )


@pytest.mark.slow
def test_a_period_that_is_bounded():
    _, poses = fourier_truth(np.arange(150) / 30.0)
    start = load("double").with_torque("fourier", terms=1, period=2.0)
    start = start.with_choices(bounds={"torque.period": (1.8, 2.5)})
    settings = replace(PAPER, torque="fourier", evaluations=5, starts=1)
    fit = identify_published([poses], start, settings)
    assert 1.8 <= fit.mechanism.values["torque.period"] <= 2.5
    assert "torque.period" not in fit.names
    assert not any("is a bound" in line for line in fit.advice)
    # the motion repeats after some 1.1 s
    start = replace(load("double").with_torque("fourier", terms=1, period=1.0), measured=None)
    start = start.with_choices(bounds={"torque.period": (0.8, 1.05)})
    assert torque_model(start, settings, prepare((poses,), start)).bounded


@pytest.mark.parametrize("bounds", [(1e-9, 1e-8), (20.0, 30.0)])
def test_bounds_that_leave_no_period(bounds):
    """Four samples of a thirtieth of a second, and twice the record of 149/30 s."""
    _, poses = fourier_truth(np.arange(150) / 30.0)
    start = load("double").with_torque("fourier", terms=1, period=bounds[0])
    start = start.with_choices(bounds={"torque.period": bounds})
    fit = identify_published([poses], start, replace(PAPER, torque="fourier", terms=1))
    assert not fit.ok
    assert fit.status == (
        f"torque.period: {bounds[0]:.4g} to {bounds[1]:.4g} s leave no period that the poses can show; "
        "expected bounds that reach into 0.1333 to 9.933 s; widen them with --bounds, or give the period "
        "with --fix torque.period=SECONDS."
    )


def test_less_than_a_period_is_fitted_all_the_same():
    """Two thirds of a swing: the status adds what the paper says."""
    truth = load("single")
    times = np.arange(24) / 30.0
    poses = record(truth, times, motion(truth, times, [1.0], [0.0]), noise=SMALL)
    slow = replace(poses, time=times * 0.75)
    fit = identify_published([slow], load("single"), replace(PAPER, torque="fourier", terms=1))
    assert fit.ok, fit.status
    assert fit.status.endswith(" s; its estimate requires multiple periods.")
    assert " The frames hold 0." in fit.status


@pytest.mark.slow
def test_a_given_period_is_taken():
    _, poses = fourier_truth(TIMES)
    start = load("double").with_torque("fourier", terms=1, period=1.0)
    start = start.with_choices(fix={"torque.period": 0.9})
    fit = identify_published([poses], start, replace(PAPER, torque="fourier", terms=2))
    assert fit.mechanism.values["torque.period"] == 0.9
    assert not any("period" in line for line in (fit.status, *fit.advice))


def test_nothing_to_be_found():
    still = record(load("double"), TIMES, np.zeros((60, 2)))
    fit = identify_published([still], load("double"), PAPER)
    assert fit.status == "Nothing moves in the record: no joint leaves its noise; give frames with motion."
    _, poses = fourier_truth(TIMES)
    fit = identify_published([poses, poses], load("double"), replace(PAPER, torque="free"))
    assert fit.status == "A torque over time belongs to one record; fit them one by one."
    with refuses(SettingsError, "gains: expected alpha above 0 and up to 1 (eq. 7), got 2."):
        identify_published([poses], load("double"), replace(PAPER, gains=(2.0, 0.1, 0.05)))
