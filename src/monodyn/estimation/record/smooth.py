"""Measured joint positions in, smooth motion out: local cubics through the neighbours of each time.

The estimate starts the identification, it never replaces the measurements: the fit itself knows the dynamics
and smooths better than any filter. Time stamps may be uneven and frames may be missing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.types import Poses

MIDDLE = (0.025, 0.975)
"""Shares of the positions of a joint between which no gross error lies."""
WINDOWS = (7, 11, 17, 27)
"""Numbers of neighbours that are tried."""
NORMAL = 0.6745
"""Median of the absolute value of a standard normal variable."""
FEWEST_SAMPLES = 5
"""Samples for a cubic and its noise; with fewer left, none of them counts as far off."""
LEAST_NOISE = 1e-9
"""Smallest noise that is believed, as a share of the motion."""

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
    from monodyn.estimation.record.cubics import smooth_curve

    frames, dofs = poses.position.shape
    motion = np.full((CURVE_ROWS, frames, dofs), np.nan)
    noise, outlier = np.full(dofs, np.nan), np.zeros((frames, dofs), dtype=bool)
    for dof in range(dofs):
        use = np.flatnonzero(poses.measured[:, dof])
        if len(use) < FEWEST_SAMPLES:
            continue
        times, values = poses.time[use], poses.position[use, dof]
        widths = [count for count in WINDOWS if count <= len(use)] or [len(use)]
        least = LEAST_NOISE * motion_size(values) + 1e-12
        motion[:, :, dof], noise[dof], outlier[use, dof] = smooth_curve(
            times, values, poses.time, np.array(widths), least, NORMAL, FEWEST_SAMPLES
        )
    return Smoothed(
        time=poses.time,
        position=motion[POSITION],
        velocity=motion[VELOCITY],
        acceleration=motion[ACCELERATION],
        acceleration_std=motion[ACCELERATION_STD],
        noise=noise,
        outlier=outlier,
    )


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
