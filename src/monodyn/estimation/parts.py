"""What a fit is made of in addition to its parameters: combinations, start states, what is left over."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from monodyn.arrays import Frozen, freeze


class Premise(str):
    """A sentence of advice on what values rest on, which is the same for all records of its kind: it stands
    once in the report, and not under every result."""


@dataclass(frozen=True)
class Combination:
    """A function of several parameters that the motion fixes.

    Attributes:
        name: The expression.
        value: Its value [SI].
        std: Standard deviation [SI].
        lower: Lower end of the 95 % interval [SI].
        upper: Upper end [SI].
        unit: Unit of all of them; empty for a plain number.
    """

    name: str
    value: float
    std: float
    lower: float
    upper: float
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Start(Frozen):
    """State at the first fitted sample of a record.

    Attributes:
        time: Time stamp [s].
        position: Joint positions [rad or m], (dof,).
        velocity: Joint rates [rad/s or m/s], (dof,).
        covariance: Covariance of positions, then rates, (2 dof, 2 dof); a part of that of the fit.
    """

    time: float
    position: np.ndarray
    velocity: np.ndarray
    covariance: np.ndarray

    def __post_init__(self) -> None:
        dofs = len(self.position)
        freeze(self, (dofs,), "position", "velocity")
        freeze(self, (2 * dofs,) * 2, "covariance")


class TriedTorque(NamedTuple):
    """One of the kinds of torque between which the evidence decided.

    Attributes:
        kind: What acts, in words.
        chosen: Whether it is the one that was taken.
        said: How well it follows the record, a sentence with its figures.
    """

    kind: str
    chosen: bool
    said: str


class Unmodelled(NamedTuple):
    """What a model lacks, as random accelerations.

    Attributes:
        density: Spectral density of each joint's random acceleration [rad^2/s^3 or m^2/s^3], (dof,).
        off: Mean square of positions, then rates of the motion less the identified one [SI], (2 dof, 2 dof).
    """

    density: np.ndarray
    off: np.ndarray


@dataclass(frozen=True, eq=False)
class Common:
    """Errors that the positions of a record have in common, as its motion shows them.

    Attributes:
        mean: How many deviations of each direction of `Poses.shifts` they are, (direction,).
        covariance: Its covariance, (direction, direction); the identity where the motion shows nothing.
    """

    mean: np.ndarray
    covariance: np.ndarray

    @cached_property
    def root(self) -> np.ndarray:
        """One deviation of each independent direction that is left, (direction, direction)."""
        values, vectors = np.linalg.eigh(self.covariance)
        return vectors * np.sqrt(np.maximum(values, 0.0))

    def of(self, directions: slice) -> Common:
        """Return what is known of some of the directions.

        Args:
            directions: Which.
        """
        return Common(self.mean[directions], self.covariance[directions, directions])
