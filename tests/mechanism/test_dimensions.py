"""Dimensions of parameters: against their units, against the motion, and the powers that a fit uses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from monodyn.mechanism import Mechanism, load
from monodyn.mechanism.dimensions import DIMENSIONS, MASS_KINDS, Dimensions, dimensions, power
from monodyn.mechanism.simulate import rollout

UNITS = {"kg": (1, 0, 0), "m": (0, 1, 0), "s": (0, 0, 1), "N": (1, 1, -2), "rad": (0, 0, 0), "1": (0, 0, 0)}
TIMES = np.linspace(0.0, 0.6, 13)


def of_unit(unit: str) -> tuple[int, int, int]:
    """Read exponents of mass, length and time off a unit such as ``N m s/rad``."""
    total = np.zeros(3, int)
    above, _, below = unit.partition("/")
    for words, sign in ((above, 1), (below, -1)):
        for word in words.split():
            name, _, exponent = word.partition("^")
            total += sign * int(exponent or 1) * np.array(UNITS[name])
    return int(total[0]), int(total[1]), int(total[2])


def joint_kind(mechanism: Mechanism, owner: str) -> str:
    return next((joint.kind for joint in mechanism.joints if joint.name == owner), "hinge")


@pytest.mark.parametrize("name", ["cartpole", "double", "bob"])
@pytest.mark.parametrize("torque", ["friction", "fourier", "known"])
def test_dimensions_agree_with_the_units_of_every_parameter(name: str, torque: str) -> None:
    mechanism = load(name).with_torque(torque, terms=1, period=1.0)
    for p in mechanism.parameters:
        of = dimensions(p.kind, joint_kind(mechanism, p.owner))
        if p.kind != "time_scale":  # seconds per stamped second: its unit is 1, but true time stands above
            assert (of.mass, of.length + of.thickness, of.time) == of_unit(p.unit), p.name


def test_every_kind_is_one_of_some_mechanism(tmp_path: Path) -> None:
    hammer = tmp_path / "hammer.xml"
    hammer.write_text(
        '<mujoco><worldbody><body><joint axis="0 -1 0"/><geom type="box" size=".1 .01 .01" pos=".1 0 0"/>'
        '<geom type="box" size=".02 .01 .05" pos=".2 0 0"/></body></worldbody></mujoco>'
    )
    kinds = {
        p.kind
        for name in ("cartpole", "double", hammer)
        for model in ("fourier", "known")
        for p in load(name).with_torque(model, terms=1, period=1.0).parameters
    }
    assert kinds == set(DIMENSIONS)


def changed(mechanism: Mechanism, factor: float, **units: float) -> Mechanism:
    """Return the same mechanism in other units, as the powers of ``factor`` by which they change."""
    values = {
        p.name: p.value * factor ** power(p.kind, joint_kind(mechanism, p.owner), **units)
        for p in mechanism.parameters
        if not p.follows and p.kind != "time_scale"
    }
    return mechanism.with_values(values)


@pytest.mark.parametrize(
    "units",
    [
        {"mass": 1},
        {"mass": 1, "thickness": 1},
        {"length": 1},
        {"length": 1, "mass": 2},
        {"length": 1, "time": 0.5},
        {"length": 1, "time": 0.5, "mass": 2},
        {"time": -1},
        {"mass": 0.3, "length": -0.7, "time": 1.1, "thickness": 0.4},
    ],
)
@pytest.mark.parametrize("bodies", ["uniform", "free"])
def test_other_units_leave_the_motion_as_it_is(units: dict[str, float], bodies: str) -> None:
    mechanism = load("cartpole").with_bodies(bodies).with_torque("fourier", terms=1, period=0.8)
    slide, hinge = (joint.name for joint in mechanism.joints)
    mechanism = mechanism.with_values(
        {
            f"{slide}.torque.sin1": 0.4,
            f"{hinge}.torque.cos1": 0.003,
            f"{hinge}.stiffness": 0.01,
            f"{slide}.stiffness": 0.5,
            f"{hinge}.armature": 1e-4,
            f"{slide}.armature": 0.05,
            f"{slide}.drag": 0.02,
            f"{hinge}.drag": 1e-4,
        }
    )
    k = 1.7
    other = changed(mechanism, k, **units)
    length, clock = k ** units.get("length", 0), k ** units.get("time", 0)
    q0, v0 = np.array([0.05, 2.0]), np.array([0.3, -1.0])
    scale = np.array([length, 1.0])
    q, v = rollout(mechanism.tree, TIMES, q0, v0, substeps=4, drive=mechanism.drive)
    p, w = rollout(other.tree, TIMES * clock, q0 * scale, v0 * scale / clock, substeps=4, drive=other.drive)
    # the same steps in other units: equal to rounding, which the motion lets grow
    np.testing.assert_allclose(p / scale, q, rtol=0, atol=1e-11)
    np.testing.assert_allclose(w / scale * clock, v, rtol=0, atol=1e-10)


def test_mass_kinds_are_what_the_scale_of_masses_changes() -> None:
    assert set(MASS_KINDS) == {
        "thickness", "density", "mass", "inertia", "damping", "friction", "stiffness", "armature", "drag",
        "air", "torque",
    }  # fmt: skip
    for kind in DIMENSIONS:
        held = {power(kind, mass=1), power(kind, mass=1, thickness=1)}
        assert (kind in MASS_KINDS) == (held != {0.0})
        assert kind not in MASS_KINDS or 1.0 in held


def test_longer_in_more_gravity() -> None:
    for masses, weighted in ((0, 2.0), (2, 4.0)):
        at = {kind: power(kind, length=1, mass=masses) for kind in DIMENSIONS}
        assert {kind for kind, p in at.items() if p == 1.0} == {
            "length", "width", "tail", "tip", "extent", "along", "across", "offset", "com_x", "com_y",
            "gravity",
        }  # fmt: skip
        kinds = ("damping", "friction", "stiffness", "armature", "drag", "air", "torque", "inertia")
        assert all(at[kind] == weighted for kind in kinds)
        assert at["mass"] == masses
        assert at["thickness"] == at["time_scale"] == at["period"] == 0.0
    assert power("density", length=1, mass=2) == 0.0


@pytest.mark.parametrize("masses", [0.0, 2.0])
def test_longer_on_a_slower_clock(masses: float) -> None:
    expected = {
        "hinge": {"armature": 2.0, "damping": 1.5, "stiffness": 1.0, "friction": 1.0, "torque": 1.0},
        "slide": {"armature": 0.0, "damping": -0.5, "stiffness": -1.0, "friction": 0.0, "torque": 0.0},
    }
    for joint, powers in expected.items():
        for kind, value in powers.items():
            assert power(kind, joint, length=1, time=0.5, mass=masses) == value + masses
    for kind, value in {"time_scale": 0.5, "period": 0.5, "mass": masses, "inertia": masses + 2.0}.items():
        assert power(kind, length=1, time=0.5, mass=masses) == value
    assert power("gravity", length=1, time=0.5, mass=masses) == 0.0


def test_a_clock_in_stamps() -> None:
    assert [power(k, time=-1) for k in ("damping", "friction", "stiffness", "gravity")] == [
        1.0,
        2.0,
        2.0,
        2.0,
    ]
    assert [power(k, time=-1) for k in ("armature", "mass", "inertia", "length")] == [0.0] * 4


def test_a_force_at_a_slide_is_a_torque_less_one_length() -> None:
    assert dimensions("torque", "slide") == Dimensions(mass=1, length=1, time=-2)
    assert dimensions("mass", "slide") == dimensions("mass")
