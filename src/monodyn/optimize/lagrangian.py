"""The augmented Lagrangian: bounds and inequalities by a few searches without any."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from monodyn.optimize.minimum import (
    EXHAUSTED,
    NOT_EVALUABLE,
    REACHED,
    Minimum,
    as_history,
    checked_bounds,
    checked_sizes,
)
from monodyn.optimize.powell import powell

STIFFNESS = 20.0  # first penalty of one step's violation, in changes of the function over one step
LEAST_REACH = 4.0  # first step of a later round, in tolerances, at the least
GROWTH = 5.0  # of the penalty where a round of multipliers did not lower the violation enough
ENOUGH = 0.25  # share to which a round of multipliers should lower the violation
UNMET = "The rounds of multipliers were over before the constraints were met to the tolerance."
VIOLATED = "No point within the inequalities was found; begin from one."


def augmented_lagrangian(
    function: Callable[[np.ndarray], float],
    start: np.ndarray,
    lower: np.ndarray | float = -np.inf,
    upper: np.ndarray | float = np.inf,
    *,
    inequalities: Callable[[np.ndarray], Sequence[float] | np.ndarray] | None = None,
    step: np.ndarray | float,
    tolerance: float = 1e-3,
    outside: float = 1.0,
    most: int = 2000,
    rounds: int = 30,
    decrease: float = 0.0,
) -> Minimum:
    """Minimize f(x) subject to lower <= x <= upper and g(x) <= 0 by the method of multipliers.

    Each round minimizes f(x) + r/2 sum_j (max(0, g_j(x) + m_j / r)^2 - (m_j / r)^2) without constraints, and
    then takes m_j = max(0, m_j + r g_j(x)). The bounds are constraints too, in steps. The penalty r is taken
    from the change of f over one step at the start, so that f may have any size. Where no constraint is
    active the first round is the last.

    The function is evaluated outside of its bounds too, mostly by a small part of a step and never by more
    than ``outside``; where it does not exist it gives NaN or infinity. An unknown with equal bounds stays
    there.

    Args:
        function: Gives f at x (param,).
        start: First x, (param,), inside the bounds.
        lower: Lower bounds, (param,) or one for all; may be infinite.
        upper: Upper bounds, (param,) or one for all; may be infinite.
        inequalities: Gives g at x, (inequality,), each of a size near 1 for a violation as large as one step.
        step: First step of each unknown, (param,) or one for all; above 0.
        tolerance: Accuracy of x and largest violation of g, in steps.
        outside: f is taken as infinite, and not called, where a constraint is violated by more steps than
            this (or than at the start).
        most: Evaluations of f at the most.
        rounds: Rounds of multipliers at the most.
        decrease: An inner search is done also when it lowers its function by no more than this.

    Returns:
        The best point inside the bounds exactly and inside the inequalities to the tolerance, with the
        multipliers, and the best such value after each round.

    Raises:
        SettingsError: The bounds are reversed, the start lies outside them, or a step is not above 0.

    Source:
        Powell 1969, Hestenes 1969 and, for inequalities, Rockafellar 1973; the paper's method for problems
        with constraints.

    Example:
        >>> def bowl(x):
        ...     return (x[0] - 2.0) ** 2 + (x[1] - 1.0) ** 2
        >>> found = augmented_lagrangian(bowl, np.zeros(2), -1.0, 1.5, step=0.5, tolerance=1e-4)
        >>> [round(float(x), 3) for x in found.x]
        [1.5, 1.0]
    """
    start, lower, upper = checked_bounds(start, lower, upper)
    step = checked_sizes(step, len(start), "step")
    problem = _Problem(function, start, lower, upper, inequalities, step, tolerance)
    problem.limit(outside)
    x, inner_step = start[problem.free], step[problem.free]
    value = problem(x)
    if not value < np.inf:
        return problem.end(False, NOT_EVALUABLE)
    if not len(x):
        return problem.end(True, REACHED)
    problem.penalty = STIFFNESS * problem.change_over_a_step(x, value)
    worst, converged, status = np.inf, False, UNMET
    for _ in range(rounds):
        left = most - problem.evaluations - 1  # one is kept for the point put inside the bounds
        if left < 1:
            status = EXHAUSTED
            break
        inner = powell(problem, x, inner_step, tolerance=tolerance, most=left, decrease=decrease)
        x = inner.x
        violation = problem.update(x)
        converged = inner.converged and violation <= 0.5 * tolerance
        if converged:
            status = REACHED
            break
        if violation > ENOUGH * worst:
            problem.stiffen()
        worst = min(worst, violation)
        inner_step = step[problem.free] * min(max(2.0 * violation, LEAST_REACH * tolerance), 1.0)
    problem.inside(x)
    return problem.end(converged, status)


class _Problem:
    """The augmented Lagrangian of the unknowns that can move; it counts, and keeps the best allowed point."""

    def __init__(self, function, start, lower, upper, inequalities, step, tolerance) -> None:
        self.function, self.inequalities = function, inequalities
        self.start, self.lower, self.upper, self.step, self.tolerance = start, lower, upper, step, tolerance
        self.free = np.flatnonzero(upper > lower)
        self.all_free = len(self.free) == len(start)
        sides = [(i, -1.0, float(lower[k]), 1.0 / float(step[k])) for i, k in enumerate(self.free)]
        sides += [(i, 1.0, float(upper[k]), 1.0 / float(step[k])) for i, k in enumerate(self.free)]
        self.sides = [side for side in sides if np.isfinite(side[2])]
        others = len(np.atleast_1d(inequalities(start))) if inequalities else 0
        self.penalty, self.outside = 0.0, np.inf
        self.shifts = [0.0] * (len(self.sides) + others)  # multipliers / penalty
        self.evaluations = 0
        self.x, self.value = start, np.inf
        self.history: list[tuple[int, float]] = []

    def __call__(self, z: np.ndarray) -> float:
        """Evaluate f and its penalty at the free unknowns."""
        x = self.embed(z)
        excess, allowed = self.constraints(z, x)
        if not allowed and max(excess) > self.outside:
            return np.inf
        self.evaluations += 1
        value = float(self.function(x))
        if not abs(value) < np.inf:
            return np.inf
        if allowed and value < self.value:
            self.x, self.value = np.array(x), value
            self.history.append((self.evaluations, value))
        total = 0.0
        for g, shift in zip(excess, self.shifts, strict=True):
            if g + shift > 0.0:
                total += (g + shift) ** 2
            total -= shift * shift
        return value + 0.5 * self.penalty * total

    def limit(self, outside: float) -> None:
        """Never evaluate f where a constraint is violated by more than this and more than at the start."""
        excess, _ = self.constraints(self.start[self.free], self.start)
        self.outside = max(outside, max(excess, default=0.0))

    def embed(self, z: np.ndarray) -> np.ndarray:
        """Give all unknowns from the free ones."""
        if self.all_free:
            return z
        x = self.start.copy()
        x[self.free] = z
        return x

    def constraints(self, z: np.ndarray, x: np.ndarray) -> tuple[list[float], bool]:
        """Give every constraint, bounds in steps first, and whether the point is allowed."""
        point = z.tolist()
        excess = [sign * (point[i] - bound) * inverse for i, sign, bound, inverse in self.sides]
        allowed = not excess or max(excess) <= 0.0
        if self.inequalities is not None:
            others = np.atleast_1d(self.inequalities(x)).tolist()
            others = [g if g == g else np.inf for g in others]
            allowed = allowed and max(others, default=0.0) <= self.tolerance
            excess += others
        return excess, allowed

    def change_over_a_step(self, z: np.ndarray, value: float) -> float:
        """Measure how much f changes over one step of an unknown, inward; 1 where it does not."""
        if not self.shifts:
            return 1.0
        largest = 0.0
        for i, k in enumerate(self.free):
            upward = self.upper[k] - z[i] >= z[i] - self.lower[k]
            room = (self.upper[k] - z[i]) if upward else (z[i] - self.lower[k])
            there = z.copy()
            there[i] += min(self.step[k], room) * (1.0 if upward else -1.0)
            change = abs(self(there) - value)
            largest = max(largest, change if change < np.inf else 0.0)
        return largest or abs(value) or 1.0

    def update(self, z: np.ndarray) -> float:
        """Take the next multipliers; how far z is from satisfying the constraints and their complements."""
        excess, _ = self.constraints(z, self.embed(z))
        worst = max((abs(max(g, -m)) for g, m in zip(excess, self.shifts, strict=True)), default=0.0)
        self.shifts = [max(0.0, m + g) for g, m in zip(excess, self.shifts, strict=True)]
        return worst

    def stiffen(self) -> None:
        """Raise the penalty; the multipliers stay."""
        self.penalty *= GROWTH
        self.shifts = [m / GROWTH for m in self.shifts]

    def inside(self, z: np.ndarray) -> None:
        """Evaluate the point of the box nearest to z, unless it was."""
        nearest = np.clip(z, self.lower[self.free], self.upper[self.free])
        if not np.array_equal(self.embed(nearest), self.x):
            self(nearest)
        if not self.value < np.inf:
            self.x = np.array(self.embed(nearest))

    def end(self, converged: bool, status: str) -> Minimum:
        """Give the best allowed point; without any, the last one, as not converged."""
        value, violation = self.value, 0.0
        excess, _ = self.constraints(self.x[self.free], self.x)
        violation = max(0.0, max(excess, default=0.0))
        if not value < np.inf:
            converged = False
            value = float(self.function(self.x))
            self.evaluations += 1
            status = VIOLATED if np.isfinite(value) else NOT_EVALUABLE
        return Minimum(
            self.x, value, self.evaluations, converged, as_history(self.history), status,
            self.multipliers(), violation,
        )  # fmt: skip

    def multipliers(self) -> np.ndarray:
        """Give the multipliers of lower bounds, upper bounds and inequalities, (2 param + inequality,)."""
        size = len(self.start)
        found = np.zeros(2 * size + len(self.shifts) - len(self.sides))
        for (i, sign, _, _), shift in zip(self.sides, self.shifts, strict=False):
            found[self.free[i] + (size if sign > 0 else 0)] = shift * self.penalty
        found[2 * size :] = np.array(self.shifts[len(self.sides) :]) * self.penalty
        return found
