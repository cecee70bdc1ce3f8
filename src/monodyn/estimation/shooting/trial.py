"""What a search tries: unknowns and start states, how the records are cut and how finely integrated."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from monodyn.estimation.record.samples import Pieces


@dataclass(frozen=True, eq=False)
class Trial:
    """One motion that can be compared with the records.

    Attributes:
        x: Coordinates of the shared unknowns, (param,).
        states: Start states, positions then rates [rad or m, rad/s or m/s], one row a piece, (piece, 2 dof).
        pieces: How the records are cut.
        substeps: Integration steps between two time stamps.
    """

    x: np.ndarray
    states: np.ndarray
    pieces: Pieces
    substeps: int = 1

    def at(self, x: np.ndarray, states: np.ndarray) -> Trial:
        """Return the trial at other unknowns, cut and integrated in the same way.

        Args:
            x: Coordinates, (param,).
            states: Start states, (piece, 2 dof).

        Returns:
            The other trial.
        """
        return replace(self, x=x, states=states)

    @property
    def runs(self) -> list[tuple[int, int, np.ndarray]]:
        """First row, one past the last row and start state (2 dof,) of each piece."""
        return list(zip(self.pieces.first[:-1], self.pieces.first[1:], self.states, strict=True))
