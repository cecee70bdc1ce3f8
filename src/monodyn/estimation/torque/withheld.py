"""Rows kept back: how well what was found from the others explains them.

A model with more unknowns follows any record more closely. Whether it is right shows in rows that it has not
seen: the unknowns are found without them and held there, and only the start state is found again, so that no
error of it grows along a motion that is hard to predict.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.estimation.record.samples import Data, cut
from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.shoot import Optimum, Route, choose_substeps, fit_pieces, typical
from monodyn.optimize import SearchSettings

WITHHELD = 0.2
"""Share of the measured rows of each record that is kept back, once at its beginning, once at its end."""
FEWEST_WITHHELD = 10
"""Rows that are kept back of a record at least: a start state alone explains fewer."""
AGAIN = SearchSettings(evaluations=20, decrease=1e-3, relative=1e-4)
"""For the unknowns without the rows that are kept back, which are not far from those with them."""
WHOLE_RECORD = 10**9
"""Samples in a piece that no record is as long as."""


def withheld_errors(
    problem: Problem, optimum: Optimum, smoothed: tuple[Smoothed, ...], route: Route
) -> tuple[float, ...]:
    """Return the errors of rows that the unknowns were found without, the beginnings and the ends of records.

    Args:
        problem: The problem.
        optimum: Its optimum with all rows.
        smoothed: Smooth motion of each record, for start states.
        route: How exact the search is.

    Returns:
        Rms error of each in units of the stated noise, infinite where the motion does not follow; none
        where the records are too short.
    """
    errors = []
    trial = optimum.trial
    states = problem.moving(trial.x)(trial.runs, trial.substeps)
    for first, rest in _splits(problem.data):
        x = _found(problem, optimum.x, rest, states, smoothed, route, held=False).x
        shown = _found(problem, x, first, states, smoothed, route, held=True)
        # a few gross errors do not decide between models: the bounded ones count as four typical residuals
        residuals = shown.residuals[problem.data.part(first).measured]
        bound = 4.0 * max(shown.sigma, 1.0)
        size = float(np.sqrt(np.mean(np.clip(residuals, -bound, bound) ** 2)))
        errors.append(size if np.isfinite(shown.cost) else float("inf"))
    return tuple(errors)


def _found(
    problem: Problem,
    x: np.ndarray,
    rows: np.ndarray,
    states: np.ndarray,
    smoothed: tuple[Smoothed, ...],
    route: Route,
    *,
    held: bool,
) -> Optimum:
    """Fit some rows, from unknowns near to theirs and from the motion that was found for all rows, or from
    the smooth one where that is nearer."""
    part = problem.with_data(problem.data.part(rows))
    smooth = part.started(x, cut(part.data, WHOLE_RECORD), smoothed)
    own = smooth.at(x, states[rows][smooth.pieces.first[:-1]])
    tried = [
        replace(start, substeps=choose_substeps(part, start, route.error_bound)[0]) for start in (own, smooth)
    ]
    start = min(tried, key=lambda start: typical(part.residuals(start), part.data.measured))
    return fit_pieces(part, start, route, AGAIN, held=held)


def _splits(data: Data) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the rows that are kept back and the others, for the beginnings and for the ends of records."""
    splits = []
    for ends in (True, False):
        back, others = [], []
        for begin, stop in zip(data.first[:-1], data.first[1:], strict=True):
            used = begin + np.flatnonzero(data.measured[begin:stop].any(axis=1))
            count = round(WITHHELD * len(used))
            if count < FEWEST_WITHHELD:
                return []
            # either part begins at a measured row, because its start state is taken from smooth motion there
            middle = int(used[-count] if ends else used[count])
            first, second = np.arange(begin, middle), np.arange(middle, stop)
            back.append(second if ends else first)
            others.append(first if ends else second)
        splits.append((np.concatenate(back), np.concatenate(others)))
    return splits
