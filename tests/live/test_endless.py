"""A stream that goes on and on: what a pendulum without friction does, and the memory of who follows it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from clips import simulate
from endless import PERIOD, SWING, followed, let_go

SMALL = replace(SWING, size=(288, 192))
SECONDS = 120.0
"""Of a stream, a fifteenth of what benchmarks/live.py follows."""


@pytest.fixture(scope="module")
def swung():
    return let_go(SMALL)


def test_what_is_let_go_there_is_there_again_after_a_period(swung):
    """By MuJoCo, over ten periods."""
    frames = simulate(replace(swung, seconds=10 * PERIOD / swung.rate))[:, 0]
    assert np.ptp(frames, axis=0).min() > 0.5
    assert np.abs(frames[-PERIOD:] - frames[:PERIOD]).max() < 1e-6


@pytest.mark.slow
def test_the_memory_of_a_stream_does_not_grow(swung):
    found = followed(swung, SECONDS)
    assert found.frames == SECONDS * swung.rate
    assert found.known > 0.99 * found.since > 0.95 * found.frames
    # the poses themselves are kept: a hundred bytes each
    assert found.most(80.0, 120.0) - found.most(20.0, 60.0) < 5.0
