"""Residuals in, weighted draws of the distribution exp(-1/2 r(x).r(x)) out, for residuals that bend.

A covariance at the best point describes that distribution where residuals are linear over its width. Draws
follow it where it is bent: each is where the residuals, projected onto what they span at the best point, take
drawn values. What is left over gives a draw its weight.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

ROUNDS = 30
"""Steps from the linear solution to a draw at most; three to five are usual."""
NEAR = 0.03
"""A draw is found where it is this near to its target, in standard deviations."""
ROUNDING = 1e-12
"""Share of the largest derivative up to which one is rounding; unknowns may be in any unit."""
SEEN = 1e-6
"""Directions along which the residuals change less than this share of the most are left as they are."""
DAMPING, MOST_DAMPING = 1e-3, 1e6
"""First damping of a step that did not lead nearer, and the one at which a draw is given up."""

Rows = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Residuals (draw, row) and their Jacobian (draw, row, param) at points (draw, param)."""


class Draws(NamedTuple):
    """Weighted points.

    Attributes:
        points: The points, (draw, param).
        weights: Their weights, of sum one, (draw,); zero for those that were not found.
    """

    points: np.ndarray
    weights: np.ndarray

    @property
    def effective(self) -> float:
        """As how many draws of equal weight they count; 0 without any."""
        total = float(np.sum(self.weights**2))
        return 1.0 / total if total > 0 else 0.0


def randomized(
    rows: Rows,
    best: np.ndarray,
    noise: np.ndarray,
    *,
    reach: np.ndarray | float = np.inf,
) -> Draws:
    """Draw from the distribution exp(-1/2 r(x).r(x)) about its peak.

    With Q an orthonormal basis of what the Jacobian spans at the peak, each draw solves Q'r(x) = Q'e for
    noise e. Such points have the density |det Q'J| exp(-1/2 |Q'r|^2), so that their weight is the rest,
    exp(-1/2 (|r|^2 - |Q'r|^2)) / |det Q'J|. Where the residuals are linear all weights are equal.

    Args:
        rows: Residuals and Jacobian at many points.
        best: The peak, (param,).
        noise: Draws of the residuals' noise, standard normal, (draw, row).
        reach: Longest step of each unknown, (param,) or one for all.

    Returns:
        The draws; along directions that no residual sees they stay at the peak.

    Source:
        Bardsley, Solonen, Haario and Laine, Randomize-then-optimize: a method for sampling from posterior
        distributions in nonlinear inverse problems, 2014.

    Example:
        >>> import numpy as np
        >>> rows = lambda x: (x - 1.0, np.ones((len(x), 1, 1)))
        >>> randomized(rows, np.array([1.0]), np.array([[0.5], [-0.5]])).points.ravel().tolist()
        [1.5, 0.5]
    """
    _, jacobian = rows(best[None])
    scale = np.linalg.norm(jacobian[0], axis=0)
    # what the residuals do not depend on but for rounding is not seen
    scale = np.where(scale > ROUNDING * np.max(scale, initial=0.0), scale, np.inf)
    left, singular, right = np.linalg.svd(jacobian[0] / scale, full_matrices=False)
    seen = singular > SEEN * singular[:1]
    onto = left[:, seen]
    # in these directions the projected Jacobian is the unit matrix at the peak
    along = right[seen].T / scale[:, None] / singular[seen]
    points, residuals, slopes, off = _solved(rows, best, noise @ onto, onto, along, reach)
    within = residuals @ onto
    rest = np.sum(residuals**2, axis=1) - np.sum(within**2, axis=1)
    with np.errstate(divide="ignore"):
        logs = -0.5 * rest - np.linalg.slogdet(slopes)[1]
    found = (off < NEAR) & np.isfinite(logs)
    if not found.any():
        return Draws(points, np.zeros(len(points)))
    weights = np.where(found, np.exp(np.where(found, logs - logs[found].max(), 0.0)), 0.0)
    return Draws(points, weights / weights.sum())


def _solved(
    rows: Rows, best: np.ndarray, aims: np.ndarray, onto: np.ndarray, along: np.ndarray,
    reach: np.ndarray | float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Solve Q'r(best + V z) = aim for every aim by damped Gauss-Newton steps.

    Args:
        rows: Residuals and Jacobian at many points.
        best: The peak, (param,).
        aims: What the projected residuals are to be, (draw, direction).
        onto: Q, (row, direction).
        along: V, (param, direction).
        reach: Longest step of each unknown.

    Returns:
        Points (draw, param), residuals (draw, row), projected Jacobians (draw, direction, direction) and how
        far from its aim each is, (draw,).
    """

    def evaluate(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        with np.errstate(all="ignore"):
            residuals, jacobian = rows(points)
            return residuals, onto.T @ jacobian @ along, residuals @ onto

    points = best + aims @ along.T
    residuals, slopes, at = evaluate(points)
    off = _lengths(at - aims)
    if not np.isfinite(off).all():
        # the linear solution may lie where there is nothing: such draws begin at the peak
        lost = ~np.isfinite(off)
        points[lost] = best
        residuals[lost], slopes[lost], at[lost] = evaluate(points[lost])
        off = _lengths(at - aims)
    damping = np.zeros(len(points))
    for _ in range(ROUNDS):
        open_ = np.flatnonzero((off >= NEAR) & (damping < MOST_DAMPING))
        if not len(open_):
            break
        a, b = slopes[open_], (at - aims)[open_]
        # a draw that went so far that its squares are no numbers takes no step
        with np.errstate(over="ignore", invalid="ignore"):
            normal = np.swapaxes(a, 1, 2) @ a
        # the unit matrix is the natural scale here; a share of its own size keeps every matrix regular
        least = 1e-12 * (1.0 + np.einsum("kii->k", normal))
        np.einsum("kii->ki", normal)[:] += (damping[open_] + least)[:, None]
        step = -np.linalg.solve(normal, np.einsum("kij,ki->kj", a, b)[:, :, None])[:, :, 0] @ along.T
        step /= np.maximum(np.max(np.abs(step) / reach, axis=1, initial=0.0), 1.0)[:, None]
        tried = points[open_] + step
        found = evaluate(tried)
        nearer = _lengths(found[2] - aims[open_]) < off[open_]
        nearer &= np.isfinite(found[1]).all(axis=(1, 2))
        good, bad = open_[nearer], open_[~nearer]
        points[good] = tried[nearer]
        residuals[good], slopes[good], at[good] = (part[nearer] for part in found)
        off[good] = _lengths(at[good] - aims[good])
        damping[good] = np.where(damping[good] > DAMPING, 0.1 * damping[good], 0.0)
        damping[bad] = np.maximum(10.0 * damping[bad], DAMPING)
    return points, residuals, slopes, off


def _lengths(vectors: np.ndarray) -> np.ndarray:
    """Return the length of each row, (draw,); infinite where it is no number."""
    with np.errstate(over="ignore", invalid="ignore"):
        lengths = np.sqrt(np.sum(vectors**2, axis=1))
    return np.where(np.isfinite(lengths), lengths, np.inf)
