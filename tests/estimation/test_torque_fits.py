"""Identification under torques: motion simulated by MuJoCo, with friction, periodic and arbitrary torques."""

import json
import os
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from monodyn.estimation.record.samples import cut, prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.trial import Trial
from monodyn.estimation.torque.periods import PeriodSearch
from monodyn.mechanism import load
from monodyn.paper.settings import PaperIdentifySettings
from monodyn.results.fill import fill
from monodyn.results.predict import predict
from monodyn.results.torques import torques
from monodyn.stages import identify
from monodyn.types import Poses

RATE, NOISE, PERIOD = 30, 1e-3, 2.3
THICKNESS = {"link1.thickness": 0.006, "link2.thickness": 0.006}
SIZES = {"link1.length": 0.23, "link1.width": 0.032, "link2.length": 0.17, "link2.width": 0.028}
GEOM = 'type="box" density="2700" contype="0" conaffinity="0"'
DOUBLE = f"""<mujoco><option gravity="0 0 -9.81" integrator="RK4"/><worldbody>
<body name="link1"><joint name="joint1" type="hinge" axis="0 -1 0" damping="0.001"/>
<geom {GEOM} size="0.115 0.003 0.016" pos="0.115 0 0"/>
<body name="link2" pos="0.23 -0.006 0"><joint name="joint2" type="hinge" axis="0 -1 0" damping="0.0005"/>
<geom {GEOM} size="0.085 0.003 0.014" pos="0.085 0 0"/></body></body></worldbody></mujoco>"""
CART = f"""<mujoco><option gravity="0 0 -9.81" integrator="RK4"/><worldbody>
<body name="cart"><joint name="slider" type="slide" axis="1 0 0" damping="0.2"/>
<geom {GEOM} size="0.06 0.004 0.03"/>
<body name="pole" pos="0 -0.02 0"><joint name="hinge" type="hinge" axis="0 -1 0" damping="0.0005"/>
<geom {GEOM} size="0.15 0.003 0.012" pos="0.15 0 0"/></body></body></worldbody></mujoco>"""


SERIES = IdentifySettings(torque="fourier")


def simulated(model, start, frames, torque=None, seed=0):
    """Return a noisy record of MuJoCo's motion under ``torque(time)``, and the torques (frame, dof)."""
    model = mujoco.MjModel.from_xml_string(model)
    data = mujoco.MjData(model)
    steps = 33
    model.opt.timestep = 1.0 / RATE / steps
    data.qpos[:] = start
    position, applied = [], []
    for step in range(frames * steps):
        if torque is not None:
            data.qfrc_applied[:] = torque(data.time)
        if step % steps == 0:
            position.append(data.qpos.copy())
            applied.append(data.qfrc_applied.copy())
        mujoco.mj_step(model, data)
    count, dofs = frames, model.nv
    names = tuple(model.joint(i).name for i in range(dofs))
    noise = NOISE * np.random.default_rng(seed).normal(size=(count, dofs))
    covariance = np.tile(NOISE**2 * np.eye(dofs), (count, 1, 1))
    record = Poses(
        names, np.arange(count), np.arange(count) / RATE, np.array(position) + noise, covariance,
        np.ones(count, dtype=bool),
    )  # fmt: skip
    return record, np.array(applied)


def started(model, tmp_path, factor, **fixed):
    """Return the mechanism of a model with sizes that are ``factor`` times as large, some fixed."""
    path = tmp_path / "model.xml"
    path.write_text(model, encoding="utf-8")
    mechanism = load(path)
    sizes = {n: factor * v for n, v in mechanism.values.items() if n.endswith((".length", ".width"))}
    return mechanism.with_values(sizes).with_choices(fix=fixed)


def wave(time):
    return np.array([0.04 * np.sin(2 * np.pi * time / PERIOD), 0.006 * np.cos(2 * np.pi * time / PERIOD)])


def two_waves(time):
    turn = 2 * np.pi * time / PERIOD
    return np.array([0.03 * np.sin(turn) + 0.02 * np.cos(2 * turn), 0.006 * np.sin(3 * turn + 1)])


def pull(time):
    return np.array([0.05 * np.exp(-((time - 3.0) ** 2)), 0.01 * np.tanh(time - 2.0)])


@pytest.fixture(scope="module")
def driven():
    return simulated(DOUBLE, [-1.5, 0.3], 150, wave)


@pytest.fixture(scope="module")
def passive():
    return simulated(DOUBLE, [-0.8, 0.4], 120)


@pytest.fixture(scope="module")
def series(driven, tmp_path_factory):
    start = started(DOUBLE, tmp_path_factory.mktemp("series"), 0.5, **THICKNESS)
    return identify(driven[0], start, IdentifySettings(torque="fourier"))


def misses(fit, record, applied):
    """Return the rms error of the torques in shares of the rms torque, (dof,)."""
    error = torques(fit, record.time).torque - applied
    return np.sqrt(np.mean(error**2, axis=0) / np.mean(applied**2, axis=0))


def test_a_periodic_torque_is_found_without_a_hint(series, driven):
    assert series.ok, series.status
    assert series.torque == "fourier"
    period = series.parameter("torque.period")
    assert abs(period.value - PERIOD) < min(4 * period.std, 0.005 * PERIOD)
    assert series.mechanism.drive.table.shape == (2, 3)
    assert misses(series, *driven).max() < 0.02
    for name, true in (("link1.length", 0.23), ("link2.length", 0.17), ("joint2.damping", 5e-4)):
        assert abs(series.parameter(name).value - true) < 4 * series.parameter(name).std


def test_the_band_of_a_torque_covers_the_truth(series, driven):
    found = torques(series, driven[0].time)
    error = np.abs(found.torque - driven[1]) / found.std
    assert np.percentile(error, 90) < 3.0


def test_a_periodic_torque_predicts(series, tmp_path):
    longer, _ = simulated(DOUBLE, [-1.5, 0.3], 210, wave)
    future = predict(series, times=longer.time[150:])
    assert np.degrees(np.abs(future.position - longer.position[150:])).max() < 1.0


def test_harmonics_are_counted(tmp_path):
    record, applied = simulated(DOUBLE, [-1.5, 0.3], 180, two_waves)
    fit = identify(record, started(DOUBLE, tmp_path, 2.0, **THICKNESS), IdentifySettings(torque="fourier"))
    assert fit.ok, fit.status
    assert (fit.mechanism.drive.table.shape[1] - 1) // 2 == 3
    assert misses(fit, record, applied).max() < 0.03


def test_a_force_at_a_slide(tmp_path):
    record, applied = simulated(
        CART, [0.0, -1.0], 150, lambda t: np.array([0.5 * np.sin(2 * np.pi * t / 1.1), 0.0])
    )
    start = started(CART, tmp_path, 0.7, **{"pole.thickness": 0.006})
    fit = identify(record, start, IdentifySettings(torque="fourier", terms=1))
    assert fit.ok, fit.status
    assert fit.parameter("torque.period").value == pytest.approx(1.1, rel=2e-3)
    error = torques(fit, record.time).torque - applied
    assert np.sqrt(np.mean(error[:, 0] ** 2)) < 0.02 * np.sqrt(np.mean(applied[:, 0] ** 2))
    assert fit.parameter("slider.torque.sin1").unit == "N"


def test_without_a_mass_torques_are_ratios(driven, tmp_path):
    fit = identify(driven[0], started(DOUBLE, tmp_path, 0.5), IdentifySettings(torque="fourier", terms=1))
    assert fit.ok, fit.status
    assert not fit.parameter("joint1.torque.sin1").identifiable
    ratio = next(c for c in fit.combinations if c.name == "joint1.torque.sin1 / link1.thickness")
    assert abs(ratio.value - 0.04 / 0.006) < 4 * ratio.std
    assert any("mass scale" in sentence for sentence in fit.advice)


def test_the_paper_s_series_stands_alone(tmp_path):
    frictionless = DOUBLE.replace('damping="0.001"', "").replace('damping="0.0005"', "")
    record, applied = simulated(frictionless, [-1.5, 0.3], 150, wave)
    start = started(DOUBLE, tmp_path, 0.5, **THICKNESS)
    fit = identify(record, start, IdentifySettings(torque="fourier", series="alone", terms=3))
    assert fit.ok, fit.status
    assert fit.parameter("joint1.damping").value == 0.0
    assert not fit.parameter("joint1.damping").free
    assert len([n for n in fit.names if ".torque." in n]) == 14
    assert misses(fit, record, applied).max() < 0.03


def guessed(record, mechanism, terms=0):
    search = PeriodSearch.of(mechanism, prepare((record,), mechanism), (smooth(record),))
    return search, search.guesses(terms)


@pytest.mark.parametrize("period", [0.6, 1.1, 2.3])
@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_the_period_is_guessed_at_any_scale(period, factor, tmp_path):
    """Within a percent from accelerations alone; peaks are smoothed away, so sizes come out less exactly."""

    def push(time):
        turn = 2 * np.pi * time / period
        return np.array([0.03 * np.sin(turn) + 0.006 * np.cos(2 * turn), 0.004 * np.cos(turn)])

    record, _ = simulated(DOUBLE, [-1.5, 0.1], 200, push)
    start = started(DOUBLE, tmp_path, factor, **THICKNESS)
    search, guesses = guessed(record, start)
    assert guesses[0].period == pytest.approx(period, rel=0.01)
    driven = posed(start.with_torque("fourier", terms=5, period=guesses[0].period), prepare((record,), start))
    found = driven.mechanism_at(search.start(guesses[0], driven))
    assert found.values["link1.length"] == pytest.approx(0.23, rel=0.35)
    table = guesses[0].table
    np.testing.assert_array_equal(found.drive.table[:, : table.shape[1]], table)
    assert not found.drive.table[:, table.shape[1] :].any()


@pytest.mark.skipif("MONODYN_DATA" not in os.environ, reason="MONODYN_DATA is not set: no rendered clips")
@pytest.mark.parametrize("frames", [100, 200, 300])
def test_the_period_of_a_rendered_clip(frames):
    """Its motion is driven with 1.4286 s and swings freely with 1.05 s; sizes are known up to a scale."""
    truth = json.loads((Path(os.environ["MONODYN_DATA"]) / "rendered" / "double_torque.json").read_text())
    (l1, w1, _), (l2, w2, _) = truth["truth"]["links"]
    seen = {"link1.length": l1, "link1.width": w1, "link2.length": l2, "link2.width": w2}
    mechanism = load("double")
    overhang = {name: 1e-9 for name in mechanism.values if name.endswith((".tail", ".tip"))}
    mechanism = mechanism.with_values({name: 0.7 * value for name, value in seen.items()} | overhang)
    position = np.array(truth["q"])[:frames]
    position = position + NOISE * np.random.default_rng(0).normal(size=position.shape)
    record = Poses(
        ("joint1", "joint2"), np.arange(frames), np.array(truth["times"])[:frames], position,
        np.tile(NOISE**2 * np.eye(2), (frames, 1, 1)), np.ones(frames, dtype=bool),
    )  # fmt: skip
    _, guesses = guessed(record, mechanism)
    assert guesses[0].period == pytest.approx(1 / 0.7, rel=5e-3)
    assert guesses[0].terms == 1


@pytest.mark.parametrize(("lower", "upper"), [(2.0, 2.5), (2.29, 2.295), (1.8, 2.2), (1e-3, 2.0)])
def test_periods_stay_within_bounds(lower, upper, driven, tmp_path):
    start = started(DOUBLE, tmp_path, 0.5, **THICKNESS).with_torque("fourier", terms=1, period=lower)
    _, guesses = guessed(driven[0], start.with_choices(bounds={"torque.period": (lower, upper)}), 1)
    assert guesses
    assert all(lower <= guess.period <= upper for guess in guesses)
    if lower < PERIOD < upper:
        assert guesses[0].period == pytest.approx(PERIOD, rel=0.01)


def test_rows_without_a_joint_tell_no_period(driven, tmp_path):
    position = driven[0].position.copy()
    position[::2, 0] = position[1::2, 1] = np.nan
    holes = Poses(
        driven[0].joints, driven[0].frame, driven[0].time, position, driven[0].covariance, driven[0].seen
    )
    assert guessed(holes, started(DOUBLE, tmp_path, 0.5, **THICKNESS))[1] == []


def test_no_period_is_said_with_what_to_do(passive, tmp_path):
    start = started(DOUBLE, tmp_path, 0.5, **THICKNESS)
    fit = identify(passive[0], start, IdentifySettings(torque="fourier"))
    assert not fit.ok
    assert "period" in fit.status
    assert "--fix torque.period" in fit.status


def test_a_period_longer_than_the_record_is_not_guessed(tmp_path):
    """Half a period of the torque looks like a shorter one to a model that may choose its sizes."""
    for first in (0, 30, 60):
        record, _ = simulated(DOUBLE, [-1.5, 0.3], 120, wave)
        fit = identify(record.part(first, first + 36), started(DOUBLE, tmp_path, 0.5), SERIES)
        assert not fit.ok
        assert "period" in fit.status


def test_what_the_model_lacks_is_no_periodic_torque(passive, tmp_path):
    """A passive record with a small fault that follows the motion: angles read 0.2 % too large."""
    record = replace(passive[0], position=1.002 * passive[0].position)
    fit = identify(record, started(DOUBLE, tmp_path, 0.5, **THICKNESS), SERIES)
    assert not fit.ok
    assert "--fix torque.period" in fit.status


def test_a_given_thickness_without_use_is_said(driven, tmp_path):
    inertial = DOUBLE.replace(GEOM, GEOM.replace('density="2700"', 'mass="0.1"'))
    start = started(inertial, tmp_path, 1.0, **THICKNESS)
    fit = identify(driven[0], start, IdentifySettings(torque="fourier", terms=1))
    assert any("link1.thickness and link2.thickness were given" in sentence for sentence in fit.advice)


def test_a_known_period_is_kept(passive, tmp_path):
    start = started(DOUBLE, tmp_path, 0.5, **THICKNESS).with_torque("fourier", terms=1, period=1.0)
    start = start.with_choices(fix={"torque.period": 0.9})
    fit = identify(passive[0], start, IdentifySettings(torque="fourier", terms=1))
    assert fit.ok, fit.status
    assert fit.parameter("torque.period").value == 0.9
    sine = fit.parameter("joint1.torque.sin1")
    assert abs(sine.value) < 4 * sine.std
    assert any("nothing periodic need act" in sentence for sentence in fit.advice)


def test_more_unknowns_than_samples_is_refused(driven, tmp_path):
    settings = IdentifySettings(torque="fourier", terms=12)
    fit = identify(driven[0].part(0, 20), started(DOUBLE, tmp_path, 0.5), settings)
    assert not fit.ok
    assert "cannot determine" in fit.status


def test_any_torque_is_found_when_sizes_are_known(tmp_path):
    record, applied = simulated(DOUBLE, [-1.5, 0.3], 90, pull)
    start = started(DOUBLE, tmp_path, 1.0, **THICKNESS, **SIZES)
    fit = identify(record, start, IdentifySettings(torque="free"))
    assert fit.ok, fit.status
    assert len(fit.names) == 2 * 90 + 4
    # friction is part of a free torque
    rate = fill(fit, record.time).velocity
    whole = applied - rate * np.array([0.001, 0.0005])
    error = (torques(fit, record.time).torque - whole)[5:-5]
    assert (np.sqrt(np.mean(error**2, axis=0)) < 0.06 * np.sqrt(np.mean(whole**2, axis=0))).all()
    assert max(fit.rms.values()) < 1.1 * NOISE


def test_free_torques_say_what_they_rest_on(driven, tmp_path):
    fit = identify(driven[0].part(0, 60), started(DOUBLE, tmp_path, 0.5), IdentifySettings(torque="free"))
    assert fit.ok, fit.status
    assert not fit.parameter("link1.length").identifiable
    assert any("held" in sentence for sentence in fit.advice)
    assert any("prediction" in sentence for sentence in fit.advice)
    assert np.isinf(predict(fit).std).all()
    assert np.isfinite(fill(fit, driven[0].time[:60]).std).all()
    assert fit.mechanism.drive.at(np.array([10.0])).tolist() == [[0.0, 0.0]]
    # camera and slides follow the common scale
    assert fit.scale == pytest.approx(fit.parameter("link1.length").value / 0.115)


def test_free_torques_take_one_record_of_a_few_hundred_frames(driven, tmp_path):
    start, settings = started(DOUBLE, tmp_path, 0.5), IdentifySettings(torque="free")
    assert "one record at a time" in identify([driven[0], driven[0]], start, settings).status
    count = 1100
    long = Poses(
        driven[0].joints, np.arange(count), np.arange(count) / RATE,
        np.resize(driven[0].position, (count, 2)), np.resize(driven[0].covariance, (count, 2, 2)),
        np.ones(count, dtype=bool),
    )  # fmt: skip
    assert "at most 1000 frames" in identify(long, start, settings).status


def test_dry_friction_is_estimated_where_it_shows(passive, tmp_path):
    start = started(DOUBLE, tmp_path, 0.5, **THICKNESS)
    without = identify(passive[0], start)
    assert not without.parameter("joint1.friction").free
    # MuJoCo's friction gives way a little by default
    stiff = (
        'damping="0.001" frictionloss="0.004" solreffriction="0.002 1" solimpfriction="0.999 0.9999 0.001"'
    )
    dry = DOUBLE.replace('damping="0.001"', stiff)
    record, _ = simulated(dry, [-0.8, 0.4], 120)
    found = identify(record, start)
    assert found.ok, found.status
    assert found.parameter("joint1.friction").free
    assert found.parameter("joint1.friction").value == pytest.approx(0.004, rel=0.05)
    held = identify(record, start.with_choices(fix={"joint1.friction": 0.0, "joint2.friction": 0.0}))
    assert held.parameter("joint1.friction").value == 0.0
    assert held.rms["joint1"] > 1.5 * found.rms["joint1"]


@pytest.mark.parametrize("name", ["joint1.torque.cos1", "torque.period", "time_scale", "link1.length"])
def test_slopes_of_a_driven_rollout_are_differences(name, driven, tmp_path):
    start = started(DOUBLE, tmp_path, 1.1).with_torque("fourier", terms=2, period=2.1)
    start = start.with_choices(free=["time_scale"])
    start = start.with_values({"joint1.torque.cos1": 0.02, "joint2.torque.sin2": 0.01, "time_scale": 1.1})
    record = driven[0].part(20, 40)
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


def test_settings_of_the_paper_are_refused_elsewhere(passive, tmp_path):
    from monodyn.errors import SettingsError

    for choice in ({"rates": True}, {"states": "filtered"}):
        with pytest.raises(SettingsError, match="method paper"):
            PaperIdentifySettings(method="fast", **choice)
        with pytest.raises(SettingsError, match="method paper"):
            identify(passive[0], started(DOUBLE, tmp_path, 0.5), PaperIdentifySettings(**choice))
    for choice in ({"terms": 3}, {"series": "alone"}):
        with pytest.raises(SettingsError, match="torque fourier"):
            IdentifySettings(**choice)
    with pytest.raises(SettingsError, match=r"eq\. 7"):
        PaperIdentifySettings(gains=(0.4, 0.1, 3.0))
