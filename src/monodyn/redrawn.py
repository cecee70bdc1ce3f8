"""What is reported, drawn again and compared with what the pictures showed: the last judge of every fit.

Residuals are those of a record, and whatever changes the record changes them. The outlines of the reported
poses, and of the identified motion, have to lie where the mechanism was followed in the pictures.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.estimation.fit import Doubt, Fit
from monodyn.mechanism import Mechanism
from monodyn.results.filmed import filmed_of
from monodyn.results.sight import Sight
from monodyn.results.trace import trace_of
from monodyn.types import Camera, Poses
from monodyn.vision.drawing.outline import outline
from monodyn.vision.locating.knowledge import hinge_px
from monodyn.vision.locating.scene import Scene
from monodyn.vision.points.marks import SCENE, Mark, targets_of
from monodyn.vision.points.scene import PointScene
from monodyn.vision.points.shown import Places, project, shown_by

BESIDE = 0.1
"""Distance of a point from the pictures, over the outline's size, from which on they contradict it: a pose as
far off counts as wrong."""
APART = 0.5
"""The same from which they refuse the identified motion: a disc drawn there covers 39 % of what it shows.
Nearer than that it is not trusted: a tenth of a small ball is half a per cent of its way on a long thread."""
STRAY = 0.1
"""Share of the frames that may be farther off: as many poses as a fit may leave out as gross errors."""
BARE = 0.05
"""Reach of the outline over bare background, over its size, from which on it is not trusted: half of what
makes a pose wrong. Outlines that lie right reach 1 to 4 %, the more the worse they stand out."""
BARE_PX = 4.0
"""Reach that says nothing, however small the outline is: edges are looked for as far as that [px]."""
UNSTEADY = 0.05
"""Standard deviation of where the mechanism turns, over the outline's size, from which it is not trusted:
twice that makes a pose wrong. Of 44 drawn links on a firm pivot 41 stay below (not two before a rolling
shutter, and one that wobbles), of 12 whose pivot gives way 2."""
MEASURED = 12
"""Frames, at most, by which the size of the outline is measured: it hardly changes."""


def redrawn(fit: Fit, scene: Scene | PointScene, followed: Poses) -> Fit:
    """Return a fit of a clip with what the pictures say against what it reports.

    The frames after the fitted ones judge the motion by its own band (``heldout``), and here the poses.
    Joints, far ends, sites and balls are compared: how far a hidden end stands out is no part of a pose.

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
    size = _size(scene, followed.position[known])
    marks = [mark for mark in targets_of(scene.mechanism).values() if mark.kind != SCENE]
    shapes = scene.mechanism.shapes
    names = [*(mark.target for mark in marks), *np.array(shapes.body)[np.diff(shapes.first) == 1].tolist()]
    for what, rows, position, most in (
        ("The poses that are reported contradict", known, filmed.tracked.position, BESIDE),
        ("The identified motion contradicts", fitted, trace.states.position, APART),
    ):
        before = _shown(marks, scene.mechanism, scene.camera, followed.position[rows])
        after = _shown(marks, filmed.mechanism, filmed.camera, position[rows])
        inside = np.all((before >= 0.0) & (before < [scene.camera.width, scene.camera.height]), axis=2)
        away = np.where(inside, np.linalg.norm(after - before, axis=2), 0.0)
        px = np.quantile(away, 1.0 - STRAY, axis=0) if len(away) else np.zeros(len(names))
        worst = int(np.argmax(px))
        if px[worst] > BESIDE * size:
            said = _contradicted(what, names[worst], float(px[worst]), size)
            return fit.doubted([Doubt("refused" if px[worst] > most * size else "approximate", said)])
    hinge = 0.0 if not isinstance(scene, Scene) or scene.doubt is None else hinge_px(scene.doubt.bundle)
    if hinge > UNSTEADY * size:
        fit = fit.doubted([Doubt("approximate", _unsteady(scene.mechanism.bodies[0], hinge, size))])
    bare_px = Sight(scene.video, scene.masks, scene, followed).bare_px if isinstance(scene, Scene) else 0.0
    if bare_px > max(BARE * size, BARE_PX):
        return fit.doubted([Doubt("approximate", _beyond(bare_px, size))])
    return fit


def _contradicted(what: str, point: str, px: float, size: float) -> str:
    """Return the sentence on a point that lies beside where the pictures show it."""
    return (
        f"{what} the pictures: drawn again, '{point}' lies up to {px:.0f} px beside where they show it, "
        f"{px / size:.0%} of the outline's size of {size:.0f} px. Sizes and camera do not go with this "
        "motion: compare overlay.mp4, and give a length or the camera's turns with --fix."
    )


def _unsteady(body: str, px: float, size: float) -> str:
    """Return the sentence on a hinge that may be elsewhere."""
    return (
        f"The hinge of '{body}' may be {px:.0f} px farther up or down the body, {px / size:.0%} of the "
        "outline's size: the whole mechanism moves in the picture beside its turns, as where a pivot gives "
        "way, and lengths may be off by more than their intervals say. Fasten the pivot, let it swing "
        f"farther, or give the length with --fix {body}.length."
    )


def _beyond(px: float, size: float) -> str:
    """Return the sentence on an outline that reaches over the background."""
    return (
        f"The pictures show {px:.0f} px of bare background where the outline would be, {px / size:.0%} of "
        f"its size of {size:.0f} px. A joint may give way, by which sizes come out wrong, or something "
        "stands before the mechanism and looks like what is behind it: diagnosis.png shows where; fasten "
        "what gives way, or give a length with --fix."
    )


def _shown(marks: Sequence[Mark], mechanism: Mechanism, camera: Camera, position: np.ndarray) -> np.ndarray:
    """Return where some poses, (frame, dof), have points of the mechanism, and then its balls [px],
    (frame, point, 2)."""
    places = Places(tuple(marks), mechanism, np.zeros(0, dtype=np.int64))
    shown, shapes = shown_by(places, mechanism, camera, np.zeros((0, 2))), mechanism.shapes
    balls = np.diff(shapes.first) == 1
    middle = shapes.points[shapes.first[:-1][balls]]
    link, height = np.append(shown.link, shapes.link[balls]), np.append(shown.height, middle[:, 2])
    place = np.concatenate([shown.place, middle[:, :2]])
    return project(shown._replace(link=link, place=place, height=height), position)


def _size(scene: Scene | PointScene, position: np.ndarray) -> float:
    """Return the diameter of a disc as large as the outlines in the picture, the median of some poses [px].

    Of what only points show it is their extent.
    """
    import cv2

    if not isinstance(scene, Scene):
        return scene.extent_px
    picture, areas = np.array([scene.camera.width, scene.camera.height]), []
    for pose in position[:: max(len(position) // MEASURED, 1)]:
        drawn = [
            np.clip(corners, 0.0, picture) for _, corners in outline(scene.mechanism, scene.camera, pose)
        ]
        areas.append(sum(cv2.contourArea(corners.astype(np.float32)) for corners in drawn))
    return float(np.sqrt(4.0 / np.pi * np.median(areas))) if areas else float("inf")
