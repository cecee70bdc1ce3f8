"""The poses of a stream: the last ones with all that is known of them, all of them as a few numbers each."""

from __future__ import annotations

from array import array
from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np

from monodyn.types import Poses


class Record:
    """Takes poses as they come.

    Args:
        seconds: How long rows are kept with what moves all positions together.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        # parts with the rows that came together
        self._recent: deque[Poses] = deque()
        self._numbers = array("d")
        self._kind: Poses | None = None

    def add(self, poses: Poses) -> None:
        """Take the next rows.

        Args:
            poses: Rows after all before, at least one.
        """
        self._kind = poses
        self._recent.append(poses)
        columns = (poses.frame[:, np.newaxis], poses.time[:, np.newaxis], poses.measured, poses.position)
        table = np.hstack([*columns, poses.covariance.reshape(len(poses), -1)])
        self._numbers.frombytes(table.astype(np.float64).tobytes())
        while poses.time[-1] - self._recent[0].time[-1] > self._seconds:
            self._recent.popleft()

    @property
    def last(self) -> Poses | None:
        """The last row; None where there is none."""
        return self._recent[-1][-1:] if self._recent else None

    def since(self, time: float, *, after: bool = False) -> Poses | None:
        """Return the rows from a time on; None where there are none.

        Args:
            time: The time [s].
            after: Leave out a row of just that time.
        """
        parts = []
        for part in self._recent:
            first = int(np.searchsorted(part.time, time, side="right" if after else "left"))
            if first < len(part):
                parts.append(part[first:] if first else part)
        return joined(parts) if parts else None

    @property
    def whole(self) -> Poses | None:
        """All rows, without what moves all positions together; None where there are none."""
        if self._kind is None:
            return None
        joints = self._kind.joints
        dofs = len(joints)
        table = np.frombuffer(self._numbers, dtype=np.float64).reshape(-1, 2 + 2 * dofs + dofs * dofs)
        frame, time, seen, position, covariance = np.split(table, [1, 2, 2 + dofs, 2 + 2 * dofs], axis=1)
        seen = seen > 0.0
        return Poses(
            joints, frame[:, 0].astype(np.int64), time[:, 0], position, covariance.reshape(-1, dofs, dofs),
            np.asarray(seen.all(axis=1)), self._kind.metric, seen, self._kind.roll,
        )  # fmt: skip


def joined(rows: Iterable[Poses]) -> Poses:
    """Return rows as one record.

    Args:
        rows: Records of one scene, one after the other.
    """
    parts: Sequence[Poses] = list(rows)
    first = parts[0]
    if len(parts) == 1:
        return first
    shifts = [part.shifts for part in parts if part.shifts is not None]
    return Poses(
        first.joints,
        np.concatenate([part.frame for part in parts]),
        np.concatenate([part.time for part in parts]),
        np.concatenate([part.position for part in parts]),
        np.concatenate([part.covariance for part in parts]),
        np.concatenate([part.measured.all(axis=1) for part in parts]),
        first.metric,
        np.concatenate([part.measured for part in parts]),
        first.roll,
        np.concatenate(shifts, axis=1) if len(shifts) == len(parts) else None,
    )
