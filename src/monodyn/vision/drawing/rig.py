"""A mechanism before a camera, as the plain arrays that the silhouette kernels take."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.types import Camera
from monodyn.vision.drawing.camera import camera_array, shrunk


class Rig(NamedTuple):
    """Arguments that every silhouette kernel shares, in their order.

    Attributes:
        parent: Parent of each link, -1 for the world, (dof,).
        kind: Joint kinds, (dof,).
        links: Link table of the mechanism's tree, (dof, 14).
        link: Link of each geom, (geom,).
        first: Where each geom's points start, (geom + 1,).
        points: Points of the geoms in their link's frame [m], (point, 3).
        radius: Radius around the points [m], (geom,).
        camera: Packed camera, (15,).
    """

    parent: np.ndarray
    kind: np.ndarray
    links: np.ndarray
    link: np.ndarray
    first: np.ndarray
    points: np.ndarray
    radius: np.ndarray
    camera: np.ndarray

    def before(self, camera: np.ndarray) -> Rig:
        """Return the mechanism before another packed camera.

        Args:
            camera: From ``camera_array``, (15,).
        """
        return self._replace(camera=camera)


def rig_of(mechanism: Mechanism, camera: Camera, *, shrink: float = 1.0) -> Rig:
    """Pack a mechanism and a camera for the kernels; geoms come in the order of their links.

    Args:
        mechanism: The mechanism.
        camera: The camera.
        shrink: Pixels of the camera per pixel of the (reduced) picture.

    Returns:
        The packed arrays.
    """
    tree, shapes = mechanism.tree, mechanism.shapes
    packed = shrunk(camera_array(camera), shrink)
    arrays = (tree.parent, tree.kind, tree.links, shapes.link, shapes.first, shapes.points, shapes.radius)
    return Rig._make([*(array.copy() for array in arrays), packed])
