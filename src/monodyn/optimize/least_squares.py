"""Bounded nonlinear least squares: residuals with Jacobian in, the nearest minimum inside the bounds out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from monodyn.errors import SettingsError
from monodyn.optimize.levenberg import USUAL, Arrow, SearchSettings, minimize_arrow


@dataclass(frozen=True, eq=False)
class Solution:
    """Where a least-squares search ended.

    Attributes:
        x: Unknowns, (param,).
        cost: 1/2 r.r there.
        residual: Residuals there, (row,).
        jacobian: Jacobian there, (row, param).
        status: What ended the search, one sentence.
        converged: True when no step promises a lower cost.
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
    lower: np.ndarray | float = -np.inf,
    upper: np.ndarray | float = np.inf,
    *,
    settings: SearchSettings = USUAL,
    reach: np.ndarray | float = np.inf,
) -> Solution:
    """Minimize 1/2 r(x).r(x) subject to lower <= x <= upper.

    Residuals that are NaN or infinite make a rejected step; a Jacobian of any rank will do.

    Args:
        residuals_and_jacobian: Gives r (row,) and dr/dx (row, param) at x (param,).
        start: First x, (param,), inside the bounds.
        lower: Lower bounds, (param,) or one for all.
        upper: Upper bounds, (param,) or one for all.
        settings: When to stop.
        reach: Longest step of each unknown, (param,) or one for all.

    Returns:
        The best point found; its status says why the search ended.

    Raises:
        SettingsError: The bounds are reversed, the start lies outside them, or a longest step is not above 0.

    Source:
        Marquardt 1963, Moré 1978 (see `monodyn.optimize.levenberg`).

    Example:
        >>> import numpy as np
        >>> def line(x):
        ...     return np.array([x[0] + x[1] - 3.0, x[0] - x[1] - 1.0]), np.array([[1.0, 1.0], [1.0, -1.0]])
        >>> [round(float(x), 6) for x in minimize(line, np.zeros(2)).x]
        [2.0, 1.0]
    """
    start = np.array(start, dtype=float)
    lower, upper = np.broadcast_to(lower, start.shape), np.broadcast_to(upper, start.shape)
    reach = np.broadcast_to(reach, start.shape)
    _check(start, lower, upper, reach)

    def evaluate(x: np.ndarray, _: np.ndarray) -> Arrow:
        residual, jacobian = residuals_and_jacobian(x)
        finite = bool(np.isfinite(residual).all())
        return Arrow(
            0.5 * float(residual @ residual) if finite else float("inf"),
            jacobian.T @ jacobian if finite else np.full((len(x), len(x)), np.nan),
            jacobian.T @ residual if finite else np.full(len(x), np.nan),
            np.zeros((0, len(x), 0)), np.zeros((0, 0, 0)), np.zeros((0, 0)), (residual, jacobian),
        )  # fmt: skip

    found = minimize_arrow(evaluate, start, np.zeros((0, 0)), lower, upper, settings=settings, reach=reach)
    residual, jacobian = found.model.kept
    return Solution(
        found.shared, found.model.cost, residual, jacobian, found.status, found.converged, found.evaluations,
        found.at_bound,
    )  # fmt: skip


def _check(start: np.ndarray, lower: np.ndarray, upper: np.ndarray, reach: np.ndarray) -> None:
    for i, (x, a, b, far) in enumerate(zip(start, lower, upper, reach, strict=True)):
        if a > b:
            raise SettingsError(
                f"unknown {i}: the lower bound {a:g} is above the upper bound {b:g}; swap them."
            )
        if not a <= x <= b:
            raise SettingsError(
                f"unknown {i}: the start {x:g} is outside its bounds {a:g} to {b:g}; move it inside."
            )
        if not far > 0:
            raise SettingsError(f"unknown {i}: expected a longest step above 0, got {far:g}.")
