"""The convex hull of points in space, as MuJoCo makes it of a mesh."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np


def hull(points: np.ndarray) -> np.ndarray:
    """Return the triangles of the convex hull.

    Args:
        points: Points that do not lie in a plane, (point, 3).

    Returns:
        The corners of each triangle, as numbers of points, (face, corner).
    """
    mujoco: Any = importlib.import_module("mujoco")
    spec = mujoco.MjSpec()
    # MuJoCo makes the hull, of single precision and of about the size of one, where inertia comes from it
    unit = (points - points.mean(axis=0)) / np.ptp(points, axis=0)
    spec.add_mesh(name="points", uservert=unit.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="points")
    graph = spec.compile().mesh_graph
    # numbers of corners and faces, where the edges of each corner begin, which point it is, the edges
    corners, faces = int(graph[0]), int(graph[1])
    return np.array(graph[2 + 3 * corners + 3 * faces :][: 3 * faces]).reshape(-1, 3)
