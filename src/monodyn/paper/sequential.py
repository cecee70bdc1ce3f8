"""The sequential framework (Fig. 2): camera, pose and aspect ratios in turn until nothing gains.

Strict is the paper's: camera and pose alternate until neither moves, then the aspect ratios are searched, and
all of it again. Interleaved is ours: a camera that is placed in closed form follows every trial of pose and
ratios.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from monodyn.mechanism.tree import SLIDE
from monodyn.paper import subproblems
from monodyn.paper.view import CAMERA_HELD, ModelView, SilhouetteImage
from monodyn.vision.drawing.camera import DEPTH, X

SETTLED_PX = 0.03
"""Camera and pose have converged, and so has a round without a gain, where the outline moves by no more [px],
in the root mean square of its points."""
MOST_TURNS = 40
"""Turns of camera and pose at most before the aspect ratios are searched."""
PATIENCE = 5
"""Strict rounds in a row without a gain after which the framework ends."""


@dataclass(frozen=True)
class RoundSchedule:
    """How many rounds the framework goes, and how its first steps shrink.

    Attributes:
        rounds: Rounds of all problems at most.
        pose_px: First step of the pose in the first round [px].
        sizes: First step of a size in the first round, as a share.
        shrink: The first steps of a round as a share of those of the round before.
        least: Least first steps as a share of the first round's.
        gain: A round gains when it lowers the mismatch by this share of the silhouette's area.
    """

    rounds: int = 30
    pose_px: float = 10.0
    sizes: float = 0.1
    shrink: float = 0.7
    least: float = 0.05
    gain: float = 2e-4


Solved = tuple[ModelView, tuple[subproblems.History, ...]]
"""The mechanism as found, the best of all rounds, and the history of every sub-problem in order."""


def strict(image: SilhouetteImage, view: ModelView, schedule: RoundSchedule | None = None) -> Solved:
    """Find camera and pose in turn until they have converged, then the aspect ratios, until nothing gains.

    Every sub-problem holds what the others found: pose (3) and ratios (4) are searched before the camera that
    (1) and (2) have left.

    Args:
        image: The seen silhouette.
        view: The start.
        schedule: How far to go.

    Returns:
        The mechanism as found, the best of all rounds, and the history of every sub-problem in order.

    Source:
        The 2012 paper, Fig. 2, eq. (1) to (4).
    """
    schedule = schedule or RoundSchedule()
    histories: list[subproblems.History] = []
    start = view
    best, least, idle, share = view, np.inf, 0, 1.0
    for _ in range(schedule.rounds):
        before = view
        view, own = camera_and_pose(image, view, schedule, share)
        histories += own
        if len(view.searched):
            found, history = subproblems.fit_ratios(image, _held(view), step=schedule.sizes * share)
            view = _rescaled(replace(found, free=view.free))
            histories.append(history)
        value = subproblems.mismatch(image, view.rig, view.position)
        # equal areas and centroids are not the least mismatch, so a round may end above the one before: the
        # alternation goes on to where it settles, and the best round is kept
        idle = 0 if least - value > schedule.gain * image.area else idle + 1
        if value < least:
            best, least = view, value
        # an outline that hardly moves may still gain, in a narrow valley; and where the model does not fit,
        # the alternation may creep along without end and without a gain
        if (idle and _moved_px(before, view) < SETTLED_PX) or idle == PATIENCE:
            break
        share = max(schedule.shrink * share, schedule.least)
    # equal areas and centroids may cost more than they gain where the start is near the least mismatch
    if subproblems.mismatch(image, start.rig, start.position) < least:
        best = start
    return best, tuple(histories)


def camera_and_pose(
    image: SilhouetteImage, view: ModelView, schedule: RoundSchedule, share: float = 1.0
) -> tuple[ModelView, list[subproblems.History]]:
    """Take the camera (1, 2) and the pose (3) in turn until the mismatch falls no more.

    Args:
        image: The seen silhouette.
        view: The mechanism as found so far.
        schedule: First steps of the pose, and what counts as a gain.
        share: First step of the pose in the first turn, as a share of that of the schedule.

    Returns:
        The mechanism after the best turn, and the history of every sub-problem in order.

    Source:
        The 2012 paper, Fig. 2: the part before the aspect ratios.
    """
    histories: list[subproblems.History] = []
    best, least = view, np.inf
    for _ in range(MOST_TURNS):
        before = view
        view, own = camera_round(image, view)
        found, history = subproblems.fit_pose(image, _held(view), step_px=schedule.pose_px * share)
        view = replace(found, free=view.free)
        histories += [*own, history]
        value = subproblems.mismatch(image, view.rig, view.position)
        # With wrong aspect ratios the equal centroids are those of a camera that is off, the pose gives way
        # to it, and every further turn leads farther off: the least mismatch is where this problem ends.
        gained = least - value
        if value < least:
            best, least = view, value
        # a camera that stays leaves the pose alone: the next turn would repeat this one
        if gained < schedule.gain * image.area or not any(view.free) or _moved_px(before, view) < SETTLED_PX:
            break
        share = max(schedule.shrink * share, schedule.least)
    return best, histories


def interleaved(image: SilhouetteImage, view: ModelView, schedule: RoundSchedule | None = None) -> Solved:
    """Solve the four problems in turn until none gains, the camera following every trial of (3) and (4).

    This is ours and not the paper's: camera and pose need not zigzag, because each trial is judged before the
    camera that gives it the seen area and centroid.

    Args:
        image: The seen silhouette.
        view: The start.
        schedule: How far to go.

    Returns:
        The mechanism as found, the best of all rounds, and the history of every sub-problem in order.

    Source:
        The objectives of the 2012 paper, eq. (1) to (4).
    """
    schedule = schedule or RoundSchedule()
    histories: list[subproblems.History] = []
    # one placement takes two steps from the given camera, which may be far off; the second one settles it
    view = subproblems.camera_placed(image, subproblems.camera_placed(image, view))
    best, least, step_share = view, subproblems.mismatch(image, view.rig, view.position), 1.0
    ratios = len(view.searched) > 0
    for _ in range(schedule.rounds):
        view, history = camera_round(image, view)
        histories += history
        view, own = subproblems.fit_pose(image, view, step_px=schedule.pose_px * step_share)
        histories.append(own)
        if ratios:
            view, own = subproblems.fit_ratios(image, view, step=schedule.sizes * step_share)
            histories.append(own)
        value = subproblems.mismatch(image, view.rig, view.position)
        # a round may end above the best one, because (1) and (2) lower other objectives than the mismatch;
        # the search goes on from there, and the best round is kept
        gained = least - value
        if value < least:
            best, least = view, value
        # long first steps may have missed a near valley, so the framework ends only once they are short;
        # without ratios there is one problem alone, and the next round would repeat this one
        short = step_share <= 2.0 * schedule.least or not ratios
        if gained < schedule.gain * image.area and short:
            break
        step_share = max(schedule.shrink * step_share, schedule.least)
    return best, tuple(histories)


FRAMEWORKS: dict[str, Callable[[SilhouetteImage, ModelView, RoundSchedule | None], Solved]] = {
    "strict": strict,
    "interleaved": interleaved,
}
"""How the four problems are taken in turn, by ``PaperLocateSettings.framework``."""


def camera_round(image: SilhouetteImage, view: ModelView) -> tuple[ModelView, list[subproblems.History]]:
    """Find the camera's depth (1), then its place (2), as far as they are to be estimated.

    Args:
        image: The seen silhouette.
        view: The mechanism as found so far.
    """
    histories = []
    if view.free.depth:
        view, history = subproblems.fit_depth(image, view)
        histories.append(history)
    if view.free.x or view.free.y:
        view, history = subproblems.fit_place(image, view)
        histories.append(history)
    return view, histories


def _held(view: ModelView) -> ModelView:
    """Return the view with its camera as it stands."""
    return replace(view, free=CAMERA_HELD)


def _rescaled(view: ModelView) -> ModelView:
    """Return the view with its reference size at its value again; camera and slides come along.

    Before a camera that is held the picture shows every size. Their common scale goes to the camera's
    distance from the first joint, which leaves the picture as it is but for sizes that a picture does not
    show (thickness).
    """
    if view.reference not in view.searched:
        return view
    factor = view.reference.value / float(view.sizes[view.searched.index(view.reference)])
    camera = view.base.camera.copy()
    camera[X : DEPTH + 1] *= factor
    position = np.where(view.base.kind == SLIDE, factor, 1.0) * view.position
    return replace(view, sizes=factor * view.sizes, position=position).before(camera)


def _moved_px(before: ModelView, after: ModelView) -> float:
    """Return how far the outline moved between two views [px], in the root mean square of its points."""
    moved = subproblems.outline_points(after.rig, after.position) - subproblems.outline_points(
        before.rig, before.position
    )
    return float(np.sqrt(np.mean(np.sum(moved**2, axis=1))))
