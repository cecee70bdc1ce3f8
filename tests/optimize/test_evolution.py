"""Differential evolution: many minima, the box, the seed, what is refused."""

import numpy as np

from minima import Counted, rastrigin, rosenbrock
from monodyn.errors import SettingsError
from monodyn.optimize import evolve
from support import refuses


def test_evolution_finds_the_lowest_of_many_minima():
    """Rastrigin's function has 11^3 minima in the box; the next lowest is at 0.995."""
    counted = Counted(rastrigin)
    box = np.full(3, -5.12), np.full(3, 5.12)
    found = evolve(counted, box, seed=4, population=60, generations=150)
    assert np.abs(found.x).max() < 0.05
    assert found.converged
    assert found.status == "The population has settled."
    assert found.evaluations == sum(x.shape[1] for x in counted.places)
    assert (np.diff(found.history[:, 1]) <= 0).all()
    again = evolve(rastrigin, box, seed=4, population=60, generations=150)
    np.testing.assert_array_equal(found.x, again.x)
    other = evolve(rastrigin, box, seed=5, population=60, generations=150)
    assert not np.array_equal(found.x, other.x)


def test_evolution_stays_in_the_box_and_ends_with_its_generations():
    counted = Counted(rosenbrock)
    found = evolve(counted, (np.zeros(2), np.array([1.0, 2.0])), seed=1, generations=3)
    places = np.concatenate([x.T for x in counted.places])
    assert (places >= 0.0).all()
    assert (places <= [1.0, 2.0]).all()
    assert found.value == min(rosenbrock(x) for x in places)
    assert found.evaluations == len(places) == 40 * 4
    assert not found.converged
    assert found.status == "The generations are over; the best candidate may not be at the minimum."


def test_evolution_lives_with_nan_and_with_a_fixed_unknown():
    found = evolve(
        lambda x: np.where(x[0] > 0.5, (x[0] - 1.0) ** 2 + x[1], np.nan),
        (np.array([-4.0, 2.0]), np.array([4.0, 2.0])), seed=1,
    )  # fmt: skip
    np.testing.assert_allclose(found.x, [1.0, 2.0], atol=1e-2)
    lost = evolve(lambda x: np.full(x.shape[1], np.nan), (np.zeros(2), np.ones(2)), seed=1, generations=2)
    assert (lost.converged, lost.value) == (False, np.inf)
    assert lost.status == "The function is not finite at any candidate; choose other bounds."


def test_evolution_refuses_what_it_cannot_use():
    with refuses(SettingsError, "unknown 1: expected finite bounds, got 0 and inf; bound the search."):
        evolve(rastrigin, (np.zeros(2), np.array([1.0, np.inf])), seed=1)
    with refuses(SettingsError, "evolve: expected a population of 5 or more, got 3."):
        evolve(rastrigin, (np.zeros(2), np.ones(2)), seed=1, population=3)
    with refuses(
        SettingsError, "unknown 0: expected a lower bound below the upper one, got 2 and 1; swap them."
    ):
        evolve(rastrigin, (np.array([2.0, 0.0]), np.ones(2)), seed=1)
