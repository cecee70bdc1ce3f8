"""The horizon of a stream: every frame's search ends at its optimum, in few steps."""

from __future__ import annotations

import numpy as np

from monodyn.estimation.settings import IdentifySettings
from monodyn.live.horizon import Horizon
from monodyn.mechanism import load
from monodyn.stages import identify
from swings import double_truth, motion, record

FIXED = {"link1.thickness": 0.006, "link1.width": 0.02, "link2.width": 0.02}
BEGUN, FRAMES = 60, 150
"""Rows that are fitted first, and rows of all."""


def test_every_frame_ends_at_its_optimum() -> None:
    times, truth, started = np.arange(FRAMES) / 30.0, double_truth(), load("double").with_choices(fix=FIXED)
    rows = record(truth, times, motion(truth, times, [0.3, 0.5], [0.0, 1.0]))
    first = rows.part(0, BEGUN)
    fit = identify(first, started, IdentifySettings(torque="friction"))
    horizon = Horizon(fit, started, first, window=1.5, ahead=0.5)
    for k in range(BEGUN, FRAMES):
        estimate = horizon.add(rows.part(k, k + 1))
        assert estimate is not None
        assert estimate.found.converged
        # the last one proves it
        assert estimate.found.evaluations <= 5
    for name in ("link1.length", "link2.length"):
        off = estimate.fit.parameter(name).value - truth.parameter(name).value
        assert abs(off) < 3.0 * estimate.std[name]
