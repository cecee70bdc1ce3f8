"""What something that is not among the unknowns adds to the intervals of what was identified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from monodyn.estimation.fit import Estimate
from monodyn.estimation.parts import Combination
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.verdict.intervals import determined, errs_by_factor, widened

_Known = TypeVar("_Known", Estimate, Combination)

NOTICED = 1e-3
"""Share of a standard deviation from which on what is added to it is more than rounding."""


@dataclass(frozen=True)
class Share:
    """What is added to the standard deviations, in the unit of each.

    Attributes:
        parameters: By name, of those to which something is added.
        combinations: Likewise.
    """

    parameters: dict[str, float]
    combinations: dict[str, float]


def added(before: Sequence[_Known], after: Sequence[_Known]) -> dict[str, float]:
    """Return by name what has to be added to the standard deviations before to have those after.

    Args:
        before: Estimates or combinations.
        after: The same with larger deviations.
    """
    std, found = {one.name: one.std for one in before}, {}
    for one in after:
        own = std.get(one.name, 0.0)
        if 0.0 < own < np.inf and np.isfinite(one.std) and one.std > (1.0 + NOTICED) * own:
            found[one.name] = float(np.sqrt(one.std**2 - own**2))
    return found


def with_share(
    parameters: Sequence[Estimate],
    found: Sequence[Combination],
    share: Share,
    problem: Problem,
    quantile: float,
) -> tuple[tuple[Estimate, ...], tuple[Combination, ...]]:
    """Let the intervals contain something more.

    Predictions, and the covariance that they use, stay.

    Args:
        parameters: The estimates without it.
        found: The combinations without it.
        share: What is added.
        problem: Gives the bounds, and what was searched as a logarithm.
        quantile: Half width of an interval in standard deviations.

    Returns:
        The estimates and the combinations, in their order.
    """
    rows = {p.name: p for p in problem.mechanism.parameters}

    def wider(one: Estimate) -> Estimate:
        more, p = share.parameters.get(one.name, 0.0), rows[one.name]
        if more == 0.0:
            return one
        std = float(np.hypot(one.std, more))
        by_factor = errs_by_factor(problem.unknowns, replace(p, value=one.value))
        lower, upper = widened(one.value, one.lower, one.upper, quantile * more, by_factor=by_factor)
        return replace(
            one,
            std=std,
            lower=max(lower, min(p.lower, one.lower)),
            upper=min(upper, max(p.upper, one.upper)),
            identifiable=one.identifiable and determined(one.value, std, by_factor=by_factor),
        )

    def looser(one: Combination) -> Combination:
        more = share.combinations.get(one.name, 0.0)
        if more == 0.0:
            return one
        # of all combinations the intervals are of the value, which may be negative
        lower, upper = widened(one.value, one.lower, one.upper, quantile * more, by_factor=False)
        return replace(one, std=float(np.hypot(one.std, more)), lower=lower, upper=upper)

    return tuple(map(wider, parameters)), tuple(map(looser, found))
