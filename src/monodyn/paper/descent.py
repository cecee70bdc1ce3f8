"""Starts and bounds of the published least squares in, the best end of its search out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.shooting.shoot import choose_substeps
from monodyn.optimize import Minimum
from monodyn.paper.fit_bounds import bounded
from monodyn.paper.fit_starts import LED_STEPS, fit_starts, led
from monodyn.paper.fixed_start import FixedStart
from monodyn.paper.modes import WEAKEST_MODE, modes
from monodyn.paper.pose_series import PoseSeries
from monodyn.paper.settings import PaperIdentifySettings
from monodyn.types import Progress

NOISE_SHARE = 1e-3
"""The search ends when the cost falls by less than this share of what the stated noise alone costs."""
FIRST_PART = 1.5
"""Values in the first of these parts under a Fourier series for each unknown, at least."""
LONGER_BY = 8
"""Samples by which the part of a record that torques over time are fitted to grows, at least."""
FOLLOWED_SHARE = 0.5
"""A part under a Fourier series grows as far as the motion is followed within this share of its size."""
MOST_FOR_A_PART = {"fourier": 800, "free": 2500}
"""Rollouts for each of those parts, at most."""
PART_STEPS = {"fourier": 4, "free": LED_STEPS}
"""Integration steps between stamps in those parts."""
PART_TOLERANCE = 1e-2
"""Nor, for a part under a Fourier series or in new directions, for less than this share."""
TOLERANCE = 1e-4
"""No search goes on for less than this share of the cost."""
LEAST_EFFECT = 1e-4
"""Directions of less effect than this share of the strongest are left out of that step."""
SHORT_SHARE = 0.1
"""A search is short of a minimum where a step of Gauss and Newton would lower the cost by this share."""
MORE_DAMPING = 5.0
"""Factor by which weak modes count as stronger after a search that gained next to nothing."""
MOST_TURNS = 10
"""Times that the directions of a search under torques over time are taken anew, at most."""
GRADIENT_EVALUATIONS = 4
"""Evaluations of a quasi-Newton search for one of a Gauss-Newton search."""
MOST_ROLLOUTS = 20000
"""Rollouts from all starts, at most."""
SHOWN_EVERY = 50
"""Progress is shown each time after this many rollouts."""
CLOSE_SHARE = {"friction": 0.02, "fourier": 0.2, "free": 0.02}
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
    series: PoseSeries | None,
    settings: PaperIdentifySettings,
    progress: Progress | None = None,
) -> Descent | None:
    """Search from one start after the other until the motion is explained.

    Args:
        fixed: The problem; its scales and integration steps are chosen here.
        smoothed: Smooth motion of each record.
        series: The Fourier series of the poses, or None.
        settings: Starts, seed, evaluations (each as many rollouts as a gradient takes), error bound.
        progress: Called as ``progress("identify", rollouts, None)`` every few hundred rollouts.

    Returns:
        The best end, or None where no start can be simulated.
    """
    close = CLOSE_SHARE[fixed.problem.mechanism.torque] * fixed.problem.data.motion_size
    best: Descent | None = None
    evaluations, tried, tick = 0, 0, _ticker(progress)
    for x in fit_starts(fixed, smoothed, series, settings):
        found = _search(fixed, x, smoothed, settings, MOST_ROLLOUTS - evaluations, tick)
        tried += 1
        if found is not None:
            evaluations += found.evaluations
            best = found if best is None or found.size < best.size else best
        if evaluations >= MOST_ROLLOUTS or (found is not None and (_rms(found) < close).all()):
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
    settings: PaperIdentifySettings,
    most: int,
    tick: Callable[[], None],
) -> Descent | None:
    """Search from one start; again where the end needs more integration steps than the start did."""
    fixed, bounds = bounded(fixed, x, smoothed)
    x = np.clip(x, *bounds)
    evaluations, converged = 0, False
    in_one = GRADIENT_EVALUATIONS * settings.evaluations * (len(x) + 1)
    if fixed.problem.mechanism.torque != "friction":
        x, evaluations = _in_parts(fixed, x, bounds, smoothed[0], min(in_one, most // 2), tick)
    # the start may move slowly and the end fast: the steps that the end needs are only known there
    error = np.inf
    for _ in range(3):
        substeps, error = choose_substeps(fixed.problem, fixed.trial(x), settings.error_bound)
        if evaluations and substeps <= fixed.substeps:
            break
        fixed = replace(fixed, substeps=max(substeps, fixed.substeps))
        allowed = min(in_one, most - evaluations)
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
    """Fit torques over time to the first samples, then to more; free ones are led on from where they fit."""
    rows, evaluations, torque = len(fixed.problem.data.times), 0, fixed.problem.mechanism.torque
    fixed, stop = replace(fixed, substeps=PART_STEPS[torque]), LONGER_BY
    if torque == "fourier":
        # with fewer values than unknowns the search would wander off along what they leave open
        stop = max(stop, int(np.ceil(FIRST_PART * len(x) / fixed.target.shape[1])))
    # the rest of free torques is left to the steps of the whole record; a series is first fitted with few
    last = rows + LONGER_BY if torque == "fourier" else rows - 1
    while stop < last and evaluations < most:
        # NaN in the target leaves a row out; torques after it move nothing that is compared
        late = (np.arange(rows) >= stop)[:, None]
        part = replace(fixed, target=np.where(late, np.nan, fixed.target))
        if not np.isfinite(part.residuals(x)).all():
            break
        # with the whole record in few steps most of the way is gone before many steps are taken
        whole = stop >= rows
        allowed = most - evaluations if whole else min(MOST_FOR_A_PART[torque], most - evaluations)
        end = _minimum(part, x, bounds, allowed, tick, whole=whole)
        evaluations += end.evaluations
        x = end.x
        if torque == "free":
            x = np.clip(led(fixed, x, smoothed, stop), *bounds)
        elif whole:
            break
        stop = max(stop + LONGER_BY, _followed(fixed, x) if torque == "fourier" else 0)
    return x, evaluations


def _followed(fixed: FixedStart, x: np.ndarray) -> int:
    """Return the first row at which the simulated motion is off by a large share of its size."""
    with np.errstate(invalid="ignore"):
        off = np.abs(fixed.residuals(x)) > FOLLOWED_SHARE * np.nanstd(fixed.target, axis=0)
    lost = off.any(axis=1)
    return int(np.argmax(lost)) if lost.any() else len(lost)


def _minimum(
    fixed: FixedStart,
    x: np.ndarray,
    bounds: np.ndarray,
    most: int,
    tick: Callable[[], None],
    *,
    whole: bool = True,
) -> Minimum:
    """Search within bounds (2, param); under a torque over time in directions taken anew until none gains.

    A search is at a minimum when the step of Gauss and Newton from there gains next to nothing: the solver
    itself cannot tell, because in a long valley its steps end early.
    """
    torque, directions = fixed.problem.mechanism.torque, _directions(fixed, x)
    if torque == "friction":
        end = _searched(fixed, x, bounds, directions, (most, _tolerance(fixed, x)), tick)
        near = np.isfinite(end.value) and _gain(fixed, end.x, bounds, directions) < SHORT_SHARE
        return replace(end, converged=end.converged and bool(near))
    spent, turns, damping = 1, 0, 1.0
    while True:
        limit = PART_TOLERANCE if torque == "fourier" and not whole else _tolerance(fixed, x)
        end = _searched(fixed, x, bounds, directions, (max(most - spent, len(x) + 2), limit), tick)
        before, after = (float(np.sum(fixed.residuals(at) ** 2)) for at in (x, end.x))
        # steps along weak modes are long, and where they leave what is linear they gain nothing: damp them
        damping = 1.0 if after < (1.0 - PART_TOLERANCE) * before else damping * MORE_DAMPING
        spent, turns, x = spent + end.evaluations + 1, turns + 1, end.x
        near = _gain(fixed, x, bounds, _directions(fixed, x)) < PART_TOLERANCE
        if near or turns >= MOST_TURNS or spent >= most:
            return replace(end, evaluations=spent, converged=near)
        directions = _directions(fixed, x, damping)


def _searched(
    fixed: FixedStart,
    x: np.ndarray,
    bounds: np.ndarray,
    directions: np.ndarray,
    limits: tuple[int, float],
    tick: Callable[[], None],
) -> Minimum:
    """Search once by the paper's solver, along directions (param, param) from ``x``.

    Directions of torques are combinations of them, whose bounds are kept by the penalty.
    """
    from monodyn.optimize import bounded_bfgs

    turned, most, tolerance = fixed.problem.unknowns.of_kind("torque"), *limits
    lengths = np.where(turned, 1.0, np.diag(directions))
    low, high = (
        np.where(turned, side, (end - x) / lengths)
        for side, end in zip((-np.inf, np.inf), bounds, strict=True)
    )

    # Bounds of single torques are no bounds of their modes. Beyond them the torque stays at its bound, and
    # how far it is beyond is one more residual, so that the search finds its way back.
    weight = float(np.linalg.norm(fixed.residuals(x))) / fixed.scale[turned]

    def residuals(z: np.ndarray) -> np.ndarray:
        tick()
        at = x + directions @ z
        within = np.clip(at, *bounds)
        return np.append(fixed.residuals(within), weight * (at - within)[turned])

    def slopes(z: np.ndarray) -> np.ndarray:
        at = x + directions @ z
        within = np.clip(at, *bounds)
        outside = turned & (at != within)
        along = fixed.jacobian(within).reshape(-1, len(x)) @ (directions * ~outside[:, None])
        beyond = (directions * outside[:, None])[turned] * weight[:, None]
        return np.concatenate((along, beyond))

    end = bounded_bfgs(
        residuals, np.zeros(len(x)), (low, high), most=most, tolerance=tolerance,
        jacobian=slopes if turned.any() else None,
    )  # fmt: skip
    # rounding in and out of the scaled coordinates must not take an unknown off its bound
    best = x + directions @ end.x
    for bound in bounds:
        best = np.where(np.abs(best - bound) < 1e-9 * fixed.scale, bound, best)
    return replace(end, x=np.clip(best, *bounds))


def _directions(fixed: FixedStart, x: np.ndarray, damping: float = 1.0) -> np.ndarray:
    """Directions of the search, (param, param): the unknowns in their scales, torques along their modes."""
    turned = fixed.problem.unknowns.of_kind("torque")
    if not turned.any():
        return np.diag(fixed.scale)
    along = fixed.jacobian(x).reshape(-1, len(x)) * fixed.scale
    weakest = min(damping * WEAKEST_MODE[fixed.problem.mechanism.torque], 1.0)
    return fixed.scale[:, None] * modes(along, turned, weakest)


def _gain(fixed: FixedStart, x: np.ndarray, bounds: np.ndarray, directions: np.ndarray) -> float:
    """Share of the cost, or of the noise's, by which a step of Gauss and Newton would lower it."""
    residuals = fixed.residuals(x).ravel()
    along = fixed.jacobian(x).reshape(-1, len(x)) @ directions
    slope, single = along.T @ residuals, ~fixed.problem.unknowns.of_kind("torque")
    # an unknown at a bound from which the cost falls outward stays there
    held = single & np.where(slope > 0, x <= bounds[0], x >= bounds[1])
    along = along[:, ~held]
    # directions of hardly any effect would take the step far out of where it is linear
    left, sizes, _ = np.linalg.svd(along, full_matrices=False)
    taken = left[:, sizes > LEAST_EFFECT * sizes.max(initial=0.0)].T @ residuals
    whole = max(float(residuals @ residuals), 2.0 * _noise_cost(fixed), 1e-300)
    return float(taken @ taken) / whole


def _tolerance(fixed: FixedStart, x: np.ndarray) -> float:
    """Share of the cost by less than which a step does not matter, for the stated noise."""
    cost = 0.5 * float(np.sum(fixed.residuals(x) ** 2))
    return float(np.clip(NOISE_SHARE * _noise_cost(fixed) / max(cost, 1e-300), 1e-10, TOLERANCE))


def _noise_cost(fixed: FixedStart) -> float:
    """Cost that the stated noise of the poses alone would make."""
    if fixed.white is not None:
        return 0.5 * float(np.isfinite(fixed.target).sum())
    return 0.5 * float(np.nansum(fixed.problem.data.std**2))
