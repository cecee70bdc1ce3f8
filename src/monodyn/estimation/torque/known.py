"""Known torques in N m at the joints: with them the motion determines masses, and not only their ratios.

Nothing else changes in the problem: a torque that is known has no unknown but its lag, and masses, which
motion alone leaves open up to a factor, are those for which the torque moves them as it did. Where the
file's densities stood for the scale of masses they give way to it, all by one factor.
"""

from __future__ import annotations

from dataclasses import replace

from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.shoot import fit_pieces
from monodyn.estimation.torque.evidence import pays
from monodyn.estimation.torque.friction import fit_damped
from monodyn.estimation.torque.task import Task, TorqueSolution
from monodyn.mechanism import Mechanism

SCALE_AND_LAG = 2
"""Unknowns that a known torque adds."""
TOO_WEAK = (
    "The known torques do not show in the motion, which is explained as well without them: they were left "
    "out, and masses are known only in ratios. A stronger torque would fix the mass scale; check the unit (N "
    "m) and the clock of the log."
)


def fit_known(mechanism: Mechanism, task: Task) -> TorqueSolution:
    """Explain the motion by known torques and friction; by friction alone where they do not show.

    Args:
        mechanism: The start.
        task: What is to be explained.

    Returns:
        The solution.
    """
    solution = fit_damped(posed(weighed(mechanism.with_torque("known")), task.data), task)
    if solution.optimum is None or not solution.optimum.complete:
        return solution
    without = _without(mechanism, solution, task)
    if without.optimum is None or pays(without.optimum, solution.optimum, SCALE_AND_LAG):
        return solution
    return without


def _without(mechanism: Mechanism, solution: TorqueSolution, task: Task) -> TorqueSolution:
    """Go on from an optimum without its torques, and with the densities of the file."""
    problem, optimum = solution.problem, solution.optimum
    if optimum is None:
        return solution
    undriven = problem.mechanism.with_torque("friction")
    free = undriven.free.copy()
    densities = [p.name for p in mechanism.parameters if p.kind == "density"]
    free[undriven.rows(densities)] = [mechanism.parameter(n).free for n in densities]
    passive = posed(replace(undriven, free=free), replace(task.data, torques=()))
    route = task.search(passive).route
    start = optimum.trial.at(passive.unknowns.carried(optimum.x, problem.unknowns), optimum.trial.states)
    found = fit_pieces(passive, start, route, route.fine)
    return TorqueSolution(passive, found, solution.tried, advice=(TOO_WEAK,))


def weighed(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with its densities free where masses depend on them alone.

    Of a geom whose thickness or mass is free the mass is free already; where one has neither, all densities
    that the user did not choose are freed together, and keep their proportions.

    Args:
        mechanism: The mechanism.
    """
    plan, names = mechanism.plan, mechanism.torques.table.names
    free = dict(zip(names, mechanism.free.tolist(), strict=True))
    # a body that has a mass of its own does not depend on the densities of its geoms
    follows = [rows is not None and not mechanism.own[rows[0]] for rows in plan.owned]
    used = [names[row] for rows, own in zip(plan.weights, follows, strict=True) if own for row in rows]
    held = [n for n in used if n.endswith(".density") and n not in mechanism.chosen and not free[n]]
    if all(free.get(name.replace(".density", ".thickness"), False) for name in held):
        return mechanism
    released = mechanism.free.copy()
    released[mechanism.rows(held)] = True
    return replace(mechanism, free=released)
