"""What something that is not among the unknowns adds to the intervals of what was identified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from monodyn.estimation.fit import Combination, Estimate
from monodyn.mechanism import Mechanism

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
    mechanism: Mechanism,
    quantile: float,
) -> tuple[tuple[Estimate, ...], tuple[Combination, ...]]:
    """Let the intervals contain something more.

    Predictions, and the covariance that they use, stay.

    Args:
        parameters: The estimates without it.
        found: The combinations without it.
        share: What is added.
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
