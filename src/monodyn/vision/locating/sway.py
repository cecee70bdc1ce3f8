"""Where the edges of key frames show the whole mechanism, against where it was located.

What a pose, sizes and camera explain leaves it in its place: it sways where a joint gives way, the camera
moves, or edges are wrong in some poses.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monodyn.vision.drawing.camera import displaced_camera
from monodyn.vision.drawing.edges import edge_terms, picture_shifts
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.foreground.masks import View

REACHES = (16.0, 12.0, 9.0, 7.0, 5.0, 4.0, 4.0, 4.0)
"""Search lengths along the normals, one after the other [px]."""
SPACING_PX = 3.0
"""Distance between outline samples [px]."""
FAR_PX = 20.0
"""Standard deviation of a displacement before the edges are looked at [px]."""
MOST_MOVE = 0.3
"""Largest change of a joint in one step."""


class Sway(NamedTuple):
    """Where the edges of the key frames show the whole mechanism, against where it was located.

    Attributes:
        shift: To the right and down [px], (key frame, 2).
        information: Of each for unit noise of an edge sample, the pose eliminated, (key frame, 2, 2).
    """

    shift: np.ndarray
    information: np.ndarray

    @property
    def rms_px(self) -> float:
        """Size of the displacements, apart from a common one, by how well the edges show them [px]."""
        known = self.information
        common = np.linalg.lstsq(known.sum(axis=0), np.einsum("kij,kj->i", known, self.shift), rcond=None)[0]
        off = self.shift - common
        squares = np.einsum("ki,kij,kj->", off, known, off)
        return math.sqrt(2.0 * squares / max(float(np.trace(known, axis1=1, axis2=2).sum()), 1e-9))


def sway_of(planes: Sequence[np.ndarray], view: View, rig: Rig, positions: np.ndarray) -> Sway:
    """Measure where the edges show the whole mechanism in some masks, next to its pose.

    Args:
        planes: The masks, each uint8 (plane, height, width).
        view: How their planes are to be read.
        rig: The mechanism before its camera.
        positions: The poses, (frame, dof).

    Returns:
        Displacements against the masks.
    """
    found = [
        _shifted(mask, view, rig, np.array(position, dtype=np.float64))
        for mask, position in zip(planes, positions, strict=True)
    ]
    return Sway(np.array([shift for shift, _ in found]), np.array([known for _, known in found]))


def _shifted(planes: np.ndarray, view: View, rig: Rig, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the displacement of the mechanism in a mask [px], (2,), and its information, (2, 2)."""
    shift, known, dofs = np.zeros(2), np.zeros((2, 2)), len(position)
    for reach in REACHES:
        moved = rig.before(displaced_camera(rig.camera, shift))
        terms = edge_terms(planes, view, moved, picture_shifts(moved), position, reach, SPACING_PX)
        inverse = np.linalg.inv(terms.normal[:dofs, :dofs] + 1e-6 * np.eye(dofs))
        mixed = terms.normal[:dofs, dofs:]
        known = terms.normal[dofs:, dofs:] - mixed.T @ inverse @ mixed
        right = terms.right[dofs:] - mixed.T @ inverse @ terms.right[:dofs]
        # what no edge shows stays where it is
        step = np.linalg.solve(known + np.eye(2) / FAR_PX**2, right - shift / FAR_PX**2)
        move = inverse @ (terms.right[:dofs] - mixed @ step)
        shift, position = shift + step, position + np.clip(move, -MOST_MOVE, MOST_MOVE)
    return shift, known
