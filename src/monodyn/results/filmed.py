"""The clip that a fit comes from, its camera in metres, and the film of the identified mechanism over it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from monodyn.results.folder import RunFolder
from monodyn.results.overlay import DrawnMotion, write_overlay
from monodyn.results.trace import metric
from monodyn.types import Camera, Poses, Progress

if TYPE_CHECKING:
    from monodyn.estimation.fit import Fit
    from monodyn.mechanism import Mechanism
    from monodyn.vision.clip.video import Video
    from monodyn.vision.locating.scene import Scene

LENGTHS = ("camera.x", "camera.y", "camera.depth")
"""Camera parameters that are lengths, and grow with the common scale."""


@dataclass(frozen=True, eq=False)
class Filmed:
    """The clip a fit comes from and its camera, for drawing.

    Attributes:
        video: The clip.
        mechanism: The identified mechanism, or the located one where nothing was identified.
        camera: Camera in the mechanism's scale.
        tracked: Measured joint positions in the mechanism's scale.
        camera_std: Standard deviations of the estimated camera parameters by name, e.g. ``camera.depth``.
    """

    video: Video
    mechanism: Mechanism
    camera: Camera
    tracked: Poses
    camera_std: Mapping[str, float] = field(default_factory=dict)


def filmed_of(fit: Fit, scene: Scene, poses: Poses) -> Filmed:
    """Return clip, mechanism and camera of a scene in metres of the identified scale.

    Args:
        fit: The fit.
        scene: The scene, from ``locate``.
        poses: The tracked clip.
    """
    camera, scale = scene.camera, fit.scale
    camera = replace(camera, x=camera.x * scale, y=camera.y * scale, depth=camera.depth * scale)
    # the fit of free torques holds the common scale, so nothing determines how far away the camera is
    unit = np.inf if fit.torque == "free" else scale
    std = {name: value * (unit if name in LENGTHS else 1.0) for name, value in scene.camera_std.items()}
    # without a fit the located mechanism is drawn, in the scale of its file
    mechanism = fit.mechanism if fit.starts else scene.mechanism
    return Filmed(scene.masks.video, mechanism, camera, metric(poses, mechanism, scale), std)


def write_film(
    folder: RunFolder, fit: Fit, filmed: Filmed, frames: Sequence[int], progress: Progress | None
) -> list[tuple[bytes, str]]:
    """Write ``overlay.mp4``.

    A refused fit is not drawn: its film shows the tracked poses alone.

    Args:
        folder: Where to.
        fit: The fit.
        filmed: Clip and camera.
        frames: First frame of the fit and the one after its last.
        progress: Called with the number of frames drawn.

    Returns:
        The first, middle and last frame as JPEG files, each with a caption.
    """
    from monodyn.results.fill import fill

    # NaN is not drawn
    position = np.full((filmed.video.count, len(fit.mechanism.joints)), np.nan)
    if fit.starts and fit.ok:
        position = fill(fit, filmed.video.times).position
    motion = DrawnMotion(filmed.mechanism, filmed.camera, position, (frames[0], frames[1]), filmed.tracked)
    pictures: list[tuple[bytes, str]] = []
    folder.write(
        "overlay.mp4",
        lambda path: pictures.extend(write_overlay(path, filmed.video, motion, progress=progress)),
    )
    return pictures
