"""Unknowns that are added to an optimum where they pay: dry friction, further harmonics of a torque."""

from __future__ import annotations

from monodyn.estimation.grow import Grown, Route, fit_pieces
from monodyn.estimation.problem import Problem, posed
from monodyn.estimation.settings import USUAL_TERMS
from monodyn.mechanism import Mechanism
from monodyn.optimize import SearchSettings

EVIDENCE = 15.0
"""Twice the log likelihood that an unknown must gain; pure chance gives one on average."""
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
        driven = problem.mechanism.with_torque("fourier", terms=further, period=period)
        trial, found = _extended(problem, grown, driven, route)
        if _pays(grown, found, 2 * dofs * (further - terms)):
            problem, grown, terms = trial, found, further
        further += 1
    return problem, grown


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
