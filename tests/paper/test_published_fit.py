"""The published least squares on made motion of known truth: Cases I to III, rates, refusals."""

import json
import os
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares

from monodyn.errors import SettingsError
from monodyn.estimation.record.samples import prepare
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.torque.fourier import NO_PERIOD
from monodyn.mechanism import load
from monodyn.mechanism.simulate import rollout
from monodyn.paper.filter import Gains, filtered
from monodyn.paper.fixed_start import FixedStart, start_states, targets
from monodyn.paper.identify import identify_published
from monodyn.paper.settings import PaperIdentifySettings
from monodyn.results.predict import predict
from swings import NOISE, TIMES, double_truth, motion, record, scaled

PAPER = PaperIdentifySettings(method="paper")
SMALL = 2e-4
"""Noise [rad] that leaves the truncation of the filter's start as large as the noise itself."""


def driven(mechanism, times, q0):
    start = np.array(q0), np.zeros(len(q0))
    return rollout(mechanism.tree, times, *start, substeps=16, drive=mechanism.drive)[0]


def fourier_truth(times, period=1.1):
    """Return a driven double pendulum that differs from its file in sizes, and its noisy record."""
    truth = scaled(load("double"), link1=1.4, link2=1.4).with_torque("fourier", terms=2, period=period)
    values = {"joint1.torque.sin1": 0.05, "joint1.torque.cos2": 0.02, "joint2.torque.cos1": 0.01}
    truth = truth.with_values(values)
    return truth, record(truth, times, driven(truth, times, [-1.5, 0.2]), noise=SMALL)


def fixed_start(mechanism, poses):
    problem = posed(replace(mechanism, measured=None), prepare((poses,), mechanism))
    states = (filtered(poses.time, poses.position, Gains(), poses.covariance),)
    return FixedStart(
        problem=problem, start=start_states(problem.data, states),
        target=targets(problem.data, states, "measured", False)[0], white=None,
        scale=np.ones(len(problem.unknowns)), substeps=8,
    )  # fmt: skip


def test_six_unknowns_of_case_one():
    """Start at rest, where the parabola of the filter has the start rates right; lengths within 1 %."""
    truth = double_truth()
    position = motion(truth, TIMES, [0.9, 0.6], [0.0, 0.0])
    fit = identify_published([record(truth, TIMES[:40], position[:40], noise=SMALL)], load("double"), PAPER)
    assert fit.ok, fit.status
    assert fit.status.startswith("Identified 6 unknowns by the published method from 40 frames")
    assert fit.names[:6] == (
        "link1.length", "link1.thickness", "link2.length", "link2.thickness", "joint1.damping",
        "joint2.damping",
    )  # fmt: skip
    assert fit.names[6:] == ("record0.joint1", "record0.joint2", "record0.joint1_vel", "record0.joint2_vel")
    assert dict(fit.tied)["link1.width"] == "link1.length"
    for name in ("link1.length", "link2.length"):
        assert fit.parameter(name).value == pytest.approx(truth.values[name], rel=0.01)
    ratio = fit.mechanism.values["link2.thickness"] / fit.mechanism.values["link1.thickness"]
    assert ratio == pytest.approx(truth.values["link2.thickness"] / truth.values["link1.thickness"], rel=0.1)
    assert max(fit.rms.values()) < np.radians(0.5)
    rates = np.sqrt(np.diag(fit.starts[0].covariance)[2:])
    assert (rates > 0.999 * SMALL * np.sqrt(1.5**2 + 2.0**2 + 0.5**2) * 30.0).all()
    assert not fit.parameter("link1.thickness").identifiable
    ahead = predict(fit, times=TIMES[40:])
    assert np.sqrt(np.mean((ahead.position - position[40:]) ** 2)) < np.radians(3.0)


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


@pytest.mark.parametrize("model", ["friction", "fourier", "free"])
def test_jacobian_against_the_tangents(model):
    """Central differences against the exact derivatives of the default problem: step 1e-6, order two."""
    mechanism = load("double").with_torque(model, terms=2, period=0.9, knots=TIMES[:8])
    names = [name for name in mechanism.values if ".torque." in name]
    mechanism = mechanism.with_values(dict.fromkeys(names, 0.01))
    poses = record(mechanism, TIMES[:8], driven(mechanism, TIMES[:8], [0.5, 0.1]), noise=1.0)
    fixed = fixed_start(mechanism, poses)
    x = fixed.problem.unknowns.x0
    jacobian = fixed.jacobian(x)
    _, expected = fixed.problem.rows(fixed.trial(x))
    expected = expected[:, :, : len(x)]
    scale = np.maximum(np.abs(expected).max(axis=(0, 1)), 1e-9)
    assert np.abs((jacobian - expected) / scale).max() < 1e-4


def test_case_two_finds_period_and_torque():
    """With the thicknesses known the torque is within 8 % and the period within 1 %."""
    times = np.arange(150) / 30.0
    truth, poses = fourier_truth(times)
    known = {name: truth.values[name] for name in ("link1.thickness", "link2.thickness")}
    start = load("double").with_choices(fix=known)
    fit = identify_published([poses], start, replace(PAPER, torque="fourier", terms=3))
    assert fit.ok, fit.status
    assert fit.torque == "fourier"
    assert fit.mechanism.values["torque.period"] == pytest.approx(1.1, rel=0.01)
    assert max(fit.rms.values()) < np.radians(0.3)
    torque, expected = fit.mechanism.drive.at(times), truth.drive.at(times)
    error = np.sqrt(np.mean((torque - expected) ** 2, axis=0) / np.mean(expected**2, axis=0))
    assert (error < 0.08).all()


@pytest.mark.parametrize(("series", "count"), [("with-friction", 36), ("alone", 34)])
def test_unknowns_of_case_two(series, count):
    """Seven harmonics: 4 sizes, 2 (2 7 + 1) coefficients and, in the paper's count of 36, 2 dampings."""
    times = np.arange(60) / 30.0
    _, poses = fourier_truth(times)
    start = load("double").with_torque("fourier", terms=1, period=1.0)
    start = start.with_choices(fix={"torque.period": 1.1})
    settings = replace(PAPER, torque="fourier", series=series, evaluations=5, starts=1)
    fit = identify_published([poses], start, settings)
    assert len(fit.names) - 4 == count
    assert fit.mechanism.values["torque.period"] == 1.1
    assert (fit.mechanism.values["joint1.damping"] == 0.0) == (series == "alone")
    assert any("--identify.evaluations" in line for line in fit.advice)


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


def test_case_three_on_a_chaotic_second():
    """Thirty frames: it may not follow, and says so; bodies keep near the file's, nothing has an interval."""
    truth, shown = double_truth(), []
    position = motion(truth, TIMES[:30], [0.9, 0.6], [0.0, 0.0])
    poses = record(truth, TIMES[:30], position, noise=np.radians(0.1))
    settings = replace(PAPER, torque="free", evaluations=10)
    fit = identify_published([poses], load("double"), settings, lambda *step: shown.append(step))
    if fit.ok:
        assert max(fit.rms.values()) < 0.05 * np.std(position, axis=0).max()
    else:
        assert re.search("does not follow|ended before its minimum", fit.status)
    for name in ("link1.length", "link2.length"):
        assert 1.0 / 10.0 < fit.mechanism.values[name] / truth.values[name] < 10.0
    assert all(np.isinf(e.std) and not e.identifiable for e in fit.parameters if e.free)
    assert any("are arbitrary" in line for line in fit.advice)
    assert not any("follow from gravity" in line for line in fit.advice)
    assert len(shown) > 1
    assert sorted(step[1] for step in shown) == [step[1] for step in shown]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_case_three_on_two_thirds_of_a_second(seed):
    truth = double_truth()
    position = motion(truth, TIMES[:20], [0.9, 0.6], [0.0, 0.0])
    poses = record(truth, TIMES[:20], position, noise=np.radians(0.1), seed=seed)
    fit = identify_published([poses], load("double"), replace(PAPER, torque="free"))
    assert fit.ok, fit.status
    assert max(fit.rms.values()) < np.radians(0.2)
    for body in ("link1", "link2"):  # within the bounds about the start, which is within two of the truth
        assert 1.0 / 6.0 < fit.mechanism.values[f"{body}.length"] / truth.values[f"{body}.length"] < 6.0


def test_gains_without_effect_and_ringing():
    truth = load("single").with_values({"link1.length": 0.26})
    poses = record(truth, TIMES, motion(truth, TIMES, [0.8], [0.0]))
    usual, other = (
        identify_published([poses], load("single"), replace(PAPER, gains=gains))
        for gains in (PAPER.gains, (0.5, 0.1, 0.01))
    )
    assert usual.parameter("link1.length") == other.parameter("link1.length")
    assert not any("gains" in line for line in usual.advice)
    assert any("no effect" in line for line in other.advice)
    ringing = identify_published([poses], load("single"), replace(PAPER, states="filtered"))
    assert any("gamma below 0.05" in line for line in ringing.advice)


def test_case_three_follows_the_noise():
    """2 k + 4 unknowns: the simulated motion is nearer to the noisy poses than these are to the truth."""
    truth = double_truth()
    noise, frames = np.radians(0.1), 12
    position = motion(truth, TIMES[:frames], [0.9, 0.6], [0.0, 0.0])
    poses = record(truth, TIMES[:frames], position, noise=noise)
    fit = identify_published([poses], load("double"), replace(PAPER, torque="free"))
    assert fit.ok, fit.status
    assert len(fit.names) - 4 == 2 * frames + 4
    assert max(fit.rms.values()) < 0.5 * np.sqrt(np.mean((poses.position - position) ** 2))
    assert fit.mechanism.values["joint1.damping"] == 0.0
    assert any("underdetermined" in line for line in fit.advice)


def test_filtered_states_make_it_worse():
    """The filter lags, which the paper saw too; rates through the same filter on both sides do not suffer."""
    truth = double_truth()
    position = motion(truth, TIMES, [0.9, 0.6], [0.0, 0.0])
    poses = record(truth, TIMES[:40], position[:40])
    error = {}
    for name, settings in (
        ("measured", {}),
        ("filtered", {"states": "filtered"}),
        ("rates", {"rates": True}),
        ("both", {"states": "filtered", "rates": True}),
    ):
        fit = identify_published([poses], load("double"), replace(PAPER, starts=1, **settings))
        simulated = predict(fit, times=TIMES[40:])
        error[name] = np.sqrt(np.mean((simulated.position - position[40:]) ** 2))
    assert error["filtered"] > 2.0 * max(error["measured"], error["rates"], error["both"])


NO_CLIPS = pytest.mark.skipif(
    "MONODYN_DATA" not in os.environ, reason="MONODYN_DATA is not set: no rendered clips"
)


def rendered(clip, frames, noise):
    """Return a record of a rendered clip's true motion with noise, its start mechanism and its truth."""
    truth = json.loads((Path(os.environ["MONODYN_DATA"]) / "rendered" / f"{clip}.json").read_text())
    times, position = np.array(truth["times"])[:frames], np.array(truth["q"])[:frames]
    (l1, w1, _), (l2, w2, _) = truth["truth"]["links"]
    seen = {"link1.length": l1, "link1.width": w1, "link2.length": l2, "link2.width": w2}
    start = load("double").with_values({name: 0.6 * value for name, value in seen.items()})
    tails = {n: 1e-9 for n in start.values if n.endswith((".tail", ".tip"))}
    start = start.with_values(tails)
    return record(start, times, position, noise=noise), start, truth


@NO_CLIPS
@pytest.mark.parametrize("clip", ["double_a", "double_b"])
def test_rendered_pendulums(clip):
    """The true motion of a rendered clip with the noise of a tracker: within 3 degrees over 40 frames."""
    poses, start, truth = rendered(clip, 40, np.radians(0.02))
    fit = identify_published([poses], start, PAPER)
    assert fit.ok, fit.status
    assert max(fit.rms.values()) < np.radians(3.0)
    assert fit.parameter("link1.length").value == pytest.approx(truth["truth"]["links"][0][0], rel=0.05)


@NO_CLIPS
def test_a_passive_pendulum_has_no_period():
    """Its series would make up for the held start state, with a torque that stands out and is not there."""
    poses, start, _ = rendered("double_a", 300, 1e-3)
    fit = identify_published([poses], start, replace(PAPER, torque="fourier"))
    assert not fit.ok
    assert fit.status == NO_PERIOD


def test_gaps_and_joints_out_of_order():
    truth = double_truth()
    position = motion(truth, TIMES, [0.9, 0.6], [0.0, 0.0])
    poses = record(truth, TIMES[:40], position[:40], noise=SMALL)
    holes = poses.position.copy()
    holes[10:14] = holes[20, 1] = np.nan
    turned = replace(
        poses, joints=poses.joints[::-1], position=holes[:, ::-1],
        covariance=poses.covariance[:, ::-1, ::-1],
    )  # fmt: skip
    fit = identify_published([turned], load("double"), PAPER)
    assert fit.ok, fit.status
    assert fit.parameter("link1.length").value == pytest.approx(truth.values["link1.length"], rel=0.02)
    assert np.isnan(fit.residual[0][10:14]).all()
    assert np.isnan(fit.residual[0][20, 1])
    assert np.isfinite(fit.residual[0][20, 0])


def test_two_records_share_the_parameters():
    truth = double_truth()
    records = [
        record(truth, TIMES[:40], motion(truth, TIMES[:40], q0, [0.0, 0.0]), noise=SMALL, seed=seed)
        for seed, q0 in enumerate(([0.9, 0.6], [-0.5, 1.2]))
    ]
    fit = identify_published(records, load("double"), PAPER)
    assert fit.ok, fit.status
    assert len(fit.starts) == len(fit.residual) == 2
    assert fit.parameter("link2.length").value == pytest.approx(truth.values["link2.length"], rel=0.01)


def test_slides_in_the_start_scale():
    """A cart seen by a camera: its slide is in the scale of the file until gravity has told the lengths.

    Hardly any noise: a wrong start rate makes a cart drift away.
    """
    truth = load("cartpole").with_values({"slide.damping": 0.05})
    position = motion(truth, TIMES, [0.0, 0.6], [0.0, 0.0])
    sizes = {
        n: 0.5 * v for n, v in truth.values.items() if n.endswith((".length", ".width", ".tail", ".tip"))
    }
    poses = record(truth, TIMES, position * [0.5, 1.0], noise=2e-6, metric=False)
    fit = identify_published([poses], truth.with_values(sizes), PAPER)
    assert fit.ok, fit.status
    assert fit.scale == pytest.approx(2.0, rel=0.05)
    np.testing.assert_allclose(fit.starts[0].position, position[0], atol=0.01)


def test_a_joint_seen_late_starts_by_its_acceleration():
    """Exact for constant accelerations, which the filter follows exactly."""
    times = np.arange(12) / 30.0
    position = np.stack((0.1 + times, 0.3 - times + 2.0 * times**2), axis=1)
    poses = record(load("double"), times, position, noise=0.0)
    holes = position.copy()
    holes[:3, 1] = np.nan
    poses = replace(poses, position=holes, covariance=np.tile(np.eye(2), (12, 1, 1)))
    fixed = fixed_start(load("double"), poses)
    np.testing.assert_allclose(fixed.start, [[0.1, 0.3, 1.0, -1.0]], atol=1e-10)


@pytest.mark.parametrize(
    ("frames", "settings", "status"),
    [
        (
            8, replace(PAPER, torque="fourier"),
            "16 measured values cannot determine 36 unknowns; give more frames, fix parameters, or take "
            "fewer harmonics with --identify.terms.",
        ),
        (2, PAPER, "Joint 'joint1' was measured 2 times, 5 are needed; give more frames."),
    ],
)  # fmt: skip
def test_too_few_samples(frames, settings, status):
    _, poses = fourier_truth(TIMES)
    start = load("double").with_torque("fourier", terms=1, period=1.0)
    fit = identify_published(
        [poses.part(0, frames)], start.with_choices(fix={"torque.period": 1.1}), settings
    )
    assert fit.status == status
    assert not fit.ok
    assert fit.starts == ()
    assert fit.torque == settings.torque


def test_a_joint_seen_three_times_and_too_many_torques():
    truth = double_truth()
    times = np.arange(201) / 30.0
    poses = record(truth, times, motion(truth, times, [0.9, 0.6], [0.0, 0.0]), noise=SMALL)
    holes = poses.position.copy()
    holes[3:, 0] = np.nan
    fit = identify_published([replace(poses, position=holes)], load("double"), PAPER)
    assert fit.status == "Joint 'joint1' was measured 3 times, 5 are needed; give more frames."
    fit = identify_published([poses], load("double"), replace(PAPER, torque="free"))
    assert fit.status == (
        "402 torques, one a joint and time stamp, are too many for the published method; fit at most 200 "
        "frames."
    )


def test_a_period_that_is_bounded():
    _, poses = fourier_truth(np.arange(150) / 30.0)
    start = load("double").with_torque("fourier", terms=1, period=2.0)
    start = start.with_choices(bounds={"torque.period": (1.8, 2.5)})
    settings = replace(PAPER, torque="fourier", evaluations=5, starts=1)
    fit = identify_published([poses], start, settings)
    assert 1.8 <= fit.mechanism.values["torque.period"] <= 2.5
    assert "torque.period" not in fit.names


def test_a_period_that_cannot_be_told():
    """A swing without a torque has none; of two thirds of a period a wrong one is guessed."""
    truth = double_truth()
    poses = record(truth, TIMES, motion(truth, TIMES, [0.9, 0.6], [0.0, 0.0]), noise=SMALL)
    fit = identify_published([poses], load("double"), replace(PAPER, torque="fourier", terms=1))
    assert fit.status == NO_PERIOD
    assert not fit.ok
    assert fit.torque == "fourier"
    _, poses = fourier_truth(np.arange(45) / 30.0, period=2.2)
    fit = identify_published([poses], load("double"), replace(PAPER, torque="fourier", terms=1))
    assert not fit.ok
    assert "with --fix torque.period=SECONDS" in fit.status


def test_nothing_to_be_found():
    still = record(load("double"), TIMES, np.zeros((60, 2)))
    fit = identify_published([still], load("double"), PAPER)
    assert fit.status == "Nothing moves in the record: no joint leaves its noise; give frames with motion."
    _, poses = fourier_truth(TIMES)
    fit = identify_published([poses, poses], load("double"), replace(PAPER, torque="free"))
    assert fit.status == "A torque over time belongs to one record; fit them one by one."
    with pytest.raises(SettingsError, match=r"gains: expected alpha above 0 and up to 1 \(eq. 7\), got 2"):
        identify_published([poses], load("double"), replace(PAPER, gains=(2.0, 0.1, 0.05)))
