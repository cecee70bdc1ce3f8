"""Several starts, one answer: the same starts for the same seed, tried in order until one is good enough."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

import numpy as np

Result = TypeVar("Result")
Begin = TypeVar("Begin")


def scatter(start: np.ndarray, width: np.ndarray, count: int, *, seed: int) -> np.ndarray:
    """Spread starts about a first one.

    Args:
        start: The first start, (param,).
        width: Largest distance from it by unknown, (param,).
        count: Number of starts, the first among them.
        seed: Seed of the random numbers.

    Returns:
        Starts, one a row, (row, param); row 0 is ``start``, the others are uniform in start +- width.

    Example:
        >>> scatter(np.zeros(2), np.ones(2), 3, seed=0).shape
        (3, 2)
    """
    draws = np.random.default_rng(seed).uniform(-1.0, 1.0, size=(max(count, 1), len(start)))
    draws[0] = 0.0
    return np.asarray(start) + draws * np.asarray(width)


def first_good(
    solve: Callable[[Begin], Result],
    starts: Iterable[Begin],
    *,
    cost: Callable[[Result], float],
    good: Callable[[Result], bool],
    same: Callable[[Result, Result], bool],
) -> tuple[Result, int]:
    """Solve from each start until a result is good, or the cheapest was found twice; take the cheapest.

    Args:
        solve: Gives a result from a start.
        starts: Starts in the order in which they are tried; at least one.
        cost: Cost of a result; NaN counts as infinite.
        good: True for a result that needs no further start.
        same: True for two results that are one: where two starts lead there, no other is looked for.

    Returns:
        The result and the number of starts that were tried.

    Raises:
        ValueError: There is no start.
    """
    best: Result | None = None
    best_cost, tried = np.inf, 0
    for start in starts:
        result = solve(start)
        tried += 1
        price = cost(result)
        twice = best is not None and np.isfinite(price) and same(best, result)
        if best is None or price < best_cost:
            best, best_cost = result, price if np.isfinite(price) else np.inf
        if good(result):
            best = result
        if twice or good(result):
            break
    if best is None:
        raise ValueError("first_good: expected at least one start, got none.")
    return best, tried
