"""What goes on from a long stretch of a wild motion, against the fit of that stretch and the truth."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.live.horizon import horizon_of
from monodyn.live.settings import LiveSettings
from monodyn.mechanism import load
from monodyn.stages import identify
from swings import motion, record

pytestmark = pytest.mark.slow
LONG, ALL = 180, 240
"""Rows of the stretch that begins it, and of the whole record."""


@pytest.mark.parametrize("damping", [3e-3, 6e-3])
def test_a_long_stretch_of_a_wild_motion_leaves_the_window_as_it_was_known(damping):
    """A triple pendulum: within the stretch some errors grow a hundredfold while others shrink to nothing."""
    values = {"joint1.damping": 2e-3, "joint2.damping": damping, "joint3.damping": damping}
    truth, times = load("triple").with_values(values), np.arange(ALL) / 30.0
    rows = record(truth, times, motion(truth, times, [1.0, 1.5, 0.5], [0.0, 0.0, 0.0]), noise=5e-4)
    mechanism = load("triple")
    fit = identify(rows.part(0, LONG), mechanism)
    horizon = horizon_of(fit, mechanism, rows.part(0, LONG), LiveSettings())
    assert horizon is not None
    for k in range(LONG, ALL):
        found = horizon.add(rows.part(k, k + 1))
        assert found is not None, k
        assert not found.astray
    lengths = [f"link{number}.length" for number in (1, 2, 3)]
    for name in lengths:
        before, now = fit.parameter(name), found.fit.parameter(name)
        assert now.std == pytest.approx(before.std, rel=0.1)
        assert abs(now.value - truth.values[name]) < 2.0 * now.std
    # the window begins no later than it has to
    assert found.time[0] == pytest.approx(times[-1] - 1.0, abs=0.07)
