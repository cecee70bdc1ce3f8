"""What sizes and camera are wrong by, seen from the motion: errors that all positions of a record share.

A picture leaves open how the camera is turned and how far away it stands. What it is wrong by moves the
positions of all frames, each by its own amount; a motion that follows the dynamics tells part of that from
noise. Each direction in which the scene is not known is an unknown with a deviation of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monodyn.estimation.parts import Common
from monodyn.estimation.record.samples import Data, Pieces
from monodyn.estimation.record.shared import growth, moves_a_zero, without_shared
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.trial import Trial
from monodyn.types import Poses

ALIKE = 10.0
"""Frames that tell as much of such errors as one: in poses nearby edges are off alike, as no shift has it."""
UNSURE = 0.3
"""Deviations of each direction that no motion takes away: how the outline follows sizes and camera is linear
about what was found alone, and edges have errors of other shapes."""
SEEN = 1e-9
"""Share of the largest singular value below which unknowns count as without effect."""


def unknown_errors(data: Data) -> Common | None:
    """Return what is known of such errors before the motion is; None where nothing moves positions together.

    Args:
        data: The data.
    """
    if data.shifts is None or not data.shifts.any():
        return None
    count = len(data.shifts)
    return Common(np.zeros(count), np.eye(count))


def common_error(problem: Problem, trial: Trial, so_far: np.ndarray) -> Common:
    """Return what the positions have in common that is no motion.

    Args:
        problem: The problem, its noise as found, its positions less what is known so far.
        trial: Its optimum.
        so_far: How many deviations of each direction were taken off, (direction,).

    Returns:
        How many deviations of each are likeliest once unknowns and start states have followed; at least
        ``UNSURE`` of each stay open, but for the zero of a joint.

    Source:
        Lindley and Smith, Bayes estimates for the linear model, 1972.
    """
    residuals, jacobian = problem.rows(trial)
    shifts, count = whitened_shifts(_at_motion(problem, trial)), len(trial.x)
    shared = _projected(jacobian, residuals, shifts, count, trial.pieces)
    # what the picture knows of sizes is as many further rows, which no shift moves
    values, vectors = np.linalg.eigh(problem.prior.information)
    known = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    off = known @ problem.prior.away(trial.x - problem.unknowns.x0)
    rows = np.concatenate((known, np.zeros((count, shifts.shape[2])), off[:, None]), axis=1)
    stacked = np.concatenate((shared, rows))
    unknowns, moved, left = stacked[:, :count], stacked[:, count:-1], stacked[:, -1]
    basis = _span(unknowns)
    moved, left = moved - basis @ (basis.T @ moved), left - basis @ (basis.T @ left)
    # edges are off in the ways that sizes and camera move them, and not as a joint's zero does
    exact = moves_a_zero(problem.data.shifts, problem.data.measured)
    alike = _span(moved[:, ~exact])
    counted = np.column_stack((moved, left))
    counted -= (1.0 - 1.0 / ALIKE) * alike @ (alike.T @ counted)
    information = moved.T @ counted[:, :-1]
    # the residuals are those of positions less ``so_far``
    pull = information @ so_far - moved.T @ counted[:, -1]
    nothing, unsure = np.eye(len(so_far)), np.where(exact, 0.0, UNSURE)
    covariance = np.linalg.inv(nothing + information)
    return Common(covariance @ pull, covariance + np.outer(unsure, unsure) * (nothing - covariance))


def less(data: Data, mean: np.ndarray) -> Data:
    """Return data with errors that the positions have in common taken off.

    Args:
        data: The data.
        mean: How many deviations of each direction of its ``shifts`` they are, (direction,).
    """
    if data.shifts is None:
        return data
    off, position = np.tensordot(mean, data.shifts, axes=1), data.position.copy()
    factor = np.ones(position.shape)
    for rows in data.of_records:
        position[rows], factor[rows] = without_shared(position[rows], off[rows], data.measured[rows])
    white = data.white / factor[:, np.newaxis]
    return replace(data, position=position, white=white, shifts=data.shifts * factor)


def left_open(data: Data, root: np.ndarray) -> Data:
    """Return data with less left open of such errors.

    Args:
        data: The data.
        root: One deviation of each independent direction that is left, (direction, direction).
    """
    return data if data.shifts is None else replace(data, shifts=np.tensordot(root.T, data.shifts, axes=1))


def by_record(common: Common, records: Sequence[Poses]) -> tuple[Common | None, ...]:
    """Return the part of each record; None for one of which nothing is said.

    Args:
        common: Of all records, one after the other.
        records: The records.
    """
    found, first = [], 0
    for record in records:
        count = 0 if record.shifts is None or record.cleared else len(record.shifts)
        found.append(common.of(slice(first, first + count)) if count else None)
        first += count
    return tuple(found)


def whitened_shifts(data: Data) -> np.ndarray:
    """Return what moves the positions together as the residuals have it, (row, dof, direction).

    Args:
        data: The data.
    """
    rows, dofs = data.position.shape
    if data.shifts is None:
        return np.zeros((rows, dofs, 0))
    return data.white @ np.moveaxis(data.shifts, 0, 2)


def _at_motion(problem: Problem, trial: Trial) -> Data:
    """Return the data with such errors as the simulated positions have them: those of measured ones have a
    part of the noise, which seems to become less if the record is made smaller."""
    data, difference = problem.data, np.nan_to_num(problem.differences(trial))
    assert data.shifts is not None
    shifts = data.shifts.copy()
    for rows in data.of_records:
        factor = growth(shifts[:, rows], data.position[rows], data.measured[rows])
        shifts[:, rows] -= factor[:, np.newaxis] * difference[rows]
    return replace(data, shifts=shifts)


def without_states(jacobian: np.ndarray, count: int, pieces: Pieces) -> np.ndarray:
    """Return derivatives by the shared unknowns less what start states can compensate.

    Args:
        jacobian: By shared unknowns, then by the start state of the row's piece, (row, dof, column).
        count: Number of shared unknowns.
        pieces: Which rows share a start state.

    Returns:
        Rows, (row dof, param).
    """
    found = []
    for first, stop in zip(pieces.first[:-1], pieces.first[1:], strict=True):
        rows = jacobian[first:stop].reshape(-1, jacobian.shape[2])
        shared, (q, _) = rows[:, :count], np.linalg.qr(rows[:, count:])
        found.append(shared - q @ (q.T @ shared))
    return np.concatenate(found)


def _projected(
    jacobian: np.ndarray, residuals: np.ndarray, shifts: np.ndarray, count: int, pieces: Pieces
) -> np.ndarray:
    """Return derivatives by unknowns and shifts, and the residuals, less what start states take up,
    (row dof, param + direction + 1)."""
    width = count + shifts.shape[2] + 1
    parts = (jacobian[..., :count], shifts, residuals[..., None], jacobian[..., count:])
    return without_states(np.concatenate(parts, axis=2), width, pieces)


def _span(columns: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of what the columns span, whatever their sizes, (row, direction)."""
    if not columns.shape[1]:
        return columns
    size = np.linalg.norm(columns, axis=0)
    left, singular, _ = np.linalg.svd(columns / np.where(size > 0.0, size, 1.0), full_matrices=False)
    return left[:, singular > SEEN * singular.max(initial=0.0)]
