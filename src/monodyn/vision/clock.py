"""Tracked poses in, the same poses at the times that their motion shows out.

Where pictures of a clip repeat the one before, either the camera lost some, and each that is new belongs to
its time stamp; or a scene of another rate was copied into the clip, and those that are new belong to that
rate. Both make the same pattern. The motion distinguishes them: it is smooth at the right times alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.types import Poses
from monodyn.vision.clip.video import Video

NEIGHBOURS = (-2, -1, 1, 2)
"""Rows from which a pose is predicted by the cubic through them."""
SMOOTHER = 0.8
"""Other times take the place of the stamps where they reduce what the cubics miss to less than this share."""


def at_true_times(poses: Poses, video: Video) -> Poses:
    """Put poses at the rate of the scene where they are smoother there, and add the rounding of their times.

    Args:
        poses: The tracked clip.
        video: The clip, which knows its repeats and to what its stamps are rounded.

    Returns:
        The poses; their covariance grows by rate^2 tick^2 / 12 where the stamps are rounded.
    """
    repeats = video.repeats
    poses = _to_the_end(poses, video)
    if len(repeats.times):
        times = repeats.times[poses.frame]
        if _smoother(poses, times):
            poses = replace(poses, time=times)
            note = (
                f"The motion is smooth at a constant rate of {repeats.rate:.6g} new pictures a second and "
                "not at their time stamps; that rate takes their place."
            )
            # a clip may be tracked more than once
            if note not in video.remarks:
                video.remarks.append(note)
    return with_time_noise(poses, video.tick / np.sqrt(12.0)) if video.tick else poses


def _smoother(poses: Poses, times: np.ndarray) -> bool:
    """Return whether the motion is clearly smoother at other times (frame,)."""
    rows = np.flatnonzero(poses.measured.all(axis=1))
    if len(rows) <= len(NEIGHBOURS):
        return False
    stamped, other = (unevenness(clock[rows], poses.position[rows]) for clock in (poses.time, times))
    # the mean over the joints of the logarithm, so that a joint with little motion counts as much as another
    ratio = np.mean(np.log(np.maximum(other, 1e-12) / np.maximum(stamped, 1e-12)))
    return bool(ratio < np.log(SMOOTHER))


def _to_the_end(poses: Poses, video: Video) -> Poses:
    """Append rows for the repeats after the last picture that is new."""
    more = np.array([frame for frame in video.repeats.frames if frame > poses.frame[-1]], dtype=np.int64)
    if not len(more):
        return poses
    dofs = len(poses.joints)
    return replace(
        poses,
        frame=np.concatenate([poses.frame, more]),
        time=np.concatenate([poses.time, video.times[more]]),
        position=np.concatenate([poses.position, np.full((len(more), dofs), np.nan)]),
        covariance=np.concatenate([poses.covariance, np.full((len(more), dofs, dofs), np.nan)]),
        seen=np.concatenate([poses.seen, np.zeros(len(more), dtype=bool)]),
        joint_seen=np.concatenate([poses.measured, np.zeros((len(more), dofs), dtype=bool)]),
        shifts=None if poses.shifts is None else np.pad(poses.shifts, ((0, 0), (0, len(more)), (0, 0))),
    )


def unevenness(times: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Return by how much the cubic through its neighbours typically misses a position, by joint (dof,).

    Args:
        times: Time stamps [s], (frame,), of at least five frames.
        positions: Joint positions [rad or m], (frame, dof).

    Returns:
        The median, in units of the error that noise of size one would make [rad or m].
    """
    middle = np.arange(-NEIGHBOURS[0], len(times) - NEIGHBOURS[-1])
    around = middle[:, None] + np.array(NEIGHBOURS)
    apart = times[around] - times[middle][:, None]
    # Lagrange's weights of the cubic through the neighbours at the time between them
    between = apart[:, None, :] - apart[:, :, None]
    share = np.where(
        np.eye(len(NEIGHBOURS), dtype=bool), 1.0, apart[:, None, :] / np.where(between, between, 1.0)
    )
    weights = share.prod(axis=2)
    missed = positions[middle] - np.einsum("ki,kid->kd", weights, positions[around])
    return np.median(np.abs(missed) / np.sqrt(1.0 + np.sum(weights**2, axis=1))[:, None], axis=0)


def with_time_noise(poses: Poses, deviation: float) -> Poses:
    """Add what errors of the time stamps make of the positions: C + v v^T s^2 with the rates v.

    Args:
        poses: The tracked clip.
        deviation: Standard deviation s of a time stamp [s].

    Returns:
        The poses with the larger covariance.
    """
    rates = np.zeros_like(poses.position)
    for dof, measured in enumerate(poses.measured.T):
        if measured.sum() > 1:
            rates[measured, dof] = np.gradient(poses.position[measured, dof], poses.time[measured])
    covariance = poses.covariance + deviation**2 * rates[:, :, None] * rates[:, None, :]
    return replace(poses, covariance=covariance)
