"""A mechanism before a camera, as a clip shows it: what ``locate`` hands to ``track``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.types import Camera
from monodyn.vision.clip.video import Video
from monodyn.vision.drawing.rig import Rig, rig_of
from monodyn.vision.drawing.shutter import Shutter
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.locating.doubt import Doubt


@dataclass(frozen=True, eq=False)
class Scene:
    """A mechanism before a camera, as a clip shows it.

    Attributes:
        mechanism: With sizes in the start scale and the picture's information about them (``measured``).
        camera: The camera, in the start scale.
        masks: The clip's masks over the background without the mechanism.
        frame: Number of the frame of the first pose.
        position: Joint positions there [rad; m in the start scale], (dof,).
        key_frames: Numbers of the frames that were refined jointly.
        key_positions: Joint positions there, (key frame, dof).
        camera_std: Standard deviations of the refined camera parameters by name [m, rad, px], the common
            scale held.
        rms_px: Root mean square distance between outline and mask edges [px].
        advice: Sentences for the user.
        thicker: By how much everything is made thicker in the reduced masks in which a pose is looked for
            [reduced px]; None where these are as they come.
        beside: What moves along with each body outside of its outline, as a share of the foreground.
        shutter: How each picture is exposed while the mechanism moves; None for pictures of one instant.
        doubt: What is not known of sizes and camera; None where nothing is said of it.
        twin: A camera on another side that explains the pictures as well, its turns [rad]; None without one.
    """

    mechanism: Mechanism
    camera: Camera
    masks: Masks = field(repr=False)
    frame: int
    position: np.ndarray
    key_frames: tuple[int, ...]
    key_positions: np.ndarray
    camera_std: Mapping[str, float]
    rms_px: float
    advice: tuple[str, ...]
    thicker: float | None = None
    beside: Mapping[str, float] = field(default_factory=dict)
    shutter: Shutter | None = None
    doubt: Doubt | None = field(default=None, repr=False)
    twin: Camera | None = None

    def moving(self, frame: int) -> Rig:
        """Return the mechanism before the camera, as it moves while a picture is exposed.

        Args:
            frame: Number of the picture.
        """
        rig = rig_of(self.mechanism, self.camera)
        return rig if self.shutter is None else self.shutter.of(rig, frame)

    @property
    def video(self) -> Video:
        """The clip."""
        return self.masks.video
