"""Smooth motion in, accelerations of the model along it out: a comparison without integrating.

Along a motion that is known well enough to be differentiated twice the equations of motion are algebraic in
the unknowns, and nearly linear. What is found so only gives a start, because the smoothed motion is not
exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.shooting.problem import Problem
from monodyn.mechanism.simulate import acceleration_derivatives, accelerations
from monodyn.mechanism.tree import Tree

MOST_STAMPS = 400
"""Time stamps that are compared; more of them would not make the start any better."""
MODEL_SHARE = 0.05
"""Share of the usual acceleration that smoothing may miss: no row weighs more than that allows."""


@dataclass(frozen=True, eq=False)
class SmoothMotion:
    """Smooth motion at measured rows.

    Attributes:
        time: Time stamps [s], (frame,).
        position: Positions [rad or m], (frame, dof).
        velocity: Rates by time stamp [rad/s or m/s], (frame, dof).
        acceleration: Accelerations by time stamp [rad/s^2 or m/s^2], (frame, dof).
        weight: One over the standard deviation of the accelerations, (frame, dof).
        slide: True for slides in the start scale, (frame, dof).
        by_roll: What a roll of the camera adds to the positions to give those against gravity, (frame, dof).
        prior_root: Square root of the picture's information, (row, param).
        record: Record of each row, int (frame,).
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    weight: np.ndarray
    slide: np.ndarray
    by_roll: np.ndarray
    prior_root: np.ndarray
    record: np.ndarray

    @property
    def at_rest(self) -> SmoothMotion:
        """The same positions without rates, where weight alone acts."""
        return replace(self, velocity=np.zeros_like(self.velocity))


def smooth_motion(problem: Problem, smoothed: tuple[Smoothed, ...]) -> SmoothMotion:
    """Collect smooth motion at rows where all joints were measured, away from the ends of the records.

    Args:
        problem: The problem.
        smoothed: Smooth motion of each record.

    Returns:
        The motion at up to ``MOST_STAMPS`` time stamps, evenly chosen.
    """
    parts = []
    for record, found in enumerate(smoothed):
        a, b = problem.data.first[record : record + 2]
        rows = problem.data.source[a:b][problem.data.measured[a:b].all(axis=1)]
        # a cubic has neighbours on one side only at the ends, and its second derivative is poor there
        rows = rows[2:-2] if len(rows) > 12 else rows
        of_record = (problem.data.slide[record], problem.data.by_roll[record], np.array(record))
        kept = (found.time, found.position, found.velocity, found.acceleration, found.acceleration_std)
        repeated = (np.repeat(value[None], len(rows), axis=0) for value in of_record)
        parts.append((*(values[rows] for values in kept), *repeated))
    t, q, v, a, std, slide, turned, of = (np.concatenate(part) for part in zip(*parts, strict=True))
    if len(q) > MOST_STAMPS:
        pick = np.linspace(0, len(q) - 1, MOST_STAMPS).astype(int)
        t, q, v, a, std, slide, turned, of = (values[pick] for values in (t, q, v, a, std, slide, turned, of))
    # the noise alone would give the smoothest rows all the weight, and smoothing misses more than noise there
    usual = np.sqrt(np.mean(a**2, axis=0)) + 1e-9 if len(a) else np.ones(q.shape[1])
    weight = 1.0 / np.sqrt(std**2 + (MODEL_SHARE * usual) ** 2)
    # information A = R'R as further rows R (x - x0) of the least squares
    values, vectors = np.linalg.eigh(problem.prior.information)
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    return SmoothMotion(t, q, v, a, weight, slide, turned, root, of)


def mismatch_rows(problem: Problem, x: np.ndarray, motion: SmoothMotion) -> tuple[np.ndarray, np.ndarray]:
    """Weigh the mismatch of accelerations, and differentiate it.

    Args:
        problem: The problem.
        x: Coordinates, (param,).
        motion: Smooth motion.

    Returns:
        Mismatches (row,) and their Jacobian (row, param): those of each time stamp and joint, then the
        picture's information about the sizes.
    """
    instance, root = problem.at(x), motion.prior_root
    if problem.data.torques:
        torque, later = known_torque(problem, motion, instance.lag)
        slopes = torque[:, :, None] * instance.directions.load + later[:, :, None] * instance.directions.lag
    else:
        torque, slopes = instance.drive.derivatives(instance.directions, motion.time * instance.stretch)
    unit, velocity, position = _scaled(problem, x, motion)
    count, dofs = len(x), position.shape[1]
    found, by = acceleration_derivatives(instance.tree, instance.directions, position, velocity, torque)
    jacobian, by_position, by_velocity, by_torque = np.split(
        by, [count, count + dofs, count + 2 * dofs], axis=2
    )
    # what was measured is scaled, turned and timed by the unknowns before the model sees it, and scaled back
    size = np.where(motion.slide[:, :, None], instance.dsize, 0.0)
    away = (motion.position * unit)[:, :, None] * size + motion.by_roll[:, :, None] * instance.droll
    faster = velocity[:, :, None] * (size - instance.dstretch)
    jacobian = jacobian + by_position @ away + by_velocity @ faster + by_torque @ slopes
    jacobian = jacobian + found[:, :, None] * (2.0 * instance.dstretch - size)
    jacobian *= (instance.stretch**2 / unit * motion.weight)[:, :, None]
    rows = _weighed(problem, x, motion, found * instance.stretch**2 / unit)
    return rows, np.concatenate((jacobian.reshape(motion.weight.size, count), root))


def mismatch_cost(problem: Problem, x: np.ndarray, motion: SmoothMotion) -> float:
    """Return the sum of squares of the rows of ``mismatch_rows``.

    Args:
        problem: The problem.
        x: Coordinates, (param,).
        motion: Smooth motion.
    """
    rows = _weighed(problem, x, motion, model_accelerations(problem, x, motion))
    return float(rows @ rows)


def model_accelerations(
    problem: Problem, x: np.ndarray, motion: SmoothMotion, torque: np.ndarray | None = None
) -> np.ndarray:
    """Return the accelerations that the model has along smooth motion.

    Args:
        problem: The problem.
        x: Coordinates, (param,).
        motion: Smooth motion.
        torque: Torques other than friction and springs [N m or N], (frame, dof); None takes the drive's.

    Returns:
        Accelerations by time stamp [rad/s^2 or m/s^2], (frame, dof).
    """
    mechanism = problem.mechanism_at(x)
    if torque is None and problem.data.torques:
        torque, _ = known_torque(problem, motion, problem.lag(mechanism))
    acting = mechanism.drive.at(motion.time * problem.stretch(x)) if torque is None else torque
    return _along(problem, x, mechanism.tree, motion, acting)


def known_torque(problem: Problem, motion: SmoothMotion, lag: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the known torques along smooth motion.

    Args:
        problem: The problem, with known torques.
        motion: Smooth motion.
        lag: How much later than in their log they act [s].

    Returns:
        Torques [N m or N] and their derivatives by the lag, each (frame, dof).
    """
    found = np.zeros((2, *motion.position.shape))
    for record, torques in enumerate(problem.data.torques):
        rows = motion.record == record
        at = np.searchsorted(torques.times, motion.time[rows])
        found[:, rows] = np.stack(torques.at(lag))[:, at]
    return found[0], found[1]


def torque_response(problem: Problem, x: np.ndarray, motion: SmoothMotion) -> np.ndarray:
    """Return what a unit torque at each joint adds to the accelerations.

    Args:
        problem: The problem.
        x: Coordinates, (param,).
        motion: Smooth motion.

    Returns:
        Accelerations by time stamp of each joint for a torque at each joint, (frame, dof, dof).
    """
    # accelerations are linear in the torque: one unit each, less what acts without
    tree, none = problem.mechanism_at(x).tree, np.zeros_like(motion.position)
    still = _along(problem, x, tree, motion, none)
    pushes = np.eye(len(problem.mechanism.joints))
    columns = [_along(problem, x, tree, motion, none + push) - still for push in pushes]
    return np.stack(columns, axis=2)


def _weighed(problem: Problem, x: np.ndarray, motion: SmoothMotion, found: np.ndarray) -> np.ndarray:
    """Weigh the mismatch of accelerations by time stamp, (frame, dof), and add the picture's information."""
    rows = (found - motion.acceleration) * motion.weight
    return np.concatenate((rows.ravel(), motion.prior_root @ (x - problem.unknowns.x0)))


def _along(
    problem: Problem, x: np.ndarray, tree: Tree, motion: SmoothMotion, torque: np.ndarray
) -> np.ndarray:
    """Accelerations by time stamp under a torque, (frame, dof)."""
    unit, velocity, position = _scaled(problem, x, motion)
    return accelerations(tree, position, velocity, torque) * problem.stretch(x) ** 2 / unit


def _scaled(
    problem: Problem, x: np.ndarray, motion: SmoothMotion
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return metres per unit of the record, rates in true time and positions, (frame, dof) each."""
    unit = np.where(motion.slide, problem.size(x), 1.0)
    # true time is stretch times stamped time: rates divide by it once, accelerations twice
    velocity = motion.velocity * unit / problem.stretch(x)
    return unit, velocity, motion.position * unit + motion.by_roll * problem.roll(x)
