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
    other = lambda a, b: False  # noqa: E731
    assert first_good(float_of, numbers, cost=abs, good=lambda r: r < 3.5, same=other) == (3.0, 2)
    assert first_good(float_of, numbers, cost=abs, good=lambda r: False, same=other) == (3.0, 3)
    with pytest.raises(ValueError, match=r"^first_good: expected at least one start, got none\.$"):
        first_good(float_of, [], cost=abs, good=bool, same=other)


def test_what_was_found_twice_is_taken():
    numbers = [np.array([x]) for x in (5.0, 3.0, 4.9, 3.01, 1.0)]
    near = lambda a, b: abs(a - b) < 0.1  # noqa: E731
    # 5 and 4.9 are alike too, but by then something cheaper was known
    assert first_good(float_of, numbers, cost=abs, good=lambda r: False, same=near) == (3.0, 4)


def float_of(x):
    return float(x[0])
