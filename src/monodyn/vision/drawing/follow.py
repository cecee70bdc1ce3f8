"""numba kernel: a pose moved onto the edges of a mask."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.vision.drawing.edges import Agreement, agreement_of, edge_kernel, no_shifts
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.foreground.masks import View


class MoveLimits(NamedTuple):
    """What holds a pose while it is moved.

    Attributes:
        lower: Least joint positions, (dof,).
        upper: Largest joint positions, (dof,).
        std: Standard deviation of the start: holds what the picture does not show, (dof,).
    """

    lower: np.ndarray
    upper: np.ndarray
    std: np.ndarray


class EdgeSearch(NamedTuple):
    """How the edges are looked for.

    Attributes:
        reaches: Search length along the normals in each iteration [px], (iteration,).
        spacing: Distance between outline samples [px].
    """

    reaches: np.ndarray
    spacing: float


def follow(
    planes: np.ndarray, view: View, rig: Rig, start: np.ndarray, limits: MoveLimits, search: EdgeSearch
) -> tuple[np.ndarray, np.ndarray, Agreement]:
    """Move a pose until its outline lies on the edges of the mask.

    Gauss-Newton on the displacements of the edges: each step solves the normal equations of ``edge_terms``,
    with a spring to the start, and is cut off at the limits.

    Args:
        planes: Mask by colour, uint8 (colour, height, width).
        view: How its planes are to be read.
        rig: The mechanism and its camera.
        start: Joint positions to start from, (dof,).
        limits: What holds the pose.
        search: How the edges are looked for.

    Returns:
        Joint positions (dof,); information matrix as in ``edge_terms``, (dof, dof); and how well the
        outline lies on the mask in the end.
    """
    position, information, found = _follow(planes, view, rig, start, limits, search)
    return position, information, agreement_of(found)


@njit(cache=True, nogil=True)
def _follow(
    planes: np.ndarray, view: View, rig: Rig, start: np.ndarray, limits: MoveLimits, search: EdgeSearch
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Do the work of ``follow``; a named tuple would be slow on its way back to Python."""
    shifts = no_shifts(rig)
    position = start.copy()
    # the spring also keeps the equations solvable when a link shows no edge at all
    damping = 1.0 / (limits.std * limits.std) + 1e-9
    # The search lengths shrink: a long one finds the edge from far away, and a short one leaves out the
    # background's structure and other bodies' edges, which a long one takes for the outline's own.
    for reach in search.reaches:
        normal, right, _ = edge_kernel(planes, view, rig, shifts, position, reach, search.spacing)
        for j in range(position.shape[0]):
            normal[j, j] += damping[j]
            right[j] += damping[j] * (start[j] - position[j])
        step = np.linalg.solve(normal, right)
        position = np.minimum(np.maximum(position + step, limits.lower), limits.upper)
    # once more, without the spring: the information is what the picture alone knows of the pose
    normal, _, found = edge_kernel(planes, view, rig, shifts, position, search.reaches[-1], search.spacing)
    return position, normal, found
