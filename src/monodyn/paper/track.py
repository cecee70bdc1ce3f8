"""The published tracking, eq. (5): frame by frame the pose of least mismatch within move limits.

The limits are a fraction of each joint's range about the last pose; the adaptive variant puts them about the
pose that the joint's current velocity leads to, and narrows them where the joint is slow. A frame whose
mismatch stands out was not seen; the limits widen until the mechanism is found again, but never so far that a
hinge could come back a whole turn off; the first frame after a long gap counts only with the next one.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from monodyn.arrays import freeze
from monodyn.errors import VideoError
from monodyn.mechanism.tree import HINGE
from monodyn.paper.locate import PaperScene
from monodyn.paper.settings import PaperTrackSettings
from monodyn.paper.silhouettes import ClipSilhouettes
from monodyn.paper.starts import pose_by_beam
from monodyn.paper.subproblems import fit_pose
from monodyn.paper.view import CAMERA_HELD, ModelView, SilhouetteImage, model_view
from monodyn.types import Poses, Progress
from monodyn.vision.drawing.rig import longest_reach
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.locating.scene import Scene

AGILE = 0.8
"""Share of the fastest joint's move by which any joint may depart from its prediction."""
SLOWEST = 0.2
"""Least width of the adaptive limits as a share of the fixed ones."""
UNUSUAL, MISMATCH_SLACK = 2.0, 0.08
"""A frame counts as seen while its share of mismatch is below this multiple of the usual one plus a slack."""
USUAL_GAIN = 0.1
"""Weight of a new frame in the usual share of mismatch."""
FIRST_MISMATCH = 0.5
"""Share of mismatch above which the mechanism is not in the first frame."""
LIMIT_FACTORS = (1.0, 2.0, 4.0)
"""Factors on the move limits, one after the other while a limit holds the pose back."""
AT_LIMIT = 0.02
"""A pose is held back when it comes as near to a limit as this share of the distance between the two."""
WIDENING = 1.6
"""Growth of the move limits for each frame that was not seen."""
WIDEST_TURN, WIDEST_SLIDE = np.pi, 0.5
"""Most of a move limit to either side: of a hinge [rad], and of a slide as a share of its range. Beyond half
a turn the same pose would lie within the limits twice, and a search could invent a turn."""
MOST_COASTED = 3
"""Frames out of sight over which the last velocity counts; after more of them one frame alone is not
trusted."""
FIRST_STEP_PX = 5.0
"""First step of the pose [px]."""
LEAST_FRAMES = 5
"""Fewest frames that show the scatter of a joint."""
NOISE_HINGE, NOISE_SLIDE = 1e-3, 1e-4
"""Standard deviation of a joint where its scatter is not known [rad, m]."""
LEAST_NOISE = 0.05
"""Least standard deviation from scatter, as a share of that one."""
EVEN = 0.2
"""Time steps are even while they differ by less than this share of the median."""


@dataclass(frozen=True, eq=False)
class MotionState:
    """What is known of the motion before a frame.

    Attributes:
        time: Time stamp of the last seen frame [s].
        position: Joint positions there, (dof,).
        velocity: Rates there [rad/s or m/s], (dof,); zero while unknown.
        frames: Number of frames seen so far.
        lost: Number of frames since.
        usual: Usual share of mismatch.
        unconfirmed: Where the last seen frame ended a long time out of sight, what was known before it; it
            holds again if the next frame is not seen.
    """

    time: float
    position: np.ndarray
    velocity: np.ndarray
    frames: int
    lost: int
    usual: float
    unconfirmed: MotionState | None = None

    def missed(self) -> MotionState:
        """Return what is known after a further frame that was not seen."""
        if self.unconfirmed is None:
            return replace(self, lost=self.lost + 1)
        # what hides the mechanism may leave a piece on which another pose lies: alone among frames that are
        # not seen it would take the hinge angles along to another turn
        return replace(self.unconfirmed, lost=self.unconfirmed.lost + 2)


@dataclass(frozen=True, eq=False, repr=False)
class PaperPoses(Poses):
    """Poses that were found by drawing silhouettes.

    Attributes:
        evaluations: Silhouettes drawn to find each frame's pose, int (frame,).
    """

    evaluations: np.ndarray = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze(self, (len(self),), "evaluations", dtype=np.int64, error=VideoError)

    def _cut(self, rows: slice) -> dict[str, Any]:
        """Return the fields that have rows, cut."""
        return super()._cut(rows) | {"evaluations": self.evaluations[rows]}


@dataclass(frozen=True, eq=False)
class FrameOutcome:
    """Result of following the mechanism into a frame.

    Attributes:
        motion: The motion from here on, or None before the mechanism was seen.
        position: Joint positions, (dof,), or None where the mechanism was not seen.
        drawings: Number of silhouettes drawn.
    """

    motion: MotionState | None
    position: np.ndarray | None
    drawings: int


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
    view = model_view(scene.mechanism, scene.camera, scene.position, CAMERA_HELD)
    silhouettes = ClipSilhouettes(scene.masks, scene.level if isinstance(scene, PaperScene) else 0.0)
    motion, latest = None, 0
    # frames that did not decode keep their row: not seen, nothing drawn
    position = np.full((video.count, len(scene.mechanism.joints)), np.nan)
    drawings = np.zeros(video.count, dtype=np.int64)
    for frame in video.frames():
        shown = silhouettes.find(frame)
        before, found = motion, None
        if shown is None:
            motion = motion and motion.missed()
        else:
            known = scene.position if frame.index == scene.frame else None
            step = next_pose(shown.image, view, motion, frame.time, settings, known)
            motion, found, drawings[frame.index] = step.motion, step.position, step.drawings
        if found is not None:
            position[frame.index], latest = found, frame.index
        elif before is not None and before.unconfirmed is not None:
            position[latest] = np.nan
        if progress is not None:
            progress("track", frame.index + 1, video.count)
    # frames that did not decode at the end of the clip have no row
    stop = frame.index + 1
    joints = tuple(joint.name for joint in scene.mechanism.joints)
    time, position = video.times[:stop], position[:stop]
    sighted = np.asarray(np.isfinite(position).all(axis=1))
    covariance = scatter_covariance(time, position, view.base.kind == HINGE)
    return PaperPoses(
        joints, np.arange(stop), time, position,
        np.where(sighted[:, np.newaxis, np.newaxis], covariance, np.nan), sighted,
        metric=False, evaluations=drawings[:stop],
    )  # fmt: skip


def next_pose(
    image: SilhouetteImage,
    view: ModelView,
    motion: MotionState | None,
    time: float,
    settings: PaperTrackSettings,
    known: np.ndarray | None,
) -> FrameOutcome:
    """Find the pose in the next frame.

    Args:
        image: Its silhouette.
        view: The mechanism before its camera.
        motion: What is known of the motion, or None before the first frame.
        time: Time stamp [s].
        settings: How the mechanism is followed.
        known: Pose in this frame where it is known, (dof,).

    Returns:
        The motion from here, the pose where the mechanism was seen, and the silhouettes drawn.
    """
    if motion is None:
        return _first(image, view, time, settings, known)
    most = UNUSUAL * motion.usual + MISMATCH_SLACK
    found, share, drawings = view, np.inf, 0
    # a pose at a move limit is not a minimum of the mismatch: the limits grow until none is active
    for factor in LIMIT_FACTORS:
        start, limits = move_limits(view, motion, time, settings, factor=factor)
        found, share, more = _within(image, replace(view, position=start), limits)
        drawings += more
        if not _held_back(found, limits):
            break
    if share > most:
        # the local search may have stopped in another minimum within the widest limits, so starts from all
        # over them are tried before the frame is given up
        _, limits = move_limits(view, motion, time, replace(settings, adaptive=False))
        wide, left, more = pose_by_beam(image, view, limits)
        drawings += more
        if left / image.area < share:
            found, share = wide, left / image.area
    if share > most:
        # what hides the mechanism would pull the pose along; the last seen state stays, its limits widen
        return FrameOutcome(motion.missed(), None, drawings)
    apart = time - motion.time
    velocity = (found.position - motion.position) / apart
    usual = motion.usual + USUAL_GAIN * (share - motion.usual)
    unconfirmed = motion if motion.lost > MOST_COASTED else None
    state = MotionState(time, found.position, velocity, motion.frames + 1, 0, usual, unconfirmed)
    return FrameOutcome(state, found.position, drawings)


def move_limits(
    view: ModelView, motion: MotionState, time: float, settings: PaperTrackSettings, *, factor: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return the start (dof,) and lower and upper move limits (2, dof) of eq. (5).

    Fixed: the last pose, and ``move_share`` of the range about it. Adaptive: the pose that the current
    velocity leads to, and about it the share of those limits that the fastest joint moves, at least a fifth.
    Each frame out of sight widens the limits, to half a turn or half of a slide's range at most: of hinge
    angles a whole turn apart the one nearest to where the motion was, or is expected, lies within them.

    Args:
        view: The mechanism, for the joints' ranges.
        motion: What is known of the motion.
        time: Time stamp of the frame [s].
        settings: ``move_share`` and ``adaptive``.
        factor: Factor on the limits.

    Source:
        The 2012 paper, eq. (5) and the paragraph after it.
    """
    widest = settings.move_share * joint_ranges(view) * WIDENING**motion.lost
    start, move = motion.position, widest
    # one frame has no velocity, and after a long time out of sight the last one predicts little
    if settings.adaptive and motion.frames > 1 and motion.lost <= MOST_COASTED:
        ahead = motion.velocity * (time - motion.time)
        start = start + ahead
        if motion.lost == 0:
            # all joints get the share of the fastest one: what one link does, it does to the others too
            fastest = float(np.max(np.abs(ahead) / widest))
            move = widest * np.clip(AGILE * fastest, SLOWEST, 1.0)
    cap = np.where(view.base.kind == HINGE, WIDEST_TURN, WIDEST_SLIDE * joint_ranges(view))
    move = np.minimum(factor * move, cap)
    low, high = view.limits
    lower, upper = np.maximum(start - move, low), np.minimum(start + move, high)
    # a prediction beyond a joint's own limit would leave nothing between the limits: both come to the limit
    limits = np.array([np.minimum(lower, high), np.maximum(upper, low)])
    return np.clip(start, *limits), limits


def _held_back(view: ModelView, limits: np.ndarray) -> bool:
    """Return whether a move limit, other than a joint's own, holds the pose back."""
    lower, upper = limits
    near = AT_LIMIT * (upper - lower)
    low = (view.position < lower + near) & (lower > view.limits[0])
    high = (view.position > upper - near) & (upper < view.limits[1])
    return bool(np.any(low | high))


def joint_ranges(view: ModelView) -> np.ndarray:
    """Return the range of each joint [rad or m], (dof,): one turn or twice the reach where it has no limits.

    Args:
        view: The mechanism.
    """
    limited = np.isfinite(view.limits).all(axis=0)
    whole = np.where(view.base.kind == HINGE, 2.0 * np.pi, 2.0 * longest_reach(view.rig))
    return np.where(limited, np.minimum(np.diff(view.limits, axis=0)[0], whole), whole)


def scatter_covariance(time: np.ndarray, position: np.ndarray, hinge: np.ndarray) -> np.ndarray:
    """Estimate the noise of tracked positions from how they scatter about locally cubic motion.

    Fourth differences of even time steps vanish for cubics; those of white noise have 70 times its variance,
    the sum of the squares of 1, -4, 6, -4, 1. Their median is robust against frames that are off.

    Args:
        time: Time stamps [s], (frame,).
        position: Joint positions, (frame, dof), NaN where not seen.
        hinge: True for hinges, bool (dof,).

    Returns:
        Diagonal covariance, (dof, dof).
    """
    noise = np.where(hinge, NOISE_HINGE, NOISE_SLIDE)
    if len(time) >= LEAST_FRAMES:
        steps = np.diff(time)
        four = np.lib.stride_tricks.sliding_window_view(steps, 4)
        even = np.ptp(four, axis=1) < EVEN * np.median(steps)
        fourth = np.abs(np.diff(position, 4, axis=0)[even])
        for dof in range(position.shape[1]):
            usable = fourth[np.isfinite(fourth[:, dof]), dof]
            if len(usable) >= LEAST_FRAMES:
                # the median of the absolute value of a normal variable is 0.6745 of its standard deviation
                deviation = float(np.median(usable)) / (0.6745 * np.sqrt(70.0))
                noise[dof] = max(deviation, LEAST_NOISE * noise[dof])
    return np.diag(noise**2)


def _first(
    image: SilhouetteImage,
    view: ModelView,
    time: float,
    settings: PaperTrackSettings,
    known: np.ndarray | None,
) -> FrameOutcome:
    """Find the first pose: near where it is known, else from anywhere within the joint ranges."""
    if known is None:
        found, left, drawings = pose_by_beam(image, view)
        share = left / image.area
    else:
        move = settings.move_share * joint_ranges(view)
        low, high = view.limits
        limits = np.array([np.maximum(known - move, low), np.minimum(known + move, high)])
        found, share, drawings = _within(image, replace(view, position=known), limits)
    if share > FIRST_MISMATCH:
        return FrameOutcome(None, None, drawings)
    at_rest = np.zeros(len(found.position))
    return FrameOutcome(MotionState(time, found.position, at_rest, 1, 0, share), found.position, drawings)


def _within(image: SilhouetteImage, view: ModelView, limits: np.ndarray) -> tuple[ModelView, float, int]:
    """Solve eq. (5); return the mechanism in the pose, its share of mismatch and the silhouettes drawn."""
    found, history = fit_pose(image, view, step_px=FIRST_STEP_PX, limits=limits)
    return found, float(history.values[-1]) / image.area, int(history.evaluations[-1])
