"""The published sequential framework (Fig. 2): the four problems in turn until none gains."""

from __future__ import annotations

from dataclasses import dataclass

from monodyn.paper.subproblems import History, fit_depth, fit_place, fit_pose, fit_ratios, followed, mismatch
from monodyn.paper.view import Seen, View


@dataclass(frozen=True)
class Effort:
    """How far the framework goes.

    Attributes:
        rounds: Rounds of all problems at the most.
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
    image: Seen, view: View, effort: Effort | None = None, *, pose: bool = True, ratios: bool = True
) -> tuple[View, tuple[History, ...]]:
    """Solve the four problems in turn until none gains any more (Fig. 2 of the 2012 paper).

    Args:
        image: The seen silhouette.
        view: The start.
        effort: How far to go.
        pose: False holds the pose.
        ratios: False holds the aspect ratios.

    Returns:
        The mechanism as found, the best of all rounds, and the history of every sub-problem in order.

    Source:
        The 2012 paper, Fig. 2 and eq. (1) to (4).
    """
    effort = effort or Effort()
    histories: list[History] = []
    view = followed(image, followed(image, view))
    best, least, near = view, mismatch(image, view.rig, view.position), 1.0
    ratios = ratios and len(view.names) > 0
    for _ in range(effort.rounds):
        view, fell = camera_round(image, view)
        histories += fell
        if pose:
            view, history = fit_pose(image, view, step_px=effort.pose_px * near)
            histories.append(history)
        if ratios:
            view, history = fit_ratios(image, view, step=effort.sizes * near)
            histories.append(history)
        value = mismatch(image, view.rig, view.position)
        gained = least - value
        if value < least:
            best, least = view, value
        if gained < effort.gain * image.area and (near <= 2.0 * effort.least or not (pose and ratios)):
            break
        near = max(effort.shrink * near, effort.least)
    return best, tuple(histories)


def camera_round(image: Seen, view: View) -> tuple[View, list[History]]:
    """Find the camera's depth (1), then its place (2), as far as they are to be estimated.

    Args:
        image: The seen silhouette.
        view: The mechanism as it is so far.
    """
    histories = []
    if view.moves[2]:
        view, history = fit_depth(image, view)
        histories.append(history)
    if any(view.moves[:2]):
        view, history = fit_place(image, view)
        histories.append(history)
    return view, histories
