"""The parameters of torques over time, and the drive that they make."""

from pathlib import Path

import numpy as np
import pytest

from models import series_driven
from monodyn.errors import MechanismError
from monodyn.mechanism import load
from monodyn.mechanism.drive import FOURIER, KNOTS, NONE

KNOT_TIMES = np.array([0.1, 0.2, 0.35, 0.7])


def test_fourier_parameters_make_the_drive() -> None:
    mechanism = series_driven(load("cartpole"))
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
    for driven in (series_driven(plain), plain.with_torque("free", knots=KNOT_TIMES)):
        assert np.array_equal(driven.tree.links, plain.tree.links)
        assert np.array_equal(driven.shapes.points, plain.shapes.points)
        assert {name: driven.values[name] for name in plain.values} == plain.values
        assert [n for n in driven.values if n not in plain.values] == list(driven.values)[len(plain.values) :]


def test_what_is_known_of_torques_is_kept() -> None:
    mechanism = series_driven(load("double")).with_choices(
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
def test_entries_of_the_drive_are_those_that_a_parameter_changes(model: str) -> None:
    mechanism = load("double").with_torque(model, terms=2, knots=KNOT_TIMES, period=1.0)
    torques = [p.name for p in mechanism.parameters if ".torque." in p.name]
    names = ["gravity", *torques[::-1][:-1]]
    entry = mechanism.torques.entries_of(names)
    assert entry.shape == mechanism.drive.table.shape
    for k, name in enumerate(names):
        changed = mechanism.with_values({name: 0.5}).drive.table != mechanism.drive.table
        assert np.array_equal(entry == k, changed)
    assert np.sum(entry == -1) == 1
    assert np.array_equal(load("double").torques.entries_of(names[:1]), np.zeros((2, 0)))


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
        ("spline", {}, "torque: expected one of 'friction', 'fourier', 'free', 'known', got 'spline'."),
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
