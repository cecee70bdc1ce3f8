"""What each method sees in the clip: camera, sizes and the pose in every frame, timed and judged."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from monodyn.arrays import usual_step
from monodyn.errors import MonodynError
from monodyn.mechanism import Joint, Mechanism
from monodyn.paper.assumptions import Assumption, failed, film_assumptions
from monodyn.paper.locate import PaperScene
from monodyn.paper.settings import PaperLocateSettings, PaperTrackSettings
from monodyn.paper.silhouettes import ClipSilhouettes
from monodyn.paper.subproblems import History
from monodyn.paper.track import PaperPoses
from monodyn.reproduce.truth import Truth, errors_of
from monodyn.stages import locate, track
from monodyn.types import Poses, Progress
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.locating.scene import Scene
from monodyn.vision.settings import CameraSettings, TrackSettings

BOTH_METHODS = ("paper", "fast")
"""The published method and the default one."""
TITLES = {"paper": "published", "fast": "default"}
"""What they are called on the page."""
CASE_FAILURES = (MonodynError, np.linalg.LinAlgError)
"""What a case may fail with and still stand in the table."""
Framework = Literal["strict", "interleaved"]


@dataclass(frozen=True, eq=False)
class FrameworkFound:
    """What one form of the framework of Figure 2 found.

    Attributes:
        name: ``strict`` or ``interleaved``.
        status: ``done``, or why there is nothing.
        mismatch: Area of ``|I_a - I_m|`` in the frame of the first pose [px^2], or None.
        area: Area of the silhouette there [px^2], or None.
        drawings: Silhouettes drawn.
        seconds: Wall time [s].
        error: Found less true pose in that frame [rad], NaN for slides, (dof,), or None.
        history: The sub-problems in the order in which they were solved.
    """

    name: str
    status: str
    mismatch: float | None = None
    area: float | None = None
    drawings: int = 0
    seconds: float = 0.0
    error: np.ndarray | None = None
    history: tuple[History, ...] = ()


@dataclass(frozen=True, eq=False)
class Seen:
    """What one method saw.

    Attributes:
        method: One of ``BOTH_METHODS``.
        status: ``done``, or why there are no poses.
        joints: The joints of the mechanism.
        scene: Camera, sizes and first pose, or None.
        poses: Joint positions in every frame, or None.
        seconds_locate: Wall time for camera, sizes and first pose [s].
        seconds_a_frame: Wall time for the pose in a frame, median [s].
        errors: Measured less true joint positions [rad or m], (frame, dof), or None where the truth is
            not known.
        frameworks: Both forms of Figure 2, for the published method.
        film: Whether the film is as the published method takes it to be.
    """

    method: str
    status: str
    joints: tuple[Joint, ...] = ()
    scene: Scene | None = None
    poses: Poses | None = None
    seconds_locate: float = 0.0
    seconds_a_frame: float = 0.0
    errors: np.ndarray | None = None
    frameworks: tuple[FrameworkFound, ...] = ()
    film: tuple[Assumption, ...] = ()

    @property
    def silhouettes(self) -> float | None:
        """Silhouettes drawn for a frame while tracking (median); None where nothing was tracked."""
        if self.poses is None:
            return None
        return float(np.median(self.poses.evaluations)) if isinstance(self.poses, PaperPoses) else 0.0

    @property
    def hinges(self) -> list[int]:
        """The degrees of freedom that are hinges."""
        return hinges_of(self.joints)


def hinges_of(joints: Sequence[Joint]) -> list[int]:
    """Return which degrees of freedom are hinges.

    Args:
        joints: The joints.
    """
    return [dof for dof, joint in enumerate(joints) if joint.kind == "hinge"]


def see(
    method: str,
    masks: Masks,
    mechanism: Mechanism,
    truth: Truth | None,
    progress: Progress | None = None,
    *,
    both_forms: bool = True,
) -> Seen:
    """Locate and track the mechanism with one method.

    Args:
        method: One of ``BOTH_METHODS``.
        masks: The foreground of the clip.
        mechanism: Topology with wrong sizes.
        truth: The true motion, or None where it is not known.
        progress: Called with the frames done.
        both_forms: Locate in both forms of Figure 2 by the published method; poses are those of the strict.

    Returns:
        What was seen; a failure stands in its ``status``.
    """
    scene, joints = None, mechanism.joints
    frameworks: tuple[FrameworkFound, ...] = ()
    began = time.perf_counter()
    try:
        if method == "fast":
            scene = locate(masks, mechanism, progress=progress)
        else:
            scene = _published(masks, mechanism, "strict", progress)
        located, watch = time.perf_counter() - began, _Watch(progress)
        if isinstance(scene, PaperScene) and both_forms:
            frameworks = (
                framework_found("strict", scene, located, truth),
                _interleaved(masks, mechanism, truth, progress),
            )
        settings = TrackSettings() if method == "fast" else PaperTrackSettings(method="paper")
        poses = track(scene.masks, scene, settings, progress=watch)
    except CASE_FAILURES as error:
        film = () if method == "fast" else failed(ClipSilhouettes(masks))
        return Seen(method, f"failed: {error}", joints, scene, frameworks=frameworks, film=film)
    errors = None
    if truth is not None:
        known = truth.position[: len(poses)]
        errors = errors_of(poses.position, known, joints, metric=poses.metric)
    film = film_assumptions(scene, poses) if isinstance(scene, PaperScene) else ()
    return Seen(method, "done", joints, scene, poses, located, watch.median, errors, frameworks, film)


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
        return usual_step(np.array(self.times)) if len(self.times) > 1 else 0.0


def _published(masks: Masks, mechanism: Mechanism, framework: Framework, progress: Progress | None) -> Scene:
    """Locate by one form of the published framework."""
    settings = PaperLocateSettings(method="paper", framework=framework)
    return locate(masks, mechanism, settings, camera=CameraSettings(method="paper"), progress=progress)


def _interleaved(
    masks: Masks, mechanism: Mechanism, truth: Truth | None, progress: Progress | None
) -> FrameworkFound:
    """Locate a second time by our form of the framework, for comparison."""
    began = time.perf_counter()
    try:
        scene = _published(masks, mechanism, "interleaved", progress)
    except CASE_FAILURES as error:
        return FrameworkFound("interleaved", f"failed: {error}")
    return framework_found("interleaved", scene, time.perf_counter() - began, truth)


def framework_found(name: str, scene: Scene, seconds: float, truth: Truth | None) -> FrameworkFound:
    """Return how well one form of the framework explains the frame of the first pose.

    Args:
        name: ``strict`` or ``interleaved``.
        scene: What it found.
        seconds: Wall time [s].
        truth: The true motion, or None.
    """
    assert isinstance(scene, PaperScene)
    frame = next(frame for frame in scene.masks.video.frames() if frame.index == scene.frame)
    area = ClipSilhouettes(scene.masks, scene.level).of(frame).image.area
    error = None
    if truth is not None and scene.frame < len(truth.position):
        row = slice(scene.frame, scene.frame + 1)
        error = errors_of(scene.position[np.newaxis], truth.position[row], scene.mechanism.joints)[0]
        # a picture shows a slide up to its origin: of a single frame nothing is left
        error = np.where([joint.kind == "hinge" for joint in scene.mechanism.joints], error, np.nan)
    return FrameworkFound(
        name,
        "done",
        scene.mismatch_px2,
        float(area),
        scene.evaluations,
        seconds,
        error,
        scene.history,
    )
