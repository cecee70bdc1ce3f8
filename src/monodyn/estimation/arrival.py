"""What rows that have left a window say: a quadratic of what the motion depends on, and of a state.

Source: Rao, Rawlings and Mayne, Constrained state estimation for nonlinear discrete-time systems: stability
    and moving horizon approximations, 2003 (arrival cost).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Arrival:
    """The cost g.d + 1/2 d.H.d of rows that have left a window.

    Here d is the change of what the motion depends on, then of the state at the first row of the window.

    Attributes:
        point: Where d is zero, (feature + 2 dof,).
        information: H, (feature + 2 dof, feature + 2 dof).
        gradient: g, (feature + 2 dof,).
        pulled: How g follows what moves all positions together, by one deviation of each direction, (feature
            + 2 dof, direction).
    """

    point: np.ndarray
    information: np.ndarray
    gradient: np.ndarray
    pulled: np.ndarray

    def at(self, point: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the cost at a point and its gradient there, (feature + 2 dof,).

        Args:
            point: What the motion depends on, then the state, (feature + 2 dof,).
        """
        away = point - self.point
        pull = self.information @ away
        return float(self.gradient @ away + 0.5 * away @ pull), self.gradient + pull

    def widened(self, noise: np.ndarray) -> Arrival:
        """Return the cost once the state has changed by something that is not known, as where a model lacks
        something.

        Args:
            noise: Covariance of that change, (2 dof, 2 dof).
        """
        count = len(self.point) - len(noise)
        change = np.zeros_like(self.information)
        change[count:, count:] = noise
        # (H^-1 + Q)^-1 = H (1 + Q H)^-1, which needs no inverse of H
        gain = np.linalg.inv(np.eye(len(change)) + change @ self.information)
        known = symmetric(self.information @ gain)
        return Arrival(self.point, known, gain.T @ self.gradient, gain.T @ self.pulled)

    def faded(self, share: float) -> Arrival:
        """Return the cost with a share of its weight, as of what may have changed since.

        Args:
            share: What is left of it, up to 1.
        """
        return Arrival(self.point, share * self.information, share * self.gradient, share * self.pulled)

    def broken_off(self, dofs: int) -> Arrival:
        """Return what it says of the mechanism alone: the state has become another one.

        Args:
            dofs: Number of joints.
        """
        known, count = self.information, len(self.point) - 2 * dofs
        size = np.sqrt(np.maximum(np.diag(known)[count:], 1e-300))
        inverse = np.linalg.pinv(known[count:, count:] / np.outer(size, size), rcond=1e-14, hermitian=True)
        onto = known[:count, count:] @ (inverse / np.outer(size, size))
        left = np.zeros_like(known)
        left[:count, :count] = symmetric(known[:count, :count] - onto @ known[count:, :count])
        gradient, pulled = np.zeros_like(self.gradient), np.zeros_like(self.pulled)
        gradient[:count] = self.gradient[:count] - onto @ self.gradient[count:]
        pulled[:count] = self.pulled[:count] - onto @ self.pulled[count:]
        return Arrival(self.point, left, gradient, pulled)


def symmetric(matrix: np.ndarray) -> np.ndarray:
    """Return a matrix without what rounding has made unequal on both sides of its diagonal, (row, row).

    Args:
        matrix: The matrix, (row, row).
    """
    return 0.5 * (matrix + matrix.T)
