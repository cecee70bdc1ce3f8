"""Least value along a line: Swann's bounding encloses it, the golden section closes in on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from monodyn.errors import SettingsError

GOLDEN = 0.5 * (3.0 - 5.0**0.5)  # share of the longer part at which it is cut
MOST = 200


@dataclass(frozen=True, slots=True)
class Bracket:
    """An interval with a least value inside: f(middle) is not above the function at either end.

    Attributes:
        low: Lower end.
        middle: The best point evaluated; on an end where that is a bound.
        high: Upper end.
        value: The function at the middle.
        evaluations: Number of evaluations.
        closed: False where the evaluations ran out while the function still fell.
    """

    low: float
    middle: float
    high: float
    value: float
    evaluations: int
    closed: bool


@dataclass(frozen=True, slots=True)
class Found:
    """Where a search along a line ended.

    Attributes:
        x: The best point evaluated.
        value: The function there.
        evaluations: Number of evaluations.
    """

    x: float
    value: float
    evaluations: int


def swann(
    function: Callable[[float], float],
    start: float,
    step: float,
    lower: float = -np.inf,
    upper: float = np.inf,
    *,
    value: float | None = None,
    most: int = MOST,
) -> Bracket:
    """Enclose a least value by steps of doubling length downhill.

    The first step is tried upward and then downward; from there x(k+1) = x(k) + 2^k step until the function
    no longer falls. A step over a bound ends on it. NaN counts as infinite.

    Args:
        function: The function of one unknown.
        start: First x.
        step: Length of the first step, above 0.
        lower: Lower bound.
        upper: Upper bound.
        value: The function at the start, where it is known.
        most: Evaluations at the most.

    Returns:
        The interval, with the best point evaluated as its middle.

    Raises:
        SettingsError: The start lies outside the bounds, or the step is not above 0.

    Source:
        Swann, Report on the development of a new direct search method of optimization, 1964; the paper's
        line search encloses by it. A step upward that is lower saves the one downward.

    Example:
        >>> found = swann(lambda x: (x - 5.0) ** 2, 0.0, 1.0)
        >>> found.low, found.middle, found.high
        (1.0, 3.0, 7.0)
    """
    if not step > 0:
        raise SettingsError(f"swann: expected a step above 0, got {step:g}.")
    if not lower <= start <= upper:
        raise SettingsError(
            f"swann: the start {start:g} is outside its bounds {lower:g} to {upper:g}; move it inside."
        )
    calls = 0
    if value is None:
        value, calls = _number(function(start)), 1
    behind, middle, sign = start, start, 1.0
    ahead = min(start + step, upper)
    above = _number(function(ahead)) if ahead > start else np.inf
    calls += ahead > start
    if not above < value:
        behind, sign = ahead, -1.0
        ahead = max(start - step, lower)
        allowed = ahead < start and calls < most
        above = _number(function(ahead)) if allowed else np.inf
        calls += allowed
    while above < value and calls < most:
        behind, middle, value = middle, ahead, above
        step *= 2.0
        ahead = min(max(middle + sign * step, lower), upper)
        if ahead == middle:
            above = np.inf
            break
        above = _number(function(ahead))
        calls += 1
    closed = not above < value
    if not closed:
        behind, middle, value = middle, ahead, above
    return Bracket(min(behind, ahead), middle, max(behind, ahead), value, calls, closed)


def golden_section(
    function: Callable[[float], float],
    low: float,
    high: float,
    tolerance: float,
    *,
    middle: float | None = None,
    value: float | None = None,
    most: int = MOST,
) -> Found:
    """Close in on the least value of a function with one valley between two ends.

    The longer part beside the best point is cut in the golden ratio; the worse end is dropped. The best point
    ever evaluated stays inside, whatever the function is. The ends themselves are not evaluated.

    Args:
        function: The function of one unknown.
        low: Lower end.
        high: Upper end.
        tolerance: Done when the interval is not longer than this.
        middle: A point between the ends or on one, such as a bracket's; default the golden section.
        value: The function at the middle, where it is known.
        most: Evaluations at the most.

    Returns:
        The best point evaluated.

    Raises:
        SettingsError: The ends are reversed, or the middle is not between them.

    Source:
        Kiefer, Sequential minimax search for a maximum, 1953; the paper's line search.

    Example:
        >>> round(golden_section(lambda x: (x - 2.0) ** 2, 0.0, 5.0, 1e-6).x, 5)
        2.0
    """
    best = low + GOLDEN * (high - low) if middle is None else middle
    if not low <= best <= high:
        raise SettingsError(f"golden_section: expected {low:g} <= {best:g} <= {high:g}; order the points.")
    calls = 0
    if value is None or middle is None:
        value, calls = _number(function(best)), 1
    while high - low > tolerance and calls < most:
        above = high - best > best - low
        x = best + GOLDEN * ((high - best) if above else (low - best))
        if x in (low, best, high):  # the interval is as short as numbers are
            break
        trial = _number(function(x))
        calls += 1
        if trial < value:
            low, high = (best, high) if above else (low, best)
            best, value = x, trial
        elif above:
            high = x
        else:
            low = x
    return Found(best, value, calls)


def line_search(
    function: Callable[[float], float],
    start: float,
    step: float,
    lower: float = -np.inf,
    upper: float = np.inf,
    tolerance: float = 1e-6,
    *,
    value: float | None = None,
    most: int = MOST,
) -> Found:
    """Find a least value along a line: Swann's bounding, then the golden section.

    Args:
        function: The function of one unknown.
        start: First x.
        step: Length of the first step, above 0.
        lower: Lower bound.
        upper: Upper bound.
        tolerance: Done when the interval is not longer than this.
        value: The function at the start, where it is known.
        most: Evaluations at the most.

    Returns:
        The best point evaluated; never worse than the start.

    Raises:
        SettingsError: The start lies outside the bounds, or the step is not above 0.

    Source:
        The paper's search in one dimension: golden section with Swann's bounding.
    """
    bracket = swann(function, start, step, lower, upper, value=value, most=most)
    if not bracket.closed:
        return Found(bracket.middle, bracket.value, bracket.evaluations)
    left = most - bracket.evaluations
    found = golden_section(
        function, bracket.low, bracket.high, tolerance, middle=bracket.middle, value=bracket.value, most=left
    )
    return Found(found.x, found.value, found.evaluations + bracket.evaluations)


def _number(value: float) -> float:
    return value if value == value else np.inf
