"""Identified mechanisms that can be controlled, next to the true ones, for the tests of controllers."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from monodyn.estimation.fit import Fit
from monodyn.mechanism import Mechanism, load
from monodyn.results.regulator import Regulator, lqr
from monodyn.stages import identify
from swings import motion, record

TIMES = np.arange(60) / 30.0
STARTS = {"cartpole": (0.1, -0.4), "double": (-0.3, 0.5)}
TRUE: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "cartpole": {"cart.mass": 0.4, "link1.length": 0.24, "slide.damping": 0.02},
        "double": {"link1.length": 0.23, "link2.length": 0.18},
    }
)
"""What differs from the bundled file."""
MOTORS = {"cartpole": "slide", "double": "joint1"}
UPRIGHT = {"joint1": np.pi / 2.0}


@lru_cache
def identified(kind: str) -> tuple[Mechanism, Fit]:
    """Identify a bundled mechanism, whose sizes are others than in the file, from two noisy seconds."""
    true = load(kind).with_values(TRUE[kind])
    position = motion(true, TIMES, STARTS[kind], (0.0, 0.0), steps=32)
    return true, identify(record(true, TIMES, position), load(kind)).check()


@lru_cache
def regulated(kind: str) -> Regulator:
    """Design the regulator that holds it upright."""
    return lqr(identified(kind)[1], UPRIGHT, actuated=[MOTORS[kind]])
