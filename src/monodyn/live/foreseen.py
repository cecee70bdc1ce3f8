"""How far off the predictions of a stream were once their time had come."""

from __future__ import annotations

from collections import deque

import numpy as np

from monodyn.live.estimate import Estimate
from monodyn.types import Poses

ALMOST = 0.9
"""Share of how far ahead is predicted that a prediction has to be old for its error to count."""


class Foreseen:
    """Holds predictions until their time has come.

    Args:
        ahead: How far ahead the motion is predicted [s].
    """

    def __init__(self, ahead: float) -> None:
        self._ahead, self._made = ahead, deque[Estimate]()
        self._squares, self._count = np.zeros(0), np.zeros(0)

    def add(self, pose: Poses | None, estimate: Estimate | None) -> np.ndarray:
        """Compare a pose with what was predicted of it, and keep the newest prediction.

        Args:
            pose: The pose of a frame, one row; None where there is none.
            estimate: What was identified last, or None.

        Returns:
            Root mean square so far of the poses less their predictions, by joint [rad or m], (dof,); NaN
            before there was any.
        """
        if pose is None:
            return np.zeros(0)
        if not len(self._count):
            self._squares, self._count = np.zeros((2, pose.position.shape[1]))
        now, made = float(pose.time[0]), self._made
        while made and made[0].future.time[-1] < now:
            made.popleft()
        if made and now - made[0].future.time[0] > ALMOST * self._ahead:
            expected = made[0].expected(now)
            off = pose.position[0] - expected
            seen = pose.measured[0]
            self._squares += np.where(seen, off, 0.0) ** 2
            self._count += seen
        if estimate is not None and (not made or made[-1] is not estimate):
            made.append(estimate)
        with np.errstate(invalid="ignore"):
            return np.sqrt(self._squares / self._count)
