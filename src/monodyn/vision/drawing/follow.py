"""numba kernel: a pose moved onto the edges of a mask."""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.vision.drawing.edges import edge_terms


@njit(cache=True)
def follow(
    planes: np.ndarray,
    trust: np.ndarray,
    part: np.ndarray,
    shaded: np.ndarray,
    parent: np.ndarray,
    kind: np.ndarray,
    links: np.ndarray,
    link: np.ndarray,
    first: np.ndarray,
    points: np.ndarray,
    radius: np.ndarray,
    camera: np.ndarray,
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    spread: np.ndarray,
    reaches: np.ndarray,
    spacing: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Move a pose until its outline lies on the edges of the mask (Gauss-Newton).

    Args:
        planes: Mask by colour, uint8 (colour, height, width).
        trust: How well each pixel tells each colour from the background.
        part: Plane of each geom, (geom,).
        shaded: True for geoms whose edges are taken against their own level, bool (geom,).
        parent: Parent of each link.
        kind: Joint kinds.
        links: Link table, (dof, 14).
        link: Link of each geom.
        first: Where each geom's points start.
        points: Points of the geoms [m].
        radius: Radius of the geoms [m].
        camera: From ``camera_array``.
        start: Joint positions to start from, (dof,).
        lower: Lower move limits, (dof,).
        upper: Upper move limits, (dof,).
        spread: Standard deviation of the start: holds what the picture does not show, (dof,).
        reaches: Search length of each iteration [px].
        spacing: Distance between samples [px].

    Returns:
        Joint positions (dof,); information matrix for unit noise of a sample, (dof, dof); and the facts of
        ``edge_terms`` at the end.
    """
    steps = np.empty(0)
    tables, places = links[np.newaxis], points[np.newaxis]
    radii, cameras = radius[np.newaxis], camera[np.newaxis]
    q = start.copy()
    damping = 1.0 / (spread * spread) + 1e-9
    for reach in reaches:
        normal, right, _ = edge_terms(
            planes,
            trust,
            part,
            shaded,
            parent,
            kind,
            link,
            first,
            tables,
            places,
            radii,
            cameras,
            steps,
            q,
            reach,
            spacing,
        )
        for j in range(q.shape[0]):
            normal[j, j] += damping[j]
            right[j] += damping[j] * (start[j] - q[j])
        q = np.minimum(np.maximum(q + np.linalg.solve(normal, right), lower), upper)
    normal, _, facts = edge_terms(
        planes,
        trust,
        part,
        shaded,
        parent,
        kind,
        link,
        first,
        tables,
        places,
        radii,
        cameras,
        steps,
        q,
        reaches[-1],
        spacing,
    )
    return q, normal, facts
