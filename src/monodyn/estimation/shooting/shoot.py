"""From a naive start to the optimum: match accelerations, then fit pieces of the records, longer and longer.

A single rollout through a whole record has a cost with many valleys; a rollout through ten samples has one.
Each piece has its own start state, so the first fit cannot go far wrong; joining pieces two by two then
carries the parameters, ever better known, to one rollout a record.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from monodyn.estimation.record.samples import Pieces, cut, merge
from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.shooting.problem import Problem
from monodyn.mechanism.simulate import least_substeps
from monodyn.optimize import Arrow, SearchSettings, minimize_arrow

MOST_SUBSTEPS = 64
ROUGH = SearchSettings(evaluations=40, decrease=1e-2, relative=1e-3)
"""For stages whose result is only a start: chi-square within 1 %."""


@dataclass(frozen=True, eq=False)
class Route:
    """How to search: fixed numbers of the settings.

    Attributes:
        piece: Measured samples in the first pieces.
        error_bound: Largest integration error [rad or m].
        fine: When the last search stops.
    """

    piece: int
    error_bound: float
    fine: SearchSettings


@dataclass(frozen=True, eq=False)
class Grown:
    """Where a route ended.

    Attributes:
        x: Coordinates, (param,).
        states: Start states, one row a piece, (piece, 2 dof).
        pieces: How the records are cut; one piece a record when the route got to its end.
        substeps: Integration steps between stamps.
        residuals: Whitened residuals, (row, dof).
        cost: Cost, with the loss that bounds the pull of gross errors.
        sigma: Typical size of a whitened residual.
        evaluations: Evaluations of the model.
        converged: True when the last search reached its minimum.
        at_bound: True for unknowns on a bound, (param,).
    """

    x: np.ndarray
    states: np.ndarray
    pieces: Pieces
    substeps: int
    residuals: np.ndarray
    cost: float
    sigma: float
    evaluations: int
    converged: bool
    at_bound: np.ndarray

    @property
    def complete(self) -> bool:
        """True when one rollout goes through each record."""
        return self.pieces.whole and bool(np.isfinite(self.cost))


def grow(
    problem: Problem,
    x: np.ndarray,
    smoothed: tuple[Smoothed, ...],
    route: Route,
    progress: Callable[[Grown], None] | None = None,
    hopeless: Callable[[Grown], bool] | None = None,
) -> Grown:
    """Fit pieces of the records, then longer ones, until one rollout goes through each record.

    Args:
        problem: The problem.
        x: First coordinates, (param,).
        smoothed: Smooth motion of each record, for the start states.
        route: How to search.
        progress: Called with the result of each stage.
        hopeless: Asked after the first stage; when it says True the route ends there.

    Returns:
        The fit of one piece a record, or of the first pieces when they are hopeless; its ``cost`` is infinite
        where a stage could not be evaluated.
    """
    pieces = cut(problem.data, route.piece)
    states = problem.start_states(x, pieces, smoothed)
    evaluations = 0
    while True:
        stage = fit_pieces(problem, x, states, pieces, route, ROUGH)
        x, states, evaluations = stage.x, stage.states, evaluations + stage.evaluations
        if progress is not None:
            progress(stage)
        if hopeless is not None and hopeless(stage):
            return replace(stage, evaluations=evaluations)
        hopeless = None
        if not np.isfinite(stage.cost) or pieces.whole:
            break
        pieces, kept = merge(pieces)
        states = states[kept]
    if np.isfinite(stage.cost):
        stage = fit_pieces(problem, x, states, pieces, route, route.fine)
        evaluations += stage.evaluations
    return replace(stage, evaluations=evaluations)


def fit_pieces(
    problem: Problem,
    x: np.ndarray,
    states: np.ndarray,
    pieces: Pieces,
    route: Route,
    search: SearchSettings,
    *,
    robust: bool = True,
    held: bool = False,
) -> Grown:
    """Fit shared unknowns and start states with the records cut as they are.

    Args:
        problem: The problem.
        x: First coordinates, (param,).
        states: First start states, (piece, 2 dof).
        pieces: How the records are cut.
        route: Gives the bound of the integration error.
        search: When to stop.
        robust: Bound the pull of samples beyond four typical residuals.
        held: Hold the shared unknowns and fit the start states alone.

    Returns:
        The fit; its ``cost`` is infinite where the start cannot be evaluated.
    """
    substeps, _ = choose_substeps(problem, x, states, pieces, route.error_bound)
    ahead: tuple[np.ndarray, np.ndarray] | None = problem.rows(x, states, pieces, substeps)
    sigma = typical(ahead[0], problem.data.measured)
    limit = 4.0 * max(1.0, sigma) if robust else 0.0
    lower, upper = (x, x) if held else (problem.unknowns.lower, problem.unknowns.upper)

    def evaluate(at: np.ndarray, local: np.ndarray) -> Arrow:
        nonlocal ahead
        rows = ahead if ahead is not None else problem.rows(at, local, pieces, substeps)
        ahead = None
        return problem.model(at, rows, pieces, limit)

    found = minimize_arrow(evaluate, x, states, (lower, upper), settings=search, reach=problem.unknowns.reach)
    residuals = found.model.kept
    return Grown(
        found.shared, found.local, pieces, substeps, residuals, found.model.cost,
        typical(residuals, problem.data.measured), found.evaluations, found.converged, found.at_bound,
    )  # fmt: skip


def typical(residuals: np.ndarray, measured: np.ndarray) -> float:
    """Return the robust size of whitened residuals, 1 when they are as large as the noise says."""
    values = np.abs(residuals[measured])
    values = values[np.isfinite(values)]
    return float(np.median(values) / 0.6745) if len(values) else float("inf")


def choose_substeps(
    problem: Problem, x: np.ndarray, states: np.ndarray, pieces: Pieces, error_bound: float
) -> tuple[int, float]:
    """Choose the integration steps between stamps by doubling them until the motion no longer changes.

    Args:
        problem: The problem.
        x: Coordinates, (param,).
        states: Start states, (piece, 2 dof).
        pieces: How the records are cut; up to 24 of them are looked at.
        error_bound: Largest error [rad or m].

    Returns:
        The smallest number that keeps the bound, or 64; and the largest error with it [rad or m].
    """
    pick = np.unique(np.linspace(0, len(states) - 1, 24).astype(int))
    chosen = [(int(pieces.first[k]), int(pieces.first[k + 1]), states[k]) for k in pick]
    return least_substeps(lambda steps: problem.rollouts(x, chosen, steps), error_bound, MOST_SUBSTEPS)
