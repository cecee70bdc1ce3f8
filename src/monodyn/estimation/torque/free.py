"""One torque a joint and time stamp (Case III), with nothing assumed about its form but that it is smooth.

Any sizes, masses and friction explain any motion together with such torques, so these are held at the values
that explain most of it without; what is estimated are the torques and the start state.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.shooting.problem import Problem, smooth_motion
from monodyn.estimation.shooting.shoot import Grown, Route, fit_pieces, grow
from monodyn.estimation.shooting.unknowns import Prior
from monodyn.optimize import SearchSettings

MOST_TORQUES = 2000
"""Unknown torques beyond which the normal equations take minutes."""
WEIGHTS = 10.0 ** np.arange(3.0, -7.0, -1.0)
"""Weights of the curvature of the torque against its size, the smoothest first."""
SIZE = 1e-6
"""Weight of the torque itself: only for what no measurement touches."""
NEAR = 1.1
"""Smoother torques are taken as long as residuals are below so many times the stated noise."""
SEARCH = SearchSettings(evaluations=12, decrease=1e-4, relative=1e-6)


def smooth_prior(problem: Problem, weight: float, size: np.ndarray) -> Prior:
    """Return the knowledge that torques are smooth: weight |second difference|^2 / size^2 for every joint.

    Args:
        problem: Gives the unknowns, all of them torques, and their order.
        weight: Weight of the curvature.
        size: Typical torque by joint [N m or N], (dof,).
    """
    way = problem.mechanism.drive_entries(problem.unknowns.names)
    count = way.shape[1]
    bend = np.diff(np.eye(count), n=2, axis=0) if count > 2 else np.zeros((0, count))
    information = np.zeros((len(problem.unknowns), len(problem.unknowns)))
    for row, scale in zip(way, size, strict=True):
        information[np.ix_(row, row)] = (weight * bend.T @ bend + SIZE * np.eye(count)) / scale**2
    return Prior(information, np.zeros(len(problem.unknowns)))


def fit_torques(
    problem: Problem,
    smoothed: tuple[Smoothed, ...],
    route: Route,
    noise: float = 1.0,
    progress: Callable[[Grown], None] | None = None,
) -> tuple[Problem, Grown]:
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
    trial = replace(problem, prior=smooth_prior(problem, WEIGHTS[0], size))
    found = grow(trial, start, smoothed, route, progress)
    for weight in WEIGHTS[1:]:
        if left_over(problem, found) < NEAR * noise or not np.isfinite(found.cost):
            break
        trial = replace(problem, prior=smooth_prior(problem, weight, size))
        further = fit_pieces(trial, found.x, found.states, found.pieces, route, SEARCH, robust=False)
        found = replace(further, evaluations=found.evaluations + further.evaluations)
        if progress is not None:
            progress(found)
    return trial, found


def left_over(problem: Problem, grown: Grown) -> float:
    """Return the rms of the whitened residuals of what was measured: 1 when it is as large as the noise."""
    return float(np.sqrt(np.mean(grown.residuals[problem.data.measured] ** 2)))


def _from_accelerations(problem: Problem, smoothed: tuple[Smoothed, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Torques that make up for what the accelerations lack, (param,), and their size by joint, (dof,)."""
    x = problem.unknowns.x0
    motion = smooth_motion(problem, smoothed)
    way = problem.mechanism.drive_entries(problem.unknowns.names)
    lacking = motion.acceleration - problem.accelerations(x, motion)
    torque = np.linalg.solve(problem.torque_response(x, motion), lacking[:, :, None])[:, :, 0]
    knots, clock, start = problem.mechanism.drive.times, motion.time * problem.stretch(x), x.copy()
    for row, values in zip(way, torque.T, strict=True):
        start[row] = np.interp(knots, clock, values)
    return start, np.maximum(np.sqrt(np.mean(torque**2, axis=0)), 1e-12)
