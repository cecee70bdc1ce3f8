"""Torques over time: their values, the parameters that make them, and what a driven mechanism writes."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

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


def _fourier(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with a series of two terms, every coefficient another number."""
    driven = mechanism.with_torque("fourier", terms=2, period=0.8)
    names = [name for name in driven.values if ".torque." in name]
    return driven.with_values({name: 0.001 * (k + 1) for k, name in enumerate(names)})


def test_fourier_parameters_make_the_drive() -> None:
    mechanism = _fourier(load("cartpole"))
    added = [p for p in mechanism.parameters if "torque" in p.name]
    waves = ["mean", "cos1", "sin1", "cos2", "sin2"]
    joints = [j.name for j in mechanism.joints]
    assert [p.name for p in added] == ["torque.period", *(f"{j}.torque.{w}" for j in joints for w in waves)]
    assert [p.unit for p in added] == ["s", *["N"] * 5, *["N m"] * 5]
    assert all(p.free and not p.follows for p in added)
    assert (added[0].lower, added[0].upper) == pytest.approx((8e-4, 800))
    assert (added[1].lower, added[1].upper) == (-np.inf, np.inf)
    assert mechanism.torque == "fourier"
    assert mechanism.drive.mode == FOURIER
    assert mechanism.drive.times.tolist() == [0.8]
    assert np.allclose(mechanism.drive.table, 0.001 * np.arange(1, 11).reshape(2, 5), rtol=1e-15)


def test_free_parameters_make_the_drive() -> None:
    mechanism = load("double").with_torque("free", knots=KNOT_TIMES)
    names = [name for name in mechanism.values if ".torque." in name]
    assert names == [f"joint{j}.torque.{k}" for k in range(4) for j in (1, 2)]
    mechanism = mechanism.with_values({name: k for k, name in enumerate(names)})
    assert mechanism.torque == "free"
    assert mechanism.drive.mode == KNOTS
    assert np.array_equal(mechanism.drive.times, KNOT_TIMES)
    assert np.array_equal(mechanism.drive.table, [[0, 2, 4, 6], [1, 3, 5, 7]])


def test_torques_leave_links_and_shapes_alone() -> None:
    plain = load("double").with_values({"link1.length": 0.3})
    for driven in (_fourier(plain), plain.with_torque("free", knots=KNOT_TIMES)):
        assert np.array_equal(driven.tree.links, plain.tree.links)
        assert np.array_equal(driven.shapes.points, plain.shapes.points)
        assert {name: driven.values[name] for name in plain.values} == plain.values
        assert [n for n in driven.values if n not in plain.values] == list(driven.values)[len(plain.values) :]


def test_what_is_known_of_torques_is_kept() -> None:
    mechanism = _fourier(load("double")).with_choices(
        fix={"joint1.torque.mean": 0.0},
        free=["gravity"],
        bounds={"joint2.torque.cos1": (-1.0, 1.0), "torque.period": (0.5, 1.0)},
    )
    more = mechanism.with_torque("fourier", terms=3, period=2.0)
    assert more.drive.table.shape == (2, 7)
    assert np.array_equal(more.drive.table[:, :5], mechanism.drive.table)
    assert not more.drive.table[:, 5:].any()
    assert more.values["torque.period"] == 0.8
    assert not more.parameter("joint1.torque.mean").free
    assert (more.parameter("joint2.torque.cos1").lower, more.parameter("torque.period").upper) == (-1.0, 1.0)
    assert more.chosen == {"joint1.torque.mean", "gravity"}
    less = more.with_torque("fourier", terms=2)
    assert less.parameters == mechanism.parameters
    off = less.with_torque("friction")
    assert off.parameters == load("double").with_choices(free=["gravity"]).parameters
    assert off.chosen == {"gravity"}
    assert off.drive.mode == NONE


def test_torques_at_knots_are_kept_with_the_same_knots_alone() -> None:
    mechanism = load("single").with_torque("free", knots=KNOT_TIMES).with_choices({"joint1.torque.1": 0.4})
    assert mechanism.with_torque("free", knots=KNOT_TIMES).drive.table.tolist() == [[0.0, 0.4, 0.0, 0.0]]
    other = mechanism.with_torque("free", knots=KNOT_TIMES + 1.0)
    assert not other.drive.table.any()
    assert other.parameter("joint1.torque.1").free
    assert not other.chosen


@pytest.mark.parametrize("model", ["fourier", "free"])
def test_driven_mechanisms_have_free_bodies_and_directions_as_others(model: str) -> None:
    plain = load("double").with_bodies("free")
    driven = load("double").with_torque(model, terms=2, knots=KNOT_TIMES, period=1.0).with_bodies("free")
    torques = [p.name for p in driven.parameters[len(plain.parameters) :]]
    assert driven.parameters[: len(plain.parameters)] == plain.parameters
    assert all(driven.parameter(name).free for name in torques)
    names = ["link1.length", *torques, "gravity"]
    found = driven.directions(names)
    expected = plain.directions(["link1.length", "gravity"])
    assert np.array_equal(found.links[:, :, [0, -1]], expected.links)
    assert np.array_equal(found.gravity[:, [0, -1]], expected.gravity)
    assert not found.links[:, :, 1:-1].any()
    assert not found.gravity[:, 1:-1].any()
    assert driven.directions(torques).links.shape[2] == len(torques)


@pytest.mark.parametrize("model", ["fourier", "free"])
def test_drive_entries_are_the_entries_that_a_parameter_changes(model: str) -> None:
    mechanism = load("double").with_torque(model, terms=2, knots=KNOT_TIMES, period=1.0)
    torques = [p.name for p in mechanism.parameters if ".torque." in p.name]
    names = ["gravity", *torques[::-1][:-1]]
    entry = mechanism.drive_entries(names)
    assert entry.shape == mechanism.drive.table.shape
    for k, name in enumerate(names):
        changed = mechanism.with_values({name: 0.5}).drive.table != mechanism.drive.table
        assert np.array_equal(entry == k, changed)
    assert np.sum(entry == -1) == 1
    assert np.array_equal(load("double").drive_entries(names[:1]), np.zeros((2, 0)))


def test_a_part_called_torque_keeps_its_parameters(tmp_path: Path) -> None:
    text = """<mujoco><worldbody><body name="torque"><joint name="torque" axis="0 -1 0"/>
      <geom name="torque" type="box" size="0.1 0.003 0.01" pos="0.1 0 0"/></body></worldbody></mujoco>"""
    (tmp_path / "m.xml").write_text(text)
    mechanism = load(tmp_path / "m.xml").with_torque("fourier", terms=1, period=0.5)
    mechanism = mechanism.with_values({"torque.torque.sin1": 0.2, "torque.length": 0.3})
    assert mechanism.drive.table.tolist() == [[0.0, 0.0, 0.2]]
    assert mechanism.parameter("torque.length").value == 0.3
    free = mechanism.with_torque("free", knots=KNOT_TIMES)
    assert [name for name in free.values if name.startswith("torque.torque.")] == [
        f"torque.torque.{k}" for k in range(4)
    ]


@pytest.mark.parametrize(
    ("model", "options", "message"),
    [
        ("spline", {}, "torque: expected one of 'friction', 'fourier', 'free', got 'spline'."),
        ("fourier", {"period": 1.0}, "torque.terms: expected 1 or more, got 0."),
        ("fourier", {"terms": 2}, "torque.period: expected a time above 0 s, got None."),
        ("fourier", {"terms": 2, "period": -0.5}, "torque.period: expected a time above 0 s, got -0.5."),
        ("fourier", {"terms": 2, "period": np.nan}, "torque.period: expected a time above 0 s, got nan."),
        ("free", {}, "torque.knots: expected 2 or more, got 0; give their times [s]."),
        ("free", {"knots": [0.0, 0.2, 0.1]},
         "torque.knots: must increase, but sample 2 is 0.1 s after 0.2 s."),
        ("free", {"knots": [[0.0, 0.2]]}, "torque.knots: expected an array of shape (any), got (1, 2)."),
    ],
)  # fmt: skip
def test_a_torque_that_makes_no_sense_is_refused(model: str, options: dict, message: str) -> None:
    with pytest.raises(MechanismError) as caught:
        load("double").with_torque(model, **options)
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
    mechanism = _fourier(load("double")).with_choices(fix={"joint1.torque.mean": -0.002})
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
