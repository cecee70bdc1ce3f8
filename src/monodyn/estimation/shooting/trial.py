"""What a search tries: unknowns and start states, how the records are cut and how finely integrated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.estimation.record.samples import Pieces

Run = tuple[int, int, np.ndarray]
"""First row, one past the last row and start state (2 dof,) of a rollout."""
Result = TypeVar("Result")
STEPS_OF_CHUNK = 1000
"""Integration steps for which it is worth to hand runs to another core."""
CHUNKS = 16
"""Parts into which runs are divided at most: more than there are cores, for some runs take longer."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One motion that can be compared with the records.

    Attributes:
        x: Coordinates of the shared unknowns, (param,).
        states: Start states, positions then rates [rad or m, rad/s or m/s], one row a piece, (piece, 2 dof).
        pieces: How the records are cut.
        substeps: Integration steps between two time stamps.
        most_off: How far off its derivatives may be, as ``simulate`` has it; 0 for those of the very rollout.
        known: Its motions, as far as they have been integrated; see `recalled`.
    """

    x: np.ndarray
    states: np.ndarray
    pieces: Pieces
    substeps: int = 1
    most_off: float = 0.0
    known: dict[str, tuple[tuple[object, ...], Any]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def at(self, x: np.ndarray, states: np.ndarray) -> Trial:
        """Return the trial at other unknowns, cut and integrated in the same way.

        Args:
            x: Coordinates, (param,).
            states: Start states, (piece, 2 dof).

        Returns:
            The other trial.
        """
        return replace(self, x=x, states=states)

    def recalled(self, what: str, of: tuple[object, ...]) -> Any:
        """Return what has been integrated of this trial, None where nothing has.

        A verdict asks for the same motion some ten times, weighted otherwise each time.

        Args:
            what: Name of what was integrated.
            of: The very objects that it depends on in addition to the trial.
        """
        before = self.known.get(what)
        if before is None or any(one is not other for one, other in zip(before[0], of, strict=True)):
            return None
        return before[1]

    def remember(self, what: str, of: tuple[object, ...], integrated: Result) -> Result:
        """Return what has been integrated, which is kept from here on.

        Args:
            what: Name of what was integrated.
            of: The very objects that it depends on in addition to the trial.
            integrated: It.
        """
        self.known[what] = (of, integrated)
        return integrated

    @property
    def runs(self) -> list[Run]:
        """First row, one past the last row and start state (2 dof,) of each piece."""
        return list(zip(self.pieces.first[:-1], self.pieces.first[1:], self.states, strict=True))


def in_batches(
    function: Callable[[Sequence[Run]], Result], runs: Sequence[Run], substeps: int
) -> list[Result]:
    """Apply a function to runs of rows, to all of them at once or, where there is enough to do, to neighbours
    on all cores.

    Args:
        function: The function; it integrates them.
        runs: The runs.
        substeps: Integration steps between two rows.

    Returns:
        What it returned, in their order.
    """
    steps = substeps * sum(stop - first for first, stop, _ in runs)
    chunks = min(len(runs), CHUNKS, steps // STEPS_OF_CHUNK)
    if chunks < 2:
        return [function(runs)]
    bounds = np.linspace(0, len(runs), chunks + 1).astype(int)
    return on_all_cores(function, [runs[a:b] for a, b in pairwise(bounds)])
