"""A further link that nobody has measured: from the beginning of a record to all of it.

Over a few samples the motion of the others has few valleys in where the hidden link is and how fast it turns.
All around is tried; what comes closest is carried on over a longer and longer part of the record, each time
from where the last one ended, so that the hidden link is always known where the part grows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from monodyn.estimation.record.samples import Pieces
from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.search import residual_size
from monodyn.estimation.shooting.shoot import ROUGH, Optimum, Route, fit_pieces
from monodyn.estimation.shooting.trial import Trial

FIRST = 2
"""Usual first pieces in the beginning with which the search begins."""
GROWTH = 1.25
"""Factor by which the part grows."""
AROUND = 12
"""Angles of the hidden link that are tried, evenly around."""
RATES = (0.0, 1.0, -1.0)
"""Rates of it that are tried, in units of the last hinge's usual one."""
CARRIED = 6
"""Motions that are carried on."""
ALIKE = 0.2
"""Start angles of the hidden link that differ by less are one motion [rad]."""
LOOSE = 0.5
"""Standard deviation of the logarithms of sizes and masses about the start, while only a part is fitted: a
short part determines few of them."""
LOST = 30.0
"""Size of the residuals, in units of the noise, beyond which no motion is carried on."""


def hanging(problem: Problem, smoothed: Smoothed, route: Route) -> Optimum | None:
    """Fit a record whose last joint, a hinge, was not measured.

    Args:
        problem: The problem, of one record.
        smoothed: Its smooth motion, of which the last joint's does not count.
        route: How to search.

    Returns:
        The best optimum of the whole record; None where no motion of the hidden link follows a part of it.
    """
    rows = len(problem.data.times)
    logarithms = np.diag(np.where(problem.unknowns.log, LOOSE**-2, 0.0))
    loose = replace(problem, prior=problem.prior.assuming(logarithms))
    x, part = problem.unknowns.x0, min(FIRST * route.piece, rows)
    tried = [(x, state) for state in _states(problem, smoothed)]
    while True:
        here = problem if part == rows else loose.with_data(loose.data.part(np.arange(part)))
        whole = Pieces(np.array([0, part]), np.zeros(1, dtype=int))
        # what is new of a part is far off to begin with, which is no gross error
        ended = [
            fit_pieces(here, Trial(x, state[None], whole), route, ROUGH, robust=False) for x, state in tried
        ]
        best = _different(sorted(ended, key=residual_size))
        if not best:
            return None
        if part == rows:
            return best[0]
        tried = [(found.x, found.trial.states[0]) for found in best]
        part = min(int(np.ceil(GROWTH * part)), rows)


def _states(problem: Problem, smoothed: Smoothed) -> list[np.ndarray]:
    """Return the states of the first row that are tried, (2 dof,) each."""
    whole = Pieces(np.array([0, len(problem.data.times)]), np.zeros(1, dtype=int))
    start = problem.started(problem.unknowns.x0, whole, (smoothed,)).states[0]
    hinge = [k for k, joint in enumerate(problem.mechanism.joints[:-1]) if joint.kind == "hinge"]
    usual = float(np.sqrt(np.mean(smoothed.velocity[:, hinge[-1]] ** 2))) if hinge else 0.0
    found, dofs = [], len(problem.mechanism.joints)
    for angle, rate in product(2.0 * np.pi * np.arange(AROUND) / AROUND, RATES):
        state = start.copy()
        state[[dofs - 1, -1]] = angle, rate * usual
        found.append(state)
    return found


def _different(ended: Sequence[Optimum]) -> list[Optimum]:
    """Return the best motions that are not lost and differ in where the hidden link begins, best first."""
    found: list[Optimum] = []
    for one in ended:
        if not np.isfinite(one.cost) or residual_size(one) > LOST:
            continue
        if all(
            abs(np.remainder(_angle(one) - _angle(k) + np.pi, 2.0 * np.pi) - np.pi) > ALIKE for k in found
        ):
            found.append(one)
    return found[:CARRIED]


def _angle(optimum: Optimum) -> float:
    return float(optimum.trial.states[0, optimum.trial.states.shape[1] // 2 - 1])
