"""Pictures for the eye: frames of a clip with the tracked outlines, above the masks they were tracked on."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from clips import Clip
from monodyn.types import Poses
from monodyn.vision.drawing.outline import outline
from monodyn.vision.locating.scene import Scene

COLUMNS = 5


def draw(clip: Clip, scene: Scene, poses: Poses, errors: np.ndarray, path: Path) -> None:
    """Write a sheet: frames in equal steps and the frame of the largest error, above their masks.

    Args:
        clip: The clip.
        scene: What was located.
        poses: What was tracked.
        errors: Tracked minus true positions, (frame, dof).
        path: The picture file.
    """
    worst = int(np.argmax(np.nan_to_num(np.abs(errors), nan=9.0).max(axis=1)))
    wanted = [*np.linspace(0, len(poses) - 1, COLUMNS - 1).astype(int).tolist(), worst]
    top, bottom, left, right = scene.masks.background.window
    part = np.s_[max(0, top - 25) : bottom, left:right]
    scale = min(1.0, 400.0 / (right - left))
    columns = {}
    for frame in scene.masks.video.frames():
        if frame.index in wanted:
            mask = scene.masks.of(frame).coverage
            pictures = [cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR) for picture in (frame.luma, mask)]
            q = poses.position[frame.index]
            if np.all(np.isfinite(q)):
                for _, polygon in outline(scene.mechanism, scene.camera, q):
                    points = [np.round(polygon * 16).astype(np.int32)]
                    for picture in pictures:
                        cv2.polylines(picture, points, True, (0, 255, 0), 1, cv2.LINE_AA, 4)
            error = np.round(np.degrees(errors[frame.index]), 1).tolist()
            cv2.putText(
                pictures[0],
                f"{frame.index} {error}",
                (left + 4, max(0, top - 25) + 18),
                0,
                0.5,
                (0, 0, 255),
                1,
            )
            columns[frame.index] = np.vstack([picture[part] for picture in pictures])
    sheet = np.hstack([columns[i] for i in wanted])
    cv2.imwrite(str(path), cv2.resize(sheet, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA))
