"""Intervals from draws, where sizes are assumed that nothing measures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.verdict.posterior import Posterior
from monodyn.estimation.verdict.regrouped import Trees
from monodyn.stages import identify
from swings import TIMES, motion, scaled

NO_TREES = Trees(np.zeros(0), np.zeros(0), np.zeros((0, 0, 0)), np.zeros((2, 0)))


def test_an_interval_leaves_as_much_weight_on_either_side() -> None:
    values = np.random.default_rng(0).exponential(size=20000)
    # draws of twice the scale, weighted to be of scale one
    wide = 2.0 * values
    weights = np.exp(-wide) / np.exp(-0.5 * wide)
    drawn = Posterior(np.zeros((20000, 0)), {}, NO_TREES, weights / weights.sum())
    low, high = drawn.interval(wide)
    assert low == pytest.approx(-np.log(0.975), rel=0.1)
    assert high == pytest.approx(-np.log(0.025), rel=0.05)


def test_sizes_that_are_assumed_have_intervals_of_their_own_shape(fit) -> None:
    tail, width = fit.parameter("link2.tail"), fit.parameter("link2.width")
    # of hardly known sizes a logarithm is about normal: twice and half are as likely
    for size in (tail, width):
        assert 0.0 < size.lower < size.value < size.upper
        assert size.upper - size.value > 1.2 * (size.value - size.lower)
    # what the motion shows has the interval of its covariance
    ratio = next(c for c in fit.combinations if c.name == "link1.J / link2.J")
    assert ratio.upper - ratio.lower == pytest.approx(2.0 * 2.0 * ratio.std, rel=0.1)
    assert ratio.lower < ratio.value < ratio.upper


def test_shifts_that_look_like_another_body_make_intervals_longer(poses, double, truth, fit) -> None:
    other = motion(scaled(truth, link2=1.005), TIMES, [0.3, 0.5], [0.0, 1.0])
    shifts = other - motion(truth, TIMES, [0.3, 0.5], [0.0, 1.0])
    stated = identify(replace(poses, shifts=shifts[None]), double)
    for name in ("link1.J / link2.J", "link2.mx * gravity / link2.J"):
        before, after = (next(c for c in one.combinations if c.name == name) for one in (fit, stated))
        assert after.std > 1.2 * before.std
        # half of the length is what the covariance has it
        assert after.upper - after.lower == pytest.approx(2.0 * 1.96 * after.std, rel=0.15)
