"""From key frames and the topology alone to a rough camera, sizes and poses: the global search.

The mechanism is laid into each mask link by link: a beam of the best partial poses is extended by every
position of the next joint, scored by the silhouette mismatch of the links placed so far (paper eq. 3).
Where the root may be, how large the mechanism appears and how its lengths compare is tried from a short
list that the masks themselves suggest.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.types import FULL, Camera
from monodyn.vision.drawing.follow import follow
from monodyn.vision.drawing.rig import Rig, rig_of
from monodyn.vision.drawing.silhouette import pose_mismatch
from monodyn.vision.locating.bundle import SIZES
from monodyn.vision.locating.keyframes import UNKNOWN, KeyFrame, KeyFrames

BEAM = 24
"""Partial poses kept per link."""
ANGLES = 72
"""Positions tried per hinge."""
PLACES = 64
"""Positions tried per slide."""
PATTERNED = 5
"""Most lengths for which patterns are tried; with more the joint refinement has to find their proportions."""
POLISH = np.array([9.0, 7.0, 5.0, 4.0, 3.0, 3.0])
"""Search lengths along the normals while a pose is polished in the reduced picture [px]."""


@dataclass(frozen=True, eq=False)
class Guess:
    """A mechanism before a camera, with its poses in some key frames.

    Attributes:
        mechanism: With sizes in the start scale.
        camera: The camera.
        positions: Joint positions, (key frame, dof).
        mismatch: Share of the foreground that is not explained, 0 is perfect; by key frame.
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


def place(
    frame: KeyFrame, frames: KeyFrames, rig: Rig, mechanism: Mechanism, *, near: np.ndarray | None = None
) -> tuple[np.ndarray, float]:
    """Find the pose in one key frame by beam search, then polish it.

    Args:
        frame: The key frame.
        frames: All key frames, for their common trust.
        rig: The mechanism before the reduced camera.
        mechanism: For joint limits.
        near: Further pose to polish beside the beam's, (dof,).

    Returns:
        Joint positions (dof,), and the share of the foreground that is not explained.
    """
    beam = _beam(frame, rig, mechanism)
    if near is not None:
        beam = np.vstack([beam, near])
    lower, upper = limits(mechanism)
    spread = np.full(len(lower), 0.5)
    spread[rig.kind == 1] = np.ptp(_slide_places(rig, frame.coarse.shape)) / 8.0
    polished = []
    for start in beam:
        q, _, _ = follow(
            frame.coarse[np.newaxis], *frames.coarse_view, *rig, start, lower, upper, spread, POLISH, 1.5
        )  # fmt: skip
        polished.append(q)
    both = np.vstack([beam, np.array(polished)])
    costs = pose_mismatch(frame.sums, rig, both, len(rig.radius))
    best = int(np.argmin(costs))
    return both[best], (frame.area + float(costs[best])) / max(frame.area, 1.0)


def limits(mechanism: Mechanism) -> tuple[np.ndarray, np.ndarray]:
    """Return the joint limits of a mechanism, -inf and inf where there are none.

    Args:
        mechanism: The mechanism.
    """
    lower = np.array([joint.lower for joint in mechanism.joints], dtype=np.float64)
    upper = np.array([joint.upper for joint in mechanism.joints], dtype=np.float64)
    return lower, upper


def _beam(frame: KeyFrame, rig: Rig, mechanism: Mechanism) -> np.ndarray:
    """Return the best few whole poses of the beam search, (pose, dof)."""
    dofs = len(rig.parent)
    poses = np.zeros((1, dofs))
    costs = np.zeros(1)
    for i in range(dofs):
        joint = mechanism.joints[i]
        if rig.kind[i] == 0:
            values = np.linspace(-np.pi, np.pi, ANGLES, endpoint=False)
        else:
            values = _slide_places(rig, frame.coarse.shape)
        values = values[(values >= joint.lower) & (values <= joint.upper)]
        if not len(values):
            values = np.linspace(joint.lower, joint.upper, 5)
        grid = np.repeat(poses, len(values), axis=0)
        grid[:, i] = np.tile(values, len(poses))
        geoms = int(np.sum(rig.link <= i))
        new = pose_mismatch(frame.sums, rig, grid, geoms)
        if geoms == int(np.sum(rig.link < i)):
            poses, costs = grid, new
            continue
        table = new.reshape(len(poses), len(values))
        wrap = rig.kind[i] == 0 and len(values) == ANGLES
        left = (
            np.roll(table, 1, axis=1)
            if wrap
            else np.pad(table, ((0, 0), (1, 0)), constant_values=np.inf)[:, :-1]
        )
        right = (
            np.roll(table, -1, axis=1)
            if wrap
            else np.pad(table, ((0, 0), (0, 1)), constant_values=np.inf)[:, 1:]
        )
        peaks = np.nonzero(((table <= left) & (table < right)).ravel())[0]
        if not len(peaks):
            peaks = np.array([int(np.argmin(new))])
        keep = peaks[np.argsort(new[peaks], kind="stable")[:BEAM]]
        poses, costs = grid[keep], new[keep]
    return poses[np.argsort(costs, kind="stable")[:3]]


def _slide_places(rig: Rig, shape: tuple[int, ...]) -> np.ndarray:
    """Return slide positions that span the picture [m]."""
    half = 0.75 * max(shape) * rig.camera[11] / rig.camera[12]
    return np.linspace(-half, half, PLACES)


def search(
    frames: KeyFrames, mechanism: Mechanism, camera: Camera, pinned: frozenset[str], count: int = 7
) -> list[Guess]:
    """Find camera, sizes and poses from the topology alone.

    Args:
        frames: Key frames of the clip.
        mechanism: With start sizes.
        camera: Start camera: its focal length and turns are kept.
        pinned: Parameters that may not change.
        count: Key frames to use.

    Returns:
        Guesses, the best first.
    """
    chosen = [frames.frames[i] for i in frames.spread(count)]
    rooted = mechanism.joints[0].kind == "hinge"
    roots = _root_points(chosen, frames) if rooted else _root_lines(chosen, frames)
    first = [_try(chosen, frames, mechanism, camera, root, 1.0, {}, pinned) for root in roots]
    first.sort(key=lambda pair: pair[0].score)
    guesses = [guess for guess, _ in first[:2]]
    patterns = _patterns(mechanism, pinned)
    for (_, root), scale, pattern in itertools.product(first[:2], (1.0, 1.2), patterns):
        if scale == 1.0 and not pattern:
            continue
        guesses.append(_try(chosen, frames, mechanism, camera, root, scale, pattern, pinned)[0])
    return sorted(guesses, key=lambda guess: guess.score)


def _patterns(mechanism: Mechanism, pinned: frozenset[str]) -> list[dict[str, float]]:
    """Return factors on the lengths to try: as given, and each one longer or shorter than the others."""
    names = [f"{body}.length" for body in mechanism.bodies if f"{body}.length" in mechanism.values]
    names = [name for name in names if name not in pinned]
    patterns: list[dict[str, float]] = [{}]
    if 1 < len(names) <= PATTERNED:
        for name in names:
            patterns += [{name: 1.7}, {name: 0.6}]
    return patterns


def _try(
    chosen: list[KeyFrame],
    frames: KeyFrames,
    mechanism: Mechanism,
    camera: Camera,
    root: tuple[float, float, float],
    scale: float,
    pattern: dict[str, float],
    pinned: frozenset[str],
) -> tuple[Guess, tuple[float, float, float]]:
    """Lay the mechanism into the chosen frames with its root at a place and its reach as seen there."""
    values = mechanism.values
    mechanism = mechanism.with_values({name: values[name] * factor for name, factor in pattern.items()})
    x, y, reach = root
    longest = _longest(mechanism)
    if "camera.depth" not in pinned:
        depth = camera.focal * longest / (scale * reach)
        camera = replace(camera, depth=depth)
    else:
        factor = scale * reach * camera.depth / (camera.focal * longest)
        names = [n for n in mechanism.values if n.endswith(SIZES) and n not in pinned]
        mechanism = mechanism.with_values({n: mechanism.values[n] * factor for n in names})
    centre = ((camera.width - 1) / 2.0, (camera.height - 1) / 2.0)
    anchor = mechanism.tree.links[0, :2]
    if "camera.x" not in pinned and np.isfinite(x):
        camera = replace(camera, x=anchor[0] - (x - centre[0]) * camera.depth / camera.focal)
    if "camera.y" not in pinned and np.isfinite(y):
        camera = replace(camera, y=anchor[1] + (y - centre[1]) * camera.depth / camera.focal)
    mechanism = _with_area(chosen, frames, mechanism, camera, pinned)
    rig = rig_of(mechanism, camera, shrink=frames.shrink)
    placed = [place(frame, frames, rig, mechanism) for frame in chosen]
    guess = Guess(mechanism, camera, np.array([q for q, _ in placed]), np.array([m for _, m in placed]))
    return guess, root


def _longest(mechanism: Mechanism) -> float:
    """Return the farthest that any point gets from the first joint [m], the mechanism stretched out."""
    tree, shapes = mechanism.tree, mechanism.shapes
    reach = np.zeros(len(tree.parent))
    for i, parent in enumerate(tree.parent):
        anchor = float(np.hypot(tree.links[i, 0], tree.links[i, 1]))
        reach[i] = anchor + reach[parent] if parent >= 0 else 0.0
    far = 1e-9
    for g, link in enumerate(shapes.link):
        points = shapes.points[shapes.first[g] : shapes.first[g + 1], :2]
        far = max(far, reach[link] + float(np.hypot(*points.T).max()) + float(shapes.radius[g]))
    return float(far)


def _with_area(
    chosen: list[KeyFrame], frames: KeyFrames, mechanism: Mechanism, camera: Camera, pinned: frozenset[str]
) -> Mechanism:
    """Scale all widths so that the mechanism's area is the mask's (the idea of paper eq. 1)."""
    names = [n for n in mechanism.values if n.endswith((".width", ".tail", ".tip")) and n not in pinned]
    if not names:
        return mechanism
    seen = float(np.median([frame.area for frame in chosen])) * frames.shrink**2
    scale = camera.focal / camera.depth
    area = 0.0
    shapes = mechanism.shapes
    for g in range(len(shapes.radius)):
        points = shapes.points[shapes.first[g] : shapes.first[g + 1], :2]
        low, high = points.min(axis=0), points.max(axis=0)
        size = high - low + 2.0 * shapes.radius[g]
        area += float(size[0] * size[1]) * scale**2
    factor = float(np.clip(seen / max(area, 1e-9), 0.1, 10.0))
    return mechanism.with_values({name: mechanism.values[name] * factor for name in names})


def _distances(chosen: list[KeyFrame], frames: KeyFrames) -> np.ndarray:
    """Return each reduced pixel's mean distance from the foreground of the frames [reduced px].

    Where the background is not known the mechanism may be without being seen: distances count less there.
    """
    import cv2

    far = []
    unknown = frames.coarse_trust < UNKNOWN
    for frame in chosen:
        empty = ((frame.coarse < 0.4 * FULL) | unknown).astype(np.uint8)
        far.append(np.minimum(cv2.distanceTransform(empty, cv2.DIST_L2, 5), 40.0))
    return np.mean(far, axis=0) * np.where(unknown, 0.3, 1.0)


def _root_points(
    chosen: list[KeyFrame], frames: KeyFrames, count: int = 8
) -> list[tuple[float, float, float]]:
    """Return where a fixed first hinge may be [px], with the reach of the foreground from there [px].

    A fixed hinge is on the mechanism in every frame.
    """
    distance = _distances(chosen, frames)
    y, x = np.nonzero(distance <= distance.min() + 1.5)
    points = np.column_stack([x, y]).astype(np.float64)
    picks = [points[int(np.argmin(distance[y, x]))]]
    apart = np.full(len(points), np.inf)
    while len(picks) < min(count, len(points)):
        apart = np.minimum(apart, np.hypot(*(points - picks[-1]).T))
        if apart.max() < 2.0:
            break
        picks.append(points[int(np.argmax(apart))])
    roots = []
    for px, py in picks:
        reaches = []
        for frame in chosen:
            fy, fx = np.nonzero((frame.coarse > 0.5 * FULL) & (frames.coarse_trust >= UNKNOWN))
            if len(fx):
                reaches.append(float(np.percentile(np.hypot(fx - px, fy - py), 99.0)))
        reach = float(np.max(reaches)) if reaches else 10.0
        roots.append(
            (
                (px + 0.5) * frames.shrink - 0.5,
                (py + 0.5) * frames.shrink - 0.5,
                max(reach, 2.0) * frames.shrink,
            )
        )
    return roots


def _root_lines(
    chosen: list[KeyFrame], frames: KeyFrames, count: int = 7
) -> list[tuple[float, float, float]]:
    """Return heights at which a sliding root may run [px], with the reach of the foreground from there [px].

    Along its slide the root's place is the joint position, so only the height is looked for.
    """
    known = frames.coarse_trust >= UNKNOWN
    rows = np.min([np.max(known * f.coarse, axis=1) for f in chosen], axis=0)
    common = np.nonzero(rows > 0.4 * FULL)[0]
    all_rows = np.nonzero(np.max([np.max(f.coarse, axis=1) for f in chosen], axis=0) > 0.5 * FULL)[0]
    if not len(common):
        common = all_rows
    heights = np.unique(np.linspace(common[0], common[-1], count).round())
    roots = []
    for py in heights:
        reach = max(all_rows[-1] - py, py - all_rows[0], 2.0)
        roots.append((np.nan, (py + 0.5) * frames.shrink - 0.5, float(reach) * frames.shrink))
    return roots
