"""The published least squares on made motion of known truth: Cases I to III, rates."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from monodyn.estimation.verdict.summary import UNSTARTED
from monodyn.mechanism import load
from monodyn.paper.identify import identify_published
from monodyn.reported import report
from monodyn.results.fill import fill
from monodyn.results.predict import predict
from monodyn.results.torques import torques
from support import slow
from swings import TIMES, double_truth, motion, record
from waves import PAPER, SMALL, fourier_truth


@pytest.mark.slow
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


@pytest.mark.slow
def test_case_two_with_a_period_that_is_known():
    """With thicknesses and period known, and friction in addition, the torque is within 8 %."""
    times = np.arange(150) / 30.0
    truth, poses = fourier_truth(times)
    known = {name: truth.values[name] for name in ("link1.thickness", "link2.thickness")}
    start = load("double").with_torque("fourier", terms=1, period=1.0)
    start = start.with_choices(fix={**known, "torque.period": 1.1})
    settings = replace(PAPER, torque="fourier", terms=3, series="with-friction")
    fit = identify_published([poses], start, settings)
    assert fit.ok, fit.status
    assert max(fit.rms.values()) < np.radians(0.3)
    torque, expected = fit.mechanism.drive.at(times), truth.drive.at(times)
    error = np.sqrt(np.mean((torque - expected) ** 2, axis=0) / np.mean(expected**2, axis=0))
    assert (error < 0.08).all()


@pytest.mark.slow
def test_case_three_on_a_chaotic_second():
    """Thirty frames are followed within the noise; bodies keep near the file's, nothing has an interval."""
    truth, shown = double_truth(), []
    position = motion(truth, TIMES[:30], [0.9, 0.6], [0.0, 0.0])
    poses = record(truth, TIMES[:30], position, noise=np.radians(0.1))
    settings = replace(PAPER, torque="free", evaluations=10)
    fit = identify_published([poses], load("double"), settings, lambda *step: shown.append(step))
    assert fit.ok, fit.status
    assert max(fit.rms.values()) < np.radians(0.1)
    for name in ("link1.length", "link2.length"):
        assert 1.0 / 10.0 < fit.mechanism.values[name] / truth.values[name] < 10.0
    assert all(np.isinf(e.std) and not e.identifiable for e in fit.parameters if e.free)
    assert any("are arbitrary" in line for line in fit.advice)
    assert not any("follow from gravity" in line for line in fit.advice)
    assert [step[1] // 50 for step in shown] == list(range(1, fit.evaluations // 50 + 1))


@pytest.mark.slow
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


@pytest.mark.slow
def test_given_starts_are_left_as_they_are():
    """The search begins at the file's own values: one start, and how it goes depends on them."""
    truth = double_truth()
    poses = record(truth, TIMES[:40], motion(truth, TIMES[:40], [0.9, 0.6], [0.0, 0.0]), noise=SMALL)
    given, ends = replace(PAPER, begin="given"), []
    for factor in (1.0, 0.8):
        near = {n: v * factor for n, v in truth.values.items() if n.endswith((".length", ".thickness"))}
        fit = identify_published([poses], load("double").with_values(near), given)
        assert not any("starts were tried" in line for line in fit.advice)
        ends.append(fit)
    assert ends[0].parameter("link1.length").value == pytest.approx(truth.values["link1.length"], rel=0.02)
    assert ends[0].evaluations != ends[1].evaluations


def test_case_three_with_friction():
    """Ours: the dampings in addition, 2 k + 6 unknowns."""
    truth = double_truth()
    poses = record(truth, TIMES[:12], motion(truth, TIMES[:12], [0.9, 0.6], [0.0, 0.0]), noise=SMALL)
    fit = identify_published([poses], load("double"), replace(PAPER, torque="free", series="with-friction"))
    assert fit.ok, fit.status
    assert len(fit.names) - 4 == 2 * 12 + 6


@pytest.mark.slow
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
    settings = replace(PAPER, states="filtered", filter="consistent")
    consistent = identify_published([poses], load("single"), settings)
    assert not any("ring" in line for line in consistent.advice)
    assert consistent.parameter("link1.length") != ringing.parameter("link1.length")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("torque", ["friction", "fourier", "free"])
@pytest.mark.parametrize("scale", [1e8, 1e150])
def test_motion_beyond_all_numbers_has_one_status(torque, scale):
    """Rates so large that accelerations overflow, or only their slopes do."""
    _, poses = fourier_truth(TIMES[:40])
    terms = 1 if torque == "fourier" else 0
    settings = replace(PAPER, torque=torque, terms=terms, begin="given")
    fit = identify_published([replace(poses, position=scale * poses.position)], load("double"), settings)
    assert not fit.ok
    assert fit.status == UNSTARTED


def test_without_intervals_there_are_none(tmp_path):
    """Under published free torques no file and no figure has one; only given values are known."""
    truth = double_truth()
    poses = record(truth, TIMES[:12], motion(truth, TIMES[:12], [0.9, 0.6], [0.0, 0.0]), noise=SMALL)
    fit = identify_published([poses], load("double"), replace(PAPER, torque="free", evaluations=5))
    assert any("there are no intervals" in line for line in fit.advice)
    for p in fit.parameters:
        assert p.std == 0.0 or (p.lower, p.upper) == (-np.inf, np.inf), p.name
    assert fit.parameter("link1.mass").std == np.inf
    assert np.isinf(torques(fit, poses.time).std).all()
    assert np.isinf(fill(fit, poses.time).std).all()
    report(fit, poses=poses, to=tmp_path, force=True)
    page = (tmp_path / "report.html").read_text()
    assert "What acts at the joints, any friction included, in proportion" in page
    assert "95 % band" not in page


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


@pytest.mark.slow
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
def test_a_series_stands_for_friction():
    """No torque acts on a passive pendulum: 34 unknowns follow it within 1.5 degrees over 80 frames."""
    poses, start, _ = rendered("double_a", 80, np.radians(0.02))
    fit = identify_published([poses], start, replace(PAPER, torque="fourier"))
    assert fit.ok, fit.status
    assert fit.status.startswith("Identified 34 unknowns")
    assert 1.05 < fit.mechanism.values["torque.period"] < 1.2
    assert max(fit.rms.values()) < np.radians(1.5)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, slow(2), slow(3)])
def test_gaps_and_joints_out_of_order(seed):
    """Gaps put the start off; from there parts that grow lead to the minimum, whatever the noise."""
    truth = double_truth()
    position = motion(truth, TIMES, [0.9, 0.6], [0.0, 0.0])
    poses = record(truth, TIMES[:40], position[:40], noise=SMALL, seed=seed)
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


@pytest.mark.slow
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


@pytest.mark.slow
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
