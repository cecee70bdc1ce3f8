"""Differential evolution: a coarse search of a whole box, to begin a fine one from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from monodyn.errors import SettingsError
from monodyn.optimize.minimum import Minimum, as_history, checked_bounds
from monodyn.optimize.status import ENDED, NOWHERE, SETTLED

LEAST_POPULATION = 5
TOLERANCE = 0.01
"""Done when the candidates' values spread by less than this share of their mean."""


def evolve(
    function: Callable[[np.ndarray], np.ndarray],
    bounds: tuple[np.ndarray, np.ndarray],
    *,
    seed: int,
    population: int = 40,
    generations: int = 50,
) -> Minimum:
    """Minimize a function over a box by differential evolution, without a final local search.

    scipy's differential_evolution (strategy best1bin) does it; the first candidates are a
    Latin hypercube. The same seed gives the same answer. NaN counts as infinite.

    Args:
        function: Gives the values (candidate,) at x (param, candidate).
        bounds: Lower and upper bounds, (param,) each, finite.
        seed: Seed of the random numbers.
        population: Number of candidates, 5 or more.
        generations: Generations after the first candidates, at most.

    Returns:
        The best candidate, with the best value after each generation.

    Raises:
        SettingsError: The bounds are reversed or infinite, or the population is too small.

    Source:
        Storn and Price, Differential evolution, 1997; the paper's discussion proposes an evolutionary search
        to narrow the space before the local one.

    Example:
        >>> found = evolve(lambda x: np.sum(x**2, axis=0), (np.full(2, -5.0), np.full(2, 5.0)), seed=1)
        >>> bool(found.value < 1e-2)
        True
    """
    from scipy.optimize import differential_evolution

    lower, upper = (np.asarray(side, dtype=float) for side in bounds)
    _check(lower, upper, population)
    rng = np.random.default_rng(seed)
    crowd = _Crowd(function)
    found = differential_evolution(
        crowd,
        np.column_stack((lower, upper)),
        maxiter=generations,
        init=_latin_hypercube(rng, lower, upper, population),
        tol=TOLERANCE,
        seed=rng,  # pyright: ignore[reportCallIssue]  (scipy before 1.15 knows no rng)
        polish=False,
        vectorized=True,
        updating="deferred",
        callback=crowd.note,
    )
    crowd.note(None)
    history = as_history(crowd.history)
    if crowd.x is None:
        return Minimum(0.5 * lower + 0.5 * upper, np.inf, crowd.evaluations, False, history, NOWHERE)
    done = bool(found.success)
    return Minimum(crowd.x, crowd.value, crowd.evaluations, done, history, SETTLED if done else ENDED)


def _check(lower: np.ndarray, upper: np.ndarray, population: int) -> None:
    """Raise unless the box is finite and the population large enough."""
    if population < LEAST_POPULATION:
        raise SettingsError(f"evolve: expected a population of {LEAST_POPULATION} or more, got {population}.")
    for i, (a, b) in enumerate(zip(lower.tolist(), upper.tolist(), strict=True)):
        if not (np.isfinite(a) and np.isfinite(b)):
            raise SettingsError(
                f"unknown {i}: expected finite bounds, got {a:g} and {b:g}; bound the search."
            )
    checked_bounds(0.5 * lower + 0.5 * upper, (lower, upper))


def _latin_hypercube(
    rng: np.random.Generator, lower: np.ndarray, upper: np.ndarray, count: int
) -> np.ndarray:
    """Return candidates (candidate, param), one in each of ``count`` equal parts of each range."""
    part = np.array([rng.permutation(count) for _ in lower]).T
    return lower + (upper - lower) * (part + rng.random(part.shape)) / count


class _Crowd:
    """The function of many candidates; counts them and keeps the best."""

    def __init__(self, function: Callable[[np.ndarray], np.ndarray]) -> None:
        self.function = function
        self.evaluations, self.value = 0, np.inf
        self.x: np.ndarray | None = None
        self.history: list[tuple[int, float]] = []

    def __call__(self, x: np.ndarray) -> np.ndarray | float:
        # scipy evaluates single candidates (param,) too
        columns = x if x.ndim == 2 else x[:, None]
        self.evaluations += columns.shape[1]
        values = np.array(self.function(columns), dtype=float).reshape(-1)
        values[np.isnan(values)] = np.inf
        best = int(np.argmin(values))
        if values[best] < self.value:
            self.x, self.value = columns[:, best].copy(), float(values[best])
        return values if x.ndim == 2 else float(values[0])

    def note(self, intermediate_result: object) -> None:
        """Keep the best value after a generation.

        Args:
            intermediate_result: What scipy passes to a callback by this name; not used.
        """
        self.history.append((self.evaluations, self.value))
