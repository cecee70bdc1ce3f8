"""Poses in, the period of the drive out.

A driven mechanism that is lightly damped shows its free oscillation besides the driven one, and that has a
period of its own. The torque has not: with a mechanism of the right proportions the period is looked for in
the torque that the poses ask for, and without one in the poses themselves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from monodyn.arrays import frozen, increasing
from monodyn.errors import SettingsError
from monodyn.estimation.smooth import Smoothed, smooth
from monodyn.estimation.torque import fourier_basis, inverse_dynamics
from monodyn.mechanism import Mechanism
from monodyn.mechanism.tree import DAMPING, FRICTION, STIFFNESS
from monodyn.types import Poses

LEAST_PERIODS = 1.5
"""Periods that a record must hold for its period to be seen."""
LEAST_EXPLAINED = 0.5
"""A period explains at least this share of the variance; the best of many explains some 5 % of pure noise."""
LEAST_OF_TORQUE = 0.95
"""Of a torque more: its columns can be mixed until little is left."""
CALM = 2.5
"""Width of the low pass over torques, in frames."""
LEAST_FUNDAMENTAL = 0.05
"""Share of the first harmonic: without it two unrelated oscillations pass as harmonics of a long period."""
LEAST_FRAMES = 24
MOST_ROWS = 600
"""Frames from the start of a record in which candidates are looked for; the best is refined on all."""
FINENESS = 0.15
"""Turns by which the fastest harmonic shifts through the record from one tried frequency to the next."""
MOST_CANDIDATES = 5
SAME = 0.02
"""Candidates within this ratio are one."""


@dataclass(frozen=True)
class Candidate:
    """A period that a record may have.

    Attributes:
        seconds: The period [s].
        explained: Share of the variance that a series of this period explains.
        terms: Harmonics of that series.
    """

    seconds: float
    explained: float
    terms: int


@dataclass(frozen=True)
class Period:
    """The common period of all joints.

    Attributes:
        status: What was found or why nothing was, one sentence.
        seconds: The period [s], NaN when none was found.
        std: Its standard deviation from the scatter about the series [s].
        explained: Share of the variance that it explains.
        candidates: What was looked at more closely, best first.
        scale: Common scale of the sizes against the mechanism's at which its torque has this period: what the
            balance of inertia and weight says; NaN without a mechanism or gravity.
    """

    status: str
    seconds: float
    std: float
    explained: float
    candidates: tuple[Candidate, ...]
    scale: float = float("nan")

    @property
    def found(self) -> bool:
        """True when there is a period."""
        return bool(np.isfinite(self.seconds))


ADVICE = "give more frames, or the period with --fix torque.period=SECONDS."


def estimate_period(
    time: np.ndarray, position: np.ndarray, terms: int, *, mechanism: Mechanism | None = None
) -> Period:
    """Estimate the common period of all joints, or of the torque at them, by least squares.

    For a grid of periods, and series of 1 to ``terms`` harmonics, the share u of the variance is found that
    the series does not explain. With a mechanism what is explained is the torque of eq. (12), from smoothed
    poses, as far as it is linear in what is not known before the fit: the common scale of sizes (inertia
    against weight) and the dampings; the combination with the least u counts. Period and number of harmonics
    with the least n log u + k log n (k coefficients, n independent samples) are best: a multiple of
    the period explains as much with more harmonics. Poses alone tell the drive from a free oscillation only
    where that is the weaker one.

    Args:
        time: Increasing time stamps [s], (frame,).
        position: Joint positions [rad or m], NaN where not seen, (frame, dof).
        terms: Harmonics at the most.
        mechanism: The mechanism, with the right proportions; None looks for the period of the poses.

    Returns:
        The period; its ``status`` says why none was found.

    Raises:
        SettingsError: The times do not increase, or the arrays do not belong together, or no terms.

    Source:
        Eq. (10) and (12) of "Estimating dynamics on-the-fly using monocular video", 2012, which leaves the
        estimate of the period open; Schwarz, Estimating the dimension of a model, 1978.
    """
    position = np.asarray(position, dtype=float)
    if position.ndim != 2:
        raise SettingsError(f"period: expected positions (frame, dof), got shape {position.shape}.")
    if terms < 1:
        raise SettingsError(f"terms: expected 1 harmonic or more, got {terms}.")
    times = increasing("period: time", np.asarray(time, dtype=float), error=SettingsError)
    times = frozen("period: time", times, (len(position),), error=SettingsError)
    rows = np.flatnonzero(np.isfinite(position).all(axis=1))
    if len(rows) < LEAST_FRAMES:
        return _none(f"A period cannot be told from {len(rows)} frames with all joints measured; {ADVICE}")
    found = smooth(_poses(times, position))
    moved = position[rows].std(axis=0)
    if (moved <= 4.0 * found.noise).all():
        return _none(f"Nothing moves in the record, so there is no period to be seen; {ADVICE}")
    series = _series(times, position, rows, mechanism, found)
    least = LEAST_EXPLAINED if mechanism is None else LEAST_OF_TORQUE
    return _judged(series, _ranked(series, terms), least)


def periodic_scale(
    time: np.ndarray, position: np.ndarray, period: float, terms: int, mechanism: Mechanism
) -> float:
    """Return the common scale of sizes at which the torque that the poses ask for has a known period best.

    Args:
        time: Increasing time stamps [s], (frame,).
        position: Joint positions [rad or m], NaN where not seen, (frame, dof).
        period: The period [s].
        terms: Harmonics.
        mechanism: The mechanism, with the right proportions.

    Returns:
        Ratio of the sizes to those of the mechanism; NaN where the frames are under four times the
        coefficients, or there is no gravity.
    """
    rows = np.flatnonzero(np.isfinite(position).all(axis=1))
    if len(rows) < max(LEAST_FRAMES, 4 * (2 * terms + 1)):
        return float("nan")
    series = _series(time, position, rows, mechanism, smooth(_poses(time, position)))
    return series.scale(period, terms)


def _none(status: str, candidates: tuple[Candidate, ...] = ()) -> Period:
    best = candidates[0].explained if candidates else 0.0
    return Period(status, float("nan"), float("nan"), best, candidates)


def _poses(times: np.ndarray, position: np.ndarray) -> Poses:
    """The positions as a record of which only the positions are known."""
    frames, dofs = position.shape
    names, seen = tuple(f"joint{k}" for k in range(dofs)), np.asarray(np.isfinite(position).any(axis=1))
    return Poses(names, np.arange(frames), times, position, np.zeros((frames, dofs, dofs)), seen)


@dataclass(frozen=True, eq=False)
class _Series:
    """What a period must explain: some combination of columns, all joints together.

    Attributes:
        time: Times [s], (row,).
        columns: Scaled columns, (row, dof, column).
        ratio: What a mix of the first two columns, inertia over weight, is multiplied with to be the common
            scale of sizes; NaN where there is none.
    """

    time: np.ndarray
    columns: np.ndarray
    ratio: float = np.nan

    def scale(self, period: float, terms: int) -> float:
        """Common scale of sizes at which most is explained, NaN where there is none."""
        mix = self.split(period, terms)[2]
        scale = self.ratio * mix[0] / mix[1] if np.isfinite(self.ratio) and mix[1] != 0 else np.nan
        return float(scale) if scale > 0 else float("nan")

    def unexplained(self, period: float, terms: int) -> tuple[float, np.ndarray]:
        """Least share of the variance that is left, and what is left of that combination (row, dof)."""
        share, left, _ = self.split(period, terms)
        return share, left

    def split(self, period: float, terms: int) -> tuple[float, np.ndarray, np.ndarray]:
        """Least share that is left, what is left of that combination (row, dof), and the mix (column,)."""
        rows, dofs, count = self.columns.shape
        basis, _ = np.linalg.qr(fourier_basis(self.time - self.time[0], period, terms))
        flat = self.columns.reshape(rows, -1)
        left = (flat - basis @ (basis.T @ flat)).reshape(-1, count)
        whole = (flat - flat.mean(axis=0)).reshape(-1, count)
        values, vectors = np.linalg.eigh(whole.T @ whole)
        keep = values > 1e-9 * values[-1]
        white = vectors[:, keep] / np.sqrt(values[keep])
        shares, mixes = np.linalg.eigh(white.T @ (left.T @ left) @ white)
        mix = white @ mixes[:, 0]
        return float(max(shares[0], 1e-12)), (left @ mix).reshape(rows, dofs), mix


def _series(
    times: np.ndarray, position: np.ndarray, rows: np.ndarray, mechanism: Mechanism | None, smoothed: Smoothed
) -> _Series:
    """Choose what has a period: the poses, or the torque they ask for."""
    if mechanism is None:
        values = position[rows]
        scale = np.maximum(values.std(axis=0), 1e-12)
        return _Series(times[rows], ((values - values.mean(axis=0)) / scale)[:, :, None])
    inner = rows[2:-2]
    q, v, a = smoothed.position[inner], smoothed.velocity[inner], smoothed.acceleration[inner]
    tree = mechanism.tree
    bare, sprung = tree.links.copy(), tree.links.copy()
    bare[:, [DAMPING, FRICTION, STIFFNESS]], sprung[:, [DAMPING, FRICTION]] = 0.0, 0.0
    inertial = inverse_dynamics(mechanism, q, v, a, links=bare, gravity=np.zeros(2))
    weight = inverse_dynamics(mechanism, q, v, a, links=bare) - inertial
    spring = inverse_dynamics(mechanism, q, v, a, links=sprung, gravity=np.zeros(2)) - inertial
    dampings = [v * unit for unit in np.eye(v.shape[1])]
    time, columns = _calmed(times[inner], np.stack([inertial, weight, spring, *dampings], axis=2))
    by_joint = np.maximum(np.sqrt((columns[:, :, :2] ** 2).sum(axis=2).mean(axis=0)), 1e-300)
    columns = columns / by_joint[:, None]
    size = np.sqrt((columns**2).mean(axis=(0, 1)))
    ratio = size[1] / size[0] if min(size[0], size[1]) > 1e-12 else np.nan
    return _Series(time, columns[:, :, size > 1e-12] / size[size > 1e-12], float(ratio))


def _calmed(times: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bring columns (row, dof, column) to even times and take the noise of accelerations out.

    All columns pass the same filter, under which what is periodic stays so with the same period.
    """
    from scipy.interpolate import make_interp_spline
    from scipy.ndimage import gaussian_filter1d

    count = 1 + round(float((times[-1] - times[0]) / np.median(np.diff(times))))
    even = np.linspace(times[0], times[-1], count)
    columns = gaussian_filter1d(make_interp_spline(times, columns, k=1)(even), CALM, axis=0)
    edge = round(2.0 * CALM)
    return even[edge:-edge], columns[edge:-edge]


def _ranked(series: _Series, terms: int) -> list[tuple[float, Candidate]]:
    """Candidates with their score, best first."""
    short = replace(series, time=series.time[:MOST_ROWS], columns=series.columns[:MOST_ROWS])
    span = float(short.time[-1] - short.time[0])
    step = float(np.median(np.diff(short.time)))
    samples, found = 0.0, []
    dofs = short.columns.shape[1]
    for count in range(1, terms + 1):
        highest = 0.4 / (step * count)
        spacing = FINENESS / (span * count)
        frequency = np.arange(LEAST_PERIODS / span - spacing, highest, spacing)
        if len(frequency) < 3 or len(short.time) < 2 * (2 * count + 1):
            break
        shares = np.array([short.unexplained(1.0 / f, count)[0] for f in frequency])
        inner = np.flatnonzero((shares[1:-1] <= shares[:-2]) & (shares[1:-1] <= shares[2:])) + 1
        for i in inner[np.argsort(shares[inner])[:MOST_CANDIDATES]]:
            seconds = _refined(series, float(frequency[i]), spacing, count)
            if series.unexplained(seconds, 1)[0] > 1.0 - LEAST_FUNDAMENTAL:
                continue
            share, left = series.unexplained(seconds, count)
            samples = samples or _independent(left)
            size = dofs * (2 * count + 1)
            score = samples * np.log(share) + size * np.log(max(samples, 2.0))
            found.append((score, Candidate(seconds, 1.0 - share, count)))
    found.sort(key=lambda pair: pair[0])
    kept: list[tuple[float, Candidate]] = []
    for score, one in found:
        if all(abs(one.seconds / other.seconds - 1.0) > SAME for _, other in kept):
            kept.append((score, one))
    return kept[:MOST_CANDIDATES]


def _refined(series: _Series, frequency: float, spacing: float, terms: int) -> float:
    """Period within one spacing of a grid point that explains most [s]."""
    from scipy.optimize import minimize_scalar

    best = minimize_scalar(
        lambda f: series.unexplained(1.0 / f, terms)[0],
        bounds=(frequency - spacing, frequency + spacing), method="bounded",
        options={"xatol": 1e-4 * spacing},
    )  # fmt: skip
    return 1.0 / float(best.x)


def _independent(left: np.ndarray) -> float:
    """Number of independent samples in what is left (row, dof): n / (1 + 2 sum of autocorrelations)."""
    total, power = 0.0, float((left**2).sum())
    for lag in range(1, len(left) // 4):
        rho = float((left[lag:] * left[:-lag]).sum()) / max(power, 1e-300)
        if rho < 1.5 / np.sqrt(left.size):
            break
        total += rho
    return left.size / (1.0 + 2.0 * total)


def _judged(series: _Series, ranked: list[tuple[float, Candidate]], least: float) -> Period:
    """Take the best candidate if it is one."""
    candidates = tuple(one for _, one in ranked)
    span = float(series.time[-1] - series.time[0])
    if not candidates or candidates[0].explained < least:
        share = f" (the best explains {100 * candidates[0].explained:.0f} %)" if candidates else ""
        return _none(
            f"No period of up to {span / LEAST_PERIODS:.3g} s explains the motion, and longer ones cannot be "
            f"told from so short a record{share}; {ADVICE}",
            candidates,
        )
    best = candidates[0]
    std = _std(series, best)
    status = f"Period {best.seconds:.4g} s +- {std:.2g} s, which explains {100 * best.explained:.3g} %."
    scale = series.scale(best.seconds, best.terms)
    return Period(status, best.seconds, std, best.explained, candidates, scale)


def _std(series: _Series, best: Candidate) -> float:
    """Standard deviation of a period from the curvature of what is left [s]."""
    share, left = series.unexplained(best.seconds, best.terms)
    step = 0.02 * best.seconds**2 / (best.terms * float(series.time[-1] - series.time[0]))
    ahead, behind = (series.unexplained(best.seconds + d, best.terms)[0] for d in (step, -step))
    curvature = max(ahead - 2.0 * share + behind, 1e-300) / step**2
    return float(np.sqrt(2.0 * share / (_independent(left) * curvature)))
