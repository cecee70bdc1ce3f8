"""Changes of units that leave the motion unchanged: they find a start, and settle what no motion determines.

A camera shows neither masses nor, without gravity or a true clock, lengths. Along such a direction a search
ends anywhere; of all the ends with the same motion, the one with round values is reported. How a parameter
changes with the units of mass, length and time stands in ``mechanism.dimensions``.
"""

from __future__ import annotations

import numpy as np

from monodyn.estimation.shooting.problem import Problem
from monodyn.mechanism.dimensions import MASS_KINDS, power

SIZES = ("length", "width", "tail", "tip", "extent", "along", "across", "com_x", "com_y", "inertia")
"""Kinds that make a mechanism larger at the same masses per length; frictions are left to the search."""


def with_masses_of_start(problem: Problem, x: np.ndarray) -> np.ndarray:
    """Change all masses, dampings, ... by one factor, so that they are near the start on average.

    Where nothing fixes the scale of masses this does not change the motion.

    Args:
        problem: The problem.
        x: Coordinates, (param,).

    Returns:
        Coordinates within the bounds, (param,).
    """
    unknowns = problem.unknowns
    heavy = unknowns.of_kind(*MASS_KINDS)
    anchors = heavy & unknowns.log
    if not anchors.any():
        return x
    # only positive masses have a logarithm to average; what may be zero goes along with them
    factor = float(np.exp(np.mean((unknowns.x0 - x)[anchors])))
    moved = np.where(anchors, x + np.log(factor), np.where(heavy & (unknowns.against < 0), x * factor, x))
    return np.clip(moved, unknowns.lower, unknowns.upper)


def with_masses(problem: Problem, x: np.ndarray, factor: float) -> np.ndarray:
    """Make all masses, dampings, ... larger by one factor.

    Args:
        problem: The problem.
        x: Coordinates, (param,).
        factor: The factor.

    Returns:
        Coordinates within the bounds, (param,).
    """
    # of a body of given density it is the thickness that makes it heavier
    units = {"mass": 1.0} if "density" in problem.unknowns.kinds else {"mass": 1.0, "thickness": 1.0}
    return _rescaled(problem, x, factor, **units)


def with_gravity_of_start(problem: Problem, x: np.ndarray) -> np.ndarray:
    """Bring gravity to its start, and change lengths and what goes with them to match.

    With everything k times as long and k times the gravity, inertias k^2 (free) or k^4 (uniform, same
    thickness) times as large and dampings likewise, the motion of hinges stays the same.

    Args:
        problem: The problem.
        x: Coordinates, (param,).

    Returns:
        Coordinates within the bounds, (param,).
    """
    unknowns = problem.unknowns
    # a slide in units of the picture would have to change its record as well
    if "gravity" not in unknowns.names or problem.data.slide.any():
        return x
    at = unknowns.names.index("gravity")
    k = float(np.exp(unknowns.x0[at] - x[at]))
    return _rescaled(problem, x, k, length=1.0, mass=mass_per_length(problem))


def with_clock_of_start(problem: Problem, x: np.ndarray) -> np.ndarray:
    """Bring the time scale to its start, and change lengths and what goes with them to match.

    With everything k times as long motion takes k^(1/2) times as long, when masses stay and inertias are k^2
    times as large (free) or masses k^2 and inertias k^4 (uniform, same thickness); frictions, stiffnesses and
    dampings follow from their units, with inertias at a hinge and masses at a slide.

    Args:
        problem: The problem.
        x: Coordinates, (param,).

    Returns:
        Coordinates within the bounds, (param,).
    """
    unknowns = problem.unknowns
    if "time_scale" not in unknowns.names:
        return x
    at = unknowns.names.index("time_scale")
    # the time scale goes with the root of the lengths
    k = float(np.exp(2.0 * (unknowns.x0[at] - x[at])))
    return _rescaled(problem, x, k, length=1.0, time=0.5, mass=mass_per_length(problem))


def starts_of_scales(problem: Problem, factors: np.ndarray) -> list[np.ndarray]:
    """Return the start at common scales of its sizes.

    Making everything k times as long slows a mechanism down by k^(1/2); where the lengths are fixed, gravity
    or the time scale can do the same.

    Args:
        problem: The problem.
        factors: Ratios of lengths, (point,).

    Returns:
        Coordinates of each, (param,); the start alone where nothing can be scaled.
    """
    unknowns = problem.unknowns
    if "length" in unknowns.kinds or "inertia" in unknowns.kinds:
        powers = [power(kind, length=1.0) if kind in SIZES else 0.0 for kind in unknowns.kinds]
    elif "gravity" in unknowns.names:
        powers = [power(kind, length=-1.0) if kind == "gravity" else 0.0 for kind in unknowns.kinds]
    elif "time_scale" in unknowns.names:
        powers = [power(kind, time=-0.5) if kind == "time_scale" else 0.0 for kind in unknowns.kinds]
    else:
        return [unknowns.x0]
    found = []
    for factor in factors:
        values = np.array([value * factor**p for value, p in zip(unknowns.start, powers, strict=True)])
        found.append(np.clip(unknowns.coordinates(values), unknowns.lower, unknowns.upper))
    return found


def mass_per_length(problem: Problem) -> float:
    """Return the exponent of masses when lengths grow: areas at a given density and thickness, or nothing.

    Args:
        problem: The problem.
    """
    return 2.0 if problem.unknowns.uniform else 0.0


def _rescaled(problem: Problem, x: np.ndarray, k: float, **units: float) -> np.ndarray:
    """Change the units by powers of ``k``; coordinates within the bounds, (param,)."""
    unknowns = problem.unknowns
    joints = {joint.name: joint.kind for joint in problem.mechanism.joints}
    powers = np.array(
        [
            power(kind, joints.get(owner, "hinge"), **units)
            for kind, owner in zip(unknowns.kinds, unknowns.owners, strict=True)
        ]
    )
    # the coordinate of a place is a ratio, which no change of units changes; a friction's may be one
    powers = np.where(unknowns.against >= 0, powers - powers[unknowns.against], powers)
    powers = np.where(unknowns.ratio, 0.0, powers)
    moved = np.where(unknowns.log, x + powers * np.log(k), x * k**powers)
    return np.clip(moved, unknowns.lower, unknowns.upper)
