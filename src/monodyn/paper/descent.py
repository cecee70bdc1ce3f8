"""Starts and bounds of the published least squares in, the best end of its search out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from monodyn.estimation.record.smooth import Smoothed
from monodyn.optimize import Exhausted, Minimum
from monodyn.paper.fit_bounds import bounded
from monodyn.paper.fit_starts import LED_STEPS, fit_starts, led
from monodyn.paper.fixed_start import FixedStart, Rollouts
from monodyn.paper.modes import WEAKEST_MODE, modes
from monodyn.paper.pose_series import PoseSeries
from monodyn.paper.settings import PaperIdentifySettings
from monodyn.types import Progress

NOISE_SHARE = 1e-3
"""The search ends when the cost falls by less than this share of what the stated noise alone costs."""
FIRST_PART = 1.5
"""Values in the first of these parts under a Fourier series for each unknown, at least."""
LONGER_BY = 8
"""Samples by which the part of a record that is fitted grows, at least."""
FOLLOWED_SHARE = 0.5
"""A part under a Fourier series grows as far as the motion is followed within this share of its size."""
MOST_FOR_A_PART = {"friction": 800, "fourier": 800, "free": 2500}
"""Evaluations of residuals or Jacobian for each of those parts, at most."""
PART_STEPS = {"friction": 8, "fourier": 4, "free": LED_STEPS}
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
"""Gradients of a quasi-Newton search for one evaluation of a Gauss-Newton search."""
MOST_ROLLOUTS = 20000
"""Rollouts from all starts after which no step is taken; those that judge the end come on top."""
CLOSE_SHARE = {"friction": 0.02, "fourier": 0.2, "free": 0.02}
"""A start is good, and no other is tried, when the rms residual is below this share of the motion."""


@dataclass(frozen=True, eq=False)
class Descent:
    """Where the search ended.

    Attributes:
        fixed: The problem, with the scales and integration steps of the search.
        x: Coordinates, (param,).
        bounds: Lower and upper bounds of the coordinates, (2, param).
        evaluations: Rollouts of the search from all starts, those of its Jacobians included.
        converged: True when the search reached its minimum.
        tried: Starts that were tried.
        error: Integration error [rad or m].
        spent: True when the evaluations that the settings allow ended it, and more would take it further.
    """

    fixed: FixedStart
    x: np.ndarray
    bounds: np.ndarray
    evaluations: int
    converged: bool
    tried: int
    error: float
    spent: bool = False

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

    Without torques over time each start is fitted to the whole record and, where that does not explain it, to
    parts of it that grow: over a long motion the least squares have many minima, over a short one few.

    Args:
        fixed: The problem; its scales and integration steps are chosen here.
        smoothed: Smooth motion of each record.
        series: The Fourier series of the poses, or None.
        settings: Starts, seed, evaluations (each as many rollouts as forward differences take, several
            times), error bound.
        progress: Called as ``progress("identify", rollouts, None)`` every few hundred rollouts.

    Returns:
        The best end, or None where no start can be simulated.
    """
    torque = fixed.problem.mechanism.torque
    close = CLOSE_SHARE[torque] * fixed.problem.data.motion_size
    fixed, best, tried = replace(fixed, rollouts=Rollouts(progress)), None, 0
    ways = (False, True) if torque == "friction" else (True,)
    begun = enumerate(fit_starts(fixed, smoothed, series, settings), 1)
    for number, x, grown in ((number, x, grown) for number, x in begun for grown in ways):
        tried = number
        found = _search(fixed, x, smoothed, settings, grown=grown)
        if found is not None:
            best = found if best is None or found.size < best.size else best
        near = found is not None and bool((_rms(found) < close).all())
        if near or fixed.rollouts.spent >= MOST_ROLLOUTS:
            break
    if best is None:
        return None
    # what looks at the end is no part of the search, and is not counted with it
    ended = replace(best.fixed, rollouts=Rollouts())
    return replace(best, fixed=ended, evaluations=fixed.rollouts.spent, tried=tried)


def _rms(found: Descent) -> np.ndarray:
    """Root mean square of simulated less measured positions in the record's units, (dof,)."""
    problem = found.fixed.problem
    difference = np.where(problem.data.measured, found.fixed.motion(found.x) - problem.data.position, np.nan)
    return np.sqrt(np.nanmean(difference**2, axis=0))


def _search(
    fixed: FixedStart,
    x: np.ndarray,
    smoothed: tuple[Smoothed, ...],
    settings: PaperIdentifySettings,
    *,
    grown: bool,
) -> Descent | None:
    """Search from one start, in parts that grow or at once; again where the end needs more integration steps
    than the start did."""
    fixed, bounds = bounded(fixed, x, smoothed)
    # of angles beyond all sense no loads can be computed
    if not np.isfinite(fixed.scale).all():
        return None
    x, rollouts, converged = np.clip(x, *bounds), fixed.rollouts, False
    driven = fixed.problem.mechanism.torque != "friction"
    in_one, began = GRADIENT_EVALUATIONS * settings.evaluations * (len(x) + 1), fixed.rollouts.spent
    if grown:
        x = _in_parts(fixed, x, bounds, smoothed[0], began + min(in_one, (MOST_ROLLOUTS - began) // 2))
    # the start may move slowly and the end fast: the steps that the end needs are only known there
    error, most = np.inf, fixed.jacobian_rollouts
    # a part or a search ends where its next Jacobian would take more; more is never allowed than in all
    spent = driven and in_one < (MOST_ROLLOUTS - began) // 2 and rollouts.spent + most >= began + in_one
    for turn in range(3):
        substeps, error = fixed.least_substeps(x, settings.error_bound)
        if (turn or driven) and substeps <= fixed.substeps:
            break
        fixed = replace(fixed, substeps=max(substeps, fixed.substeps))
        until = min(rollouts.spent + in_one, MOST_ROLLOUTS)
        if until - rollouts.spent <= len(x):
            break
        end = _minimum(fixed, x, bounds, until)
        if not np.isfinite(end.value):
            return None
        x, converged = end.x, end.converged
        spent = spent or (until < MOST_ROLLOUTS and rollouts.spent + most >= until)
    return Descent(fixed, x, bounds, rollouts.spent - began, converged, 1, error, spent)


def _in_parts(
    fixed: FixedStart, x: np.ndarray, bounds: np.ndarray, smoothed: Smoothed, until: int
) -> np.ndarray:
    """Fit to the first samples of each record, then to more; free torques are led on from where they fit."""
    data, torque, rollouts = fixed.problem.data, fixed.problem.mechanism.torque, fixed.rollouts
    rows, of_record = (
        int(np.diff(data.first).max()),
        np.arange(len(data.times)) - data.by_row(data.first[:-1]),
    )
    fixed, stop = replace(fixed, substeps=PART_STEPS[torque]), LONGER_BY
    # half of the evaluations are Jacobians, of which each may take many rollouts
    in_part = MOST_FOR_A_PART[torque] * (1 + fixed.jacobian_rollouts) // 2
    if torque == "fourier":
        # with fewer values than unknowns the search would wander off along what they leave open
        stop = max(stop, int(np.ceil(FIRST_PART * len(x) / fixed.target.shape[1])))
    # the rest of free torques is left to the steps of the whole record; a series is first fitted with few
    last = rows + LONGER_BY if torque == "fourier" else rows - 1
    while stop < last and rollouts.spent < until:
        # NaN in the target leaves a row out; torques after it move nothing that is compared
        late = (of_record >= stop)[:, None]
        part = replace(fixed, target=np.where(late, np.nan, fixed.target))
        if not np.isfinite(part.residuals(x)).all():
            break
        # with the whole record in few steps most of the way is gone before many steps are taken
        whole = stop >= rows
        allowed = until if whole else min(rollouts.spent + in_part, until)
        x = _minimum(part, x, bounds, allowed, whole=whole).x
        if torque == "free":
            ahead = led(fixed, x, smoothed, stop)
            x = x if ahead is None else np.clip(ahead, *bounds)
        elif whole:
            break
        stop = max(stop + LONGER_BY, _followed(fixed, x) if torque == "fourier" else 0)
    return x


def _followed(fixed: FixedStart, x: np.ndarray) -> int:
    """Return the first row at which the simulated motion is off by a large share of its size."""
    with np.errstate(invalid="ignore"):
        off = np.abs(fixed.residuals(x)) > FOLLOWED_SHARE * np.nanstd(fixed.target, axis=0)
    lost = off.any(axis=1)
    return int(np.argmax(lost)) if lost.any() else len(lost)


def _minimum(
    fixed: FixedStart, x: np.ndarray, bounds: np.ndarray, until: int, *, whole: bool = True
) -> Minimum:
    """Search within bounds (2, param); under a torque over time in directions taken anew until none gains.

    No step is taken once as many rollouts are spent as ``until`` says.

    A search is at a minimum when the step of Gauss and Newton from there gains next to nothing: the solver
    itself cannot tell, because in a long valley its steps end early.
    """
    torque, directions = fixed.problem.mechanism.torque, _directions(fixed, x)
    if torque == "friction":
        end = _searched(fixed, x, bounds, directions, (until, _tolerance(fixed, x)))
        near = np.isfinite(end.value) and _gain(fixed, end.x, bounds, directions) < SHORT_SHARE
        return replace(end, converged=end.converged and bool(near))
    turns, damping = 0, 1.0
    while True:
        limit = PART_TOLERANCE if torque == "fourier" and not whole else _tolerance(fixed, x)
        end = _searched(fixed, x, bounds, directions, (until, limit))
        before, after = (float(np.sum(fixed.residuals(at) ** 2)) for at in (x, end.x))
        # steps along weak modes are long, and where they leave what is linear they gain nothing: damp them
        damping = 1.0 if after < (1.0 - PART_TOLERANCE) * before else damping * MORE_DAMPING
        turns, x = turns + 1, end.x
        near = _gain(fixed, x, bounds, _directions(fixed, x)) < PART_TOLERANCE
        if near or turns >= MOST_TURNS or fixed.rollouts.spent >= until:
            return replace(end, converged=near)
        directions = _directions(fixed, x, damping)


def _searched(
    fixed: FixedStart,
    x: np.ndarray,
    bounds: np.ndarray,
    directions: np.ndarray,
    limits: tuple[int, float],
) -> Minimum:
    """Search once by the paper's solver, along directions (param, param) from ``x``.

    ``limits`` are the rollouts of the whole search after which it ends, and the tolerance.

    Directions of torques are combinations of them, whose bounds are kept by the penalty.
    """
    from monodyn.optimize import bounded_bfgs

    turned, until, tolerance = fixed.problem.unknowns.of_kind("torque"), *limits
    lengths = np.where(turned, 1.0, np.diag(directions))
    low, high = (
        np.where(turned, side, (end - x) / lengths)
        for side, end in zip((-np.inf, np.inf), bounds, strict=True)
    )

    # Bounds of single torques are no bounds of their modes. Beyond them the torque stays at its bound, and
    # how far it is beyond is one more residual, so that the search finds its way back.
    weight = float(np.linalg.norm(fixed.residuals(x))) / fixed.scale[turned]

    rollouts = fixed.rollouts
    # the start itself is always looked at
    until = max(until, rollouts.spent + 1)

    def residuals(z: np.ndarray) -> np.ndarray:
        at = x + directions @ z
        within = np.clip(at, *bounds)
        if rollouts.spent >= until:
            raise Exhausted
        return np.append(fixed.residuals(within), weight * (at - within)[turned])

    def slopes(z: np.ndarray) -> np.ndarray:
        # by differences a Jacobian takes many rollouts, of which the solver knows nothing
        if rollouts.spent + fixed.jacobian_rollouts > until:
            raise Exhausted
        at = x + directions @ z
        within = np.clip(at, *bounds)
        outside = turned & (at != within)
        along = fixed.jacobian(within).reshape(-1, len(x)) @ (directions * ~outside[:, None])
        beyond = (directions * outside[:, None])[turned] * weight[:, None]
        return np.concatenate((along, beyond))

    end = bounded_bfgs(
        residuals, np.zeros(len(x)), (low, high), most=until - rollouts.spent, tolerance=tolerance,
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
    # without an effect, or where the motion overflows, torques have no modes to take
    if not (np.isfinite(along).all() and along[:, turned].any()):
        return np.diag(fixed.scale)
    weakest = min(damping * WEAKEST_MODE[fixed.problem.mechanism.torque], 1.0)
    return fixed.scale[:, None] * modes(along, turned, weakest)


def _gain(fixed: FixedStart, x: np.ndarray, bounds: np.ndarray, directions: np.ndarray) -> float:
    """Share of the cost, or of the noise's, by which a step of Gauss and Newton would lower it."""
    residuals, turned = fixed.residuals(x).ravel(), fixed.problem.unknowns.of_kind("torque")
    along = fixed.jacobian(x).reshape(-1, len(x))
    if not (np.isfinite(along).all() and np.isfinite(residuals).all()):
        return np.inf

    def held(slope: np.ndarray) -> np.ndarray:
        # an unknown at a bound from which the cost falls outward stays there
        return np.where(slope > 0, x <= bounds[0], x >= bounds[1])

    # a direction combines many torques: those that are held do not move along it, the others do
    along = along @ (directions * ~(turned & held(along.T @ residuals))[:, None])
    along = along[:, turned | ~held(along.T @ residuals)]
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
