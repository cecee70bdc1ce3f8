"""Torques over time: their values, the motion that they make, and what a driven mechanism writes."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from models import series_driven
from monodyn.errors import MechanismError
from monodyn.mechanism import Mechanism, load, write_mjcf, write_urdf
from monodyn.mechanism.drive import FOURIER, KNOTS, NONE, UNDRIVEN, Drive
from monodyn.mechanism.simulate import simulate

SEED = 20120806
KNOT_TIMES = np.array([0.1, 0.2, 0.35, 0.7])


def test_fourier_series_is_the_sum_of_its_waves() -> None:
    table = np.random.default_rng(SEED).uniform(-1, 1, (2, 15))
    times = np.linspace(-3, 9, 200)
    angle = 2 * np.pi * times[:, None] / 1.7 * np.arange(1, 8)
    waves = np.stack([np.cos(angle), np.sin(angle)], axis=-1).reshape(len(times), 14)
    # Rounding; the angles are up to 200 rad.
    expected = table[:, 0] + waves @ table[:, 1:].T
    assert np.allclose(Drive(FOURIER, [1.7], table).at(times), expected, rtol=0, atol=1e-12)


def test_knots_are_joined_by_lines_and_nothing_is_outside() -> None:
    table = np.random.default_rng(SEED).uniform(-1, 1, (3, 4))
    times = np.linspace(0, 1, 98)
    expected = np.stack([np.interp(times, KNOT_TIMES, row, left=0, right=0) for row in table], axis=1)
    assert np.allclose(Drive(KNOTS, KNOT_TIMES, table).at(times), expected, rtol=0, atol=1e-14)
    assert np.allclose(Drive(KNOTS, KNOT_TIMES, table).at(KNOT_TIMES), table.T, rtol=0, atol=1e-14)
    # A stamp that rounding puts beside an end counts as the end.
    ends = Drive(KNOTS, KNOT_TIMES, table).at(np.array([0.1 - 1e-15, 0.7 + 1e-15]))
    assert np.array_equal(ends, table[:, [0, -1]].T)


def test_no_drive_is_no_torque() -> None:
    assert np.array_equal(UNDRIVEN(3).at(np.arange(4.0)), np.zeros((4, 3)))


@pytest.mark.parametrize(
    ("mode", "times", "columns", "message"),
    [
        (FOURIER, [0.0], 3, "Drive.times: expected one period above 0 s, got [0.0]."),
        (FOURIER, [1.0, 2.0], 3, "Drive.times: expected one period above 0 s, got [1.0, 2.0]."),
        (FOURIER, [1.0], 4, "Drive.table: expected a mean and pairs of cosine and sine, got 4 columns."),
        (KNOTS, [0.0, 0.0], 2, "Drive.times: must increase, but sample 1 is 0 s after 0 s."),
        (KNOTS, [0.0], 1,
         "Drive.table: expected a column for each of at least 2 knots, got 1 columns and 1 knots."),
        (KNOTS, [0.0, 1.0], 3,
         "Drive.table: expected a column for each of at least 2 knots, got 3 columns and 2 knots."),
        (NONE, [], 1,
         "Drive.mode: expected NONE (0, without times and columns), FOURIER (1) or KNOTS (2), got 0."),
        (7, [], 0,
         "Drive.mode: expected NONE (0, without times and columns), FOURIER (1) or KNOTS (2), got 7."),
    ],
)  # fmt: skip
def test_a_drive_that_makes_no_sense_is_refused(mode: int, times: list, columns: int, message: str) -> None:
    with pytest.raises(MechanismError) as caught:
        Drive(mode, np.array(times), np.zeros((2, columns)))
    assert str(caught.value) == message


def _weightless(tmp_path: Path) -> Mechanism:
    """Return a hinge of inertia 4e-4 kg m^2 without gravity or friction."""
    body = """<mujoco><option gravity="0 0 0"/><worldbody><body name="rotor">
      <joint name="hub" axis="0 -1 0" armature="1e-4"/><inertial pos="0 0 0" mass="1" diaginertia="1 3e-4 1"/>
      <geom type="sphere" size="0.01" contype="0" conaffinity="0"/></body></worldbody></mujoco>"""
    (tmp_path / "rotor.xml").write_text(body)
    return load(tmp_path / "rotor.xml").with_values({"hub.damping": 0.0})


def test_a_periodic_torque_turns_a_free_hinge_as_its_integral_says(tmp_path: Path) -> None:
    mechanism = _weightless(tmp_path).with_torque("fourier", terms=2, period=0.5)
    mechanism = mechanism.with_values({"hub.torque.sin2": 2e-3, "hub.torque.mean": 1e-4})
    times = 0.1 + np.linspace(0, 1, 31)
    angle = simulate(mechanism, times, np.array([0.2]), np.zeros(1), tolerance=1e-9).position[:, 0]
    turn, past = 4 * np.pi / 0.5, times - 0.1
    wave = past * np.cos(0.1 * turn) / turn - (np.sin(turn * times) - np.sin(0.1 * turn)) / turn**2
    # The tolerance of the integration.
    assert np.allclose(angle, 0.2 + 0.25 * past**2 / 2 + 5 * wave, rtol=0, atol=2e-9)


def test_a_torque_at_knots_turns_a_free_hinge_as_its_integral_says(tmp_path: Path) -> None:
    mechanism = _weightless(tmp_path).with_torque("free", knots=np.array([0.2, 0.6]))
    mechanism = mechanism.with_values({"hub.torque.1": 1e-3})
    times = np.linspace(0, 1, 11)
    angle = simulate(mechanism, times, np.zeros(1), np.array([1.0])).position[:, 0]
    ramp, after = np.clip(times - 0.2, 0, 0.4), np.clip(times - 0.6, 0, None)
    expected = times + 2.5 / 0.4 * ramp**3 / 6 + 2.5 * 0.4 / 2 * after
    # RK4 integrates lines exactly, also where a step begins at the last knot: there the torque is over.
    assert np.allclose(angle, expected, rtol=0, atol=1e-12)


def test_the_torque_of_a_driven_mechanism_is_the_control_of_what_is_written(tmp_path: Path) -> None:
    mechanism = series_driven(load("double")).with_choices(fix={"joint1.torque.mean": -0.002})
    write_mjcf(mechanism, tmp_path / "driven.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "driven.xml"))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    assert [model.actuator(i).name for i in range(model.nu)] == ["joint1_torque", "joint2_torque"]
    data = mujoco.MjData(model)
    model.opt.timestep = 1e-3
    start, theirs = np.array([-0.4, 0.3]), []

    def push(_: mujoco.MjModel, now: mujoco.MjData) -> None:
        now.ctrl[:] = mechanism.drive.at(np.array([now.time]))[0]

    data.qpos[:] = start
    mujoco.set_mjcb_control(push)
    try:
        for _ in range(1000):
            theirs.append(data.qpos.copy())
            mujoco.mj_step(model, data)
    finally:
        mujoco.set_mjcb_control(None)
    ours = simulate(mechanism, np.arange(1000) * 1e-3, start, np.zeros(2), tolerance=1e-9)
    # The error of MuJoCo's own RK4 at 1 ms.
    assert np.allclose(ours.position, theirs, rtol=0, atol=1e-7)


def test_a_drive_stands_in_numbers_with_its_formula(tmp_path: Path) -> None:
    mechanism, path = series_driven(load("double")), tmp_path / "m.xml"
    write_mjcf(mechanism, path)
    text = " ".join(path.read_text().split())
    assert (
        "Not applied by MuJoCo itself: the control [N m or N] of the motor of each joint at data.time t [s] "
        "is a0 + a1 cos(2 pi t / T) + b1 sin(2 pi t / T) + a2 cos(4 pi t / T) + ..., with T in the numeric "
        "torque.period and a0 a1 b1 a2 b2 ... in <joint>.torque." in text
    )
    model = mujoco.MjModel.from_xml_path(str(path))
    turn = 2 * np.pi * 0.3 / model.numeric("torque.period").data[0]
    waves = [1.0, np.cos(turn), np.sin(turn), np.cos(2 * turn), np.sin(2 * turn)]
    said = [waves @ model.numeric(f"{joint.name}.torque").data for joint in mechanism.joints]
    assert said == pytest.approx(mechanism.drive.at(np.array([0.3]))[0], rel=1e-12)
    knots = load("double").with_torque("free", knots=KNOT_TIMES)
    knots = knots.with_values({f"joint2.torque.{k}": 0.1 * k for k in range(4)})
    write_mjcf(knots, path)
    text = " ".join(path.read_text().split())
    assert (
        "Not applied by MuJoCo itself: the controls [N m or N] of the motors at the times in the numeric "
        "torque.times [s of data.time] are those in <joint>.torque, linear in between and zero outside."
        in text
    )
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.numeric("torque.times").data.tolist() == KNOT_TIMES.tolist()
    assert model.numeric("joint2.torque").data == pytest.approx([0.0, 0.1, 0.2, 0.3])


@pytest.mark.parametrize("model", ["fourier", "free"])
def test_what_a_driven_mechanism_writes_can_be_read(model: str, tmp_path: Path) -> None:
    mechanism = load("cartpole").with_torque(model, terms=2, knots=KNOT_TIMES, period=1.0)
    write_mjcf(mechanism, tmp_path / "m.xml")
    write_urdf(mechanism, tmp_path / "m.urdf")
    again = load(tmp_path / "m.xml")
    # Numbers are written in full; quaternions round.
    assert np.allclose(again.tree.links[:, :12], mechanism.tree.links[:, :12], rtol=1e-9, atol=1e-12)
    assert again.torque == load(tmp_path / "m.urdf").torque == "friction"
    write_mjcf(load("cartpole"), tmp_path / "plain.xml")
    assert "actuator" not in (tmp_path / "plain.xml").read_text()
