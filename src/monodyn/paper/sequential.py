"""The published sequential framework (Fig. 2): the four problems in turn until none gains."""

from __future__ import annotations

from dataclasses import dataclass

from monodyn.paper.subproblems import (
    History,
    camera_placed,
    fit_depth,
    fit_place,
    fit_pose,
    fit_ratios,
    mismatch,
)
from monodyn.paper.view import ModelView, SilhouetteImage


@dataclass(frozen=True)
class RoundSchedule:
    """How many rounds the framework goes, and how its first steps shrink.

    Attributes:
        rounds: Rounds of all problems at most.
        pose_px: First step of the pose in the first round [px].
        sizes: First step of a size in the first round, as a share.
        shrink: The first steps of a round as a share of those of the round before.
        least: Least first steps as a share of the first round's.
        gain: The framework ends when a round gains less than this share of the silhouette's area.
    """

    rounds: int = 30
    pose_px: float = 10.0
    sizes: float = 0.1
    shrink: float = 0.7
    least: float = 0.05
    gain: float = 2e-4


def sequential(
    image: SilhouetteImage, view: ModelView, schedule: RoundSchedule | None = None
) -> tuple[ModelView, tuple[History, ...]]:
    """Solve the four problems in turn until none gains any more (Fig. 2 of the 2012 paper).

    Args:
        image: The seen silhouette.
        view: The start.
        schedule: How far to go.

    Returns:
        The mechanism as found, the best of all rounds, and the history of every sub-problem in order.

    Source:
        The 2012 paper, Fig. 2 and eq. (1) to (4).
    """
    schedule = schedule or RoundSchedule()
    histories: list[History] = []
    # one placement takes two steps from the given camera, which may be far off; the second one settles it
    view = camera_placed(image, camera_placed(image, view))
    best, least, step_share = view, mismatch(image, view.rig, view.position), 1.0
    ratios = len(view.searched) > 0
    for _ in range(schedule.rounds):
        view, history = camera_round(image, view)
        histories += history
        view, own = fit_pose(image, view, step_px=schedule.pose_px * step_share)
        histories.append(own)
        if ratios:
            view, own = fit_ratios(image, view, step=schedule.sizes * step_share)
            histories.append(own)
        value = mismatch(image, view.rig, view.position)
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


def camera_round(image: SilhouetteImage, view: ModelView) -> tuple[ModelView, list[History]]:
    """Find the camera's depth (1), then its place (2), as far as they are to be estimated.

    Args:
        image: The seen silhouette.
        view: The mechanism as found so far.
    """
    histories = []
    if view.free.depth:
        view, history = fit_depth(image, view)
        histories.append(history)
    if view.free.x or view.free.y:
        view, history = fit_place(image, view)
        histories.append(history)
    return view, histories
