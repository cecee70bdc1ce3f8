"""General searches for a minimum; nothing here depends on mechanisms."""

from monodyn.optimize.bfgs import Exhausted, bounded_bfgs
from monodyn.optimize.bracket import Bracket, Found, golden_section, line_search, swann
from monodyn.optimize.evolution import evolve
from monodyn.optimize.lagrangian import augmented_lagrangian
from monodyn.optimize.least_squares import Solution, dense, minimize
from monodyn.optimize.levenberg import Arrow, ArrowSolution, SearchSettings, minimize_arrow, minimize_together
from monodyn.optimize.minimum import Bounds, DirectSettings, Minimum
from monodyn.optimize.multistart import first_good, scatter
from monodyn.optimize.powell import powell
from monodyn.optimize.randomize import Draws, randomized

__all__ = [
    "Arrow",
    "ArrowSolution",
    "Bounds",
    "Bracket",
    "DirectSettings",
    "Draws",
    "Exhausted",
    "Found",
    "Minimum",
    "SearchSettings",
    "Solution",
    "augmented_lagrangian",
    "bounded_bfgs",
    "dense",
    "evolve",
    "first_good",
    "golden_section",
    "line_search",
    "minimize",
    "minimize_arrow",
    "minimize_together",
    "powell",
    "randomized",
    "scatter",
    "swann",
]
