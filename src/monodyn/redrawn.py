"""What is reported, drawn again and compared with what the pictures showed: the last judge of every fit.

Residuals are those of a record, and whatever changes the record changes them. The outlines of the reported
poses, and of the identified motion, have to lie where the mechanism was followed in the pictures.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monodyn.estimation.fit import Doubt, Fit
from monodyn.mechanism import Mechanism
from monodyn.results.filmed import filmed_of
from monodyn.results.trace import trace_of
from monodyn.types import Camera, Poses
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.drawing.silhouette import outline_starts, project
from monodyn.vision.locating.scene import Scene
from monodyn.vision.points.scene import PointScene
from monodyn.vision.points.sticks import sticks

BESIDE = 0.1
"""Distance of an outline from the pictures, over its own size, from which on they contradict it: as far off a
pose counts as wrong."""
STRAY = 0.1
"""Share of the frames that may be farther off: as many poses as a fit may leave out as gross errors."""


class Drawn(NamedTuple):
    """The outlines of one body in some frames.

    Attributes:
        body: Its name.
        points: Points of it in the picture [px], (frame, point, 2); NaN in a frame that cannot be drawn.
    """

    body: str
    points: np.ndarray


def redrawn(fit: Fit, scene: Scene | PointScene, followed: Poses) -> Fit:
    """Return a fit of a clip with what the pictures say against what it reports.

    The frames after the fitted ones judge the motion by its own band (``heldout``), and here the poses.

    Args:
        fit: The fit.
        scene: The mechanism as it was located.
        followed: The poses as they were followed, which lie on the edges of the pictures.
    """
    if not (fit.ok and fit.starts):
        return fit
    filmed, trace = filmed_of(fit, scene, followed), trace_of(fit, followed)
    known = np.asarray(followed.measured.all(axis=1))
    fitted = known.copy()
    fitted[: trace.rows[0]] = False
    fitted[trace.rows[1] :] = False
    for what, rows, position in (
        ("The poses that are reported contradict", known, filmed.tracked.position),
        ("The identified motion contradicts", fitted, trace.states.position),
    ):
        shown = _drawn(scene.mechanism, scene.camera, followed.position[rows])
        drawn = _drawn(filmed.mechanism, filmed.camera, position[rows])
        for before, after in zip(shown, drawn, strict=True):
            away = np.sqrt(np.mean(np.sum((after.points - before.points) ** 2, axis=2), axis=1))
            size = _size(before.points) if isinstance(scene, Scene) else scene.extent_px
            px = float(np.nanquantile(away, 1.0 - STRAY)) if np.isfinite(away).any() else 0.0
            if px > BESIDE * size:
                return fit.doubted([Doubt("refused", _contradicted(what, before.body, px, size))])
    return fit


def _contradicted(what: str, body: str, px: float, size: float) -> str:
    """Return the sentence on an outline that lies beside what the pictures show."""
    return (
        f"{what} the pictures: drawn again, the outline of {body} lies up to {px:.0f} px beside "
        f"where the pictures show it, {px / size:.0%} of its size of {size:.0f} px. Sizes and camera do not "
        "go with this motion: compare overlay.mp4, and give a length or the camera's turns with --fix."
    )


def _drawn(mechanism: Mechanism, camera: Camera, position: np.ndarray) -> list[Drawn]:
    """Return the outline points of each body in some poses, (frame, dof)."""
    if not mechanism.plan.drawn:
        lines = [np.concatenate(sticks(mechanism, camera, row)) for row in position]
        return [Drawn("the mechanism", np.array(lines))] if lines else []
    rig = rig_of(mechanism, camera)
    starts = outline_starts(rig, len(rig.radius))
    points = np.full((len(position), starts[-1], 2), np.nan)
    for row, pose in zip(points, position, strict=True):
        if not project(rig, np.array(pose), row):
            row[:] = np.nan
    bodies = mechanism.shapes.body
    of_point = np.repeat(np.arange(len(bodies)), np.diff(starts))
    names = list(dict.fromkeys(bodies))
    of_body = np.array([names.index(body) for body in bodies])[of_point]
    return [Drawn(name, points[:, of_body == k]) for k, name in enumerate(names)]


def _size(points: np.ndarray) -> float:
    """Return the side of a square as large as the outline of a body, its median over the frames [px]."""
    import cv2

    finite = points[np.isfinite(points).all(axis=(1, 2))].astype(np.float32)
    areas = [cv2.contourArea(cv2.convexHull(corners)) for corners in finite]
    return float(np.sqrt(np.median(areas))) if areas else float("inf")
