"""The published sub-problems: depth (1), place (2), pose (3, 5) and aspect ratios (4) from a silhouette.

Each is one pure function. The area determines the depth, the centroid the place, and the mismatch of the
drawn and the seen silhouette pose and ratios.

Where the camera is held, as in the strict framework, every trial of (3) and (4) is made before the camera as
it stands. Where it is free, as in the interleaved one, which is ours, each trial is made before a camera that
is placed by (1) and (2) in closed form: the area falls with the square of the depth, the centroid moves with
the camera.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from monodyn.optimize.bracket import line_search
from monodyn.optimize.lagrangian import augmented_lagrangian
from monodyn.optimize.minimum import DirectSettings
from monodyn.paper.placed import drawn, placed_mismatch
from monodyn.paper.view import ModelView, SilhouetteImage
from monodyn.vision.drawing.camera import DEPTH, FOCAL, X, Y
from monodyn.vision.drawing.mismatch import UNDRAWABLE
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.drawing.silhouette import outline_starts, project

LEAST_SIZE_PX = 1.5
"""No length or width becomes smaller [px]: without an inside the mismatch would no longer depend on it."""
PLACED_DRAWINGS = 3
"""Silhouettes drawn for one trial before a camera that is placed."""
DEPTH_RANGE = (0.1, 10.0)
"""The depth is sought between these multiples of the one at which the areas would match."""
DEPTH_STEP, DEPTH_TOLERANCE, MOST_DEPTHS = 0.05, 1e-5, 200
"""First step and accuracy of the depth, as shares of it, and the most trials."""
PLACE_STEP_PX, PLACE_TOLERANCE_PX, MOST_PLACES = 4.0, 0.005, 300
"""First step and accuracy of the camera's place in the picture [px], and the most trials."""
POSE_STEP_PX, POSE_TOLERANCE_PX, MOST_POSES = 5.0, 0.02, 1000
"""Usual first step and accuracy of the pose in the picture [px], and the most trials."""
RATIO_STEP, RATIO_TOLERANCE, MOST_RATIOS = 0.1, 0.02, 3000
"""Usual first step as a share of each size, accuracy as a share of the step, and the most trials."""
LEAST_STEPPED = 0.05
"""A size counts as at least this share of the largest one where steps are taken, so that a zero may grow."""
TURNED = 1e-4
"""Step of a joint for the slopes of the outline's points [rad or m]."""
FLATTEST = 1e-4
"""Least eigenvalue of the displacement metric, as a share of the largest: a joint that moves nothing in the
picture would otherwise take an infinite step."""


@dataclass(frozen=True, eq=False)
class History:
    """How the objective of one sub-problem fell.

    Attributes:
        problem: ``depth`` (1), ``place`` (2), ``pose`` (3, or 5 in video) or ``ratios`` (4).
        evaluations: Silhouettes drawn so far in this search, (entry,).
        values: Least objective so far [px^4, px^2, px^2, px^2], (entry,).
    """

    problem: str
    evaluations: np.ndarray
    values: np.ndarray


def mismatch(image: SilhouetteImage, rig: Rig, position: np.ndarray) -> float:
    """Return the sum of ``|I_a - I_m|`` over the picture [px^2].

    Args:
        image: The seen silhouette I_a.
        rig: What is drawn, I_m.
        position: Joint positions, (dof,).

    Source:
        The 2012 paper, eq. (3), (4) and (5).
    """
    area, (common,) = drawn(image.sums[np.newaxis], rig, position)
    # |I_a - I_m| counts each silhouette once, less what both have in common
    return image.area + area - 2.0 * common if area >= 0.0 else UNDRAWABLE


def area_gap(image: SilhouetteImage, rig: Rig, position: np.ndarray) -> float:
    """Return ``(A_o - A_m)^2`` [px^4], the areas inside of the picture.

    Args:
        image: The seen silhouette.
        rig: What is drawn.
        position: Joint positions, (dof,).

    Source:
        The 2012 paper, eq. (1).
    """
    _, (area,) = drawn(image.moments[:1], rig, position)
    return (image.area - area) ** 2 if area >= 0.0 else UNDRAWABLE


def centroid_gap(image: SilhouetteImage, rig: Rig, position: np.ndarray) -> float:
    """Return the squared distance between the centroids of the seen and the drawn silhouette [px^2].

    Args:
        image: The seen silhouette.
        rig: What is drawn.
        position: Joint positions, (dof,).

    Source:
        The 2012 paper, eq. (2).
    """
    _, (area, x, y) = drawn(image.moments, rig, position)
    return (image.x - x / area) ** 2 + (image.y - y / area) ** 2 if area > 0.0 else UNDRAWABLE


def fit_depth(image: SilhouetteImage, view: ModelView) -> tuple[ModelView, History]:
    """Find the camera's depth by the silhouette's area: golden section with Swann's bounding.

    The depth is bounded so that the drawn mechanism is at most a hundred times smaller or larger than seen.

    Args:
        image: The seen silhouette.
        view: The mechanism as found so far.

    Returns:
        The mechanism before the camera as found, and the history of the search.

    Source:
        The 2012 paper, eq. (1).
    """
    rig, camera = view.rig, view.base.camera
    depth = float(camera[DEPTH])
    # the whole drawn area, also outside of the picture, so that a start too near still gives a likely depth
    area = float(drawn(image.moments[:1], rig, view.position)[0])
    # what reaches behind the camera has no area: no depth is likelier than the present one then
    likely = depth * float(np.sqrt(max(area, 1.0) / image.area)) if area >= 0.0 else depth
    # the search starts at the present depth, which has to lie within its bounds
    lower, upper = min(DEPTH_RANGE[0] * likely, depth), max(DEPTH_RANGE[1] * likely, depth)
    calls: list[float] = []

    def gap(value: float) -> float:
        calls.append(area_gap(image, rig.before(_replaced(camera, {DEPTH: value})), view.position))
        return calls[-1]

    settings = DirectSettings(DEPTH_TOLERANCE * depth, MOST_DEPTHS)
    found = line_search(gap, depth, DEPTH_STEP * depth, (lower, upper), settings=settings)
    falling = np.minimum.accumulate(calls)
    history = History("depth", np.arange(1, len(calls) + 1), falling)
    return view.before(_replaced(camera, {DEPTH: found.x})), history


def fit_place(image: SilhouetteImage, view: ModelView) -> tuple[ModelView, History]:
    """Find the camera's x and y by the silhouette's centroid: augmented Lagrangian, Powell inside.

    They are bounded so that the drawn silhouette's centroid stays inside of the picture.

    Args:
        image: The seen silhouette.
        view: The mechanism as found so far.

    Returns:
        The mechanism before the camera as found, and the history of the search.

    Source:
        The 2012 paper, eq. (2).
    """
    rig, camera = view.rig, view.base.camera
    columns = [column for column, free in ((X, view.free.x), (Y, view.free.y)) if free]
    scale = float(camera[DEPTH] / camera[FOCAL])
    height, width = image.sums.shape[0], image.sums.shape[1] - 1
    _, (area, sum_x, sum_y) = drawn(image.moments, rig, view.position)
    middle = [sum_x / area, sum_y / area] if area > 0.0 else [0.5 * width, 0.5 * height]
    # the camera moves against the picture: x up to the centroid's distance from either side; rows count down
    reach = {X: (middle[0] - width, middle[0]), Y: (-middle[1], height - middle[1])}
    start = camera[columns]
    lower = np.minimum(start + scale * np.array([reach[c][0] for c in columns]), start)
    upper = np.maximum(start + scale * np.array([reach[c][1] for c in columns]), start)

    def gap(place: np.ndarray) -> float:
        moved = _replaced(camera, dict(zip(columns, place, strict=True)))
        return centroid_gap(image, rig.before(moved), view.position)

    found = augmented_lagrangian(
        gap, start, (lower, upper), step=PLACE_STEP_PX * scale,
        settings=DirectSettings(PLACE_TOLERANCE_PX / PLACE_STEP_PX, MOST_PLACES),
    )  # fmt: skip
    moved = _replaced(camera, dict(zip(columns, found.x, strict=True)))
    return view.before(moved), _history("place", found.history, found.evaluations)


def fit_pose(
    image: SilhouetteImage,
    view: ModelView,
    *,
    step_px: float = POSE_STEP_PX,
    limits: np.ndarray | None = None,
) -> tuple[ModelView, History]:
    """Find the pose by the mismatch of the silhouettes within limits: augmented Lagrangian, Powell inside.

    The unknowns are the joint positions along ``pose_directions``. The paper does not say along which
    directions Powell's search starts; these are ours.

    Args:
        image: The seen silhouette.
        view: The mechanism; its position is the start.
        step_px: First step along each direction [px].
        limits: Lower and upper limits (of eq. 5), (2, dof); default the joints' own (eq. 3).

    Returns:
        The mechanism in the pose as found, and the history of the search.

    Source:
        The 2012 paper, eq. (3) and (5).
    """
    rig = view.rig
    low, high = view.limits if limits is None else limits
    start = np.clip(view.position, low, high)
    free = np.flatnonzero(high > low)
    if not len(free):
        value = mismatch(image, rig, start)
        return replace(view, position=start), History("pose", np.array([1]), np.array([value]))
    directions = np.zeros((len(start), len(free)))
    directions[free] = pose_directions(rig, start, free)

    def gap(along: np.ndarray) -> float:
        q = start + directions @ along
        return _placed_gap(image, view, rig, q)[0] if any(view.free) else mismatch(image, rig, q)

    found = augmented_lagrangian(
        gap, np.zeros(len(free)), inequalities=_beyond(start, directions, (low, high), step_px),
        step=step_px, settings=DirectSettings(POSE_TOLERANCE_PX / step_px, MOST_POSES),
    )  # fmt: skip
    # the constraints are met to the tolerance alone, so the last bit is cut off
    pose = np.clip(start + directions @ found.x, low, high)
    history = _history("pose", found.history, found.evaluations, view)
    return camera_placed(image, replace(view, position=pose)), history


def _beyond(
    start: np.ndarray, directions: np.ndarray, limits: tuple[np.ndarray, np.ndarray], step_px: float
) -> Callable[[np.ndarray], np.ndarray] | None:
    """Return how far a pose along the directions is beyond its finite limits, in first steps; None without.

    Along the directions the limits of single joints are no bounds but inequalities over all unknowns.
    """
    low, high = limits
    free = np.flatnonzero(high > low)
    # what one first step along every direction moves each joint by: violations come to the size of a step
    size = np.abs(directions).sum(axis=1) * step_px
    limited = [(i, -1.0, low[i]) for i in free if np.isfinite(low[i])]
    limited += [(i, 1.0, high[i]) for i in free if np.isfinite(high[i])]
    if not limited:
        return None
    rows = np.array([i for i, _, _ in limited], dtype=np.int64)
    signs = np.array([sign for _, sign, _ in limited]) / size[rows]
    bounds = np.array([bound for _, _, bound in limited])

    def beyond(along: np.ndarray) -> np.ndarray:
        return signs * (start[rows] + directions[rows] @ along - bounds)

    return beyond


def pose_directions(rig: Rig, position: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return directions of the pose that move the picture independently, by one pixel each.

    Powell's search starts along them; the paper does not say along which directions it starts. They are the
    principal axes of the mean square displacement of the outline's points, ``d^T M d`` with
    ``M = mean J^T J``. Along the joints themselves the mismatch has narrow valleys with a kinked floor, in
    which line searches stop: turning a link moves all that hang on it.

    Args:
        rig: The mechanism.
        position: Joint positions, (dof,).
        free: Joints that move, (free,).

    Returns:
        Directions as columns [rad or m by px], (free, free).
    """
    # the metric is that of the picture: equal steps along its axes move the outline equally far
    here = outline_points(rig, position)
    slopes = np.empty((len(free), here.size))
    for k, i in enumerate(free):
        there = position.copy()
        there[i] += TURNED
        slopes[k] = (outline_points(rig, there) - here).ravel() / TURNED
    metric = 2.0 * slopes @ slopes.T / here.size
    # behind the camera the points are NaN: all eigenvalues are then zero, and the floor gives any direction
    values, vectors = np.linalg.eigh(np.nan_to_num(metric))
    return vectors / np.sqrt(np.maximum(values, FLATTEST * max(float(values[-1]), 1e-9)))


def outline_points(rig: Rig, position: np.ndarray) -> np.ndarray:
    """Return the projected points of all geoms [px], (point, 2); NaN where they are behind the camera.

    Args:
        rig: The mechanism.
        position: Joint positions, (dof,).
    """
    px = np.empty((int(outline_starts(rig, len(rig.radius))[-1]), 2))
    seen_whole = project(rig, position, px)
    return px if seen_whole else np.full_like(px, np.nan)


def fit_ratios(
    image: SilhouetteImage, view: ModelView, *, step: float = RATIO_STEP
) -> tuple[ModelView, History]:
    """Find the aspect ratios by the mismatch of the silhouettes: augmented Lagrangian, Powell inside.

    The unknowns are each body's width and length as ratios to the reference length. The common scale is left
    to the depth: the reference stays as long as it is, or, where it is among the sizes of the view, the sum
    of the lengths does.

    Args:
        image: The seen silhouette.
        view: The mechanism as found so far.
        step: First step as a share of each size.

    Returns:
        The mechanism with its sizes as found, and the history of the search.

    Source:
        The 2012 paper, eq. (4).
    """
    lower, upper = size_range(view)
    start = np.clip(view.sizes, lower, upper)
    typical = np.maximum(start, LEAST_STEPPED * float(start.max(initial=0.0)))

    scaled = _in_scale(view)

    def gap(sizes: np.ndarray) -> float:
        rig = view.rig_with(scaled(sizes))
        if any(view.free):
            return _placed_gap(image, view, rig, view.position)[0]
        return mismatch(image, rig, view.position)

    if view.reference in view.searched:
        held = np.array([p is view.reference for p in view.searched])
        lower, upper = np.where(held, start, lower), np.where(held, start, upper)
    found = augmented_lagrangian(
        gap,
        start,
        (lower, upper),
        step=step * typical,
        settings=DirectSettings(RATIO_TOLERANCE, MOST_RATIOS),
    )
    history = _history("ratios", found.history, found.evaluations, view)
    return camera_placed(image, replace(view, sizes=scaled(found.x))), history


def size_range(view: ModelView) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds within which sizes are seen in the picture [m], (param,) each.

    Args:
        view: The mechanism as found so far.
    """
    least = LEAST_SIZE_PX * float(view.base.camera[DEPTH] / view.base.camera[FOCAL])
    # an overhang of zero still leaves the body between its hinges to be seen
    return np.minimum(np.maximum(view.lower, np.where(view.overhang, 0.0, least)), view.upper), view.upper


def _in_scale(view: ModelView) -> Callable[[np.ndarray], np.ndarray]:
    """Return what brings sizes to the common scale of the view: the lengths keep their sum."""
    lengths = np.array([p.kind == "length" for p in view.searched], dtype=bool)
    if view.reference not in view.searched or not np.any(lengths):
        return lambda sizes: sizes
    total = float(view.sizes[lengths].sum())
    return lambda sizes: sizes * (total / float(sizes[lengths].sum()))


def camera_placed(image: SilhouetteImage, view: ModelView) -> ModelView:
    """Return the view before the camera that (1) and (2) place in closed form.

    Args:
        image: The seen silhouette.
        view: The mechanism as found so far.
    """
    _, place = _placed_gap(image, view, view.rig, view.position)
    return view.before(_replaced(view.base.camera, dict(enumerate(place, X))))


def _placed_gap(
    image: SilhouetteImage, view: ModelView, rig: Rig, position: np.ndarray
) -> tuple[float, np.ndarray]:
    """Return the mismatch before the camera that is placed, and its x, y and depth."""
    costs, places = placed_mismatch(
        image.sums, image.moments, rig, position[np.newaxis], image.target, view.free
    )
    return image.area + float(costs[0]), places[0]


def _replaced(camera: np.ndarray, values: dict[int, float]) -> np.ndarray:
    """Return a packed camera with some columns replaced."""
    out = camera.copy()
    for column, value in values.items():
        out[column] = value
    return out


def _history(problem: str, entries: np.ndarray, total: int, view: ModelView | None = None) -> History:
    """Return the history of a search; a camera that is placed draws two more silhouettes a trial."""
    each = PLACED_DRAWINGS if view is not None and any(view.free) else 1
    drawings = each * np.append(entries[:, 0], total).astype(np.int64)
    return History(problem, drawings, np.append(entries[:, 1], entries[-1, 1]))
