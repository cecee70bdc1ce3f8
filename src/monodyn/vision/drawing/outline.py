"""From a pose to the outlines of the bodies in the picture: for drawing and for masking out."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import numpy as np
from numba import njit

from monodyn.errors import MechanismError
from monodyn.mechanism import Mechanism
from monodyn.types import Camera
from monodyn.vision.drawing import silhouette
from monodyn.vision.drawing.camera import rotation
from monodyn.vision.drawing.rig import Rig, rig_of

NEAR = 0.02
"""Least distance before the camera at which a body is drawn, as a share of the camera's distance."""
BEYOND = 3.0
"""Outlines are cut off so many picture sizes from the middle of the picture."""
STEP, ALIKE = 1e-4, 1e-5
"""Step of a joint by which its motion is measured [rad or m]; difference below which motions are the same."""
_CUBE = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 5)] * 3), axis=-1).reshape(-1, 3)
BALL = _CUBE[np.abs(_CUBE).max(axis=1) == 1.0]
"""Directions in which the surface of a ball is sampled where its tangent cone has no picture, (point, 3)."""


def outline(mechanism: Mechanism, camera: Camera, position: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Return the outline of every geom of the mechanism, as far as the camera sees it.

    Args:
        mechanism: The mechanism.
        camera: The camera, in the same scale.
        position: Joint positions [rad or m], (dof,).

    Returns:
        Name of the body and polygon [px], (point, 2), of each geom that is before the camera.
    """
    rig = _rig(mechanism, camera)
    position = np.array(position, dtype=np.float64)
    drawn, px, first = _corners(rig, position)
    if drawn:
        corners = [px[begin:end] for begin, end in pairwise(first.tolist())]
    elif np.all(np.isfinite(position)):
        corners = [_visible(points, camera) for points in _placed(rig, position)]
    else:
        corners = []
    named = zip(mechanism.shapes.body, corners, strict=bool(corners))
    return [(body, polygon) for body, polygon in named if len(polygon)]


@lru_cache(maxsize=4)
def _rig(mechanism: Mechanism, camera: Camera) -> Rig:
    """Return the rig of a mechanism before a camera: all frames of a film have one or two."""
    return rig_of(mechanism, camera)


@njit(cache=True)
def _corners(rig: Rig, position: np.ndarray) -> tuple[bool, np.ndarray, np.ndarray]:
    """Return whether a pose, (dof,), can be drawn, the corners of all outlines [px], (corner, 2), and where
    those of each geom start, int64 (geom + 1,)."""
    outlines = silhouette.blank_outlines(rig, len(rig.radius))
    drawn = silhouette.draw(rig, position, outlines)
    corners = np.empty((outlines.first[-1] if drawn else 0, 2))
    for i in range(len(corners)):
        corners[i] = outlines.px[outlines.hull[i]]
    return drawn, corners, outlines.first


def _placed(rig: Rig, position: np.ndarray) -> list[np.ndarray]:
    """Return points of the plane frame whose hull is each geom, grown by its radius, each (point, 3)."""
    frames = silhouette.link_frames(rig, position)
    placed = []
    for g, link in enumerate(rig.link):
        c, s = np.cos(frames[link, silhouette.LINK_ANGLE]), np.sin(frames[link, silhouette.LINK_ANGLE])
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        points = rig.points[rig.first[g] : rig.first[g + 1]] @ turn.T
        points = points + np.array([frames[link, silhouette.LINK_X], frames[link, silhouette.LINK_Y], 0.0])
        around = rig.radius[g] * BALL / np.linalg.norm(BALL, axis=1, keepdims=True)
        if rig.radius[g] > 0.0:
            points = (points[:, np.newaxis] + around).reshape(-1, 3)
        placed.append(points)
    return placed


def _visible(points: np.ndarray, camera: Camera) -> np.ndarray:
    """Return the outline of a convex body of which a part may be beside or behind the camera, (point, 2)."""
    import cv2

    seen = (points - [camera.x, camera.y, camera.depth]) @ rotation(camera).T
    near = NEAR * camera.depth
    before, behind = seen[seen[:, 2] >= near], seen[seen[:, 2] < near]
    if not len(before):
        return np.zeros((0, 2))
    # The hull is cut by the plane at ``near``. Its corners there lie on edges of the hull, which are among
    # the lines from each point before the plane to each behind it; the others of these lines end inside.
    share = (near - before[:, np.newaxis, 2]) / (behind[:, 2] - before[:, np.newaxis, 2])
    cut = before[:, np.newaxis] + share[..., np.newaxis] * (behind - before[:, np.newaxis])
    seen = np.concatenate([before, cut.reshape(-1, 3)])
    centre = np.array([(camera.width - 1) / 2.0, (camera.height - 1) / 2.0])
    px = camera.focal * seen[:, :2] / seen[:, 2:]
    far = BEYOND * max(camera.width, camera.height)
    hull = cv2.convexHull(np.clip(px, -1e7, 1e7).astype(np.float32))
    box = np.array([[-far, -far], [far, -far], [far, far], [-far, far]], np.float32)
    _, corners = cv2.intersectConvexConvex(hull, box)
    return np.zeros((0, 2)) if corners is None else corners.reshape(-1, 2).astype(np.float64) + centre


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
    # what is not covered was never written to, and takes no memory: no copy is made of it
    return picture.view(np.bool_)


def check_told_apart(mechanism: Mechanism) -> None:
    """Refuse a mechanism of which several joints move all that can be seen alike, in every pose.

    Args:
        mechanism: The mechanism.

    Raises:
        MechanismError: two joints or more cannot be told apart by any picture.
    """
    rig = rig_of(mechanism, Camera(1000, 1000, 1000.0))
    # a pose like any other; at zero links may lie on one line
    pose = np.random.default_rng(0).uniform(0.2, 1.0, len(mechanism.joints))

    def places(position: np.ndarray) -> np.ndarray:
        return np.concatenate([np.zeros(0), *(points.ravel() for points in _placed(rig, position))])

    steps = STEP * np.eye(len(pose))
    moved = np.array([(places(pose + step) - places(pose - step)) / (2.0 * STEP) for step in steps])
    sizes = np.linalg.norm(moved, axis=1)
    # a joint that moves nothing is one that is hidden: the motion of the others may show it
    shown = np.flatnonzero(sizes > ALIKE * max(sizes.max(initial=0.0), 1e-12))
    if len(shown) < 2:
        return
    left, strength, _ = np.linalg.svd(moved[shown] / sizes[shown, np.newaxis], full_matrices=False)
    if strength[-1] > ALIKE:
        return
    alike = [f"'{mechanism.joints[shown[i]].name}'" for i in np.flatnonzero(np.abs(left[:, -1]) > 0.1)]
    raise MechanismError(
        f"joints {', '.join(alike)}: expected each to move what can be seen in its own way, got some that no "
        "picture tells apart; give the bodies between them a geom, or leave joints out."
    )
