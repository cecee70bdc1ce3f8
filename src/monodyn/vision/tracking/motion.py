"""The motion of each joint so far: where it may be next, and how surely.

Each joint has its own past, because something may hide one body while the others are seen. A prediction is a
parabola or a straight line through the last measurements. What it may add to the last one is bounded: a rate
taken across a gap may be wrong by whole turns, and would otherwise feed on itself.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.mechanism.turning import LONGER, TURN
from monodyn.uncounted import UNCOUNTED

MOST_AMPLIFIED = 16.0
"""Sum of the weights of a parabola above which it would mostly amplify noise."""
STRAIGHT_STEPS = 3.0
"""Steps over which the last rate is continued."""
TURNS_KNOWN_FRAMES = 8
"""Frames out of sight over which the last rates count for the number of turns."""
PREDICTED_FRAMES = 30
"""Frames out of sight after which the last poses predict nothing."""
FIRST_ERROR = 0.1
"""Error of the first predictions, as a share of the farthest extrapolation."""
LEAST_ERROR = 0.003
"""Least error of a prediction over one frame, as a share of the farthest extrapolation."""
ERROR_GAIN = 0.2
"""Share of a new error in the running one."""
KEPT = 3
"""Measurements of a joint that are kept: as many as a parabola takes."""


class Motion:
    """What is known of the motion before a frame.

    Args:
        farthest: Most that an extrapolation adds to the last position, (dof,): half a turn of a hinge.
        step: Usual time between two frames [s].
    """

    def __init__(self, farthest: np.ndarray, step: float) -> None:
        self._farthest, self._step = farthest, step
        dofs = len(farthest)
        # rows from the oldest to the latest; NaN where a joint has fewer
        self._time, self._position = np.full((KEPT, dofs), np.nan), np.full((KEPT, dofs), np.nan)
        self._error = FIRST_ERROR * farthest
        self._known = (np.nan, self._position)

    @property
    def begun(self) -> bool:
        """True once every joint was measured."""
        return bool(np.isfinite(self._time[-1]).all())

    def add(self, time: float, position: np.ndarray, joints: np.ndarray) -> None:
        """Take in what was measured in a frame.

        Args:
            time: Time stamp [s].
            position: Joint positions, (dof,).
            joints: True for the joints that were measured, (dof,).
        """
        # only errors over a single frame are comparable
        fresh = 1.5 * self._step
        _take(self._time, self._position, self._error, self._ahead(time)[0], (time, fresh), position, joints)
        self._known = (np.nan, self._known[1])

    def frames_since(self, time: float) -> np.ndarray:
        """Return how long ago each joint was measured, in frames, (dof,).

        Args:
            time: Time stamp [s].
        """
        return (time - self._time[-1]) / self._step

    def spread(self, time: float) -> np.ndarray:
        """Return the standard deviation of the expected positions, (dof,).

        Where the third derivative is unknown the error of a parabola grows with the product of the distances
        from its three points: by n (n + 1) (n + 2) / 6 over n frames.

        Args:
            time: Time stamp [s].
        """
        n = np.maximum(self.frames_since(time), 1.0)
        error = np.maximum(self._error, LEAST_ERROR * self._farthest)
        return np.minimum(error * n * (n + 1.0) * (n + 2.0) / 6.0, self._farthest)

    def expected(self, time: float) -> np.ndarray:
        """Return where each joint is expected: at its last position after a long time out of sight, (dof,).

        Args:
            time: Time stamp [s].
        """
        near = self.frames_since(time) <= TURNS_KNOWN_FRAMES
        return np.where(near, self._ahead(time)[0], self._position[-1])

    def turned(self, position: np.ndarray, time: float) -> np.ndarray:
        """Return hinge angles with the whole turns of the motion so far, (dof,).

        They make the smallest step from where a joint was seen in the frame before; after frames out of
        sight they are those of its last rate.

        Args:
            position: Angles but for whole turns [rad], (dof,).
            time: Time stamp [s].
        """
        since = self.frames_since(time)
        hidden = (since > LONGER) & (since <= TURNS_KNOWN_FRAMES)
        near = np.where(hidden, self._ahead(time)[1], self._position[-1])
        # before the first measurement there is no motion
        return position + TURN * np.nan_to_num(np.round((near - position) / TURN))

    def predictions(self, time: float) -> list[np.ndarray]:
        """Return where the mechanism may be: by constant acceleration, by constant rate, where it was.

        Args:
            time: Time stamp [s].

        Returns:
            Joint positions, each (dof,), the likeliest first; nothing where all joints have been out of sight
            for long.
        """
        if not self.begun or self.frames_since(time).min() > PREDICTED_FRAMES:
            return []
        return list(self._ahead(time))

    def _ahead(self, time: float) -> np.ndarray:
        """Return the predictions for a time, (3, dof), which are asked for more than once a frame."""
        if self._known[0] != time:
            self._known = time, _extrapolated(self._time, self._position, self._farthest, time)
        return self._known[1]


@njit(cache=True)
def _extrapolated(times: np.ndarray, positions: np.ndarray, farthest: np.ndarray, time: float) -> np.ndarray:
    """Return each joint by a parabola, by a line, and where it was, (3, dof); NaN before the first."""
    dofs = farthest.shape[0]
    ahead = np.empty((3, dofs))
    for j in range(dofs):
        a, b, c = times[0, j], times[1, j], times[2, j]
        last, by_line = positions[2, j], 0.0
        if not np.isnan(b):
            rate = (last - positions[1, j]) / (c - b)
            by_line = rate * min(time - c, STRAIGHT_STEPS * (c - b))
        by_curve = by_line
        if not np.isnan(a):
            # the parabola through three poses (Lagrange); the time stamps need not be equally spaced
            u = (time - b) * (time - c) / ((a - b) * (a - c))
            v = (time - a) * (time - c) / ((b - a) * (b - c))
            w = (time - a) * (time - b) / ((c - a) * (c - b))
            if abs(u) + abs(v) + abs(w) < MOST_AMPLIFIED:
                by_curve = u * positions[0, j] + v * positions[1, j] + w * last - last
        ahead[0, j] = last + min(max(by_curve, -farthest[j]), farthest[j])
        ahead[1, j] = last + min(max(by_line, -farthest[j]), farthest[j])
        ahead[2, j] = last
    return ahead


@njit(cache=True, **UNCOUNTED)
def _take(
    times: np.ndarray,
    positions: np.ndarray,
    error: np.ndarray,
    expected: np.ndarray,
    when: tuple[float, float],
    position: np.ndarray,
    joints: np.ndarray,
) -> None:
    """Put a measurement into the tables (row, dof), and its error into the running ones (dof,)."""
    time, fresh = when
    for j in range(error.shape[0]):
        if not joints[j]:
            continue
        if time - times[2, j] < fresh:
            off = min(abs(position[j] - expected[j]), 4.0 * error[j])
            error[j] += ERROR_GAIN * (off - error[j])
        for row in range(KEPT - 1):
            times[row, j], positions[row, j] = times[row + 1, j], positions[row + 1, j]
        times[KEPT - 1, j], positions[KEPT - 1, j] = time, position[j]
