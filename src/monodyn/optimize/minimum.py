"""The noun that every search of a least value returns, and the checks that the searches share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from monodyn.errors import SettingsError

Bounds = tuple[np.ndarray | float, np.ndarray | float]
"""Lower and upper bounds of the unknowns, (param,) each or one for all."""
UNBOUNDED: Bounds = (-np.inf, np.inf)


@dataclass(frozen=True)
class DirectSettings:
    """When a search without derivatives stops.

    Attributes:
        tolerance: Accuracy of the unknowns: in steps of each where there are several, in its own unit along a
            line.
        evaluations: Most evaluations of the function.
    """

    tolerance: float = 1e-3
    evaluations: int = 2000


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where a search of a least value ended.

    Attributes:
        x: The best point found, (param,).
        value: The function there.
        evaluations: Number of times the function was called (candidates, where it takes many at once).
        converged: True when the search ended by its own criterion.
        history: Rows of evaluations so far and best value so far, (entry, 2).
        status: What ended the search, one sentence.
        multipliers: Multipliers of lower bounds, upper bounds and inequalities in units of the function by
            unit of the constraint, (2 param + inequality,); empty for searches without any.
        violation: Largest violation of a constraint, in steps.
    """

    x: np.ndarray
    value: float
    evaluations: int
    converged: bool
    history: np.ndarray
    status: str
    multipliers: np.ndarray = field(default_factory=lambda: np.zeros(0))
    violation: float = 0.0


class Tally:
    """A function that counts its calls and remembers the least value; NaN counts as infinite."""

    def __init__(self, function: Callable[[np.ndarray], float]) -> None:
        self.function = function
        self.evaluations = 0
        self.x: np.ndarray | None = None
        self.value = np.inf

    def __call__(self, x: np.ndarray) -> float:
        """Evaluate the function.

        Args:
            x: Where, (param,).

        Returns:
            The value, infinite in place of NaN, so that comparisons with it are never false on both sides.
        """
        self.evaluations += 1
        value = float(self.function(x))
        if value < self.value:
            self.x, self.value = x.copy(), value
        return value if value == value else np.inf


def as_history(entries: Sequence[tuple[int, float]]) -> np.ndarray:
    """Return pairs of evaluations and value as an array.

    Args:
        entries: Evaluations so far and best value so far, in the order of time.

    Returns:
        The same, (entry, 2), also where there is none.
    """
    return np.array(entries, dtype=float).reshape(-1, 2)


def checked_bounds(start: np.ndarray, bounds: Bounds) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return start and bounds as arrays of one length.

    Args:
        start: First x, (param,).
        bounds: Lower and upper bounds, (param,) each or one for all.

    Returns:
        Start, lower and upper bounds, (param,) each.

    Raises:
        SettingsError: The bounds are reversed or NaN, or the start lies outside them.
    """
    start = np.array(start, dtype=float)
    lower, upper = (np.array(np.broadcast_to(side, start.shape), dtype=float) for side in bounds)
    for i, (x, a, b) in enumerate(zip(start.tolist(), lower.tolist(), upper.tolist(), strict=True)):
        if not a <= b:
            raise SettingsError(
                f"unknown {i}: expected a lower bound below the upper one, got {a:g} and {b:g}; swap them."
            )
        if not a <= x <= b:
            raise SettingsError(
                f"unknown {i}: the start {x:g} is outside its bounds {a:g} to {b:g}; move it inside."
            )
    return start, lower, upper


def checked_sizes(sizes: np.ndarray | float, count: int, name: str) -> np.ndarray:
    """Return one size for each unknown.

    Args:
        sizes: Sizes, (param,) or one for all.
        count: Number of unknowns.
        name: What the sizes are, for the message.

    Returns:
        Sizes, (param,).

    Raises:
        SettingsError: A size is not above 0 or not finite.
    """
    sizes = np.array(np.broadcast_to(sizes, (count,)), dtype=float)
    for i, size in enumerate(sizes.tolist()):
        if not 0.0 < size < np.inf:
            raise SettingsError(f"unknown {i}: expected a {name} above 0, got {size:g}.")
    return sizes
