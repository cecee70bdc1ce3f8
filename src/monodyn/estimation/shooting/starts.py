"""Where to begin: the file's sizes are wrong, and the common scale may be off a thousandfold.

Two cheap looks at the record find it: accelerations of the smoothed motion, without integrating, and rollouts
of a few samples for motion too fast to be smoothed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from monodyn.estimation.record.samples import cut
from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.shooting.problem import Motion, Problem
from monodyn.estimation.shooting.shoot import Route, fit_pieces
from monodyn.estimation.shooting.unknowns import kind_of, scaled_start
from monodyn.optimize import SearchSettings, minimize, scatter

FACTORS = 2.0 ** np.arange(-4.0, 11.0)
"""Common scales that are tried: 1/16 to 1024, slow motion makes lengths look large."""
FINE_FACTORS = 2.0 ** np.arange(-4.0, 10.01, 0.125)
MATCH = SearchSettings(evaluations=30, relative=1e-4)
"""For matching accelerations, which are only as good as the smoothing."""
GLANCE = SearchSettings(evaluations=4, relative=1e-2)
"""For start states alone, to see which common scale is near."""
FEWEST = 5
"""Measured samples in the shortest pieces."""


def starts(
    problem: Problem, motion: Motion, smoothed: tuple[Smoothed, ...], route: Route, count: int, seed: int
) -> Iterator[tuple[np.ndarray, Route]]:
    """Yield starts in the order in which they should be tried, with the route to go from there.

    First the best match of accelerations; then the file's start at the common scale that short rollouts find,
    with shorter pieces; then starts scattered about that one, lengths within a factor of 1.5, masses of 3.

    Args:
        problem: The problem.
        motion: Smooth motion at the measured rows.
        smoothed: Smooth motion of each record.
        route: The usual route.
        count: Number of starts.
        seed: Seed of the scatter.

    Yields:
        Coordinates (param,) and a route.
    """
    unknowns = problem.unknowns
    yield matched(problem, motion), route
    if count < 2:
        return
    short = replace(route, piece=max(FEWEST, route.piece // 2))
    rolled = _rolled(problem, smoothed, short)
    yield rolled, short
    reach = {"length": np.log(1.5), "thickness": np.log(3.0), "mass": np.log(3.0), "inertia": np.log(3.0)}
    spread = np.array([reach.get(kind_of(name), 0.0) for name in unknowns.names])
    for i, x in enumerate(scatter(rolled, spread, count - 1, seed=seed)[1:]):
        x = np.clip(x, unknowns.lower, unknowns.upper)
        yield (x, short) if i % 2 == 0 else (_match(problem, motion, x), route)


def matched(problem: Problem, motion: Motion) -> np.ndarray:
    """Match accelerations: first the common scale, then all unknowns, (param,)."""
    nearest = min(_scaled(problem), key=lambda x: problem.acceleration_cost(x, motion))
    return _match(problem, motion, nearest)


def _match(problem: Problem, motion: Motion, x: np.ndarray) -> np.ndarray:
    unknowns = problem.unknowns
    found = minimize(
        lambda at: problem.acceleration_rows(at, motion), x, (unknowns.lower, unknowns.upper), settings=MATCH,
        reach=unknowns.reach,
    )  # fmt: skip
    return found.x


def _rolled(problem: Problem, smoothed: tuple[Smoothed, ...], route: Route) -> np.ndarray:
    """Find the common scale at which short rollouts with free start states come closest, (param,)."""
    pieces = cut(problem.data, route.piece)

    def cost(x: np.ndarray) -> float:
        states = problem.start_states(x, pieces, smoothed)
        found = fit_pieces(problem, x, states, pieces, route, GLANCE, held=True)
        return found.sigma if np.isfinite(found.cost) else float("inf")

    return min(_scaled(problem), key=cost)


def sized(problem: Problem, motion: Motion) -> np.ndarray:
    """Find the common scale at which the motion asks for the least torque beside that of gravity, (param,).

    Both are taken along the measured motion and hinge by hinge; all else stays as picture or file say.
    """
    still = replace(motion, velocity=np.zeros_like(motion.velocity))
    hangs = np.array([joint.kind == "hinge" for joint in problem.mechanism.joints])

    def least(x: np.ndarray) -> float:
        per_torque = problem.torque_response(x, motion)
        lacking = motion.acceleration - problem.accelerations(x, motion)
        falling = problem.accelerations(x, still)
        asked, weight = (np.linalg.solve(per_torque, a[:, :, None])[:, :, 0] for a in (lacking, falling))
        asked, weight = (np.mean(torque**2, axis=0)[hangs] for torque in (asked, weight))
        return float(np.sum(asked / np.maximum(weight, 1e-30)))

    return min(_scaled(problem, FINE_FACTORS), key=least)


def _scaled(problem: Problem, factors: np.ndarray = FACTORS) -> list[np.ndarray]:
    """The start at each of the common scales, or as it is where nothing can be scaled."""
    unknowns, found = problem.unknowns, []
    for factor in factors:
        values = scaled_start(unknowns, factor, problem.mechanism)
        if not values:
            return [unknowns.x0]
        start = [values.get(name, value) for name, value in zip(unknowns.names, unknowns.start, strict=True)]
        found.append(np.clip(unknowns.coordinates(np.array(start)), unknowns.lower, unknowns.upper))
    return found
