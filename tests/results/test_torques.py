"""Torques of a fitted drive over time, with the standard deviation of the fit."""

import tempfile
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from monodyn.estimation.fit import Estimate
from monodyn.mechanism import load, write_mjcf
from monodyn.results.fill import fill
from monodyn.results.torques import torque_course, torques
from monodyn.types import TorqueLog


def test_a_mean_torque_has_the_deviation_of_its_parameter(fit):
    # one unknown, the mean of a periodic torque of 0.1 N m at the first joint
    mechanism = load("double").with_torque("fourier", terms=1, period=1.0)
    mechanism = mechanism.with_values({"joint1.torque.mean": 0.1})
    dofs = 2 * len(mechanism.joints)
    mean = Estimate("joint1.torque.mean", 0.1, 0.02, 0.06, 0.14, "N m", True, True, False)
    covariance = np.diag([0.02**2, *np.ones(dofs)])
    driven = replace(fit, mechanism=mechanism, parameters=(mean,), covariance=covariance, torque="fourier")
    found = torques(driven, np.arange(5) / 30.0)
    np.testing.assert_allclose(found.torque, np.tile([0.1, 0.0], (5, 1)), atol=1e-15)
    np.testing.assert_allclose(found.std, np.tile([0.02, 0.0], (5, 1)), atol=1e-15)


def _driven(fit, mechanism, kind, values):
    """Return the fit with torques over time that it did not estimate."""
    moved = {"mechanism": mechanism.with_values(values), "torque": kind, "parameters": (), "tied": ()}
    return replace(fit, covariance=np.zeros((4, 4)), **moved)


def _under_lines(course, fit, times):
    """Return the motion by MuJoCo under what is linear between the rows that are not empty, none outside."""
    model = mujoco.MjModel.from_xml_string(_model(fit.mechanism))
    model.opt.timestep = 1.0 / 30.0 / 100.0
    data, start = mujoco.MjData(model), fit.starts[0]
    data.time, data.qpos[:], data.qvel[:] = start.time, start.position, start.velocity
    known, rows = np.isfinite(course.torque).all(axis=1), []
    time, torque = course.time[known], course.torque[known].T

    def push(_, now):
        now.ctrl[:] = [np.interp(now.time, time, row, left=0.0, right=0.0) for row in torque]

    mujoco.set_mjcb_control(push)
    try:
        for _ in times:
            rows.append(data.qpos.copy())
            mujoco.mj_step(model, data, 100)
    finally:
        mujoco.set_mjcb_control(None)
    return np.array(rows)


def _model(mechanism):
    with tempfile.TemporaryDirectory() as folder:
        write_mjcf(mechanism, Path(folder) / "m.xml")
        return (Path(folder) / "m.xml").read_text(encoding="utf-8")


@pytest.mark.slow
def test_lines_between_the_rows_make_the_motion_of_a_series(fit):
    """Of its eighth harmonic a frame has a quarter of a wave: lines from frame to frame are degrees off."""
    series = fit.mechanism.with_torque("fourier", terms=8, period=1.0)
    waves = {"joint1.torque.sin8": 0.2, "joint2.torque.cos1": 0.005}
    driven = _driven(fit, series, "fourier", waves)
    times = driven.starts[0].time + np.arange(80) / 30.0
    frames = torques(driven, times)
    course = torque_course(driven, times)
    assert set(times) <= set(course.time)
    motion = fill(driven, times).position
    assert np.degrees(np.abs(_under_lines(frames, driven, times) - motion)).max() > 0.5
    assert np.degrees(np.abs(_under_lines(course, driven, times) - motion)).max() < 0.05


def test_free_torques_are_empty_where_nothing_is_known_of_them(fit):
    start = fit.starts[0].time
    knots = start + np.arange(0, 40, 2) / 30.0
    free = fit.mechanism.with_torque("free", knots=knots)
    values = {f"joint1.torque.{k}": 0.01 * (-1) ** k for k in range(len(knots))}
    driven = _driven(fit, free, "free", values)
    times = start + np.arange(-5, 60) / 30.0
    course = torque_course(driven, times)
    known = (course.time > knots[0] - 1e-9) & (course.time < knots[-1] + 1e-9)
    assert np.isfinite(course.torque[known]).all()
    assert np.isnan(course.torque[~known]).all()
    assert np.isnan(course.std[~known]).all()
    ahead = times[5:]
    motion = fill(driven, ahead).position
    assert np.degrees(np.abs(_under_lines(course, driven, ahead) - motion)).max() < 1e-3


def test_known_torques_go_on_after_their_log_without_a_deviation(fit):
    start = fit.starts[0].time
    stamps = start + np.arange(0, 1.5, 0.004)
    log = TorqueLog(("joint2",), stamps, 0.02 * np.sin(25.0 * stamps)[:, None])
    known = _driven(replace(fit, torques=(log,)), fit.mechanism.with_torque("known"), "known", {})
    times = start + np.arange(60) / 30.0
    course = torque_course(known, times)
    late = course.time > stamps[-1] + 0.01
    assert course.torque[late, 1] == pytest.approx(log.torque[-1, 0], abs=1e-4)
    assert np.isnan(course.std[late]).all()
    assert np.isfinite(course.std[course.time < stamps[-1]]).all()
    motion = fill(known, times).position
    assert np.degrees(np.abs(_under_lines(course, known, times) - motion)).max() < 0.05


def test_without_a_drive_nothing_acts(fit):
    found = torques(fit, np.arange(3) / 30.0)
    assert found.torque == pytest.approx(0.0)
    assert found.std == pytest.approx(0.0)
