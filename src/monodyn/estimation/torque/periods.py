"""Candidates for the period of a torque, from accelerations, before anything is integrated.

Along smooth motion the accelerations are linear in the torque, and nearly so in the other unknowns. So for
every period and number of harmonics the best series is one linear least squares, in which the other unknowns
may move as well; the remaining sum of squares ranks the periods. What smoothing misses of a lively motion may
be larger than what the torque explains: the ranks say where to look, and decide nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from monodyn.estimation.record.samples import Data
from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.settings import USUAL_TERMS
from monodyn.estimation.shooting.accelerations import (
    SmoothMotion,
    mismatch_rows,
    smooth_motion,
    torque_response,
)
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.starts import least_driven
from monodyn.mechanism import Mechanism
from monodyn.mechanism.drive import fourier_basis

FEWEST_PERIODS = 1.25
"""A record this many periods long shows that something repeats."""
FEWEST_ROWS = 8
"""Rows with all joints measured, at least; with fewer, accelerations give no information about a period."""
PER_HARMONIC = 2.5
"""Samples in the shortest harmonic."""
CORRELATED = 4.0
"""Accelerations of smoothed motion share their neighbours' samples: this many count as one."""
SCANNED_TERMS = tuple(range(1, USUAL_TERMS + 1))
"""Harmonics that the scan tries when their number is open."""
LONGEST_SPAN = 4.0
"""Periods up to this many times the record are compared with the best one that it shows more than once."""
APART = 0.04
"""Periods nearer to each other than this share are one."""
MOST_CANDIDATES = 8
"""Periods that are fitted. In random records the true one was among the first five."""
FEWEST_TERMS = 2
"""Harmonics of a candidate at least: smoothing hides the second one, and a period twice as long would pass
for the true one."""


@dataclass(frozen=True, eq=False)
class PeriodGuess:
    """A period that explains the accelerations.

    Attributes:
        period: Period [s].
        terms: Number of harmonics.
        criterion: Schwarz's criterion: n log(left over) + unknowns log n; lower is better.
        table: Coefficients, (dof, 1 + 2 terms).
        change: Change of the other unknowns' coordinates, (param,).
    """

    period: float
    terms: int
    criterion: float
    table: np.ndarray
    change: np.ndarray


@dataclass(frozen=True, eq=False)
class PeriodSearch:
    """A search of the period: the problem without a periodic torque, and how its accelerations fall short.

    Attributes:
        problem: The problem.
        x: Coordinates at which its accelerations are nearest, (param,).
        motion: Smooth motion.
        bounds: Least and greatest period [s] that the user allows; equal where it is known.
    """

    problem: Problem
    x: np.ndarray
    motion: SmoothMotion
    bounds: tuple[float, float]

    @classmethod
    def of(cls, mechanism: Mechanism, data: Data, smoothed: tuple[Smoothed, ...]) -> PeriodSearch:
        """Return the search for a mechanism, whose ``torque.period`` bounds the periods that are allowed.

        Args:
            mechanism: The start.
            data: The measurements.
            smoothed: Smooth motion of each record.

        Returns:
            The search, at the common scale that requires the least torque.
        """
        clock = mechanism.with_torque("fourier", terms=1, period=1.0).parameter("torque.period")
        problem = posed(mechanism.with_torque("friction"), data)
        motion = smooth_motion(problem, smoothed)
        bounds = (clock.lower, clock.upper) if clock.free else (clock.value, clock.value)
        x = least_driven(problem, motion) if len(motion.time) else problem.unknowns.x0
        return cls(problem, x, motion, bounds)

    def guesses(self, terms: int) -> list[PeriodGuess]:
        """Return the periods at which a torque explains the accelerations better than at those around them.

        Args:
            terms: Number of harmonics; 0 lets the criterion choose.

        Returns:
            Up to ``MOST_CANDIDATES`` guesses, the best first; none with under 8 rows that have all joints
            measured. A known period is the only one.

        Source:
            Golub and Pereyra, The differentiation of pseudo-inverses and nonlinear least squares problems
            whose variables separate, 1973; Schwarz, Estimating the dimension of a model, 1978.
        """
        if len(self.motion.time) < FEWEST_ROWS:
            return []
        # many harmonics make any long period fit: an open number is tried from few
        counts = SCANNED_TERMS if terms == 0 else (terms,)
        if self.bounds[0] == self.bounds[1]:
            every = [self._scan.fit(self.bounds[0], count) for count in counts]
            return sorted(every, key=lambda guess: guess.criterion)[:1]
        periods, values = self._scan.criteria(counts, self.bounds)
        least = values.min(axis=0, initial=np.inf)
        # every local minimum of the scan is a candidate, also one at the end of the bounds
        ends = np.concatenate(([np.inf], least, [np.inf]))
        low = np.flatnonzero((least <= ends[:-2]) & (least < ends[2:]))
        kept: list[PeriodGuess] = []
        for i in low[np.argsort(least[low])]:
            if all(abs(np.log(periods[i] / other.period)) > APART for other in kept):
                allowed = [count for count, value in zip(counts, values[:, i], strict=True) if value < np.inf]
                count = max(counts[int(np.argmin(values[:, i]))], min(FEWEST_TERMS, max(allowed)))
                kept.append(self._scan.fit(float(periods[i]), count))
        return kept[:MOST_CANDIDATES]

    def simpler(self, terms: int, period: float, fixed: int) -> list[PeriodGuess]:
        """Return series with fewer harmonics, or of a part of a period, that may be all there is to a series.

        Args:
            terms: Number of harmonics.
            period: Period [s].
            fixed: Number of harmonics that is given; 0 for none.
        """
        parts = range(1, terms + 1) if self.bounds[0] < self.bounds[1] else (1,)
        every = [(part, count) for part in parts for count in range(1, terms // part + 1)]
        every = [(part, fixed) for part in parts] if fixed else every
        return [self._scan.fit(period / part, count) for part, count in every if (part, count) != (1, terms)]

    def longer(self, terms: int, period: float) -> list[PeriodGuess]:
        """Return the best of the periods that the record does not show, none where none is allowed.

        A multiple of the given period, of which that one is a harmonic, is no other period.

        Args:
            terms: Number of harmonics.
            period: Period [s] that it is compared with.
        """
        longest = self._scan.span / FEWEST_PERIODS
        longer = longest * np.geomspace(1.0, LONGEST_SPAN * FEWEST_PERIODS, 40)[1:]
        longer = longer[(self.bounds[0] < longer) & (longer < self.bounds[1])]
        order = np.arange(1, terms + 1)[:, None]
        other = longer[(np.abs(order / longer - 1.0 / period) > 0.5 / self._scan.span).all(axis=0)]
        every = [self._scan.fit(float(one), terms) for one in other]
        return sorted(every, key=lambda guess: guess.criterion)[:1]

    def shown(self, period: float) -> bool:
        """Return whether the record is long enough to show that something repeats.

        Args:
            period: Period [s].
        """
        return period <= self._scan.span / FEWEST_PERIODS or self.bounds[0] == self.bounds[1]

    @cached_property
    def _scan(self) -> _Scan:
        return _Scan(self.problem, self.x, self.motion)

    def start(self, guess: PeriodGuess, driven: Problem) -> np.ndarray:
        """Bring a guess into the coordinates of a problem with a periodic torque.

        Args:
            guess: The guess.
            driven: The problem; harmonics that the guess has not start at zero.

        Returns:
            Coordinates, (param,).
        """
        plain = self.problem.unknowns
        change = np.clip(guess.change, -plain.reach, plain.reach)
        start = driven.unknowns.carried(np.clip(self.x + change, plain.lower, plain.upper), plain)
        entries = driven.mechanism.torques.entries_of(driven.unknowns.names)[:, : guess.table.shape[1]]
        start[entries[entries >= 0]] = guess.table[entries >= 0]
        return start


class _Scan:
    """Linear least squares at one period after the other, the other unknowns projected out."""

    def __init__(self, problem: Problem, x: np.ndarray, motion: SmoothMotion) -> None:
        rows, jacobian = mismatch_rows(problem, x, motion)
        response = torque_response(problem, x, motion) * motion.weight[:, :, None]
        self.frames, self.dofs, _ = response.shape
        self.clock = motion.time * problem.stretch(x)
        steps = np.diff(np.unique(self.clock))
        self.pace = float(np.median(steps))
        self.span = float(np.sum(steps))
        self.response, self.count, self.prior = response, len(x), len(rows) - motion.weight.size
        # what the other unknowns can explain is taken out of both rows and columns (variable projection), so
        # that the series is fitted as if they had moved to their best for every period
        q, self.triangle = np.linalg.qr(jacobian)
        self.q, self.rows = q, rows
        self.left = rows - q @ (q.T @ rows)
        self.samples = max(motion.weight.size / CORRELATED, 4.0)

    def criteria(self, counts: Sequence[int], bounds: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """Return the periods that the record can show [s], (period,), and their criteria by number of
        harmonics, (count, period)."""
        periods = self.periods(counts, bounds)
        values = np.full((len(counts), len(periods)), np.inf)
        for i, period in enumerate(periods):
            # the shortest harmonic has samples enough between its zeros
            most = max((c for c in counts if period >= c * PER_HARMONIC * self.pace), default=0)
            if most:
                left = self._left_over(float(period), most)
                for k, count in enumerate(counts):
                    if count <= most:
                        columns = self.dofs * (2 * count + 1)
                        values[k, i] = self._criterion(float(left[columns - 1]), columns + 1)
        return periods, values

    def _left_over(self, period: float, terms: int) -> np.ndarray:
        """Return the sums of squares that are left with the first column of a series, the first two, ..."""
        columns = self._columns(period, terms)
        seen = self.q.T @ columns
        # orthogonalized one after the other each column takes its own share of the sum of squares
        gram = columns.T @ columns - seen.T @ seen
        gram[np.diag_indices_from(gram)] *= 1.0 + 1e-9
        shares = np.linalg.solve(np.linalg.cholesky(gram), columns.T @ self.left)
        return np.maximum(float(self.left @ self.left) - np.cumsum(shares**2), 0.0)

    def periods(self, counts: Sequence[int], bounds: tuple[float, float]) -> np.ndarray:
        """Return the periods that the record can show [s], evenly spaced in frequency, ends of bounds too."""
        # the longest period is one that the record shows more than once, the shortest one whose last harmonic
        # still has samples enough between its zeros; from one to the next that turns by a tenth at the end
        low, scanned, top = FEWEST_PERIODS / self.span, [], 0.0
        for count in sorted(counts, reverse=True):
            high = max(1.0 / (count * PER_HARMONIC * self.pace), low)
            scanned.append(np.arange(max(low, top), high, 0.1 / self.span / count))
            top = high
        periods = 1.0 / np.concatenate(scanned)
        ends = [end for end in bounds if 1.0 / top <= end <= 1.0 / low]
        inside = periods[(bounds[0] < periods) & (periods < bounds[1])]
        return np.sort(np.concatenate((inside, ends)))[::-1]

    def fit(self, period: float, terms: int) -> PeriodGuess:
        """Fit a series of one period, the other unknowns free to move."""
        columns = self._columns(period, terms)
        free = columns - self.q @ (self.q.T @ columns)
        best, *_ = np.linalg.lstsq(free, -self.left, rcond=1e-9)
        left = self.left + free @ best
        # with the series at its best the other unknowns follow from what their own columns see of the rest
        change = -np.linalg.lstsq(self.triangle, self.q.T @ (self.rows + columns @ best), rcond=1e-9)[0]
        criterion = self._criterion(float(left @ left), columns.shape[1] + 1)
        # columns are by harmonic, a table is by joint
        return PeriodGuess(period, terms, criterion, best.reshape(-1, self.dofs).T, change)

    def _columns(self, period: float, terms: int) -> np.ndarray:
        """Return what each coefficient adds to the rows: mean of each joint, first cosine of each, ..."""
        shapes = fourier_basis(self.clock, period, terms)
        columns = np.zeros((len(self.rows), self.dofs * shapes.shape[1]))
        # rows of the prior have no torque: their part of the columns stays zero
        acting = shapes[:, None, :, None] * self.response[:, :, None, :]
        columns[: len(self.rows) - self.prior] = acting.reshape(-1, columns.shape[1])
        return columns

    def _criterion(self, left_over: float, unknowns: int) -> float:
        return self.samples * np.log(max(left_over, 1e-300)) + unknowns * np.log(self.samples)
