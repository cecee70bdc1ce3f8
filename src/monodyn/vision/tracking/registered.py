"""What an error of the registration of a moving camera adds to the covariance of a pose.

It displaces the whole mask of a frame: all edges by the same, which no number of them averages out.
"""

from __future__ import annotations

import numpy as np

from monodyn.types import Mask
from monodyn.vision.drawing.edges import edge_terms, picture_shifts
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.foreground.masks import View

EDGE_PX = 0.3
"""Standard deviation of an edge sample against the move limit of a joint that hardly shows [px]."""


def displaced_pose(
    mask: Mask, view: View, rig: Rig, position: np.ndarray, limit: np.ndarray, search: tuple[float, float]
) -> np.ndarray:
    """Return how a pose follows a displacement of its mask.

    Args:
        mask: The mask.
        view: How its planes are to be read.
        rig: The mechanism before its camera.
        position: Joint positions on the mask, (dof,).
        limit: How far each joint is known without the mask, (dof,).
        search: Search length along the normals and distance between outline samples [px].

    Returns:
        Derivative by the displacement to the right and down [1/px], (dof, 2).
    """
    terms = edge_terms(mask.planes, view, rig, picture_shifts(rig), position, *search)
    dofs = len(position)
    known = terms.normal[:dofs, :dofs] + np.diag(EDGE_PX**2 / limit**2)
    return np.linalg.solve(known, terms.normal[:dofs, dofs:])
