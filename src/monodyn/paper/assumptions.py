"""What the published method assumes of a film, and whether it holds."""

from __future__ import annotations

from dataclasses import dataclass

from monodyn.types import Poses
from monodyn.vision.locating.scene import Scene


@dataclass(frozen=True)
class Assumption:
    """An assumption of the paper about a clip.

    Attributes:
        name: What is assumed.
        held: True or False; None where it cannot be decided.
        numbers: What decides it.
    """

    name: str
    held: bool | None
    numbers: str


def film_assumptions(scene: Scene, poses: Poses | None) -> tuple[Assumption, ...]:
    """Return whether the film is as the published method takes it to be.

    Args:
        scene: What was found.
        poses: The poses, or None.
    """
    return ()
