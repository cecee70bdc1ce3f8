"""Bounded nonlinear least squares: residuals with Jacobian in, the nearest minimum inside the bounds out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from monodyn.errors import SettingsError
from monodyn.optimize.levenberg import USUAL_SEARCH, Arrow, SearchSettings, minimize_arrow
from monodyn.optimize.minimum import UNBOUNDED, Bounds, checked_bounds


@dataclass(frozen=True, eq=False)
class Solution:
    """Where a least-squares search ended.

    Attributes:
        x: Unknowns, (param,).
        cost: 1/2 r.r there.
        residual: Residuals there, (row,).
        jacobian: Jacobian there, (row, param).
        status: What ended the search, one sentence.
        converged: True when no step predicts a lower cost.
        evaluations: Number of evaluations.
        at_bound: True for unknowns on a bound, (param,).
    """

    x: np.ndarray
    cost: float
    residual: np.ndarray
    jacobian: np.ndarray
    status: str
    converged: bool
    evaluations: int
    at_bound: np.ndarray


def minimize(
    residuals_and_jacobian: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    start: np.ndarray,
    bounds: Bounds = UNBOUNDED,
    *,
    settings: SearchSettings = USUAL_SEARCH,
    reach: np.ndarray | float = np.inf,
) -> Solution:
    """Minimize 1/2 r(x).r(x) within bounds.

    Residuals that are NaN or infinite make a rejected step; a Jacobian may have any rank.

    Args:
        residuals_and_jacobian: Gives r (row,) and dr/dx (row, param) at x (param,).
        start: First x, (param,), inside the bounds.
        bounds: Lower and upper bounds, (param,) each or one for all.
        settings: When to stop.
        reach: Longest step of each unknown, (param,) or one for all.

    Returns:
        The best point found; its status is the reason why the search ended.

    Raises:
        SettingsError: A longest step is not above 0, the bounds are reversed or the start lies outside them.

    Source:
        Marquardt 1963, Moré 1978 (see `monodyn.optimize.levenberg`).

    Example:
        >>> import numpy as np
        >>> def line(x):
        ...     return np.array([x[0] + x[1] - 3.0, x[0] - x[1] - 1.0]), np.array([[1.0, 1.0], [1.0, -1.0]])
        >>> [round(float(x), 6) for x in minimize(line, np.zeros(2)).x]
        [2.0, 1.0]
    """
    start, lower, upper = checked_bounds(start, bounds)
    reach = np.broadcast_to(reach, start.shape)
    for i, far in enumerate(reach.tolist()):
        if not far > 0:
            raise SettingsError(f"unknown {i}: expected a longest step above 0, got {far:g}.")

    def evaluate(x: np.ndarray, _: np.ndarray) -> Arrow:
        return dense(*residuals_and_jacobian(x))

    found = minimize_arrow(evaluate, start, np.zeros((0, 0)), (lower, upper), settings=settings, reach=reach)
    residual, jacobian = found.model.kept
    return Solution(
        found.shared, found.model.cost, residual, jacobian, found.status, found.converged, found.evaluations,
        found.at_bound,
    )  # fmt: skip


def dense(residual: np.ndarray, jacobian: np.ndarray) -> Arrow:
    """Return the arrow without blocks of residuals and their Jacobian.

    Args:
        residual: Residuals, (row,).
        jacobian: Their Jacobian, (row, param).
    """
    size = jacobian.shape[1]
    # A cost that is infinite makes the search reject the step; the blocks need only be there.
    finite = bool(np.isfinite(residual).all())
    return Arrow(
        0.5 * float(residual @ residual) if finite else float("inf"),
        jacobian.T @ jacobian if finite else np.full((size, size), np.nan),
        jacobian.T @ residual if finite else np.full(size, np.nan),
        np.zeros((0, size, 0)), np.zeros((0, 0, 0)), np.zeros((0, 0)), (residual, jacobian),
    )  # fmt: skip
