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


def growth(errors: np.ndarray, position: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Return by how much errors of sizes and camera grow with the positions of one record, (..., dof).

    Args:
        errors: The errors [rad or m], (..., row, dof).
        position: Positions [rad or m], (row, dof).
        measured: Where positions were measured, bool (row, dof).
    """
    count = np.maximum(measured.sum(axis=0), 1)
    mean = np.where(measured, position, 0.0).sum(axis=0) / count
    away = np.where(measured, position - mean, 0.0)
    square = np.sum(away**2, axis=0)
    return np.sum(away * errors, axis=-2) / np.where(square > 0.0, square, 1.0)


def without_shared(
    position: np.ndarray, error: np.ndarray, measured: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Take an error of sizes and camera off the positions of one record.

    As far as it grows with the position it is a factor on the motion, and on the noise: a record that is made
    smaller is no better known. The factor is that of many small steps, so that no error makes it zero.

    Args:
        position: Positions [rad or m], (row, dof).
        error: The error [rad or m], (row, dof).
        measured: Where positions were measured, bool (row, dof).

    Returns:
        Positions without it, (row, dof), and the factor on their noise, (dof,).
    """
    rate = growth(error, position, measured)
    # q' = -rate (q - c) from 0 to 1 leads to q - (1 - exp(-rate)) (q - c), and the error is rate (q - c)
    share = np.where(rate == 0.0, 1.0, -np.expm1(-rate) / np.where(rate == 0.0, 1.0, rate))
    return np.where(measured, position - share * error, position), np.exp(-rate)
