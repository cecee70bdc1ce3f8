"""Searches for the pose (3) from starts at a known distance: how many of them end in the same pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.paper.locate import PaperScene
from monodyn.paper.silhouettes import ClipSilhouettes
from monodyn.paper.subproblems import fit_pose
from monodyn.paper.view import CAMERA_HELD, ModelView, SilhouetteImage, model_view
from monodyn.reproduce.truth import Truth
from monodyn.reproduce.vision import Seen, hinges_of

DISTANCES = tuple(np.radians([10.0, 30.0, 60.0, 90.0, 180.0]).tolist())
"""Distances of the starts, the largest turn of any hinge [rad]."""
STARTS_EACH = 24
"""Starts at each distance of several hinges; a single one has two, one to either side."""
SAME_POSE = float(np.radians(2.0))
"""A search ends in the same pose when no hinge is off by more than this [rad]."""

FIRST_STEP_PX, LEAST_STEP_PX, SHRINK = 10.0, 1.0, 0.7
"""First step of the first search and of the last ones [px], and the first step of a search by that of
the one before."""
GAIN = 1e-3
"""Searches end when one gains less than this share of the silhouette's area."""


@dataclass(frozen=True)
class PoseStarts:
    """How many searches ended in the same pose.

    Attributes:
        distances: Distances of the starts, the largest turn of any hinge [rad].
        same: Searches that ended in the pose, by distance.
        starts: Searches made at each distance.
    """

    distances: tuple[float, ...]
    same: tuple[int, ...]
    starts: int


def pose_starts(
    seen: Seen, truth: Truth | None, seed: int, distances: Sequence[float] = DISTANCES
) -> PoseStarts | None:
    """Search for the pose behind the found camera from starts in random directions.

    Args:
        seen: What the published method saw.
        truth: The true motion; where it is not known, the found pose is the one to end in.
        seed: Seed of the directions.
        distances: Distances of the starts [rad].

    Returns:
        The numbers; None where there is no such scene, or no hinge.

    Source:
        Eq. (3) and the discussion of "Estimating dynamics on-the-fly using monocular video", 2012.
    """
    scene = seen.scene
    if not isinstance(scene, PaperScene) or not hinges_of(scene.mechanism.joints):
        return None
    hinges = hinges_of(scene.mechanism.joints)
    frame = next(frame for frame in scene.masks.video.frames() if frame.index == scene.frame)
    image = ClipSilhouettes(scene.masks, scene.level).of(frame).image
    goal = scene.position.copy()
    if truth is not None and np.isfinite(truth.position[scene.frame]).all():
        goal[hinges] = truth.position[scene.frame, hinges]
    view = model_view(scene.mechanism, scene.camera, goal, CAMERA_HELD)
    rng, same = np.random.default_rng([seed, 1]), []
    for distance in distances:
        ended = 0
        for direction in directions(rng, len(hinges)):
            start = goal.copy()
            start[hinges] += distance * direction
            found = settled(image, replace(view, position=start))
            turn = (found.position - goal)[hinges]
            # poses that differ by whole turns are the same picture
            ended += bool((np.abs((turn + np.pi) % (2.0 * np.pi) - np.pi) < SAME_POSE).all())
        same.append(ended)
    return PoseStarts(tuple(distances), tuple(same), len(directions(rng, len(hinges))))


def settled(image: SilhouetteImage, view: ModelView) -> ModelView:
    """Return the pose after searches (3) with shorter and shorter first steps, until one gains nothing.

    Args:
        image: The seen silhouette.
        view: The mechanism; its position is the start.
    """
    least, step_px = np.inf, FIRST_STEP_PX
    while True:
        view, history = fit_pose(image, view, step_px=step_px)
        value = float(history.values[-1])
        if step_px <= LEAST_STEP_PX and least - value < GAIN * image.area:
            return view
        least, step_px = min(value, least), max(SHRINK * step_px, LEAST_STEP_PX)


def directions(rng: np.random.Generator, hinges: int) -> list[np.ndarray]:
    """Return distinct directions whose largest turn is one: random ones, both of a single hinge; (dof,).

    Args:
        rng: Where random ones come from.
        hinges: Number of hinges.
    """
    if hinges == 1:
        return [np.array([1.0]), np.array([-1.0])]
    turns = [rng.standard_normal(hinges) for _ in range(STARTS_EACH)]
    return [turn / np.abs(turn).max() for turn in turns]
