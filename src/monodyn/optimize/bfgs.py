"""Bounded least squares by a quasi-Newton search with an active set."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from monodyn.optimize.minimum import UNBOUNDED, Bounds, Minimum, as_history, checked_bounds
from monodyn.optimize.status import EDGE, EXHAUSTED, NOT_EVALUABLE, REACHED, STALLED

FAILURES = (ArithmeticError, ValueError, np.linalg.LinAlgError)
PENALTY = 1e3
"""Value where the residuals do not exist, in values at the start."""
DIFFERENCE = 1e-7
"""Step of the differences, in units of an unknown or as a share of it, whichever is larger."""
RESTARTS = 5
"""Searches from the best point at most, after the first."""


class Exhausted(Exception):
    """No more evaluations are allowed; residuals or a Jacobian that raise it end the search at its best."""


def bounded_bfgs(
    residuals: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    bounds: Bounds = UNBOUNDED,
    *,
    tolerance: float = 1e-10,
    most: int = 10000,
    jacobian: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Minimum:
    """Minimize 1/2 r(x).r(x) within bounds.

    scipy's SLSQP (Kraft 1988) does it: sequential quadratic programming with Powell's damped BFGS update of
    the Hessian and an active set in the quadratic subproblem. It works on the value in units of that at the
    start, with forward differences, each counted as an evaluation. Where the residuals do not exist (not
    finite, or the function raises ArithmeticError, ValueError or LinAlgError) the value is a large finite
    penalty, so that the line search turns back. The search begins again at its best point, with a fresh
    Hessian, as long as that lowers the value.

    Args:
        residuals: Gives r (row,) at x (param,); never called outside of the bounds.
        start: First x, (param,), inside the bounds; the residuals must exist there. The unknowns should be
            in units of their typical size.
        bounds: Lower and upper bounds, (param,) each or one for all; may be infinite.
        tolerance: Done when the value changes by less than this share of that at the start.
        most: Evaluations of the residuals at most, Jacobians among them.
        jacobian: Gives dr/dx (row, param) in place of differences; counted as one evaluation. Where it takes
            more, who gives it counts them, and raises ``Exhausted`` when too many are spent.

    Returns:
        The best point where the residuals exist, with the value 1/2 r.r. A search whose last steps met points
            without residuals is not converged: it may have stopped at their edge.

    Raises:
        SettingsError: The bounds are reversed, or the start lies outside them.

    Source:
        The paper's solver of eq. 14 and its penalty on systems that cannot be simulated; Kraft, A software
        package for sequential quadratic programming, 1988.

    Example:
        >>> def valley(x):
        ...     return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])
        >>> found = bounded_bfgs(valley, np.zeros(2), (-2.0, 2.0))
        >>> [round(float(x), 4) for x in found.x]
        [1.0, 1.0]
    """
    start, lower, upper = checked_bounds(start, bounds)
    fit = _Fit(residuals, (lower, upper), most, jacobian)
    first = fit.evaluate(start)
    if first is None:
        return Minimum(start, np.inf, fit.evaluations, False, as_history(fit.history), NOT_EVALUABLE)
    fit.unit = fit.best[1] or 1.0
    try:
        status = _searches(fit, tolerance)
    except Exhausted:
        status = EXHAUSTED
    x, value = fit.best
    return Minimum(x, value, fit.evaluations, status == REACHED, as_history(fit.history), status)


def _searches(fit: _Fit, tolerance: float) -> str:
    """Search from the best point as long as that lowers the value; return the status of the last search."""
    status = STALLED
    for _ in range(RESTARTS + 1):
        before, failures = fit.best[1], fit.failures
        done = fit.search(tolerance)
        # The penalty is flat, so a search that met it has no slope back: its end may be no minimum.
        edge = fit.failures > failures and fit.best[1] > tolerance * fit.unit
        status = EDGE if edge else REACHED if done else STALLED
        if before - fit.best[1] <= tolerance * fit.unit:
            break
    return status


class _Fit:
    """Value and slope in units of the value at the start; counts, and keeps the best point."""

    def __init__(
        self,
        residuals: Callable[[np.ndarray], np.ndarray],
        bounds: tuple[np.ndarray, np.ndarray],
        most: int,
        jacobian: Callable[[np.ndarray], np.ndarray] | None,
    ) -> None:
        self.residuals, self.most, self.jacobian = residuals, most, jacobian
        self.lower, self.upper = bounds
        self.evaluations, self.failures, self.unit = 0, 0, 1.0
        self.best: tuple[np.ndarray, float] = (np.zeros(0), np.inf)
        self.history: list[tuple[int, float]] = []
        self.last: tuple[np.ndarray, np.ndarray | None] | None = None

    def evaluate(self, x: np.ndarray) -> np.ndarray | None:
        """Return the residuals at x (param,), (row,), or None where they do not exist."""
        if self.evaluations >= self.most:
            raise Exhausted
        self.evaluations += 1
        try:
            # a copy: a function that changes its argument must not change the point that is kept
            found = np.asarray(self.residuals(x.copy()), dtype=float)
        except FAILURES:
            found = np.full(1, np.nan)
        value = _half_square(found)
        if not value < np.inf:
            self.failures += 1
            return None
        if value < self.best[1]:
            self.best = x.copy(), value
            self.history.append((self.evaluations, value))
        return found

    def search(self, tolerance: float) -> bool:
        """Search once from the best point; True when the method reports that it is done."""
        from scipy.optimize import Bounds as ScipyBounds
        from scipy.optimize import minimize

        bounds = ScipyBounds(self.lower, self.upper)  # pyright: ignore[reportArgumentType]
        found = minimize(
            self.value, self.best[0], jac=self.slope, method="SLSQP", bounds=bounds,
            options={"ftol": tolerance, "maxiter": self.most},
        )  # fmt: skip
        return bool(found.success)

    def at(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Return x (param,) inside the bounds and the residuals there (row,) or None.

        SLSQP requests value and slope at the same point in turn: the last point is kept.
        """
        x = np.clip(z, self.lower, self.upper)
        if self.last is None or not np.array_equal(self.last[0], x):
            self.last = x, self.evaluate(x)
        return self.last

    def value(self, z: np.ndarray) -> float:
        """Return the value at z (param,) in values at the start; the penalty where there are no residuals."""
        residual = self.at(z)[1]
        # Capped at the penalty, so that a point without residuals is never lower than one with them; finite,
        # because an infinite value would put NaN into SLSQP's quadratic model.
        return PENALTY if residual is None else min(_half_square(residual) / self.unit, PENALTY)

    def slope(self, z: np.ndarray) -> np.ndarray:
        """Return the slope of the value at z (param,), (param,); 0 where there are no residuals."""
        x, residual = self.at(z)
        # the penalty is a plateau: its slope is zero, and the line search alone leads back from it
        if residual is None:
            return np.zeros(len(x))
        if self.jacobian is not None:
            if self.evaluations >= self.most:
                raise Exhausted
            self.evaluations += 1
            along = residual @ self.jacobian(x)
            # derivatives overflow before the residuals themselves do
            if np.isfinite(along).all():
                return along / self.unit
        return self.differences(x, residual) / self.unit

    def differences(self, x: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Return the slope of 1/2 r.r by differences, (param,).

        They are forward, and backward where forward leaves the bounds or meets no residuals.
        """
        along = np.zeros(len(x))
        for i in np.flatnonzero(self.upper > self.lower):
            size = DIFFERENCE * max(1.0, abs(x[i]))
            for step in (size, -size):
                moved = x.copy()
                moved[i] = min(max(x[i] + step, self.lower[i]), self.upper[i])
                # clipped by a bound the step is too short to divide by: the other side is taken
                if abs(moved[i] - x[i]) < 0.5 * size:
                    continue
                other = self.evaluate(moved)
                if other is not None:
                    # r.dr/dx, and not the difference of two values 1/2 r.r: near the optimum these agree in
                    # most digits.
                    along[i] = (other - residual) @ residual / (moved[i] - x[i])
                    break
        return along


def _half_square(residual: np.ndarray) -> float:
    """Return 1/2 r.r of (row,); what overflows is infinite."""
    with np.errstate(over="ignore", invalid="ignore"):
        return 0.5 * float(residual @ residual)
