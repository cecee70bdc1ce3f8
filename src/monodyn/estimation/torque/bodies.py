"""Bodies whose mass is not spread evenly: masses, centres and inertias as unknowns."""

from __future__ import annotations

from dataclasses import replace

from monodyn.estimation.torque.evidence import with_more_unknowns
from monodyn.estimation.torque.friction import far_off, fit_friction, with_dry_friction
from monodyn.estimation.torque.task import Task, TorqueSolution
from monodyn.mechanism import Mechanism


def fit_free_bodies(solution: TorqueSolution, task: Task) -> TorqueSolution | None:
    """Explain the motion by friction and bodies whose mass may lie anywhere.

    Args:
        solution: Friction with uniform bodies.
        task: What is to be explained.

    Returns:
        The solution; None where bodies are free already, or what is theirs is given.
    """
    problem, optimum = solution.problem, solution.optimum
    mechanism = problem.mechanism.with_bodies("free")
    if optimum is None or not problem.unknowns.uniform or not _free(mechanism):
        return None
    if optimum.complete and not far_off(problem, optimum):
        # nearby, what uniform bodies found is where these begin: sizes, frictions and the motion itself
        begun = problem.mechanism_at(optimum.x).with_bodies("free").values
        larger, found = with_more_unknowns(problem, optimum, mechanism, task.search(problem).route, begun)
        larger, found = with_dry_friction(larger, found, task)
        return replace(solution, problem=larger, optimum=found)
    # far off, sizes and frictions have taken on what the masses should explain
    return fit_friction(mechanism, replace(task, settings=replace(task.settings, starts=1)))


def _free(mechanism: Mechanism) -> bool:
    return any(p.kind == "inertia" and p.free for p in mechanism.parameters)
