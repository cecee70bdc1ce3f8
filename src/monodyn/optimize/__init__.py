"""Searches that know nothing of pendulums."""

from monodyn.optimize.least_squares import Solution, minimize
from monodyn.optimize.levenberg import Arrow, ArrowSolution, SearchSettings, minimize_arrow
from monodyn.optimize.multistart import first_good, scatter

__all__ = [
    "Arrow",
    "ArrowSolution",
    "SearchSettings",
    "Solution",
    "first_good",
    "minimize",
    "minimize_arrow",
    "scatter",
]
