"""From key frames and the topology alone to a rough camera, sizes and poses: the global search.

The mechanism is laid into each mask link by link: a beam of the best partial poses is extended by every
position of the next joint, scored by the silhouette mismatch of the links placed so far (paper eq. 3).
Where the root may be, how large the mechanism appears and how its lengths compare is tried from a short
list that the masks themselves suggest.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.mechanism.tree import ANCHOR_X, ANCHOR_Y, HINGE, SLIDE
from monodyn.types import FULL, Camera
from monodyn.vision.drawing.camera import DEPTH, FOCAL
from monodyn.vision.drawing.follow import EdgeSearch, MoveLimits, follow
from monodyn.vision.drawing.mismatch import pose_mismatch
from monodyn.vision.drawing.rig import SIZE_KINDS, Rig, joint_limits, longest_reach, rig_of
from monodyn.vision.locating.keyframes import KeyFrame, KeyFrames

BEAM = 24
"""Partial poses kept per link."""
WHOLE_POSES = 3
"""Whole poses of the beam that are polished."""
ANGLES = 72
"""Positions tried per hinge."""
PLACES = 64
"""Positions tried per slide."""
PATTERNED = 5
"""Most lengths for which patterns are tried; with more the joint refinement has to find their proportions."""
LONGER, SHORTER = 1.7, 0.6
"""Factors on one length at a time, with which the search is tried."""
POLISH = EdgeSearch(np.array([9.0, 7.0, 5.0, 4.0, 3.0, 3.0]), 1.5)
"""How a pose is polished in the reduced picture [reduced px]."""
POLISH_STD = 0.5
"""Standard deviation of a hinge of the beam [rad]."""
FARTHEST_DISTANCE = 40.0
"""Distances from the foreground count up to this [reduced px]."""
UNKNOWN_DISTANCE = 0.3
"""Weight of distances where the background is not known."""


@dataclass(frozen=True, eq=False)
class SceneGuess:
    """A mechanism before a camera, with its poses in some key frames.

    Attributes:
        mechanism: With sizes in the start scale.
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
        ordered = np.sort(self.mismatch)
        return float(np.mean(ordered[: max(1, (3 * len(ordered) + 3) // 4)]))


@dataclass(frozen=True, eq=False)
class SceneStart:
    """What the search starts from.

    Attributes:
        mechanism: With start sizes.
        camera: Start camera: its focal length and turns are kept.
        pinned: Parameters that may not change.
    """

    mechanism: Mechanism
    camera: Camera
    pinned: frozenset[str]


class _Root(NamedTuple):
    """Where the first joint may be [px], NaN along its slide, and how far the foreground reaches from there
    [px]."""

    x: float
    y: float
    reach: float


def search_scene(frames: KeyFrames, start: SceneStart, count: int = 7) -> list[SceneGuess]:
    """Find camera, sizes and poses from the topology alone.

    Args:
        frames: Key frames of the clip.
        start: The mechanism, the camera, and what may not change.
        count: Key frames to use.

    Returns:
        Guesses, the best first.
    """
    chosen = frames.only(frames.most_distinct(count))
    hinged = start.mechanism.joints[0].kind == "hinge"
    roots = _root_points(chosen) if hinged else _root_lines(chosen)
    # Places are tried with the file's proportions first. Sizes and proportions are tried at the best two
    # places only: all combinations would take three times as long, and do not save a wrong place.
    tried = [(_guess(chosen, start, root, 1.0, {}), root) for root in roots]
    tried.sort(key=lambda pair: pair[0].score)
    guesses = [guess for guess, _ in tried[:2]]
    patterns = _patterns(start)
    for (_, root), scale, pattern in itertools.product(tried[:2], (1.0, 1.2), patterns):
        if scale == 1.0 and not pattern:
            continue
        guesses.append(_guess(chosen, start, root, scale, pattern))
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
    std[rig.kind == SLIDE] = np.ptp(_slide_places(rig, frame.coarse.shape)) / 8.0
    limits, planes = MoveLimits(lower, upper, std), frame.coarse[np.newaxis]
    polished = [follow(planes, frames.coarse_view, rig, start, limits, POLISH)[0] for start in beam]
    # polishing may follow a wrong edge: the poses of the beam itself stay in the choice
    both = np.vstack([beam, np.array(polished)])
    costs = pose_mismatch(frame.sums, rig, both, len(rig.radius))
    best = int(np.argmin(costs))
    return both[best], (frame.area + float(costs[best])) / max(frame.area, 1.0)


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
    rig = rig_of(mechanism, camera, shrink=frames.shrink)
    further = itertools.repeat(None) if near is None else iter(near)
    found = [
        search_pose(frame, frames, rig, mechanism, near=pose)
        for frame, pose in zip(frames.frames, further, strict=False)
    ]
    positions, mismatch = np.array([q for q, _ in found]), np.array([share for _, share in found])
    return SceneGuess(mechanism, camera, positions, mismatch)


def _beam(frame: KeyFrame, rig: Rig, mechanism: Mechanism) -> np.ndarray:
    """Return the best few whole poses of the beam search, (pose, dof)."""
    dofs = len(rig.parent)
    # Each round sets one more joint of every pose. Geoms come in the order of their links, so the geoms of
    # the links that are set are the first ones, and a partial pose is scored by these alone.
    poses, costs = np.zeros((1, dofs)), np.zeros(1)
    for i in range(dofs):
        values = _joint_values(frame, rig, mechanism, i)
        grid = np.repeat(poses, len(values), axis=0)
        grid[:, i] = np.tile(values, len(poses))
        geoms = int(np.sum(rig.link <= i))
        new = pose_mismatch(frame.sums, rig, grid, geoms)
        if geoms == int(np.sum(rig.link < i)):
            # a link without geoms scores nothing: its positions all go on to the next joint
            poses, costs = grid, new
            continue
        circular = rig.kind[i] == HINGE and len(values) == ANGLES
        kept = _best_peaks(new.reshape(len(poses), len(values)), circular)
        poses, costs = grid[kept], new[kept]
    return poses[np.argsort(costs, kind="stable")[:WHOLE_POSES]]


def _joint_values(frame: KeyFrame, rig: Rig, mechanism: Mechanism, row: int) -> np.ndarray:
    """Return the positions to try of one joint, within its limits [rad or m]."""
    joint = mechanism.joints[row]
    if rig.kind[row] == HINGE:
        values = np.linspace(-np.pi, np.pi, ANGLES, endpoint=False)
    else:
        values = _slide_places(rig, frame.coarse.shape)
    values = values[(values >= joint.lower) & (values <= joint.upper)]
    return values if len(values) else np.linspace(joint.lower, joint.upper, 5)


def _best_peaks(costs: np.ndarray, circular: bool) -> np.ndarray:
    """Return the flat indices of the best local minima along the rows of a table (pose, value).

    Neighbouring positions have nearly equal scores: without the choice of minima the beam would fill with
    copies of one pose, and lose the others that a later link may need.
    """
    if circular:
        left, right = np.roll(costs, 1, axis=1), np.roll(costs, -1, axis=1)
    else:
        left = np.pad(costs, ((0, 0), (1, 0)), constant_values=np.inf)[:, :-1]
        right = np.pad(costs, ((0, 0), (0, 1)), constant_values=np.inf)[:, 1:]
    # one of the two comparisons is strict: a plateau counts once
    peaks = np.nonzero(((costs <= left) & (costs < right)).ravel())[0]
    if not len(peaks):
        peaks = np.array([int(np.argmin(costs))])
    return peaks[np.argsort(costs.ravel()[peaks], kind="stable")[:BEAM]]


def _slide_places(rig: Rig, shape: tuple[int, ...]) -> np.ndarray:
    """Return slide positions that span the picture [m]."""
    half = 0.75 * max(shape) * rig.camera[DEPTH] / rig.camera[FOCAL]
    return np.linspace(-half, half, PLACES)


def _patterns(start: SceneStart) -> list[dict[str, float]]:
    """Return factors on the lengths to try: as given, and each one longer or shorter than the others."""
    mechanism = start.mechanism
    names = [f"{body}.length" for body in mechanism.bodies if f"{body}.length" in mechanism.values]
    names = [name for name in names if name not in start.pinned]
    patterns: list[dict[str, float]] = [{}]
    if 1 < len(names) <= PATTERNED:
        for name in names:
            patterns += [{name: LONGER}, {name: SHORTER}]
    return patterns


def _guess(
    frames: KeyFrames, start: SceneStart, root: _Root, scale: float, pattern: Mapping[str, float]
) -> SceneGuess:
    """Lay the mechanism into the frames with its root at a place and its reach as seen there."""
    camera, pinned, values = start.camera, start.pinned, start.mechanism.values
    mechanism = start.mechanism.with_values({name: values[name] * by for name, by in pattern.items()})
    longest = longest_reach(rig_of(mechanism, camera))
    # Stretched out, the mechanism reaches ``scale`` times as far as the foreground ever does. The depth makes
    # it so; where the depth is given, the sizes do.
    if "camera.depth" not in pinned:
        depth = camera.focal * longest / (scale * root.reach)
        camera = replace(camera, depth=depth)
    else:
        factor = scale * root.reach * camera.depth / (camera.focal * longest)
        mechanism = _scaled(mechanism, SIZE_KINDS, factor, pinned)
    centre = ((camera.width - 1) / 2.0, (camera.height - 1) / 2.0)
    anchor = mechanism.tree.links[0]
    if "camera.x" not in pinned and np.isfinite(root.x):
        camera = replace(camera, x=anchor[ANCHOR_X] - (root.x - centre[0]) * camera.depth / camera.focal)
    if "camera.y" not in pinned and np.isfinite(root.y):
        camera = replace(camera, y=anchor[ANCHOR_Y] + (root.y - centre[1]) * camera.depth / camera.focal)
    return search_poses(frames, _with_area(frames, mechanism, camera, pinned), camera)


def _scaled(mechanism: Mechanism, kinds: tuple[str, ...], factor: float, pinned: frozenset[str]) -> Mechanism:
    """Multiply the sizes of some kinds by a factor, as far as they may change."""
    sizes = [p for p in mechanism.parameters if p.kind in kinds and p.name not in pinned]
    return mechanism.with_values({p.name: p.value * factor for p in sizes}) if sizes else mechanism


def _with_area(frames: KeyFrames, mechanism: Mechanism, camera: Camera, pinned: frozenset[str]) -> Mechanism:
    """Scale all widths so that the mechanism's area is the mask's (the idea of paper eq. 1)."""
    seen = float(np.median([frame.area for frame in frames.frames])) * frames.shrink**2
    scale = camera.focal / camera.depth
    area = 0.0
    shapes = mechanism.shapes
    # the geoms' bounding boxes in their links' frames: what they hide of one another does not count
    for g in range(len(shapes.radius)):
        points = shapes.points[shapes.first[g] : shapes.first[g + 1], :2]
        low, high = points.min(axis=0), points.max(axis=0)
        size = high - low + 2.0 * shapes.radius[g]
        area += float(size[0] * size[1]) * scale**2
    factor = float(np.clip(seen / max(area, 1e-9), 0.1, 10.0))
    return _scaled(mechanism, ("width", "tail", "tip"), factor, pinned)


def _distances(frames: KeyFrames) -> np.ndarray:
    """Return each reduced pixel's mean distance from the foreground of the frames [reduced px].

    Where the background is not known the mechanism may be without being seen: distances count less there.
    """
    import cv2

    far = []
    for frame in frames.frames:
        empty = ((frame.coarse < 0.4 * FULL) | frames.unknown).astype(np.uint8)
        far.append(np.minimum(cv2.distanceTransform(empty, cv2.DIST_L2, 5), FARTHEST_DISTANCE))
    return np.mean(far, axis=0) * np.where(frames.unknown, UNKNOWN_DISTANCE, 1.0)


def _root_points(frames: KeyFrames, count: int = 8) -> list[_Root]:
    """Return where a fixed first hinge may be.

    A fixed hinge is on the mechanism in every frame.
    """
    distance = _distances(frames)
    y, x = np.nonzero(distance <= distance.min() + 1.5)
    points = np.column_stack([x, y]).astype(np.float64)
    # the likeliest place first, then each time the one farthest from those chosen
    picks = [points[int(np.argmin(distance[y, x]))]]
    apart = np.full(len(points), np.inf)
    while len(picks) < min(count, len(points)):
        apart = np.minimum(apart, np.hypot(*(points - picks[-1]).T))
        if apart.max() < 2.0:
            break
        picks.append(points[int(np.argmax(apart))])
    return [_root_at(frames, px, py) for px, py in picks]


def _root_at(frames: KeyFrames, px: float, py: float) -> _Root:
    """Return a root at a reduced pixel with the farthest that the foreground reaches from there."""
    reaches = []
    for frame in frames.frames:
        fy, fx = np.nonzero((frame.coarse > 0.5 * FULL) & ~frames.unknown)
        if len(fx):
            # not the farthest pixel, which may be a speck
            reaches.append(float(np.percentile(np.hypot(fx - px, fy - py), 99.0)))
    reach = float(np.max(reaches)) if reaches else 10.0
    shrink = frames.shrink
    return _Root((px + 0.5) * shrink - 0.5, (py + 0.5) * shrink - 0.5, max(reach, 2.0) * shrink)


def _root_lines(frames: KeyFrames, count: int = 7) -> list[_Root]:
    """Return heights at which a sliding root may run.

    Along its slide the root's place is the joint position, so only the height is looked for.
    """
    masks = [frame.coarse for frame in frames.frames]
    # what slides along a level line covers some of that row in every frame
    rows = np.min([np.max(~frames.unknown * mask, axis=1) for mask in masks], axis=0)
    common = np.nonzero(rows > 0.4 * FULL)[0]
    all_rows = np.nonzero(np.max([np.max(mask, axis=1) for mask in masks], axis=0) > 0.5 * FULL)[0]
    if not len(common):
        common = all_rows
    heights = np.unique(np.linspace(common[0], common[-1], count).round())
    roots = []
    for py in heights:
        reach = max(all_rows[-1] - py, py - all_rows[0], 2.0)
        roots.append(_Root(np.nan, (py + 0.5) * frames.shrink - 0.5, float(reach) * frames.shrink))
    return roots
