"""The pose in every sample of a clip, by which background and colours are taken once more."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.vision.drawing.edges import Agreement
from monodyn.vision.drawing.follow import EdgeSearch, MoveLimits, follow
from monodyn.vision.drawing.rig import joint_limits, rig_of
from monodyn.vision.locating.advice import LEAST_INSIDE, LEAST_MATCHED
from monodyn.vision.locating.bundle import Bundle
from monodyn.vision.locating.keyframes import KeyFrames
from monodyn.vision.locating.search import left_shares, search_poses

POSE = EdgeSearch(np.array([8.0, 6.0, 5.0, 4.0, 4.0]), 3.0)
"""How edges are looked for in a single frame, for its pose alone [px]."""
STD = 1.0
"""Standard deviation of a joint there [rad or m]."""
SURE = 0.9
"""A pose that was known before is looked for anew where it does not lie on its mask, or less well than this
share of how the refined ones do."""
MORE = 0.1
"""So is one that leaves by this much more of its mask unexplained than the better quarter of them: a link
that is folded over another one lies on the mask, too."""


def poses_everywhere(
    frames: KeyFrames, bundle: Bundle, known: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Find the pose in every frame, and whether it lies on the mask.

    Args:
        frames: The masks of all samples.
        bundle: The refined mechanism before its camera.
        known: The pose of each frame as it was found before the refinement, (key frame, dof); None looks for
            all of them anew.

    Returns:
        Joint positions, (key frame, dof), and True where they lie on the mask, bool (key frame,).
    """
    rig = rig_of(bundle.mechanism, bundle.camera)
    lower, upper = joint_limits(bundle.mechanism)
    limits = MoveLimits(lower, upper, np.full(len(lower), STD))

    def followed(start: tuple[int, np.ndarray]) -> tuple[np.ndarray, Agreement]:
        q, _, found = follow(frames.frames[start[0]].planes, frames.view, rig, start[1], limits, POSE)
        return q, found

    def poses(starts: Iterable[tuple[int, np.ndarray]]) -> list[tuple[np.ndarray, Agreement]]:
        return on_all_cores(followed, starts)

    rows = range(len(frames.frames))
    lost, found = list(rows), {}
    if known is not None:
        found = dict(enumerate(poses(zip(rows, known, strict=True))))
        matched = max(SURE * float(np.median(bundle.matched)), LEAST_MATCHED)
        inside = max(SURE * float(np.median(bundle.inside)), LEAST_INSIDE)
        left = left_shares(frames, bundle.mechanism, bundle.camera, [found[row][0] for row in rows])
        most = float(np.quantile(left, 0.25)) + MORE
        lost = [
            row
            for row, (_, on) in found.items()
            if on.matched <= matched or on.inside <= inside or left[row] > most
        ]
    if lost:
        again = search_poses(frames.only(lost), bundle.mechanism, bundle.camera)
        found |= dict(zip(lost, poses(zip(lost, again.positions, strict=True)), strict=True))
    every = [found[row] for row in rows]
    lies = [on.matched > LEAST_MATCHED and on.inside > LEAST_INSIDE for _, on in every]
    return np.array([q for q, _ in every]), np.array(lies)
