"""The clip that a fit comes from, its camera in metres, and the film of the identified mechanism over it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from monodyn.mechanism.upright import ROLL, by_roll
from monodyn.results.folder import RunFolder
from monodyn.results.overlay import DrawnMotion, DrawnSearch, write_overlay
from monodyn.results.sight import Sight
from monodyn.results.trace import metric
from monodyn.types import Camera, Poses, Progress
from monodyn.vision.drawing.camera import turned
from monodyn.vision.points.scene import PointScene

if TYPE_CHECKING:
    from monodyn.estimation.fit import Fit
    from monodyn.mechanism import Mechanism
    from monodyn.results.fill import States
    from monodyn.vision.clip.steady import CameraPath
    from monodyn.vision.clip.video import Video
    from monodyn.vision.drawing.shutter import Shutter
    from monodyn.vision.locating.scene import Scene

LENGTHS = ("camera.x", "camera.y", "camera.depth")
"""Camera parameters that are lengths, and grow with the common scale."""


@dataclass(frozen=True, eq=False)
class Filmed:
    """The clip a fit comes from and its camera, for drawing.

    Attributes:
        video: The clip.
        mechanism: The identified mechanism as the pictures show it, see ``as_seen``; the located one where
            nothing was identified.
        camera: Camera in the mechanism's scale.
        tracked: Measured joint positions in the mechanism's scale.
        camera_std: Standard deviations of the estimated camera parameters by name, e.g. ``camera.depth``.
        sight: What was seen of the clip, for the diagnosis.
        shutter: How each picture is exposed while the mechanism moves; None for pictures of one instant.
    """

    video: Video
    mechanism: Mechanism
    camera: Camera
    tracked: Poses
    camera_std: Mapping[str, float] = field(default_factory=dict)
    sight: Sight | None = None
    shutter: Shutter | None = None

    @property
    def camera_path(self) -> CameraPath | None:
        """The way of a camera that moves, as the still scene or points that stand still show it."""
        points = None if self.sight is None else self.sight.points
        return self.video.camera_path if points is None else points.camera_path(self.video.count)


def filmed_of(fit: Fit, scene: Scene | PointScene, poses: Poses, sight: Sight | None = None) -> Filmed:
    """Return clip, mechanism and camera of a scene in metres of the identified scale.

    Args:
        fit: The fit.
        scene: The scene, from ``locate``.
        poses: The tracked clip.
        sight: What was seen of the clip so far; None looks anew.
    """
    camera, scale = scene.camera, fit.scale
    camera = replace(camera, x=camera.x * scale, y=camera.y * scale, depth=camera.depth * scale)
    # the fit of free torques holds the common scale, so nothing determines how far away the camera is
    unit = np.inf if fit.torque == "free" else scale
    std = {name: value * (unit if name in LENGTHS else 1.0) for name, value in scene.camera_std.items()}
    if by_roll(fit.mechanism).any():
        # the frame of the mechanism is upright: before it the camera stands turned about the hinge
        camera = turned(camera, fit.mechanism.values[ROLL] - camera.roll)
        std |= {row.name: row.std for row in fit.parameters if row.name == ROLL and row.free}
    # without a fit the located mechanism is drawn, in the scale of its file
    mechanism = as_seen(fit.mechanism, scene.mechanism, scale) if fit.starts else scene.mechanism
    sight = sight or _seen(scene, poses)
    sight.status, sight.grade = fit.status, fit.grade
    shutter = None if isinstance(scene, PointScene) else scene.shutter
    if shutter is not None:
        std["camera.exposure"] = shutter.std
    return Filmed(
        sight.video, mechanism, camera, metric(poses, mechanism, scale, fit.common_of(0)), std, sight, shutter
    )


def _seen(scene: Scene | PointScene, poses: Poses) -> Sight:
    """Return what was seen of the clip of a scene."""
    if isinstance(scene, PointScene):
        return Sight(scene.video, poses=poses, tracks=scene.tracks, points=scene)
    return Sight(scene.masks.video, scene.masks, scene, poses)


def as_seen(identified: Mechanism, located: Mechanism, scale: float) -> Mechanism:
    """Return an identified mechanism with the thicknesses that its outline was located with.

    A thickness along the line of sight stands for a mass in the fit and may be metres, but in the picture it
    moves the near edges of a body: drawn with another one, the outline is not where the camera sees it.

    Args:
        identified: The mechanism of the fit.
        located: The mechanism of the scene, in the start scale.
        scale: Metres per unit of length of the start.

    Returns:
        The mechanism to draw.
    """
    thick = [p for p in located.parameters if p.kind == "thickness" and not p.follows]
    return identified.with_values({p.name: p.value * scale for p in thick})


def write_film(
    folder: RunFolder,
    fit: Fit,
    filmed: Filmed,
    frames: Sequence[int],
    progress: Progress | None,
    motion: States | None = None,
) -> bytes:
    """Write ``overlay.mp4``.

    A refused fit is not drawn: its film shows the tracked poses alone.

    Args:
        folder: Where to.
        fit: The fit.
        filmed: Clip and camera.
        frames: First frame of the fit and the one after its last.
        progress: Called with the number of frames drawn.
        motion: The motion of the record, its gaps filled, which need not be worked out again where the clip
            has no other pictures; None works it out.

    Returns:
        Its middle frame as a JPEG file.
    """
    from monodyn.results.fill import fill
    from monodyn.results.gaps import filled

    # the whole clip is drawn, its repeats too, each picture with the motion of its own time
    video = filmed.video.as_filmed.timed(filmed.tracked.frame, filmed.tracked.time)
    # NaN is not drawn
    position = np.full((video.count, len(fit.mechanism.joints)), np.nan)
    through = position
    if fit.starts and fit.ok:
        position = fill(fit, video.times).position
        if motion is None or not np.array_equal(motion.time, video.times):
            motion = filled(fit, filmed.tracked, video.times)
        # where nothing is known there is nothing to draw
        through = np.where(np.isfinite(motion.std), motion.position, np.nan)
    drawn = DrawnMotion(
        filmed.mechanism,
        filmed.camera,
        position,
        (frames[0], frames[1]),
        filmed.tracked,
        filmed.sight,
        through,
    )
    stills: list[bytes] = []
    folder.write(
        "overlay.mp4",
        lambda path: stills.append(
            write_overlay(path, video, drawn.drawing, begin=float(video.times[0]), progress=progress)
        ),
    )
    return stills[0]


def write_sight_film(folder: RunFolder, sight: Sight, progress: Progress | None = None) -> None:
    """Write ``overlay.mp4`` of a run without a fit: what was tracked, or else the foreground and why.

    Args:
        folder: Where to.
        sight: What the run saw.
        progress: Called with the number of frames drawn.
    """
    if not sight.filmed:
        return
    drawing_of = DrawnSearch(sight).drawing
    scene, poses = sight.scene or sight.points, sight.poses
    if scene is not None and poses is not None and sight.anything_tracked:
        # NaN is not drawn
        nothing = np.full((sight.video.count, len(poses.joints)), np.nan)
        motion = DrawnMotion(scene.mechanism, scene.camera, nothing, (0, sight.video.count), poses, sight)
        drawing_of = motion.drawing

    def film(path: Path) -> None:
        video = sight.video.as_filmed
        write_overlay(path, video, drawing_of, begin=float(video.times[0]), progress=progress)

    folder.write("overlay.mp4", film)
