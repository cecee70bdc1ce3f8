"""Rounded time stamps in, the times of the constant rate behind them out.

A container keeps stamps in whole ticks: Matroska and WebM of 1 ms, GIF of 10 ms. At 29.97 frames a second
that moves each of them by up to half a tick. The one idea: where one rate and one beginning explain *all*
stamps within half a tick, missing frames included, they are the stamps before the rounding; where none does,
the stamps stay as they are, and the tick counts as an error of the time.

A recording that was stopped and went on, or a counter that began anew, leaves a jump between two stamps: no
motion goes on across it, and how long it was is not worth hours of empty time in every table and film.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from monodyn.arrays import usual_step

UNITS = (Fraction(1, 1000), Fraction(1, 100))
"""Ticks of Matroska and GIF [s]: a file made from one of them keeps the rounding under a finer tick."""
NTSC = Fraction(1000, 1001)
"""What television in colour made of whole rates: 30 became 29.97."""
HALVINGS = 60
"""Steps of a search on a line: each keeps two thirds of it, or half."""
ROUNDING = 1e-6
"""What floating point may add to a deviation [ticks]."""
JUMP = 5.0
"""Time between two frames above which no motion goes on from one to the other [s]."""
JUMP_STEPS = 100.0
"""Usual times between two frames that a jump is longer than, too: slow motions are filmed with few frames."""
PAUSE = 2.0
"""How long a jump counts at most, over the shortest one."""


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


def jumps(times: np.ndarray) -> np.ndarray:
    """Return where no motion goes on from one frame to the next for the time between them.

    Args:
        times: Times [s], increasing, (frame,).

    Returns:
        Rows of the first frame after each jump, int (frame,).
    """
    return np.flatnonzero(np.diff(times) > _shortest_jump(times)) + 1


def without_pauses(counts: np.ndarray, unit: float, notes: list[str]) -> np.ndarray:
    """Shorten the jumps of whole numbers that time is counted in.

    Args:
        counts: Stamps, or numbers of pictures, increasing, int64 (frame,).
        unit: What one of them is [s].
        notes: Takes a sentence where a jump was shortened.

    Returns:
        The counts, int64 (frame,), those after a jump as if it had lasted for ``PAUSE`` of the shortest.
    """
    times = counts * unit
    pause, steps = PAUSE * _shortest_jump(times), np.diff(counts)
    long = np.flatnonzero(steps * unit > pause)
    if not len(long):
        return counts
    seconds = float(steps[long].max()) * unit
    where = f"by {seconds:.6g} s before frame {long[0] + 1}"
    if len(long) > 1:
        where = f"{len(long)} times, by up to {seconds:.6g} s, first before frame {long[0] + 1}"
    notes.append(f"The times of the frames jump {where}: a pause of {pause:.3g} s is taken in place of that.")
    steps[long] = round(pause / unit)
    return counts[0] + np.concatenate(([0], np.cumsum(steps)))


def _shortest_jump(times: np.ndarray) -> float:
    """Return the time between two frames above which it is a jump [s]."""
    return max(JUMP, JUMP_STEPS * usual_step(times)) if len(times) > 1 else JUMP


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

    def begin(self, step: float) -> tuple[float, float]:
        """Return the first and the last beginning with which a step explains all numbers.

        Args:
            step: A step that explains them.
        """
        rest = self.numbers - step * self.count
        return float(rest.max() - 0.5), float(rest.min() + 0.5)


def constant_steps(numbers: np.ndarray) -> Steps | None:
    """Find the constant steps, well above one, whose multiples are the given numbers after rounding.

    Args:
        numbers: Increasing whole numbers, int64 (frame,); multiples may be missing.

    Returns:
        The steps; None where no constant step explains all numbers.
    """
    gaps = np.diff(numbers)
    # rounding makes two neighbouring numbers of a constant step; what is farther off has frames missing
    usual = np.abs(gaps - np.sort(gaps)[len(gaps) // 2]) <= 1
    parts = np.round(gaps / np.mean(gaps[usual]))
    if np.any(parts < 1):
        return None
    return explaining_steps(numbers, np.concatenate(([0], np.cumsum(parts))).astype(np.int64))


def explaining_steps(numbers: np.ndarray, count: np.ndarray) -> Steps | None:
    """Find the constant steps that explain numbers whose multiples are known.

    Args:
        numbers: Increasing whole numbers, int64 (frame,).
        count: Which multiple each of them is, increasing, int64 (frame,).

    Returns:
        The steps; None where no constant step explains all numbers.
    """

    def spread(step: float) -> float:
        return float(np.ptp(numbers - step * count))

    # The spread is convex in the step, so thirds close in on its minimum; a step explains the numbers where
    # the spread is at most one, whichever way they were rounded.
    usual = float(numbers[-1] - numbers[0]) / float(count[-1] - count[0])
    low, high = usual - 1.0, usual + 1.0
    for _ in range(HALVINGS):
        third = (high - low) / 3.0
        if spread(low + third) < spread(high - third):
            high -= third
        else:
            low += third
    best = 0.5 * (low + high)
    # A gap is its exact length rounded up or down. Alternating gaps of two and four numbers are within half a
    # number of constant ones of three, but no rounding makes them.
    off = np.max(np.abs(np.diff(numbers) - np.diff(count) * best))
    if spread(best) > 1.0 + ROUNDING or off > 1.0 - ROUNDING:
        return None
    reach = 1.0 / float(count[-1] - count[0])
    return Steps(numbers, count, _last(spread, best, best - reach), _last(spread, best, best + reach))


def _last(spread: Callable[[float], float], inside: float, outside: float) -> float:
    """Bisect for the last step, from ``inside`` toward ``outside``, that explains the numbers."""
    for _ in range(HALVINGS):
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if spread(middle) <= 1.0 + ROUNDING else (inside, middle)
    return inside


def usual_rate(steps: Steps, unit: Fraction, stated: Sequence[Fraction] = ()) -> Fraction:
    """Return the rate behind constant steps [Hz]: a usual one if such a one explains them, else the middle.

    Args:
        steps: The steps.
        unit: Their unit [s].
        stated: Rates that a file states [Hz]; of several that explain the steps they come first.
    """
    middle = 1 / (Fraction(0.5 * (steps.shortest + steps.longest)) * unit)
    usual = [Fraction(round(middle)), round(middle / NTSC) * NTSC]
    fits = [rate for rate in (*usual, *stated) if rate > 0 and steps.explained_by(float(1 / (rate * unit)))]
    return next((rate for rate in fits if rate in stated), fits[0]) if fits else middle


def _restored(steps: Steps, first: Fraction, unit: Fraction, stated: Sequence[Fraction]) -> np.ndarray:
    """Return the times [s] at the usual rate that explains the stamps, or at the middle of those that do."""
    step = 1 / (usual_rate(steps, unit, stated) * unit)
    # the first stamp stays, where it may, so that the clock of the file does
    begin = first + Fraction(float(np.clip(steps.numbers[0], *steps.begin(float(step))))) * unit
    return np.array([float(begin + step * count * unit) for count in steps.count.tolist()])
