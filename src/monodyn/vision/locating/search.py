"""From key frames and the topology alone to a rough camera, sizes and poses: the global search.

Places of the root come from what the masks have in common (``roots``). From each of them structures grow link
by link, with lengths of a grid and widths of the foreground (``grow``). Sizes and poses of the best ones are
improved in turn.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.errors import VideoError
from monodyn.mechanism import Mechanism
from monodyn.mechanism.tree import SLIDE
from monodyn.types import Camera
from monodyn.vision.drawing.camera import X
from monodyn.vision.drawing.follow import EdgeSearch, MoveLimits, follow
from monodyn.vision.drawing.mismatch import pose_balance
from monodyn.vision.drawing.rig import Rig, joint_limits, rig_of, root_slides
from monodyn.vision.locating import grow
from monodyn.vision.locating.beam import Beam, extended, slide_places
from monodyn.vision.locating.keyframes import KeyFrame, KeyFrames
from monodyn.vision.locating.roots import root_lines, root_points
from monodyn.vision.locating.settle import settled
from monodyn.vision.locating.thin import LEAST_WIDTH_PX, thickened
from monodyn.vision.locating.unit import drawn

WIDE = Beam(24, 72, 64)
"""Poses kept per link, positions tried per hinge and per slide, when the pose of a known mechanism is looked
for."""
WHOLE_POSES = 3
"""Most whole poses of the beam that are polished."""
WORTH = 0.5
"""A whole pose is polished if it explains at least this share of what the best one explains."""
GROWN_FRAMES = 5
"""Key frames in which structures grow."""
FINALISTS = 4
"""Structures whose sizes and poses are improved."""
POLISH = EdgeSearch(np.array([9.0, 7.0, 5.0, 4.0, 3.0, 3.0]), 1.5)
"""How a pose is polished in the reduced picture [reduced px]."""
POLISH_STD = 0.5
"""Standard deviation of a hinge of the beam [rad]."""


@dataclass(frozen=True, eq=False)
class SceneGuess:
    """A mechanism before a camera, with its poses in some key frames.

    Attributes:
        mechanism: Its sizes and those of the camera are in one unit.
        camera: The camera.
        positions: Joint positions, (key frame, dof).
        mismatch: Share of the foreground that is not explained, 0 is perfect, (key frame,).
    """

    mechanism: Mechanism
    camera: Camera
    positions: np.ndarray
    mismatch: np.ndarray

    @property
    def score(self) -> float:
        """Mean mismatch of the better three quarters of the frames."""
        return grow.better_mean(self.mismatch)


def search_scene(frames: KeyFrames, start: grow.SceneStart, count: int = 7) -> list[SceneGuess]:
    """Find camera, sizes and poses from the topology alone.

    Args:
        frames: Key frames of the clip.
        start: The mechanism, the camera, and what may not change.
        count: Key frames to use.

    Returns:
        Guesses, the best first.

    Raises:
        VideoError: Nothing shows along which the first joint may slide.
    """
    chosen = frames.only(frames.most_distinct(count))
    slides = root_slides(start.mechanism)
    if start.mechanism.joints[0].kind == "hinge":
        roots = root_points(chosen)
    else:
        roots = root_lines(chosen, upright=slides[0].column != X)
    if not roots:
        raise VideoError(
            "the clip: expected foreground along which the first joint slides, got hardly any in the key "
            "frames; a lower --segment.contrast, or --background with a picture without the mechanism, may "
            "show it."
        )
    few = chosen.only(range(min(GROWN_FRAMES, len(chosen.frames))))

    def improved(structure: grow.Structure) -> SceneGuess:
        better = settled(few, grow.whole(structure, start), start)
        held = {p.name: p.value for p in drawn(better.mechanism) if p.name in start.pinned}
        # what may not change was never made thicker
        mechanism = thinned(chosen, better.mechanism, better.camera).with_values(held)
        return search_poses(chosen, mechanism, better.camera)

    guesses = on_all_cores(improved, grow.grown(few, start, roots)[:FINALISTS])
    return sorted(guesses, key=lambda guess: guess.score)


def search_pose(
    frame: KeyFrame, frames: KeyFrames, rig: Rig, mechanism: Mechanism, *, near: np.ndarray | None = None
) -> tuple[np.ndarray, float]:
    """Find the pose in one key frame by beam search, then polish it.

    Args:
        frame: The key frame.
        frames: All key frames, for their common trust.
        rig: The mechanism before the reduced camera.
        mechanism: For joint limits.
        near: Further pose to polish in addition to the beam's, (dof,).

    Returns:
        Joint positions (dof,), and the share of the foreground that is not explained.
    """
    beam = _beam(frame, rig, mechanism)
    if near is not None:
        beam = np.vstack([beam, near])
    lower, upper = joint_limits(mechanism)
    std = np.full(len(lower), POLISH_STD)
    for row in np.flatnonzero(rig.kind == SLIDE):
        # in a picture that shows hardly anything there may be one place alone
        std[row] = np.ptp(slide_places(frame, rig, int(row), 2)) / 8.0 or POLISH_STD
    limits, planes = MoveLimits(lower, upper, std), frame.coarse[np.newaxis]
    polished = [follow(planes, frames.coarse_view, rig, start, limits, POLISH)[0] for start in beam]
    # polishing may follow a wrong edge: the poses of the beam itself stay in the choice
    both = np.vstack([beam, np.array(polished)])
    costs = pose_balance(frame.balance, rig, both, len(rig.radius))
    best = int(np.argmin(costs))
    return both[best], grow.unexplained(frame, float(costs[best]))


def search_poses(
    frames: KeyFrames, mechanism: Mechanism, camera: Camera, near: np.ndarray | None = None
) -> SceneGuess:
    """Find the pose in every key frame separately.

    Args:
        frames: The key frames.
        mechanism: The mechanism.
        camera: The camera.
        near: Further pose of each key frame to polish, (key frame, dof).

    Returns:
        The mechanism before the camera with these poses.
    """
    rig = rig_of(as_thick(frames, mechanism, camera), camera, shrink=frames.shrink)
    further = itertools.repeat(None) if near is None else iter(near)
    found = on_all_cores(
        lambda pair: search_pose(pair[0], frames, rig, mechanism, near=pair[1]),
        zip(frames.afresh().frames, further, strict=False),
    )
    positions, mismatch = np.array([q for q, _ in found]), np.array([share for _, share in found])
    return SceneGuess(mechanism, camera, positions, mismatch)


def as_thick(frames: KeyFrames, mechanism: Mechanism, camera: Camera) -> Mechanism:
    """Return a mechanism as thick as everything is in reduced masks.

    Args:
        frames: Frames with these masks.
        mechanism: The mechanism.
        camera: The camera before it, in the same unit.
    """
    return thickened(mechanism, (frames.thicker or 0.0) * frames.shrink * camera.depth / camera.focal)


def left_shares(
    frames: KeyFrames, mechanism: Mechanism, camera: Camera, poses: Iterable[np.ndarray]
) -> np.ndarray:
    """Return the share of each frame's foreground that a mechanism does not explain.

    Args:
        frames: The key frames.
        mechanism: The mechanism.
        camera: The camera.
        poses: Joint positions in each frame, each (dof,).

    Returns:
        The shares, (key frame,).

    Source:
        The mismatch of outline and mask is eq. (3) of the 2012 paper.
    """
    rig = rig_of(as_thick(frames, mechanism, camera), camera, shrink=frames.shrink)
    pairs = zip(frames.afresh().frames, poses, strict=True)
    return np.array(on_all_cores(lambda pair: grow.left_share(pair[0], rig, pair[1]), pairs))


def thinned(frames: KeyFrames, mechanism: Mechanism, camera: Camera) -> Mechanism:
    """Return a mechanism as thick as it is, from the one that was found in reduced masks.

    Args:
        frames: Frames with these masks.
        mechanism: The mechanism.
        camera: The camera before it, in the same unit.
    """
    px = camera.depth / camera.focal
    return thickened(mechanism, -(frames.thicker or 0.0) * frames.shrink * px, LEAST_WIDTH_PX * px)


def _beam(frame: KeyFrame, rig: Rig, mechanism: Mechanism) -> np.ndarray:
    """Return the best few whole poses of the beam search, (pose, dof)."""
    dofs = len(rig.parent)
    poses, costs = np.zeros((1, dofs)), np.zeros(1)
    for i in range(dofs):
        poses, costs = extended(frame, rig, mechanism, i, poses, WIDE)
    order = np.argsort(costs, kind="stable")[:WHOLE_POSES]
    # what explains much less than the best pose does not overtake it by being polished
    limit = WORTH * costs[order[0]] if costs[order[0]] < 0.0 else np.inf
    return poses[order[costs[order] <= limit]]
