"""Clips whose pictures are not of one instant: followed once more, with the motion in each exposure known.

A clip is located and followed as if its pictures were sharp. Where the edges are as wide as the motion would
blur them, the poses determine how, and scene and poses are found again with outlines that move meanwhile.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monodyn.checks import camera_choices
from monodyn.settings import RunSettings
from monodyn.stages import track_freely
from monodyn.types import Poses, Progress
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.drawing.shutter import way
from monodyn.vision.foreground.given import GivenMasks
from monodyn.vision.locating.again import find_again
from monodyn.vision.locating.locate import Sought
from monodyn.vision.locating.scene import Scene
from monodyn.vision.release import FreeSpan
from monodyn.vision.settings import CameraSettings
from monodyn.vision.tracking.exposure import SHARP, Exposure, exposure_of, with_shutter

if TYPE_CHECKING:
    from monodyn.mechanism import Mechanism

ROUNDS = 4
"""Times that scene and poses are found again, at most: each time the motion is known better."""
SAME = 0.05
"""Difference of two exposures, as a share, that makes no difference to poses and sizes."""
SAME_PX = 1.0
"""Difference of the ways that the outline goes in an exposure up to which poses and sizes stay [px]."""


def follow_exposed(
    found: tuple[Scene, Poses, FreeSpan],
    mechanism: Mechanism,
    settings: RunSettings,
    progress: Progress | None = None,
) -> tuple[Scene, Poses, FreeSpan]:
    """Find scene and poses again where the pictures are not of one instant.

    Args:
        found: The scene, the poses, and the frames in which the mechanism moves freely, as found for sharp
            pictures.
        mechanism: The mechanism with the user's choices.
        settings: Those of the run; ``camera.exposure`` and ``camera.readout`` where they are known.
        progress: Called with the frames done by each step.

    Returns:
        The same three; ``found`` itself where the pictures are sharp, where the camera moves, whose own blur
        is not known, or where the published method is chosen, which knows no exposure.
    """
    methods = settings.camera.method, settings.locate.method, settings.track.method
    if "paper" in methods or found[0].video.camera_path is not None:
        return found
    fix, free = camera_choices(settings)
    given, readout = settings.camera.exposure, settings.camera.readout
    report = progress or (lambda step, done, total: None)
    for _ in range(ROUNDS):
        scene, poses, _ = found
        exposure = _estimated(scene, poses) if given is None else Exposure(given)
        if not (exposure.seconds or readout):
            break
        moving = with_shutter(scene, poses, exposure, readout)
        if _alike(scene, moving):
            break
        sought = Sought(scene.masks, mechanism, settings.locate, fix, free, report)
        scene = find_again(sought, moving, poses)
        found = (scene, *track_freely(scene.masks, scene, settings.track, progress=progress))
    return found


def blurred(scene: Scene, times: np.ndarray, camera: CameraSettings) -> list[str]:
    """Return the note on how the pictures were exposed; nothing where they are of one instant.

    Args:
        scene: The scene.
        times: Time stamps of the frames [s], (frame,).
        camera: What was given of the camera.
    """
    shutter = scene.shutter
    if shutter is None and (camera.exposure or camera.readout):
        return [
            "The camera moves: its pictures are taken as of one instant each, and --camera.exposure and "
            "--camera.readout do not count."
        ]
    if shutter is None or not shutter.exposure:
        return []
    known = f" ± {1000.0 * shutter.std:.2g}" if shutter.std else ""
    share = shutter.exposure / float(np.median(np.diff(times)))
    return [
        f"Motion blurs the pictures: each is exposed for {1000.0 * shutter.exposure:.3g}{known} ms, "
        f"{share:.0%} of the time between two frames. Outlines that move meanwhile are compared with them; "
        "the poses are those in the middle of the exposures."
    ]


def _estimated(scene: Scene, poses: Poses) -> Exposure:
    """Return the exposure of a clip; masks of other tools, mostly cut off at a threshold, show none."""
    return SHARP if isinstance(scene.masks, GivenMasks) else exposure_of(scene, poses)


def _alike(used: Scene, known: Scene) -> bool:
    """Return whether the shutter of one scene leaves the pictures as that of the other does."""
    one, other = used.shutter, known.shutter
    if one is None or other is None or abs(one.exposure - other.exposure) > SAME * other.exposure:
        return False
    rig = rig_of(known.mechanism, known.camera)
    # what is exposed from the first row to the last is the way of both
    apart = other.span * (other.rate - one.rate)
    sweeps = zip(other.position, apart, strict=True)
    return all(way(rig._replace(sweep=sweep), q) <= SAME_PX for q, sweep in sweeps if np.isfinite(q).all())
