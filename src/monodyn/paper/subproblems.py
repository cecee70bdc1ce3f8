"""The published sub-problems: depth (1), place (2), pose (3, 5) and aspect ratios (4) from a silhouette.

Each is one pure function. The area tells the depth, the centroid the place, and the mismatch of the drawn
and the seen silhouette pose and ratios.

Solved strictly one after the other they stop far from the least mismatch, because a pose is only as good as
the camera that it was found with. So the camera follows each trial of (3) and (4) by (1) and (2) in closed
form: the area falls with the square of the depth, the centroid moves with the camera.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from monodyn.optimize.bracket import line_search
from monodyn.optimize.lagrangian import augmented_lagrangian
from monodyn.paper.placed import NOWHERE, drawn, placed_mismatch
from monodyn.paper.view import DEPTH, Seen, View, X, Y
from monodyn.vision.drawing.camera import FOCAL
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.drawing.silhouette import outline_starts, project

LEAST_WIDTH_PX = 1.5
"""No size gets below this: what has no inside has no mismatch to come back by [px]."""
FOLLOWING = 3
"""Silhouettes drawn for one trial before a camera that follows."""


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


def mismatch(image: Seen, rig: Rig, position: np.ndarray) -> float:
    """Return the sum of ``|I_a - I_m|`` over the picture [px^2].

    Args:
        image: The seen silhouette I_a.
        rig: What is drawn, I_m.
        position: Joint positions, (dof,).

    Source:
        The 2012 paper, eq. (3), (4) and (5).
    """
    area, common = drawn(image.sums[np.newaxis], rig, position)
    return image.area + area - 2.0 * common if area >= 0.0 else NOWHERE


def area_gap(image: Seen, rig: Rig, position: np.ndarray) -> float:
    """Return ``(A_o - A_m)^2`` [px^4], the areas inside of the picture.

    Args:
        image: The seen silhouette.
        rig: What is drawn.
        position: Joint positions, (dof,).

    Source:
        The 2012 paper, eq. (1).
    """
    area = drawn(image.moments[:1], rig, position)[1]
    return (image.area - area) ** 2 if area >= 0.0 else NOWHERE


def centroid_gap(image: Seen, rig: Rig, position: np.ndarray) -> float:
    """Return the squared distance between the centroids of the seen and the drawn silhouette [px^2].

    Args:
        image: The seen silhouette.
        rig: What is drawn.
        position: Joint positions, (dof,).

    Source:
        The 2012 paper, eq. (2).
    """
    _, area, x, y = drawn(image.moments, rig, position)
    return (image.x - x / area) ** 2 + (image.y - y / area) ** 2 if area > 0.0 else NOWHERE


def fit_depth(
    image: Seen, view: View, *, step: float = 0.05, tolerance: float = 1e-5
) -> tuple[View, History]:
    """Find the camera's depth by the silhouette's area: golden section with Swann's bounding.

    The depth is bounded so that the drawn mechanism is neither a hundred times smaller nor larger than seen.

    Args:
        image: The seen silhouette.
        view: The mechanism as it is so far.
        step: First step as a share of the depth.
        tolerance: Done at this share of the depth.

    Source:
        The 2012 paper, eq. (1).
    """
    rig, camera = view.rig, view.base.camera
    depth = float(camera[DEPTH])
    area = max(float(drawn(image.moments[:1], rig, view.position)[0]), 1.0)
    likely = depth * float(np.sqrt(area / image.area))
    lower, upper = min(0.1 * likely, depth), max(10.0 * likely, depth)
    calls: list[float] = []

    def gap(value: float) -> float:
        calls.append(area_gap(image, rig.before(_with(camera, {DEPTH: value})), view.position))
        return calls[-1]

    found = line_search(gap, depth, step * depth, lower, upper, tolerance * depth)
    falling = np.minimum.accumulate(calls)
    history = History("depth", np.arange(1, len(calls) + 1), falling)
    return view.before(_with(camera, {DEPTH: found.x})), history


def fit_place(
    image: Seen, view: View, *, step_px: float = 4.0, tolerance_px: float = 0.005
) -> tuple[View, History]:
    """Find the camera's x and y by the silhouette's centroid: augmented Lagrangian, Powell inside.

    They are bounded so that the drawn silhouette's centroid stays inside of the picture.

    Args:
        image: The seen silhouette.
        view: The mechanism as it is so far.
        step_px: First step in the picture [px].
        tolerance_px: Done at this step in the picture [px].

    Source:
        The 2012 paper, eq. (2).
    """
    rig, camera = view.rig, view.base.camera
    columns = [column for column, moves in zip((X, Y), view.moves, strict=False) if moves]
    scale = float(camera[DEPTH] / camera[FOCAL])
    height, width = image.sums.shape[0], image.sums.shape[1] - 1
    _, area, sum_x, sum_y = drawn(image.moments, rig, view.position)
    middle = [sum_x / area, sum_y / area] if area > 0.0 else [0.5 * width, 0.5 * height]
    reach = {X: (middle[0] - width, middle[0]), Y: (-middle[1], height - middle[1])}
    start = camera[columns]
    lower = np.minimum(start + scale * np.array([reach[c][0] for c in columns]), start)
    upper = np.maximum(start + scale * np.array([reach[c][1] for c in columns]), start)

    def gap(place: np.ndarray) -> float:
        return centroid_gap(
            image, rig.before(_with(camera, dict(zip(columns, place, strict=True)))), view.position
        )

    found = augmented_lagrangian(
        gap, start, lower, upper, step=step_px * scale, tolerance=tolerance_px / step_px, most=300
    )
    moved = _with(camera, dict(zip(columns, found.x, strict=True)))
    return view.before(moved), _history("place", found.history, found.evaluations)


def fit_pose(
    image: Seen,
    view: View,
    *,
    step_px: float = 5.0,
    tolerance_px: float = 0.02,
    lower: np.ndarray | None = None,
    upper: np.ndarray | None = None,
    most: int = 1000,
) -> tuple[View, History]:
    """Find the pose by the mismatch of the silhouettes within limits: augmented Lagrangian, Powell inside.

    The unknowns are the joint positions along ``pose_directions``.

    Args:
        image: The seen silhouette.
        view: The mechanism; its position is the start.
        step_px: First step along each direction [px].
        tolerance_px: Done at this step [px].
        lower: Lower limits (of eq. 5), (dof,); default the joints' own (eq. 3).
        upper: Upper limits, (dof,).
        most: Trials at the most.

    Source:
        The 2012 paper, eq. (3) and (5).
    """
    rig = view.rig
    low = view.limits[0] if lower is None else lower
    high = view.limits[1] if upper is None else upper
    start = np.clip(view.position, low, high)
    free = np.flatnonzero(high > low)
    if not len(free):
        value = mismatch(image, rig, start)
        return replace(view, position=start), History("pose", np.array([1]), np.array([value]))
    directions = np.zeros((len(start), len(free)))
    directions[free] = pose_directions(rig, start, free)
    size = np.abs(directions).sum(axis=1) * step_px

    def gap(along: np.ndarray) -> float:
        q = start + directions @ along
        return _following(image, view, rig, q)[0] if any(view.moves) else mismatch(image, rig, q)

    limited = [(i, -1.0, low[i]) for i in free if np.isfinite(low[i])]
    limited += [(i, 1.0, high[i]) for i in free if np.isfinite(high[i])]
    rows = np.array([i for i, _, _ in limited], dtype=np.int64)
    signs = np.array([sign for _, sign, _ in limited]) / size[rows] if limited else np.zeros(0)
    bounds = np.array([bound for _, _, bound in limited])

    def beyond(along: np.ndarray) -> np.ndarray:
        return signs * (start[rows] + directions[rows] @ along - bounds)

    found = augmented_lagrangian(
        gap, np.zeros(len(free)), inequalities=beyond if limited else None, step=step_px,
        tolerance=tolerance_px / step_px, most=most,
    )  # fmt: skip
    pose = np.clip(start + directions @ found.x, low, high)
    history = _history("pose", found.history, found.evaluations, view)
    return followed(image, replace(view, position=pose)), history


def pose_directions(rig: Rig, position: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return directions of the pose that move the picture independently, by one pixel each.

    They are the principal axes of the mean square displacement of the outline's points, ``d^T M d`` with
    ``M = mean J^T J``. Along the joints themselves the mismatch has narrow valleys with a kinked floor, in
    which line searches stop: turning a link moves all that hang on it.

    Args:
        rig: The mechanism.
        position: Joint positions, (dof,).
        free: Joints that move, (free,).

    Returns:
        Directions as columns [rad or m by px], (free, free).
    """
    here = outline_points(rig, position)
    slopes = np.empty((len(free), here.size))
    for k, i in enumerate(free):
        there = position.copy()
        there[i] += 1e-4
        slopes[k] = (outline_points(rig, there) - here).ravel() / 1e-4
    metric = 2.0 * slopes @ slopes.T / here.size
    values, vectors = np.linalg.eigh(np.nan_to_num(metric))
    return vectors / np.sqrt(np.maximum(values, 1e-4 * max(float(values[-1]), 1e-9)))


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
    image: Seen, view: View, *, step: float = 0.1, tolerance: float = 0.02, most: int = 3000
) -> tuple[View, History]:
    """Find the aspect ratios by the mismatch of the silhouettes: augmented Lagrangian, Powell inside.

    With the reference length held, the unknowns are each body's width and every other length.

    Args:
        image: The seen silhouette.
        view: The mechanism as it is so far.
        step: First step as a share of each size.
        tolerance: Done at this share of the step.
        most: Trials at the most.

    Source:
        The 2012 paper, eq. (4).
    """
    least = LEAST_WIDTH_PX * float(view.base.camera[DEPTH] / view.base.camera[FOCAL])
    overhang = np.array([name.endswith((".tail", ".tip")) for name in view.names])
    lower = np.minimum(np.maximum(view.lower, np.where(overhang, 0.0, least)), view.upper)
    start = np.clip(view.sizes, lower, view.upper)
    typical = np.maximum(start, 0.05 * float(start.max(initial=0.0)))

    def gap(sizes: np.ndarray) -> float:
        rig = view.rig_with(sizes)
        if any(view.moves):
            return _following(image, view, rig, view.position)[0]
        return mismatch(image, rig, view.position)

    found = augmented_lagrangian(
        gap, start, lower, view.upper, step=step * typical, tolerance=tolerance, most=most
    )
    found_view = replace(view, sizes=found.x)
    return followed(image, found_view), _history("ratios", found.history, found.evaluations, view)


def followed(image: Seen, view: View) -> View:
    """Return the view before the camera that follows by (1) and (2) in closed form.

    Args:
        image: The seen silhouette.
        view: The mechanism as it is so far.
    """
    return view.before(
        _with(view.base.camera, dict(enumerate(_following(image, view, view.rig, view.position)[1], X)))
    )


def _following(image: Seen, view: View, rig: Rig, position: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the mismatch before the camera that follows, and its x, y and depth."""
    facts = np.array([image.area, image.x, image.y])
    costs, places = placed_mismatch(
        image.sums, image.moments, rig, position[np.newaxis], facts, np.array(view.moves)
    )
    return image.area + float(costs[0]), places[0]


def _with(camera: np.ndarray, values: dict[int, float]) -> np.ndarray:
    """Return a packed camera with some columns replaced."""
    out = camera.copy()
    for column, value in values.items():
        out[column] = value
    return out


def _history(problem: str, entries: np.ndarray, total: int, view: View | None = None) -> History:
    """Return the history of a search; a camera that follows draws two more silhouettes a trial."""
    each = FOLLOWING if view is not None and any(view.moves) else 1
    drawings = each * np.append(entries[:, 0], total).astype(np.int64)
    return History(problem, drawings, np.append(entries[:, 1], entries[-1, 1]))
