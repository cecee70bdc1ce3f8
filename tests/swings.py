"""Simulated records with known truth, for the tests of the identification."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.mechanism import Mechanism, load
from monodyn.mechanism.simulate import rollout
from monodyn.types import Poses

NOISE = 0.002
"""Standard deviation of a measured joint position [rad]."""
TIMES = np.arange(60) / 30.0
"""Time stamps of a record: two seconds of 30 frames each [s], (frame,)."""
SIZES = ("length", "width", "tail", "tip")
"""Kinds of parameters that a picture fixes up to one scale."""


def scaled(mechanism: Mechanism, **factors: float) -> Mechanism:
    """Change all sizes of a body together, so that the file's proportions are the truth; ``link1=1.5``."""
    changed = {}
    for name, value in mechanism.values.items():
        body, kind = name.split(".", 1) if "." in name else (name, "")
        if body in factors and kind in SIZES:
            changed[name] = value * factors[body]
    return mechanism.with_values(changed)


def motion(
    mechanism: Mechanism, times: np.ndarray, q0: Sequence[float], v0: Sequence[float], steps: int = 16
) -> np.ndarray:
    """Return the positions of a free motion, (time, dof), from position and rate at the first time stamp."""
    start = np.array(q0, float), np.array(v0, float)
    return rollout(mechanism.tree, np.asarray(times, float), *start, substeps=steps)[0]


def leaning(position: np.ndarray) -> np.ndarray:
    """Return what two ways of a camera to stand wrong would do, (direction, frame, dof)."""
    return 4e-3 * np.stack([np.cos(2.0 * position), np.sin(position)])


def record(
    mechanism: Mechanism,
    times: np.ndarray,
    position: np.ndarray,
    *,
    noise: float = NOISE,
    seed: int = 0,
    metric: bool = True,
) -> Poses:
    """Return positions, (frame, dof), as measured: with white noise that the record states."""
    position = position + noise * np.random.default_rng(seed).normal(size=position.shape)
    names = tuple(joint.name for joint in mechanism.joints)
    return white(names, times, position, noise, metric=metric)


def white(
    names: tuple[str, ...],
    times: np.ndarray,
    position: np.ndarray,
    noise: float,
    *,
    seen: np.ndarray | None = None,
    metric: bool = True,
) -> Poses:
    """Return positions, (frame, dof), as a record that states the same independent noise for all of them."""
    count = len(times)
    covariance = np.tile(noise**2 * np.eye(len(names)), (count, 1, 1))
    seen = np.ones(count, dtype=bool) if seen is None else seen
    return Poses(names, np.arange(count), times, position, covariance, seen, metric)


def double_truth() -> Mechanism:
    """Return a double pendulum that differs from its file in lengths, a thickness and dampings."""
    values = {"link2.thickness": 0.009, "joint1.damping": 2e-3, "joint2.damping": 1e-3}
    return scaled(load("double"), link1=1.5, link2=0.75).with_values(values)


def sigmas(estimate, true: float) -> float:
    """Return how many of its standard deviations an estimate with ``value`` and ``std`` is off."""
    return abs(estimate.value - true) / estimate.std
