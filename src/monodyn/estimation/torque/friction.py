"""Viscous friction at every joint (Case I), and dry friction where the motion shows it."""

from __future__ import annotations

from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.search import obstacle
from monodyn.estimation.shooting.shoot import Optimum, Route
from monodyn.estimation.torque.evidence import pays, with_more_unknowns
from monodyn.estimation.torque.task import Task, TorqueSolution
from monodyn.mechanism import Mechanism


def fit_friction(mechanism: Mechanism, task: Task) -> TorqueSolution:
    """Explain the motion by viscous friction (Case I), and by dry friction where it shows.

    Args:
        mechanism: The start.
        task: What is to be explained.

    Returns:
        The solution.
    """
    problem = posed(mechanism.with_torque("friction"), task.data)
    reason = obstacle(problem, task.smoothed)
    if reason is not None:
        return TorqueSolution(problem, None, reason=reason)
    search = task.search(problem)
    optimum, tried = search.from_starts()
    return TorqueSolution(*with_dry_friction(problem, optimum, search.route), tried)


def with_dry_friction(problem: Problem, optimum: Optimum, route: Route) -> tuple[Problem, Optimum]:
    """Free the dry frictions that the user did not choose, and keep those that the motion shows.

    Args:
        problem: The problem with dry friction held.
        optimum: Its optimum.
        route: How exact the search is.

    Returns:
        The problem with them free and its optimum, or both as they were.
    """
    mechanism = problem.mechanism
    names = [
        p.name
        for p in mechanism.parameters
        if p.kind == "friction" and p.name not in mechanism.chosen and not p.free
    ]
    while names and optimum.complete:
        freed = mechanism.with_choices(free=names)
        larger, found = with_more_unknowns(problem, optimum, freed, route)
        # a friction that ends at zero explains nothing, but counts against the others: they are tried without
        zero = [name for name in names if larger.unknowns.named(found.x)[name] <= 0.0]
        if not zero:
            return (larger, found) if pays(optimum, found, len(names)) else (problem, optimum)
        names = [name for name in names if name not in zero]
    return problem, optimum
