"""A run under known torques, read back, moves under them as it did."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import monodyn
from driven import DOUBLE, simulated, started
from monodyn.errors import SettingsError
from monodyn.types import TorqueLog
from support import command, refuses

FRAMES, FITTED, LAG = 75, 60, 0.03


def push(time):
    return 0.04 * np.sin(2 * np.pi * time / 2.3) + 0.03 * np.sin(11 * time + 1)


@pytest.fixture(scope="module")
def record():
    """A double pendulum in MuJoCo whose shoulder is pushed, with the log, which is early and ends soon."""
    poses, _ = simulated(DOUBLE, (0.6, -0.4), FRAMES, lambda time: np.array([push(time), 0.0]))
    time = np.arange(-0.2, 2.8, 1 / 200)
    return replace(poses, torques=TorqueLog(("joint1",), time, push(time + LAG)[:, None]))


@pytest.fixture(scope="module")
def run(record, tmp_path_factory):
    folder = tmp_path_factory.mktemp("known")
    mechanism = started(DOUBLE, folder, 1.0)
    fit = monodyn.identify(record[:FITTED], mechanism)
    assert fit.torque == "known"
    future = monodyn.predict(fit, times=np.concatenate((record.time[FITTED:], [2.6, 2.7, 3.2])))
    monodyn.report(fit, future, to=folder / "run", poses=record)
    return fit, folder / "run"


@pytest.mark.slow
def test_the_motion_and_its_band_are_those_of_the_fit(run, record) -> None:
    fit, folder = run
    back = monodyn.open_run(folder)
    there, here = monodyn.fill(fit, record.time), monodyn.fill(back, record.time)
    # what torques.csv promises of its lines [rad]
    assert np.abs(here.position - there.position).max() < 1e-3
    np.testing.assert_allclose(here.std, there.std, rtol=0.05)
    ahead = monodyn.predict(back, times=record.time[FITTED:])
    # within the noise of MuJoCo's record, of 1e-3 rad, and what the fit leaves over
    assert np.abs(ahead.position - record.position[FITTED:]).max() < 0.02
    free = monodyn.fill(replace(back, torques=()), record.time).position
    assert np.abs(free - record.position).max() > 0.1
    # after the log nothing is known, as before
    for one in (fit, back):
        std = monodyn.predict(one, times=np.array([2.6, 3.2])).std
        assert np.isfinite(std[0]).all()
        assert np.isinf(std[1]).all()


@pytest.mark.slow
def test_the_command_predicts_under_them_but_what_is_let_go(run, record) -> None:
    _, folder = run
    note = "- The known torques belong to the record: here none act."
    within = command("predict", folder, "--at", "1.0", "--until", "2.0")
    assert note not in within.out
    begun = monodyn.restart(monodyn.open_run(folder), at=1.0)
    there = monodyn.fill(begun, record.time[30:61]).position
    assert np.abs(there - record.position[30:61]).max() < 0.02
    assert note in command("predict", folder, "--from", "joint1=0.6,joint2=-0.4").out
    beyond = command("predict", folder, "--until", "4")
    assert (
        "- The known torques of the run reach to the end of its prediction; after that the last of them "
        "stands for them, and nothing is known." in beyond.out
    )


@pytest.mark.slow
def test_each_record_has_its_own(record, tmp_path) -> None:
    mechanism = started(DOUBLE, tmp_path, 1.0)
    half = replace(record.torques, torque=0.5 * record.torques.torque)
    other, _ = simulated(DOUBLE, (-0.3, 0.5), 60, lambda time: np.array([0.5 * push(time), 0.0]), seed=1)
    records = [record[:FITTED], replace(other, torques=half)]
    fit = monodyn.identify(records, mechanism)
    monodyn.report(fit, to=tmp_path / "run")
    back = monodyn.open_run(tmp_path / "run")
    for k, one in enumerate(records):
        there, here = (monodyn.fill(each, one.time, record=k).position for each in (fit, back))
        assert np.abs(here - there).max() < 1e-3


@pytest.mark.slow
def test_a_table_that_is_gone_or_another_one_is_refused(run) -> None:
    _, folder = run
    table = folder / "torques.csv"
    text = table.read_text()
    try:
        table.write_text(text.replace("joint1", "elbow"))
        said = (
            f"'{table}': expected the file as it was written, got another one ('joint1' is not in list); run "
            "it again."
        )
        with refuses(SettingsError, said):
            monodyn.open_run(folder)
        table.unlink()
        said = (
            f"'{folder}': expected the folder of a run under known torques with its torques.csv, got one "
            "without; put it back, or run it again."
        )
        with refuses(SettingsError, said):
            monodyn.open_run(folder)
    finally:
        table.write_text(text)
