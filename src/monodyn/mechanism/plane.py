"""The plane in which a mechanism moves: x right, y up, z toward the camera along the hinge axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monodyn.errors import MechanismError

PARALLEL = 1e-6
"""Largest sine between axes that count as parallel, or cosine between axes that count as square."""


@dataclass(frozen=True, eq=False)
class Plane:
    """The plane frame in the world frame of the file.

    Attributes:
        axes: Its x, y, z directions as rows, (3, 3).
        gravity: Gravity along -y [m/s^2].
        hinges: True for hinges, bool (dof,).
        signs: +1 or -1 for a hinge whose axis is along z or against it; +1 for slides, int (dof,).
    """

    axes: np.ndarray
    gravity: float
    hinges: np.ndarray
    signs: np.ndarray

    def place(self, point: np.ndarray) -> np.ndarray:
        """Return a point of the world in the plane frame [m], (3,).

        Args:
            point: Point in the world frame [m], (3,).
        """
        return self.axes @ point

    def angle(self, rotation: np.ndarray) -> float | None:
        """Return the turn of a body in the plane [rad], or None if it is also tilted out of it.

        Args:
            rotation: Orientation of the body in the world frame, (3, 3).
        """
        turn = self.axes @ rotation @ self.axes.T
        if turn[2, 2] < 1 - PARALLEL**2:
            return None
        return float(np.arctan2(turn[1, 0], turn[0, 0]))


def find_plane(
    where: str, names: Sequence[str], hinges: np.ndarray, axes: np.ndarray, gravity: np.ndarray
) -> Plane:
    """Find the plane of motion from the joints' axes and gravity.

    Args:
        where: Name of the file, for messages.
        names: Joint names.
        hinges: True for hinges, bool (dof,).
        axes: Unit axes in the world frame, (dof, 3).
        gravity: Gravity in the world frame [m/s^2], (3,).

    Raises:
        MechanismError: The hinge axes are not parallel, or a slide leaves the plane.
    """
    z = axes[np.argmax(hinges)] if hinges.any() else _slide_normal(axes, gravity)
    for name, hinge, axis in zip(names, hinges, axes, strict=True):
        text = _axis_text(axis)
        if hinge and np.linalg.norm(np.cross(axis, z)) > PARALLEL:
            first = names[int(np.argmax(hinges))]
            raise MechanismError(
                f"{where}: joint '{name}': expected a hinge axis parallel to that of '{first}', got {text} "
                "in the world; only planar mechanisms are supported, so make the axes parallel."
            )
        if not hinge and abs(axis @ z) > PARALLEL:
            raise MechanismError(
                f"{where}: joint '{name}': expected a slide in the plane square to {_axis_text(z)}, got "
                f"axis {text} in the world; only planar mechanisms are supported, so turn it into the plane."
            )
    # The part of gravity along the hinges is borne by them: only the rest pulls in the plane.
    up = -gravity + (gravity @ z) * z
    pull = float(np.linalg.norm(up))
    if pull <= PARALLEL * max(1.0, float(np.linalg.norm(gravity))):
        up, pull = _level_up(z), 0.0
    y = up / np.linalg.norm(up)
    frame = np.stack([np.cross(y, z), y, z])
    signs = np.where(hinges & (axes @ z < 0), -1, 1)
    return Plane(frame, pull, hinges, signs)


def _axis_text(axis: np.ndarray) -> str:
    """Return a direction as text."""
    return " ".join(f"{x:.4g}" for x in axis + 0.0)


def _level_up(z: np.ndarray) -> np.ndarray:
    """Return the direction that is up where gravity has no part in the plane: the file's z, else its y."""
    for axis in np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]):
        flat = axis - (axis @ z) * z
        if np.linalg.norm(flat) > 0.5:
            return flat
    raise AssertionError("no axis lies near the plane")


def _slide_normal(axes: np.ndarray, gravity: np.ndarray) -> np.ndarray:
    """Return the normal of the plane of slides alone: square to the slides, or to one and gravity."""
    front = np.array([0.0, -1.0, 0.0])
    others = [*axes[1:], gravity / (np.linalg.norm(gravity) or 1.0), np.array([0.0, 0.0, 1.0])]
    for other in others:
        normal = np.cross(axes[0], other)
        size = float(np.linalg.norm(normal))
        if size > PARALLEL:
            normal = normal / size
            side = float(normal @ front)
            if abs(side) > PARALLEL:
                return normal if side > 0 else -normal
            return normal if normal @ np.cross(axes[0], others[-1]) >= 0 else -normal
    return front
