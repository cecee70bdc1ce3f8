"""Viscous friction at every joint (Case I), and dry friction where the motion shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from monodyn.estimation.record.samples import cut
from monodyn.estimation.shooting import shoot
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.search import obstacle
from monodyn.estimation.shooting.shoot import Optimum
from monodyn.estimation.torque.evidence import at_noise, gains, pays, with_more_unknowns
from monodyn.estimation.torque.task import Task, TorqueSolution
from monodyn.mechanism import Mechanism

FAR_SHARE, FAR_NOISE = 0.02, 10.0
"""Typical difference, as a share of the motion and in units of the noise, above which the motion may be
another one altogether."""
LEAD = 5e-3
"""Where the search for how far ahead of the rate dry friction turns begins [s]: half of MuJoCo's default."""
FEW_RECORDS = 1
"""Records of which it is sought, at most: the fits of many take too long."""
PIECES = 4
"""Length of the pieces in which it has to show first, in units of the first ones of a search."""


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
    return optimum.sigma > FAR_NOISE and shoot.relative_difference(problem, optimum.trial) >= FAR_SHARE


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
    larger, start = shoot.with_proportions(problem, optimum)
    if len(larger.unknowns) == len(problem.unknowns):
        return problem, optimum
    return larger, task.search(larger).from_start(start.x)


def with_dry_friction(problem: Problem, optimum: Optimum, task: Task) -> tuple[Problem, Optimum]:
    """Free the dry frictions that the user did not choose, and keep those that the motion shows; then how far
    ahead of the rate they turn, where that is left over.

    Args:
        problem: The problem with dry friction held.
        optimum: Its optimum.
        task: What is to be explained.

    Returns:
        The problem with them free and its optimum, or both as they were.
    """
    rubbing, found = _with_frictions(problem, optimum, task)
    leading, ahead = _with_leads(rubbing, found, task)
    if leading is rubbing:
        return rubbing, ahead
    # a friction that explains nothing while it turns with the rate may do so where it turns ahead
    return with_dry_friction(leading, ahead, task)


def _with_frictions(problem: Problem, optimum: Optimum, task: Task) -> tuple[Problem, Optimum]:
    """Free the dry frictions that the user did not choose, and keep those that the motion shows."""
    mechanism = problem.mechanism
    names = [
        p.name
        for p in mechanism.parameters
        if p.kind == "friction" and p.name not in mechanism.chosen and not p.free
    ]
    if not names or not optimum.complete:
        return problem, optimum
    if not far_off(problem, optimum):
        return _from_there(problem, optimum, names, task)
    # a motion that dry friction has brought to rest is so far from every damped one that no step leads there
    larger, found = _from_the_start(problem, names, task)
    return (larger, found) if pays(optimum, found, len(names)) else (problem, optimum)


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
    return near_proportions(smaller, shoot.fit_pieces(smaller, start, search.route, search.route.fine), task)


def _not_zero(problem: Problem, optimum: Optimum, names: list[str]) -> list[str]:
    """Return the frictions that do not end at zero; one that does explains nothing, but is an unknown."""
    values = problem.unknowns.named(optimum.x)
    return [name for name in names if values[name] > 0.0]


def _with_leads(problem: Problem, optimum: Optimum, task: Task) -> tuple[Problem, Optimum]:
    """Free how far ahead of the rate dry friction turns, where something is left over and it pays.

    No bearing does that, but the soft constraint by which a simulator has dry friction does.
    """
    if not optimum.complete or at_noise(problem, optimum) or problem.data.records > FEW_RECORDS:
        return problem, optimum
    names = _leading(problem, optimum)
    if not names:
        return problem, optimum
    larger, search = problem.of(led(problem.mechanism, names)), task.search(problem)
    # in pieces, for a motion in which friction turns earlier soon leaves the one before; where they cannot be
    # followed a lead is not the reason, and where they show none neither does the whole
    pieces = cut(problem.data, PIECES * search.route.piece)
    begun = problem.started(optimum.x, pieces, task.smoothed)
    before = shoot.fit_pieces(problem, begun, search.route, shoot.ROUGH)
    if search.hopeless(before):
        return problem, optimum
    x = larger.unknowns.carried(before.x, problem.unknowns)
    after = shoot.fit_pieces(larger, larger.started(x, pieces, task.smoothed), search.route, shoot.ROUGH)
    if not gains(before, after, 1):
        return problem, optimum
    found = shoot.multiple_shooting(larger, after.x, task.smoothed, search.route, search.report)
    ends = found.at_bound[larger.unknowns.of_kind("lead")]
    if ends.any() or not pays(optimum, found, 1):
        return problem, optimum
    return _unless_found_without(problem, larger, found, task)


def led(mechanism: Mechanism, names: Sequence[str]) -> Mechanism:
    """Return a mechanism in which dry friction turns ahead of the rate, by a time to be estimated.

    Args:
        mechanism: The mechanism.
        names: Leads that are free, together unless the user has chosen one.
    """
    values, free = mechanism.values, mechanism.free.copy()
    free[mechanism.rows(names)] = True
    return replace(mechanism.with_values({name: values[name] or LEAD for name in names}), free=free)


def _leading(problem: Problem, optimum: Optimum) -> list[str]:
    """Return the leads where dry friction acts, but for the chosen; none where all are free."""
    values, mechanism = problem.unknowns.named(optimum.x), problem.mechanism
    rubbing = [j.name for j in mechanism.joints if values.get(f"{j.name}.friction", 0.0) > 0.0]
    leads = [mechanism.parameter(f"{name}.lead") for name in rubbing]
    names = [lead.name for lead in leads if lead.name not in mechanism.chosen]
    return [] if all(mechanism.parameter(name).free for name in names) else names


def _unless_found_without(
    problem: Problem, larger: Problem, found: Optimum, task: Task
) -> tuple[Problem, Optimum]:
    """Return an optimum with leads, or what is found from there without them if they explain no more."""
    route = task.search(problem).route
    x = problem.unknowns.carried(found.x, larger.unknowns)
    without = shoot.fit_pieces(problem, found.trial.at(x, found.trial.states), route, route.fine)
    return (larger, found) if pays(without, found, 1) or not without.complete else (problem, without)
