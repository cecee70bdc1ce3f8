"""A fit in, draws of its posterior out, where sizes are assumed that nothing measures.

What is assumed of such sizes leaves them open by factors, over which the motion is far from linear in them:
the covariance at the optimum gives intervals that miss. Draws follow the posterior where it is bent.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from monodyn.estimation.shooting.prior import size_ratios
from monodyn.estimation.verdict.refine import Refined
from monodyn.estimation.verdict.regrouped import Trees
from monodyn.estimation.verdict.surrogate import Surrogate, surrogate_of
from monodyn.mechanism.plan import OWNED_COLUMNS
from monodyn.optimize import Draws, randomized

DRAWS, SEED = 1500, 0
"""Draws, and the seed of their noise."""
LEAST_EFFECTIVE = 100.0
"""Draws of equal weight that they have to be worth."""
SIDES = (0.025, 0.975)
"""Shares of the draws below the ends of an interval."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """Weighted draws of what may be true.

    Attributes:
        unknowns: Values of the unknowns, (draw, param).
        values: Values of all parameters of the mechanism's plan by name, (draw,) each.
        trees: The joint trees.
        weights: Weights of the draws, (draw,), of sum one.
    """

    unknowns: np.ndarray
    values: dict[str, np.ndarray]
    trees: Trees
    weights: np.ndarray

    def interval(self, drawn: np.ndarray) -> tuple[float, float]:
        """Return the ends of the 95 % interval of a quantity.

        Args:
            drawn: Its value in every draw, (draw,).
        """
        order = np.argsort(drawn)
        # the middle of each draw's share: the ends lie where the shares beyond them are those wanted
        below = np.cumsum(self.weights[order]) - 0.5 * self.weights[order]
        low, high = np.interp(SIDES, below, drawn[order])
        return float(low), float(high)


def posterior(found: Refined) -> Posterior | None:
    """Draw from the posterior of a fit.

    Args:
        found: The optimum, and what is known there.

    Returns:
        The draws; None where the covariance stands for it: where no size is assumed, the motion depends on
        more than the regrouped inertias, or too few draws were found.
    """
    problem, optimum = found.weighted, found.optimum
    if not size_ratios(problem.mechanism, problem.unknowns):
        return None
    surrogate = surrogate_of(problem, optimum.trial, optimum.at_bound)
    if surrogate is None:
        return None
    draws = randomized(
        surrogate.rows, surrogate.peak(), _noise(surrogate, found.freedom), reach=surrogate.reach
    )
    # Bounds cut intervals, not draws: a friction that is zero in truth lies at the edge of what is possible,
    # and to leave out what lies beyond would shift all else.
    return _drawn(surrogate, draws) if draws.effective >= LEAST_EFFECTIVE else None


def _noise(surrogate: Surrogate, freedom: float) -> np.ndarray:
    """Draw the residuals' noise, (draw, row).

    The same draws serve every fit, so that what they lack by chance would shift all intervals alike: each
    residual takes every part of its distribution once, and no two are correlated.

    Source:
        McKay, Beckman and Conover, A comparison of three methods for selecting values of input variables,
        1979 (Latin hypercubes).
    """
    rng = np.random.default_rng(SEED)
    measured, assumed = len(surrogate.level), len(surrogate.aims)
    each = np.array([NormalDist().inv_cdf((i + 0.5) / DRAWS) for i in range(DRAWS)])
    parts = np.tile(each[:, None], measured + assumed)
    noise = rng.permuted(parts, axis=0)
    noise = np.linalg.solve(np.linalg.cholesky(noise.T @ noise / DRAWS), noise.T).T
    # the size of the record's noise is known from so many residuals only
    noise[:, :measured] *= np.sqrt(freedom / rng.chisquare(freedom, size=(DRAWS, 1)))
    # a shift of all positions is no noise: it moves the optimum as a whole
    noise[:, :measured] += rng.normal(size=(DRAWS, surrogate.shift.shape[1])) @ surrogate.shift.T
    return noise


def _drawn(surrogate: Surrogate, draws: Draws) -> Posterior:
    """Bring draws to what follows from them."""
    points, weights = draws.points[draws.weights > 0], draws.weights[draws.weights > 0]
    mechanism = surrogate.sizes.problem.mechanism
    numbers, trees = surrogate.sizes.at(points)
    values = dict(zip(mechanism.plan.table.names, numbers, strict=True))
    for i, rows in enumerate(mechanism.plan.owned):
        for row, column in zip(rows or (), OWNED_COLUMNS, strict=False):
            values[mechanism.plan.table.names[row]] = trees.links[i, column]
    return Posterior(surrogate.sizes.unknowns(points), values, trees, weights)
