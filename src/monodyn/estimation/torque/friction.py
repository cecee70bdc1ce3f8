"""Viscous friction at every joint (Case I), and dry friction where the motion shows it."""

from __future__ import annotations

from dataclasses import replace

from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.search import obstacle
from monodyn.estimation.shooting.shoot import Optimum, fit_pieces, relative_difference, with_proportions
from monodyn.estimation.torque.evidence import at_noise, pays, with_more_unknowns
from monodyn.estimation.torque.task import Task, TorqueSolution
from monodyn.mechanism import Mechanism

FAR_SHARE, FAR_NOISE = 0.02, 10.0
"""Typical difference, as a share of the motion and in units of the noise, above which the motion may be
another one altogether."""


def fit_friction(mechanism: Mechanism, task: Task) -> TorqueSolution:
    """Explain the motion by viscous friction (Case I), and by dry friction where it shows.

    Args:
        mechanism: The start.
        task: What is to be explained.

    Returns:
        The solution.
    """
    return fit_damped(posed(mechanism.with_torque("friction"), task.data), task)


def fit_damped(problem: Problem, task: Task) -> TorqueSolution:
    """Search from one start after the other, then with dry friction where it shows.

    Args:
        problem: The problem with dry friction held.
        task: What is to be explained.

    Returns:
        The solution.
    """
    reason = obstacle(problem, task.smoothed)
    if reason is not None:
        return TorqueSolution(problem, None, reason=reason)
    search = task.search(problem)
    optimum, tried = search.from_starts()
    return settled(problem, optimum, task, tried)


def settled(problem: Problem, optimum: Optimum, task: Task, tried: int) -> TorqueSolution:
    """Go on from where a search ended: with sizes near the file's proportion, and with dry friction.

    Args:
        problem: The problem with dry friction held.
        optimum: Where the search ended.
        task: What is to be explained.
        tried: Number of starts.

    Returns:
        The solution.
    """
    problem, optimum = near_proportions(problem, optimum, task)
    return TorqueSolution(*with_dry_friction(problem, optimum, task), tried)


def far_off(problem: Problem, optimum: Optimum) -> bool:
    """Return whether the motion may be another one than the record's altogether.

    Args:
        problem: The problem.
        optimum: Its optimum.
    """
    return optimum.sigma > FAR_NOISE and relative_difference(problem, optimum.trial) >= FAR_SHARE


def near_proportions(problem: Problem, optimum: Optimum, task: Task) -> tuple[Problem, Optimum]:
    """Free the sizes that nothing measures where something is left over, so that no torque stands for them.

    Args:
        problem: The problem.
        optimum: Its optimum.
        task: What is to be explained.

    Returns:
        The problem with them free and its optimum, or both as they were.
    """
    if not optimum.complete or at_noise(problem, optimum):
        return problem, optimum
    # far from the motion sizes are no reason, and the search along their curved valleys is long
    if far_off(problem, optimum):
        return problem, optimum
    larger, start = with_proportions(problem, optimum)
    if len(larger.unknowns) == len(problem.unknowns):
        return problem, optimum
    return larger, task.search(larger).from_start(start.x)


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
    if not names or not optimum.complete:
        return problem, optimum
    near, found = _from_there(problem, optimum, names, task)
    if task.search(near).explained(found) or not far_off(near, found):
        return near, found
    # a motion that dry friction has brought to rest is so far from every damped one that no step leads there
    far, other = _from_the_start(problem, names, task)
    return (far, other) if pays(found, other, len(names)) else (near, found)


def _from_there(problem: Problem, optimum: Optimum, names: list[str], task: Task) -> tuple[Problem, Optimum]:
    """Go on from an optimum with some frictions free; those that explain nothing are held again."""
    route = task.search(problem).route
    while names:
        freed = problem.mechanism.with_choices(free=names)
        larger, found = with_more_unknowns(problem, optimum, freed, route)
        kept = _not_zero(larger, found, names)
        if kept == names:
            return (larger, found) if pays(optimum, found, len(names)) else (problem, optimum)
        names = kept
    return problem, optimum


def _from_the_start(problem: Problem, names: list[str], task: Task) -> tuple[Problem, Optimum]:
    """Search from accelerations on with some frictions free, and hold those that explain nothing."""
    once = replace(task, settings=replace(task.settings, starts=1))
    larger = posed(problem.mechanism.with_choices(free=names), problem.data)
    search = once.search(larger)
    # where not even short pieces can be followed dry friction is not the reason
    found, _ = search.from_starts(give_up=True)
    kept = _not_zero(larger, found, names)
    if not found.complete or kept == names:
        return near_proportions(larger, found, task)
    smaller = posed(problem.mechanism.with_choices(free=kept), problem.data)
    start = found.trial.at(smaller.unknowns.carried(found.x, larger.unknowns), found.trial.states)
    return near_proportions(smaller, fit_pieces(smaller, start, search.route, search.route.fine), task)


def _not_zero(problem: Problem, optimum: Optimum, names: list[str]) -> list[str]:
    """Return the frictions that do not end at zero; one that does explains nothing, but is an unknown."""
    values = problem.unknowns.named(optimum.x)
    return [name for name in names if values[name] > 0.0]
