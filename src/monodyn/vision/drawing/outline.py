"""From a pose to the outlines of the bodies in the picture: for drawing and for masking out."""

from __future__ import annotations

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.types import Camera
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.drawing.silhouette import hulls, link_frames, outline_counts, project


def outline(mechanism: Mechanism, camera: Camera, position: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Return the outline of every geom of the mechanism.

    Args:
        mechanism: The mechanism.
        camera: The camera, in the same scale.
        position: Joint positions [rad or m], (dof,).

    Returns:
        Name of the body and polygon [px], (point, 2), of each geom; empty when a body is behind the camera.
    """
    rig = rig_of(mechanism, camera)
    geoms = len(rig.radius)
    starts = outline_counts(rig.first, rig.radius)
    px = np.empty((starts[-1], 2))
    frames = link_frames(rig.parent, rig.kind, rig.links, np.array(position, dtype=np.float64))
    if not project(frames, rig.link, rig.first, rig.points, rig.radius, rig.camera, px):
        return []
    hull = np.empty(len(px) + 2 * geoms + 2, dtype=np.int64)
    hull_first = np.zeros(geoms + 1, dtype=np.int64)
    hulls(px, starts, geoms, hull, hull_first)
    bodies = mechanism.shapes.body
    return [(bodies[g], px[hull[hull_first[g] : hull_first[g + 1]]]) for g in range(geoms)]


def covered_pixels(mechanism: Mechanism, camera: Camera, position: np.ndarray, *, grow: float) -> np.ndarray:
    """Return the pixels that the mechanism covers, bool (height, width).

    Args:
        mechanism: The mechanism.
        camera: The camera.
        position: Joint positions, (dof,).
        grow: Margin around the outlines [px].
    """
    import cv2

    picture = np.zeros((camera.height, camera.width), np.uint8)
    for _, polygon in outline(mechanism, camera, position):
        points = np.round(polygon * 16.0).astype(np.int32)
        cv2.fillPoly(picture, [points], 1, cv2.LINE_8, 4)
        cv2.polylines(picture, [points], True, 1, max(1, round(2.0 * grow)), cv2.LINE_8, 4)
    return picture > 0
