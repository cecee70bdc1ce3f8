"""Intervals when the start state is made of the same samples."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares

from monodyn.mechanism import load
from monodyn.paper.identify import identify_published
from monodyn.results.predict import predict
from swings import NOISE, TIMES, double_truth, motion, record
from waves import PAPER


def _std_by_solving_again(problem, best, simulated):
    """Standard deviations of least squares solved anew with each sample moved, start state and all.

    ``problem(p, y)`` gives residuals with samples y. The spread of the residuals tells the noise; and the
    parabola through three samples, of the simulated motion, misses the start rate by what it misses.
    """
    samples, step = problem.samples, 1e-5

    def solve(y, late=0.0):
        found = least_squares(
            lambda p: problem.residuals(p, y, late), best.x, x_scale=[0.1, 1e-3], xtol=1e-14, ftol=1e-14,
            gtol=1e-14,
        )  # fmt: skip
        return found.x, found.fun

    ways, spread = [], 0.0
    for k in range(len(samples)):
        ends = [solve(samples + sign * step * np.eye(len(samples))[k]) for sign in (1.0, -1.0)]
        ways.append((ends[0][0] - ends[1][0]) / (2.0 * step))
        spread += float(np.sum(((ends[0][1] - ends[1][1]) / (2.0 * step)) ** 2))
    variance = max(2.0 * best.cost / spread, NOISE**2)
    missed = problem.rate(simulated) - problem.rate(samples)
    off = (solve(samples, missed)[0] - solve(samples, -missed)[0]) / 2.0
    return np.sqrt(variance * np.sum(np.square(ways), axis=0) + off**2)


@pytest.mark.slow
def test_minimum_and_intervals_against_scipy():
    """Least squares of scipy on its own rollouts: the same minimum, and the same intervals."""
    truth = load("single").with_values({"link1.length": 0.26, "joint1.damping": 2e-3})
    poses = record(truth, TIMES, motion(truth, TIMES, [0.8], [0.0]))
    start = load("single").with_choices(fix={"link1.thickness": truth.values["link1.thickness"]})
    fit = identify_published([poses], start, PAPER)
    width = start.values["link1.width"] / start.values["link1.length"]
    overhang = {
        name: start.values[name] / start.values["link1.length"] for name in start.values
        if name.endswith((".tail", ".tip"))
    }  # fmt: skip

    def rate(y):
        return (-1.5 * y[0] + 2.0 * y[1] - 0.5 * y[2]) * 30.0

    def residuals(p, y, late=0.0):
        sizes = {"link1.length": p[0], "joint1.damping": p[1], "link1.width": width * p[0]}
        other = start.with_values(sizes | {name: share * p[0] for name, share in overhang.items()})
        return motion(other, TIMES, y[:1], [rate(y) + late])[:, 0] - y

    y = poses.position[:, 0]
    best = least_squares(
        lambda p: residuals(p, y), [0.25, 1e-3], x_scale=[0.1, 1e-3], xtol=1e-12, ftol=1e-12, gtol=1e-12
    )
    simulated = residuals(best.x, y) + y
    std = _std_by_solving_again(SimpleNamespace(samples=y, residuals=residuals, rate=rate), best, simulated)
    for i, name in enumerate(("link1.length", "joint1.damping")):
        found = fit.parameter(name)
        assert found.value == pytest.approx(best.x[i], abs=0.02 * std[i])
        assert found.std == pytest.approx(std[i], rel=0.02)


@pytest.mark.slow
def test_intervals_cover_the_truth():
    """95 % intervals of 20 draws, for parameters, start state and prediction, by their std alone."""
    truth, start = double_truth(), np.array([0.9, 0.6, 0.0, 0.0])
    position = motion(truth, TIMES, start[:2], start[2:])
    known = load("double").with_choices(fix={"link1.thickness": truth.values["link1.thickness"]})
    names = ("link1.length", "link2.length", "link2.thickness", "joint1.damping", "joint2.damping")
    inside = []
    for seed in range(20):
        poses = record(truth, TIMES[:40], position[:40], noise=np.radians(0.02), seed=seed)
        fit = identify_published([poses], known, replace(PAPER, starts=1))
        found = [fit.parameter(name) for name in names]
        ahead, state = predict(fit, times=TIMES[40:]), fit.starts[0]
        off = np.abs(np.concatenate((state.position, state.velocity)) - start)
        inside.append(
            [np.mean([e.lower < truth.values[e.name] < e.upper for e in found]),
             np.mean(off < 2.0 * np.sqrt(np.diag(state.covariance))),
             np.mean(np.abs(ahead.position - position[40:]) < 2.0 * ahead.std)]
        )  # fmt: skip
    assert (np.mean(inside, axis=0) > 0.75).all()
