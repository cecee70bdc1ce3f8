"""Clips whose pictures are not of one instant: followed once more, with the motion in each exposure known.

A clip is located and followed as if its pictures were sharp. Where the edges are as wide as the motion would
blur them, the poses determine how, and scene and poses are found again with outlines that move meanwhile.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from monodyn.arrays import usual_step
from monodyn.checks import camera_choices
from monodyn.errors import SettingsError
from monodyn.settings import RunSettings
from monodyn.stages import track_freely
from monodyn.types import Poses, Progress
from monodyn.vision.clip.video import Video
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.drawing.shutter import way
from monodyn.vision.foreground.given import GivenMasks
from monodyn.vision.locating.again import find_again
from monodyn.vision.locating.locate import Sought
from monodyn.vision.locating.scene import Scene
from monodyn.vision.release import FreeSpan
from monodyn.vision.settings import CameraSettings
from monodyn.vision.tracking.exposure import ROUNDED, SHARP, Exposure, exposure_of, with_shutter

if TYPE_CHECKING:
    from monodyn.mechanism import Mechanism

ROUNDS = 6
"""Times that scene and poses are found again, at most: each time the motion is known better."""
SAME = 0.05
"""Difference of two exposures, as a share, that makes no difference to poses and sizes."""
SAME_PX = 1.0
"""Difference of the ways that the outline goes in an exposure up to which poses and sizes stay [px]."""


class Exposed(NamedTuple):
    """What was found of a clip, with how its pictures were exposed.

    Attributes:
        scene: The scene.
        poses: The poses.
        span: The frames in which the mechanism moves freely.
        settled: False where exposure and motion still changed in the last round.
    """

    scene: Scene
    poses: Poses
    span: FreeSpan
    settled: bool = True


def check_exposure(video: Video, camera: CameraSettings, *, repeats: int = 0) -> None:
    """Refuse an exposure, or a readout, that takes longer than it is from one picture to the next.

    Args:
        video: The clip.
        camera: What was given of the camera.
        repeats: How many pictures may repeat the one before without being known to: the scene's own rate is
            lower then, and each picture may be exposed for longer.

    Raises:
        SettingsError: one of them does.
    """
    new = np.delete(video.times, list(video.repeats.frames))
    if len(new) < 2:
        return
    interval = 1.0 / video.repeats.rate if video.repeats.rate else usual_step(new)
    for name, seconds in (("exposure", camera.exposure or 0.0), ("readout", camera.readout)):
        if abs(seconds) > ROUNDED * (1 + repeats) * interval:
            raise SettingsError(
                f"camera.{name}: expected at most {interval:.4g} s, the time between two pictures of the "
                f"clip, got {seconds:g} s; give it in seconds (5 ms are 0.005), and --rate if the clip has "
                "another rate."
            )


def follow_exposed(
    found: tuple[Scene, Poses, FreeSpan],
    mechanism: Mechanism,
    settings: RunSettings,
    progress: Progress | None = None,
) -> Exposed:
    """Find scene and poses again where the pictures are not of one instant.

    Args:
        found: The scene, the poses, and the frames in which the mechanism moves freely, as found for sharp
            pictures.
        mechanism: The mechanism with the user's choices.
        settings: Those of the run; ``camera.exposure`` and ``camera.readout`` where they are known.
        progress: Called with the frames done by each step.

    Returns:
        The same three, as they are where the pictures are sharp, where the camera moves, whose own blur is
        not known, or where the published method is chosen, which knows no exposure; and whether they settled.
    """
    methods = settings.camera.method, settings.locate.method, settings.track.method
    if "paper" in methods or found[0].video.camera_path is not None:
        return Exposed(*found)
    fix, free = camera_choices(settings)
    given, readout = settings.camera.exposure, settings.camera.readout
    report = progress or (lambda step, done, total: None)
    looked = False
    for done in range(ROUNDS + 1):
        scene, poses, _ = found
        exposure = _estimated(scene, poses) if given is None else Exposure(given)
        if not (exposure.seconds or readout):
            break
        moving = with_shutter(scene, poses, exposure, readout)
        settled = _alike(scene, moving)
        if settled and looked:
            break
        if done == ROUNDS:
            return Exposed(*found, settled=False)
        # A camera that may turn takes up what the edges of an exposure that is not yet known are off. One
        # that is turned, and held square, keeps the exposure from settling.
        looked = looked or settled or done >= ROUNDS // 2
        sought = Sought(scene.masks, mechanism, settings.locate, fix, free, report)
        scene = find_again(sought, moving, poses, looks=looked)
        found = (scene, *track_freely(scene.masks, scene, settings.track, progress=progress))
    return Exposed(*found)


def blurred(found: Exposed, camera: CameraSettings) -> list[str]:
    """Return notes on how the pictures were exposed; nothing where they are of one instant.

    Args:
        found: What was found of the clip.
        camera: What was given of the camera.
    """
    scene, shutter = found.scene, found.scene.shutter
    if shutter is None and scene.video.camera_path is not None and (camera.exposure or camera.readout):
        return [
            "The camera moves: its pictures are taken as of one instant each, and --camera.exposure and "
            "--camera.readout do not count."
        ]
    if shutter is None or not shutter.exposure:
        return []
    share = shutter.exposure / usual_step(found.poses.time)
    if camera.exposure is None:
        begin, known = "Motion blurs the pictures: each is exposed for", f" ± {1000.0 * shutter.std:.2g}"
    else:
        begin, known = "As given with --camera.exposure, each picture is exposed for", ""
    return [
        f"{begin} {1000.0 * shutter.exposure:.3g}{known} ms, {share:.0%} of the time between two frames. "
        "Outlines that move meanwhile are compared with them; the poses are those in the middle of the "
        "exposures."
    ]


def unsettled(found: Exposed) -> str:
    """Return what to doubt where exposure and motion still changed in the last round; empty otherwise.

    Args:
        found: What was found of the clip.
    """
    if found.settled:
        return ""
    return (
        f"Exposure and motion still changed after scene and poses had been found with them {ROUNDS} times: "
        "sizes and poses may be off by more than stated; --camera.exposure SECONDS gives the exposure where "
        "it is known, and shorter exposures or more pictures a second show the motion better."
    )


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
