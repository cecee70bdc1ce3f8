"""Viscous friction at every joint (Case I), and dry friction where the motion shows it."""

from __future__ import annotations

from dataclasses import replace

from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.search import obstacle, residual_size
from monodyn.estimation.shooting.shoot import Optimum
from monodyn.estimation.torque.evidence import pays, with_more_unknowns
from monodyn.estimation.torque.task import Task, TorqueSolution
from monodyn.mechanism import Mechanism

ANEW = 2
"""Starts from which dry friction is looked for where going on from the damped motion explains nothing."""


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
    return TorqueSolution(*with_dry_friction(problem, optimum, task), tried)


def with_dry_friction(problem: Problem, optimum: Optimum, task: Task) -> tuple[Problem, Optimum]:
    """Free the dry frictions that the user did not choose, and keep those that the motion shows.

    Args:
        problem: The problem with dry friction held.
        optimum: Its optimum.
        task: What is to be explained.

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
        larger, found = _freed(problem, optimum, freed, task)
        # a friction that ends at zero explains nothing, but counts against the others: they are tried without
        zero = [name for name in names if larger.unknowns.named(found.x)[name] <= 0.0]
        if not zero:
            return (larger, found) if pays(optimum, found, len(names)) else (problem, optimum)
        names = [name for name in names if name not in zero]
    return problem, optimum


def _freed(problem: Problem, optimum: Optimum, freed: Mechanism, task: Task) -> tuple[Problem, Optimum]:
    """Go on from an optimum with more frictions free; where that explains nothing, search anew with them."""
    search = task.search(problem)
    larger, found = with_more_unknowns(problem, optimum, freed, search.route)
    anew = task.search(larger)
    if search.explained(optimum) or anew.explained(found):
        return larger, found
    # A motion that dry friction has brought to rest is so far from every damped one that no step leads there.
    few = replace(task, settings=replace(task.settings, starts=min(ANEW, task.settings.starts)))
    other, _ = few.search(larger).from_starts()
    return larger, min(found, other, key=residual_size)
