"""numba kernel: a pose moved onto the edges of a mask."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.solving import product, solved
from monodyn.uncounted import UNCOUNTED
from monodyn.vision.drawing.edges import (
    LINK_COLUMNS,
    ROBUST,
    Agreement,
    agreement_of,
    drawn_edge_terms,
    edge_room,
    no_shifts,
)
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.drawing.silhouette import draw
from monodyn.vision.foreground.masks import View

SETTLED_PX = 0.005
"""Step with the last search length, rms over the samples, after which no further one is made: each is less
than a tenth of the one before [px]."""
BESIDE_PX = 1.5
"""How far beyond the end of a normal its value depends on the picture [px]."""
EVERYWHERE = np.inf
"""How far around the outline a mask is known of which nothing is left out [px]."""


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
    position, information, found, _ = follow_kernel(planes, view, rig, start, limits, search, EVERYWHERE)
    return position, information, agreement_of(found)


@njit(cache=True, nogil=True)
def follow_kernel(
    planes: np.ndarray,
    view: View,
    rig: Rig,
    start: np.ndarray,
    limits: MoveLimits,
    search: EdgeSearch,
    margin: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
    """Do the work of ``follow`` on a mask of which only a part may be known, for it and for other kernels.

    Args:
        planes: Mask by colour, uint8 (colour, height, width).
        view: How its planes are to be read.
        rig: The mechanism and its camera.
        start: Joint positions to start from, (dof,).
        limits: What holds the pose.
        search: How the edges are looked for.
        margin: How far around the outline of the start the mask is known [px].

    Returns:
        Joint positions (dof,); their information matrix, (dof, dof); what is found on each link, in the
        columns of ``edges``, (dof, column); and whether only the known part of the mask was looked at, where
        the picture is exposed at once: else the rest means nothing.
    """
    shifts, room = no_shifts(rig), edge_room(rig)
    position, dofs = start.copy(), start.shape[0]
    normal, found = np.zeros((dofs, dofs)), np.zeros((dofs, LINK_COLUMNS))
    kept = draw(rig, start, room.outlines)
    begin = room.outlines.px.copy()
    # the spring also keeps the equations solvable when a link shows no edge at all
    damping = 1.0 / (limits.std * limits.std) + 1e-9
    last = search.reaches[-1]
    # The search lengths shrink: a long one finds the edge from far away, and a short one leaves out the
    # background's structure and other bodies' edges, which a long one takes for the outline's own.
    for reach in search.reaches:
        if draw(rig, position, room.outlines):
            kept = kept and _farthest(begin, room.outlines.px) + reach + BESIDE_PX <= margin
            normal, right, found = drawn_edge_terms(
                planes, view, rig, shifts, position, room, reach, search.spacing
            )
        else:
            normal, right, found = np.zeros((dofs, dofs)), np.zeros(dofs), np.zeros((dofs, LINK_COLUMNS))
        held = normal.copy()
        for j in range(dofs):
            held[j, j] += damping[j]
            right[j] += damping[j] * (start[j] - position[j])
        step = solved(held, right)
        position = np.minimum(np.maximum(position + step, limits.lower), limits.upper)
        moved, weight = np.sum(step * product(normal, step)), found[:, ROBUST].sum()
        # a step as small as this leaves the next one nothing, and the picture no other information
        if reach == last and moved < SETTLED_PX * SETTLED_PX * weight:
            return position, normal, found, kept
    # once more, without the spring: the information is what the picture alone knows of the pose
    if draw(rig, position, room.outlines):
        kept = kept and _farthest(begin, room.outlines.px) + last + BESIDE_PX <= margin
        normal, _, found = drawn_edge_terms(planes, view, rig, shifts, position, room, last, search.spacing)
    else:
        normal, found = np.zeros((dofs, dofs)), np.zeros((dofs, LINK_COLUMNS))
    return position, normal, found, kept


@njit(cache=True, **UNCOUNTED)
def _farthest(one: np.ndarray, other: np.ndarray) -> float:
    """Return how far points have moved at most along rows or columns, each (point, 2) [px]."""
    most = 0.0
    for k in range(one.shape[0]):
        most = max(most, abs(one[k, 0] - other[k, 0]), abs(one[k, 1] - other[k, 1]))
    return most
