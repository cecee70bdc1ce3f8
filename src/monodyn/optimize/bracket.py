"""Least value along a line: Swann's bounding encloses it, the golden section closes in on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from monodyn.errors import SettingsError
from monodyn.optimize.minimum import DirectSettings

GOLDEN = 0.5 * (3.0 - 5.0**0.5)
"""Share of the longer part at which it is cut."""
MOST = 200
"""Evaluations along a line at most, unless the caller sets another number."""
LINE = DirectSettings(tolerance=1e-6, evaluations=MOST)

Span = tuple[float, float]
"""Lower and upper end of an interval."""
WHOLE_LINE: Span = (-np.inf, np.inf)


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
    bounds: Span = WHOLE_LINE,
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
        bounds: Lower and upper bound.
        value: The function at the start, where it is known.
        most: Evaluations at most.

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
    lower, upper = bounds
    if not step > 0:
        raise SettingsError(f"swann: expected a step above 0, got {step:g}.")
    if not lower <= start <= upper:
        raise SettingsError(
            f"swann: the start {start:g} is outside its bounds {lower:g} to {upper:g}; move it inside."
        )
    # A caller that searches line after line knows the value at its start: it is not evaluated again.
    calls = 0
    if value is None:
        value, calls = _number(function(start)), 1
    behind, ahead, above, more = _first_steps(function, (start, value), step, bounds, most - calls)
    middle, calls, sign = start, calls + more, 1.0 if ahead > start else -1.0
    # Here and after each turn: f(middle) <= f(behind), and the search goes on as long as f(ahead) is lower
    # still. Three places in a row of which the middle one is lowest enclose a least value.
    while above < value and calls < most:
        behind, middle, value = middle, ahead, above
        # Doubling makes the count of evaluations grow with the logarithm of the distance; the interval that
        # is left is at most three times as long as the step that led to its middle.
        step *= 2.0
        ahead = min(max(middle + sign * step, lower), upper)
        if ahead == middle:  # the best point is a bound: it closes the interval itself
            above = np.inf
            break
        above = _number(function(ahead))
        calls += 1
    # Where the evaluations ran out the point ahead is the lowest, so that it becomes the middle: the best
    # point is returned even when nothing encloses it.
    closed = not above < value
    if not closed:
        behind, middle, value = middle, ahead, above
    return Bracket(min(behind, ahead), middle, max(behind, ahead), value, calls, closed)


def _first_steps(
    function: Callable[[float], float], start: tuple[float, float], step: float, bounds: Span, most: int
) -> tuple[float, float, float, int]:
    """Step upward from a start and its value, and downward where that is not lower.

    Returns:
        The place behind the start, the place ahead of it and the value there, and the evaluations.
    """
    (x, value), (lower, upper) = start, bounds
    upward = min(x + step, upper)
    tried = upward > x
    above = _number(function(upward)) if tried else np.inf
    if above < value:
        return x, upward, above, 1
    # Upward is not lower, so the start is the middle of what lies between there and one step downward.
    downward = max(x - step, lower)
    allowed = downward < x and tried < most
    below = _number(function(downward)) if allowed else np.inf
    return upward, downward, below, tried + allowed


def golden_section(
    function: Callable[[float], float],
    ends: Span,
    tolerance: float,
    *,
    inside: tuple[float, float] | None = None,
    most: int = MOST,
) -> Found:
    """Close in on the least value of a function with one valley between two ends.

    The longer part next to the best point is cut in the golden ratio; the worse end is dropped. The best
    point ever evaluated stays inside, whatever the function is. The ends themselves are not evaluated.

    Args:
        function: The function of one unknown.
        ends: Lower and upper end.
        tolerance: Done when the interval is not longer than this.
        inside: A point between the ends or on one, such as a bracket's middle, and the function there;
            default the golden section.
        most: Evaluations at most.

    Returns:
        The best point evaluated.

    Raises:
        SettingsError: The ends are reversed, or the point inside is not between them.

    Source:
        Kiefer, Sequential minimax search for a maximum, 1953; the paper's line search.

    Example:
        >>> round(golden_section(lambda x: (x - 2.0) ** 2, (0.0, 5.0), 1e-6).x, 5)
        2.0
    """
    # Invariant: low <= best <= high, and ``value`` is the least of all evaluated, at best. Each end is one of
    # the given ones or a point where the function is not lower than at best.
    low, high = ends
    best = low + GOLDEN * (high - low) if inside is None else inside[0]
    if not low <= best <= high:
        raise SettingsError(f"golden_section: expected {low:g} <= {best:g} <= {high:g}; order the points.")
    value, calls = (_number(function(best)), 1) if inside is None else (inside[1], 0)
    while high - low > tolerance and calls < most:
        # The longer part is cut, so that the interval shrinks by the golden ratio even where the best point
        # is not at that ratio, as that of a bracket is not.
        above = high - best > best - low
        x = best + GOLDEN * ((high - best) if above else (low - best))
        if x in (low, best, high):  # the interval is as short as floating-point numbers allow
            break
        trial = _number(function(x))
        calls += 1
        if trial < value:  # the new point is the best; the old one becomes the end on the other side
            low, high = (best, high) if above else (low, best)
            best, value = x, trial
        # The new point is no better, so that it becomes the end on its own side: a single valley that reached
        # lower beyond it would have to rise between it and the best point first.
        elif above:
            high = x
        else:
            low = x
    return Found(best, value, calls)


def line_search(
    function: Callable[[float], float],
    start: float,
    step: float,
    bounds: Span = WHOLE_LINE,
    *,
    value: float | None = None,
    settings: DirectSettings = LINE,
) -> Found:
    """Find a least value along a line: Swann's bounding, then the golden section.

    Args:
        function: The function of one unknown.
        start: First x.
        step: Length of the first step, above 0.
        bounds: Lower and upper bound.
        value: The function at the start, where it is known.
        settings: When to stop; the tolerance is the length of the last interval.

    Returns:
        The best point evaluated; never worse than the start.

    Raises:
        SettingsError: The start lies outside the bounds, or the step is not above 0.

    Source:
        The paper's search in one dimension: golden section with Swann's bounding.
    """
    bracket = swann(function, start, step, bounds, value=value, most=settings.evaluations)
    if not bracket.closed:
        return Found(bracket.middle, bracket.value, bracket.evaluations)
    found = golden_section(
        function,
        (bracket.low, bracket.high),
        settings.tolerance,
        inside=(bracket.middle, bracket.value),
        most=settings.evaluations - bracket.evaluations,
    )
    return Found(found.x, found.value, found.evaluations + bracket.evaluations)


def _number(value: float) -> float:
    """Return infinity in place of NaN."""
    return value if value == value else np.inf
