"""Numbers as a report and a table write them: with the digits that their standard deviation leaves."""

from __future__ import annotations

import math
from typing import Protocol


class _Moving(Protocol):
    """A joint: all that is asked of it here is its kind."""

    @property
    def kind(self) -> str: ...


def number(value: float | None, std: float | None = None) -> str:
    """Return a number as text, with the digits that its standard deviation leaves, five without one.

    Args:
        value: The number; None is unknown.
        std: Its standard deviation, when known.
    """
    if value is None or math.isnan(value):
        return "unknown"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    # a value without a standard deviation has five digits
    if std is None or not math.isfinite(std) or std <= 0 or value == 0:
        return f"{value:.5g}".replace("-", "−")
    # two digits of the standard deviation, and all digits of the value down to there
    digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(std)) + 2
    return f"{value:.{min(max(digits, 2), 8)}g}".replace("-", "−")


def is_whole(text: str) -> bool:
    """Return whether a text is a whole number in the digits 0 to 9, without a sign.

    Args:
        text: The text.
    """
    # there are digits of other scripts, and some that ``int`` does not take
    return text.isascii() and text.isdigit()


def known_or(value: float | None, unknown: float) -> float:
    """Return a number of a JSON document, which has null for what is none.

    Args:
        value: The number, or None.
        unknown: What None stands for.
    """
    return unknown if value is None else float(value)


def short(value: float | None) -> str:
    """Return a standard deviation as text with two digits.

    Args:
        value: The standard deviation; None is unknown.
    """
    return f"{value:.2g}" if value is not None and math.isfinite(value) else number(value)


def interval(
    lower: float | None, upper: float | None, std: float | None, *, free: bool, known: bool, at_bound: bool
) -> str:
    """Return a 95 % interval as text, or why there is none.

    Args:
        lower: Its lower end; None is unbounded.
        upper: Its upper end, likewise.
        std: Standard deviation of what it is of.
        free: Whether that was estimated.
        known: Whether the data determine it.
        at_bound: Whether it ended on a bound.
    """
    if at_bound:
        return "at its bound"
    if known:
        return f"{number(lower, std)} to {number(upper, std)}"
    return "not determined" if free else "held"


def shown_in(joint: _Moving) -> tuple[float, str]:
    """Return how a joint's position is shown: units in a radian or a metre, and the unit's name.

    Args:
        joint: A joint.
    """
    return (180.0 / math.pi, "deg") if joint.kind == "hinge" else (1000.0, "mm")
