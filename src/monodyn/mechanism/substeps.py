"""How finely a motion has to be integrated: steps are doubled until it no longer changes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

STEADY = (8.0, 32.0)
"""Ratios of the changes by two doublings with which the next one is taken to be as much smaller, by 16 at
most. A smaller ratio is no order of the method, as where dry friction turns; a larger one shows that the
coarser motion was not in the range of its order yet."""


def least_substeps(
    positions: Callable[[int], np.ndarray], tolerance: float, most: int, least: int = 1
) -> tuple[int, float]:
    """Double the integration steps until the motion stays within a bound of its error.

    Args:
        positions: Gives the motion [rad or m] that a number of steps between two time stamps integrates, an
            array of the same shape for every number.
        tolerance: Largest error of any position [rad or m].
        most: Where to stop doubling; returned also if the bound is out of reach, as in long chaotic motion.
        least: Where to begin: a power of two.

    Returns:
        Steps between two time stamps, the least power of two that keeps the bound; and the largest error with
        them [rad or m], infinite where the motion is not finite or there is nothing to compare with.

    Source:
        Step doubling: halving the step of an order-4 method divides its error by 16, so the error of the
        longer step is 16/15 of the difference of the two results, that of the shorter 1/15. Where the last
        two differences fall by a ratio r near 16, the next ones are known: the shorter step leaves
        1 / (r - 1) of the difference, and is not doubled any more where that keeps the bound.
    """
    steps, change = least, np.inf
    coarse = positions(least)
    while steps < most:
        # The finer motion of this round is the coarser one of the next: each number is integrated once.
        fine, before = positions(2 * steps), change
        with np.errstate(invalid="ignore", over="ignore"):
            change = float(np.max(np.abs(fine - coarse), initial=0.0))
        if 16 / 15 * change <= tolerance:
            return steps, 16 / 15 * change
        steps, coarse = 2 * steps, fine
        # where changes fall as they should, the next one is known without trying it
        falls = before / change if np.isfinite(before) else 0.0
        if STEADY[0] <= falls <= STEADY[1]:
            left = change / (min(falls, 16.0) - 1.0)
            if left <= tolerance:
                return steps, left
    return steps, change / 15 if np.isfinite(change) else np.inf
