"""Torques that a program applies while it watches: held from one frame to the next."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence

import numpy as np

from monodyn.errors import SettingsError
from monodyn.names import known
from monodyn.typed import is_a, kind_of
from monodyn.types import TorqueLog

PLACES = (0.001, 0.333, 0.667, 0.999)
"""Where between two frames a torque is stated: a log is linear between its rows, and this one has steps."""


class Applied:
    """Takes the torque that acts from each frame on.

    Args:
        joints: Names of the mechanism's joints.
    """

    def __init__(self, joints: Sequence[str]) -> None:
        self._joints = tuple(joints)
        self._times: list[float] = []
        self._torques: list[np.ndarray] = []

    def add(self, time: float, torques: Mapping[str, float] | None) -> None:
        """Take what acts from a frame on.

        Args:
            time: Time of the frame [s].
            torques: Torque by joint [N m; a slide's N]; none acts at the others. None stands for none at all.

        Raises:
            SettingsError: they are no numbers by joint, a name is no joint, or a torque is not finite.
        """
        if not is_a(torques, Mapping[str, float] | None):
            raise SettingsError(
                f"apply: expected what it returns to be torques by joint or None, got {kind_of(torques)}; "
                "give e.g. {'joint1': 0.5}."
            )
        row = np.zeros(len(self._joints))
        for name, value in (torques or {}).items():
            if name not in self._joints:
                raise SettingsError(
                    f"apply: joint '{name}' is not in the mechanism; {known('joints', self._joints, name)}"
                )
            if not np.isfinite(value):
                raise SettingsError(f"apply: expected a finite torque for {name}, got {value}.")
            row[self._joints.index(name)] = float(value)
        self._times.append(time)
        self._torques.append(row)

    def forget(self, before: float) -> None:
        """Forget what acted before a time.

        Args:
            before: The time [s].
        """
        first = max(bisect_right(self._times, before) - 1, 0)
        del self._times[:first], self._torques[:first]

    def between(self, begin: float, end: float) -> TorqueLog | None:
        """Return what acted over a stretch; None where nothing did.

        Args:
            begin: Begin of the stretch [s].
            end: Its end [s].
        """
        first = max(bisect_right(self._times, begin) - 1, 0)
        last = bisect_left(self._times, end)
        torques = np.array(self._torques[first:last]).reshape(-1, len(self._joints))
        if not torques.any():
            return None
        times = np.array([*self._times[first:last], max(end, self._times[last - 1] + 1e-6)])
        share = np.array(PLACES)
        rows = (times[:-1, None] + np.diff(times)[:, None] * share).ravel()
        values = np.repeat(torques, len(PLACES), axis=0)
        if rows[0] > begin:
            # before the first frame that is known of nothing acted
            rows, values = np.append(begin, rows), np.concatenate((0.0 * values[:1], values))
        return TorqueLog(self._joints, np.append(rows, times[-1]), np.concatenate((values, values[-1:])))
