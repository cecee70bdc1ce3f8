"""A small fit and a record for the tests of what follows from a fit."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import av
import numpy as np

import monodyn
from monodyn.estimation.fit import Estimate, Fit
from monodyn.estimation.parts import Combination
from monodyn.mechanism import load
from monodyn.mechanism.simulate import simulate
from monodyn.results.fill import fill
from monodyn.types import Poses

TIME = np.arange(20) / 30.0


@lru_cache
def identified() -> Fit:
    """Identify the bundled single pendulum from 20 simulated frames, one of them not seen."""
    mechanism = load("single")
    rng = np.random.default_rng(5)
    position = simulate(mechanism, TIME, np.array([-1.0]), np.array([0.5])).position
    position = position + 1e-3 * rng.standard_normal((20, 1))
    seen = np.ones(20, bool)
    seen[7] = False
    position[7] = np.nan
    covariance = np.full((20, 1, 1), 1e-6)
    return monodyn.identify(Poses(("joint1",), np.arange(20), TIME, position, covariance, seen), mechanism)


def made_fit(**changes: Any) -> Fit:
    """Return that fit with some of what it says replaced."""
    said = {
        "status": "Identified from 20 frames.",
        "doubts": (),
        "advice": ("Measure <b>one</b> mass & be done.",),
        "parameters": (
            Estimate("link1.length", 0.2, 1e-3, 0.198, 0.202, "m", True, True, False),
            Estimate("joint1.damping", 1e-3, math.inf, 0.0, math.inf, "N m s/rad", True, False, False),
            Estimate("gravity", 9.81, 0.0, 9.81, 9.81, "m/s^2", False, True, False),
        ),
        "combinations": (Combination("joint1.damping / link1.J", 0.123456, 0.00123, 0.121, 0.126),),
    }
    fit = replace(identified(), **{**said, **changes})
    # of as many unknowns as it says there are
    count, states = len(fit.shared), [start.covariance for start in fit.starts]
    covariance = np.zeros((len(fit.names), len(fit.names)))
    for k, own in enumerate(states):
        at = count + k * len(own) + np.arange(len(own))
        covariance[np.ix_(at, at)] = own
    return replace(fit, covariance=covariance, tied=())


def noisy_film(path: Path, size: tuple[int, int] = (96, 64), count: int = 90) -> Path:
    """Write a film of noise, which no encoder makes small, 30 pictures a second."""
    rng = np.random.default_rng(3)
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream("libx264", rate=30, options={"crf": "18"})
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        for _ in range(count):
            noise = rng.integers(0, 256, (size[1], size[0], 3), dtype=np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(noise, "rgb24")))
        container.mux(stream.encode())
    return path


def record(fit: Fit, count: int = 30) -> Poses:
    """Return a record that is 1 mrad above the fitted motion."""
    time = np.arange(count) / 30.0
    position = fill(fit, time).position + 1e-3
    seen = np.ones(count, bool)
    seen[7] = False
    return Poses(("joint1",), np.arange(count), time, position, np.zeros((count, 1, 1)), seen)


def estimates(mechanism, std, *, bound=()):
    """Return estimates of some parameters, their standard deviations by name."""
    found = []
    for name, deviation in std.items():
        p = mechanism.parameter(name)
        clear = np.isfinite(deviation) and deviation < p.value
        found.append(
            Estimate(name, p.value, deviation, p.lower, p.upper, p.unit, True, bool(clear), name in bound)
        )
    return found
