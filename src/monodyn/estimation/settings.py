"""How a mechanism is identified: settings alone, so that the command line can list them without the rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class IdentifySettings:
    """How a mechanism is identified.

    Attributes:
        bodies: ``uniform``: mass and inertia follow from sizes and density; ``free``: each body's mass,
            centre of mass and inertia are unknowns.
        starts: At most so many starts are tried until the motion is explained.
        seed: Seed of the scattered starts.
        piece: Measured samples in each of the short rollouts the search begins with.
        error_bound: The integration error of a rollout stays below this [rad or m].
        outlier: A sample is left out when its residual is above so many typical ones; 0 keeps all.
        evaluations: Evaluations of the model in one search, at most.
    """

    bodies: Literal["uniform", "free"] = "uniform"
    starts: int = 6
    seed: int = 0
    piece: int = 10
    error_bound: float = 1e-5
    outlier: float = 8.0
    evaluations: int = 100
