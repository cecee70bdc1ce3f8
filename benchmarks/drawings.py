"""Pictures for the eye: frames of a clip with the tracked outlines, above the masks they were tracked on."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from clips import Clip
from monodyn.types import Poses
from monodyn.vision.drawing.outline import outline
from monodyn.vision.locating.scene import Scene

SHOWN = 5
"""Frames on a sheet."""
ABOVE = 25
"""Rows above the mechanism's reach that are shown, for the text [px]."""
MOST_WIDTH = 400.0
"""Width of one picture on the sheet, at most [px]."""
SUBPIXEL_BITS = 4
"""Fractional bits of the corners of a drawn outline."""
GREEN, RED = (0, 255, 0), (0, 0, 255)
"""Colours as OpenCV takes them: blue, green, red."""


def draw(clip: Clip, scene: Scene, poses: Poses, errors: np.ndarray, path: Path) -> None:
    """Write a sheet: frames in equal steps and the frame of the largest error, above their masks.

    Args:
        clip: The clip.
        scene: What was located.
        poses: What was tracked.
        errors: Tracked minus true positions, (frame, dof).
        path: The picture file.
    """
    worst = int(np.argmax(np.nan_to_num(np.abs(errors), nan=np.inf).max(axis=1)))
    wanted = [*np.linspace(0, len(poses) - 1, SHOWN - 1).astype(int).tolist(), worst]
    top, bottom, left, right = scene.masks.background.window
    first = max(0, top - ABOVE)
    part = np.s_[first:bottom, left:right]
    scale = min(1.0, MOST_WIDTH / (right - left))
    columns = {}
    for frame in scene.masks.video.frames():
        if frame.index in wanted:
            mask = scene.masks.of(frame).coverage
            pictures = [cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR) for picture in (frame.luma, mask)]
            q = poses.position[frame.index]
            if np.all(np.isfinite(q)):
                for _, polygon in outline(scene.mechanism, scene.camera, q):
                    points = [np.round(polygon * 2**SUBPIXEL_BITS).astype(np.int32)]
                    for picture in pictures:
                        cv2.polylines(picture, points, True, GREEN, 1, cv2.LINE_AA, SUBPIXEL_BITS)
            error = np.round(np.degrees(errors[frame.index]), 1).tolist()
            place = left + 4, first + 18
            cv2.putText(pictures[0], f"{frame.index} {error}", place, cv2.FONT_HERSHEY_SIMPLEX, 0.5, RED, 1)
            columns[frame.index] = np.vstack([picture[part] for picture in pictures])
    sheet = np.hstack([columns[i] for i in wanted])
    cv2.imwrite(str(path), cv2.resize(sheet, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA))
