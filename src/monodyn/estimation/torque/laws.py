"""Laws that auto tries beside friction: drags that grow with the square of a speed, and springs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.types import Poses

QUADRATIC, AIR = "quadratic drag", "air drag"
"""The two laws of drag; on links that hang from the wall they are one."""


def drag_laws(mechanism: Mechanism) -> dict[str, list[str]]:
    """Return the parameters of each law that a mechanism can have.

    Args:
        mechanism: The mechanism.

    Returns:
        Names of the parameters by law; the air's only where a link is carried by another one, and of a link
        that hangs from the wall that of its joint.
    """
    laws = {QUADRATIC: [f"{joint.name}.drag" for joint in mechanism.joints]}
    parents = mechanism.tree.parent.tolist()
    if any(parent >= 0 for parent in parents):
        laws[AIR] = [
            f"{joint.name}.{'drag' if parent < 0 else 'air'}"
            for joint, parent in zip(mechanism.joints, parents, strict=True)
        ]
    return laws


def sprung(mechanism: Mechanism, position: np.ndarray) -> tuple[Mechanism, dict[str, list[str]]]:
    """Return a mechanism with a place for a spring at each joint that has none, and their parameters.

    Args:
        mechanism: The mechanism.
        position: Where springs begin to be slack [rad or m], (dof,).

    Returns:
        A copy in which springs without stiffness are slack there, and names of the parameters by joint;
        nothing for one whose spring the file or the user gave.
    """
    values, laws, rests = mechanism.values, {}, {}
    for joint, slack in zip(mechanism.joints, position.tolist(), strict=True):
        stiffness, rest = f"{joint.name}.stiffness", f"{joint.name}.rest"
        if stiffness in mechanism.chosen or values[stiffness] > 0.0:
            continue
        laws[joint.name] = [stiffness]
        if rest not in mechanism.chosen:
            laws[joint.name].append(rest)
            rests[rest] = _within(mechanism, rest, slack)
    return mechanism.with_values(rests), laws


def slackened(mechanism: Mechanism, records: Sequence[Poses]) -> Mechanism:
    """Return a mechanism whose freed springs begin to be slack in the middle of the motion, and anywhere.

    A search that begins without stiffness has no reason to move where a spring is slack, and from elsewhere
    the stiffness may have to become negative first.

    Args:
        mechanism: The mechanism with the user's choices.
        records: The records.

    Returns:
        A copy; as it is where a file or the user says where a spring is slack, or how stiff it is.
    """
    values, at = mechanism.values, {}
    for i, joint in enumerate(mechanism.joints):
        stiffness, rest = f"{joint.name}.stiffness", f"{joint.name}.rest"
        freed = mechanism.parameter(stiffness).free and values[stiffness] == 0.0
        held = rest in mechanism.chosen and not mechanism.parameter(rest).free
        if freed and not held and values[rest] == 0.0:
            at[rest] = i
    if not at:
        return mechanism
    middle = middles(records)
    slack = {rest: _within(mechanism, rest, float(middle[i])) for rest, i in at.items()}
    return mechanism.with_values(slack).with_choices(free=list(slack))


def _within(mechanism: Mechanism, name: str, value: float) -> float:
    """Return the value within the bounds of a parameter: a hinge may have turned farther than its spring."""
    row = mechanism.row(name)
    return float(np.clip(value, mechanism.lower[row], mechanism.upper[row]))


def middles(records: Sequence[Poses]) -> np.ndarray:
    """Return the mean of the measured positions of each joint [rad or m], zero without any, (dof,).

    Args:
        records: The records.
    """
    position = np.concatenate([np.where(one.measured, one.position, 0.0) for one in records])
    count = np.concatenate([one.measured for one in records]).sum(axis=0)
    return position.sum(axis=0) / np.maximum(count, 1)
