"""How well gravity is known where nobody measured it, and with it everything that follows from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from monodyn.estimation.fit import Combination, Estimate
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.shoot import Optimum
from monodyn.estimation.verdict.combinations import combinations
from monodyn.estimation.verdict.intervals import estimates
from monodyn.estimation.verdict.refine import Refined
from monodyn.estimation.verdict.uncertainty import Knowledge, knowledge_at, without_states
from monodyn.mechanism import Mechanism

_Known = TypeVar("_Known", Estimate, Combination)

GRAVITY_STD = 1.5e-3
"""Standard deviation of gravity where it is taken from a file, as a share of it: it is 9.780 to 9.832 m/s^2
at sea level, less on mountains, and the air carries a part in a thousand of what is light."""
NOTICED = 1e-3
"""Share of a standard deviation from which on what gravity adds to it is more than rounding."""


@dataclass(frozen=True)
class GravityShare:
    """What gravity adds to the standard deviations, in the unit of each.

    Attributes:
        parameters: By name, of those that follow from gravity.
        combinations: Likewise.
    """

    parameters: dict[str, float]
    combinations: dict[str, float]


def gravity_share(found: Refined) -> GravityShare:
    """Return what it adds to the standard deviations that gravity is known no better than that.

    Gravity is taken for a further unknown about the file's value. Lengths follow from it, and masses and
    forces with them; where a length or a slide tells lengths as well, the motion knows gravity better than
    that, and it adds less.

    Args:
        found: The optimum, and what is known there.
    """
    problem, optimum = found.weighted, found.optimum
    if not _taken(problem.mechanism):
        return GravityShare({}, {})
    larger = problem.of(problem.mechanism.with_choices(free=["gravity"]))
    x = larger.unknowns.carried(optimum.x, problem.unknowns)
    moved = replace(
        optimum,
        trial=optimum.trial.at(x, optimum.trial.states),
        at_bound=np.isin(larger.unknowns.names, np.array(problem.unknowns.names)[optimum.at_bound]),
    )
    known = _with_its_share(found, larger, moved)
    # of deviations alone, which do not depend on the width of an interval
    return GravityShare(
        _added(estimates(problem, optimum, found.known, 1.0), estimates(larger, moved, known, 1.0)),
        _added(combinations(problem, optimum.x, found.known, 1.0), combinations(larger, x, known, 1.0)),
    )


def _with_its_share(found: Refined, larger: Problem, moved: Optimum) -> Knowledge:
    """Return what is known with gravity as a further unknown.

    The others follow a change of its logarithm by r, which leaves residuals of squared size s for a unit of
    it; with its variance v = 1 / (1 / GRAVITY_STD^2 + s) they have the covariance v r r' in addition. (The
    covariance of all together would lose what gravity adds where a record is exact.)
    """
    problem, at = found.weighted, larger.unknowns.names.index("gravity")
    _, jacobian = larger.rows(moved.trial)
    others = np.delete(np.arange(jacobian.shape[2]), at)
    unshifted = problem.with_data(replace(problem.data, shifts=None))
    noise = knowledge_at(unshifted, found.optimum.x, jacobian[:, :, others], moved.trial.pieces)
    rows = without_states(jacobian, len(larger.unknowns), moved.trial.pieces)
    own, rest = rows[:, at], np.delete(rows, at, axis=1)
    follows = -noise.covariance @ (rest.T @ own)
    left = float(np.sum((own + rest @ follows) ** 2) + follows @ problem.prior.information @ follows)
    variance = 1.0 / (GRAVITY_STD**-2.0 + left)
    along = np.insert(follows, at, 1.0)
    known = found.known
    covariance = np.insert(np.insert(known.covariance, at, 0.0, axis=0), at, 0.0, axis=1)
    covariance += variance * np.outer(along, along)
    std = np.where(np.isinf(np.insert(known.std, at, 0.0)), np.inf, np.sqrt(np.diag(covariance)))
    return Knowledge(
        covariance,
        np.insert(known.open, at, 0.0, axis=0) if known.open.size else np.zeros((len(along), 0)),
        np.insert(known.relative, at, 1.0),
        std,
        known.full,
    )


def _taken(mechanism: Mechanism) -> bool:
    """Return whether gravity is the file's; free torques hold all sizes, whatever it is."""
    gravity = mechanism.parameter("gravity")
    held = not gravity.free and "gravity" not in mechanism.chosen
    return held and gravity.value > 0.0 and mechanism.torque != "free"


def _added(before: Sequence[_Known], after: Sequence[_Known]) -> dict[str, float]:
    """Return by name what has to be added to the standard deviations before to have those after."""
    std, found = {one.name: one.std for one in before}, {}
    for one in after:
        own = std.get(one.name, 0.0)
        if 0.0 < own < np.inf and np.isfinite(one.std) and one.std > (1.0 + NOTICED) * own:
            found[one.name] = float(np.sqrt(one.std**2 - own**2))
    return found


def with_gravity(
    parameters: Sequence[Estimate],
    found: Sequence[Combination],
    share: GravityShare,
    mechanism: Mechanism,
    quantile: float,
) -> tuple[tuple[Estimate, ...], tuple[Combination, ...]]:
    """Let the intervals contain how well gravity is known.

    The motion itself hardly depends on it: predictions, and the covariance that they use, stay.

    Args:
        parameters: The estimates without it.
        found: The combinations without it.
        share: What it adds.
        mechanism: Gives the bounds.
        quantile: Half width of an interval in standard deviations.

    Returns:
        The estimates and the combinations, in their order.
    """
    limits = {p.name: (p.lower, p.upper) for p in mechanism.parameters}

    def widened(one: _Known, more: float) -> _Known:
        if more == 0.0:
            return one
        lowest, highest = limits.get(one.name, (-np.inf, np.inf))
        low, high = one.value - one.lower, one.upper - one.value
        return replace(
            one,
            std=float(np.hypot(one.std, more)),
            lower=max(one.value - float(np.hypot(low, quantile * more)), min(lowest, one.lower)),
            upper=min(one.value + float(np.hypot(high, quantile * more)), max(highest, one.upper)),
        )

    return (
        tuple(widened(one, share.parameters.get(one.name, 0.0)) for one in parameters),
        tuple(widened(one, share.combinations.get(one.name, 0.0)) for one in found),
    )
