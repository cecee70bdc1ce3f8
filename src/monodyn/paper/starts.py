"""Starts for the published local search: poses spread over the joint ranges, or an evolutionary search.

A start is a pose and a set of sizes before the camera that gives its silhouette the seen area and centroid
(eq. 1 and 2); starts are ranked by the mismatch (eq. 3).
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from monodyn.paper.placed import drawn, placed_mismatch
from monodyn.paper.subproblems import FOLLOWING, fit_pose
from monodyn.paper.view import Seen, View, X
from monodyn.vision.drawing.camera import DEPTH, FOCAL
from monodyn.vision.drawing.silhouette import pose_mismatch

BUDGET = 12_000
"""Poses drawn by one spread, by joint."""
COARSEST = 4
"""Fewest values of each joint in a grid of poses."""
PATTERNED = 3
"""Most lengths whose proportions are tried."""
LENGTHS = (0.6, 1.7)
"""Factors on one length against the others."""
WIDTHS = (0.4, 1.0, 2.5)
"""Factors on all widths against the lengths."""
APART = 0.5
"""Starts differ by this angle at some hinge [rad]."""
ANGLES, BEAM = 48, 10
"""Positions tried a joint, and partial poses kept, where the camera is known."""
GENERATIONS, SEEDS = 80, 4
"""Length and number of the evolutionary searches."""


def spread_starts(image: Seen, view: View, count: int) -> tuple[list[View], int]:
    """Return the best of poses and proportions spread over their ranges, each unlike the others.

    Args:
        image: The seen silhouette, maybe reduced.
        view: The mechanism before a camera of the same size.
        count: Starts at the most.

    Returns:
        The starts, and the silhouettes drawn.
    """
    patterns = _patterns(view)
    poses = _grid(image, view, max(1, BUDGET * len(view.position) // len(patterns)))
    costs, places, sizes = [], [], []
    for pattern in patterns:
        own = _scaled(image, view, pattern, poses[0])
        cost, place = _ranked(image, view, own, poses)
        costs.append(cost)
        places.append(place)
        sizes += [own] * len(poses)
    cost, place, many = np.concatenate(costs), np.concatenate(places), np.tile(poses, (len(patterns), 1))
    picks: list[int] = []
    for i in np.argsort(cost, kind="stable"):
        if all(_apart(view, many[i], many[j]) for j in picks):
            picks.append(int(i))
        if len(picks) == count:
            break
    starts = [_start(view, sizes[i], many[i], place[i]) for i in picks]
    return starts, FOLLOWING * len(many)


def evolved_starts(image: Seen, view: View, count: int = SEEDS, *, seed: int = 0) -> tuple[list[View], int]:
    """Return the ends of evolutionary searches over pose and proportions, each of other random numbers.

    Args:
        image: The seen silhouette, maybe reduced.
        view: The mechanism before a camera of the same size.
        count: Number of searches.
        seed: Seed of all of them; no two seeds share a search.

    Returns:
        The starts, and the silhouettes drawn.

    Source:
        The 2012 paper, discussion: an evolutionary search narrows the search space before the local one.
    """
    from monodyn.optimize.evolution import evolve

    low, high = _ranges(image, view)
    dofs = len(low)
    fold = np.log(3.0)
    lower, upper = (
        np.append(low, np.full(len(view.names), -fold)),
        np.append(high, np.full(len(view.names), fold)),
    )

    def gaps(candidates: np.ndarray) -> np.ndarray:
        return np.array([
            _ranked(image, view, _bounded(view, np.exp(x[dofs:])), x[np.newaxis, :dofs])[0][0]
            for x in np.ascontiguousarray(candidates.T)
        ])  # fmt: skip

    starts, drawings = [], 0
    for own in range(count * seed, count * (seed + 1)):
        found = evolve(
            gaps, lower, upper, seed=own, population=12 * len(lower), generations=GENERATIONS, many=True
        )
        pose, sizes = found.x[:dofs].copy(), _bounded(view, np.exp(found.x[dofs:]))
        place = _ranked(image, view, sizes, pose[np.newaxis])[1]
        starts.append(_start(view, sizes, pose, place[0]))
        drawings += FOLLOWING * found.evaluations
    return starts, drawings


def spread_pose(
    image: Seen, view: View, *, lower: np.ndarray | None = None, upper: np.ndarray | None = None
) -> tuple[View, float, int]:
    """Find the pose (3) from starts spread over the joint ranges, before a camera that is known.

    The starts are laid into the silhouette link by link: the best partial poses go on.

    Args:
        image: The seen silhouette.
        view: The mechanism; its camera stays.
        lower: Lower limits, (dof,); default the joints' own.
        upper: Upper limits, (dof,).

    Returns:
        The mechanism in the pose, its mismatch [px^2], and the silhouettes drawn.
    """
    view = replace(view, moves=(False, False, False))
    rig = view.rig
    low, high = _ranges(image, view)
    low, high = (low if lower is None else lower), (high if upper is None else upper)
    poses, costs, evaluations = np.clip(np.zeros((1, len(low))), low, high), np.zeros(1), 0
    for i in range(len(low)):
        turn = high[i] - low[i] >= 2.0 * np.pi - 1e-9 and rig.kind[i] == 0
        values = np.linspace(low[i], high[i], ANGLES, endpoint=not turn)
        grid = np.repeat(poses, len(values), axis=0)
        grid[:, i] = np.tile(values, len(poses))
        geoms = int(np.sum(rig.link <= i))
        costs = pose_mismatch(image.sums, rig, grid, geoms)
        evaluations += len(grid)
        poses = grid[np.argsort(costs, kind="stable")]
        poses = _unlike(poses, i, (high[i] - low[i]) / ANGLES)[:BEAM]
    found: list[tuple[View, float]] = []
    for pose in poses[:3]:
        fitted, history = fit_pose(image, replace(view, position=pose), lower=low, upper=high)
        found.append((fitted, float(history.values[-1])))
        evaluations += int(history.evaluations[-1])
    best, least = min(found, key=lambda pair: pair[1])
    return best, least, evaluations


def _unlike(poses: np.ndarray, joint: int, step: float) -> np.ndarray:
    """Return the poses, the best first, that do not differ from a better one by neighbouring values alone."""
    kept: list[np.ndarray] = []
    for pose in poses[: 6 * BEAM]:
        others = [k for k in kept if np.array_equal(k[:joint], pose[:joint])]
        if all(abs(k[joint] - pose[joint]) > 1.5 * step for k in others):
            kept.append(pose)
    return np.array(kept)


def _ranges(image: Seen, view: View) -> tuple[np.ndarray, np.ndarray]:
    """Return the joint ranges: one turn, or across the picture, where there are no limits."""
    camera = view.base.camera
    width = 0.75 * (image.sums.shape[1] - 1) * float(camera[DEPTH] / camera[FOCAL])
    half = np.where(view.base.kind == 0, np.pi, width)
    lower, upper = view.limits
    return np.where(np.isfinite(lower), lower, -half), np.where(np.isfinite(upper), upper, half)


def _grid(image: Seen, view: View, most: int) -> np.ndarray:
    """Return poses spread evenly over the joint ranges, (pose, dof): a grid, scattered where it is coarse."""
    low, high = _ranges(image, view)
    moving = int(np.sum(high > low))
    each = int(most ** (1.0 / max(moving, 1)))
    if each < COARSEST:
        from scipy.stats.qmc import Halton

        return low + (high - low) * Halton(len(low), scramble=False).random(most)
    axes = []
    for i in range(len(low)):
        turn = view.base.kind[i] == 0 and high[i] - low[i] >= 2.0 * np.pi - 1e-9
        count = min(each, 72) if high[i] > low[i] else 1
        axes.append(np.linspace(low[i], high[i], count, endpoint=not turn))
    return np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)


def _patterns(view: View) -> list[np.ndarray]:
    """Return factors on the sizes to try: each length longer or shorter, all widths wider or thinner."""
    names = (*view.names, view.reference) if view.reference else view.names
    lengths = [name for name in names if name.endswith(".length")]
    widths = np.array([name.endswith(".width") for name in names], dtype=bool)
    shapes = [np.ones(len(names))]
    if 1 < len(lengths) <= PATTERNED:
        for name, factor in itertools.product(lengths, LENGTHS):
            shapes.append(np.where([own == name for own in names], factor, 1.0))
    out = []
    for shape, wider in itertools.product(shapes, WIDTHS if widths.any() else (1.0,)):
        whole = shape * np.where(widths, wider, 1.0)
        out.append(whole[:-1] / whole[-1] if view.reference else whole)
    return out


def _scaled(image: Seen, view: View, pattern: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return the sizes of a pattern; where the depth is known they give the seen area."""
    sizes = _bounded(view, pattern)
    if not view.moves[2] and len(sizes):
        area = float(drawn(image.moments[:1], view.rig_with(sizes), pose)[0])
        sizes = np.clip(sizes * np.sqrt(image.area / max(area, 1.0)), view.lower, view.upper)
    return sizes


def _bounded(view: View, factors: np.ndarray) -> np.ndarray:
    return np.clip(view.sizes * factors, view.lower, view.upper)


def _ranked(image: Seen, view: View, sizes: np.ndarray, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mismatch of poses before cameras that follow, and the cameras' places."""
    facts = np.array([image.area, image.x, image.y])
    return placed_mismatch(
        image.sums, image.moments, view.rig_with(sizes), poses, facts, np.array(view.moves)
    )


def _apart(view: View, a: np.ndarray, b: np.ndarray) -> bool:
    """Return whether two poses differ visibly at some hinge."""
    turn = (a - b + np.pi) % (2.0 * np.pi) - np.pi
    return bool(np.any(np.abs(turn[view.base.kind == 0]) > APART)) or not np.any(view.base.kind == 0)


def _start(view: View, sizes: np.ndarray, pose: np.ndarray, place: np.ndarray) -> View:
    camera = view.base.camera.copy()
    camera[X : X + 3] = place
    return replace(view, sizes=sizes, position=pose).before(camera)
