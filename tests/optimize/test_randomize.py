"""Draws of bent distributions against closed forms and plain Monte Carlo."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.optimize import Draws, minimize, randomized

SIDES = (0.025, 0.5, 0.975)


def quantiles(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the ends and the middle of a 95 % interval of weighted values."""
    order = np.argsort(values)
    return np.interp(SIDES, np.cumsum(weights[order]) - 0.5 * weights[order], values[order])


def squared(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The square of a parameter about 1 +- 0.4 is measured as 1.6 +- 0.3."""
    a = points[:, 0]
    rows = np.stack(((a**2 - 1.6) / 0.3, (a - 1.0) / 0.4), axis=1)
    return rows, np.stack((2.0 * a / 0.3, np.full_like(a, 1.0 / 0.4)), axis=1)[:, :, None]


def product(measured: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A length times e to the power of another unknown is measured to 0.02; either is about 0 +- 1."""
    a, b = points.T
    grown = np.exp(0.7 * b)
    rows = np.stack(((a + grown - measured) / 0.02, a, b), axis=1)
    one, none = np.ones_like(a), np.zeros_like(a)
    slopes = [[one / 0.02, 0.7 * grown / 0.02], [one, none], [none, one]]
    return rows, np.moveaxis(np.array(slopes), -1, 0)


def drawn(rows, best: np.ndarray, count: int, seed: int = 0) -> Draws:
    """Draw about the peak, which is searched from ``best``."""
    found = minimize(lambda x: tuple(part[0] for part in rows(x[None])), best).x
    size = rows(best[None])[0].shape[1]
    return randomized(rows, found, np.random.default_rng(seed).normal(size=(count, size)))


def test_linear_residuals_give_draws_of_equal_weight() -> None:
    slope = np.array([[1.0, 2.0], [0.5, -1.0], [0.0, 3.0]])
    aim = np.array([0.3, 1.0, -2.0])

    def rows(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return points @ slope.T - aim, np.tile(slope, (len(points), 1, 1))

    best = np.linalg.lstsq(slope, aim, rcond=None)[0]
    noise = np.random.default_rng(1).normal(size=(50, 3))
    found = randomized(rows, best, noise)
    np.testing.assert_allclose(found.weights, 0.02)
    assert found.effective == pytest.approx(50.0)
    # each draw is the least-squares solution for its noise
    np.testing.assert_allclose(found.points, best + np.linalg.lstsq(slope, noise.T, rcond=None)[0].T)


def test_a_measured_square_has_the_posterior_of_its_closed_form() -> None:
    grid = np.linspace(-2.0, 4.0, 200001)[:, None]
    density = np.exp(-0.5 * np.sum(squared(grid)[0] ** 2, axis=1))
    wanted = quantiles(grid[:, 0], density / density.sum())
    found = drawn(squared, np.array([1.0]), 20000)
    got = quantiles(found.points[:, 0], found.weights)
    np.testing.assert_allclose(got, wanted, atol=0.01)
    # a tenth of the interval's width: the linear interval lies elsewhere
    slope = squared(np.array([[1.0]]))[1][0, :, 0]
    assert abs(1.96 / np.linalg.norm(slope) - (wanted[2] - wanted[1])) > 0.03


def test_draws_of_a_bent_valley_agree_with_plain_monte_carlo() -> None:
    rng = np.random.default_rng(2)
    prior = rng.normal(size=(2_000_000, 2))
    logs = -0.5 * ((prior[:, 0] + np.exp(0.7 * prior[:, 1]) - 2.2) / 0.02) ** 2
    weights = np.exp(logs) / np.exp(logs).sum()
    kept = weights > 1e-12
    found = drawn(lambda x: product(np.array(2.2), x), np.array([0.5, 0.5]), 40000)
    for i in range(2):
        wanted = quantiles(prior[kept, i], weights[kept])
        np.testing.assert_allclose(quantiles(found.points[:, i], found.weights), wanted, atol=0.05)


def test_intervals_of_draws_hold_as_often_as_they_say() -> None:
    rng = np.random.default_rng(3)
    held = []
    for k in range(150):
        truth = 1.0 + 0.4 * rng.normal()
        shift = 0.3 * rng.normal()
        measured = shift + truth**2 + 0.1 * rng.normal()

        def rows(points: np.ndarray, measured=measured) -> tuple[np.ndarray, np.ndarray]:
            # the sum of a shift and of a square is measured
            a, b = points.T
            off = np.stack(((a + b**2 - measured) / 0.1, a / 0.3, (b - 1.0) / 0.4), axis=1)
            one, none = np.ones_like(a), np.zeros_like(a)
            slopes = [[one / 0.1, 2.0 * b / 0.1], [one / 0.3, none], [none, one / 0.4]]
            return off, np.moveaxis(np.array(slopes), -1, 0)

        found = drawn(rows, np.array([0.0, 1.0]), 200, seed=k)
        for value, points in ((shift, found.points[:, 0]), (truth, found.points[:, 1])):
            low, _, high = quantiles(points, found.weights)
            held.append(low <= value <= high)
    # 150 pairs of intervals of 95 %, of which both hold or none: three standard deviations are 5.3 %
    assert abs(np.mean(held) - 0.95) < 0.053


def test_directions_without_residuals_stay_at_the_peak_and_lost_draws_count_nothing() -> None:
    def rows(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        a = points[:, 0]
        slope = np.stack((1.0 / a, np.zeros_like(a)), axis=1)[:, None]
        return np.log(a)[:, None], slope

    found = randomized(rows, np.array([1.0, 7.0]), np.array([[1.0], [-3.0]]))
    np.testing.assert_allclose(found.points[:, 0], np.exp([1.0, -3.0]), rtol=0.04)
    np.testing.assert_array_equal(found.points[:, 1], 7.0)

    def ended(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.arctan(points), (1.0 / (1.0 + points**2))[:, :, None]

    # an arc tangent never gets to two
    found = randomized(ended, np.zeros(1), np.array([[0.5], [2.0]]))
    np.testing.assert_array_equal(found.weights, [1.0, 0.0])
    assert randomized(ended, np.zeros(1), np.array([[2.0]])).effective == 0.0


@pytest.mark.filterwarnings("error")
def test_an_unknown_that_acts_by_rounding_alone_stays_and_spoils_no_draw() -> None:
    def with_another(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rows, slopes = squared(points[:, :1])
        rounding = np.full((len(points), 2, 1), 1e-14)
        return rows + 1e-14 * points[:, 1:], np.concatenate((slopes, rounding), axis=2)

    noise = np.random.default_rng(0).normal(size=(200, 2))
    alone, both = (
        randomized(squared, np.array([1.2]), noise),
        randomized(with_another, np.array([1.2, 3.0]), noise),
    )
    np.testing.assert_allclose(both.weights, alone.weights, rtol=1e-9)
    np.testing.assert_allclose(both.points[:, 0], alone.points[:, 0], rtol=1e-9)
    assert (both.points[:, 1] == 3.0).all()


def test_slopes_whose_squares_are_no_numbers_lead_nowhere() -> None:
    """Beyond 1.2 the residual is as steep as a step: such draws count for nothing, and nobody is warned."""

    def steep(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        a = points[:, 0]
        rows = np.stack((a - 1.0, np.where(a > 1.2, 7.0, a - 1.0)), axis=1)
        return rows, np.stack((np.ones_like(a), np.where(a > 1.2, 1e200, 1.0)), axis=1)[:, :, None]

    draws = randomized(steep, np.array([1.0]), np.random.default_rng(0).normal(size=(50, 2)))
    near = draws.weights > 0
    assert near.any()
    assert np.all(draws.points[near, 0] <= 1.2)
