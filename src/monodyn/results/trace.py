"""A record next to its motion under the identified dynamics, and how far the two are apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from monodyn.arrays import usual_step
from monodyn.errors import VideoError
from monodyn.estimation.record.shared import moves_a_zero, without_shared
from monodyn.mechanism.upright import ROLL, ROLL_STD, by_roll, in_metres
from monodyn.types import Poses

if TYPE_CHECKING:
    from monodyn.estimation.fit import Fit
    from monodyn.estimation.parts import Common
    from monodyn.mechanism import Mechanism
    from monodyn.results.fill import States
    from monodyn.results.predict import Prediction
    from monodyn.results.torques import Torques
    from monodyn.vision.clip.video import Video

NEGLIGIBLE = 1.0
"""Standard deviations of all positions together below which errors that they share do not matter."""

LEAST_STD = 1e-9
"""Noise of a position that has none [rad or m]."""


@dataclass(frozen=True, eq=False)
class Trace:
    """One record next to its motion under the identified dynamics.

    Attributes:
        name: What the record is called, e.g. its file name.
        poses: Measured joint positions, slides in metres of the identified scale.
        states: Motion under the identified dynamics at ``poses.time``.
        rows: First fitted row of ``poses`` and the one after the last.
        future: Prediction from the end of the fitted rows, or None.
        future_frame: Frame numbers of the prediction, int (frame,).
        torques: Torques at ``poses.time`` other than friction, or None where there are none.
        turning: Hinges that nothing keeps from whole turns, by number.
        shared: Errors that the positions may share, as of ``shared_errors``, slides in metres,
            (direction, frame, dof); None for none.
    """

    name: str
    poses: Poses
    states: States
    rows: tuple[int, int]
    future: Prediction | None = None
    future_frame: np.ndarray | None = None
    torques: Torques | None = None
    turning: tuple[int, ...] = ()
    shared: np.ndarray | None = None

    @property
    def all_times(self) -> np.ndarray:
        """Time stamps of the record and of its prediction [s], (frame,)."""
        return self.poses.time if self.future is None else np.union1d(self.poses.time, self.future.time)

    def heldout(self) -> dict[str, float | None]:
        """Return the rms of the prediction against the measured rows after the fitted ones, by joint.

        Returns:
            Errors [rad or m], infinite where the prediction is no number; a joint without measured rows there
            has None.
        """
        return rms_of(self.poses.joints, self.ahead[1])

    @cached_property
    def ahead(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The measured rows after the fitted ones against their prediction.

        Time stamps [s], (frame,); measured less predicted position [rad or m], (frame, dof), NaN where not
        measured, infinite where what was measured has no finite prediction, of a hinge modulo a turn after a
        gap in which it may have made one; and the standard deviation of the prediction, (frame, dof).
        """
        after = self.poses[self.rows[1] :]
        if self.future is None or not len(self.future.time) or not len(after):
            return np.zeros(0), np.zeros((0, len(self.poses.joints))), np.zeros((0, len(self.poses.joints)))
        # the prediction may have other time stamps: only rows that both have are compared
        row = np.minimum(np.searchsorted(self.future.time, after.time - 1e-9), len(self.future.time) - 1)
        both = np.abs(self.future.time[row] - after.time) < 1e-9
        time, row, measured = after.time[both], row[both], after.measured[both]
        error = after.position[both] - self.future.position[row]
        error = np.where(measured, np.where(np.isfinite(error), error, np.inf), np.nan)
        before = self.poses[self.rows[0] : self.rows[1]]
        for dof in self.turning:
            seen = before.time[before.measured[:, dof]]
            last = float(seen[-1]) if len(seen) else -np.inf
            error[:, dof] -= _open_turns(time, error[:, dof], self.future.velocity[row, dof], last)
        return time, error, self.future.std[row]


def _open_turns(time: np.ndarray, error: np.ndarray, rate: np.ndarray, last: float) -> np.ndarray:
    """Return the whole turns in the errors of a hinge that its gaps leave open [rad], (frame,).

    Args:
        time: Time stamps [s], (frame,).
        error: Errors [rad], (frame,), NaN where not measured.
        rate: Predicted rates [rad/s], (frame,).
        last: When it was measured before [s].
    """
    turns, open_turns = np.zeros(len(time)), 0.0
    for i in np.flatnonzero(np.isfinite(error)):
        fastest = np.abs(rate[(time > last) & (time <= time[i])]).max()
        # from one measured row to the next less than half a turn is told apart
        if i and not np.isfinite(error[i - 1]) and fastest * (time[i] - last) > np.pi / 2.0:
            open_turns = 2.0 * np.pi * np.round(error[i] / (2.0 * np.pi))
        turns[i], last = open_turns, time[i]
    return turns


def rms_of(joints: Sequence[str], error: np.ndarray) -> dict[str, float | None]:
    """Return the rms of each joint's error over the rows that have one.

    Args:
        joints: Joint names.
        error: Errors [rad or m], (frame, dof), NaN where unknown.
    """
    found: dict[str, float | None] = {}
    for dof, joint in enumerate(joints):
        column = error[:, dof][~np.isnan(error[:, dof])]
        found[joint] = float(np.sqrt(np.mean(column**2))) if len(column) else None
    return found


def trace_of(
    fit: Fit, poses: Poses, future: Prediction | None = None, *, name: str = "", record: int = 0
) -> Trace:
    """Put a record next to its motion under the identified dynamics.

    Args:
        fit: The fit.
        poses: The whole record; the fitted rows are found by their times.
        future: Its prediction.
        name: What to call the record.
        record: Number of the record within the fit.

    Returns:
        The trace, slides in metres of the identified scale.
    """
    from monodyn.results.fill import fill
    from monodyn.results.torques import torques

    first, stop = fitted_rows(fit, poses, record)
    record_poses = metric(poses, fit.mechanism, fit.scale, fit.common_of(record))
    numbers = None
    if future is not None:
        numbers = frame_numbers(future.time, poses.time, poses.frame)
    acting = torques(fit, poses.time, record=record) if fit.torque != "friction" else None
    states = fill(fit, poses.time, record=record)
    turning = tuple(i for i, joint in enumerate(fit.mechanism.joints) if joint.turns)
    shared = shared_errors(poses, fit.mechanism)
    if shared is not None and not poses.metric:
        shared = shared * in_metres(fit.mechanism, fit.scale)
    return Trace(name, record_poses, states, (first, stop), future, numbers, acting, turning, shared)


def fitted_rows(fit: Fit, poses: Poses, record: int = 0) -> tuple[int, int]:
    """Return the first fitted row of a record and the one after the last.

    Args:
        fit: The fit.
        poses: The whole record, which may go on before and after them.
        record: Number of the record within the fit.

    Raises:
        VideoError: the record is not the one that was fitted.
    """
    fitted = fit.time[record]
    first = int(np.searchsorted(poses.time, fitted[0] - 1e-9))
    stop = first + len(fitted)
    if stop > len(poses) or not np.allclose(poses.time[first:stop], fitted, rtol=0.0, atol=1e-9):
        raise VideoError(
            "poses: expected the record that was fitted, got other time stamps; pass the same record."
        )
    return first, stop


def fitted_poses(fit: Fit, video: Video | None = None, *, record: int = 0) -> Poses:
    """Return the fitted frames of a record, from the residual that the fit keeps.

    Args:
        fit: The fit.
        video: The clip the record is from, which knows its frame numbers; without it they are those of a
            clip that starts at 0 s where the time stamps are those of one, else they count from 0.
        record: Number of the record within the fit.

    Returns:
        The record without its covariance, which the fit does not keep.
    """
    from monodyn.results.fill import fill

    time, residual = fit.time[record], fit.residual[record]
    position = fill(fit, time, record=record).position + residual
    joints = tuple(joint.name for joint in fit.mechanism.joints)
    count, dofs = residual.shape
    seen = np.asarray(np.isfinite(residual).any(axis=1))
    numbers = counted(time) if video is None else frame_numbers(time, video.times, np.arange(video.count))
    return Poses(joints, numbers, time, position, np.zeros((count, dofs, dofs)), seen, roll=None)


def counted(times: np.ndarray) -> np.ndarray:
    """Return the frame numbers of a record whose numbers are not known, int (frame,).

    Args:
        times: Time stamps [s], (frame,); where they are evenly spaced and 0 s is one of the places, frame 0
            is there.
    """
    count = len(times)
    rows = np.arange(count)
    if count < 2:
        return rows
    places = times * ((count - 1) / (times[-1] - times[0]))
    first = int(np.round(places[0]))
    # stamps in whole milliseconds are off by 1 part in 20 of a frame at 100 Hz
    even = first >= 0 and np.abs(places - first - rows).max() < 0.1
    return rows + first if even else rows


def frame_numbers(times: np.ndarray, known: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Return frame numbers of time stamps: those of a record, counted on after its end.

    Args:
        times: Time stamps [s], (frame,).
        known: Time stamps of the record [s], (frame,).
        numbers: Its frame numbers, int (frame,).

    Returns:
        Frame numbers, int (frame,).
    """
    step = usual_step(known) if len(known) > 1 else 1.0
    # within the record by interpolation, which also numbers missing frames; after it by the usual step
    count = np.interp(times, known, numbers)
    beyond = np.maximum(times - known[-1], 0.0) / step
    return np.round(count + beyond).astype(np.int64)


def metric(poses: Poses, mechanism: Mechanism, scale: float, common: Common | None = None) -> Poses:
    """Return a record with its slides in metres of the identified scale and its hinges against gravity.

    Args:
        poses: The record.
        mechanism: The identified mechanism, which knows the roll of the camera.
        scale: Metres per unit of the start scale.
        common: Errors that the positions have in common, which are taken off; None for none.
    """
    position, shifts = poses.position, poses.shifts
    factor = np.ones(position.shape[1])
    changed: dict[str, Any] = {}
    if poses.roll is not None:
        position = position + by_roll(mechanism) * (mechanism.values[ROLL] - poses.roll)
        changed["roll"] = None
    if common is not None and shifts is not None and not poses.cleared:
        off = np.tensordot(common.mean, shifts, axes=1)
        position, factor = without_shared(position, off, poses.measured)
        shifts = np.tensordot(common.root.T, shifts, axes=1)
        changed["cleared"] = True
    if not poses.metric:
        metres = in_metres(mechanism, scale)
        position, factor = position * metres, factor * metres
        changed["metric"] = True
    if not changed:
        return poses
    covariance = poses.covariance * np.outer(factor, factor)
    shifts = None if shifts is None else shifts * factor
    return replace(poses, position=position, covariance=covariance, shifts=shifts, **changed)


def shared_errors(poses: Poses, mechanism: Mechanism) -> np.ndarray | None:
    """Return the errors that the positions of a record share, of sizes, camera and its roll.

    No motion has told them yet. A table that is identified again has to state them: they do not average out.

    Args:
        poses: The record, as followed.
        mechanism: The mechanism, in which the roll of a camera is free unless it was given.

    Returns:
        By how much each position is off where sizes and camera are off by one standard deviation along one of
        several independent directions, (direction, frame, dof); None where nothing of the sort matters.
    """
    unclear = np.zeros((0, *poses.position.shape))
    if poses.shifts is not None and not poses.cleared:
        shifts, alone = (
            np.where(poses.measured, poses.shifts, 0.0),
            moves_a_zero(poses.shifts, poses.measured),
        )
        unclear = np.concatenate((shifts[alone], _largest(poses, shifts[~alone])))
    if poses.roll is not None and mechanism.parameter(ROLL).free:
        slope = dict(zip((j.name for j in mechanism.joints), by_roll(mechanism).tolist(), strict=True))
        turned = ROLL_STD * np.array([slope[name] for name in poses.joints])
        # by itself: that it is the same in all rows tells it from what else is unclear
        unclear = np.concatenate((np.where(poses.measured, turned, 0.0)[np.newaxis], unclear))
    return unclear if unclear.any() else None


def _largest(poses: Poses, shifts: np.ndarray) -> np.ndarray:
    """Return independent directions of what moves the positions, the largest, (direction, frame, dof)."""
    std = np.sqrt(np.diagonal(poses.covariance, axis1=1, axis2=2))
    weighed = shifts[:, poses.measured] / np.maximum(std[poses.measured], LEAST_STD)
    directions, size, _ = np.linalg.svd(weighed, full_matrices=False)
    # the largest first, until the rest of them is too little
    matters = np.sqrt(np.cumsum(size[::-1] ** 2)[::-1]) > NEGLIGIBLE
    return np.tensordot(directions.T[matters], shifts, axes=1)
