"""Unknowns that are added to an optimum where they pay: dry friction, further harmonics of a torque."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.estimation.settings import USUAL_TERMS
from monodyn.estimation.shooting.problem import Motion, Problem, posed
from monodyn.estimation.shooting.shoot import Grown, Route, fit_pieces
from monodyn.mechanism import Mechanism
from monodyn.optimize import SearchSettings

EVIDENCE = 15.0
"""Twice the log likelihood that an unknown must gain; pure chance gives one on average."""
LEAST_SHARE = 0.01
"""Share of weight and inertia at a joint from which a periodic torque stands out."""
GLANCE = SearchSettings(evaluations=2)
"""One step: where it gains next to nothing, more of them will not gain much."""


def dry_friction(problem: Problem, grown: Grown, route: Route) -> tuple[Problem, Grown]:
    """Free the dry frictions that the user did not choose, and keep those that the motion shows.

    Args:
        problem: The problem with dry friction held.
        grown: Its optimum.
        route: How exact the search is.

    Returns:
        The problem with them free and its optimum, or both as they were.
    """
    mechanism = problem.mechanism
    names = [f"{joint.name}.friction" for joint in mechanism.joints]
    names = [name for name in names if name not in mechanism.chosen and not mechanism.parameter(name).free]
    while names and grown.complete:
        trial, found = _extended(problem, grown, mechanism.with_choices(free=names), route)
        zero = [name for name in names if trial.unknowns.named(found.x)[name] <= 0.0]
        if not zero:
            return (trial, found) if _pays(grown, found, len(names)) else (problem, grown)
        names = [name for name in names if name not in zero]
    return problem, grown


def more_terms(problem: Problem, grown: Grown, route: Route) -> tuple[Problem, Grown]:
    """Add harmonics to a periodic torque as long as one of the next two pays.

    Args:
        problem: The problem with a periodic torque.
        grown: Its optimum.
        route: How exact the search is.

    Returns:
        The problem with as many harmonics as pay, and its optimum.
    """
    dofs, period = len(problem.mechanism.joints), problem.mechanism.values["torque.period"]
    terms = (problem.mechanism.drive.table.shape[1] - 1) // 2
    further = terms + 1
    while further <= min(terms + 2, USUAL_TERMS) and grown.complete:
        driven = series(problem.mechanism, further, period)
        trial, found = _extended(problem, grown, driven, route)
        if _pays(grown, found, 2 * dofs * (further - terms)):
            problem, grown, terms = trial, found, further
        further += 1
    return problem, grown


def simpler_series(problem: Problem, grown: Grown, route: Route, divide: bool) -> tuple[Problem, Grown]:
    """Take harmonics off a periodic torque, or divide its period, as long as the rest explains as much.

    Args:
        problem: The problem with a periodic torque.
        grown: Its optimum.
        route: How exact the search is.
        divide: Whether the period may be divided.

    Returns:
        The problem with the series that Schwarz's criterion likes best, and its optimum.
    """
    while True:
        terms, period = series_of(problem, grown)
        shorter = [(terms - 1, period)] if terms > 1 else []
        if divide:
            shorter += [(terms // d, period / d) for d in range(2, terms + 1)]
        tried = [(problem, grown)]
        tried += [_cut(problem, grown, count, time, route) for count, time in shorter]
        best = likeliest(tried)
        problem, grown = tried[best]
        if best == 0:
            return problem, grown


def series(mechanism: Mechanism, terms: int, period: float) -> Mechanism:
    """Return the mechanism under a periodic torque; a period that is not free stays.

    Args:
        mechanism: The mechanism.
        terms: Number of harmonics.
        period: Start of the period [s].
    """
    driven = mechanism.with_torque("fourier", terms=terms, period=period)
    return driven.with_values({"torque.period": period} if driven.parameter("torque.period").free else {})


def series_of(problem: Problem, grown: Grown) -> tuple[int, float]:
    """Return the number of harmonics and the period [s] at an optimum."""
    mechanism = problem.mechanism_at(grown.x)
    return (mechanism.drive.table.shape[1] - 1) // 2, mechanism.values["torque.period"]


def _cut(problem: Problem, grown: Grown, terms: int, period: float, route: Route) -> tuple[Problem, Grown]:
    """Fit a shorter series from an optimum; harmonics of a divided period take over their coefficients."""
    _, before = series_of(problem, grown)
    times = round(before / period)
    trial = posed(series(problem.mechanism, terms, period), problem.data)
    start = trial.unknowns.carried(grown.x, problem.unknowns)
    if "torque.period" in trial.unknowns.names:
        start[trial.unknowns.names.index("torque.period")] = np.log(period)
    table = problem.mechanism_at(grown.x).drive.table
    ways = trial.mechanism.drive_entries(trial.unknowns.names)
    for k in range(1, terms + 1):
        for part in (-1, 0):  # cosine and sine
            new, old = ways[:, 2 * k + part], table[:, 2 * k * times + part]
            start[new[new >= 0]] = old[new >= 0]
    return trial, fit_pieces(trial, start, grown.states, grown.pieces, route, route.fine)


def periodic(problem: Problem, grown: Grown, route: Route) -> bool:
    """True when a periodic torque explains the motion by far better than friction alone.

    By far, because the best of many periods was taken.

    Args:
        problem: The problem with a periodic torque.
        grown: Its optimum.
        route: How exact the search is.
    """
    trial = posed(problem.mechanism.with_torque("friction"), problem.data)
    start = trial.unknowns.carried(grown.x, problem.unknowns)
    passive = fit_pieces(trial, start, grown.states, grown.pieces, route, route.fine)
    added = len(problem.unknowns) - len(trial.unknowns)
    return not passive.complete or _pays(passive, grown, added)


def stands_out(problem: Problem, x: np.ndarray, motion: Motion) -> bool:
    """True when the periodic part of a torque is worth speaking of beside weight and inertia.

    What the model lacks is often periodic as the motion is, and small; a torque of under a hundredth of
    weight and inertia at every joint is taken for that.

    Args:
        problem: The problem with a periodic torque.
        x: Coordinates, (param,).
        motion: Smooth motion.
    """
    still = replace(motion, velocity=np.zeros_like(motion.velocity))
    response, none = problem.torque_response(x, motion), np.zeros_like(motion.position)
    weight, inertia = (
        np.linalg.solve(response, accelerations[:, :, None])[:, :, 0]
        for accelerations in (problem.accelerations(x, still, none), motion.acceleration)
    )
    load = np.sqrt(np.mean(weight**2 + inertia**2, axis=0))
    torque = problem.at(x).drive.at(motion.time * problem.stretch(x))
    swing = np.sqrt(np.mean((torque - torque.mean(axis=0)) ** 2, axis=0))
    return bool((swing > LEAST_SHARE * load).any())


def likeliest(tried: list[tuple[Problem, Grown]]) -> int:
    """Return which optimum Schwarz's criterion likes best: a longer series must earn its harmonics.

    Residuals of the one that follows best tell the noise.

    Args:
        tried: Problems on the same data with their optima.
    """
    noise = max(min(grown.sigma for _, grown in tried), 1.0)
    criteria = [
        2.0 * grown.cost / noise**2 + len(problem.unknowns) * np.log(problem.data.samples)
        if grown.complete
        else np.inf
        for problem, grown in tried
    ]
    return int(np.argmin(criteria))


def _extended(problem: Problem, grown: Grown, mechanism: Mechanism, route: Route) -> tuple[Problem, Grown]:
    """Go on from an optimum with more unknowns, which begin at their values in ``mechanism``."""
    trial = posed(mechanism, problem.data)
    start = trial.unknowns.carried(grown.x, problem.unknowns)
    found = fit_pieces(trial, start, grown.states, grown.pieces, route, GLANCE)
    if _pays(grown, found, 1):
        found = fit_pieces(trial, found.x, found.states, grown.pieces, route, route.fine)
    return trial, found


def _pays(before: Grown, after: Grown, added: int) -> bool:
    """True when the cost falls by more than chance allows, noise taken as large as the residuals are."""
    return after.complete and 2.0 * (before.cost - after.cost) > EVIDENCE * added * max(after.sigma, 1.0) ** 2
