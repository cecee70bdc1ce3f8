"""A last link that nobody measured, found from the motion of the others: MuJoCo moves both."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from monodyn.estimation.record.samples import prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.shooting.hanging import hanging
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.shoot import ROUGH, Route
from monodyn.mechanism import load, write_mjcf
from monodyn.types import Poses

NOISE, FRAMES = 1e-3, 120


def hidden(tmp_path, start, rates):
    """Return positions of a double pendulum at 60 Hz, and its record without the second joint."""
    true = load("double").with_values({"link1.length": 0.27, "link2.length": 0.16, "link2.thickness": 0.009})
    write_mjcf(true, tmp_path / "true.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "true.xml"))
    model.opt.timestep, model.opt.integrator = 1.0 / 6000.0, mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = start, rates
    rows = []
    for step in range(100 * FRAMES):
        if step % 100 == 0:
            rows.append(data.qpos.copy())
        mujoco.mj_step(model, data)
    moved = np.array(rows)
    seen = np.zeros((FRAMES, 2), dtype=bool)
    seen[:, 0] = True
    measured = np.column_stack(
        [moved[:, 0] + NOISE * np.random.default_rng(1).normal(size=FRAMES), np.full(FRAMES, np.nan)]
    )
    record = Poses(
        ("joint1", "joint2"), np.arange(FRAMES), np.arange(FRAMES) / 60.0, measured,
        np.repeat(np.diag([NOISE**2, 1.0])[None], FRAMES, axis=0), np.zeros(FRAMES, dtype=bool),
        joint_seen=seen,
    )  # fmt: skip
    return moved, record


def found(record):
    mechanism = load("double").with_torque("friction")
    problem = posed(mechanism, prepare((record,), mechanism), near=True)
    return problem, hanging(problem, smooth(record), Route(10, 1e-4, ROUGH))


@pytest.mark.slow
def test_a_hidden_link_is_found_wherever_it_begins(tmp_path):
    # from rest, and in the middle of a motion
    for start, rates in (([-0.3, 1.9], [0.0, 0.0]), ([-1.2, -2.5], [4.0, -6.0])):
        moved, record = hidden(tmp_path, start, rates)
        problem, optimum = found(record)
        assert optimum is not None
        away = problem.simulated(optimum.trial) - moved
        # nobody says how often it has turned before
        away[:, 1] -= 2.0 * np.pi * np.round(np.median(away[:, 1]) / (2.0 * np.pi))
        assert np.sqrt(np.mean(away[:, 0] ** 2)) < NOISE
        assert np.abs(away[:, 1]).max() < 0.1
        values = problem.mechanism_at(optimum.x).values
        assert abs(np.log(values["link1.length"] / 0.27)) < 0.05
        assert abs(np.log(values["link2.length"] / 0.16)) < 0.15


@pytest.mark.slow
def test_what_nothing_follows_has_none(tmp_path):
    _, record = hidden(tmp_path, [-0.3, 1.9], [0.0, 0.0])
    shaken = np.array(record.position)
    shaken[:, 0] = np.random.default_rng(2).normal(size=FRAMES)
    noise = Poses(
        record.joints, record.frame, record.time, shaken, record.covariance, record.seen,
        joint_seen=record.joint_seen,
    )  # fmt: skip
    assert found(noise)[1] is None
