"""Convex hulls in space, against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from monodyn.mechanism.hull import hull

BOX = np.array(np.meshgrid([0.0, 1.0], [0.0, 0.1], [0.0, 3.0])).reshape(3, -1).T
RANDOM = np.random.default_rng(0)


@pytest.mark.parametrize(
    "points",
    [
        BOX,
        np.vstack([BOX, 0.5 * BOX + 0.01]),
        RANDOM.uniform(size=(4, 3)),
        # thin, far away and far from round
        RANDOM.normal(size=(500, 3)) * [1.0, 1e-3, 20.0] + 5.0,
    ],
)
def test_a_hull_has_the_corners_and_the_volume_of_scipys(points: np.ndarray) -> None:
    faces, expected = hull(points), ConvexHull(points)
    assert np.unique(faces).tolist() == sorted(expected.vertices.tolist())
    volume = np.abs(np.linalg.det(points[faces] - points.mean(axis=0))).sum() / 6.0
    assert volume == pytest.approx(expected.volume, rel=1e-9)
