"""Torques over time at the joints, in addition to friction and springs: Fourier series, or values at knots.

Both are linear in a table: tau_i(t) = sum_c table[i, c] basis_c(t). The numba kernels at the end of the file
give the basis and its derivative by time at one instant, so that rollouts and their derivatives share one
formula. ``fourier_basis`` is the same series for whole arrays of times and for any derivative, for fits that
are linear in the coefficients and need no mechanism; a test compares the two.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numba import njit

from monodyn.arrays import Frozen, freeze, increasing
from monodyn.errors import MechanismError, SettingsError
from monodyn.mechanism.tree import Directions
from monodyn.uncounted import UNCOUNTED

NONE, FOURIER, KNOTS = range(3)

SIDE = 1e-7
"""Share of its own step by which a time is moved inward to decide on which side of a knot it is."""


@dataclass(frozen=True, eq=False)
class Drive(Frozen):
    """Torque over true time at every joint.

    * ``FOURIER``: tau = mean + sum_k cos_k cos(2 pi k t / T) + sin_k sin(2 pi k t / T); a row of the table is
      mean, cos_1, sin_1, cos_2, sin_2, ...
    * ``KNOTS``: a column of the table is the torques at one knot; linear in between, zero outside.
    * ``NONE``: no torque; the table has no columns.

    Attributes:
        mode: ``NONE``, ``FOURIER`` or ``KNOTS``.
        times: The period [s], (1,); or the knots [s], (knot,); or empty.
        table: Coefficients [N m or N], (dof, column), float or complex.
        lagging: Derivative of the table by a lag of known torques [N m/s or N/s], (dof, column); None for 0.

    Source: the 2012 paper, eq. (13), and its Case III, which has an unknown torque "at each time instant" and
        leaves open how it runs in between; here it is linear.
    """

    mode: int
    times: np.ndarray
    table: np.ndarray
    lagging: np.ndarray | None = None

    def __post_init__(self) -> None:
        # a complex table stays complex, because the kernels are differentiated by complex steps
        number = complex if np.iscomplexobj(self.table) else float
        freeze(self, (None,), "times", error=MechanismError)
        freeze(self, (None, None), "table", dtype=number, error=MechanismError)
        columns = self.table.shape[1]
        if self.lagging is not None:
            freeze(self, self.table.shape, "lagging", error=MechanismError)
        if self.mode == FOURIER:
            period = self.times.tolist()
            if len(period) != 1 or not 0 < period[0] < np.inf:
                raise MechanismError(f"Drive.times: expected one period above 0 s, got {period}.")
            # a cosine without its sine would fix the phase of a wave
            if columns % 2 == 0:
                raise MechanismError(
                    f"Drive.table: expected a mean and pairs of cosine and sine, got {columns} columns."
                )
        elif self.mode == KNOTS:
            increasing("Drive.times", self.times, error=MechanismError)
            # a line needs two knots; outside of all knots the torque is zero
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

    def basis(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the torque that a one in each column of the table adds, and its time derivative.

        Args:
            times: True times [s], (row,).

        Returns:
            Values and rates [1/s], each (row, column).
        """
        values, rates = np.zeros((2, len(times), self.table.shape[1]))
        if self.mode == NONE:
            return values, rates
        # A time that is a knot counts as inside: the first and the last knot have a torque.
        middle = float(np.mean(self.times)) if len(self.times) else 0.0
        for row, time in enumerate(times):
            basis_at(self.mode, self.times, time, middle, values[row], rates[row])
        return values, rates

    def derivatives(self, directions: Directions, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Differentiate the torque by parameters.

        Args:
            directions: How each parameter changes the drive.
            times: True times [s], (row,).

        Returns:
            The torque [N m or N], (row, dof), and its derivatives, (row, dof, param).
        """
        shapes, rates = self.basis(times)
        torque, rate = shapes @ self.table.T, rates @ self.table.T
        slopes = torque[:, :, None] * directions.load
        slopes = slopes + (times[:, None] * rate)[:, :, None] * directions.clock
        if self.lagging is not None:
            slopes = slopes + (shapes @ self.lagging.T)[:, :, None] * directions.lag
        for i, c in zip(*np.nonzero(directions.entry >= 0), strict=True):
            slopes[:, i, directions.entry[i, c]] += shapes[:, c]
        return torque, slopes


@cache
def UNDRIVEN(dofs: int) -> Drive:
    """Return the drive of no torque, one for all mechanisms with so many joints.

    Args:
        dofs: Number of joints.
    """
    return Drive(NONE, np.zeros(0), np.zeros((dofs, 0)))


def fourier_basis(time: np.ndarray, period: float, terms: int, *, derivative: int = 0) -> np.ndarray:
    """Return 1, cos(w t), sin(w t), cos(2 w t), ... with w = 2 pi / period, or a derivative by time.

    The paper prints j w in front of the sums of eq. (11); it belongs to each term.

    Args:
        time: Times [s], (frame,).
        period: The period [s].
        terms: Harmonics M.
        derivative: 0 for the series itself, 1 for its rate, 2 for its acceleration.

    Returns:
        Columns mean, cos1, sin1, cos2, ..., (frame, 2 M + 1).

    Raises:
        SettingsError: The period is not above 0 or there are no terms.

    Source:
        Eq. (10), (11) and (13) of "Estimating dynamics on-the-fly using monocular video", 2012.
    """
    if not (np.isfinite(period) and period > 0):
        raise SettingsError(f"period: expected a time above 0 s, got {period:g}.")
    if terms < 1:
        raise SettingsError(f"terms: expected 1 harmonic or more, got {terms}.")
    omega = 2.0 * np.pi * np.arange(1, terms + 1) / period
    phase = np.asarray(time, dtype=float)[:, None] * omega + 0.5 * np.pi * derivative
    # each derivative turns a sine or cosine by a quarter and multiplies it by its frequency
    pairs = np.stack((np.cos(phase), np.sin(phase)), axis=2) * (omega**derivative)[:, None]
    mean = np.full((len(phase), 1), float(derivative == 0))
    return np.concatenate((mean, pairs.reshape(len(phase), -1)), axis=1)


@njit(cache=True, error_model="numpy", **UNCOUNTED)
def basis_at(mode, stamps, time, side, value, rate):  # pragma: no cover - compiled
    """Write basis and time derivative by column at ``time``; return the range of columns that are not zero.

    ``value`` and ``rate`` are (column,); columns outside of the range are left as they are. At a knot the
    limit from the time ``side`` counts, so that a step that ends at a knot and one that begins there each see
    a smooth torque.
    """
    if mode == FOURIER:
        turn = 2.0 * np.pi / stamps[0]
        c, s = np.cos(turn * time), np.sin(turn * time)
        value[0], rate[0] = 1.0, 0.0
        ck, sk = c, s
        # (ck, sk) are cosine and sine of k times the angle, by the addition theorem: one pair of library
        # calls whatever the number of harmonics; rounding grows only with k.
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
        # Two hats overlap between knots j and j + 1; all others are zero there.
        j = min(np.searchsorted(stamps, within, side="right") - 1, last - 1)
        width = stamps[j + 1] - stamps[j]
        part = min(max((time - stamps[j]) / width, 0.0), 1.0)
        value[j], rate[j] = 1.0 - part, -1.0 / width
        value[j + 1], rate[j + 1] = part, 1.0 / width
        return j, j + 2
    return 0, 0


@njit(cache=True, error_model="numpy", **UNCOUNTED)
def torque(mode, stamps, table, time, side, value, rate, tau, slope):  # pragma: no cover - compiled
    """Write torques ``tau`` and their time derivatives ``slope``, (dof,); return ``basis_at``'s range."""
    low, high = basis_at(mode, stamps, time, side, value, rate)
    for i in range(table.shape[0]):
        tau[i] = 0.0
        slope[i] = 0.0
        for c in range(low, high):
            tau[i] += table[i, c] * value[c]
            slope[i] += table[i, c] * rate[c]
    return low, high


@njit(cache=True, error_model="numpy")
def _torques(mode, stamps, table, times):  # pragma: no cover - compiled
    """Return the torques at every time, (frame, dof)."""
    value, rate = np.empty(table.shape[1]), np.empty(table.shape[1])
    tau = np.empty((times.size, table.shape[0]), table.dtype)
    slope = np.empty(table.shape[0], table.dtype)
    middle = np.mean(stamps)
    for f in range(times.size):
        torque(mode, stamps, table, times[f], middle, value, rate, tau[f], slope)
    return tau
