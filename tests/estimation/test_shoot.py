"""Integration steps keep their bound, or it is said."""

import re

import numpy as np
import pytest

from monodyn.estimation.settings import IdentifySettings
from monodyn.stages import identify
from swings import TIMES, motion, record


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
            r"rad \(m for slides\) and not to the required 1e-09; fit a shorter record, or give a larger "
            r"--identify\.error-bound if that is exact enough\.",
            doubt.reason,
        )
        for doubt in fit.doubts
    )
