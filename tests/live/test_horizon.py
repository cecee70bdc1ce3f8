"""The horizon of a stream: every search ends at its optimum, in few steps; what goes on from a long stretch
of a wild motion, against the fit of that stretch and the truth."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.estimation.settings import IdentifySettings
from monodyn.live.horizon import Horizon, horizon_of
from monodyn.live.settings import LiveSettings
from monodyn.mechanism import load
from monodyn.stages import identify
from swings import double_truth, motion, record

FIXED = {"link1.thickness": 0.006, "link1.width": 0.02, "link2.width": 0.02}
BEGUN, FRAMES = 60, 150
"""Rows that are fitted first, and rows of all."""
LONG, ALL = 180, 240
"""Rows of a long stretch that begins it, and of the whole record."""


def test_every_frame_ends_at_its_optimum() -> None:
    times, truth, started = np.arange(FRAMES) / 30.0, double_truth(), load("double").with_choices(fix=FIXED)
    rows = record(truth, times, motion(truth, times, [0.3, 0.5], [0.0, 1.0]))
    first = rows[:BEGUN]
    fit = identify(first, started, IdentifySettings(torque="friction"))
    horizon = Horizon(fit, started, first, window=1.5, ahead=0.5)
    for k in range(BEGUN, FRAMES):
        estimate = horizon.add(rows[k : k + 1])
        assert estimate is not None
        assert estimate.found.converged
        # the last one proves it
        assert estimate.found.evaluations <= 5
    for name in ("link1.length", "link2.length"):
        off = estimate.fit.parameter(name).value - truth.parameter(name).value
        assert abs(off) < 3.0 * estimate.std[name]


@pytest.mark.slow
@pytest.mark.parametrize("damping", [3e-3, 6e-3])
def test_a_long_stretch_of_a_wild_motion_leaves_the_window_as_it_was_known(damping):
    """A triple pendulum: within the stretch some errors grow a hundredfold while others shrink to nothing."""
    values = {"joint1.damping": 2e-3, "joint2.damping": damping, "joint3.damping": damping}
    truth, times = load("triple").with_values(values), np.arange(ALL) / 30.0
    rows = record(truth, times, motion(truth, times, [1.0, 1.5, 0.5], [0.0, 0.0, 0.0]), noise=5e-4)
    mechanism = load("triple")
    fit = identify(rows[:LONG], mechanism)
    horizon = horizon_of(fit, mechanism, rows[:LONG], LiveSettings())
    assert horizon is not None
    for k in range(LONG, ALL):
        found = horizon.add(rows[k : k + 1])
        assert found is not None, k
        assert not found.astray
    lengths = [f"link{number}.length" for number in (1, 2, 3)]
    for name in lengths:
        before, now = fit.parameter(name), found.fit.parameter(name)
        assert now.std == pytest.approx(before.std, rel=0.1)
        assert abs(now.value - truth.values[name]) < 2.0 * now.std
    # the window begins no later than it has to
    assert found.time[0] == pytest.approx(times[-1] - 1.0, abs=0.07)
