"""Measured joint positions in, smooth motion out: local cubics through the neighbours of each time.

The estimate starts the identification, it never replaces the measurements: the fit itself knows the dynamics
and smooths better than any filter. Time stamps may be uneven and frames may be missing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from monodyn.types import Poses

MIDDLE = (0.025, 0.975)
"""Shares of the positions of a joint between which no gross error lies."""
WINDOWS = (7, 11, 17, 27)
"""Numbers of neighbours that are tried."""
FEWEST_SAMPLES = 5
"""Samples for a cubic and its noise; with fewer left, none of them counts as far off."""
NORMAL = 0.6745
"""Median of the absolute value of a standard normal variable."""

POSITION, VELOCITY, ACCELERATION, ACCELERATION_STD = range(4)
"""Rows of a curve, in the order of the kernel."""
CURVE_ROWS = ACCELERATION_STD + 1
"""Number of these rows."""


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Smooth motion through a record.

    Attributes:
        time: Times of the estimates [s], (frame,).
        position: Joint positions [rad or m], (frame, dof); NaN for a joint with under 5 measured samples.
        velocity: Joint rates [rad/s or m/s], (frame, dof).
        acceleration: Second derivative [rad/s^2 or m/s^2], (frame, dof).
        acceleration_std: Its standard deviation from the noise alone, (frame, dof).
        noise: Standard deviation of the measurements about the curve [rad or m], (dof,).
        outlier: True for measurements that lie far from the curve through their neighbours, (frame, dof).
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    acceleration_std: np.ndarray
    noise: np.ndarray
    outlier: np.ndarray


def smooth(poses: Poses) -> Smoothed:
    """Estimate position, rate and acceleration at every time stamp of a record.

    At each time a cubic is fitted to the nearest measured samples, weighted (1 - |t/h|^3)^3 by distance and
    again by the size of their residual; the number of neighbours is the one of ``WINDOWS`` that predicts
    left-out samples best.

    Args:
        poses: The record; samples that were not measured are gaps.

    Returns:
        The motion at ``poses.time``.

    Source:
        Cleveland, Robust locally weighted regression and smoothing scatterplots, 1979.
    """
    frames, dofs = poses.position.shape
    motion = np.full((CURVE_ROWS, frames, dofs), np.nan)
    noise, outlier = np.full(dofs, np.nan), np.zeros((frames, dofs), dtype=bool)
    for dof in range(dofs):
        use = np.flatnonzero(poses.measured[:, dof])
        if len(use) < FEWEST_SAMPLES:
            continue
        times, values = poses.time[use], poses.position[use, dof]
        found = _best_window(times, values, poses.time)
        motion[:, :, dof], noise[dof] = found.curve, found.noise
        outlier[use, dof] = found.far
    return Smoothed(
        time=poses.time,
        position=motion[POSITION],
        velocity=motion[VELOCITY],
        acceleration=motion[ACCELERATION],
        acceleration_std=motion[ACCELERATION_STD],
        noise=noise,
        outlier=outlier,
    )


@dataclass(frozen=True, eq=False)
class _Curve:
    """A curve at the requested times, in the rows named above, (row, frame); how well the samples are met."""

    curve: np.ndarray
    noise: float
    far: np.ndarray
    error: float


def _best_window(times: np.ndarray, values: np.ndarray, at: np.ndarray) -> _Curve:
    """Fit with each number of neighbours and keep the one that predicts left-out samples best."""
    # the error of a width is that of samples predicted by their neighbours alone: more neighbours average out
    # more noise and miss more of the motion, and it is least where the two balance
    widths = [count for count in WINDOWS if count <= len(times)] or [len(times)]
    tried = [_fit(times, values, count) for count in widths]
    best = min(tried, key=lambda curve: curve.error)
    width = widths[tried.index(best)]
    if len(times) - int(best.far.sum()) < FEWEST_SAMPLES:
        best = replace(best, far=np.zeros(len(times), dtype=bool))
    # gross errors are left out of the curve itself; the samples that stay have equal weight
    near = ~best.far
    count = min(width, int(near.sum()))
    rows, _ = _cubics(times[near], values[near], np.ones(int(near.sum())), at, count)
    rows[ACCELERATION_STD] *= best.noise
    return _Curve(rows, best.noise, best.far, best.error)


def _fit(times: np.ndarray, values: np.ndarray, count: int) -> _Curve:
    """Fit at the samples, down-weight those far off, fit again."""
    weight = np.ones(len(times))
    least = 1e-9 * motion_size(values) + 1e-12
    for _ in range(8):
        curve, share = _cubics(times, values, weight, times, count)
        # a sample that takes part in its own estimate with share s is s nearer to it than to one without it:
        # residual / (1 - s) is the residual if it were left out
        rest = np.maximum(1.0 - share, 0.05)
        left_out = np.abs(values - curve[POSITION]) / rest
        size = max(float(np.median(left_out)) / NORMAL, least)
        if left_out.max() < 6.0 * size:
            break
        # bisquare weights: a sample six typical residuals off no longer pulls at the curve, however far off;
        # the rest of a weight keeps a curve among such samples alone
        far_off = (left_out / (6.0 * size)) ** 2
        weight = np.clip(1.0 - far_off, 0.0, 1.0) ** 2 + 1e-6 / (1.0 + far_off)
    residual = left_out * np.sqrt(rest)
    noise = max(float(np.median(residual)) / NORMAL, least)
    far = (left_out > 8.0 * size) & (residual > 8.0 * noise)
    return _Curve(curve, noise, far, float(np.mean(np.minimum(left_out, 6.0 * size))))


def _cubics(
    times: np.ndarray, values: np.ndarray, weight: np.ndarray, at: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Fit a cubic about each requested time.

    Args:
        times: Times of the samples [s], (sample,).
        values: Samples, (sample,).
        weight: Weight of each sample, (sample,).
        at: Requested times [s], (frame,).
        count: Number of neighbours.

    Returns:
        The curve in the rows named above, its standard deviation for unit noise, (row, frame); and the share
        of a sample in its own estimate (its leverage), (frame,), of use where ``at`` are the samples.
    """
    from monodyn.estimation.record.cubics import local_cubics

    return local_cubics(times, values, weight, at, _neighbours(times, at, count), count)


def _neighbours(times: np.ndarray, at: np.ndarray, count: int) -> np.ndarray:
    """First of the ``count`` samples nearest to each requested time, int (frame,)."""
    # start from a window centred by rank, then slide it one sample at a time while the sample that enters is
    # nearer than the one that leaves; times increase, so that a window which no longer moves is the nearest
    first = np.searchsorted(times, at) - count // 2
    first = np.clip(first, 0, len(times) - count)
    for _ in range(count):
        after = np.minimum(first + count, len(times) - 1)
        closer = (first + count < len(times)) & (np.abs(times[after] - at) < np.abs(times[first] - at))
        if not closer.any():
            break
        first = first + closer
    for _ in range(count):
        before = np.maximum(first - 1, 0)
        closer = (first > 0) & (np.abs(times[before] - at) < np.abs(times[first + count - 1] - at))
        if not closer.any():
            break
        first = first - closer
    return first


def motion_size(values: np.ndarray) -> float:
    """Return the standard deviation of positions about their mean, to which no gross error adds much.

    Values farther outside of the middle 95 % than that is wide count as if they were no farther.

    Args:
        values: Positions [rad or m], (sample,).

    Returns:
        Their size in the same unit; 0 for none.
    """
    if not len(values):
        return 0.0
    low, high = np.quantile(values, MIDDLE)
    return float(np.std(np.clip(values, 2.0 * low - high, 2.0 * high - low)))
