"""The augmented Lagrangian: bounds and inequalities by a few searches without any."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from monodyn.optimize import minimum
from monodyn.optimize.powell import LEAST_REACH, USUAL_DIRECT, powell
from monodyn.optimize.status import EXHAUSTED, NOT_EVALUABLE, REACHED, UNMET, VIOLATED

FIRST_PENALTY = 20.0
"""First penalty of one step's violation, in changes of the function over one step."""
GROWTH = 5.0
"""Growth of the penalty where a round of multipliers did not lower the violation enough."""
ENOUGH = 0.25
"""Share to which a round of multipliers should lower the violation."""
ROUNDS = 30
"""Rounds of multipliers at most."""
OUTSIDE = 1.0
"""f is taken as infinite, and not called, where a constraint is violated by more steps than this (or than at
the start)."""

Inequalities = Callable[[np.ndarray], Sequence[float] | np.ndarray]


def augmented_lagrangian(
    function: Callable[[np.ndarray], float],
    start: np.ndarray,
    bounds: minimum.Bounds = minimum.UNBOUNDED,
    *,
    step: np.ndarray | float,
    inequalities: Inequalities | None = None,
    settings: minimum.DirectSettings = USUAL_DIRECT,
) -> minimum.Minimum:
    """Minimize f(x) within bounds and with g(x) <= 0 by the method of multipliers.

    Each round minimizes f(x) + r/2 sum_j (max(0, g_j(x) + m_j / r)^2 - (m_j / r)^2) without constraints, and
    then takes m_j = max(0, m_j + r g_j(x)). The bounds are constraints too, in steps. The penalty r is taken
    from the change of f over one step at the start, so that f may have any size. Where no constraint is
    active the first round is the last.

    The function is evaluated outside of its bounds too, mostly by a small part of a step and never by more
    than one; where it does not exist it gives NaN or infinity. An unknown with equal bounds stays there.

    Args:
        function: Gives f at x (param,).
        start: First x, (param,), inside the bounds.
        bounds: Lower and upper bounds, (param,) each or one for all; may be infinite.
        step: First step of each unknown, (param,) or one for all; above 0.
        inequalities: Gives g at x, (inequality,), each of a size near 1 for a violation as large as one step.
        settings: When to stop; the tolerance, of x and of the largest violation of g, is in steps.

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
        >>> found = augmented_lagrangian(bowl, np.zeros(2), (-1.0, 1.5), step=0.5)
        >>> [round(float(x), 2) for x in found.x]
        [1.5, 1.0]
    """
    start, lower, upper = minimum.checked_bounds(start, bounds)
    step = minimum.checked_sizes(step, len(start), "step")
    problem = _Problem(function, start, (lower, upper), step, inequalities, settings.tolerance)
    x = start[problem.free]
    value = problem(x)
    if not value < np.inf:
        return problem.end(False, NOT_EVALUABLE)
    if not len(x):
        return problem.end(True, REACHED)
    problem.penalty = FIRST_PENALTY * problem.change_over_a_step(x, value)
    return _rounds(problem, x, settings)


def _rounds(problem: _Problem, x: np.ndarray, settings: minimum.DirectSettings) -> minimum.Minimum:
    """Alternate searches without constraints and new multipliers, from x (free,)."""
    tolerance, step = settings.tolerance, problem.step[problem.free]
    inner_step, worst, converged, status = step, np.inf, False, UNMET
    for _ in range(ROUNDS):
        left = settings.evaluations - problem.evaluations - 1  # one is kept for the point put inside
        if left < 1:
            status = EXHAUSTED
            break
        inner = powell(problem, x, inner_step, settings=minimum.DirectSettings(tolerance, left))
        x = inner.x
        violation = problem.update(x)
        # Half the tolerance for the violation leaves the other half to the inner search.
        converged = inner.converged and violation <= 0.5 * tolerance
        if converged:
            status = REACHED
            break
        # Multipliers alone converge linearly, at a rate that falls with the penalty: raise it only where they
        # are slow, because a high penalty makes narrow valleys.
        if violation > ENOUGH * worst:
            problem.stiffen()
        worst = min(worst, violation)
        # The next minimum is about as far away as the constraint was missed; a full step would leave the
        # valley.
        inner_step = step * min(max(2.0 * violation, LEAST_REACH * tolerance), 1.0)
    problem.inside(x)
    return problem.end(converged, status)


class _Problem:
    """The augmented Lagrangian of the unknowns that can move; it counts, and keeps the best allowed point."""

    def __init__(
        self,
        function: Callable[[np.ndarray], float],
        start: np.ndarray,
        bounds: tuple[np.ndarray, np.ndarray],
        step: np.ndarray,
        inequalities: Inequalities | None,
        tolerance: float,
    ) -> None:
        self.function, self.inequalities = function, inequalities
        self.start, self.step, self.tolerance = start, step, tolerance
        self.lower, self.upper = lower, upper = bounds
        self.free = np.flatnonzero(upper > lower)
        self.all_free = len(self.free) == len(start)
        sides = [(i, -1.0, float(lower[k]), 1.0 / float(step[k])) for i, k in enumerate(self.free)]
        sides += [(i, 1.0, float(upper[k]), 1.0 / float(step[k])) for i, k in enumerate(self.free)]
        self.sides = [side for side in sides if np.isfinite(side[2])]
        others = len(np.atleast_1d(inequalities(start))) if inequalities else 0
        self.penalty = 0.0
        self.shifts = [0.0] * (len(self.sides) + others)  # multipliers / penalty
        self.evaluations = 0
        self.x, self.value = start, np.inf
        self.history: list[tuple[int, float]] = []
        self.outside = max(OUTSIDE, max(self.constraints(start[self.free], start)[0], default=0.0))

    def __call__(self, z: np.ndarray) -> float:
        """Return f and its penalty at the free unknowns (free,)."""
        x = self.embed(z)
        excess, allowed = self.constraints(z, x)
        # f may not exist far outside; the inner line search turns back at infinity
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
        # An inactive constraint contributes its constant alone: the sum and its slope are continuous where
        # g + m / r changes sign.
        for g, shift in zip(excess, self.shifts, strict=True):
            if g + shift > 0.0:
                total += (g + shift) ** 2
            total -= shift * shift
        return value + 0.5 * self.penalty * total

    def embed(self, z: np.ndarray) -> np.ndarray:
        """Return all unknowns (param,) from the free ones (free,)."""
        if self.all_free:
            return z
        x = self.start.copy()
        x[self.free] = z
        return x

    def constraints(self, z: np.ndarray, x: np.ndarray) -> tuple[list[float], bool]:
        """Return every constraint, bounds in steps first, and whether the point is allowed."""
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
            # inward, to the side with more room: only there the function is certain to exist
            upward = self.upper[k] - z[i] >= z[i] - self.lower[k]
            room = (self.upper[k] - z[i]) if upward else (z[i] - self.lower[k])
            there = z.copy()
            there[i] += min(self.step[k], room) * (1.0 if upward else -1.0)
            change = abs(self(there) - value)
            largest = max(largest, change if change < np.inf else 0.0)
        return largest or abs(value) or 1.0

    def update(self, z: np.ndarray) -> float:
        """Take the next multipliers; return how far z is from the conditions of a constrained minimum.

        Each constraint is met or its multiplier is zero: max(g, -m) vanishes for both.
        """
        excess, _ = self.constraints(z, self.embed(z))
        worst = max((abs(max(g, -m)) for g, m in zip(excess, self.shifts, strict=True)), default=0.0)
        # At the inner minimum the penalty pulls with r (g + m / r). Taking this pull as the next multiplier
        # leaves the gradient of f balanced without any violation, so that the next minimum moves onto the
        # constraint; it stays above zero because an inequality only pushes.
        self.shifts = [max(0.0, m + g) for g, m in zip(excess, self.shifts, strict=True)]
        return worst

    def stiffen(self) -> None:
        """Raise the penalty; the multipliers stay."""
        self.penalty *= GROWTH
        # shifts are multipliers by penalty: dividing them keeps the multipliers themselves
        self.shifts = [m / GROWTH for m in self.shifts]

    def inside(self, z: np.ndarray) -> None:
        """Evaluate the point of the box nearest to z, unless it was."""
        nearest = np.clip(z, self.lower[self.free], self.upper[self.free])
        if not np.array_equal(self.embed(nearest), self.x):
            self(nearest)
        if not self.value < np.inf:
            self.x = np.array(self.embed(nearest))

    def end(self, converged: bool, status: str) -> minimum.Minimum:
        """Return the best allowed point; without any, the last one, as not converged."""
        value, violation = self.value, 0.0
        excess, _ = self.constraints(self.x[self.free], self.x)
        violation = max(0.0, max(excess, default=0.0))
        if not value < np.inf:
            converged = False
            value = float(self.function(self.x))
            self.evaluations += 1
            status = VIOLATED if np.isfinite(value) else NOT_EVALUABLE
        return minimum.Minimum(
            self.x, value, self.evaluations, converged, minimum.as_history(self.history), status,
            self.multipliers(), violation,
        )  # fmt: skip

    def multipliers(self) -> np.ndarray:
        """Return the multipliers of lower bounds, upper bounds, inequalities, (2 param + inequality,)."""
        size = len(self.start)
        found = np.zeros(2 * size + len(self.shifts) - len(self.sides))
        for (i, sign, _, _), shift in zip(self.sides, self.shifts, strict=False):
            found[self.free[i] + (size if sign > 0 else 0)] = shift * self.penalty
        found[2 * size :] = np.array(self.shifts[len(self.sides) :]) * self.penalty
        return found
