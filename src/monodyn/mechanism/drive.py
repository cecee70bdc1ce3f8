"""Torques over time at the joints, besides friction and springs: a Fourier series, or values at knots.

Both are linear in a table: tau_i(t) = sum_c table[i, c] basis_c(t). The kernels below give the basis and its
derivative by time, so that rollouts and their derivatives share one formula.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from monodyn.arrays import frozen, increasing
from monodyn.errors import MechanismError

NONE, FOURIER, KNOTS = range(3)

SIDE = 1e-7
"""Share of the way into its own step by which a time is moved to tell on which side of a knot it is."""


@dataclass(frozen=True, eq=False)
class Drive:
    """Torque over true time at every joint.

    * ``FOURIER``: tau = mean + sum_k cos_k cos(2 pi k t / T) + sin_k sin(2 pi k t / T); a row of the table is
      mean, cos_1, sin_1, cos_2, sin_2, ...
    * ``KNOTS``: a column of the table is the torques at one knot; linear in between, zero outside.
    * ``NONE``: no torque; the table has no columns.

    Attributes:
        mode: ``NONE``, ``FOURIER`` or ``KNOTS``.
        times: The period [s], (1,); or the knots [s], (knot,); or empty.
        table: Coefficients [N m or N], (dof, column), float or complex.

    Source: the 2012 paper, eq. (13), and its Case III, which has an unknown torque "at each time instant" and
        does not say how it runs in between; here it is linear.
    """

    mode: int
    times: np.ndarray
    table: np.ndarray

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        number = complex if np.iscomplexobj(self.table) else float
        set_(self, "times", frozen("Drive.times", self.times, (None,), error=MechanismError))
        shape = (None, None)
        set_(self, "table", frozen("Drive.table", self.table, shape, dtype=number, error=MechanismError))
        columns = self.table.shape[1]
        if self.mode == FOURIER:
            period = self.times.tolist()
            if len(period) != 1 or not 0 < period[0] < np.inf:
                raise MechanismError(f"Drive.times: expected one period above 0 s, got {period}.")
            if columns % 2 == 0:
                raise MechanismError(
                    f"Drive.table: expected a mean and pairs of cosine and sine, got {columns} columns."
                )
        elif self.mode == KNOTS:
            increasing("Drive.times", self.times, error=MechanismError)
            if len(self.times) < 2 or columns != len(self.times):
                raise MechanismError(
                    f"Drive.table: expected a column for each of at least 2 knots, got {columns} columns and "
                    f"{len(self.times)} knots."
                )
        elif self.mode != NONE or columns or len(self.times):
            raise MechanismError(
                f"Drive.mode: expected NONE (0, without times and columns), FOURIER (1) or KNOTS (2), got "
                f"{self.mode}."
            )

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return the torques at true times.

        Args:
            times: Times [s], (frame,).

        Returns:
            Torques [N m or N], (frame, dof).

        Example:
            >>> import numpy as np
            >>> from monodyn.mechanism.drive import KNOTS, Drive
            >>> Drive(KNOTS, np.array([0.0, 1.0]), np.array([[0.0, 2.0]])).at(np.array([0.25, 3.0])).tolist()
            [[0.5], [0.0]]
        """
        return _torques(self.mode, self.times, self.table, np.asarray(times, dtype=np.float64))


def UNDRIVEN(dofs: int) -> Drive:
    """Return the drive of no torque.

    Args:
        dofs: Number of joints.
    """
    return Drive(NONE, np.zeros(0), np.zeros((dofs, 0)))


@njit(cache=True, error_model="numpy")
def basis(mode, stamps, time, side, value, rate):  # pragma: no cover - compiled
    """Write basis and time derivative by column at ``time``; return the range of columns that are not zero.

    Columns outside of the range are left as they are. At a knot the limit from the time ``side`` counts, so
    that a step which ends at a knot and one which begins there each see a smooth torque.
    """
    if mode == FOURIER:
        turn = 2.0 * np.pi / stamps[0]
        c, s = np.cos(turn * time), np.sin(turn * time)
        value[0], rate[0] = 1.0, 0.0
        ck, sk = c, s
        for k in range(1, (value.size + 1) // 2):
            value[2 * k - 1], rate[2 * k - 1] = ck, -k * turn * sk
            value[2 * k], rate[2 * k] = sk, k * turn * ck
            ck, sk = ck * c - sk * s, sk * c + ck * s
        return 0, value.size
    if mode == KNOTS:
        last = stamps.size - 1
        within = time + SIDE * (side - time)
        if within < stamps[0] or within > stamps[last]:
            return 0, 0
        j = min(np.searchsorted(stamps, within, side="right") - 1, last - 1)
        width = stamps[j + 1] - stamps[j]
        part = min(max((time - stamps[j]) / width, 0.0), 1.0)
        value[j], rate[j] = 1.0 - part, -1.0 / width
        value[j + 1], rate[j + 1] = part, 1.0 / width
        return j, j + 2
    return 0, 0


@njit(cache=True, error_model="numpy")
def torque(mode, stamps, table, time, side, value, rate, tau, slope):  # pragma: no cover - compiled
    """Write torques and their derivative by time; return the range of columns as ``basis`` does."""
    low, high = basis(mode, stamps, time, side, value, rate)
    for i in range(table.shape[0]):
        tau[i] = 0.0
        slope[i] = 0.0
        for c in range(low, high):
            tau[i] += table[i, c] * value[c]
            slope[i] += table[i, c] * rate[c]
    return low, high


@njit(cache=True, error_model="numpy")
def _torques(mode, stamps, table, times):  # pragma: no cover - compiled
    value, rate = np.empty(table.shape[1]), np.empty(table.shape[1])
    tau = np.empty((times.size, table.shape[0]), table.dtype)
    slope = np.empty(table.shape[0], table.dtype)
    middle = np.mean(stamps)
    for f in range(times.size):
        torque(mode, stamps, table, times[f], middle, value, rate, tau[f], slope)
    return tau
