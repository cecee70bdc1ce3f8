"""A mechanism before a camera, as the plain arrays that the kernels of this folder take."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.mechanism import Mechanism
from monodyn.mechanism.parts import PLACE_KINDS
from monodyn.mechanism.tree import ANCHOR_X, ANCHOR_Y, ANGLE, AXIS_X, AXIS_Y, SLIDE
from monodyn.types import Camera
from monodyn.vision.drawing.camera import X, Y, camera_array, shrunk

RING, COARSE_RING = 32, 16
"""Points on the outline of a ball, and in a reduced picture; the second divides the first."""
SIZE_KINDS = ("length", "width", "tail", "tip", "extent")
"""Kinds of the parameters whose sizes a picture shows."""
SHOWN_KINDS = (*SIZE_KINDS, *PLACE_KINDS, "turn", "offset")
"""Kinds of all parameters that a picture shows."""


class Rig(NamedTuple):
    """A mechanism before a camera; the kernels take it whole.

    Attributes:
        parent: Parent of each link, -1 for the world, (dof,).
        kind: Joint kinds, (dof,).
        links: Link table of the mechanism's tree, (dof, column).
        link: Link of each geom, (geom,).
        first: Where each geom's points start, (geom + 1,).
        points: Points of the geoms in their link's frame [m], (point, 3).
        radius: Radius around the points [m], (geom,).
        camera: Packed camera, (entry,).
        ring: Points on the outline of a ball.
        sweep: How far each joint moves while a row of the picture is exposed [rad or m], (dof,).
        skew: How far each joint moves between the exposures of the first row and of the last [rad or m],
            (dof,).
        bend: How much farther than by a steady motion each joint is at the beginning and at the end of a
            row's exposure [rad or m], (dof,).
        lean: The same when the first row and the last are exposed, (dof,).
    """

    parent: np.ndarray
    kind: np.ndarray
    links: np.ndarray
    link: np.ndarray
    first: np.ndarray
    points: np.ndarray
    radius: np.ndarray
    camera: np.ndarray
    ring: int
    sweep: np.ndarray
    skew: np.ndarray
    bend: np.ndarray
    lean: np.ndarray

    def before(self, camera: np.ndarray) -> Rig:
        """Return the mechanism before another packed camera.

        Args:
            camera: From ``camera_array``, (entry,).

        Returns:
            The rig with that camera.
        """
        return self._replace(camera=camera)


@njit(cache=True, inline="always")
def altered(rig: Rig, links: np.ndarray, points: np.ndarray, radius: np.ndarray, camera: np.ndarray) -> Rig:
    """Return a rig of the same topology with other sizes and another camera; for kernels.

    Args:
        rig: The mechanism.
        links: Its link table, (dof, column).
        points: Points of its geoms [m], (point, 3).
        radius: Radius around the points [m], (geom,).
        camera: Packed camera, (entry,).

    Returns:
        The rig, which shares all arrays.
    """
    return Rig(
        parent=rig.parent,
        kind=rig.kind,
        links=links,
        link=rig.link,
        first=rig.first,
        points=points,
        radius=radius,
        camera=camera,
        ring=rig.ring,
        sweep=rig.sweep,
        skew=rig.skew,
        bend=rig.bend,
        lean=rig.lean,
    )


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
    # copies: the mechanism's own arrays are read-only, for which numba would compile every kernel again
    return Rig(
        parent=tree.parent.copy(),
        kind=tree.kind.copy(),
        links=tree.links.copy(),
        link=shapes.link.copy(),
        first=shapes.first.copy(),
        points=shapes.points.copy(),
        radius=shapes.radius.copy(),
        camera=packed,
        ring=RING if shrink == 1.0 else COARSE_RING,
        sweep=np.zeros(len(tree.parent)),
        skew=np.zeros(len(tree.parent)),
        bend=np.zeros(len(tree.parent)),
        lean=np.zeros(len(tree.parent)),
    )


def joint_limits(mechanism: Mechanism) -> tuple[np.ndarray, np.ndarray]:
    """Return the joint limits of a mechanism.

    Args:
        mechanism: The mechanism.

    Returns:
        Lower and upper limits [rad or m], -inf and inf where there are none, each (dof,).
    """
    lower = np.array([joint.lower for joint in mechanism.joints], dtype=np.float64)
    upper = np.array([joint.upper for joint in mechanism.joints], dtype=np.float64)
    return lower, upper


def longest_reach(rig: Rig) -> float:
    """Return the largest distance of any point from the first joint, the mechanism stretched out.

    Args:
        rig: The mechanism; its slides count at zero.

    Returns:
        The distance [m].
    """
    stretch = np.zeros(len(rig.parent))
    for i, parent in enumerate(rig.parent):
        if parent >= 0:
            anchor = float(np.hypot(rig.links[i, ANCHOR_X], rig.links[i, ANCHOR_Y]))
            stretch[i] = stretch[parent] + anchor
    far = 1e-9
    for g, link in enumerate(rig.link):
        points = rig.points[rig.first[g] : rig.first[g + 1], :2]
        far = max(far, stretch[link] + float(np.hypot(*points.T).max()) + float(rig.radius[g]))
    return float(far)


class RootSlide(NamedTuple):
    """A slide of a root, and the camera coordinate that means the same.

    Attributes:
        joint: Its row among the joints.
        column: Column of the packed camera, ``X`` or ``Y``: the one that the slide is closer to.
    """

    joint: int
    column: int


def root_slides(mechanism: Mechanism) -> list[RootSlide]:
    """Find the slides of the root, each with the camera coordinate that means the same.

    Where a root's slide is zero is a matter of choice: moving it by a constant, and the camera along, leaves
    every picture unchanged. One of the two has to be held.

    Args:
        mechanism: The mechanism.

    Returns:
        Each such slide, in the order of the joints.
    """
    slides = []
    for i, parent in enumerate(mechanism.tree.parent):
        if parent < 0 and mechanism.tree.kind[i] == SLIDE:
            link = mechanism.tree.links[i]
            angle = np.arctan2(link[AXIS_Y], link[AXIS_X]) + link[ANGLE]
            slides.append(RootSlide(i, X if abs(np.cos(angle)) >= abs(np.sin(angle)) else Y))
    return slides
