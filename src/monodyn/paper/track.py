"""The published tracking, eq. (5): frame by frame the pose of least mismatch within move limits.

The limits are a fraction of each joint's range about the last pose; the adaptive variant puts them about the
pose that the joint's current velocity leads to, and narrows them where the joint is slow. A frame whose
mismatch stands out was not seen; the limits widen until the mechanism is found again.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from monodyn.arrays import frozen
from monodyn.errors import VideoError
from monodyn.paper.ambiguity import level_of
from monodyn.paper.locate import PaperScene
from monodyn.paper.settings import PaperTrackSettings
from monodyn.paper.starts import spread_pose
from monodyn.paper.subproblems import fit_pose
from monodyn.paper.threshold import holds, silhouette
from monodyn.paper.view import Seen, View, seen, view_of
from monodyn.types import Frame, Poses, Progress
from monodyn.vision.drawing.rig import longest_reach
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.locating.scene import Scene

AGILE = 0.8
"""Share of the fastest joint's move by which any joint may depart from its prediction."""
SLOWEST = 0.2
"""Least width of the adaptive limits as a share of the fixed ones."""
UNUSUAL, SLACK = 2.0, 0.08
"""A frame is seen while its share of mismatch is below so many usual ones plus a slack."""
GROWTHS = (1.0, 2.0, 4.0)
"""Factors on the move limits, one after the other while a limit holds the pose back."""
WIDENING = 1.6
"""Growth of the move limits for each frame that was not seen."""
COASTING = 3
"""Frames out of sight over which the last velocity counts."""
STEP_PX = 5.0
"""First step of the pose [px]."""


@dataclass(frozen=True, eq=False)
class Motion:
    """What is known of the motion before a frame.

    Attributes:
        time: Time stamp of the last seen frame [s].
        position: Joint positions there, (dof,).
        velocity: Rates there [rad/s or m/s], (dof,); zero while unknown.
        frames: Number of frames seen so far.
        lost: Number of frames since.
        usual: Usual share of mismatch.
    """

    time: float
    position: np.ndarray
    velocity: np.ndarray
    frames: int
    lost: int
    usual: float


@dataclass(frozen=True, eq=False)
class PaperPoses(Poses):
    """Poses that were found by drawing silhouettes.

    Attributes:
        evaluations: Silhouettes drawn to find each frame's pose, int (frame,).
    """

    evaluations: np.ndarray = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        counts = frozen(
            "PaperPoses.evaluations", self.evaluations, (len(self),), dtype=np.int64, error=VideoError
        )
        object.__setattr__(self, "evaluations", counts)


def track_published(
    masks: Masks, scene: Scene, settings: PaperTrackSettings, progress: Progress | None = None
) -> PaperPoses:
    """Follow the mechanism through the clip by eq. (5).

    Args:
        masks: The masks of the clip to follow; background and level are the scene's.
        scene: Camera, sizes and first pose.
        settings: ``move_share`` and ``adaptive``.
        progress: Called with the number of frames done.

    Returns:
        Joint positions with covariance and the silhouettes drawn for each frame. The method itself gives no
        covariance: it is diagonal and constant, from the scatter of the positions about smooth motion.

    Source:
        The 2012 paper, eq. (5).
    """
    video = masks.video
    view = view_of(scene.mechanism, scene.camera, scene.position, (False, False, False))
    level = level_of(scene.masks, scene.level if isinstance(scene, PaperScene) else 0.0)
    motion = None
    blank = np.full(len(scene.mechanism.joints), np.nan)
    rows: list[tuple[int, float, np.ndarray, bool, int]] = []
    for frame in video.frames():
        rows += [(i, float(video.times[i]), blank, False, 0) for i in range(len(rows), frame.index)]
        image = _image(frame, scene, level)
        if image is None:
            motion = motion and replace(motion, lost=motion.lost + 1)
            rows.append((frame.index, frame.time, blank, False, 0))
        else:
            known = scene.position if frame.index == scene.frame else None
            motion, found, drawings = step(image, view, motion, frame.time, settings, known)
            rows.append(
                (frame.index, frame.time, blank if found is None else found, found is not None, drawings)
            )
        if progress is not None:
            progress("track", len(rows), video.count)
    index, time, position, saw, drawings = zip(*rows, strict=True)
    joints = tuple(joint.name for joint in scene.mechanism.joints)
    positions, sighted = np.array(position), np.array(saw)
    covariance = scatter(np.array(time), positions, view.base.kind == 0)
    return PaperPoses(
        joints, np.array(index), np.array(time), positions,
        np.where(sighted[:, np.newaxis, np.newaxis], covariance, np.nan), sighted,
        metric=False, evaluations=np.array(drawings),
    )  # fmt: skip


def step(
    image: Seen,
    view: View,
    motion: Motion | None,
    time: float,
    settings: PaperTrackSettings,
    known: np.ndarray | None,
) -> tuple[Motion | None, np.ndarray | None, int]:
    """Find the pose in the next frame.

    Args:
        image: Its silhouette.
        view: The mechanism before its camera.
        motion: What is known of the motion, or None before the first frame.
        time: Time stamp [s].
        settings: How the mechanism is followed.
        known: Pose in this frame where it is known, (dof,).

    Returns:
        The motion from here, the joint positions (dof,) or None where the mechanism was not seen, and the
        silhouettes drawn.
    """
    if motion is None:
        return _first(image, view, time, settings, known)
    limit = UNUSUAL * motion.usual + SLACK
    found, share, drawings = view, np.inf, 0
    for growth in GROWTHS:
        start, lower, upper = move_limits(view, motion, time, settings, growth=growth)
        found, share, more = _within(image, replace(view, position=start), lower, upper)
        drawings += more
        if not _held_back(found, lower, upper):
            break
    if share > limit:
        _, lower, upper = move_limits(view, motion, time, replace(settings, adaptive=False))
        wide, left, more = spread_pose(image, view, lower=lower, upper=upper)
        drawings += more
        if left / image.area < share:
            found, share = wide, left / image.area
    if share > limit:
        return replace(motion, lost=motion.lost + 1), None, drawings
    apart = time - motion.time
    velocity = (found.position - motion.position) / apart
    usual = motion.usual + 0.1 * (share - motion.usual)
    return Motion(time, found.position, velocity, motion.frames + 1, 0, usual), found.position, drawings


def move_limits(
    view: View, motion: Motion, time: float, settings: PaperTrackSettings, *, growth: float = 1.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return start, lower and upper move limits of eq. (5), (dof,) each.

    Fixed: the last pose, and ``move_share`` of the range about it. Adaptive: the pose that the current
    velocity leads to, and about it the share of those limits that the fastest joint moves, a fifth at least.
    Each frame out of sight widens the limits.

    Args:
        view: The mechanism, for the joints' ranges.
        motion: What is known of the motion.
        time: Time stamp of the frame [s].
        settings: ``move_share`` and ``adaptive``.
        growth: Factor on the limits.

    Source:
        The 2012 paper, eq. (5) and the paragraph after it.
    """
    widest = settings.move_share * joint_ranges(view) * WIDENING**motion.lost
    start, move = motion.position, widest
    if settings.adaptive and motion.frames > 1 and motion.lost <= COASTING:
        ahead = motion.velocity * (time - motion.time)
        start = start + ahead
        if motion.lost == 0:
            fastest = float(np.max(np.abs(ahead) / widest))
            move = widest * np.clip(AGILE * fastest, SLOWEST, 1.0)
    move = move * growth
    lower, upper = np.maximum(start - move, view.limits[0]), np.minimum(start + move, view.limits[1])
    lower, upper = np.minimum(lower, view.limits[1]), np.maximum(upper, view.limits[0])
    return np.clip(start, lower, upper), lower, upper


def _held_back(view: View, lower: np.ndarray, upper: np.ndarray) -> bool:
    """Return whether a move limit, other than a joint's own, holds the pose back."""
    slack = 0.02 * (upper - lower)
    low = (view.position < lower + slack) & (lower > view.limits[0])
    high = (view.position > upper - slack) & (upper < view.limits[1])
    return bool(np.any(low | high))


def joint_ranges(view: View) -> np.ndarray:
    """Return the range of each joint [rad or m], (dof,): one turn or twice the reach where it has no limits.

    Args:
        view: The mechanism.
    """
    limited = np.isfinite(view.limits).all(axis=0)
    whole = np.where(view.base.kind == 0, 2.0 * np.pi, 2.0 * longest_reach(view.rig))
    return np.where(limited, np.minimum(np.diff(view.limits, axis=0)[0], whole), whole)


def scatter(time: np.ndarray, position: np.ndarray, hinge: np.ndarray) -> np.ndarray:
    """Estimate the noise of tracked positions from how they scatter about locally cubic motion.

    Fourth differences of even time steps vanish for cubics; those of noise have 70 times its variance. Their
    median is robust against frames that are off.

    Args:
        time: Time stamps [s], (frame,).
        position: Joint positions, (frame, dof), NaN where not seen.
        hinge: True for hinges, bool (dof,).

    Returns:
        Diagonal covariance, (dof, dof).
    """
    noise = np.where(hinge, 1e-3, 1e-4)
    if len(time) >= 5:
        steps = np.diff(time)
        even = np.ptp(np.lib.stride_tricks.sliding_window_view(steps, 4), axis=1) < 0.2 * np.median(steps)
        fourth = np.abs(np.diff(position, 4, axis=0)[even])
        for dof in range(position.shape[1]):
            usable = fourth[np.isfinite(fourth[:, dof]), dof]
            if len(usable) >= 5:
                noise[dof] = max(float(np.median(usable)) / (0.6745 * np.sqrt(70.0)), 0.05 * noise[dof])
    return np.diag(noise**2)


def _image(frame: Frame, scene: Scene, level: float) -> Seen | None:
    """Return the silhouette of a frame, None where there is none."""
    drawn = silhouette(frame, scene.masks.background, level)
    return seen(drawn) if holds(drawn) else None


def _first(
    image: Seen, view: View, time: float, settings: PaperTrackSettings, known: np.ndarray | None
) -> tuple[Motion | None, np.ndarray | None, int]:
    """Find the first pose: near where it is known, else from starts spread over the joint ranges."""
    if known is None:
        found, left, drawings = spread_pose(image, view)
        share = left / image.area
    else:
        move = settings.move_share * joint_ranges(view)
        lower, upper = np.maximum(known - move, view.limits[0]), np.minimum(known + move, view.limits[1])
        found, share, drawings = _within(image, replace(view, position=known), lower, upper)
    if share > 0.5:
        return None, None, drawings
    return Motion(time, found.position, np.zeros(len(found.position)), 1, 0, share), found.position, drawings


def _within(image: Seen, view: View, lower: np.ndarray, upper: np.ndarray) -> tuple[View, float, int]:
    """Solve eq. (5); return the mechanism in the pose, its share of mismatch and the silhouettes drawn."""
    found, history = fit_pose(image, view, step_px=STEP_PX, lower=lower, upper=upper)
    return found, float(history.values[-1]) / image.area, int(history.evaluations[-1])
