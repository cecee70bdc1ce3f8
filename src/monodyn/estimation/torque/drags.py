"""Drags that grow with the square of a speed: at the joints, or of the air on the links."""

from __future__ import annotations

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
