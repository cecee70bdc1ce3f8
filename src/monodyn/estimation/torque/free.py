"""One torque a joint and time stamp (Case III), with nothing assumed about its form but that it is smooth.

Any sizes, masses and friction explain any motion together with such torques, so these are held at the values
that explain most of it without; what is estimated are the torques and the start state.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.shooting.accelerations import model_accelerations, smooth_motion, torque_response
from monodyn.estimation.shooting.prior import Prior
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.search import obstacle
from monodyn.estimation.shooting.shoot import Optimum, Route, fit_pieces, multiple_shooting
from monodyn.estimation.shooting.starts import least_driven
from monodyn.estimation.torque.evidence import FARTHEST
from monodyn.estimation.torque.task import Task, TorqueSolution, frictionless
from monodyn.mechanism import Mechanism
from monodyn.optimize import SearchSettings

MOST_FREE_TORQUES = 2000
"""Unknown torques beyond which the normal equations take minutes."""
WEIGHTS = 10.0 ** np.arange(3.0, -7.0, -1.0)
"""Weights of the curvature of the torque against its size, the smoothest first."""
SIZE_WEIGHT = 1e-6
"""Weight of the torque itself: only for what no measurement touches."""
NEAR_NOISE = 1.1
"""Smoother torques are taken as long as residuals are below this many times the stated noise."""
ROUGHER = SearchSettings(evaluations=12, decrease=1e-4, relative=1e-6)
"""For each further weight, which starts from the torques of the one before."""


def fit_free_torques(mechanism: Mechanism, task: Task) -> TorqueSolution:
    """Explain the motion by one torque a joint and time stamp (Case III); sizes and masses are held.

    Where friction explains the motion it is held too, and the torque comes on top of it; else, or where the
    torque acts ``alone``, it is part of the torque.

    Args:
        mechanism: The start.
        task: What is to be explained.

    Returns:
        The solution.
    """
    if task.settings.series == "alone":
        mechanism = frictionless(mechanism)
    undriven = posed(mechanism.with_torque("friction"), task.data)
    stamps = task.data.times[task.data.measured.any(axis=1)]
    reason = _too_many(task, len(stamps), len(mechanism.joints)) or obstacle(undriven, task.smoothed)
    if reason is not None:
        return TorqueSolution(undriven, None, reason=reason)
    search = replace(task, settings=replace(task.settings, starts=1)).search(undriven)
    optimum, _ = search.from_starts()
    passive = search.explained(optimum)
    x = optimum.x if passive else least_driven(undriven, search.motion)
    held = undriven.mechanism_at(x) if passive else frictionless(undriven.mechanism_at(x))
    driven = held.with_torque("free", knots=stamps * undriven.stretch(x))
    problem = replace(posed(driven, task.data, torques_only=True), base=undriven.size(x))
    # what friction alone leaves over is no torque but an error of the record, which is not fitted either
    noise = max(residual_rms(undriven, optimum), 1.0) if passive else 1.0
    return TorqueSolution(*fit_smooth_torques(problem, task.smoothed, search.route, noise, search.report))


def _too_many(task: Task, stamps: int, joints: int) -> str | None:
    """Return a sentence where there are more records or torques than can be fitted at once, or None."""
    if task.data.records > 1:
        return "Free torques belong to one record each; identify one record at a time."
    if stamps * joints > MOST_FREE_TORQUES:
        return (
            f"{stamps * joints} torques, one a joint and time stamp, are too many at once; fit at most "
            f"{MOST_FREE_TORQUES // joints} frames."
        )
    return None


def smooth_prior(problem: Problem, weight: float, size: np.ndarray) -> Prior:
    """Return the knowledge that torques are smooth: weight |second difference|^2 / size^2 for every joint.

    Args:
        problem: Gives the unknowns, all of them torques, and their order.
        weight: Weight of the curvature.
        size: Typical torque by joint [N m or N], (dof,).

    Returns:
        The information matrix of the torques.
    """
    # entries: which unknown is the torque of a joint (row) at a knot (column)
    entries = problem.mechanism.torques.entries_of(problem.unknowns.names)
    count = entries.shape[1]
    bend = np.diff(np.eye(count), n=2, axis=0) if count > 2 else np.zeros((0, count))
    information = np.zeros((len(problem.unknowns), len(problem.unknowns)))
    for row, scale in zip(entries, size, strict=True):
        information[np.ix_(row, row)] = (weight * bend.T @ bend + SIZE_WEIGHT * np.eye(count)) / scale**2
    return Prior(information, np.zeros(len(problem.unknowns)))


def fit_smooth_torques(
    problem: Problem,
    smoothed: tuple[Smoothed, ...],
    route: Route,
    noise: float = 1.0,
    progress: Callable[[Optimum], None] | None = None,
) -> tuple[Problem, Optimum]:
    """Fit torques and start state, the torques as smooth as the noise of the record allows.

    Args:
        problem: The problem; its unknowns are the torques at the knots.
        smoothed: Smooth motion of the record.
        route: How to search.
        noise: Size of the residuals against the stated noise that is known to be left.
        progress: Called with the result of each stage.

    Returns:
        The problem with the smoothness that was chosen, and its optimum.
    """
    start, size = _from_accelerations(problem, smoothed)
    smoothest = replace(problem, prior=smooth_prior(problem, WEIGHTS[0], size))
    found = multiple_shooting(smoothest, start, smoothed, route, progress)
    # the smoothest torques that follow the record within its noise: rougher ones would follow the noise
    for weight in WEIGHTS[1:]:
        if residual_rms(problem, found) < NEAR_NOISE * noise or not np.isfinite(found.cost):
            break
        smoothest = replace(problem, prior=smooth_prior(problem, weight, size))
        further = fit_pieces(smoothest, found.trial, route, ROUGHER, robust=False)
        found = replace(further, evaluations=found.evaluations + further.evaluations)
        if progress is not None:
            progress(found)
    return smoothest, found


def residual_rms(problem: Problem, optimum: Optimum) -> float:
    """Return the rms of the whitened residuals of what was measured: 1 when it is as large as the noise.

    Args:
        problem: The problem.
        optimum: Its optimum.
    """
    bound = FARTHEST * max(optimum.sigma, 1.0)
    residuals = np.clip(optimum.residuals[problem.data.measured], -bound, bound)
    return float(np.sqrt(np.mean(residuals**2)))


def _from_accelerations(problem: Problem, smoothed: tuple[Smoothed, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Torques that make up for what the accelerations lack, (param,), and their size by joint, (dof,)."""
    x = problem.unknowns.x0
    motion = smooth_motion(problem, smoothed)
    entries = problem.mechanism.torques.entries_of(problem.unknowns.names)
    lacking = motion.acceleration - model_accelerations(problem, x, motion)
    torque = np.linalg.solve(torque_response(problem, x, motion), lacking[:, :, None])[:, :, 0]
    # smooth motion is known at measured rows, knots may lie in between: linear, as the drive itself
    knots, clock, start = problem.mechanism.drive.times, motion.time * problem.stretch(x), x.copy()
    for row, values in zip(entries, torque.T, strict=True):
        start[row] = np.interp(knots, clock, values)
    return start, np.maximum(np.sqrt(np.mean(torque**2, axis=0)), 1e-12)
