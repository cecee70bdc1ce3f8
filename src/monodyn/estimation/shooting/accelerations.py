"""Smooth motion in, accelerations of the model along it out: a comparison without integrating.

Along a motion that is known well enough to be differentiated twice the equations of motion are algebraic in
the unknowns, and nearly linear. What is found so only gives a start, because the smoothed motion is not
exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.shooting.instance import Instance
from monodyn.estimation.shooting.problem import Problem
from monodyn.mechanism.simulate import accelerations

COORDINATE_STEP = 1e-6
"""Step of the differences by coordinate: exact enough for a start."""
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
    instance, root, weight = problem.at(x), motion.prior_root, motion.weight
    jacobian = np.zeros((weight.size, len(x)))
    if problem.data.torques:
        torque, later = known_torque(problem, motion, instance.lag)
        slopes = torque[:, :, None] * instance.directions.load + later[:, :, None] * instance.directions.lag
    else:
        torque, slopes = instance.drive.derivatives(instance.directions, motion.time * instance.stretch)
    for p in range(len(x)):
        # the torque is linear in its coefficients: its own step is exact, the tree's is a central difference
        ahead, behind = (
            _moved(instance, motion, p, step, torque + step * slopes[:, :, p])
            for step in (COORDINATE_STEP, -COORDINATE_STEP)
        )
        jacobian[:, p] = ((ahead - behind) * weight).ravel() / (2.0 * COORDINATE_STEP)
    return _mismatch(problem, x, motion), np.concatenate((jacobian, root))


def mismatch_cost(problem: Problem, x: np.ndarray, motion: SmoothMotion) -> float:
    """Return the sum of squares of the rows of ``mismatch_rows``.

    Args:
        problem: The problem.
        x: Coordinates, (param,).
        motion: Smooth motion.
    """
    rows = _mismatch(problem, x, motion)
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
    instance = problem.at(x)
    if torque is None and problem.data.torques:
        torque, _ = known_torque(problem, motion, instance.lag)
    acting = instance.drive.at(motion.time * instance.stretch) if torque is None else torque
    return _along(instance, motion, acting)


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
    instance, none = problem.at(x), np.zeros_like(motion.position)
    still = _along(instance, motion, none)
    pushes = np.eye(len(problem.mechanism.joints))
    columns = [_along(instance, motion, none + push) - still for push in pushes]
    return np.stack(columns, axis=2)


def _mismatch(problem: Problem, x: np.ndarray, motion: SmoothMotion) -> np.ndarray:
    rows = (model_accelerations(problem, x, motion) - motion.acceleration) * motion.weight
    return np.concatenate((rows.ravel(), motion.prior_root @ (x - problem.unknowns.x0)))


def _along(instance: Instance, motion: SmoothMotion, torque: np.ndarray) -> np.ndarray:
    """Accelerations by time stamp under a torque, (frame, dof)."""
    unit = np.where(motion.slide, instance.size, 1.0)
    velocity = motion.velocity * unit / instance.stretch
    # true time is stretch times stamped time: rates divide by it once, accelerations twice
    position = motion.position * unit + motion.by_roll * instance.roll
    found = accelerations(instance.tree, position, velocity, torque)
    return found * instance.stretch**2 / unit


def _moved(
    instance: Instance, motion: SmoothMotion, param: int, step: float, torque: np.ndarray
) -> np.ndarray:
    """Accelerations by time stamp with one coordinate moved by ``step``, (frame, dof)."""
    moved = replace(
        instance,
        tree=instance.tree.along(instance.directions, param, step),
        size=instance.size * np.exp(step * instance.dsize[param]),
        stretch=instance.stretch * np.exp(step * instance.dstretch[param]),
        roll=instance.roll + step * instance.droll[param],
    )
    return _along(moved, motion, torque)
