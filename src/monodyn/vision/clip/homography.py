"""Where a still scene appears in a picture: displaced, turned, zoomed, and seen from the side."""

from __future__ import annotations

import cmath
from typing import NamedTuple

import numpy as np


class Homography(NamedTuple):
    """Maps points of the scene to a picture, both from the middle of the picture.

    Attributes:
        entries: Its matrix for points (x, y, 1), the last entry 1, (3, 3).
        size: Width and height of the picture [px].
    """

    entries: np.ndarray
    size: tuple[int, int]

    @property
    def middle(self) -> np.ndarray:
        """Middle of the picture [px], (2,)."""
        return 0.5 * (np.array(self.size) - 1.0)

    @property
    def shift(self) -> np.ndarray:
        """Displacement of what is in the middle, to the right and down [px], (2,)."""
        return self.entries[:2, 2]

    @property
    def zoom(self) -> float:
        """Size of the scene in the picture over its own."""
        return abs(self._growth)

    @property
    def turn(self) -> float:
        """Turn of the scene in the picture, counter-clockwise as seen [rad]."""
        return -cmath.phase(self._growth)

    @property
    def _growth(self) -> complex:
        m = self.entries
        return complex(m[0, 0] + m[1, 1], m[1, 0] - m[0, 1]) / 2.0

    @property
    def matrix(self) -> np.ndarray:
        """Its matrix for points in pixels, (3, 3)."""
        middle, matrix = self.middle, self.entries.copy()
        matrix[:, 2] -= matrix[:, :2] @ middle
        matrix[:2] += middle[:, np.newaxis] * matrix[2]
        return matrix

    @property
    def inverse(self) -> Homography:
        """The map from the picture to the scene."""
        return self._replace(entries=_normalized(np.linalg.inv(self.entries)))

    def after(self, first: Homography) -> Homography:
        """Return the map that applies another one first.

        Args:
            first: The other one.
        """
        return self._replace(entries=_normalized(self.entries @ first.entries))

    def of(self, points: np.ndarray) -> np.ndarray:
        """Map points.

        Args:
            points: Points [px], (point, 2).

        Returns:
            Where they are mapped [px], (point, 2).
        """
        matrix = self.matrix
        moved = points @ matrix[:, :2].T + matrix[:, 2]
        return moved[:, :2] / moved[:, 2:]

    def apart(self, other: Homography) -> float:
        """Return by how much two maps differ in the middle and halfway to the corners, at most [px].

        Args:
            other: The other one.
        """
        signs = np.array([[0.0, 0.0], [-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]])
        points = self.middle * (1.0 + signs)
        return float(np.hypot(*(self.of(points) - other.of(points)).T).max())


def _normalized(matrix: np.ndarray) -> np.ndarray:
    return matrix / matrix[2, 2]


def at_rest(size: tuple[int, int]) -> Homography:
    """Return the map of a camera that has not moved.

    Args:
        size: Width and height of the picture [px].
    """
    return Homography(np.eye(3), size)
