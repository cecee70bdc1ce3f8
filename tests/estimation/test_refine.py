"""Gross errors are left out where they are short and isolated."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.stages import identify
from swings import motion, record, sigmas


def test_gross_errors_and_gaps(poses, double, truth):
    position = poses.position.copy()
    position[[7, 20, 33, 34], [0, 1, 0, 1]] += [1.0, -2.0, 0.5, 0.8]
    position[40:44] = np.nan
    position[50, 1] = np.nan
    fit = identify(replace(poses, position=position), double)
    assert sigmas(fit.parameter("link1.length"), truth.values["link1.length"]) < 4.0
    assert "4 of 56 samples were left out as gross errors (frame 7, 20, 33 and 34)." in fit.advice
    assert np.isnan(fit.residual[0][[7, 40, 50], [0, 0, 1]]).all()


@pytest.mark.slow
def test_a_record_with_what_no_motion_reaches_is_damaged(poses, double):
    """One sample of 1e20: whatever wrote it may have written others."""
    position = poses.position.copy()
    position[20, 1] = 1e20
    fit = identify(replace(poses, position=position), double)
    assert fit.grade == "approximate"
    assert fit.doubts[0].reason == (
        "The record is damaged: 1 of its rows have positions that no motion reaches, up to 1e+20 of joint2. "
        "They were left out; look whether the others are right."
    )


@pytest.mark.slow
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
