"""A mechanism at one set of shared unknowns, in the form that is simulated, with its derivatives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from monodyn.arrays import plain
from monodyn.mechanism import Mechanism
from monodyn.mechanism.dimensions import power
from monodyn.mechanism.drive import Drive
from monodyn.mechanism.plan import JOINT
from monodyn.mechanism.tree import Directions, Tree


@dataclass(frozen=True, eq=False)
class Instance:
    """The mechanism at one set of shared unknowns, with its derivatives by coordinate.

    Attributes:
        mechanism: The mechanism.
        directions: What each coordinate changes in its tree and its drive, the time scale in the drive alone.
        size: Metric scale of slides.
        dsize: Derivative of its logarithm, (param,).
        stretch: Seconds per stamped second.
        dstretch: Derivative of its logarithm, (param,).
        roll: Roll of the camera [rad].
        droll: Its derivative, (param,).
        lag: How much later than in their log known torques act [s].
    """

    mechanism: Mechanism
    directions: Directions
    size: float
    dsize: np.ndarray
    stretch: float
    dstretch: np.ndarray
    roll: float
    droll: np.ndarray
    lag: float

    @property
    def tree(self) -> Tree:
        """The joint tree."""
        return self.mechanism.tree

    @property
    def drive(self) -> Drive:
        """Torque over time."""
        return self.mechanism.drive

    @cached_property
    def slowed(self) -> Directions:
        """The directions with what a change of the time scale does as a change of forces at the same stamps.

        q(s t; gravity, stiffness, friction, damping, v0) = q(t; s^2 gravity, s^2 stiffness, s^2 friction,
        s damping, s v0) holds for the integrated motion as well, step by step, so that the derivative is
        exact and a time scale that lengths can make up for is seen to be open. The rate within which friction
        changes sign is part of the method and not of the mechanism: it goes along with the scale. The
        derivative of the start rates is the caller's.
        """
        directions, dstretch = self.directions, self.dstretch
        if not dstretch.any():
            return directions
        powers = np.zeros(self.tree.links.shape[1])
        for kind, term in JOINT.items():
            powers[term.column] = power(kind, time=-1.0)
        links = directions.links + (powers * self.tree.links)[:, :, None] * dstretch
        by_gravity = power("gravity", time=-1.0) * self.tree.gravity[:, None]
        gravity = directions.gravity + by_gravity * dstretch
        return replace(directions, links=plain(links), gravity=plain(gravity))
