"""Rounded time stamps in, the times of the constant rate behind them out.

A container keeps stamps in whole ticks: Matroska and WebM of 1 ms, GIF of 10 ms. At 29.97 frames a second that
moves each of them by up to half a tick. The one idea: where one rate and one beginning explain *all* stamps
within half a tick, missing frames included, they are the stamps before the rounding; where none does, the
stamps stay as they are, and the tick counts as an error of the time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

UNITS = (Fraction(1, 1000), Fraction(1, 100))
"""Ticks of Matroska and GIF [s]: a file made from one of them keeps the rounding under a finer tick."""
NTSC = Fraction(1000, 1001)
"""What television in colour made of whole rates: 30 became 29.97."""
HALVINGS = 60
"""Steps of a search on a line: each keeps two thirds of it, or half."""
ROUNDING = 1e-6
"""What floating point may add to a deviation [ticks]."""


class Clock(NamedTuple):
    """Times of the frames, and how exact they are.

    Attributes:
        times: Times [s], (frame,).
        tick: Unit to which they are rounded [s]; 0 where the rounding is undone.
    """

    times: np.ndarray
    tick: float


def clock_of(ticks: np.ndarray, base: Fraction, rates: Sequence[Fraction] = ()) -> Clock:
    """Undo the rounding of time stamps where a constant rate explains them all.

    No stamp moves by more than its unit, and a frame that is missing stays missing.

    Args:
        ticks: Stamps in whole ticks, increasing, int64 (frame,).
        base: Length of a tick [s].
        rates: Rates that the container states [Hz]; they decide between rates that explain the stamps alike.

    Returns:
        The times; those of the stamps where they follow no constant rate.
    """
    since = ticks - ticks[0]
    unit = base
    for wider in (base, *(unit for unit in UNITS if unit > base)):
        # stamps that were rounded to a wider unit before are its multiples, within the tick they have now
        multiples = since * float(base / wider)
        numbers = np.rint(multiples).astype(np.int64)
        if np.max(np.abs(multiples - numbers)) > 0.5 * float(base / wider) + ROUNDING:
            continue
        unit = wider
        steps = constant_steps(numbers)
        if steps is not None:
            return Clock(_restored(steps, ticks[0] * base, wider, rates), 0.0)
    # in exact fractions: 1001/30000 s times a large number of ticks must not be rounded twice
    return Clock(np.array([float(tick * base) for tick in ticks.tolist()]), float(unit))


class Steps(NamedTuple):
    """Constant steps behind whole numbers.

    Attributes:
        numbers: The whole numbers, int64 (frame,).
        count: Steps from the first one on, int64 (frame,); where one is left out, it grows by more than one.
        shortest: Shortest step that explains them.
        longest: Longest step that does.
    """

    numbers: np.ndarray
    count: np.ndarray
    shortest: float
    longest: float

    def explained_by(self, step: float) -> bool:
        """Return whether a step explains the numbers.

        Args:
            step: The step.
        """
        return self.shortest <= step <= self.longest

    def begin(self, step: float) -> float:
        """Return the beginning that is nearest to the first number and explains all of them.

        Args:
            step: A step that explains them.
        """
        rest = self.numbers - step * self.count
        return float(np.clip(self.numbers[0], rest.max() - 0.5, rest.min() + 0.5))


def constant_steps(numbers: np.ndarray) -> Steps | None:
    """Find the constant steps whose multiples are the given numbers after rounding.

    Args:
        numbers: Increasing whole numbers, int64 (frame,); multiples may be missing.

    Returns:
        The steps; None where no constant step explains all numbers.
    """
    gaps = np.diff(numbers)
    middle = np.sort(gaps)[len(gaps) // 2]
    # rounding makes two neighbouring numbers of a constant step; what is farther off has frames missing
    usual = gaps[np.abs(gaps - middle) <= 1]
    start = float(np.mean(usual))
    parts = np.round(gaps / start)
    if np.any(parts < 1):
        return None
    count = np.concatenate(([0], np.cumsum(parts))).astype(np.int64)

    def spread(step: float) -> float:
        return float(np.ptp(numbers - step * count))

    # The spread is convex in the step, so thirds close in on its minimum; a step explains the numbers where
    # the spread is at most one, whichever way they were rounded.
    low, high = start - 1.0, start + 1.0
    for _ in range(HALVINGS):
        third = (high - low) / 3.0
        if spread(low + third) < spread(high - third):
            high -= third
        else:
            low += third
    best = 0.5 * (low + high)
    # A gap is its exact length rounded up or down. Alternating gaps of two and four numbers are within half a
    # number of constant ones of three, but no rounding makes them.
    if spread(best) > 1.0 + ROUNDING or np.max(np.abs(gaps - parts * best)) > 1.0 - ROUNDING:
        return None
    return Steps(
        numbers, count, *(_last(spread, best, best + way / max(1, int(count[-1]))) for way in (-1.0, 1.0))
    )


def _last(spread: Callable[[float], float], inside: float, outside: float) -> float:
    """Bisect for the last step, from ``inside`` toward ``outside``, that explains the numbers."""
    for _ in range(HALVINGS):
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if spread(middle) <= 1.0 + ROUNDING else (inside, middle)
    return inside


def _restored(steps: Steps, first: Fraction, unit: Fraction, stated: Sequence[Fraction]) -> np.ndarray:
    """Return the times [s] at the usual rate that explains the stamps, or at the middle of those that do."""
    middle = Fraction(0.5 * (steps.shortest + steps.longest))
    rate = 1 / (middle * unit)
    usual = [Fraction(round(rate)), round(rate / NTSC) * NTSC]
    fits = [r for r in (*usual, *stated) if r > 0 and steps.explained_by(float(1 / (r * unit)))]
    # of several the one that the file states, else the first: a whole rate
    chosen = next((r for r in fits if r in stated), fits[0]) if fits else rate
    step = 1 / (chosen * unit)
    begin = first + Fraction(steps.begin(float(step))) * unit
    return np.array([float(begin + step * count * unit) for count in steps.count.tolist()])
