"""How joints are shown: symbol, unit, and the factor that a position is multiplied by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from monodyn.mechanism import Joint
from monodyn.numbers import shown_in

SIGNS = {"deg": "°", "mm": " mm"}
"""How a unit is written after a number."""


@dataclass(frozen=True)
class JointUnit:
    """How one joint is shown.

    Attributes:
        name: Name in the mechanism file.
        symbol: Letter and number of the joint in headings.
        unit: ``deg`` for hinges, ``mm`` for slides.
        factor: Units in a radian or a metre.
    """

    name: str
    symbol: str
    unit: str
    factor: float

    @property
    def sign(self) -> str:
        """The unit as it is written after a number."""
        return SIGNS[self.unit]


def units_of(joints: Sequence[Joint]) -> tuple[JointUnit, ...]:
    """Return how each joint is shown.

    Args:
        joints: The joints.
    """
    found = []
    for number, joint in enumerate(joints, start=1):
        factor, unit = shown_in(joint)
        found.append(JointUnit(joint.name, f"{'θ' if unit == 'deg' else 's'}{number}", unit, factor))
    return tuple(found)


def shared_unit(units: Sequence[JointUnit]) -> str:
    """Return the unit of all joints, or nothing where they differ.

    Args:
        units: How each joint is shown.
    """
    kinds = {unit.unit for unit in units}
    return kinds.pop() if len(kinds) == 1 else ""
