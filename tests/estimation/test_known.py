"""Known torques: MuJoCo's motion under them gives masses and the lag with intervals; weak ones do not."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from driven import DOUBLE, simulated, started
from monodyn.errors import MechanismError, SettingsError, VideoError
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.torque.known import weighed
from monodyn.mechanism import load
from monodyn.results.findings import Findings, fit_document, listed_rows
from monodyn.results.predict import predict
from monodyn.results.torques import torques
from monodyn.stages import identify
from monodyn.types import TorqueLog
from support import refuses

LAG = 0.03
FRAMES = 75


def push(time):
    return 0.04 * np.sin(2 * np.pi * time / 2.3) + 0.03 * np.sin(11 * time + 1)


def log_of(force, *, lag=0.0, joint="joint1", rate=200, seconds=4.0):
    """Return the log of a torque that acts ``lag`` later than the log has it."""
    time = np.arange(-0.2, seconds, 1 / rate)
    return TorqueLog((joint,), time, force(time + lag)[:, None])


@pytest.fixture(scope="module")
def pushed():
    """A double pendulum whose shoulder is pushed, and its log, which is early."""
    record, _ = simulated(DOUBLE, (0.6, -0.4), FRAMES, lambda time: np.array([push(time), 0.0]))
    return replace(record, torques=log_of(push, lag=LAG))


@pytest.fixture(scope="module")
def found(pushed, tmp_path_factory):
    """The fit from sizes and thicknesses that are wrong."""
    mechanism = started(DOUBLE, tmp_path_factory.mktemp("known"), 1.2)
    start = mechanism.with_values({"link1.thickness": 0.003, "link2.thickness": 0.009})
    return identify(pushed[:60], start)


def test_masses_inertias_and_dampings_are_absolute(found) -> None:
    model = mujoco.MjModel.from_xml_string(DOUBLE)
    truth = {f"link{i}.mass": float(model.body_mass[i]) for i in (1, 2)}
    truth |= {f"link{i}.inertia": float(model.body_inertia[i, 1]) for i in (1, 2)}
    truth |= {"joint1.damping": 1e-3, "joint2.damping": 5e-4}
    assert found.ok
    assert found.torque == "known"
    assert found.mass_scale == "torques"
    for name, true in truth.items():
        estimate = found.parameter(name)
        assert abs(estimate.value / true - 1) < 0.02, name
        # three standard deviations, as one of six 95 % intervals may well miss
        assert abs(estimate.value - true) < 3.0 * estimate.std < 0.1 * true, name


def test_the_lag_is_estimated(found) -> None:
    lag = found.parameter("torque.lag")
    # MuJoCo holds a torque during its steps of 1 ms, so that it comes half a step later
    assert abs(lag.value - LAG - 0.0005) < 4.0 * lag.std < 0.002


def test_masses_are_listed_and_documented(found) -> None:
    names = [row.name for row in listed_rows(found)]
    assert {"link1.mass", "link2.inertia", "torque.lag"} <= set(names)
    document = fit_document(Findings(found))
    assert document["torque"] == "known"
    assert document["mass_scale"] == "torques"


def test_the_prediction_goes_on_under_the_known_torque(found, pushed) -> None:
    ahead = pushed[60:FRAMES]
    future = predict(found, times=ahead.time)
    assert np.abs(future.position - ahead.position).max() < 0.01
    acting = torques(found, ahead.time)
    assert np.allclose(acting.torque[:, 0], push(ahead.time), atol=5e-4)
    assert not acting.torque[:, 1].any()
    # after the log nothing is known
    assert np.isinf(predict(found, times=np.array([4.5])).std).all()


@pytest.mark.slow
def test_a_torque_that_does_not_show_is_left_out(tmp_path) -> None:
    record, _ = simulated(DOUBLE, (0.6, -0.4), 45, lambda time: np.array([1e-4 * push(time), 0.0]))
    record = replace(record, torques=log_of(lambda time: 1e-4 * push(time)))
    fit = identify(record, started(DOUBLE, tmp_path, 1.0), IdentifySettings(starts=1))
    assert fit.torque == "friction"
    assert fit.mass_scale is None
    assert not fit.parameter("link1.mass").identifiable
    assert fit.advice[0] == (
        "The known torques do not show in the motion, which is explained as well without them: they were "
        "left out, and masses are known only in ratios. A stronger torque would fix the mass scale; check "
        "the unit (N m) and the clock of the log."
    )


def test_densities_are_freed_together_where_masses_follow_from_them_alone(tmp_path) -> None:
    capsule = DOUBLE.replace('type="box"', 'type="capsule"').replace("0.003 0.016", "0.016")
    path = tmp_path / "rods.xml"
    path.write_text(capsule, encoding="utf-8")
    rods = load(path)
    free = weighed(rods)
    assert free.parameter("link1.density").free
    assert free.parameter("link2.density").free
    unknowns = posed(free.with_torque("known"), _data(free)).unknowns
    assert "link1.density" in unknowns.names
    assert "link2.density" in unknowns.tied
    given = weighed(rods.with_choices(fix={"link1.density": 2000.0}))
    assert not given.parameter("link1.density").free
    assert given.parameter("link2.density").free
    # a box has a thickness that nothing shows, which takes up the scale of masses
    boxes = load("double")
    assert weighed(boxes) is boxes


def _data(mechanism):
    from monodyn.estimation.record.samples import prepare
    from swings import white

    times = np.arange(30) / 30
    record = white(("joint1", "joint2"), times, np.zeros((30, 2)), 1e-3)
    return prepare([replace(record, torques=log_of(push))], mechanism)


def test_torques_that_cannot_be_used_are_refused(pushed) -> None:
    double, log = load("double"), log_of(push)
    with refuses(
        VideoError,
        "record 1: expected known torques as other records have them, got none; give a log for each record, "
        "or for none.",
    ):
        identify([pushed, replace(pushed, torques=None)], double)
    with refuses(
        MechanismError, "torques: joint 'elbw' is not in the mechanism; joints: 'joint1', 'joint2'."
    ):
        identify(replace(pushed, torques=replace(log, joints=("elbw",))), double)
    short = log_of(push, seconds=1.0)
    with refuses(
        VideoError,
        "torques: expected a log of all of record 0, 0 to 2.467 s, got one from -0.2 to 0.995 s; both are on "
        "one clock: shift the times of the log, or fit what it covers (--fit-frames A:B).",
    ):
        identify(replace(pushed, torques=short), double)
    with refuses(
        SettingsError,
        "torques: expected the method 'fast' and --identify.torque friction with known torques, got "
        "--identify.torque free; leave one of them out.",
    ):
        identify(pushed, double, IdentifySettings(torque="free"))
    with refuses(
        SettingsError,
        "torques: expected the method 'fast' and --identify.torque friction with known torques, got the "
        "method 'paper'; leave one of them out.",
    ):
        identify(pushed, double, IdentifySettings(method="paper"))
    with refuses(
        VideoError,
        "TorqueLog: expected two rows or more of finite torques that are not all zero, got others; give what "
        "acted, or no log.",
    ):
        replace(log, torque=np.zeros((len(log.time), 1)))
