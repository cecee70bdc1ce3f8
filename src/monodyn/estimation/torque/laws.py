"""Laws that auto tries beside friction: drags that grow with the square of a speed, and springs."""

from __future__ import annotations

import numpy as np

from monodyn.mechanism import Mechanism

QUADRATIC, AIR = "quadratic drag", "air drag"
"""The two laws; on links that hang from the wall they are one."""


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
            rests[rest] = slack
    return mechanism.with_values(rests), laws
