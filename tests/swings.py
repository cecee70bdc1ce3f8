"""Simulated records with known truth, for the tests of the identification."""

import numpy as np

from monodyn.mechanism import load
from monodyn.mechanism.simulate import rollout
from monodyn.types import Poses

NOISE = 0.002
TIMES = np.arange(60) / 30.0
SIZES = ("length", "width", "tail", "tip")


def scaled(mechanism, **factors):
    """Change all sizes of a body together, so that the file's proportions are the truth; ``link1=1.5``."""
    values = mechanism.values
    changed = {}
    for name, value in values.items():
        body, kind = name.split(".", 1) if "." in name else (name, "")
        if body in factors and kind in SIZES:
            changed[name] = value * factors[body]
    return mechanism.with_values(changed)


def motion(mechanism, times, q0, v0, steps=16):
    start = np.array(q0, float), np.array(v0, float)
    return rollout(mechanism.tree, np.asarray(times, float), *start, substeps=steps)[0]


def record(mechanism, times, position, *, noise=NOISE, seed=0, metric=True):
    position = position + noise * np.random.default_rng(seed).normal(size=position.shape)
    names = tuple(joint.name for joint in mechanism.joints)
    covariance = np.tile(noise**2 * np.eye(len(names)), (len(times), 1, 1))
    count = len(times)
    return Poses(names, np.arange(count), times, position, covariance, np.ones(count, dtype=bool), metric)


def double_truth():
    """Return a double pendulum that differs from its file in lengths, a thickness and dampings."""
    values = {"link2.thickness": 0.009, "joint1.damping": 2e-3, "joint2.damping": 1e-3}
    return scaled(load("double"), link1=1.5, link2=0.75).with_values(values)


def sigmas(estimate, true):
    return abs(estimate.value - true) / estimate.std
