"""Bounds of the published search: about the start, and as wide as is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.record.samples import prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.shooting.problem import posed
from monodyn.mechanism import load
from monodyn.paper.filter import Gains, filtered
from monodyn.paper.fit_bounds import FREE_LENGTH_REACH, MOST_LOADS, SIZE_REACH, bounded
from monodyn.paper.fixed_start import FixedStart, start_states, targets
from swings import TIMES, motion, record


@pytest.mark.parametrize("model", ["friction", "fourier", "free"])
def test_bounds_hold_the_start_and_reach_a_factor(model: str) -> None:
    double = load("double")
    poses = record(double, TIMES, motion(double, TIMES, [0.3, 0.5], [0.0, 1.0]))
    mechanism = replace(double.with_torque(model, terms=2, period=0.9, knots=TIMES[::6]), measured=None)
    problem = posed(mechanism, prepare((poses,), mechanism))
    states = (filtered(poses.time, poses.position, Gains(), poses.covariance),)
    fixed = FixedStart(
        problem=problem, start=start_states(problem.data, states),
        target=targets(problem.data, states, "measured", False)[0], white=None,
        scale=np.ones(len(problem.unknowns)), substeps=8,
    )  # fmt: skip
    unknowns, x = problem.unknowns, problem.unknowns.x0
    found, (low, high) = bounded(fixed, x, (smooth(poses),))
    assert np.all((low <= x) & (x <= high))
    assert np.all(found.scale > 0.0)
    short = unknowns.of_kind("length") & (model == "free")
    reach = np.where(short, FREE_LENGTH_REACH, SIZE_REACH)
    sizes = unknowns.log & (unknowns.of_kind("length") | unknowns.of_kind("thickness"))
    assert sizes.any()
    np.testing.assert_allclose((high - x)[sizes], np.minimum(reach, unknowns.upper - x)[sizes])
    np.testing.assert_allclose((x - low)[sizes], np.minimum(reach, x - unknowns.lower)[sizes])
    if model in MOST_LOADS:
        torques = unknowns.of_kind("torque")
        assert torques.any()
        # bounds of so many loads, scales of a tenth of one
        np.testing.assert_allclose(high[torques], 10.0 * MOST_LOADS[model] * found.scale[torques])
        np.testing.assert_allclose(low[torques], -high[torques])
