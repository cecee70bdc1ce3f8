"""What the searches check: bounds and sizes, the same message whichever search is asked."""

import numpy as np
import pytest

from minima import rosenbrock, rosenbrock_residuals
from monodyn.errors import SettingsError
from monodyn.optimize import augmented_lagrangian, bounded_bfgs, minimize
from monodyn.optimize.minimum import Tally, checked_sizes
from support import refuses


def multipliers(start, bounds):
    return augmented_lagrangian(rosenbrock, start, bounds, step=0.5)


def bfgs(start, bounds):
    return bounded_bfgs(rosenbrock_residuals, start, bounds)


def squares(start, bounds):
    return minimize(lambda x: (rosenbrock_residuals(x), np.ones((2, 2))), start, bounds)


@pytest.mark.parametrize("search", [multipliers, bfgs, squares])
def test_bad_bounds_have_one_message(search):
    with refuses(SettingsError, "unknown 1: the start 2 is outside its bounds -1 to 1; move it inside."):
        search(np.array([0.0, 2.0]), (-1.0, 1.0))
    with refuses(
        SettingsError, "unknown 0: expected a lower bound below the upper one, got 1 and -1; swap them."
    ):
        search(np.zeros(2), (1.0, -1.0))


def test_sizes_are_above_zero_and_finite():
    with refuses(SettingsError, "unknown 1: expected a step above 0, got -1."):
        checked_sizes(np.array([1.0, -1.0]), 2, "step")
    with refuses(SettingsError, "unknown 0: expected a step above 0, got inf."):
        checked_sizes(np.inf, 2, "step")


def test_a_tally_remembers_the_least_value_and_takes_nan_as_infinite():
    tally = Tally(lambda x: float(x[0]) if x[0] > 0 else np.nan)
    assert [tally(np.array([x])) for x in (2.0, -1.0, 1.0, 3.0)] == [2.0, np.inf, 1.0, 3.0]
    assert (tally.evaluations, tally.value) == (4, 1.0)
