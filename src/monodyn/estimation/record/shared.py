"""Errors that the positions of a record share, as sizes, camera and its roll make them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.types import Poses

SAME = 1e-9
"""Share by which what moves a joint's zero may differ from row to row, as a table rounds it."""


def end_to_end(records: Sequence[Poses], first: np.ndarray, source: np.ndarray) -> np.ndarray | None:
    """Lay the errors of several records end to end.

    Args:
        records: The records, joints in one order.
        first: First row of each and one past the last, (record + 1,).
        source: Row of its record at which a row was measured, below 0 where none was, int (row,).

    Returns:
        The errors, those of one record zero in all others, (direction, row, dof); None where there are none.
    """
    parts = []
    for k, record in enumerate(records):
        if record.shifts is not None and not record.cleared:
            rows = np.arange(first[k], first[k + 1])[source[first[k] : first[k + 1]] >= 0]
            # what is not known of one scene says nothing of another
            own = np.zeros((len(record.shifts), len(source), record.shifts.shape[2]))
            own[:, rows] = record.shifts[:, source[rows]]
            parts.append(own)
    return np.concatenate(parts) if parts else None


def moves_a_zero(shifts: np.ndarray | None, measured: np.ndarray) -> np.ndarray:
    """Return which errors move a single joint, by the same in each row, as a roll of the camera does.

    Args:
        shifts: Errors that positions share, (direction, row, dof), or None.
        measured: Where positions were measured, bool (row, dof).

    Returns:
        True for those, bool (direction,).
    """
    found = []
    for shift in () if shifts is None else shifts:
        rows, dofs = np.nonzero(measured & (shift != 0.0))
        one = shift[rows, dofs]
        # among the rows of a record none is left out
        whole = len(rows) > 0 and len(rows) == measured[rows[0] : rows[-1] + 1, dofs[0]].sum()
        found.append(whole and np.ptp(dofs) == 0 and np.ptp(one) <= SAME * np.abs(one[0]))
    return np.array(found, dtype=np.bool_)
