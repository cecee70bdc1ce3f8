"""Where a search under known torques begins: the masses that they move as they did, and their lag.

Along smooth motion the accelerations are linear in the torque over the masses, and nearly so in the other
unknowns. So for every lag the best scale of masses is one linear least squares, in which the others may move.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.arrays import usual_step
from monodyn.estimation.shooting import accelerations
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.scaling import with_masses
from monodyn.mechanism.torques import LAG

MOST_LAGS = 81
"""Lags that are tried, between their bounds."""
PER_FRAME = 2
"""Lags in the time between two rows."""
DEPENDENT = 1e-6
"""Directions of the other unknowns below this share of the largest are none."""


def at_best_torque(problem: Problem, x: np.ndarray, motion: accelerations.SmoothMotion) -> np.ndarray:
    """Move the scale of masses and the lag to where known torques explain most of the accelerations.

    Args:
        problem: The problem, with known torques.
        x: Coordinates, (param,).
        motion: Smooth motion.

    Returns:
        Coordinates within the bounds, (param,); ``x`` where no lag makes the torques act along the motion.

    Source:
        Golub and Pereyra, The differentiation of pseudo-inverses and nonlinear least squares problems whose
        variables separate, 1973.
    """
    undriven = problem.with_data(replace(problem.data, torques=()))
    rows, jacobian = accelerations.mismatch_rows(undriven, x, motion)
    norms = np.linalg.norm(jacobian, axis=0)
    left, singular, _ = np.linalg.svd(jacobian / np.where(norms > 0, norms, 1.0), full_matrices=False)
    # without a torque masses have no scale: what moves nothing must not take a direction from the torque
    span = left[:, singular > DEPENDENT * max(float(singular.max(initial=0.0)), 1e-300)]
    lacking = rows - span @ (span.T @ rows)
    response = accelerations.torque_response(undriven, x, motion) * motion.weight[:, :, None]
    best, gain, scale = x, 0.0, 1.0
    for at in _lagged(problem, x, motion):
        torque, _ = accelerations.known_torque(problem, motion, problem.at(at).lag)
        pushed = np.zeros_like(rows)
        pushed[: motion.weight.size] = np.einsum("fij,fj->fi", response, torque).ravel()
        pushed -= span @ (span.T @ pushed)
        along, size = -float(pushed @ lacking), float(pushed @ pushed)
        # a torque against the motion would take masses below zero
        if along > 0 and along**2 > gain * size:
            best, gain, scale = at, along**2 / size, along / size
    return with_masses(problem, best, 1.0 / scale)


def _lagged(problem: Problem, x: np.ndarray, motion: accelerations.SmoothMotion) -> list[np.ndarray]:
    """Return the coordinates at each lag that is tried."""
    unknowns = problem.unknowns
    if LAG not in unknowns.names:
        return [x]
    i = unknowns.names.index(LAG)
    low, high = float(unknowns.lower[i]), float(unknowns.upper[i])
    step = usual_step(np.unique(motion.time)) / PER_FRAME if len(motion.time) > 1 else np.inf
    count = min(int((high - low) / step) + 2, MOST_LAGS)
    found = []
    for lag in np.append(np.linspace(low, high, count), x[i]):
        at = x.copy()
        at[i] = lag
        found.append(at)
    return found
