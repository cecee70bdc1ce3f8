"""From first unknowns to the optimum: pieces of the records are fitted, longer and longer.

A single rollout through a whole record has a cost with many valleys; a rollout through ten samples has one.
Each piece has its own start state, so the first fit cannot go far wrong; joining pieces two by two then
carries the parameters, ever better known, to one rollout a record.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace

import numpy as np

from monodyn.estimation.record.samples import cut, merge
from monodyn.estimation.record.smooth import NORMAL, Smoothed
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.trial import Trial
from monodyn.mechanism.substeps import least_substeps
from monodyn.optimize import Arrow, SearchSettings, minimize_arrow
from monodyn.optimize.status import STALLED

MOST_SHOOTING_STEPS = 64
"""Integration steps between two time stamps at most."""
NEAR_SHARE, NEAR_ROWS = 0.1, 0.95
"""A motion is near the record, in the valley of the optimum, where all but one in twenty of its samples are
off by at most this share of the joint's motion (of 1 rad at most)."""
NEARER = 0.5
"""Where a search ends with less than this share of its first typical residual, its steps are chosen anew."""
NEAR_DAMPING = 1e-6
"""First damping where a search goes on that has ended roughly."""
AS_EXACT = 1.5
"""How far off derivatives may be, as ``simulate`` has it, over the root of the decrease at which a search
ends. They turn the gradient, so that for each unknown a decrease is promised that does not come: half the
square of what they are off by, which is about a third of that measure."""
MOST_RUNS = 24
"""Pieces by which the integration steps are chosen."""
ROUGH = SearchSettings(evaluations=40, decrease=1e-2, relative=1e-3)
"""For stages whose result is only a start: chi-square within 1 %."""


FIXED_WORK = 3000
"""Work of an evaluation beside its integration: without it a short record, whose evaluations cost about the
same whatever its rows, would be searched for minutes."""


@dataclass
class Budget:
    """What searches may evaluate together; once it is spent each of them ends where it stands.

    Attributes:
        remaining: Work that is left, integration steps times the directions in which each is differentiated;
            never a time, so that the same run ends the same anywhere.
    """

    remaining: float = np.inf


_BUDGET: ContextVar[Budget] = ContextVar("budget")


@contextmanager
def limited(work: float) -> Iterator[Budget]:
    """Limit what all searches inside may evaluate together.

    Args:
        work: As a budget counts it.

    Yields:
        The budget.
    """
    budget = Budget(work)
    token = _BUDGET.set(budget)
    try:
        yield budget
    finally:
        _BUDGET.reset(token)


@dataclass(frozen=True, eq=False)
class Route:
    """How to search: fixed numbers of the settings.

    Attributes:
        piece: Measured samples in the first pieces.
        error_bound: Largest integration error [rad or m].
        fine: When the last search stops.
        share: Integration error that is allowed beyond, as a share of the typical residual.
    """

    piece: int
    error_bound: float
    fine: SearchSettings
    share: float = 0.0


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where a search ended.

    Attributes:
        trial: The best unknowns and start states; one piece a record when the search got to its end.
        residuals: Whitened residuals, (row, dof).
        cost: Cost, with the loss that bounds the pull of gross errors.
        sigma: Typical size of a whitened residual.
        evaluations: Evaluations of the model.
        converged: True when the last search reached its minimum.
        at_bound: True for unknowns on a bound, (param,).
        twins: Coordinates of other optima that the data cannot tell from this one, each (param,).
    """

    trial: Trial
    residuals: np.ndarray
    cost: float
    sigma: float
    evaluations: int
    converged: bool
    at_bound: np.ndarray
    twins: tuple[np.ndarray, ...] = ()

    @property
    def x(self) -> np.ndarray:
        """Coordinates of the shared unknowns, (param,)."""
        return self.trial.x

    @property
    def complete(self) -> bool:
        """True when one rollout goes through each record."""
        return self.trial.pieces.whole and bool(np.isfinite(self.cost))


def multiple_shooting(
    problem: Problem,
    x: np.ndarray,
    smoothed: tuple[Smoothed, ...],
    route: Route,
    progress: Callable[[Optimum], None] | None = None,
    hopeless: Callable[[Optimum], bool] | None = None,
    *,
    patient: bool = True,
    share: float = 0.0,
) -> Optimum:
    """Fit pieces of the records, then longer ones, until one rollout goes through each record.

    Args:
        problem: The problem.
        x: First coordinates, (param,).
        smoothed: Smooth motion of each record, for the start states.
        route: How to search.
        progress: Called with the result of each stage.
        hopeless: Called with the result of the first stage; when it returns True the route ends there.
        patient: Do not ask again after the stages between the first and the last.
        share: In place of the route's: the way to the right valley leads far from where the steps of a rough
            integration were chosen.

    Returns:
        The fit of one piece a record, or of the pieces that are hopeless; its ``cost`` is infinite where a
        stage could not be evaluated.

    Source:
        Bock, Recent advances in parameter identification techniques for ordinary differential equations,
        1983 (multiple shooting); here the pieces are joined by fitting longer ones, not by constraints.
    """
    trial = problem.started(x, cut(problem.data, route.piece), smoothed)
    route, evaluations = replace(route, share=share), 0
    while True:
        stage = fit_pieces(problem, trial, route, ROUGH)
        evaluations += stage.evaluations
        if progress is not None:
            progress(stage)
        trial = stage.trial
        if hopeless is not None and not trial.pieces.whole and hopeless(stage):
            return replace(stage, evaluations=evaluations)
        hopeless = None if patient else hopeless
        if not np.isfinite(stage.cost) or trial.pieces.whole:
            break
        trial = _joined(problem, trial)
    if np.isfinite(stage.cost):
        stage = fit_pieces(problem, trial, route, replace(route.fine, damping=NEAR_DAMPING))
        evaluations += stage.evaluations
    return replace(stage, evaluations=evaluations)


def _joined(problem: Problem, trial: Trial) -> Trial:
    """Join neighbouring pieces, again and again while the motion through them stays near the record.

    The shared unknowns are better known with each stage, so that the start state of the first half now
    carries the motion through both; the start state of the second half is no longer needed.
    """
    measured, hinge = problem.data.measured, np.array([j.kind == "hinge" for j in problem.mechanism.joints])
    # however often a hinge goes round, it is out of the valley after a part of a turn
    near = NEAR_SHARE * np.where(hinge, np.minimum(problem.data.motion_size, 1.0), problem.data.motion_size)
    joined = _merged(trial)
    while not joined.pieces.whole:
        longer = _merged(joined)
        off = np.abs(problem.differences(longer))
        if np.mean((off <= near)[measured]) < NEAR_ROWS:
            break
        joined = longer
    return joined


def _merged(trial: Trial) -> Trial:
    pieces, kept = merge(trial.pieces)
    return Trial(trial.x, trial.states[kept], pieces, trial.substeps)


def fit_pieces(
    problem: Problem,
    start: Trial,
    route: Route,
    search: SearchSettings,
    *,
    robust: bool = True,
    held: np.ndarray | bool = False,
    substeps: int | None = None,
    exact: bool = False,
) -> Optimum:
    """Fit shared unknowns and start states without changing how the records are cut.

    Args:
        problem: The problem.
        start: Where the search begins; its integration steps are chosen here.
        route: Gives the bound of the integration error.
        search: When to stop.
        robust: Bound the pull of samples beyond four typical residuals.
        held: True for shared unknowns that stay as they are, (param,), or for all of them.
        substeps: Integration steps that the start needs, where they have been chosen.
        exact: The derivatives are those of the very rollouts from the start; else they become so where the
            search makes no way without.

    Returns:
        The fit; its ``cost`` is infinite where the start cannot be evaluated.
    """
    start = _searched(start, substeps or _substeps(problem, start, route), 0.0 if exact else most_off(search))
    # the rows of the start give the typical residual, and are then those of the search's first evaluation
    sigma = typical(problem.rows(start)[0], problem.data.measured)
    limit = 4.0 * max(1.0, sigma) if robust else 0.0
    unknowns, budget = problem.unknowns, _BUDGET.get(Budget())
    directions = start.states.shape[1] + int(np.count_nonzero(~np.broadcast_to(held, start.x.shape)))
    work = FIXED_WORK + int(start.pieces.first[-1]) * start.substeps * directions
    most = int(min(search.evaluations, max(budget.remaining / work, 1.0)))
    lower, upper = np.where(held, start.x, unknowns.lower), np.where(held, start.x, unknowns.upper)

    def evaluate(at: np.ndarray, local: np.ndarray) -> Arrow:
        same = np.array_equal(at, start.x) and np.array_equal(local, start.states)
        trial = start if same else start.at(at, local)
        model = problem.model(at, problem.rows(trial), start.pieces, limit)
        return replace(model, kept=(*model.kept, trial))

    def bend(
        model: Arrow, at: np.ndarray, local: np.ndarray, step: np.ndarray, local_step: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        return problem.bend(model, start.at(at, local), (step, local_step), limit)

    # the start states are eliminated piece by piece, so that a step costs no more for many pieces
    found = minimize_arrow(
        evaluate, start.x, start.states, (lower, upper), settings=replace(search, evaluations=most),
        reach=unknowns.reach, bend=bend,
    )  # fmt: skip
    budget.remaining -= found.evaluations * work
    residuals, _, trial = found.model.kept
    ended = Optimum(
        trial, residuals, found.model.cost, typical(residuals, problem.data.measured), found.evaluations,
        found.converged, found.at_bound,
    )  # fmt: skip
    if found.status == STALLED and start.most_off > 0.0:
        # what the derivatives are off by is all that is left to gain
        nearby = replace(search, damping=NEAR_DAMPING)
        again = fit_pieces(
            problem, ended.trial, route, nearby, robust=robust, held=held, substeps=start.substeps, exact=True
        )
        ended = replace(again, evaluations=again.evaluations + ended.evaluations)
    # what was exact enough for where it began may not be for where it ended, much nearer to the record
    nearer = route.share > 0.0 and ended.sigma < NEARER * sigma
    if nearer and _substeps(problem, ended.trial, route) > ended.trial.substeps:
        again = fit_pieces(problem, ended.trial, route, search, robust=robust, held=held)
        return replace(again, evaluations=again.evaluations + ended.evaluations)
    return ended


def most_off(search: SearchSettings) -> float:
    """Return how far off derivatives may be for a search to end where it should, as ``simulate`` has it.

    Args:
        search: When it stops.
    """
    return AS_EXACT * float(np.sqrt(search.decrease))


def _searched(trial: Trial, substeps: int, off: float) -> Trial:
    """Return a trial with the integration steps and the exactness of a search, itself where it has them."""
    if trial.substeps == substeps and trial.most_off == off:
        return trial
    return replace(trial, substeps=substeps, most_off=off)


def _substeps(problem: Problem, trial: Trial, route: Route) -> int:
    """Choose the integration steps for a search that begins at a trial.

    Far from the record there is no point in an exact motion: its error has to be small against what it is off
    by.
    """
    bound = route.error_bound
    if route.share:
        off = route.share * float(typical_differences(problem, trial).min())
        bound = max(bound, off) if np.isfinite(off) else bound
    return choose_substeps(problem, trial, bound)[0]


def with_proportions(problem: Problem, optimum: Optimum) -> tuple[Problem, Optimum]:
    """Take sizes that nothing measures for unknowns about in the file's proportion, at an optimum.

    The search takes them to be exactly in it: motion moves them little, and along curved valleys.

    Args:
        problem: The problem.
        optimum: Its optimum.

    Returns:
        The problem with them, and the same optimum as a point of it.
    """
    if problem.near or problem.mechanism.torque == "free":
        # all sizes are given under free torques
        return problem, optimum
    larger = replace(posed(problem.mechanism, problem.data, near=True), base=problem.base)
    x = larger.unknowns.carried(optimum.x, problem.unknowns)
    at_bound = np.isin(larger.unknowns.names, np.array(problem.unknowns.names)[optimum.at_bound])
    return larger, replace(optimum, trial=optimum.trial.at(x, optimum.trial.states), at_bound=at_bound)


def typical(residuals: np.ndarray, measured: np.ndarray) -> float:
    """Return the robust size of residuals; that of whitened ones is 1 when they are as large as the noise.

    Args:
        residuals: Residuals, (row, dof).
        measured: True where they count, (row, dof).
    """
    # the median does not see gross errors, and 0.6745 makes it the standard deviation of normal noise
    values = np.abs(residuals[measured])
    values = values[np.isfinite(values)]
    return float(np.median(values) / NORMAL) if len(values) else float("inf")


def typical_differences(problem: Problem, trial: Trial) -> np.ndarray:
    """Return the robust size of measured less simulated positions of each joint.

    Args:
        problem: The problem.
        trial: Unknowns and start states.

    Returns:
        Sizes in the record's units [rad or m], (dof,).
    """
    difference = problem.differences(trial)
    return np.array(
        [typical(difference[:, [j]], use[:, None]) for j, use in enumerate(problem.data.measured.T)]
    )


def relative_difference(problem: Problem, trial: Trial) -> float:
    """Return the largest typical difference of any joint, as a share of its motion.

    Args:
        problem: The problem.
        trial: Unknowns and start states.
    """
    moved = np.maximum(problem.data.motion_size, 1e-12)
    return float((typical_differences(problem, trial) / moved).max())


def choose_substeps(
    problem: Problem,
    trial: Trial,
    error_bound: float,
    tried: Callable[[int], object] = lambda _: None,
) -> tuple[int, float]:
    """Choose the integration steps between stamps by doubling them until the motion no longer changes.

    Args:
        problem: The problem.
        trial: Unknowns and start states; up to ``MOST_RUNS`` of its pieces are integrated.
        error_bound: Largest error [rad or m].
        tried: Called with each number of steps by which the motion is integrated.

    Returns:
        The smallest number that keeps the bound, or 64; and the largest error with it [rad or m].
    """
    runs = trial.runs
    # the same mechanism in other states: a few pieces, evenly chosen, stand for all
    pick = np.unique(np.linspace(0, len(runs) - 1, MOST_RUNS).astype(int))
    chosen = [runs[k] for k in pick]
    moving, dofs = problem.moving(trial.x), problem.data.position.shape[1]
    least = max((torque.parts for torque in problem.data.torques), default=1)

    def positions(steps: int) -> np.ndarray:
        tried(steps)
        return moving(chosen, steps)[:, :dofs]

    return least_substeps(positions, error_bound, MOST_SHOOTING_STEPS, least)
