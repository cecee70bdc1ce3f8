"""Gravity's direction found in motion that MuJoCo simulates under tilted gravity."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from monodyn.estimation.fit import Fit
from monodyn.mechanism import Mechanism, load, write_mjcf
from monodyn.mechanism.upright import ROLL, ROLL_STD, with_roll
from monodyn.results.fill import fill
from monodyn.results.trace import trace_of
from monodyn.stages import identify
from monodyn.types import Poses
from support import slow
from swings import double_truth, record, sigmas

TIMES = np.arange(80) / 30.0
NOISE = 0.002


def filmed(mechanism: Mechanism, roll: float, folder: Path) -> tuple[Poses, np.ndarray]:
    """Simulate before a camera that is out of level; also return the positions against gravity."""
    write_mjcf(mechanism, folder / "model.xml")
    model = mujoco.MjModel.from_xml_path(str(folder / "model.xml"))
    # a camera turned counter-clockwise sees the mechanism, and gravity with it, turned clockwise
    model.opt.gravity[:] = [-9.81 * np.sin(roll), 0.0, -9.81 * np.cos(roll)]
    data = mujoco.MjData(model)
    data.qpos[:] = [-0.6, 0.5]
    seen = []
    for time in TIMES:
        while data.time < time - 1e-9:
            mujoco.mj_step(model, data)
        seen.append(data.qpos.copy())
    seen = np.array(seen)
    poses = replace(record(mechanism, TIMES, seen, noise=NOISE), metric=False)
    return poses, seen + np.array([roll, 0.0])


def identified(poses: Poses, **choice: bool) -> Fit:
    """Identify with the roll free, near level unless ``assumed`` is false."""
    return identify(poses, with_roll(load("double"), 0.0, free=True, **choice))


@pytest.mark.parametrize("degrees", [-8.0, slow(-1.0), 0.0, slow(3.0), slow(20.0)])
def test_the_roll_is_found_and_positions_are_against_gravity(degrees: float, tmp_path: Path) -> None:
    truth, roll = double_truth(), np.radians(degrees)
    poses, upright = filmed(truth, roll, tmp_path)
    fit = identified(poses)
    assert fit.ok
    assert sigmas(fit.parameter(ROLL), roll) < 4.0
    # of noise alone, 0.1 deg in 80 frames
    assert fit.parameter(ROLL).value == pytest.approx(roll, abs=np.radians(0.05))
    assert sigmas(fit.parameter("link1.length"), truth.values["link1.length"]) < 4.0
    np.testing.assert_allclose(fill(fit, TIMES).position, upright, rtol=0, atol=3 * NOISE)
    trace = trace_of(fit, poses)
    assert trace.poses.roll is None
    np.testing.assert_allclose(np.mean(trace.poses.position - upright, axis=0), 0.0, atol=NOISE)
    tilted = "deg from straight down in the picture, more than a camera is usually out of level: if it was"
    assert any(tilted in line for line in fit.advice) == (degrees > 12.0)


@pytest.mark.slow
def test_a_level_camera_is_not_trusted(tmp_path: Path) -> None:
    truth = double_truth()
    poses, _ = filmed(truth, np.radians(7.0), tmp_path)
    held = identify(poses, load("double"))
    assert held.grade != "trusted"
    assert ROLL not in [p.name for p in held.parameters]
    given = identify(poses, load("double").with_choices(fix={ROLL: np.radians(7.0)}))
    assert given.ok
    assert given.parameter(ROLL).std == 0.0


def test_a_record_against_gravity_has_no_roll(tmp_path: Path) -> None:
    poses, upright = filmed(double_truth(), np.radians(5.0), tmp_path)
    fit = identified(replace(poses, position=upright, roll=None))
    assert fit.ok
    assert ROLL not in [p.name for p in fit.parameters]


@pytest.mark.slow
def test_one_roll_of_several_records_is_said(tmp_path: Path) -> None:
    one, other = (filmed(double_truth(), np.radians(degrees), tmp_path)[0] for degrees in (2.0, -2.0))
    said = "One camera.roll was taken for all 2 records"
    mechanism = with_roll(load("double"), 0.0, free=True)
    assert any(line.startswith(said) for line in identify([one, other], mechanism).advice)
    # a record against gravity shares nothing with one that was filmed
    upright = identify([one, replace(other, roll=None)], mechanism)
    assert not any("One camera.roll" in line for line in (*upright.advice, *identified(one).advice))


@pytest.mark.slow
def test_what_a_picture_was_taken_with_is_taken_into_account(tmp_path: Path) -> None:
    """The same poses by a camera whose roll was known in part: the same roll of the camera comes out."""
    poses, _ = filmed(double_truth(), np.radians(5.0), tmp_path)
    part = np.radians(2.0)
    known = replace(poses, position=poses.position + np.array([part, 0.0]), roll=part)
    one, other = identified(poses), identify(known, with_roll(load("double"), 0.0, free=True))
    assert other.parameter(ROLL).value == pytest.approx(one.parameter(ROLL).value, abs=1e-6)


@pytest.mark.slow
def test_a_short_record_knows_no_more_than_is_assumed(tmp_path: Path) -> None:
    poses, _ = filmed(double_truth(), np.radians(1.0), tmp_path)
    fit = identified(poses[:7])
    free = identified(poses[:7], assumed=False)
    assert fit.parameter(ROLL).std < 1.001 * ROLL_STD < free.parameter(ROLL).std
    assert (
        "The motion hardly determines camera.roll: the camera is taken to be level within 3 deg "
        "(standard deviation), and angles against gravity are known no better than that; give the roll "
        "with --fix camera.roll=VALUE [rad]."
    ) in fit.advice
