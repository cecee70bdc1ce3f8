"""A camera's roll: joint positions as a picture shows them, and against gravity.

A camera that is turned about its optical axis by the roll r shows every direction turned clockwise by r.
Where a mechanism hangs on one hinge of the world, nothing but the angle of that hinge depends on what is
upright: its position against gravity is that in the picture plus r, counter-clockwise. Where slides or
several joints belong to the world their directions and places in the file show the roll in the picture.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from monodyn.mechanism.tree import HINGE

if TYPE_CHECKING:
    from monodyn.mechanism.model import Mechanism

ROLL = "camera.roll"
"""Name of the parameter."""
ROLL_STD = float(np.radians(3.0))
"""Standard deviation of the roll of a camera of which nothing is known [rad]."""
QUARTERS = (0.5 * np.pi, np.pi, -0.5 * np.pi)
"""Turns of a camera that lies on its side, or stands on its head [rad]."""


def by_roll(mechanism: Mechanism) -> np.ndarray:
    """Return what the roll of the camera adds to joint positions in the picture, to be against gravity.

    Args:
        mechanism: The mechanism.

    Returns:
        Position by roll [rad/rad], (dof,): the sign of the only hinge of the world; zero for all other
        joints, and for all where the world has other joints.
    """
    slope, roots = np.zeros(len(mechanism.joints)), np.flatnonzero(mechanism.tree.parent < 0)
    if len(roots) == 1 and mechanism.tree.kind[roots[0]] == HINGE:
        slope[roots[0]] = mechanism.joints[roots[0]].sign
    return slope


def in_metres(mechanism: Mechanism, scale: float) -> np.ndarray:
    """Return what takes positions in the start scale to metres: the scale for slides, 1 for hinges, (dof,).

    Args:
        mechanism: The mechanism.
        scale: Metres per unit of the start scale.
    """
    return np.array([scale if joint.kind == "slide" else 1.0 for joint in mechanism.joints])


def feels_roll(mechanism: Mechanism) -> bool:
    """Return whether the motion depends on the roll: on gravity's direction, or on where a spring rests.

    Args:
        mechanism: The mechanism.
    """
    root = np.flatnonzero(by_roll(mechanism))
    if not len(root):
        return False
    springs = f"{mechanism.joints[int(root[0])].name}.stiffness"
    acting = (mechanism.parameter(name) for name in ("gravity", springs))
    return any(p.value > 0 or p.free for p in acting)


def with_roll(mechanism: Mechanism, roll: float, *, free: bool, assumed: bool = True) -> Mechanism:
    """Return a copy that knows the roll of the camera that its positions were taken with.

    Args:
        mechanism: The mechanism.
        roll: The roll [rad].
        free: True where an identification may change it.
        assumed: True where it is taken to be near this value, within ``ROLL_STD``.
    """
    row, numbers, frees = mechanism.row(ROLL), mechanism.numbers.copy(), mechanism.free.copy()
    numbers[row], frees[row] = roll, free
    chosen = mechanism.chosen - {ROLL} if assumed else mechanism.chosen | {ROLL}
    return replace(mechanism, numbers=numbers, free=frees, chosen=chosen)
