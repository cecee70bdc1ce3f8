"""Bounded least squares by a quasi-Newton search with active set."""

from __future__ import annotations

from collections.abc import Callable

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

FAILURES = (ArithmeticError, ValueError, np.linalg.LinAlgError)
STALLED = "No smaller value was found along the search direction."
EDGE = "The search ended at the edge of where the residuals exist; choose another start."


def bounded_bfgs(
    residuals: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    lower: np.ndarray | float = -np.inf,
    upper: np.ndarray | float = np.inf,
    *,
    scale: np.ndarray | float = 1.0,
    jacobian: Callable[[np.ndarray], np.ndarray] | None = None,
    norm: bool = False,
    penalty: float = 1e3,
    difference: float = 1e-7,
    tolerance: float = 1e-10,
    most: int = 10000,
    restarts: int = 5,
) -> Minimum:
    """Minimize 1/2 r(x).r(x), or its root |r|, subject to lower <= x <= upper.

    scipy's SLSQP (Kraft 1988) does it: sequential quadratic programming with Powell's damped BFGS update of
    the Hessian and an active set in the quadratic subproblem: the paper's active-set method with BFGS. It
    works on unknowns in units of their scale and on the value in units of that at the start. Where the
    residuals do not exist (not finite, or the function raises ArithmeticError, ValueError or LinAlgError)
    the value is a large finite penalty, so that the line search turns back. The search begins again at its
    best point, with a fresh Hessian, as long as that lowers the value.

    Args:
        residuals: Gives r (row,) at x (param,); never called outside of the bounds.
        start: First x, (param,), inside the bounds; the residuals must exist there.
        lower: Lower bounds, (param,) or one for all; may be infinite.
        upper: Upper bounds, (param,) or one for all; may be infinite.
        scale: Typical size of each unknown, (param,) or one for all; above 0.
        jacobian: Gives dr/dx (row, param); default forward differences, each counted as an evaluation.
        norm: Minimize |r| in place of 1/2 r.r; the minimum is the same.
        penalty: Value where the residuals do not exist, in values at the start.
        difference: Step of the differences, in scales.
        tolerance: Done when the value changes by less than this share of that at the start.
        most: Evaluations of the residuals at the most.
        restarts: Searches from the best point at the most, after the first.

    Returns:
        The best point where the residuals exist; the value is 1/2 r.r or |r|. A search whose last steps met
            points without residuals is not converged: it may have stopped at their edge.

    Raises:
        SettingsError: The bounds are reversed, the start lies outside them, or a scale is not above 0.

    Source:
        The paper's solver of eq. 14 and its penalty on systems that cannot be simulated; Kraft, A software
        package for sequential quadratic programming, 1988.

    Example:
        >>> def valley(x):
        ...     return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])
        >>> found = bounded_bfgs(valley, np.zeros(2), -2.0, 2.0)
        >>> [round(float(x), 4) for x in found.x]
        [1.0, 1.0]
    """
    start, lower, upper = checked_bounds(start, lower, upper)
    scale = checked_sizes(scale, len(start), "scale")
    fit = _Fit(residuals, jacobian, (lower, upper), scale, norm, penalty, difference, most)
    first = fit.evaluate(start)
    if first is None:
        return Minimum(start, np.inf, fit.evaluations, False, as_history(fit.history), NOT_EVALUABLE)
    converged, status = False, EXHAUSTED
    fit.unit = fit.best[1] or 1.0
    try:
        for _ in range(restarts + 1):
            before, failures = fit.best[1], fit.failures
            done = fit.search(tolerance)
            edge = fit.failures > failures and fit.best[1] > tolerance * fit.unit
            converged = done and not edge
            status = REACHED if converged else EDGE if edge else STALLED
            if before - fit.best[1] <= tolerance * fit.unit:
                break
    except _Exhausted:
        converged, status = False, EXHAUSTED
    x, value = fit.best
    return Minimum(x, value, fit.evaluations, converged, as_history(fit.history), status)


class _Exhausted(Exception):
    """The evaluations ran out."""


class _Fit:
    """Value and slope in scaled unknowns; counts, and keeps the best point."""

    def __init__(self, residuals, jacobian, bounds, scale, norm, penalty, difference, most) -> None:
        self.residuals, self.jacobian = residuals, jacobian
        self.lower, self.upper = bounds
        self.scale, self.norm, self.penalty, self.difference = scale, norm, penalty, difference
        self.most, self.evaluations, self.failures, self.unit = most, 0, 0, 1.0
        self.best: tuple[np.ndarray, float] = (np.zeros(0), np.inf)
        self.history: list[tuple[int, float]] = []
        self.last: tuple[np.ndarray, np.ndarray | None] | None = None

    def evaluate(self, x: np.ndarray) -> np.ndarray | None:
        """Give the residuals at x, or None where they do not exist."""
        if self.evaluations >= self.most:
            raise _Exhausted
        self.evaluations += 1
        try:
            found = np.asarray(self.residuals(x.copy()), dtype=float)
        except FAILURES:
            found = np.full(1, np.nan)
        value = self.value(found)
        if not value < np.inf:
            self.failures += 1
            return None
        if value < self.best[1]:
            self.best = x.copy(), value
            self.history.append((self.evaluations, value))
        return found

    def value(self, residual: np.ndarray) -> float:
        """Give 1/2 r.r or |r|."""
        with np.errstate(over="ignore", invalid="ignore"):
            square = float(residual @ residual)
        return square**0.5 if self.norm else 0.5 * square

    def search(self, tolerance: float) -> bool:
        """Search once from the best point; True when the method says that it is done."""
        from scipy.optimize import Bounds, minimize

        bounds = Bounds(self.lower / self.scale, self.upper / self.scale)  # pyright: ignore[reportArgumentType]
        found = minimize(
            self.scaled_value, self.best[0] / self.scale, jac=self.slope, method="SLSQP", bounds=bounds,
            options={"ftol": tolerance, "maxiter": self.most},
        )  # fmt: skip
        return bool(found.success)

    def at(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Give x and the residuals there, from the last call where it is the same point."""
        x = np.clip(z * self.scale, self.lower, self.upper)
        if self.last is None or not np.array_equal(self.last[0], x):
            self.last = x, self.evaluate(x)
        return self.last

    def scaled_value(self, z: np.ndarray) -> float:
        """Give the value in values at the start; the penalty where there are no residuals."""
        residual = self.at(z)[1]
        return self.penalty if residual is None else min(self.value(residual) / self.unit, self.penalty)

    def slope(self, z: np.ndarray) -> np.ndarray:
        """Give the slope of the scaled value; 0 where there are no residuals."""
        x, residual = self.at(z)
        if residual is None:
            return np.zeros(len(x))
        along = self.differences(x, residual) if self.jacobian is None else self.jacobian(x).T @ residual
        length = self.value(residual) if self.norm else 1.0
        return along * self.scale / (self.unit * (length or 1.0))

    def differences(self, x: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Give the slope of 1/2 r.r by differences, backward where forward leaves the bounds or fails."""
        along = np.zeros(len(x))
        for i in np.flatnonzero(self.upper > self.lower):
            size = self.difference * max(self.scale[i], abs(x[i]))
            for step in (size, -size):
                moved = x.copy()
                moved[i] = min(max(x[i] + step, self.lower[i]), self.upper[i])
                if abs(moved[i] - x[i]) < 0.5 * size:
                    continue
                other = self.evaluate(moved)
                if other is not None:
                    along[i] = (other - residual) @ residual / (moved[i] - x[i])
                    break
        return along
