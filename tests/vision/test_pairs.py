"""Pairs of least cost, against scipy and by hand."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from monodyn.vision.dots.pairs import cheapest_pairs


def test_the_nearest_is_not_always_the_partner() -> None:
    rows, columns = cheapest_pairs(np.array([[1.0, 2.0, 9.0], [0.0, 4.0, 9.0]]))
    assert (rows.tolist(), columns.tolist()) == ([0, 1], [1, 0])
    rows, columns = cheapest_pairs(np.array([[5.0], [1.0], [3.0]]))
    assert (rows.tolist(), columns.tolist()) == ([1], [0])


def test_pairs_cost_as_little_as_scipys() -> None:
    rng = np.random.default_rng(0)
    for trial in range(300):
        cost = rng.uniform(size=rng.integers(1, 9, 2))
        # many equal costs, as those of spots that are too far away
        cost = np.round(cost, 1) if trial % 3 == 0 else cost
        rows, columns = cheapest_pairs(cost)
        assert len(set(columns.tolist())) == len(rows) == min(cost.shape)
        assert (np.diff(rows) > 0).all()
        assert np.isclose(cost[rows, columns].sum(), cost[linear_sum_assignment(cost)].sum(), rtol=1e-12)
