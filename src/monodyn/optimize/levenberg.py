"""Bounded Levenberg-Marquardt on normal equations with the shape of an arrow.

Some unknowns (``shared``) touch every residual, others (``local``) only those of their own block: parameters
of a mechanism against the start states of many short records. Each block is eliminated on its own, so that an
iteration costs as much as its residuals, whatever the number of blocks. A dense problem is an arrow without
blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from monodyn.optimize.status import EXHAUSTED, NOT_EVALUABLE, REACHED, STALLED

LEAST_DAMPING, MOST_DAMPING = 1e-15, 1e12
"""The least is small against what is known least, such as an assumed proportion, next to the largest slope of
a motion that doubles every error several times: damped more it would creep."""
HOLDS = 0.75
"""Share of the predicted fall of the cost that has to come for the model to count as one that holds."""
LEAST_GAIN = 1e-4
"""A step is taken when the cost falls by at least this share of what the model predicted."""
MOST_BEND = 0.75
"""Acceleration over a step, both as they move the residuals, above which it is not bent."""
LEAST_BEND = 0.005
"""The same, below which a bend is not worth an evaluation. The acceleration goes with the square of the
length: the last one tells how large the next one will be, as long as the model holds."""


@dataclass(frozen=True)
class SearchSettings:
    """When a least-squares search stops.

    Attributes:
        evaluations: Most evaluations of the residuals.
        relative: Done when the predicted decrease of the cost is below this share of the cost.
        decrease: Done when the predicted decrease of the cost is below this, in units of the cost.
        damping: First damping, relative to the squared norm of each column of the Jacobian.
    """

    evaluations: int = 100
    relative: float = 1e-12
    decrease: float = 0.0
    damping: float = 1e-3


USUAL_SEARCH = SearchSettings()


@dataclass(frozen=True, eq=False)
class Arrow:
    """The cost 1/2 r.r at one point, with its Gauss-Newton model in blocks.

    Attributes:
        cost: 1/2 r.r.
        hessian: J.J of the shared unknowns, (shared, shared).
        gradient: J.r of the shared unknowns, (shared,).
        cross: J.J of shared with local unknowns, (block, shared, local).
        local_hessian: J.J of the local unknowns, (block, local, local).
        local_gradient: J.r of the local unknowns, (block, local).
        kept: Whatever the caller wants back with the best point, such as the residuals.
    """

    cost: float
    hessian: np.ndarray
    gradient: np.ndarray
    cross: np.ndarray
    local_hessian: np.ndarray
    local_gradient: np.ndarray
    kept: Any = None

    @property
    def finite(self) -> bool:
        """True when nothing in the model is NaN or infinite."""
        from monodyn.optimize.arrow import finite

        parts = (self.hessian, self.gradient, self.cross, self.local_hessian, self.local_gradient)
        return bool(np.isfinite(self.cost)) and finite(*map(np.ascontiguousarray, parts))


@dataclass(frozen=True, eq=False)
class ArrowSolution:
    """Where a search on an arrow ended.

    Attributes:
        shared: Shared unknowns, (shared,).
        local: Local unknowns, (block, local).
        model: Cost and Gauss-Newton model there.
        status: What ended the search, one sentence.
        converged: True when no step predicts a lower cost.
        evaluations: Number of evaluations.
        at_bound: True for shared unknowns that lie on a bound, (shared,).
    """

    shared: np.ndarray
    local: np.ndarray
    model: Arrow
    status: str
    converged: bool
    evaluations: int
    at_bound: np.ndarray


Bend = Callable[[Arrow, np.ndarray, np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Gives J.r'' along a step at a model and its point: (model, shared, local, step, local step)."""
Point = tuple[np.ndarray, np.ndarray]
"""Shared and local unknowns."""


def minimize_arrow(
    evaluate: Callable[[np.ndarray, np.ndarray], Arrow | None],
    shared: np.ndarray,
    local: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    *,
    settings: SearchSettings = USUAL_SEARCH,
    reach: np.ndarray | float = np.inf,
    bend: Bend | None = None,
) -> ArrowSolution:
    """Minimize 1/2 r(shared, local).r with bounds on the shared unknowns.

    Each step solves (H + damping D) dx = -g with D the largest diagonal of H seen so far; shared unknowns
    that the step carries over a bound, or further than ``reach``, are put there and the others solved again,
    so that the step is the best one inside. A point that cannot be evaluated (None, NaN, infinite) counts as
    a rejected step. Where the residuals bend along a step, it is bent with them: narrow valleys that are
    curved are followed in few steps.

    Args:
        evaluate: Gives the model at (shared, local), or None where the residuals do not exist.
        shared: Start of the shared unknowns, (shared,), inside the bounds.
        local: Start of the local unknowns, (block, local); without bounds.
        bounds: Lower and upper bounds of the shared unknowns, (shared,) each.
        settings: When to stop.
        reach: Longest step of each shared unknown, (shared,) or one for all; above 0. A logarithm whose
            derivative fades in one direction needs one: a single step of the model can carry it so far that
            no later step brings it back.
        bend: Gives J.r'' of the second derivative of the residuals along a step, shared and local, at the
            point of a model, where that may matter; without it steps are straight.

    Returns:
        The best point found; its status is the reason why the search ended.

    Source:
        Marquardt, An algorithm for least-squares estimation of nonlinear parameters, 1963; the scaling by the
        largest diagonal is that of Moré, 1978; the bent step that of Transtrum and Sethna, Improvements to
        the Levenberg-Marquardt algorithm for nonlinear least-squares minimization, 2012 (geodesic
        acceleration).
    """
    search = _search(shared, local, bounds, settings, reach, bend)
    point = next(search)
    while True:
        try:
            point = search.send(evaluate(*point))
        except StopIteration as ended:
            return ended.value


def _search(
    shared: np.ndarray,
    local: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    settings: SearchSettings,
    reach: np.ndarray | float,
    bend: Bend | None,
) -> Generator[Point, Arrow | None, ArrowSolution]:
    """Yield the points of a search one after the other, for the model at each of them; return its end."""
    shared, local, (lower, upper) = np.array(shared, dtype=float), np.array(local, dtype=float), bounds
    model = yield shared, local
    evaluations, converged, status = 1, False, EXHAUSTED
    if model is None or not model.finite:
        model = _nowhere(len(shared), local.shape, model.kept if model else None)
        at_bound = (shared <= lower) | (shared >= upper)
        return ArrowSolution(shared, local, model, NOT_EVALUABLE, False, 1, at_bound)
    damping, scale, curved = settings.damping, _diagonals(model), np.inf
    while evaluations < settings.evaluations:
        room = np.maximum(lower - shared, -reach), np.minimum(upper - shared, reach)
        with np.errstate(over="ignore", invalid="ignore"):  # a step that overflows is rejected below
            step, local_step, predicted = damped_step(model, damping, scale, *room)
        if predicted <= settings.decrease + max(settings.relative, 1e-15) * model.cost:
            # Much damping makes every prediction small: only a step with little of it proves a minimum.
            converged = damping < 1.0
            status = REACHED if converged else STALLED
            break
        if bend is not None and np.isfinite(predicted):
            length = _length(scale, step, local_step)
            if length > 0.0 and not curved * length < LEAST_BEND:
                pull = bend(model, shared, local, step, local_step)
                more, local_more = _acceleration(model, damping, scale, room, (step, local_step), pull)
                share = _length(scale, more, local_more) / length
                # a step along which the residuals bend that much is too long for the model, bent or not
                if share <= MOST_BEND:
                    step, local_step = step + 0.5 * more, local_step + 0.5 * local_more
                curved = share / length
        at, local_at = np.minimum(np.maximum(shared + step, lower), upper), local + local_step
        trial = (yield at, local_at) if np.isfinite(predicted) else None
        evaluations += 1
        # The gain compares what happened with what the model promised: near 1 the model holds at this
        # length of step, and the damping may shrink toward a plain Gauss-Newton step.
        gain = (model.cost - trial.cost) / predicted if trial is not None and trial.finite else -np.inf
        damping = _next_damping(damping, gain)
        # nor does the last bend tell of the next one where the model did not hold
        curved = curved if gain > HOLDS else np.inf
        if gain > LEAST_GAIN and trial is not None:
            shared, local, model = at, local_at, trial
            # The scale never shrinks: a column that fades for a while does not get a longer step for it.
            now = _diagonals(model)
            scale = np.maximum(scale[0], now[0]), np.maximum(scale[1], now[1])
        elif damping > MOST_DAMPING:
            status = STALLED
            break
    at_bound = (shared <= lower) | (shared >= upper)
    return ArrowSolution(shared, local, model, status, converged, evaluations, at_bound)


def minimize_together(
    evaluate: Callable[[list[np.ndarray]], Sequence[Arrow]],
    starts: Sequence[np.ndarray],
    *,
    settings: SearchSettings = USUAL_SEARCH,
    reach: np.ndarray | float = np.inf,
) -> list[ArrowSolution]:
    """Minimize from many starts, each as ``minimize_arrow`` does without blocks, a step of all at a time.

    Args:
        evaluate: Gives the models at many points, (shared,) each.
        starts: Starts, (shared,) each.
        settings: When each search stops.
        reach: Longest step of each unknown, (shared,) or one for all.

    Returns:
        Where each of them ended.
    """
    found: dict[int, ArrowSolution] = {}
    nothing = np.zeros((0, 0))
    free = np.full(len(starts[0]), np.inf) if starts else nothing
    searches = [_search(start, nothing, (-free, free), settings, reach, None) for start in starts]
    points = {k: next(search)[0] for k, search in enumerate(searches)}
    while points:
        models = dict(zip(points, evaluate(list(points.values())), strict=True))
        points = {}
        for k, model in models.items():
            try:
                points[k] = searches[k].send(model)[0]
            except StopIteration as ended:
                found[k] = ended.value
    return [found[k] for k in range(len(starts))]


def _nowhere(size: int, local: tuple[int, ...], kept: Any) -> Arrow:
    """Return the model of a start that cannot be evaluated: infinite cost, nothing in the blocks."""
    blocks, width = local
    return Arrow(
        float("inf"), np.zeros((size, size)), np.zeros(size), np.zeros((blocks, size, width)),
        np.zeros((blocks, width, width)), np.zeros((blocks, width)), kept,
    )  # fmt: skip


def _acceleration(
    model: Arrow,
    damping: float,
    scale: tuple[np.ndarray, np.ndarray],
    room: tuple[np.ndarray, np.ndarray],
    step: tuple[np.ndarray, np.ndarray],
    pull: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the acceleration along a step, half of which undoes what the residuals bend away along it."""
    left = replace(model, gradient=pull[0], local_gradient=pull[1])
    with np.errstate(over="ignore", invalid="ignore"):
        # what is left of the room for a step counts twice for an acceleration; what used it up stays there
        met = (step[0] <= room[0]) | (step[0] >= room[1])
        below, above = (np.where(met, 0.0, 2.0 * (end - step[0])) for end in room)
        more, local_more, _ = damped_step(left, damping, scale, below, above)
    return more, local_more


def _length(scale: tuple[np.ndarray, np.ndarray], step: np.ndarray, local_step: np.ndarray) -> float:
    """Return how far a step moves the residuals, by the diagonals of the model."""
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.sqrt(np.sum(scale[0] * step**2) + np.sum(scale[1] * local_step**2)))


def damped_step(
    model: Arrow,
    damping: float,
    scale: tuple[np.ndarray, np.ndarray],
    room_below: np.ndarray,
    room_above: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Solve one damped, bounded step.

    Args:
        model: Gauss-Newton model at the point.
        damping: Share of the scale that is added to the diagonal.
        scale: Diagonals of the shared (shared,) and local (block, local) parts.
        room_below: The step is not below this, (shared,); at most 0.
        room_above: The step is not above this, (shared,); at least 0.

    Returns:
        Shared step (shared,), local step (block, local), and the decrease of the cost that the model
        predicts; that is NaN where there is no such step.
    """
    from monodyn.optimize.arrow import damped_step as solved

    parts = (
        model.hessian, model.gradient, model.cross, model.local_hessian, model.local_gradient, *scale,
        room_below, room_above,
    )  # fmt: skip
    h, g, cross, local_h, local_g, *rest = (np.ascontiguousarray(part, dtype=float) for part in parts)
    shared_scale, local_scale, below, above = rest
    return solved(h, g, cross, local_h, local_g, float(damping), shared_scale, local_scale, below, above)


def _diagonals(model: Arrow) -> tuple[np.ndarray, np.ndarray]:
    """Diagonals of the model; 1 for an unknown without influence."""
    from monodyn.optimize.arrow import diagonals

    return diagonals(np.ascontiguousarray(model.hessian), np.ascontiguousarray(model.local_hessian))


def _next_damping(damping: float, gain: float) -> float:
    """Less damping after a step that lowered the cost as predicted, more after one that did not."""
    if gain > HOLDS:
        return max(0.1 * damping, LEAST_DAMPING)
    if gain > 0.25:
        return max(0.5 * damping, LEAST_DAMPING)
    # the step is kept because the cost fell, but the model was trusted too far: the next one is shorter
    if gain > LEAST_GAIN:
        return 2.0 * damping
    # a rejected step with next to no damping would otherwise need many rejections until the damping acts
    return max(8.0 * damping, 1e-6)
