"""From a pose to the outlines of the bodies in the picture: for drawing and for masking out."""

from __future__ import annotations

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.types import Camera
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.drawing.silhouette import blank_outlines, draw


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
    outlines = blank_outlines(rig, len(rig.radius))
    if not draw(rig, np.array(position, dtype=np.float64), outlines):
        return []
    corners = np.split(outlines.px[outlines.hull[: outlines.first[-1]]], outlines.first[1:-1])
    return list(zip(mechanism.shapes.body, corners, strict=True))


def covered_pixels(
    mechanism: Mechanism, camera: Camera, position: np.ndarray, *, margin: float
) -> np.ndarray:
    """Return the pixels that the mechanism covers.

    Args:
        mechanism: The mechanism.
        camera: The camera.
        position: Joint positions, (dof,).
        margin: Width of the band around the outlines that counts as covered [px].

    Returns:
        True where covered, bool (height, width).
    """
    import cv2

    picture = np.zeros((camera.height, camera.width), np.uint8)
    for _, polygon in outline(mechanism, camera, position):
        # four bits after the point, which is the ``shift`` below
        points = np.round(polygon * 16.0).astype(np.int32)
        cv2.fillPoly(picture, [points], 1, cv2.LINE_8, 4)
        cv2.polylines(picture, [points], True, 1, max(1, round(2.0 * margin)), cv2.LINE_8, 4)
    return picture > 0
