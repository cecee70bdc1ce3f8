"""What a compiled model may hold: whatever the planar dynamics do not know is refused by name.

MuJoCo has read the file by then, so that defaults, classes and copies are resolved; what must be refused
before it reads anything stands in ``files``.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from monodyn.errors import MechanismError
from monodyn.mechanism.parts import Link
from monodyn.mechanism.tree import LONGEST_LEAD
from monodyn.names import short

WILD = 1e9
"""Largest number [SI] that a mechanism file may hold."""

STATED = (
    ("air", WILD, "the drag of the air on its link"),
    ("lead", LONGEST_LEAD, "how far ahead of the rate its dry friction turns [s]"),
)
"""Kinds of parameter of a joint that MJCF has no attribute for, the largest each may be, and what it is."""

NEAREST = 1e-9
"""Distance of two hinges of a chain above which they turn about different axes [m]."""

RESERVED = ("time", "frame", "seen", "record")
"""Columns of the tables of positions that no joint may be named after."""
ENDINGS = ("_vel", "_std", "_vel_std", "_seen", "_excluded", "_torque")
"""What is put after the name of a joint for its other columns."""

HINGE_TYPE, SLIDE_TYPE = 3, 2
FREE_TYPE = 0
"""MuJoCo's numbers of the joint types."""
MOST_JOINTS, MOST_BODIES, MOST_GEOMS = 30, 200, 400
"""Most of a mechanism: the time of a fit grows with the cube of its joints, of a search with its geoms."""


def refuse_unsupported(model: Any, where: str, joints: Sequence[str], bodies: Sequence[str]) -> None:
    """Raise for whatever the planar dynamics do not know.

    Args:
        model: The compiled model.
        where: Name of the file, for messages.
        joints: Names of the joints.
        bodies: Names of the bodies, the world first.

    Raises:
        MechanismError: There is no joint, or more than can be searched, or a body, option or constraint is
            not supported.
    """
    if model.njnt == 0:
        raise MechanismError(f"{where}: expected at least one joint, got none; add a hinge or a slide.")
    for got, most, what in (
        (model.njnt, MOST_JOINTS, "joints"),
        (model.nbody - 1, MOST_BODIES, "bodies"),
        (model.ngeom, MOST_GEOMS, "geoms"),
    ):
        if got > most:
            raise MechanismError(
                f"{where}: expected at most {most} {what}, got {got}; leave out what does not move."
            )
    for j, name in enumerate(joints):
        _refuse_joint(model, j, f"{where}: joint '{name}'", reserved=name in RESERVED)
    for name, ending in itertools.product(joints, ENDINGS):
        if f"{name}{ending}" in joints:
            raise MechanismError(
                f"{where}: joint '{name}{ending}': expected a name that is not that of a column of joint "
                f"'{name}' in the tables ({', '.join(f'{name}{each}' for each in ENDINGS)}); rename it."
            )
    for b in range(model.nbody):
        if model.body_gravcomp[b]:
            raise MechanismError(
                f"{where}: body '{bodies[b]}': gravity compensation is not supported; remove gravcomp."
            )
    if model.opt.density or model.opt.viscosity:
        raise MechanismError(
            f"{where}: option: forces of a surrounding fluid are not supported; remove density and viscosity."
        )
    # Reading the file has refused active equalities and tendons by their names. An equality that is not
    # active is refused here, because it could be switched on.
    if model.neq or model.ntendon:
        raise MechanismError(
            f"{where}: closed loops and coupled joints are not supported; remove equality and tendon."
        )
    _refuse_wild_numbers(model, where, joints)


def _refuse_joint(model: Any, j: int, shown: str, *, reserved: bool) -> None:
    """Raise for a joint that is no hinge or slide, has other forces than the dynamics know, or a bad name."""
    if reserved:
        raise MechanismError(
            f"{shown}: expected a name other than {', '.join(RESERVED)}, which are columns of the tables of "
            "positions; rename it."
        )
    kind = int(model.jnt_type[j])
    if kind not in (HINGE_TYPE, SLIDE_TYPE):
        got = "free" if kind == FREE_TYPE else "ball"
        raise MechanismError(f"{shown}: expected a hinge or a slide, got a {got} joint; replace it.")
    # MuJoCo's damping is -(b + b1 |v| + b2 v^2) v: b1 is the quadratic drag.
    bent = np.any(model.dof_dampingpoly[int(model.jnt_dofadr[j]), 1:]) or np.any(model.jnt_stiffnesspoly[j])
    if bent or np.any(model.jnt_springyield[j]):
        raise MechanismError(
            f"{shown}: expected linear and quadratic damping and linear stiffness, got higher terms; "
            "give one or two numbers of damping and one of stiffness."
        )


def refuse_one_axis(links: Sequence[Link], where: str) -> None:
    """Raise for two hinges, one on what the other moves, that turn about the same axis.

    Args:
        links: The links, parents first.
        where: Name of the file, for messages.

    Raises:
        MechanismError: There are two such hinges.
    """
    for link in links:
        above = links[link.parent] if link.parent >= 0 else None
        if above is None or link.joint.kind != "hinge" or above.joint.kind != "hinge":
            continue
        if float(np.hypot(*link.anchor)) > NEAREST:
            continue
        body, carrier = short(link.joint.body), short(above.joint.body)
        end = (
            f"give '{body}' a pos, where its hinge is on '{carrier}'; what turns about one axle hangs from "
            "the same body."
            if link.joint.body != above.joint.body
            else "only their sum shows, leave one out."
        )
        raise MechanismError(
            f"{where}: joints '{short(above.joint.name)}', '{short(link.joint.name)}': expected hinges in "
            f"different places, got two that turn about the same axis; {end}"
        )


def stated(model: Any, joint: str, kind: str) -> np.ndarray:
    """Return what a custom numeric ``<joint>.<kind>`` of a file states, for which MJCF has no attribute.

    Args:
        model: The compiled model.
        joint: Name of the joint.
        kind: Kind of the parameter.

    Returns:
        Its numbers, (entry,); one 0 where the file has none.
    """
    for n in range(model.nnumeric):
        numeric = model.numeric(n)
        if numeric.name == f"{joint}.{kind}":
            return np.array(numeric.data, dtype=float)
    return np.zeros(1)


def _refuse_wild_numbers(model: Any, where: str, joints: Sequence[str]) -> None:
    """Raise for numbers that are too large for any mechanism and for the arithmetic."""
    damping = np.column_stack([model.dof_damping, model.dof_dampingpoly])
    groups = {
        "gravity": model.opt.gravity,
        "body positions": model.body_pos,
        "masses and inertias": np.concatenate([model.body_mass, model.body_inertia.ravel()]),
        "geom positions": model.geom_pos,
        "geom sizes": model.geom_size,
        "orientations": np.concatenate([model.body_quat, model.geom_quat]),
        "joint positions": model.jnt_pos,
        "joint references": np.concatenate([model.qpos0, model.qpos_spring]),
        "joint axes": model.jnt_axis,
        "damping, friction, stiffness or armature": np.concatenate(
            [damping.ravel(), model.dof_frictionloss, model.jnt_stiffness, model.dof_armature]
        ),
    }
    for what, numbers in groups.items():
        # written so that NaN, which is not below anything, counts as too large
        wild = ~(np.abs(np.asarray(numbers)) <= WILD)
        if wild.any():
            raise MechanismError(
                f"{where}: {what}: expected numbers up to {WILD:g}, got {np.asarray(numbers)[wild][0]:g}; "
                "correct it."
            )
    for name in joints:
        for kind, most, what in STATED:
            number = stated(model, name, kind)
            if len(number) != 1 or not 0.0 <= number[0] <= most:
                raise MechanismError(
                    f"{where}: custom numeric '{name}.{kind}': expected one number from 0 to {most:g}, "
                    f"{what}, got {' '.join(f'{value:g}' for value in number)}; correct it."
                )
    for name, axis in zip(joints, model.jnt_axis, strict=True):
        if abs(float(axis @ axis) - 1) > 1e-6:
            raise MechanismError(
                f"{where}: joint '{name}': expected an axis with a direction, got one without; correct it."
            )
    if np.any(damping < 0) or np.any(model.jnt_stiffness < 0):
        raise MechanismError(
            f"{where}: joints: expected damping and stiffness not below 0, got a negative one; correct it."
        )
