"""Starts and bounds of the published least squares in, the best end of its search out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.shoot import choose_substeps
from monodyn.optimize import Minimum
from monodyn.paper.fit_bounds import bounded
from monodyn.paper.fit_starts import LED_STEPS, fit_starts, led
from monodyn.paper.fixed_start import FixedStart
from monodyn.types import Progress

NOISE_SHARE = 1e-3
"""The search ends when the cost falls by less than this share of what the stated noise alone costs."""
WEAKEST_MODE = 0.01
"""Modes of free torques below this share of the strongest are taken as that strong."""
LONGER_BY = 8
"""Samples by which the part of a record that free torques are fitted to grows."""
MOST_FOR_A_PART = 2500
"""Rollouts for each of those parts, at most."""
GRADIENT_EVALUATIONS = 4
"""Evaluations of a quasi-Newton search for one of a Gauss-Newton search."""
MOST_ROLLOUTS = 20000
"""Rollouts from all starts, at most."""
SHOWN_EVERY = 500
"""Progress is shown each time after this many rollouts."""
CLOSE_SHARE = 0.02
"""A start is good, and no other is tried, when the rms residual is below this share of the motion."""


@dataclass(frozen=True, eq=False)
class Descent:
    """Where the search ended.

    Attributes:
        fixed: The problem, with the scales and integration steps of the search.
        x: Coordinates, (param,).
        bounds: Lower and upper bounds of the coordinates, (2, param).
        evaluations: Rollouts from all starts.
        converged: True when the search reached its minimum.
        tried: Starts that were tried.
        error: Integration error [rad or m].
    """

    fixed: FixedStart
    x: np.ndarray
    bounds: np.ndarray
    evaluations: int
    converged: bool
    tried: int
    error: float

    @property
    def size(self) -> float:
        """Sum of the squares of the residuals."""
        return float(np.sum(self.fixed.residuals(self.x) ** 2))


def descend(
    fixed: FixedStart,
    smoothed: tuple[Smoothed, ...],
    start: np.ndarray | None,
    settings: IdentifySettings,
    progress: Progress | None = None,
) -> Descent | None:
    """Search from one start after the other until the motion is explained.

    Args:
        fixed: The problem; its scales and integration steps are chosen here.
        smoothed: Smooth motion of each record.
        start: Coordinates at which a torque of the period explains the accelerations, (param,), or None.
        settings: Starts, seed, evaluations (each as many rollouts as a gradient takes), error bound.
        progress: Called as ``progress("identify", rollouts, None)`` every few hundred rollouts.

    Returns:
        The best end, or None where no start can be simulated.
    """
    motion = fixed.problem.data.motion_size
    best: Descent | None = None
    evaluations, tried, tick = 0, 0, _ticker(progress)
    for x in fit_starts(fixed, smoothed, start, settings):
        found = _search(fixed, x, smoothed, settings, MOST_ROLLOUTS - evaluations, tick)
        tried += 1
        if found is not None:
            evaluations += found.evaluations
            best = found if best is None or found.size < best.size else best
        if evaluations >= MOST_ROLLOUTS or (found is not None and (_rms(found) < CLOSE_SHARE * motion).all()):
            break
    return None if best is None else replace(best, evaluations=evaluations, tried=tried)


def _ticker(progress: Progress | None) -> Callable[[], None]:
    """Return what counts rollouts and shows every few hundred of them."""
    count = 0

    def tick() -> None:
        nonlocal count
        count += 1
        if progress is not None and count % SHOWN_EVERY == 0:
            progress("identify", count, None)

    return tick


def _rms(found: Descent) -> np.ndarray:
    """Root mean square of simulated less measured positions in the record's units, (dof,)."""
    difference = found.fixed.problem.differences(found.fixed.trial(found.x))
    return np.sqrt(np.nanmean(difference**2, axis=0))


def _search(
    fixed: FixedStart,
    x: np.ndarray,
    smoothed: tuple[Smoothed, ...],
    settings: IdentifySettings,
    most: int,
    tick: Callable[[], None],
) -> Descent | None:
    """Search from one start; again where the end needs more integration steps than the start did."""
    fixed, bounds = bounded(fixed, x, smoothed)
    x = np.clip(x, *bounds)
    evaluations, converged = 0, False
    if fixed.problem.mechanism.torque == "free":
        x, evaluations = _in_parts(fixed, x, bounds, smoothed[0], most // 2, tick)
    # the start may move slowly and the end fast: the steps that the end needs are only known there
    error = np.inf
    for _ in range(3):
        substeps, error = choose_substeps(fixed.problem, fixed.trial(x), settings.error_bound)
        if evaluations and substeps <= fixed.substeps:
            break
        fixed = replace(fixed, substeps=max(substeps, fixed.substeps))
        allowed = min(GRADIENT_EVALUATIONS * settings.evaluations * (len(x) + 1), most - evaluations)
        if allowed <= len(x):
            break
        end = _minimum(fixed, x, bounds, allowed, tick)
        evaluations += end.evaluations
        if not np.isfinite(end.value):
            return None
        x, converged = end.x, end.converged
    return Descent(fixed, x, bounds, evaluations, converged, 1, error)


def _in_parts(
    fixed: FixedStart,
    x: np.ndarray,
    bounds: np.ndarray,
    smoothed: Smoothed,
    most: int,
    tick: Callable[[], None],
) -> tuple[np.ndarray, int]:
    """Fit free torques to the first samples, then to more, each time led on from the end of what fits."""
    rows, evaluations = len(fixed.problem.data.times), 0
    for stop in range(LONGER_BY, rows - 1, LONGER_BY):
        # NaN in the target leaves a row out; torques after it move nothing that is compared
        late = (np.arange(rows) >= stop)[:, None]
        part = replace(fixed, substeps=LED_STEPS, target=np.where(late, np.nan, fixed.target))
        if not np.isfinite(part.residuals(x)).all() or evaluations >= most:
            break
        end = _minimum(part, x, bounds, min(MOST_FOR_A_PART, most - evaluations), tick)
        evaluations += end.evaluations
        x = np.clip(led(fixed, end.x, smoothed, stop), *bounds)
    return x, evaluations


def _minimum(
    fixed: FixedStart, x: np.ndarray, bounds: np.ndarray, most: int, tick: Callable[[], None]
) -> Minimum:
    """Search within bounds (2, param) by the paper's solver, unknowns in units of their scale.

    Free torques are searched along their modes instead, of which the bounds are kept by the penalty.
    """
    from monodyn.optimize import bounded_bfgs

    free = fixed.problem.mechanism.torque == "free"
    turned = fixed.problem.unknowns.of_kind("torque") & free
    turn = fixed.scale[:, None] * _modes(fixed, x, turned)
    low, high = (
        np.where(turned, side, (end - x) / fixed.scale)
        for side, end in zip((-np.inf, np.inf), bounds, strict=True)
    )
    cost = 0.5 * float(np.sum(fixed.residuals(x) ** 2))

    # bounds of single torques are no bounds of their modes: outside of them the cost is not a number, from
    # which the search steps back
    def residuals(z: np.ndarray) -> np.ndarray:
        tick()
        at = x + turn @ z
        if ((at < bounds[0]) | (at > bounds[1]))[turned].any():
            return np.full(1, np.nan)
        return fixed.residuals(np.clip(at, *bounds)).ravel()

    tolerance = float(np.clip(NOISE_SHARE * _noise_cost(fixed) / max(cost, 1e-300), 1e-10, 1e-4))
    end = bounded_bfgs(residuals, np.zeros(len(x)), (low, high), most=most, tolerance=tolerance)
    # rounding in and out of the scaled coordinates must not take an unknown off its bound
    best = x + turn @ end.x
    for bound in bounds:
        best = np.where(np.abs(best - bound) < 1e-9 * fixed.scale, bound, best)
    return replace(end, x=np.clip(best, *bounds))


def _modes(fixed: FixedStart, x: np.ndarray, turned: np.ndarray) -> np.ndarray:
    """Directions of the unknowns, in scales, with those of ``turned`` scaled to equal effect on the motion.

    A torque early in a record moves all that follows and a late one hardly anything, and neighbours do
    nearly the same: without this a quasi-Newton search takes thousands of steps. (param, param).
    """
    modes = np.eye(len(x))
    if turned.any():
        along = fixed.jacobian(x).reshape(-1, len(x))[:, turned] * fixed.scale[turned]
        _, sizes, vectors = np.linalg.svd(along)
        # fewer rows than torques leave directions that move nothing: they count as the weakest
        sizes = np.append(sizes, np.zeros(len(vectors) - len(sizes)))
        modes[np.ix_(turned, turned)] = vectors.T / np.hypot(sizes, WEAKEST_MODE * sizes[0])
    return modes


def _noise_cost(fixed: FixedStart) -> float:
    """Cost that the stated noise of the poses alone would make."""
    if fixed.white is not None:
        return 0.5 * float(np.isfinite(fixed.target).sum())
    return 0.5 * float(np.nansum(fixed.problem.data.std**2))
