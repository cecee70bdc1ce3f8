"""How a mechanism is identified: settings alone, so that the command line can list them without the rest."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Literal

from monodyn.errors import SettingsError


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
        outlier: A sample is left out when its residual is above so many typical ones, 3 or more; 0 keeps all.
        evaluations: Evaluations of the model in one search, at most.
    """

    bodies: Literal["uniform", "free"] = "uniform"
    starts: int = 6
    seed: int = 0
    piece: int = 10
    error_bound: float = 1e-5
    outlier: float = 8.0
    evaluations: int = 100

    def __post_init__(self) -> None:
        if self.bodies not in ("uniform", "free"):
            raise SettingsError(f"identify.bodies: expected 'uniform' or 'free', got '{self.bodies}'.")
        ranges = (
            ("starts", 1, 1000), ("seed", 0, 2**63), ("piece", 5, 10000), ("error_bound", 1e-10, 1e-2),
            ("evaluations", 5, 10000),
        )  # fmt: skip
        for name, low, high in ranges:
            value = getattr(self, name)
            if not low <= value <= high:
                shown = f"identify.{name.replace('_', '-')}"
                raise SettingsError(f"{shown}: expected {low:g} to {high:g}, got {value:g}.")
        if self.outlier != 0 and not (self.outlier >= 3 and isfinite(self.outlier)):
            raise SettingsError(f"identify.outlier: expected 0 or at least 3, got {self.outlier:g}.")
