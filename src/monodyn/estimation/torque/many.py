"""Many records: a few of them decide where the search ends and what acts, all of them where exactly.

A search from an unknown start evaluates its records some hundred times, and most of that only finds the
valley of the optimum and the kind of torque. Records of one mechanism share both, so that a few of them will
do; from there all records together need some ten evaluations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from monodyn.estimation.shooting.search import obstacle
from monodyn.estimation.shooting.shoot import multiple_shooting
from monodyn.estimation.torque.task import Task, TorqueSolution
from monodyn.mechanism import Mechanism

FEW = 4
"""Records that are searched first; with under twice as many all of them are."""
WORSE = 1.5
"""Where all records are met this many times worse than the few, something acts that the few do not show."""

TorqueModel = Callable[[Mechanism, Task], TorqueSolution]


def fit_many(model: TorqueModel, mechanism: Mechanism, task: Task) -> TorqueSolution:
    """Explain the motion of all records, from what explains a few of them.

    Args:
        model: Explains records from the mechanism's start.
        mechanism: The start.
        task: What is to be explained.

    Returns:
        The solution of all records; the model's own where they are few, where the few are not followed, or
        where the others are not as the few.
    """
    # what acts at one time, or is logged record by record, says nothing of other records; and whether the
    # roll of a camera is an unknown depends on which records were measured in a picture
    filmed = task.data.by_roll.any(axis=1)
    mixed = bool(filmed.any() and not filmed.all())
    apart = bool(task.data.torques) or task.settings.torque == "free" or mixed
    if task.data.records < 2 * FEW or apart:
        return model(mechanism, task)
    chosen = np.unique(np.linspace(0, task.data.records - 1, FEW).astype(int))
    found = model(mechanism, task.of(chosen))
    if found.optimum is None or not found.optimum.complete or found.problem.mechanism.torque == "free":
        return model(mechanism, task)
    problem = found.problem.with_data(task.data)
    if obstacle(problem, task.smoothed) is not None:
        return model(mechanism, task)
    search = task.search(problem)
    optimum = multiple_shooting(problem, found.optimum.x, task.smoothed, search.route, search.report)
    if not optimum.complete or optimum.sigma > WORSE * max(found.optimum.sigma, 1.0):
        return model(mechanism, task)
    spent = optimum.evaluations + found.optimum.evaluations
    optimum = replace(optimum, evaluations=spent, twins=found.optimum.twins)
    return replace(found, problem=problem, optimum=optimum)
