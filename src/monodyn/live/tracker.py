"""The mechanism followed from frame to frame once it was found, each pose with what moves all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monodyn.types import Frame, Poses
from monodyn.vision.locating.scene import Scene
from monodyn.vision.settings import TrackSettings
from monodyn.vision.track import Follower

LED_IN = 8
"""Frames before the first new one that are followed once more, so that their motion is known."""


class Tracker:
    """Follows the mechanism of a scene.

    Args:
        scene: Mechanism and camera.
        settings: How it is followed.
        watched: Frames before the first that will come, in the order of time.
    """

    def __init__(self, scene: Scene, settings: TrackSettings, watched: Sequence[Frame]) -> None:
        self.scene = scene
        self._joints = tuple(joint.name for joint in scene.mechanism.joints)
        # the numbers of frames in the stream are not those of the clip in which the scene was found
        self._follower = Follower(replace(scene, key_frames=(), key_positions=np.zeros((0, 0))), settings)
        for frame in watched[-LED_IN:]:
            self._follower.find(frame)

    def follow(self, frame: Frame, expected: np.ndarray | None = None) -> Poses:
        """Find the pose in the next frame.

        Args:
            frame: The frame.
            expected: Where the dynamics have the joints by now [rad; m in the start scale], (dof,); None
                where they are not known.

        Returns:
            One row; joints that were not seen hold NaN.
        """
        found = self._follower.find(frame, expected)
        position = np.where(found.joints, found.position, np.nan)[None]
        whole, doubt = np.array([bool(found.joints.all())]), self.scene.doubt
        poses = Poses(
            self._joints, np.array([frame.index]), np.array([frame.time]), position,
            found.covariance[None], whole, metric=False, joint_seen=found.joints[None],
            roll=self.scene.camera.roll,
        )  # fmt: skip
        return poses if doubt is None else doubt.with_shifts(poses, self.scene.mechanism.slides)
