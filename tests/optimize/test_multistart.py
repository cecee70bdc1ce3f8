"""Several starts: the same for a seed, tried in order."""

import numpy as np
import pytest

from monodyn.optimize import first_good, scatter


def test_starts_repeat_for_a_seed_and_hold_the_first():
    a, b = (scatter(np.array([1.0, 2.0]), np.array([0.5, 0.0]), 4, seed=3) for _ in range(2))
    np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(a[0], [1.0, 2.0])
    assert np.all(np.abs(a[:, 0] - 1.0) <= 0.5)


def test_first_good_stops_early_and_takes_the_cheapest_otherwise():
    numbers = [np.array([x]) for x in (5.0, 3.0, 4.0)]
    assert first_good(float_of, numbers, cost=abs, good=lambda r: r < 3.5) == (3.0, 2)
    assert first_good(float_of, numbers, cost=abs, good=lambda r: False) == (3.0, 3)
    with pytest.raises(ValueError, match=r"^first_good: expected at least one start, got none\.$"):
        first_good(float_of, [], cost=abs, good=bool)


def float_of(x):
    return float(x[0])
