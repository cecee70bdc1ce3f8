"""Forty frames with 0.1 deg of noise and sizes as a picture knows them: parameters are recovered."""

import numpy as np
import pytest

from monodyn.estimation.verdict.combinations import inertial_ratios
from monodyn.mechanism import Measured, load
from monodyn.mechanism.simulate import rollout
from monodyn.results.predict import predict
from monodyn.stages import identify
from monodyn.types import Poses
from support import slow
from swings import record

NOISE = np.radians(0.1)
SLIDE_NOISE = 5e-4
TIMES = np.arange(80) / 30.0
FAST = {"q0": [0.9, 1.1], "v0": [4.0, -20.0]}
"""The outer link spins: up to one radian between frames."""

CASES = {
    "single": ({"link1.length": 0.24, "joint1.damping": 1e-3}, [0.6], [0.0]),
    "double": ({"link1.length": 0.23, "link2.length": 0.17, "joint2.damping": 5e-4}, [0.9, 0.4], [0.0, 1.0]),
    "spin": ({"link1.length": 0.18, "link2.length": 0.21, "link2.thickness": 0.005}, FAST["q0"], FAST["v0"]),
    "triple": ({"link1.length": 0.2, "link2.length": 0.16, "link3.length": 0.12}, [0.8, 0.3, 0.2], [0.0] * 3),
    "bob": ({"link1.length": 0.26, "link1.sphere.width": 0.06}, [0.5], [0.5]),
    "cartpole": ({"link1.length": 0.25, "cart.mass": 0.3, "slide.damping": 0.06}, [0.0, 0.6], [0.2, 0.0]),
}


def clip(name, seed):
    """Truth, start as after the picture (proportions within 0.3 and 1 %, wrong scale), noisy poses."""
    values, q0, v0 = CASES[name]
    truth = load("double" if name == "spin" else name).with_values(values)
    rng = np.random.default_rng(seed)
    sizes = [p.name for p in truth.parameters if p.free and p.name.endswith((".length", ".width"))]
    std = np.array([0.003 if size.endswith("length") else 0.01 for size in sizes])
    weight = 1.0 / std**2
    information = np.diag(weight) - np.outer(weight, weight) / weight.sum()
    off = np.log(0.45) + std * rng.normal(size=len(sizes))
    scale = np.exp(np.average(off, weights=weight))
    others = {
        p.name: p.value * scale for p in truth.parameters if p.free and p.name.endswith((".tail", ".tip"))
    }
    wrong = {size: truth.values[size] * np.exp(change) for size, change in zip(sizes, off, strict=True)}
    wrong |= {p.name: 1e-3 for p in truth.parameters if p.name.endswith(".damping")}
    start = truth.with_values({**wrong, **others}).with_measured(Measured(tuple(sizes), information))
    q, _ = rollout(truth.tree, TIMES, np.array(q0), np.array(v0), substeps=16)
    slides = np.array([joint.kind == "slide" for joint in truth.joints])
    noise = np.where(slides, SLIDE_NOISE, NOISE)
    unit = np.where(slides, scale, 1.0)
    position = (q + noise * rng.normal(size=q.shape)) * unit
    covariance = np.tile(np.diag((noise * unit) ** 2), (80, 1, 1))
    names = tuple(joint.name for joint in truth.joints)
    poses = Poses(
        names, np.arange(80), TIMES, position, covariance, np.ones(80, dtype=bool), not slides.any()
    )
    return truth, start, poses, q


@pytest.mark.parametrize("name", [name if name in ("single", "bob") else slow(name) for name in CASES])
def test_forty_frames(name):
    """Five noise seeds: every length within 0.7 % and, over the seeds, errors as large as stated."""
    scores, future_scores = [], []
    for seed in range(5):
        truth, start, poses, q = clip(name, seed)
        fit = identify(poses[:40], start).check()
        for estimate in fit.parameters:
            if estimate.name.endswith(".length"):
                true = truth.values[estimate.name]
                assert estimate.value == pytest.approx(true, rel=0.02 if "cart." in estimate.name else 0.007)
                scores.append((estimate.value - true) / estimate.std)
        ratios = inertial_ratios(truth, truth.tree, full=False)
        scores += [(c.value - ratios[c.name].real) / c.std for c in fit.combinations if c.name in ratios]
        future = predict(fit, times=TIMES[40:])
        future_scores.append((future.position - q[40:]) / future.std)
    # a mean square of n independent standard scores is 1 +- sqrt(2 / n); 10 scores: below 1 + 4 sqrt(0.2)
    assert np.mean(np.square(scores)) < 2.8
    # the errors of one prediction hang together: five scores or little more
    assert np.sqrt(np.mean(np.square(future_scores))) < 2.2


@pytest.mark.parametrize("name", ["single", slow("double")])
def test_whole_clip_gives_the_damping(name):
    """Ten seconds fix damping over inertia to a percent; 3 % is three of its standard deviations and more."""
    values, q0, v0 = CASES[name]
    truth = load(name).with_values(values)
    times = np.arange(300) / 30.0
    q, _ = rollout(truth.tree, times, np.array(q0), np.array(v0), substeps=16)
    poses = record(truth, times, q, noise=NOISE)
    known = {
        p.name: p.value for p in truth.parameters if p.free and p.name.endswith((".width", ".tail", ".tip"))
    }
    fit = identify(poses, load(name).with_choices(fix=known)).check()
    ratios = inertial_ratios(truth, truth.tree, full=False)
    found = {c.name: c.value for c in fit.combinations}
    for ratio, value in ratios.items():
        assert found[ratio] == pytest.approx(value.real, rel=0.03)
