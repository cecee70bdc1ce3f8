"""Gaps filled from both sides: against closed forms, the roll-out, and MuJoCo pushed at random."""

from __future__ import annotations

import math
import tempfile
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from fits import identified, made_fit
from monodyn import smooth
from monodyn.errors import SettingsError, VideoError
from monodyn.estimation.fit import Fit
from monodyn.estimation.parts import Start, Unmodelled
from monodyn.mechanism import Mechanism, load, write_mjcf
from monodyn.results import chain
from monodyn.results.fill import fill
from monodyn.results.smoother import WIDER
from monodyn.types import Poses
from support import refuses
from swings import record

ALL = np.arange(120) / 30.0
NOISE, RATE = 1e-3, 60.0
SLIDE = """<mujoco><option gravity="0 0 -9.81"/><worldbody><body name="sled">
<joint name="slider" type="slide" axis="1 0 0"/>
<geom type="box" size="0.05 0.02 0.02" density="1000"/></body></worldbody></mujoco>"""


def test_a_fit_without_residuals_is_not_smoothed() -> None:
    fit = replace(identified(), residual=())
    with refuses(
        SettingsError,
        "smooth: expected a fit with its residuals, got one that was read back from a run folder; states.csv "
        "holds its motion, gaps filled, or identify poses.csv again.",
    ):
        smooth(fit, record(fit.mechanism, fit.time[0], np.zeros((len(fit.time[0]), 1))))


def known(mechanism: Mechanism, poses: Poses, state: np.ndarray, density: np.ndarray, seed: int = 0) -> Fit:
    """Return the fit of a mechanism that is known, pushed at random: only its start is not known exactly."""
    dofs = len(poses.joints)
    rng = np.random.default_rng(seed)
    spread = np.diag(np.full(2 * dofs, 1e-4 / WIDER))
    begun = state + math.sqrt(1e-4) * rng.normal(size=2 * dofs)
    residual = np.where(poses.measured, rng.normal(scale=NOISE, size=poses.position.shape), np.nan)
    return replace(
        identified(),
        mechanism=mechanism,
        parameters=(),
        tied=(),
        starts=(Start(float(poses.time[0]), begun[:dofs], begun[dofs:], spread),),
        covariance=spread,
        residual=(residual,),
        time=(poses.time,),
        rms=dict.fromkeys(poses.joints, NOISE),
        stamp_error=0.0,
        unmodelled=Unmodelled(density, np.zeros((2 * dofs, 2 * dofs))),
    )


def pushed(seed: int, density: float, gaps: list[tuple[int, int, int | slice]], frames: int, reach: float):
    """Let MuJoCo move a double pendulum, push it at random, and hide some of it."""
    rng = np.random.default_rng(seed)
    mechanism = load("double")
    sizes = [p for p in mechanism.parameters if p.free and p.kind in ("length", "width", "thickness")]
    mechanism = mechanism.with_values({p.name: p.value * math.exp(rng.uniform(-0.4, 0.4)) for p in sizes})
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drawn.xml"
        write_mjcf(mechanism, path)
        body = mujoco.MjModel.from_xml_path(str(path))
    steps = 20
    body.opt.timestep, body.opt.integrator = 1.0 / (RATE * steps), mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(body)
    data.qpos[:] = np.array([-0.5 * np.pi, 0.0]) + rng.uniform(-reach, reach, 2)
    states = np.zeros((frames, 4))
    for row in range(frames):
        states[row] = *data.qpos, *data.qvel
        for _ in range(steps):
            data.qvel[:] += rng.normal(size=2) * math.sqrt(density * body.opt.timestep)
            mujoco.mj_step(body, data)
    seen = np.ones((frames, 2), dtype=bool)
    for first, after, joint in gaps:
        seen[first:after, joint] = False
    position = np.where(seen, states[:, :2] + rng.normal(scale=NOISE, size=(frames, 2)), np.nan)
    covariance = np.tile(NOISE**2 * np.eye(2), (frames, 1, 1))
    time = np.arange(frames) / RATE
    poses = Poses(
        ("joint1", "joint2"), np.arange(frames), time, position, covariance, seen.all(axis=1), joint_seen=seen
    )
    return known(mechanism, poses, states[0], np.full(2, density), seed), poses, states


def sled(rows: np.ndarray, density: float, rng: np.random.Generator) -> Poses:
    """Return positions of a sled that is pushed at random and was seen at some of 41 time stamps alone."""
    h = 0.05
    push = np.linalg.cholesky(density * np.array([[h**3 / 3.0, h**2 / 2.0], [h**2 / 2.0, h]]))
    state, position = np.array([0.3, 0.2]), np.full((41, 1), np.nan)
    for row in range(41):
        position[row] = state[0] + NOISE * rng.normal()
        state = np.array([[1.0, h], [0.0, 1.0]]) @ state + push @ rng.normal(size=2)
    position[np.setdiff1d(np.arange(41), rows)] = np.nan
    seen = np.isfinite(position[:, 0])
    return Poses(("slider",), np.arange(41), h * np.arange(41), position, np.full((41, 1, 1), NOISE**2), seen)


def test_a_sled_that_is_pushed_is_found_by_the_closed_form(tmp_path):
    """Of a free mass the positions are a Gaussian process: x0 + v0 t + twice integrated white noise.

    Its covariance is P11 + P22 t s + q (m^3 / 3 + m^2 |t - s| / 2), m the earlier of t and s, and the filled
    position is the mean that is conditional on what is measured.
    """
    path = tmp_path / "sled.xml"
    path.write_text(SLIDE)
    mechanism, rows = load(path).with_values({"slider.damping": 0.0}), np.r_[0:14, 25:41]
    density = 0.05
    poses = sled(rows, density, np.random.default_rng(1))
    fit = known(mechanism, poses, np.array([0.3, 0.2]), np.array([density]))
    time, start = poses.time, fit.starts[0]
    found = smooth(fit, poses, np.linspace(0.0, 2.0, 161))
    factor = _noise_factor(fit, poses)

    def kernel(t: np.ndarray, s: np.ndarray) -> np.ndarray:
        early, apart = np.minimum.outer(t, s), np.abs(np.subtract.outer(t, s))
        return 1e-4 * (1.0 + np.outer(t, s)) + density * (early**3 / 3.0 + early**2 * apart / 2.0)

    def mean(t: np.ndarray) -> np.ndarray:
        return start.position[0] + start.velocity[0] * t

    inverse = np.linalg.inv(kernel(time[rows], time[rows]) + factor**2 * NOISE**2 * np.eye(len(rows)))
    across = kernel(found.time, time[rows])
    right = mean(found.time) + across @ inverse @ (poses.position[rows, 0] - mean(time[rows]))
    variance = np.diag(kernel(found.time, found.time)) - np.einsum("ij,jk,ik->i", across, inverse, across)
    # the band is wider by what the innovations of this record are larger than expected: the same everywhere
    ratio = found.std[0, 0] ** 2 / variance[0]
    assert 1.0 - 1e-6 < ratio < 1.6
    np.testing.assert_allclose(found.position[:, 0], right, atol=1e-7)
    # the closed form is a difference of terms 1e3 times as large
    np.testing.assert_allclose(found.std[:, 0] ** 2, ratio * variance, rtol=3e-5)


def _noise_factor(fit: Fit, poses: Poses) -> float:
    """Return the noise that second differences of the residuals show, over the stated one."""
    r = fit.residual[0][:, 0] / NOISE
    sizes = []
    for stride in (1, 2):
        second = r[2 * stride :] - 2.0 * r[stride:-stride] + r[: -2 * stride]
        second = second[np.isfinite(second)]
        sizes.append(math.sqrt(float(np.median(second**2)) / 0.4549 / 6.0))
    return max(sizes)


def test_where_nothing_is_lacking_it_is_the_roll_out(fit, truth):
    mechanism, q, _ = truth
    exact = replace(fit, unmodelled=None, stamp_error=0.0)
    poses = replace(record(mechanism, ALL[40:80], q[40:80]), frame=np.arange(40, 80))
    found, rolled = smooth(exact, poses, ALL), fill(exact, ALL)
    for name in ("time", "position", "velocity", "std", "velocity_std"):
        np.testing.assert_array_equal(getattr(found, name), getattr(rolled, name))


def test_frames_that_the_fit_has_not_seen_correct_the_motion(fit, truth):
    """Ahead of the fitted frames the roll-out is known ever less; what is measured there brings it back."""
    mechanism, q, _ = truth
    exact = replace(fit, unmodelled=None, stamp_error=0.0)
    seen = np.ones(120, dtype=bool)
    seen[95:105] = seen[10:20] = False
    poses = record(mechanism, ALL, q, seed=4)
    poses = replace(poses, position=np.where(seen[:, None], poses.position, np.nan), seen=seen)
    found, rolled = smooth(exact, poses), fill(exact, ALL)
    for rows in (slice(95, 105), slice(10, 20)):
        assert np.all(found.std[rows] < rolled.std[rows])
        assert np.all(np.abs(found.position - q)[rows] < 4.0 * found.std[rows])
    assert np.abs(found.position - q)[~seen].max() < np.abs(rolled.position - q)[~seen].max()


def test_the_error_of_stamps_is_that_of_the_frames(fit, truth):
    mechanism, q, _ = truth
    late = 1e-3
    poses = replace(record(mechanism, ALL[40:80], q[40:80]), frame=np.arange(40, 80))
    exact = replace(fit, unmodelled=None, stamp_error=late)
    found, rolled = smooth(exact, poses), fill(exact, ALL[40:80])
    more = found.std**2 - rolled.std**2
    np.testing.assert_allclose(more, (late * rolled.velocity) ** 2, rtol=1e-6, atol=1e-15)
    # rates of the roll-out, differentiated: 3e4 rad/s^3 over a step of 1 ms leave 0.01 rad/s^2
    ahead = fill(exact, np.repeat(ALL[40:80], 2) + np.tile([0.0, 1e-3], 40)).velocity.reshape(40, 2, 2)
    rate = (ahead[:, 1] - ahead[:, 0]) / 1e-3
    more = found.velocity_std**2 - rolled.velocity_std**2
    np.testing.assert_allclose(np.sqrt(more), late * np.abs(rate), atol=late * 20.0)


@pytest.mark.slow
def test_the_errors_in_gaps_are_as_large_as_stated():
    """Over 200 gaps of both joints or of one alone the mean square of error over deviation is one.

    The middle of each gap counts, of positions and rates. Their mean over 200 has a deviation of 0.1.
    """
    gaps: list[tuple[int, int, int | slice]] = [
        (20 + 26 * k, 36 + 26 * k, (slice(None), 0, 1)[k % 3]) for k in range(10)
    ]
    places, rates, rolled = [], [], []
    for seed in range(20):
        fit, poses, states = pushed(seed, 0.02, gaps, 290, 1.5)
        found = smooth(fit, poses)
        for first, after, joint in gaps:
            row, dof = (first + after) // 2, 1 if joint == 1 else 0
            places.append((found.position[row, dof] - states[row, dof]) / found.std[row, dof])
            rates.append((found.velocity[row, dof] - states[row, 2 + dof]) / found.velocity_std[row, dof])
            rolled.append(abs(found.position[row, dof] - states[row, dof]))
    assert len(places) == 200
    for errors in (places, rates):
        assert 0.7 < np.mean(np.square(errors)) < 1.35
        assert np.mean(np.abs(errors) < 1.96) > 0.9


def test_a_joint_that_is_seen_fills_the_other():
    fit, poses, states = pushed(3, 0.5, [(30, 60, 0)], 90, 1.0)
    both = poses.joint_seen.copy()
    both[30:60] = False
    alone = smooth(fit, poses)
    neither = smooth(fit, replace(poses, joint_seen=both, seen=both.all(axis=1)))
    assert alone.std[45, 0] < 0.7 * neither.std[45, 0]
    assert np.all(np.abs(alone.position - states[:, :2]) < 4.5 * alone.std)


def test_times_may_lie_between_the_rows_where_frames_were_dropped():
    fit, poses, states = pushed(5, 0.05, [], 80, 1.0)
    kept = np.r_[0:30, 45:80]
    fewer = Poses(
        poses.joints, poses.frame[kept], poses.time[kept], poses.position[kept], poses.covariance[kept],
        poses.seen[kept],
    )  # fmt: skip
    fit = replace(fit, time=(fewer.time,), residual=(fit.residual[0][kept],))
    hidden = smooth(fit, fewer, poses.time)
    assert np.all(np.abs(hidden.position - states[:, :2]) < 4.5 * hidden.std)
    assert hidden.std[37].max() > 2.0 * hidden.std[10].max()
    # what is left is that of the last linearisation
    again = smooth(fit, fewer)
    assert np.all(np.abs(again.position - hidden.position[kept]) < 2.0 * chain.SETTLED * again.std)


def test_a_position_that_is_far_off_hardly_counts():
    fit, poses, states = pushed(6, 0.05, [(30, 40, slice(None))], 70, 1.0)
    moved = poses.position.copy()
    moved[28, 1] += 0.5
    wrong, right = smooth(fit, replace(poses, position=moved)), smooth(fit, poses)
    assert np.abs(wrong.position - states[:, :2]).max() < 0.03
    assert np.abs(wrong.position - right.position).max() < 0.01


@pytest.mark.slow
def test_a_wild_motion_is_led_through_a_long_gap():
    """In a second the filter, which goes forwards alone, ends whole turns away."""
    fit, poses, states = pushed(9, 0.01, [(40, 100, slice(None))], 140, 2.5)
    found = smooth(fit, poses)
    assert np.isfinite(found.std).all()
    assert np.all(np.abs(found.position - states[:, :2]) < 4.5 * found.std)
    assert found.std[70].max() > 3.0 * found.std[20].max()


def test_a_gap_that_no_motion_leads_through_is_left_open(monkeypatch):
    """The longest gap is cut; both sides of it are known all the same."""
    fit, poses, states = pushed(7, 0.05, [(20, 24, slice(None)), (40, 55, slice(None))], 80, 1.0)
    followed = chain._followed
    monkeypatch.setattr(chain, "_followed", lambda c, seen: followed(c, seen) if c.cuts else None)
    found = smooth(fit, poses)
    lost = np.zeros(80, dtype=bool)
    lost[40:55] = True
    np.testing.assert_array_equal(np.isinf(found.std).all(axis=1), lost)
    assert np.all(np.abs(found.position - states[:, :2])[~lost] < 4.5 * found.std[~lost])
    monkeypatch.setattr(chain, "_followed", lambda c, seen: None)
    assert np.isinf(smooth(fit, poses).std).all()


def test_an_open_fit_is_rolled_out():
    fit, poses, _ = pushed(8, 0.05, [(20, 30, slice(None))], 60, 1.0)
    unsure = replace(fit, covariance=np.full_like(fit.covariance, np.nan))
    np.testing.assert_array_equal(smooth(unsure, poses).position, fill(unsure, poses.time).position)
    assert np.isinf(smooth(unsure, poses).std).all()


def test_bad_input_is_refused(fit, truth):
    mechanism, q, _ = truth
    poses = replace(record(mechanism, ALL[40:80], q[40:80]), frame=np.arange(40, 80))
    with refuses(SettingsError, "smooth: times: must increase, but sample 1 is 0.5 s after 1 s."):
        smooth(fit, poses, np.array([1.0, 0.5]))
    with refuses(SettingsError, "fill: expected a record from 0 to 0, got 2."):
        smooth(fit, poses, record=2)
    with refuses(
        VideoError,
        "poses: expected the record that was fitted, got other time stamps; pass the same record.",
    ):
        smooth(fit, record(mechanism, ALL[:30], q[:30]))
    with refuses(
        SettingsError, "fill: expected an identified mechanism, got a fit without one: Too few frames."
    ):
        smooth(made_fit(starts=(), status="Too few frames."), poses)
