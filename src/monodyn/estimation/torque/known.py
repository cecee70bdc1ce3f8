"""Known torques in N m at the joints: with them the motion determines masses, and not only their ratios.

Nothing else changes in the problem: a torque that is known has no unknown but its lag, and masses, which
motion alone leaves open up to a factor, are those for which the torque moves them as it did. Where the
file's densities stood for the scale of masses they give way to it, all by one factor.
"""

from __future__ import annotations

from dataclasses import replace

from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.torque.friction import fit_damped
from monodyn.estimation.torque.task import Task, TorqueSolution
from monodyn.mechanism import Mechanism


def fit_known(mechanism: Mechanism, task: Task) -> TorqueSolution:
    """Explain the motion by known torques and friction.

    Args:
        mechanism: The start.
        task: What is to be explained.

    Returns:
        The solution.
    """
    return fit_damped(posed(weighed(mechanism.with_torque("known")), task.data), task)


def weighed(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with its densities free where masses depend on them alone.

    Of a body whose thickness or mass is free the mass is free already; all densities that the user did not
    choose are freed together, and keep their proportions.

    Args:
        mechanism: The mechanism.
    """
    plan, names = mechanism.plan, mechanism.torques.table.names
    free = dict(zip(names, mechanism.free.tolist(), strict=True))
    used = [names[row] for rows in plan.weights for row in rows if names[row].endswith(".density")]
    given = [i for i, rows in enumerate(plan.owned) if rows is not None and mechanism.own[rows[0]]]
    own = {names[row] for i in given for row in plan.weights[i]}
    held = [name for name in used if name not in mechanism.chosen and name not in own]
    if all(free.get(name.replace(".density", ".thickness"), False) for name in held):
        return mechanism
    rows = [mechanism.row(name) for name in held]
    released = mechanism.free.copy()
    released[rows] = True
    return replace(mechanism, free=released)
