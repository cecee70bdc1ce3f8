"""Torques at the joints: Fourier series, and what a motion requires."""

from __future__ import annotations

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.mechanism.drive import fourier_basis
from monodyn.mechanism.simulate import accelerations
from monodyn.mechanism.tree import Tree


def fourier_coefficients(time: np.ndarray, values: np.ndarray, period: float, terms: int) -> np.ndarray:
    """Fit Fourier series to joint positions or torques by least squares, each joint separately.

    Args:
        time: Times [s], (frame,).
        values: What is fitted, NaN where not known, (frame, dof).
        period: The period [s].
        terms: Harmonics M.

    Returns:
        Coefficients mean, cos1, sin1, cos2, ... by joint, (2 M + 1, dof); those of the least norm where the
        frames do not determine them.

    Raises:
        SettingsError: The period is not above 0 or there are no terms.

    Source:
        Eq. (10) of "Estimating dynamics on-the-fly using monocular video", 2012.
    """
    basis, values = fourier_basis(time, period, terms), np.asarray(values, dtype=float)
    found = np.zeros((basis.shape[1], values.shape[1]))
    for dof, column in enumerate(values.T):
        # lstsq takes the least norm where frames are too few, rather than any solution
        use = np.isfinite(column)
        found[:, dof] = np.linalg.lstsq(basis[use], column[use], rcond=None)[0]
    return found


def inverse_dynamics(
    mechanism: Mechanism,
    position: np.ndarray,
    velocity: np.ndarray,
    acceleration: np.ndarray,
    *,
    tree: Tree | None = None,
) -> np.ndarray:
    """Return the torques that a motion requires in addition to the mechanism's own friction and springs.

    tau = M(q) (a - a_0(q, v)) with a_0 the acceleration without them.

    Args:
        mechanism: The mechanism.
        position: Joint positions [rad or m], (frame, dof).
        velocity: Joint rates [rad/s or m/s], (frame, dof).
        acceleration: Joint accelerations [rad/s^2 or m/s^2], (frame, dof).
        tree: Joint tree in place of the mechanism's.

    Returns:
        Torques [N m or N], (frame, dof); NaN where no mass matrix can be computed.

    Source:
        Eq. (8), for any mechanism, of "Estimating dynamics on-the-fly using monocular video", 2012.
    """
    tree = mechanism.tree if tree is None else tree
    count, dofs = position.shape
    motion, found = (position, velocity), np.zeros_like(position)
    # columns of the inverse mass matrix: what a unit torque at each joint adds to the accelerations
    free = accelerations(tree, *motion, np.zeros((count, dofs)))
    pushed = [accelerations(tree, *motion, np.tile(push, (count, 1))) for push in np.eye(dofs)]
    for k in range(count):
        inverse_inertia = np.array([by_joint[k] for by_joint in pushed]).T - free[k][:, None]
        try:
            found[k] = np.linalg.solve(inverse_inertia, acceleration[k] - free[k])
        except np.linalg.LinAlgError:
            # accelerations so large that a unit torque is lost in their rounding
            found[k] = np.nan
    return found


def torque_of_series(
    mechanism: Mechanism, coefficients: np.ndarray, period: float, time: np.ndarray
) -> np.ndarray:
    """Return the torques that a periodic motion requires, tau = f(theta, theta', theta'').

    Args:
        mechanism: The mechanism; its own friction and springs are no part of the torque.
        coefficients: Those of the motion's Fourier series, as `fourier_coefficients` gives them,
            (2 M + 1, dof).
        period: Its period [s].
        time: Times [s], (frame,).

    Returns:
        Torques [N m or N], (frame, dof).

    Raises:
        SettingsError: The period is not above 0 or there are no terms.

    Source:
        Eq. (10) to (12) of "Estimating dynamics on-the-fly using monocular video", 2012.
    """
    terms = (len(coefficients) - 1) // 2
    motion = [fourier_basis(time, period, terms, derivative=k) @ coefficients for k in range(3)]
    return inverse_dynamics(mechanism, *motion)
