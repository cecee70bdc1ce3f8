"""Differential evolution: a coarse search of a whole box, to begin a fine one from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from monodyn.errors import SettingsError
from monodyn.optimize.minimum import Minimum, as_history, checked_bounds

LEAST_POPULATION = 5
SETTLED = "The population has settled."
ENDED = "The generations are over; the best candidate may not be at the minimum."
NOWHERE = "The function is not finite at any candidate; choose other bounds."


def evolve(
    function: Callable[[np.ndarray], float | np.ndarray],
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    seed: int,
    population: int = 40,
    generations: int = 50,
    start: np.ndarray | None = None,
    many: bool = False,
    tolerance: float = 0.01,
) -> Minimum:
    """Minimize a function over a box by differential evolution, without a final local search.

    scipy's differential_evolution (strategy best1bin) does it; the first candidates are a
    Latin hypercube. The same seed gives the same answer. NaN counts as infinite.

    Args:
        function: Gives the value at x (param,), or with ``many`` the values (candidate,) at x
            (param, candidate).
        lower: Lower bounds, (param,), finite.
        upper: Upper bounds, (param,), finite.
        seed: Seed of the random numbers.
        population: Number of candidates, 5 or more.
        generations: Generations after the first candidates, at the most.
        start: A candidate to begin with, (param,); default none.
        many: True when the function takes many candidates at once.
        tolerance: Done when the candidates' values spread by less than this share of their mean.

    Returns:
        The best candidate, with the best value after each generation.

    Raises:
        SettingsError: The bounds are reversed or infinite, the start lies outside them, or the population is
            too small.

    Source:
        Storn and Price, Differential evolution, 1997; the paper's discussion proposes an evolutionary search
        to narrow the space before the local one.

    Example:
        >>> found = evolve(lambda x: float(np.sum(x**2)), np.full(2, -5.0), np.full(2, 5.0), seed=1)
        >>> bool(found.value < 1e-2)
        True
    """
    from scipy.optimize import differential_evolution

    lower, upper = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    middle = 0.5 * lower + 0.5 * upper if start is None else np.asarray(start, dtype=float)
    _check(lower, upper, population)
    checked_bounds(middle, lower, upper)
    rng = np.random.default_rng(seed)
    first = _latin_hypercube(rng, lower, upper, population)
    if start is not None:
        first[0] = middle
    crowd = _Crowd(function, many)
    found = differential_evolution(
        crowd,
        np.column_stack((lower, upper)),
        maxiter=generations,
        init=first,
        tol=tolerance,
        seed=rng,  # pyright: ignore[reportCallIssue]  (scipy before 1.15 knows no rng)
        polish=False,
        vectorized=many,
        updating="deferred" if many else "immediate",
        callback=crowd.note,
    )
    crowd.note(None)
    if crowd.x is None:
        return Minimum(middle, np.inf, crowd.evaluations, False, as_history(crowd.history), NOWHERE)
    status = SETTLED if found.success else ENDED
    return Minimum(
        crowd.x, crowd.value, crowd.evaluations, bool(found.success), as_history(crowd.history), status
    )


def _check(lower: np.ndarray, upper: np.ndarray, population: int) -> None:
    if population < LEAST_POPULATION:
        raise SettingsError(f"evolve: expected a population of {LEAST_POPULATION} or more, got {population}.")
    for i, (a, b) in enumerate(zip(lower.tolist(), upper.tolist(), strict=True)):
        if not (np.isfinite(a) and np.isfinite(b)):
            raise SettingsError(
                f"unknown {i}: expected finite bounds, got {a:g} and {b:g}; bound the search."
            )


def _latin_hypercube(
    rng: np.random.Generator, lower: np.ndarray, upper: np.ndarray, count: int
) -> np.ndarray:
    """Give candidates, (candidate, param), one in each of ``count`` equal parts of every unknown's range."""
    part = np.array([rng.permutation(count) for _ in lower]).T
    return lower + (upper - lower) * (part + rng.random(part.shape)) / count


class _Crowd:
    """The function for one candidate or many; counts them and keeps the best."""

    def __init__(self, function: Callable[[np.ndarray], float | np.ndarray], many: bool) -> None:
        self.function, self.many = function, many
        self.evaluations, self.value = 0, np.inf
        self.x: np.ndarray | None = None
        self.history: list[tuple[int, float]] = []

    def __call__(self, x: np.ndarray) -> float | np.ndarray:
        columns = x if self.many and x.ndim == 2 else x[:, None]
        self.evaluations += columns.shape[1]
        values = np.array(self.function(columns if self.many else x), dtype=float).reshape(-1)
        values[np.isnan(values)] = np.inf
        best = int(np.argmin(values))
        if values[best] < self.value:
            self.x, self.value = columns[:, best].copy(), float(values[best])
        return values if self.many and x.ndim == 2 else float(values[0])

    def note(self, intermediate_result) -> None:
        """Keep the best value after a generation."""
        self.history.append((self.evaluations, self.value))
