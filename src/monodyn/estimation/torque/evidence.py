"""Which further unknowns are justified: they must explain more than chance would, and than what the positions
have in common does, which a picture leaves open."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from monodyn.estimation.parts import Common
from monodyn.estimation.shooting.common import common_error, less, unknown_errors
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.shoot import Optimum, Route, fit_pieces
from monodyn.mechanism import Mechanism
from monodyn.optimize import SearchSettings

EVIDENCE = 15.0
"""Twice the log likelihood that an unknown must gain; pure chance gives one on average."""
ONE_STEP = SearchSettings(evaluations=2)
"""One step: where it gains next to nothing, more of them will not gain much."""
AT_NOISE = 1.5
"""Typical residual, in units of the stated noise, up to which one step shows what there is to gain; a motion
that is explained less well is fitted to the end."""
SLOW = 1.0
"""Slow part of the residuals, in units of the stated noise, above which a model lacks something ..."""
CHANCE = 2.0
"""... and above this many standard deviations of what chance makes of residuals as large."""
FARTHEST = 4.0
"""A residual beyond this many typical ones counts as that: a gross error is no torque."""
LIKELY = 3.0
"""Deviations in one direction up to which what the positions have in common is taken for the reason; all
directions together may have one each besides."""


class Cleared(NamedTuple):
    """A fit to positions less what they have in common.

    Attributes:
        common: What that is.
        problem: The problem with such positions.
        optimum: Its optimum.
    """

    common: Common
    problem: Problem
    optimum: Optimum


def slow_part(problem: Problem, optimum: Optimum) -> float:
    """Return the size of what changes slowly in the residuals, in units of the stated noise.

    Noise of neighbouring rows has no product on average; what a model lacks has its square.

    Args:
        problem: The problem.
        optimum: Its optimum.

    Returns:
        The root of the mean product of neighbouring residuals, of the joint where it is largest; infinite
        where the motion was not followed to its end.
    """
    if not optimum.complete:
        return float("inf")
    bound = FARTHEST * max(optimum.sigma, 1.0)
    residuals = np.clip(optimum.residuals, -bound, bound)
    both = problem.data.measured[1:] & problem.data.measured[:-1]
    # the last row of a record is no neighbour of the first one of the next
    both[problem.data.first[1:-1] - 1] = False
    products = np.where(both, residuals[1:] * residuals[:-1], 0.0)
    mean = products.sum(axis=0) / np.maximum(both.sum(axis=0), 1)
    return float(np.sqrt(max(float(mean.max()), 0.0)))


def at_noise(problem: Problem, optimum: Optimum) -> bool:
    """Return whether what is left over is as fast as noise, or as small as the stated noise.

    A record may state too little noise: the mean of n products of independent residuals of size s has the
    deviation s^2 / sqrt(n).

    Args:
        problem: The problem.
        optimum: Its optimum.
    """
    rows = max(int(problem.data.measured.any(axis=1).sum()), 1)
    return slow_part(problem, optimum) ** 2 < max(SLOW**2, CHANCE * optimum.sigma**2 / np.sqrt(rows))


def cleared(problem: Problem, optimum: Optimum, route: Route) -> Cleared | None:
    """Take off what the positions have in common, where that is what an optimum leaves over.

    No drag, and no mass, should stand for a camera that is turned or a size that is off: within the errors
    that the picture states these are the simpler reason. A drag that hardly shows beside them is not found.

    Args:
        problem: The problem.
        optimum: Its optimum.
        route: How exact the search is.

    Returns:
        The fit without it; None where that leaves more than noise, where an error would be unlikely, or where
        the positions have none in common.
    """
    before = unknown_errors(problem.data)
    if before is None or not optimum.complete:
        return None
    common = common_error(problem, optimum.trial, before.mean)
    off = np.abs(common.mean)
    if off.max() > LIKELY or off @ off > LIKELY**2 + len(off):
        return None
    without = problem.with_data(less(problem.data, common.mean))
    found = fit_pieces(without, optimum.trial, route, route.fine)
    return Cleared(common, without, found) if at_noise(without, found) else None


def pays(before: Optimum, after: Optimum, added: int) -> bool:
    """Return whether the cost falls by more than chance allows, noise taken as large as the residuals are.

    Args:
        before: The optimum without the unknowns.
        after: The optimum with them.
        added: Their number.
    """
    return after.complete and gains(before, after, added)


def gains(before: Optimum, after: Optimum, added: int) -> bool:
    """Return the same as ``pays`` of fits to pieces of the records, the same of both.

    Args:
        before: The optimum without the unknowns.
        after: The optimum with them.
        added: Their number.
    """
    gain = 2.0 * (before.cost - after.cost)
    return gain > EVIDENCE * added * max(after.sigma, 1.0) ** 2


def likeliest(tried: list[tuple[Problem, Optimum]]) -> int:
    """Choose by Schwarz's criterion, which charges the logarithm of the number of samples for every unknown.

    The noise is that of the optimum which follows best.

    Args:
        tried: Problems on the same data with their optima.

    Returns:
        Place of the best of them.

    Source:
        Schwarz, Estimating the dimension of a model, 1978.
    """
    noise = max(min(optimum.sigma for _, optimum in tried), 1.0)
    # with the noise as large as the best fit leaves it, a record that states too little noise does not
    # favour a fit that misses
    criteria = [
        2.0 * optimum.cost / noise**2 + len(problem.unknowns) * np.log(problem.data.samples)
        if optimum.complete
        else np.inf
        for problem, optimum in tried
    ]
    return int(np.argmin(criteria))


def with_more_unknowns(
    problem: Problem,
    optimum: Optimum,
    mechanism: Mechanism,
    route: Route,
    begun: Mapping[str, float] | None = None,
) -> tuple[Problem, Optimum]:
    """Go on from an optimum with more unknowns: one step, to the end where it pays or much is left.

    Args:
        problem: The problem.
        optimum: Its optimum.
        mechanism: Has the further unknowns; all others start as in the problem, for its sizes are those that
            the picture knows and the record was measured in.
        route: How exact the search is.
        begun: Values at which the further unknowns begin, by name; those of the mechanism where there are
            none.

    Returns:
        The problem with them and its optimum, or what one step towards it found.
    """
    larger = problem.of(mechanism)
    x = larger.unknowns.carried(optimum.x, problem.unknowns, begun)
    start = optimum.trial.at(x, optimum.trial.states)
    # The cost is nearly quadratic about an optimum: the first step gains most of what there is to gain. Not
    # so far from the noise, where the other unknowns have taken on what the new ones should explain.
    # It is the same motion so far, and is compared with the optimum as it was integrated.
    found = fit_pieces(larger, start, route, ONE_STEP, substeps=optimum.trial.substeps)
    if pays(optimum, found, 1) or optimum.sigma > AT_NOISE:
        found = fit_pieces(larger, found.trial, route, route.fine)
    return larger, found
