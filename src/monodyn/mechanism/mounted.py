"""A mechanism on a base that swings to and fro: a mass so heavy that nothing moves it but its own spring.

A stand that rocks accelerates all that hangs on it. As a further joint, a slide with a spring, such a base is
a mechanism like any other; its mass is so large that its motion is a plain oscillation.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.mechanism.model import Mechanism
from monodyn.mechanism.parts import Given, Joint, Link
from monodyn.mechanism.plan import JOINT
from monodyn.mechanism.read import assembled

BASE = "base"
"""Name of the base's body, and of its joint; an underscore follows where the mechanism has that name."""
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
    name = BASE
    while name in mechanism.bodies or any(joint.name == name for joint in mechanism.joints):
        name += "_"
    values = mechanism.values
    mass = HEAVIER * sum(values[f"{body}.mass"] for body in mechanism.bodies)
    base = Link(
        joint=Joint(name, name, "slide", -np.inf, np.inf, 1), parent=-1, carries=True, anchor=np.zeros(2),
        angle=0.0, axis=np.array([1.0, 0.0]), offset=0.0, geoms=(),
        givens=(Given(name, mass, np.zeros(2), mass),),
        terms={kind: mass * rate**2 if kind == "stiffness" else 0.0 for kind in JOINT},
    )  # fmt: skip
    links = [base, *(replace(link, parent=link.parent + 1) for link in mechanism.plan.links)]
    made = assembled(mechanism.name, links, values["gravity"])
    numbers, lower, upper = made.numbers.copy(), made.lower.copy(), made.upper.copy()
    own, free = made.own.copy(), np.zeros(len(made.free), dtype=bool)
    table = mechanism.plan.table
    for row, parameter in enumerate(table.names):
        at = made.row(parameter)
        numbers[at], lower[at], upper[at] = (
            column[row] for column in (mechanism.numbers, mechanism.lower, mechanism.upper)
        )
        own[at], free[at] = mechanism.own[row], mechanism.free[row]
    made = replace(
        made,
        numbers=numbers,
        lower=lower,
        upper=upper,
        own=own,
        free=free,
        chosen=mechanism.chosen,
        measured=mechanism.measured,
    )
    held = [p.name for p in made.parameters if p.owner == name and not p.follows]
    return made.with_choices(fix={n: made.values[n] for n in held}).with_choices(
        free=[f"{name}.stiffness"]
    ), name
