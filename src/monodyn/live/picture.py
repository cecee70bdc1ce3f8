"""A frame as a picture: the mechanism as it was found, and faintly where it will be and by which way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.live.step import Step
from monodyn.mechanism import Mechanism
from monodyn.results.overlay import FITTED, PREDICTED, TRACKED, Drawing, Ink, draw
from monodyn.results.sight import outlines_of
from monodyn.types import Camera, Frame
from monodyn.vision.points.marks import targets_of
from monodyn.vision.points.shown import Places, Shown, project

WIDEST = 1280
"""Columns of a picture, at most: what is larger is made smaller [px]."""
QUALITY = 80
"""Of the JPEG file, 0 to 100."""
FAINT = 0.55
"""Share of the picture that shines through what is predicted."""
THIN = replace(PREDICTED, width=1.0)
"""How the way of a tip is drawn."""
ON_THE_WAY = 40
"""Points of the way of a tip."""


def jpeg_of(step: Step) -> bytes:
    """Return a frame with the mechanism drawn over it as a JPEG file.

    Args:
        step: What is known at it.
    """
    import cv2

    height, width = step.frame.luma.shape
    picture = cv2.cvtColor(drawn_over(step), cv2.COLOR_YUV2BGR_I420)[:height, :width]
    if width > WIDEST:
        size = (WIDEST, max(round(height * WIDEST / width), 1))
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()


def drawn_over(step: Step) -> np.ndarray:
    """Return a frame with the mechanism drawn over it as stacked planes (I420), sizes made even.

    Args:
        step: What is known at it.

    Returns:
        Luma above the two chroma planes, uint8 (1.5 height, width).
    """
    import cv2

    frame, ghost = step.frame, _ahead(step)
    if ghost:
        plain = draw(frame, Drawing([]))
        faint = cv2.addWeighted(plain, FAINT, draw(frame, Drawing(ghost)), 1.0 - FAINT, 0.0)
        frame = _as_frame(frame, faint)
    return draw(frame, Drawing(_found(step)))


def _found(step: Step) -> list[tuple[np.ndarray, Ink]]:
    """Return the outlines of the pose; white as long as nothing is identified."""
    scene, pose = step.scene, step.pose
    if scene is None or pose is None:
        return []
    ink = FITTED if step.fit is not None and step.fit.ok else TRACKED
    position = np.where(pose.measured[0], pose.position[0], np.nan)
    # a joint that was not seen is where the dynamics have it
    if step.estimate is not None:
        position = np.where(np.isfinite(position), position, step.estimate.expected(step.time))
    return [(polygon, ink) for polygon in outlines_of(scene.mechanism, scene.camera, position)]


def _ahead(step: Step) -> list[tuple[np.ndarray, Ink]]:
    """Return the outlines at the end of the prediction, and the ways of the tips to there."""
    scene, future = step.scene, step.future
    if scene is None or future is None or step.estimate is None or step.verdict == "refused":
        return []
    times = np.linspace(step.time, float(future.time[-1]), ON_THE_WAY)
    positions = np.array([step.estimate.expected(time) for time in times.tolist()])
    ghost = outlines_of(scene.mechanism, scene.camera, positions[-1])
    ways = _ways(scene.mechanism, scene.camera, positions)
    return [*((way, THIN) for way in ways), *((polygon, PREDICTED) for polygon in ghost)]


def _ways(mechanism: Mechanism, camera: Camera, positions: np.ndarray) -> list[np.ndarray]:
    """Return the ways [px] of the far ends of the links that carry no other one, each there and back.

    Args:
        mechanism: The mechanism.
        camera: The camera, in the same scale.
        positions: Joint positions, one after the other, (frame, dof).
    """
    targets, tree = targets_of(mechanism), mechanism.tree
    outer = [dof for dof in range(len(tree.parent)) if dof not in tree.parent]
    tips = [targets[body] for dof in outer if (body := mechanism.joints[dof].body) in targets]
    if not tips or not np.isfinite(positions).all():
        return []
    places = Places(tuple(tips), mechanism, np.zeros(0, dtype=np.int64))
    place, height = places.at(mechanism, np.zeros((0, 2)))
    links = np.array([mark.link for mark in tips])
    shown = Shown(tree.parent, tree.kind, tree.links, links, place, height, camera)
    pixels = project(shown, positions)
    # a line that is closed: there and back again
    ways = [np.concatenate((pixels[:, k], pixels[::-1, k])) for k in range(len(tips))]
    return [way for way in ways if np.all(np.isfinite(way)) and np.abs(way).max() < 1e6]


def _as_frame(frame: Frame, planes: np.ndarray) -> Frame:
    """Return stacked planes as a frame of the same size."""
    height, width = (n + n % 2 for n in frame.luma.shape)
    blue, red = planes[height:].reshape(2, height // 2, width // 2)
    rows, columns = frame.luma.shape
    return replace(frame, luma=planes[:rows, :columns], chroma=(blue, red))
