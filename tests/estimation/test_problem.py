"""Residuals of rollouts: their derivatives against differences."""

from dataclasses import replace

import numpy as np
import pytest

from driven import (
    DOUBLE,
    started,
)
from monodyn.estimation.record.samples import cut, ordered, prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.shooting import trial as trials
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.trial import Trial
from monodyn.mechanism import load
from monodyn.mechanism.plan import JOINT
from monodyn.mechanism.upright import ROLL, with_roll
from swings import TIMES, motion, record

TYPICAL = {
    "damping": 0.01, "friction": 2e-3, "stiffness": 0.05, "rest": 0.1,
    "armature": 1e-4, "drag": 1e-4, "air": 1e-4, "lead": 5e-3,
}  # fmt: skip
"""A value of each joint parameter that shows in a swing [SI units of the kind]."""


@pytest.mark.parametrize("kind", JOINT)
@pytest.mark.parametrize("model", ["double", "cartpole"])
def test_the_derivative_by_the_time_scale_is_exact(model, kind):
    """Against a central difference of the residuals themselves, slides in the scale of the picture.

    Each joint law has its own power of time, so that each is tried alone.
    """
    start = load(model).with_values({"time_scale": 0.7}).with_choices(free=["time_scale"])
    acting = (kind, *{"rest": ("stiffness",), "lead": ("friction",)}.get(kind, ()))
    alone = {p.name: TYPICAL[p.kind] * (p.kind in acting) for p in start.parameters if p.kind in JOINT}
    resisted = start.with_values(alone)
    swing = motion(resisted, TIMES, [0.1, 0.5], [0.2, 1.0])
    data = prepare([record(resisted, TIMES, swing, metric=False)], resisted)
    problem = posed(resisted, data)
    unknowns = problem.unknowns
    pieces, at = cut(data, 20), unknowns.names.index("time_scale")
    states = np.tile([0.1, 0.5, 0.2, 1.0], (len(pieces.record), 1))
    step, trial = 1e-5 * np.eye(len(unknowns))[at], Trial(unknowns.x0, states, pieces, 4)
    ends = [problem.residuals(trial.at(trial.x + sign * step, states)) for sign in (1.0, -1.0)]
    _, jacobian = problem.rows(trial)
    slope = (ends[0] - ends[1]) / 2e-5
    # the difference is good to 1e-10 by its step and to 1e-11 of the residuals by rounding; the rate at which
    # friction changes sign is taken to go along with the scale, which leaves a share of its few reversals
    exact = 3e-3 if kind in ("friction", "lead") else 1e-7
    np.testing.assert_allclose(jacobian[:, :, at], slope, rtol=0, atol=exact * np.abs(slope).max())


@pytest.mark.parametrize("kept", [0.0, 0.03])
def test_the_derivative_by_the_roll_is_exact(kept):
    """Against a central difference of the residuals; the record takes part of the roll into account."""
    start = with_roll(load("double"), 0.1, free=True)
    swing = motion(start, TIMES, [0.1, 0.5], [0.2, 1.0])
    poses = replace(record(start, TIMES, swing + np.array([kept, 0.0]), metric=False), roll=kept)
    data = prepare([poses], start)
    # positions are those of a camera without roll, whatever was taken into account
    np.testing.assert_allclose(data.position, record(start, TIMES, swing).position, atol=1e-12)
    problem = posed(start, data)
    pieces, at = cut(data, 20), problem.unknowns.names.index(ROLL)
    states = np.tile([0.2, 0.5, 0.2, 1.0], (len(pieces.record), 1))
    step, trial = 1e-5 * np.eye(len(problem.unknowns))[at], Trial(problem.unknowns.x0, states, pieces, 4)
    ends = [problem.residuals(trial.at(trial.x + sign * step, states)) for sign in (1.0, -1.0)]
    residual, jacobian = problem.rows(trial)
    np.testing.assert_allclose(residual, problem.residuals(trial), atol=1e-9)
    # linear in the roll: rounding alone
    np.testing.assert_allclose(jacobian[:, :, at], (ends[0] - ends[1]) / 2e-5, rtol=0, atol=1e-6 * 500)
    # a start state from the record is against gravity
    smoothed = (smooth(ordered(poses, start)),)
    begun = problem.started(problem.unknowns.x0, pieces, smoothed).states[0]
    assert begun[0] == pytest.approx(swing[0, 0] + 0.1, abs=0.01)


def test_runs_on_all_cores_are_those_of_one(monkeypatch):
    """Pieces are handed out by their integration steps, and come back in order."""
    double = load("double")
    problem = posed(
        double, prepare([record(double, TIMES, motion(double, TIMES, [0.1, 0.5], [0.2, 1.0]))], double)
    )
    pieces = cut(problem.data, 7)
    states = np.random.default_rng(0).normal(scale=0.3, size=(len(pieces.record), 4))
    handed = []
    every = trials.on_all_cores
    monkeypatch.setattr(trials, "on_all_cores", lambda f, items: every(f, handed.append(items) or items))
    at = [Trial(problem.unknowns.x0, states, pieces, substeps) for substeps in (1, 64)]
    together = [problem.moved(one) for one in at]
    steps = 64 * len(problem.data.times)
    assert [len(items) for items in handed] == [steps // trials.STEPS_OF_CHUNK]
    monkeypatch.setattr(trials, "STEPS_OF_CHUNK", steps)
    alone = [problem.moved(one.at(one.x, one.states)) for one in at]
    assert len(handed) == 1
    for one, other in zip(together, alone, strict=True):
        for found, expected in zip(one, other, strict=True):
            assert np.array_equal(found, expected)


@pytest.mark.parametrize("limit", [0.0, 5.0])
def test_the_bend_along_a_step_is_that_of_the_jacobian(limit):
    """Against a central difference of the Jacobian along the step, pieces and start states included."""
    start = load("double")
    swing = motion(start, TIMES, [0.1, 0.5], [0.2, 1.0])
    problem = posed(start, prepare([record(start, TIMES, swing, noise=1e-2)], start))
    pieces, params = cut(problem.data, 20), len(problem.unknowns)
    rng = np.random.default_rng(3)
    count = len(pieces.record)
    states = np.tile([0.1, 0.5, 0.2, 1.0], (count, 1)) + 0.05 * rng.normal(size=(count, 4))
    trial = Trial(problem.unknowns.x0, states, pieces, 4)
    # dampings are no logarithms
    usual = np.array([1e-5 if kind == "damping" else 0.02 for kind in problem.unknowns.kinds])
    step = usual * rng.normal(size=params), 0.02 * rng.normal(size=states.shape)
    by_row = np.repeat(step[1], np.diff(pieces.first), axis=0)
    rows = problem.rows(trial)
    slopes = []
    for sign in (1.0, -1.0):
        _, jacobian = problem.rows(trial.at(trial.x + sign * 1e-3 * step[0], states + sign * 1e-3 * step[1]))
        slopes.append(
            jacobian[:, :, :params] @ step[0] + np.einsum("fil,fl->fi", jacobian[:, :, params:], by_row)
        )
    second = (slopes[0] - slopes[1]) / 2e-3
    if limit:
        second /= 1.0 + np.sum(rows[0] ** 2, axis=1, keepdims=True) / limit**2
    each = np.einsum("fip,fi->fp", rows[1], second)
    wanted = np.add.reduceat(each[:, params:], pieces.first[:-1], axis=0)
    found = problem.bend(problem.model(trial.x, rows, pieces, limit), trial, step, limit)
    # up to the third derivative, at a tenth of the step
    shared = each[:, :params].sum(axis=0)
    np.testing.assert_allclose(found[0], shared, rtol=0.02, atol=1e-3 * np.abs(shared).max())
    np.testing.assert_allclose(found[1], wanted, rtol=0.02, atol=5e-3 * np.abs(wanted).max())


@pytest.mark.parametrize("name", ["joint1.torque.cos1", "torque.period", "time_scale", "link1.length"])
def test_slopes_of_a_driven_rollout_are_differences(name, driven, tmp_path):
    start = started(DOUBLE, tmp_path, 1.1).with_torque("fourier", terms=2, period=2.1)
    start = start.with_choices(free=["time_scale"])
    start = start.with_values({"joint1.torque.cos1": 0.02, "joint2.torque.sin2": 0.01, "time_scale": 1.1})
    record = driven[0][20:40]
    data = prepare((record,), start)
    problem, pieces = posed(start, data), cut(data, 20)
    trial = Trial(problem.unknowns.x0, np.array([[-1.5, 0.3, 0.5, -1.0]]), pieces, 8)
    at, step = problem.unknowns.names.index(name), 1e-5
    _, jacobian = problem.rows(trial)
    moved = []
    for sign in (1, -1):
        near = trial.x.copy()
        near[at] += sign * step
        # a start state is by true time: the same stamps begin elsewhere on another clock
        moved.append(problem.rows(trial.at(near, trial.states))[0])
    difference = (moved[0] - moved[1]) / (2 * step)
    assert np.abs(jacobian[:, :, at] - difference).max() < 1e-5 * np.abs(difference).max()


@pytest.mark.parametrize("model", ["fourier", "free"])
def test_slopes_of_the_torque_are_differences(model):
    knots = np.linspace(0.0, 2.0, 7)
    mechanism = load("double").with_torque(model, terms=2, period=0.7, knots=knots)
    names = tuple(n for n in mechanism.values if ".torque." in n or n == "torque.period")
    rng = np.random.default_rng(1)
    mechanism = mechanism.with_values({n: rng.uniform(0.5, 1.0) for n in names})
    times = np.linspace(0.05, 1.9, 11)
    torque, slopes = mechanism.drive.derivatives(mechanism.directions(names), times)
    assert torque == pytest.approx(mechanism.drive.at(times))
    for k, name in enumerate(names):
        value, step = mechanism.values[name], 1e-6
        ends = [mechanism.with_values({name: value + s * step}).drive.at(times) for s in (1, -1)]
        assert slopes[:, :, k] == pytest.approx((ends[0] - ends[1]) / (2 * step), abs=1e-7)
