"""Physical dimensions of every kind of parameter: one table, and how a change of units changes a parameter.

The motion of a mechanism does not depend on the units of mass, length and time in which it is written down.
Parameters that differ by such a change of units are therefore one mechanism to a camera that knows neither
scale. A parameter of dimensions M^a L^b T^c becomes k^(a m + b l + c t) times as large when masses become
k^m, lengths k^l and times k^t times as large; ``power`` returns that exponent.

The line of sight is a separate dimension, because neither the picture nor the planar motion relates a
``thickness`` to the sizes in the plane: density times thickness is the mass of an area. Three changes keep
the motion of a mechanism (k the factor):

* Masses, where no torque or force is known: ``power(kind, joint, mass=1)``. If densities are held,
  thicknesses take the change instead: ``mass=1, thickness=1``. ``MASS_KINDS`` are the kinds of both cases.
* Lengths and gravity at the same times: ``length=1``; bodies of given density and thickness have
  ``mass=2`` in addition, bodies of free mass and inertia keep their masses, ``mass=0``.
* Lengths and the clock at the same gravity: ``length=1, time=0.5`` with ``mass`` as before.

Parameters on a clock that runs at another rate, true time to stamped time, have ``time=-1``. A ``time_scale``
counts as a time: the stamps stay while true seconds change.

Source: dimensional analysis with lengths in different directions kept apart: H. E. Huntley, Dimensional
Analysis, Macdonald, London 1952.
"""

from __future__ import annotations

from typing import NamedTuple


class Dimensions(NamedTuple):
    """Exponents of a physical quantity.

    Attributes:
        mass: Exponent of mass.
        length: Exponent of length in the plane of the picture.
        time: Exponent of time.
        thickness: Exponent of length along the line of sight.
    """

    mass: int = 0
    length: int = 0
    time: int = 0
    thickness: int = 0


_LENGTH = Dimensions(length=1)
_FORCE = Dimensions(mass=1, length=1, time=-2)
_TORQUE = Dimensions(mass=1, length=2, time=-2)

DIMENSIONS = {
    "length": _LENGTH,
    "width": _LENGTH,
    "tail": _LENGTH,
    "tip": _LENGTH,
    "extent": _LENGTH,
    "along": _LENGTH,
    "across": _LENGTH,
    "turn": Dimensions(),
    "roll": Dimensions(),
    "offset": _LENGTH,
    "com_x": _LENGTH,
    "com_y": _LENGTH,
    "thickness": Dimensions(thickness=1),
    "density": Dimensions(mass=1, length=-2, thickness=-1),
    "mass": Dimensions(mass=1),
    "inertia": Dimensions(mass=1, length=2),
    "damping": Dimensions(mass=1, length=2, time=-1),
    "friction": _TORQUE,
    "stiffness": _TORQUE,
    "rest": Dimensions(),
    "armature": Dimensions(mass=1, length=2),
    "drag": Dimensions(mass=1, length=2),
    "air": Dimensions(mass=1, length=2),
    "lead": Dimensions(time=1),
    "torque": _TORQUE,
    "gravity": Dimensions(length=1, time=-2),
    "time_scale": Dimensions(time=1),
    "period": Dimensions(time=1),
    "lag": Dimensions(time=1),
}
"""Dimensions by kind of parameter, those of joints at a hinge. An ``offset`` is seen, by its parallax, on the
scale of the picture, so that it counts as a length in the plane."""

SLIDE_DIMENSIONS = {
    "damping": Dimensions(mass=1, time=-1),
    "friction": _FORCE,
    "stiffness": Dimensions(mass=1, time=-2),
    "rest": _LENGTH,
    "armature": Dimensions(mass=1),
    "drag": Dimensions(mass=1, length=-1),
    "air": Dimensions(mass=1, length=-1),
    "lead": Dimensions(time=1),
    "torque": _FORCE,
}
"""Dimensions of the kinds that are forces at a slide where they are torques at a hinge."""

MASS_KINDS = tuple(kind for kind, of in DIMENSIONS.items() if of.mass or of.thickness)
"""Kinds that are proportional to the scale of masses, which motion without a measured torque leaves open."""


def dimensions(kind: str, joint: str = "hinge") -> Dimensions:
    """Return the dimensions of a kind of parameter.

    Args:
        kind: `Parameter.kind`.
        joint: Kind of the joint it belongs to, ``"hinge"`` or ``"slide"``; of no effect on other parameters.
    """
    return SLIDE_DIMENSIONS.get(kind, DIMENSIONS[kind]) if joint == "slide" else DIMENSIONS[kind]


def power(
    kind: str,
    joint: str = "hinge",
    *,
    mass: float = 0.0,
    length: float = 0.0,
    time: float = 0.0,
    thickness: float = 0.0,
) -> float:
    """Return the exponent with which a parameter changes when masses, lengths and times do.

    Args:
        kind: `Parameter.kind`.
        joint: Kind of the joint it belongs to, ``"hinge"`` or ``"slide"``; of no effect on other parameters.
        mass: Masses become k^mass times as large.
        length: Lengths in the plane become k^length times as large.
        time: Times become k^time times as large.
        thickness: Lengths along the line of sight become k^thickness times as large.

    Returns:
        The p with which the parameter becomes k^p times as large.

    Example:
        >>> from monodyn.mechanism.dimensions import power
        >>> power("damping", length=1, mass=2), power("damping", "slide", length=1, time=0.5)
        (4.0, -0.5)
    """
    of = dimensions(kind, joint)
    return float(of.mass * mass + of.length * length + of.time * time + of.thickness * thickness)
