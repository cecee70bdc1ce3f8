"""What each method sees in the clip: camera, sizes and the pose in every frame, timed and judged."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from monodyn.errors import MonodynError
from monodyn.mechanism import Mechanism
from monodyn.paper.filter import Filtered, Gains, filtered
from monodyn.paper.track import PaperPoses
from monodyn.reproduce.clip import Truth
from monodyn.stages import locate, track
from monodyn.types import Poses, Progress
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.locating.scene import Scene
from monodyn.vision.settings import CameraSettings, LocateSettings, TrackSettings

BOTH_METHODS = ("paper", "fast")
"""The published method and the default one."""
TITLES = {"paper": "published", "fast": "default"}
"""What they are called on the page."""
CASE_FAILURES = (MonodynError, np.linalg.LinAlgError)
"""What a case may fail with and still stand in the table."""


@dataclass(frozen=True, eq=False)
class Seen:
    """What one method saw.

    Attributes:
        method: One of ``BOTH_METHODS``.
        status: ``done``, or why there are no poses.
        scene: Camera, sizes and first pose, or None.
        poses: Joint positions in every frame, or None.
        seconds_locate: Wall time for camera, sizes and first pose [s], everything compiled.
        seconds_a_frame: Wall time for the pose in a frame, median [s].
        states: The filtered poses, or None.
        errors: Measured less true joint positions [rad], (frame, dof), or None where the truth is not known.
    """

    method: str
    status: str
    scene: Scene | None = None
    poses: Poses | None = None
    seconds_locate: float = 0.0
    seconds_a_frame: float = 0.0
    states: Filtered | None = None
    errors: np.ndarray | None = None

    @property
    def silhouettes(self) -> float | None:
        """Silhouettes drawn for a frame while tracking (median); None where nothing was tracked."""
        if self.poses is None:
            return None
        return float(np.median(self.poses.evaluations)) if isinstance(self.poses, PaperPoses) else 0.0


def see(
    method: str,
    masks: Masks,
    mechanism: Mechanism,
    truth: Truth | None,
    gains: Gains,
    progress: Progress | None = None,
) -> Seen:
    """Locate and track the mechanism with one method and filter its poses.

    Args:
        method: One of ``BOTH_METHODS``.
        masks: The foreground of the clip.
        mechanism: Topology with wrong sizes.
        truth: The true motion, or None where it is not known.
        gains: Gains of the filter.
        progress: Called with the frames done.

    Returns:
        What was seen; a failure stands in its ``status``.
    """
    scene = None
    try:
        _located(method, masks, mechanism, progress)  # loads and compiles; the second one is timed
        began = time.perf_counter()
        scene = _located(method, masks, mechanism, progress)
        located, watch = time.perf_counter(), _Watch(progress)
        poses = track(scene.masks, scene, _track_settings(method), progress=watch)
        states = filtered(poses.time, poses.position, gains, poses.covariance)
    except CASE_FAILURES as error:
        return Seen(method, f"failed: {error}", scene)
    errors = None
    if truth is not None:
        errors = poses.position - aligned(truth.position, poses.position)
    return Seen(method, "done", scene, poses, located - began, watch.median, states, errors)


class _Watch:
    """Passes progress on and keeps when each frame was done; compiling delays only a few of them."""

    def __init__(self, progress: Progress | None) -> None:
        self.progress = progress
        self.times: list[float] = []

    def __call__(self, step: str, done: int, total: int | None) -> None:
        self.times.append(time.perf_counter())
        if self.progress is not None:
            self.progress(step, done, total)

    @property
    def median(self) -> float:
        """Median time between two calls [s]."""
        return float(np.median(np.diff(self.times))) if len(self.times) > 1 else 0.0


def _located(method: str, masks: Masks, mechanism: Mechanism, progress: Progress | None) -> Scene:
    """Locate with one method, camera included."""
    if method == "fast":
        return locate(masks, mechanism, progress=progress)
    both = LocateSettings(method="paper"), CameraSettings(method="paper")
    return locate(masks, mechanism, both[0], camera=both[1], progress=progress)


def _track_settings(method: str) -> TrackSettings:
    return TrackSettings() if method == "fast" else TrackSettings(method="paper")


def aligned(truth: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Turn true hinge angles by whole turns to where the measured ones are.

    Args:
        truth: True joint positions [rad], (frame, dof).
        position: Measured ones, NaN where not seen, (frame, dof).

    Returns:
        The true positions, (frame, dof).
    """
    # a hinge angle is measured up to whole turns; the median is right even where single frames are off
    turns = np.round(np.nanmedian(position - truth, axis=0) / (2.0 * np.pi))
    return truth + 2.0 * np.pi * turns
