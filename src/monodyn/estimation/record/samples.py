"""Records of joint positions in, plain arrays out: samples end to end, whitened, cut into pieces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from monodyn.arrays import check_unbroken, usual_step
from monodyn.errors import MechanismError, VideoError
from monodyn.estimation.record.shared import end_to_end
from monodyn.estimation.record.smooth import motion_size
from monodyn.mechanism import Mechanism
from monodyn.mechanism.logged import LoggedTorque, logged
from monodyn.mechanism.upright import by_roll
from monodyn.names import known, quoted
from monodyn.types import Poses, TorqueLog


@dataclass(frozen=True, eq=False)
class Data:
    """The samples of all records, end to end.

    A row is a time stamp; rows without a measurement keep the integration steps short across gaps.

    Attributes:
        times: Time stamps [s], (row,).
        position: Measured positions [rad or m], 0 where there is none, (row, dof).
        white: Whitening matrices W with W.T W the inverse covariance of what is measured, (row, dof, dof).
        measured: True where a joint was measured, (row, dof).
        first: First row of each record and one past the last, (record + 1,).
        source: Row of the record's table, -1 for a row put into a gap, (row,).
        slide: True for slides in the start scale, (record, dof).
        by_roll: What a roll of the camera adds to the measured positions to give those against gravity
            [rad/rad], (record, dof); zero for a record that is against gravity.
        shifts: What moves the positions of a record together, by one standard deviation of each direction
            [rad or m], (direction, row, dof); None where nothing does.
        torques: Known torques at the rows of each record; empty where none are known.
    """

    times: np.ndarray
    position: np.ndarray
    white: np.ndarray
    measured: np.ndarray
    first: np.ndarray
    source: np.ndarray
    slide: np.ndarray
    by_roll: np.ndarray
    shifts: np.ndarray | None = None
    torques: tuple[LoggedTorque, ...] = ()

    @property
    def samples(self) -> int:
        """Number of measured joint positions."""
        return int(self.measured.sum())

    @cached_property
    def std(self) -> np.ndarray:
        """Standard deviation of each measured position alone [rad or m], NaN in gaps, (row, dof)."""
        # what was not measured has information one and no correlation, which does not change
        # the rest of the inverse
        gaps = np.eye(self.measured.shape[1]) * ~self.measured[:, None, :]
        covariance = np.linalg.inv(np.swapaxes(self.white, 1, 2) @ self.white + gaps)
        diagonal = np.diagonal(covariance, axis1=1, axis2=2)
        return np.where(self.measured, np.sqrt(np.maximum(diagonal, 0.0)), np.nan)

    @property
    def records(self) -> int:
        """Number of records."""
        return len(self.first) - 1

    @property
    def of_records(self) -> list[slice]:
        """The rows of each record."""
        return [slice(first, stop) for first, stop in zip(self.first[:-1], self.first[1:], strict=True)]

    @cached_property
    def motion_size(self) -> np.ndarray:
        """Standard deviation of the measured positions of each joint about their mean, without the pull of
        gross errors [rad or m], (dof,)."""
        return np.array([motion_size(self.position[use, j]) for j, use in enumerate(self.measured.T)])

    @cached_property
    def sliding(self) -> np.ndarray:
        """Where a position is that of a slide, bool (row, dof)."""
        return self.by_row(self.slide)

    @cached_property
    def turning(self) -> np.ndarray:
        """What a roll of the camera adds to a position [rad/rad], (row, dof)."""
        return self.by_row(self.by_roll)

    def by_row(self, of_record: np.ndarray) -> np.ndarray:
        """Repeat what holds for a record for each of its rows.

        Args:
            of_record: One entry a record, (record, ...).

        Returns:
            One entry a row, (row, ...).
        """
        return np.repeat(of_record, np.diff(self.first), axis=0)

    def scaled(self, noise: np.ndarray, shift: np.ndarray | None = None) -> Data:
        """Return the data with every standard deviation multiplied by a factor of its joint.

        Args:
            noise: The factors, (dof,).
            shift: One standard deviation of an error that all joints of a row share, added to their
                covariance [rad or m], (row, dof); none without rows.
        """
        white = self.white / noise
        if shift is None or not len(shift):
            return replace(self, white=white)
        # (C + d d^T)^-1 = W^T (1 - u u^T / (1 + u^T u)) W with u = W d, and the bracket is the square of
        # 1 - g u u^T with g = (1 - 1 / sqrt(1 + u^T u)) / u^T u
        u = np.einsum("fij,fj->fi", white, shift)
        squared = np.einsum("fi,fi->f", u, u)
        gain = 1.0 / (1.0 + squared + np.sqrt(1.0 + squared))
        along = np.einsum("fi,fij->fj", u, white)
        return replace(self, white=white - gain[:, None, None] * u[:, :, None] * along[:, None, :])

    def part(self, rows: np.ndarray) -> Data:
        """Return the data of some rows alone; known torques, which are laid out along whole records, stay.

        Args:
            rows: The rows, rising, int (row,).
        """
        return replace(
            self,
            times=self.times[rows],
            position=self.position[rows],
            white=self.white[rows],
            measured=self.measured[rows],
            first=np.searchsorted(rows, self.first),
            source=self.source[rows],
            shifts=None if self.shifts is None else self.shifts[:, rows],
        )

    def of(self, records: np.ndarray) -> Data:
        """Return the data of some records alone, without known torques.

        Args:
            records: Which, rising, int (record,).
        """
        rows = np.concatenate([np.arange(*self.first[k : k + 2].tolist()) for k in records.tolist()])
        first = np.concatenate(([0], np.cumsum(np.diff(self.first)[records])))
        part = replace(self.part(rows), first=first)
        return replace(part, slide=self.slide[records], by_roll=self.by_roll[records], torques=())

    def without(self, rows: np.ndarray) -> Data:
        """Return the data with the measurements of some rows left out.

        Args:
            rows: True for rows to leave out, (row,).
        """
        keep = ~rows
        return replace(self, white=self.white * keep[:, None, None], measured=self.measured & keep[:, None])


def prepare(poses: Sequence[Poses], mechanism: Mechanism) -> Data:
    """Lay the records end to end.

    Args:
        poses: The records; each needs at least one measured sample.
        mechanism: Gives the order of the joints and their kinds.

    Returns:
        The samples from the first to the last measured row of each record.

    Raises:
        VideoError: There is no record, or one that cannot be used.
    """
    if not poses:
        raise VideoError("identify: expected at least one record of joint positions, got none.")
    parts = [_record(i, record, mechanism) for i, record in enumerate(poses)]
    first = np.concatenate(([0], np.cumsum([len(part[0]) for part in parts])))
    slide = np.array([mechanism.slides & (not record.metric) for record in poses])
    times, position, white, measured, source = (np.concatenate(part) for part in zip(*parts, strict=True))
    turning = by_roll(mechanism)
    turned = np.array([turning * (record.roll is not None) for record in poses])
    shifts = end_to_end([ordered(record, mechanism) for record in poses], first, source)
    stamps = np.split(times, first[1:-1])
    torques = known_torques(poses, mechanism, stamps)
    return Data(times, position, white, measured, first, source, slide, turned, shifts, torques)


def known_torques(
    poses: Sequence[Poses], mechanism: Mechanism, stamps: Sequence[np.ndarray]
) -> tuple[LoggedTorque, ...]:
    """Place the known torques of records at their rows.

    Args:
        poses: The records.
        mechanism: Gives the joints.
        stamps: Times of the rows of each record [s], each (row,).

    Returns:
        One a record, or none where no torques are known.

    Raises:
        MechanismError: A torque acts at a joint that the mechanism has not.
        VideoError: Torques are known of some records alone, or not of the whole of one.
    """
    names, found = tuple(joint.name for joint in mechanism.joints), []
    if all(record.torques is None for record in poses):
        return ()
    for number, (record, times) in enumerate(zip(poses, stamps, strict=True)):
        log = record.torques
        if log is None:
            raise VideoError(
                f"record {number}: expected known torques as other records have them, got none; give a log "
                "for each record, or for none."
            )
        for name in log.joints:
            if name not in names:
                joints = known("joints", names, name)
                raise MechanismError(f"torques: joint {name!r} is not in the mechanism; {joints}")
        check_covered(log, float(times[0]), float(times[-1]), f"record {number}")
        found.append(logged(log, names, times))
    return tuple(found)


def check_covered(log: TorqueLog, begin: float, end: float, what: str) -> None:
    """Refuse a log that does not reach over a record, but for a row's time at either end.

    Args:
        log: The log.
        begin: First time stamp of the record [s].
        end: Its last one [s].
        what: The record in a message.

    Raises:
        VideoError: The log begins too late or ends too early.
    """
    step = usual_step(log.time)
    if log.time[0] > begin + step or log.time[-1] < end - step:
        raise VideoError(
            f"torques: expected a log of all of {what}, {begin:.4g} to {end:.4g} s, got one from "
            f"{log.time[0]:.4g} to {log.time[-1]:.4g} s; both are on one clock: shift the times of the log, "
            "or fit what it covers (--fit-frames A:B)."
        )


def ordered(record: Poses, mechanism: Mechanism) -> Poses:
    """Bring the joints of a record into the mechanism's order, as a camera without roll would show them.

    Args:
        record: The record; its joints are those of the mechanism.
        mechanism: The mechanism.

    Returns:
        The same record with its columns in that order; one against gravity stays so.
    """
    names = tuple(joint.name for joint in mechanism.joints)
    if record.roll:
        slope = dict(zip(names, by_roll(mechanism).tolist(), strict=True))
        less = record.roll * np.array([slope[name] for name in record.joints])
        record = replace(record, position=record.position - less, roll=0.0)
    if names == record.joints:
        return record
    order = [record.joints.index(name) for name in names]
    covariance = record.covariance[:, order][:, :, order]
    joint_seen = None if record.joint_seen is None else record.joint_seen[:, order]
    position = record.position[:, order]
    shifts = None if record.shifts is None else record.shifts[:, :, order]
    return replace(
        record, joints=names, position=position, covariance=covariance, joint_seen=joint_seen, shifts=shifts
    )


def _record(number: int, poses: Poses, mechanism: Mechanism) -> tuple[np.ndarray, ...]:
    """Rows of one record: times, positions, whitening, measured, source."""
    names = tuple(joint.name for joint in mechanism.joints)
    for name in poses.joints:
        if name not in names:
            raise MechanismError(f"joint {name!r} is not in the mechanism; {known('joints', names, name)}")
    missing = [name for name in names if name not in poses.joints]
    if missing:
        raise MechanismError(
            f"record {number}: joint {missing[0]!r} of the mechanism was not measured; joints: "
            f"{quoted(poses.joints)}."
        )
    poses = ordered(poses, mechanism)
    position, covariance = poses.position, poses.covariance
    measured = poses.measured
    used = np.flatnonzero(measured.any(axis=1))
    if len(used) == 0:
        raise VideoError(
            f"record {number}: expected measured joint positions, got none in {len(poses)} rows."
        )
    rows = slice(used[0], used[-1] + 1)
    position, covariance, measured = position[rows], covariance[rows], measured[rows]
    # rows before the first and after the last measurement would only cost integration
    white = _whitening(number, covariance, measured)
    check_unbroken(f"record {number}", poses.time[rows])
    times, at = _filled(poses.time[rows])
    # rows that fill a gap stay zero: they weigh nothing and count as not measured
    placed = (
        _placed(values, len(times), at) for values in (np.where(measured, position, 0.0), white, measured)
    )
    source = np.full(len(times), -1)
    source[at] = np.arange(rows.start, rows.stop)
    return times, *placed, source


def _placed(values: np.ndarray, length: int, at: np.ndarray) -> np.ndarray:
    """Put ``values`` (row, ...) into rows ``at`` of a longer array of zeros."""
    longer = np.zeros((length, *values.shape[1:]), dtype=values.dtype)
    longer[at] = values
    return longer


def _filled(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Put stamps into gaps so that no step is over twice the usual one; also return rows of the old ones."""
    if len(times) < 2:
        return times, np.arange(len(times))
    # the small share keeps a step of exactly twice the usual one whole, which rounding would split
    parts = np.maximum(np.ceil(np.diff(times) / (2.0 * usual_step(times)) - 1e-9), 1.0).astype(int)
    at = np.concatenate(([0], np.cumsum(parts)))
    return np.interp(np.arange(at[-1] + 1), at, times), at


def _whitening(number: int, covariance: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Square roots of the inverse covariances of what is measured, (row, dof, dof)."""
    dofs = measured.shape[1]
    both = measured[:, :, None] & measured[:, None, :]
    # a joint that was not measured is a separate block with variance 1, so that the inverse of the rest is
    # that of the measured joints alone
    filled = np.where(both, covariance, np.eye(dofs))
    bad = ~np.isfinite(filled).all(axis=(1, 2)) | (np.diagonal(filled, axis1=1, axis2=2) <= 0).any(axis=1)
    if not bad.any():
        try:
            white = np.swapaxes(np.linalg.cholesky(np.linalg.inv(filled)), 1, 2)
            return white * both
        except np.linalg.LinAlgError:
            bad = np.linalg.eigvalsh(filled)[:, 0] <= 0
    raise VideoError(
        f"record {number}: the covariance of measured sample {int(np.argmax(bad))} is not positive definite; "
        "give each joint a standard deviation above zero."
    )


@dataclass(frozen=True, eq=False)
class Pieces:
    """Runs of consecutive rows, each with its own start state; together they are all rows in their order.

    Attributes:
        first: First row of each piece and one past the last, (piece + 1,).
        record: Record that each piece is part of, (piece,).
    """

    first: np.ndarray
    record: np.ndarray

    @property
    def whole(self) -> bool:
        """True when there is one piece a record."""
        return len(np.unique(self.record)) == len(self.record)


def cut(data: Data, samples: int) -> Pieces:
    """Cut every record into pieces that each start at a measured row.

    Args:
        data: The samples.
        samples: Measured rows in a piece, about.

    Returns:
        The pieces, in the order of the rows.
    """
    first, record = [], []
    for i, (start, stop) in enumerate(zip(data.first[:-1], data.first[1:], strict=True)):
        used = start + np.flatnonzero(data.measured[start:stop].any(axis=1))
        count = max(1, round(len(used) / samples))
        # a piece starts at a measured row, because its start state is taken from smooth motion there
        heads = [int(part[0]) for part in np.array_split(used, count)]
        first += [int(start), *heads[1:]]
        record += [i] * count
    return Pieces(np.array([*first, int(data.first[-1])]), np.array(record))


def spread(data: Data, pieces: Pieces, most: int) -> tuple[Data, Pieces]:
    """Leave out all but some of the pieces, evenly chosen, which stand for all.

    Args:
        data: The samples.
        pieces: How their records are cut.
        most: Number of pieces that stay, at most.

    Returns:
        The samples of the chosen pieces, of the same records, and how they are cut.
    """
    # known torques are laid out along whole records
    if data.torques or len(pieces.record) <= most:
        return data, pieces
    chosen = np.unique(np.linspace(0, len(pieces.record) - 1, most).astype(int))
    lengths = np.diff(pieces.first)[chosen]
    bounds = zip(pieces.first[chosen].tolist(), pieces.first[chosen + 1].tolist(), strict=True)
    rows = np.concatenate([np.arange(begin, end) for begin, end in bounds])
    part = data.part(rows)
    return part, Pieces(np.concatenate(([0], np.cumsum(lengths))), pieces.record[chosen])


def merge(pieces: Pieces) -> tuple[Pieces, np.ndarray]:
    """Join neighbouring pieces of a record two by two.

    Args:
        pieces: The pieces.

    Returns:
        The longer pieces, and which of the old ones start them, (piece,).
    """
    keep = []
    for record in np.unique(pieces.record):
        keep += np.flatnonzero(pieces.record == record)[::2].tolist()
    kept = np.array(keep)
    return Pieces(np.append(pieces.first[kept], pieces.first[-1]), pieces.record[kept]), kept
