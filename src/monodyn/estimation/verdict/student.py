"""Half width of a 95 % interval where a few residuals only tell the noise: Student's distribution."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

SURE = 0.95
"""Share of what is drawn that lies within."""


def half_width(freedom: float) -> float:
    """Return the half width of a 95 % interval in standard deviations.

    With t = sqrt(n) tan(a) the share between -t and t is 2 C times the integral of cos^(n-1) from 0 to a. It
    rises ever less steeply, so that Newton's steps from 0 approach it from below.

    Args:
        freedom: Degrees of freedom n; less than one count as one.

    Source:
        Student, The probable error of a mean, 1908; C follows from the gamma function.
    """
    n = max(freedom, 1.0)
    most = math.exp(math.lgamma(0.5 * (n + 1.0)) - math.lgamma(0.5 * n)) * 2.0 / math.sqrt(math.pi)
    nodes, weights = _quadrature()
    angle, step = 0.0, 1.0
    while step > 1e-13 * angle:
        share = most * 0.5 * angle * float(weights @ np.cos(0.5 * angle * (nodes + 1.0)) ** (n - 1.0))
        step = (SURE - share) / (most * math.cos(angle) ** (n - 1.0))
        angle += step
    return math.sqrt(n) * math.tan(angle)


@cache
def _quadrature() -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and weights of Gauss's quadrature between -1 and 1, (32,) each."""
    return np.polynomial.legendre.leggauss(32)
