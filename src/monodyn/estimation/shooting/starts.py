"""Where to begin: the file's sizes are wrong, and the common scale may be off a thousandfold.

Two cheap comparisons with the record find it: accelerations of the smoothed motion, without integrating, and
rollouts of a few samples for motion too fast to be smoothed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from monodyn.estimation.record.samples import cut, spread
from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.shooting.accelerations import (
    SmoothMotion,
    mismatch_cost,
    mismatch_rows,
    model_accelerations,
    torque_response,
)
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.pushed import at_best_torque
from monodyn.estimation.shooting.scaling import starts_of_scales
from monodyn.estimation.shooting.shoot import Route, fit_pieces
from monodyn.mechanism.upright import QUARTERS, ROLL
from monodyn.optimize import SearchSettings, minimize, scatter

FACTORS = 2.0 ** np.arange(-4.0, 11.0)
"""Common scales that are tried: 1/16 to 1024, slow motion makes lengths look large."""
FINE_FACTORS = 2.0 ** np.arange(-4.0, 10.01, 0.125)
"""The same, as near to each other as one linear fit of the accelerations can distinguish."""
MATCH = SearchSettings(evaluations=30, relative=1e-4)
"""For matching accelerations, which are only as good as the smoothing."""
STATES_ALONE = SearchSettings(evaluations=4, relative=1e-2)
"""For start states alone, to see which common scale is near."""
MOST_ROLLED = 100
"""Short rollouts by which the common scale is found."""
SHORTEST_PIECE = 5
"""Measured samples in the shortest pieces."""
SCATTER = {"length": np.log(1.5), "thickness": np.log(3.0), "mass": np.log(3.0), "inertia": np.log(3.0)}
"""Half width of the scattered starts, by kind, in logarithms."""


def starts(
    problem: Problem,
    motion: SmoothMotion,
    smoothed: tuple[Smoothed, ...],
    route: Route,
    count: int,
    seed: int,
) -> Iterator[tuple[np.ndarray, Route]]:
    """Yield starts in the order in which they should be tried, with the route to go from there.

    First the best match of accelerations; the best with gravity from any side of the picture, if that is
    another; then the file's start at the common scale that short rollouts find, with shorter pieces; then
    starts scattered about that one, lengths within a factor of 1.5, masses of 3.

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
    level, turned = (_nearest(problem, motion, sides) for sides in (1, None))
    if not np.array_equal(level, turned):
        yield match(problem, motion, turned), route
    short = replace(route, piece=max(SHORTEST_PIECE, route.piece // 2))
    rolled = _rolled(problem, motion, smoothed, short)
    yield rolled, short
    width = np.array([SCATTER.get(kind, 0.0) for kind in unknowns.kinds])
    for i, x in enumerate(scatter(rolled, width, count - 1, seed=seed)[1:]):
        x = np.clip(x, unknowns.lower, unknowns.upper)
        # every other one is matched first: where accelerations are any good that saves the short pieces
        yield (x, short) if i % 2 == 0 else (match(problem, motion, x), route)


def matched(problem: Problem, motion: SmoothMotion) -> np.ndarray:
    """Match accelerations: first the common scale, then all unknowns.

    Args:
        problem: The problem.
        motion: Smooth motion.

    Returns:
        Coordinates, (param,).
    """
    return match(problem, motion, _nearest(problem, motion))


def _nearest(problem: Problem, motion: SmoothMotion, sides: int | None = 1) -> np.ndarray:
    """Return the start of the common scale that matches best, (param,), with gravity from so many sides of
    the picture, None for all."""
    tried = [turned for x in _scales(problem, motion) for turned in from_sides(problem, x)[:sides]]
    return min(tried, key=lambda x: mismatch_cost(problem, x, motion))


def from_sides(problem: Problem, x: np.ndarray) -> list[np.ndarray]:
    """Return a start, then those with gravity from each other side of the picture, (param,) each.

    Args:
        problem: The problem; where its unknowns lack the roll, the start stays alone.
        x: Coordinates of the start, (param,).
    """
    turns = QUARTERS if ROLL in problem.unknowns.names else ()
    return [x, *(_turned(problem, x, turn) for turn in turns)]


def _turned(problem: Problem, x: np.ndarray, by: float) -> np.ndarray:
    """Return coordinates, (param,), with the camera rolled by an angle more [rad], to within half a turn."""
    roll = np.array([name == ROLL for name in problem.unknowns.names])
    return np.where(roll, np.remainder(x + by + np.pi, 2.0 * np.pi) - np.pi, x)


def _scales(problem: Problem, motion: SmoothMotion) -> list[np.ndarray]:
    """Return the start at common scales of its sizes, under known torques with masses and lag to match."""
    found = starts_of_scales(problem, FACTORS)
    if problem.data.torques and len(motion.time):
        return [at_best_torque(problem, x, motion) for x in found]
    return found


def match(problem: Problem, motion: SmoothMotion, x: np.ndarray) -> np.ndarray:
    """Match accelerations from one start.

    Args:
        problem: The problem.
        motion: Smooth motion.
        x: Coordinates of the start, (param,).

    Returns:
        Coordinates, (param,).
    """
    unknowns = problem.unknowns
    found = minimize(
        lambda at: mismatch_rows(problem, at, motion), x, (unknowns.lower, unknowns.upper), settings=MATCH,
        reach=unknowns.reach,
    )  # fmt: skip
    return _turned(problem, found.x, 0.0)


def _rolled(
    problem: Problem, motion: SmoothMotion, smoothed: tuple[Smoothed, ...], route: Route
) -> np.ndarray:
    """Find the common scale at which short rollouts with free start states come closest, (param,)."""
    data, pieces = spread(problem.data, cut(problem.data, route.piece), MOST_ROLLED)
    problem = problem.with_data(data)

    def cost(x: np.ndarray) -> float:
        trial = problem.started(x, pieces, smoothed)
        found = fit_pieces(problem, trial, route, STATES_ALONE, held=True)
        # the typical residual, not the cost: at a wrong scale some pieces are lost, which must not decide
        return found.sigma if np.isfinite(found.cost) else float("inf")

    return min(_scales(problem, motion), key=cost)


def least_driven(problem: Problem, motion: SmoothMotion) -> np.ndarray:
    """Find the common scale at which the motion requires the least torque in addition to that of gravity.

    Both are taken along the measured motion and hinge by hinge; all else keeps the values of picture or file.

    Args:
        problem: The problem.
        motion: Smooth motion.

    Returns:
        Coordinates, (param,).
    """
    hangs = np.array([joint.kind == "hinge" for joint in problem.mechanism.joints])

    def required(x: np.ndarray) -> float:
        per_torque = torque_response(problem, x, motion)
        lacking = motion.acceleration - model_accelerations(problem, x, motion)
        falling = model_accelerations(problem, x, motion.at_rest)
        # both as torques, whose ratio has no unit: a larger mechanism needs more of either
        try:
            torque, weight = (np.linalg.solve(per_torque, a[:, :, None])[:, :, 0] for a in (lacking, falling))
        except np.linalg.LinAlgError:
            # the scale is so far off that a torque moves nothing
            return float("inf")
        torque, weight = (np.mean(load**2, axis=0)[hangs] for load in (torque, weight))
        return float(np.sum(torque / np.maximum(weight, 1e-30)))

    return min(starts_of_scales(problem, FINE_FACTORS), key=required)
