"""A mechanism with a part more: on a base that swings to and fro, or with a further link at its end.

A stand that rocks accelerates all that hangs on it. As a further joint, a slide with a spring, such a base is
a mechanism like any other; its mass is so large that nothing moves it but its own spring, in a plain
oscillation. A further link hangs where the last one ends, and is like that one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.mechanism.axis import long_axis, profile
from monodyn.mechanism.model import Mechanism
from monodyn.mechanism.parts import Given, Joint, Link
from monodyn.mechanism.plan import JOINT, START_DAMPING
from monodyn.mechanism.read import assembled

BASE = "base"
"""Name of the base's body, and of its joint; an underscore follows where the mechanism has that name."""
FURTHER = "further"
"""Name of a further link's body, and of its joint."""
ALIKE = ("length", "tail", "width", "thickness", "offset")
"""Sizes of a further link that are those of the last one."""
HEAVIER = 1e4
"""Mass of the base over that of all bodies: what they do to its motion is less than its noise."""


def mounted(mechanism: Mechanism, rate: float) -> tuple[Mechanism, str]:
    """Return a mechanism on a base that swings to the right and back, its spring free.

    Args:
        mechanism: A mechanism whose roots stand on the world.
        rate: Rate of the base's oscillation [rad/s].

    Returns:
        The mechanism with one joint more, the first one, and the name of that joint.
    """
    name = _new(BASE, mechanism)
    values = mechanism.values
    mass = HEAVIER * sum(values[f"{body}.mass"] for body in mechanism.bodies)
    base = Link(
        joint=Joint(name, name, "slide", -np.inf, np.inf, 1), parent=-1, carries=True, anchor=np.zeros(2),
        angle=0.0, axis=np.array([1.0, 0.0]), offset=0.0, geoms=(),
        givens=(Given(name, mass, np.zeros(2), mass),),
        terms={kind: mass * rate**2 if kind == "stiffness" else 0.0 for kind in JOINT},
    )  # fmt: skip
    links = [base, *(replace(link, parent=link.parent + 1) for link in mechanism.plan.links)]
    made = grown(mechanism, assembled(mechanism.name, links, values["gravity"]))
    known = set(mechanism.plan.table.names)
    held = [p.name for p in made.parameters if p.name not in known and not p.follows]
    return made.with_choices(fix={n: made.values[n] for n in held}).with_choices(
        free=[f"{name}.stiffness"]
    ), name


def hung(mechanism: Mechanism) -> tuple[Mechanism, str] | None:
    """Return a mechanism with a further link, like the last one, on a hinge where that one ends.

    Args:
        mechanism: A mechanism.

    Returns:
        The mechanism with one joint more, the last one, and the name of that joint; None where the last body
        has no length, or others would be measured from its end.
    """
    last, count = mechanism.plan.links[-1], len(mechanism.plan.links)
    if not last.carries or f"{last.joint.body}.length" not in mechanism.values:
        return None
    name = _new(FURTHER, mechanism)
    profiles = [profile(geom) for geom in last.geoms if geom.body == last.joint.body]
    along, length = long_axis(last, [], profiles)
    further = replace(
        last, joint=Joint(name, name, "hinge", -np.inf, np.inf, 1), parent=count - 1, anchor=length * along,
        angle=0.0, axis=np.array([1.0, 0.0]), sites=(),
        geoms=tuple(replace(geom, body=name, name="") for geom in last.geoms),
        givens=tuple(replace(given, body=name) for given in last.givens),
        terms={kind: START_DAMPING if kind == "damping" else 0.0 for kind in JOINT},
    )  # fmt: skip
    made = assembled(mechanism.name, [*mechanism.plan.links, further], mechanism.values["gravity"])
    if not set(mechanism.plan.table.names) <= set(made.values):
        return None
    made = grown(mechanism, made)
    # where picture or search have found other sizes of the last one than the file's, it is like these
    theirs = {f"{name}.{kind}": f"{last.joint.body}.{kind}" for kind in ALIKE}
    alike = {own: made.values[other] for own, other in theirs.items() if {own, other} <= set(made.values)}
    return made.with_values(alike), name


def _new(name: str, mechanism: Mechanism) -> str:
    """Return a name that no body or joint has yet."""
    while name in mechanism.bodies or any(joint.name == name for joint in mechanism.joints):
        name += "_"
    return name


def grown(mechanism: Mechanism, made: Mechanism) -> Mechanism:
    """Return a mechanism of further parts with the parameters of another one as they are there.

    Args:
        mechanism: The other one.
        made: A mechanism that has all of its parameters.
    """
    columns = ("numbers", "lower", "upper", "own", "free")
    table, found = mechanism.plan.table, {column: getattr(made, column).copy() for column in columns}
    for row, parameter in enumerate(table.names):
        at = made.row(parameter)
        for column, values in found.items():
            values[at] = getattr(mechanism, column)[row]
    return replace(made, **found, chosen=mechanism.chosen, measured=mechanism.measured, ends=mechanism.ends)
