"""Starts for the published local search: poses over the joint ranges, or the ends of an evolutionary search.

A start is a pose and a set of sizes before the camera that gives its silhouette the seen area and centroid
(eq. 1 and 2), in closed form; starts are ranked by the mismatch (eq. 3). This initialization is ours: the
paper starts from any suitable one.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from monodyn.mechanism.tree import HINGE
from monodyn.paper.placed import drawn, placed_mismatch
from monodyn.paper.subproblems import PLACED_DRAWINGS, fit_pose
from monodyn.paper.view import CAMERA_HELD, ModelView, SilhouetteImage
from monodyn.vision.drawing.camera import DEPTH, FOCAL, X
from monodyn.vision.drawing.mismatch import pose_mismatch

GRID_POSES = 12_000
"""Poses of one grid, by joint."""
COARSEST = 4
"""Fewest values of each joint in a grid of poses; with fewer the poses are scattered."""
FINEST = 72
"""Most values of a joint in a grid of poses: five degrees of a turn."""
MOST_PROPORTIONED = 3
"""Most lengths whose proportions are tried."""
LENGTH_FACTORS = (0.6, 1.7)
"""Factors on one length against the others."""
WIDTH_FACTORS = (0.4, 1.0, 2.5)
"""Factors on all widths against the lengths."""
APART_ANGLE = 0.5
"""Starts differ by this angle at some hinge [rad]."""
SLIDE_SHARE = 0.75
"""A slide without limits reaches over this share of the picture's width to either side."""
BEAM_VALUES, BEAM_POSES = 48, 10
"""Positions tried a joint, and partial poses kept, where the camera is known."""
BEAM_CANDIDATES = 6
"""Partial poses that are compared with one another, for each one that is kept."""
BEAM_FINALISTS = 3
"""Poses that the local search goes on from."""
GENERATIONS, EVOLUTIONS = 80, 4
"""Length and number of the evolutionary searches."""
POPULATION = 12
"""Candidates of a generation, by unknown."""
EVOLVED_FACTOR = 3.0
"""Sizes evolve within this factor, up or down."""


def grid_starts(image: SilhouetteImage, view: ModelView, count: int) -> tuple[list[ModelView], int]:
    """Return the best of poses and proportions over their ranges, each unlike the others.

    Args:
        image: The seen silhouette, maybe reduced.
        view: The mechanism before a camera of the same size.
        count: Starts at most.

    Returns:
        The starts, and the number of silhouettes drawn.
    """
    patterns = _patterns(view)
    poses = _grid(image, view, max(1, GRID_POSES * len(view.position) // len(patterns)))
    costs, places, sizes = [], [], []
    for pattern in patterns:
        own = _scaled(image, view, pattern, poses[0])
        cost, place = _ranked(image, view, own, poses)
        costs.append(cost)
        places.append(place)
        sizes += [own] * len(poses)
    cost, place, many = np.concatenate(costs), np.concatenate(places), np.tile(poses, (len(patterns), 1))
    picks: list[int] = []
    # neighbours in the grid lead to the same minimum: a start counts only if it is unlike all better ones
    for i in np.argsort(cost, kind="stable"):
        if all(_apart(view, many[i], many[j]) for j in picks):
            picks.append(int(i))
        if len(picks) == count:
            break
    starts = [_start(view, sizes[i], many[i], place[i]) for i in picks]
    return starts, PLACED_DRAWINGS * len(many)


def evolved_starts(
    image: SilhouetteImage, view: ModelView, count: int = EVOLUTIONS, *, seed: int = 0
) -> tuple[list[ModelView], int]:
    """Return the ends of evolutionary searches over pose and proportions, each of other random numbers.

    Args:
        image: The seen silhouette, maybe reduced.
        view: The mechanism before a camera of the same size.
        count: Number of searches.
        seed: Seed of all of them; no two seeds share a search.

    Returns:
        The starts, and the number of silhouettes drawn.

    Source:
        The 2012 paper, discussion: an evolutionary search narrows the search space before the local one.
    """
    from monodyn.optimize.evolution import evolve

    low, high = _ranges(image, view)
    dofs = len(low)
    # the unknowns are the joint positions, then the logarithms of the factors on the sizes; the reference
    # stays, because the placed camera takes up the common scale
    fold = np.array([0.0 if p is view.reference else np.log(EVOLVED_FACTOR) for p in view.searched])
    lower, upper = np.append(low, -fold), np.append(high, fold)
    gaps = _candidate_gaps(image, view, dofs)
    starts, drawings = [], 0
    for own in range(count * seed, count * (seed + 1)):
        found = evolve(
            gaps, (lower, upper), seed=own, population=POPULATION * len(lower), generations=GENERATIONS
        )
        pose, sizes = found.x[:dofs].copy(), _bounded(view, np.exp(found.x[dofs:]))
        place = _ranked(image, view, sizes, pose[np.newaxis])[1]
        starts.append(_start(view, sizes, pose, place[0]))
        drawings += PLACED_DRAWINGS * found.evaluations
    return starts, drawings


def _candidate_gaps(image: SilhouetteImage, view: ModelView, dofs: int) -> Callable[[np.ndarray], np.ndarray]:
    """Return the objective of the evolution: candidates (unknown, candidate) to mismatches (candidate,)."""

    def gap(x: np.ndarray) -> float:
        sizes = _bounded(view, np.exp(x[dofs:]))
        return _ranked(image, view, sizes, x[np.newaxis, :dofs])[0][0]

    return lambda candidates: np.array([gap(x) for x in np.ascontiguousarray(candidates.T)])


def pose_by_beam(
    image: SilhouetteImage, view: ModelView, limits: np.ndarray | None = None
) -> tuple[ModelView, float, int]:
    """Find the pose (3) anywhere within the joint ranges, before a camera that is known.

    The starts are laid into the silhouette link by link: the best partial poses go on (beam search).

    Args:
        image: The seen silhouette.
        view: The mechanism; its camera stays.
        limits: Lower and upper limits, (2, dof); default the joints' own.

    Returns:
        The mechanism in the pose, its mismatch [px^2], and the number of silhouettes drawn.
    """
    view = replace(view, free=CAMERA_HELD)
    rig = view.rig
    low, high = _ranges(image, view) if limits is None else limits
    poses, evaluations = np.clip(np.zeros((1, len(low))), low, high), 0
    for i in range(len(low)):
        values = _values(view, i, low[i], high[i], BEAM_VALUES)
        grid = np.repeat(poses, len(values), axis=0)
        grid[:, i] = np.tile(values, len(poses))
        # links further out have no position yet; only the geoms up to this link are drawn and compared
        geoms = int(np.sum(rig.link <= i))
        costs = pose_mismatch(image.sums, rig, grid, geoms)
        evaluations += len(grid)
        poses = grid[np.argsort(costs, kind="stable")]
        poses = _unlike(poses, i, (high[i] - low[i]) / BEAM_VALUES)[:BEAM_POSES]
    found: list[tuple[ModelView, float]] = []
    for pose in poses[:BEAM_FINALISTS]:
        fitted, history = fit_pose(image, replace(view, position=pose), limits=np.array([low, high]))
        found.append((fitted, float(history.values[-1])))
        evaluations += int(history.evaluations[-1])
    best, least = min(found, key=lambda pair: pair[1])
    return best, least, evaluations


def _unlike(poses: np.ndarray, joint: int, step: float) -> np.ndarray:
    """Return the poses, the best first, without those that neighbour a better one.

    Poses are neighbours when they agree in the joints before and differ by one value of this joint. Without
    this the beam would fill up with one minimum, and lose the others before the links further out decide.
    """
    kept: list[np.ndarray] = []
    for pose in poses[: BEAM_CANDIDATES * BEAM_POSES]:
        others = [k for k in kept if np.array_equal(k[:joint], pose[:joint])]
        if all(abs(k[joint] - pose[joint]) > 1.5 * step for k in others):
            kept.append(pose)
    return np.array(kept)


def _ranges(image: SilhouetteImage, view: ModelView) -> tuple[np.ndarray, np.ndarray]:
    """Return the joint ranges: one turn, or across the picture, where there are no limits."""
    camera = view.base.camera
    width = SLIDE_SHARE * (image.sums.shape[1] - 1) * float(camera[DEPTH] / camera[FOCAL])
    half = np.where(view.base.kind == HINGE, np.pi, width)
    lower, upper = view.limits
    return np.where(np.isfinite(lower), lower, -half), np.where(np.isfinite(upper), upper, half)


def _values(view: ModelView, joint: int, low: float, high: float, count: int) -> np.ndarray:
    """Return evenly spaced positions of a joint, (count,); the two ends of a whole turn count once."""
    turn = view.base.kind[joint] == HINGE and high - low >= 2.0 * np.pi - 1e-9
    return np.linspace(low, high, count, endpoint=not turn)


def _grid(image: SilhouetteImage, view: ModelView, most: int) -> np.ndarray:
    """Return poses spread evenly over the joint ranges, (pose, dof): a grid, scattered where it is coarse."""
    low, high = _ranges(image, view)
    moving = int(np.sum(high > low))
    each = int(most ** (1.0 / max(moving, 1)))
    if each < COARSEST:
        # with many joints a grid has too few values of each; a low-discrepancy sequence has all different
        from scipy.stats.qmc import Halton

        return low + (high - low) * Halton(len(low), scramble=False).random(most)
    counts = np.where(high > low, min(each, FINEST), 1)
    axes = [_values(view, i, low[i], high[i], int(counts[i])) for i in range(len(low))]
    return np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)


def _patterns(view: ModelView) -> list[np.ndarray]:
    """Return factors on the sizes to try: each length longer or shorter, all widths wider or thinner."""
    held = () if view.reference is None or view.reference in view.searched else (view.reference,)
    sizes = (*view.searched, *held)
    lengths = [p for p in sizes if p.kind == "length"]
    widths = np.array([p.kind == "width" for p in sizes], dtype=bool)
    shapes = [np.ones(len(sizes))]
    if 1 < len(lengths) <= MOST_PROPORTIONED:
        for length, factor in itertools.product(lengths, LENGTH_FACTORS):
            shapes.append(np.where([own is length for own in sizes], factor, 1.0))
    out = []
    for shape, wider in itertools.product(shapes, WIDTH_FACTORS if widths.any() else (1.0,)):
        whole = shape * np.where(widths, wider, 1.0)
        # the reference does not change: a factor on it is its inverse on all others
        own = 1.0 if view.reference is None else whole[sizes.index(view.reference)]
        out.append(whole[: len(view.searched)] / own)
    return out


def _scaled(image: SilhouetteImage, view: ModelView, pattern: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return the sizes of a pattern; where the depth is known they give the seen area."""
    sizes = _bounded(view, pattern)
    if not view.free.depth and len(sizes):
        area = float(drawn(image.moments[:1], view.rig_with(sizes), pose)[0])
        sizes = np.clip(sizes * np.sqrt(image.area / max(area, 1.0)), view.lower, view.upper)
    return sizes


def _bounded(view: ModelView, factors: np.ndarray) -> np.ndarray:
    return np.clip(view.sizes * factors, view.lower, view.upper)


def _ranked(
    image: SilhouetteImage, view: ModelView, sizes: np.ndarray, poses: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the mismatch of poses, each before the camera that is placed for it, and the cameras' places."""
    rig = view.rig_with(sizes)
    return placed_mismatch(image.sums, image.moments, rig, poses, image.target, view.free)


def _apart(view: ModelView, a: np.ndarray, b: np.ndarray) -> bool:
    """Return whether two poses differ visibly at some hinge."""
    turn = (a - b + np.pi) % (2.0 * np.pi) - np.pi
    hinge = view.base.kind == HINGE
    return bool(np.any(np.abs(turn[hinge]) > APART_ANGLE)) or not np.any(hinge)


def _start(view: ModelView, sizes: np.ndarray, pose: np.ndarray, place: np.ndarray) -> ModelView:
    camera = view.base.camera.copy()
    camera[X : DEPTH + 1] = place
    return replace(view, sizes=sizes, position=pose).before(camera)
