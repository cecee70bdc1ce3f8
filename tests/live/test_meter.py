"""Frames a second, and how long poses and fits take."""

from __future__ import annotations

import numpy as np
import pytest

from lives import followed, watched
from monodyn.live.meter import LAST, Meter


def test_nothing_is_known_before_two_frames():
    meter = Meter()
    assert meter.pace == (None, None, None)
    meter.add(watched(), now=0.0)
    assert meter.pace == (None, None, None)


@pytest.mark.slow
def test_the_rate_is_that_of_the_last_seconds_and_latencies_those_of_the_last_frames():
    meter = Meter()
    for k in range(100):
        meter.add(watched(k), now=k / 10.0)
    assert meter.pace.rate == pytest.approx(10.0)
    assert meter.pace.pose is None
    rng = np.random.default_rng(1)
    latencies = rng.uniform(0.001, 0.02, 2 * LAST)
    for k, latency in enumerate(latencies.tolist()):
        fresh = 2.0 * latency if k % 2 else None
        meter.add(followed(latency=latency, fresh=fresh), now=10.0 + k / 50.0)
    pace = meter.pace
    assert pace.rate == pytest.approx(50.0, rel=0.02)
    assert pace.pose == pytest.approx(np.percentile(latencies[-LAST:], [50, 99]))
    assert pace.fit == pytest.approx(np.percentile(2.0 * latencies[1::2], [50, 99]))


def test_a_slow_stream_has_a_rate_too():
    meter = Meter()
    for k in range(3):
        meter.add(watched(k), now=5.0 * k)
    assert meter.pace.rate == pytest.approx(0.2)
