"""How well gravity is known where nobody measured it, and with it every length that follows from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monodyn.estimation.fit import Estimate
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.scaling import mass_per_length
from monodyn.mechanism import Mechanism
from monodyn.mechanism.dimensions import power
from monodyn.mechanism.plan import JOINT

GRAVITY_STD = 1.5e-3
"""Standard deviation of gravity where it is taken from a file, as a share of it: it is 9.780 to 9.832 m/s^2
at sea level, less on mountains, and the air carries a part in a thousand of what is light."""


def follows_gravity(mechanism: Mechanism) -> bool:
    """Return whether lengths are known by gravity alone, and gravity is taken from the file.

    Args:
        mechanism: The mechanism, with what the user chose.
    """
    gravity = mechanism.parameter("gravity")
    if gravity.free or gravity.value <= 0.0 or "gravity" in mechanism.chosen:
        return False
    # a length that is given, or a clock that is open, leaves gravity no length to tell
    lengths = [p for p in mechanism.parameters if p.kind == "length"]
    return all(p.free or p.follows for p in lengths) and not mechanism.parameter("time_scale").free


def with_gravity(problem: Problem, estimates: Sequence[Estimate], quantile: float) -> tuple[Estimate, ...]:
    """Let the intervals of what follows from gravity contain how well it is known.

    With k times the gravity the same motion is that of everything k times as long, with masses as they go
    with lengths, or k^-2 times the masses where torques are known; so the predicted motion does not depend
    on it, and the covariance that predictions use stays.

    Args:
        problem: The problem that was solved.
        estimates: The estimates without it.
        quantile: Half width of an interval in standard deviations.

    Returns:
        The estimates, in their order.
    """
    mechanism, data = problem.mechanism, problem.data
    kinds = {joint.name: joint.kind for joint in mechanism.joints}
    metric = any(kind == "slide" for kind in kinds.values()) and not data.slide.any()
    # a slide that is measured in metres tells lengths by itself
    if metric or not follows_gravity(mechanism):
        return tuple(estimates)
    mass = -2.0 if data.torques else mass_per_length(problem)
    parameters = {p.name: p for p in mechanism.parameters}

    def widened(estimate: Estimate) -> Estimate:
        p = parameters[estimate.name]
        joint = kinds.get(p.owner, "hinge") if p.kind in JOINT else "hinge"
        more = abs(GRAVITY_STD * power(p.kind, joint, length=1.0, mass=mass) * estimate.value)
        if not 0.0 < estimate.std < np.inf or more == 0.0:
            return estimate
        low, high = estimate.value - estimate.lower, estimate.upper - estimate.value
        return replace(
            estimate,
            std=float(np.hypot(estimate.std, more)),
            lower=max(estimate.value - float(np.hypot(low, quantile * more)), min(p.lower, estimate.lower)),
            upper=min(estimate.value + float(np.hypot(high, quantile * more)), max(p.upper, estimate.upper)),
        )

    return tuple(widened(estimate) for estimate in estimates)
