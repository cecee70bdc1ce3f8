"""Joint positions in, their common period and Fourier series out: eq. (10), of one omega for all joints.

At a given period the series is one linear least squares a joint, so that the period alone is searched. The
paper leaves the numbers of harmonics M_i open; here Schwarz's criterion chooses them. A period that a record
does not hold twice is compared with the others by its first harmonic alone: a series of several fits one
period of anything, and only what comes again shows that it is a period.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from monodyn.arrays import usual_step
from monodyn.mechanism.drive import fourier_basis
from monodyn.paper.torque import fourier_coefficients

MOST_HARMONICS = 3
"""Harmonics of a joint's positions that are tried, at most."""
PER_WAVE = 4.0
"""Samples in the shortest wave, at least."""
LONGEST_PERIOD = 2.0
"""Longest period that is tried, in lengths of the record: half a wave at least is seen."""
SCAN_STEP = 0.1
"""Spacing of the scanned frequencies as a share of a turn of the last harmonic over the record."""


@dataclass(frozen=True, eq=False)
class PoseSeries:
    """The poses of a record as Fourier series of one period.

    Attributes:
        period: 2 pi / omega [s].
        periods: How many of them the record holds.
        coefficients: Mean, cos1, sin1, ... by joint, zero beyond its M_i, (2 M + 1, dof).
        harmonics: M_i of each joint.
        criterion: Schwarz's criterion; lower is better.
    """

    period: float
    periods: float
    coefficients: np.ndarray
    harmonics: tuple[int, ...]
    criterion: float


def pose_series(
    time: np.ndarray,
    position: np.ndarray,
    noise: np.ndarray,
    bounds: tuple[float, float] = (0.0, np.inf),
) -> PoseSeries:
    """Fit theta_i = p_i0 + sum_j (p_ij cos j omega t + q_ij sin j omega t) with one omega to all joints.

    Period and M_i have the least n log(mean square of what is left) + k log n over the n positions of all
    joints and the k coefficients, with M_i up to three, one where the record does not hold the period twice;
    M_i is then chosen anew, up to three, if the record holds the period once.

    Args:
        time: Times [s], increasing, (frame,).
        position: Joint positions [rad or m], NaN where not seen, (frame, dof).
        noise: Standard deviation of the positions [rad or m], below which nothing is explained, (dof,).
        bounds: Least and greatest period allowed [s]; equal where the period is known.

    Returns:
        The series of the best period.

    Source:
        Eq. (10) of "Estimating dynamics on-the-fly using monocular video", 2012; Schwarz, Estimating the
        dimension of a model, 1978.
    """
    fit = _Fit(np.asarray(time, dtype=float), np.asarray(position, dtype=float), np.asarray(noise))
    periods = fit.scanned(bounds)
    best = min((fit.at(period) for period in periods), key=lambda found: found.criterion)
    period = fit.refined(best, bounds)
    return fit.at(period, MOST_HARMONICS if period <= fit.span else 1)


def shown_periods(time: np.ndarray) -> tuple[float, float]:
    """Return the shortest and the longest period that a record can show [s].

    The shortest takes as many samples as a wave needs, or the record where that is shorter still; half of the
    longest one is seen.

    Args:
        time: Times [s], increasing, (frame,).
    """
    span, step = float(np.ptp(time)), usual_step(time)
    return min(PER_WAVE * step, span), LONGEST_PERIOD * span


class _Fit:
    """Least squares at one period after the other."""

    def __init__(self, time: np.ndarray, position: np.ndarray, noise: np.ndarray) -> None:
        self.time, self.position, self.noise = time, position, noise
        self.span = float(np.ptp(time))

    def scanned(self, bounds: tuple[float, float]) -> np.ndarray:
        """Return the periods to try [s]: evenly spaced in frequency, and the ends of the bounds."""
        high, low = (1.0 / period for period in shown_periods(self.time))
        frequencies = np.arange(low, high, self.step)
        inside = [1.0 / f for f in frequencies if bounds[0] < 1.0 / f < bounds[1]]
        # where the bounds leave nothing of what the record can show, they decide themselves
        ends = [end for end in bounds if 1.0 / high <= end <= 1.0 / low]
        if not inside and not ends:
            ends = [bounds[0] if bounds[0] > 1.0 / low else bounds[1]]
        return np.array([*inside, *ends])

    @property
    def step(self) -> float:
        """Spacing of the scanned frequencies [Hz]."""
        return SCAN_STEP / (MOST_HARMONICS * self.span)

    def at(self, period: float, most: int = 0) -> PoseSeries:
        """Fit the series of one period, up to ``most`` harmonics; 0: as many as its search allows."""
        # no more harmonics either than the samples can tell apart
        step = usual_step(self.time)
        most = most or (MOST_HARMONICS if 2.0 * period <= self.span else 1)
        most = min(most, int(period / (PER_WAVE * step)))
        columns, squares = self._columns(period, max(most, 1))
        # joints count alike, as in (14); what the noise explains is not charged: a series need not go below
        # it
        known = np.isfinite(self.position)
        count, floor = int(known.sum()), max(float(np.sum(known * self.noise**2)), 1e-300)

        def criterion(chosen: tuple[int, ...]) -> float:
            left = sum(own[m - 1] for own, m in zip(squares, chosen, strict=True))
            unknowns = sum(1 + 2 * m for m in chosen)
            return float(count * np.log((left + floor) / count) + unknowns * np.log(max(count, 2)))

        # joint by joint, the others at their best so far; twice, because what one leaves weighs the others
        best = (1,) * len(columns)
        for dof in [*range(len(best)), *range(len(best))]:
            others = [(*best[:dof], m, *best[dof + 1 :]) for m in range(1, len(squares[dof]) + 1)]
            best = min(others, key=criterion)
        table = np.zeros((1 + 2 * max(best), len(columns)))
        for dof, m in enumerate(best):
            table[: 1 + 2 * m, dof] = columns[dof][m - 1]
        return PoseSeries(period, self.span / period, table, best, criterion(best))

    def _columns(self, period: float, most: int) -> tuple[list[list[np.ndarray]], list[list[float]]]:
        """Fit each joint with 1 to ``most`` harmonics: coefficients and sums of squares of what is left."""
        columns: list[list[np.ndarray]] = []
        squares: list[list[float]] = []
        for values in self.position.T:
            found = [
                fourier_coefficients(self.time, values[:, None], period, m)[:, 0] for m in range(1, most + 1)
            ]
            left = [
                values - fourier_basis(self.time, period, m) @ own for m, own in enumerate(found, start=1)
            ]
            columns.append(found)
            squares.append([float(np.nansum(own**2)) for own in left])
        return columns, squares

    def refined(self, best: PoseSeries, bounds: tuple[float, float]) -> float:
        """Move the period between its neighbours in the scan to where the criterion is least."""
        from scipy.optimize import minimize_scalar

        frequency, count = 1.0 / best.period, max(best.harmonics)
        ends = np.array((frequency - self.step, frequency + self.step))
        ends = np.clip(ends, 1.0 / bounds[1], 1.0 / max(bounds[0], 1e-9))
        seen = best.period <= LONGEST_PERIOD * self.span
        if not (seen and ends[1] > ends[0]):
            return best.period
        # the same harmonics throughout: their number jumps where one more period is whole
        found: Any = minimize_scalar(
            lambda f: self.at(1.0 / f, count).criterion,
            bounds=ends,
            method="bounded",
            options={"xatol": 0.01 * self.step},
        )
        return 1.0 / float(found.x)
