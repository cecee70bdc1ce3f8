"""From tracked points and scene to joint positions with covariance in every frame.

Every frame is fitted by itself; between poses that explain its points about as well the motion of the frames
around it decides. Points that lie on no mark are left out, and a joint counts as seen where the others
determine it.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from monodyn.mechanism.tree import HINGE
from monodyn.mechanism.turning import unwound
from monodyn.types import Poses
from monodyn.vision.points.adjust import Adjustment, Fitted, Seen, common_shifts, cost, noise_of
from monodyn.vision.points.locate import covariances, inside, registered
from monodyn.vision.points.poses import named_rightly, solved
from monodyn.vision.points.rest import Named, at_rest
from monodyn.vision.points.scene import PointScene
from monodyn.vision.points.shown import mean_length, project
from monodyn.vision.points.start import START_JITTER_PX, START_NOISE
from monodyn.vision.points.tracks import PointTracks

DETERMINED = 0.15
"""Standard deviation from which a joint was not seen [rad; of a slide in mean lengths of the mechanism]."""
UNUSUAL = 6.0
"""Distance from where the motion goes, in standard deviations, from which a pose with points missing is not
believed."""
IMPOSSIBLE = 10.0
"""The same of a pose on which all points lie: an outlier, too, can be as far from its joint as its mark."""
RARE, RARER = 98.0, 3.0
"""Percentile of that distance among such poses, and times that have to be exceeded."""
LEAST_SURE = 8
"""Certain frames from which others are predicted."""
LEAST_SPREAD = 1e-4
"""Least error of a prediction [rad or m]."""
ROUNDS = 3
"""Times that the noise of another table is found anew."""
PASSES = 2
"""Times that every frame is compared with those around it."""


def follow_points(tracks: PointTracks, scene: PointScene) -> Poses:
    """Find the pose of every frame.

    Args:
        tracks: The points to follow, of the same names as the scene's.
        scene: Camera, sizes and marks.

    Returns:
        Joint positions [rad; m in the start scale] with covariance; joints that the points do not determine
        are not seen and hold NaN.
    """
    joints = scene.mechanism.joints
    dofs = len(joints)
    if tracks is scene.tracks:
        # locating has put the names right, and taken the camera's motion out
        found = _named(scene, scene.seen, scene.fitted.noise, moving=scene.drift is not None)
    else:
        found = at_rest(tracks, scene.marks, scene.mechanism, partial(_named_anew, scene))
    adjustment, fitted, seen = found.adjustment, found.fitted, found.seen
    known = np.ones((len(tracks), dofs), dtype=bool)
    for _ in range(PASSES):
        # a frame that is not believed says nothing of those around it
        fitted, known = _with_motion(adjustment, fitted, seen, known)
    kept = inside(adjustment, fitted, seen)
    covariance = covariances(adjustment, fitted, kept, robust=False)
    path = None if tracks.clip is None else tracks.clip.camera_path
    if path is not None:
        covariance = registered(adjustment, fitted, kept, covariance, path.std[tracks.frame])
    covariance = covariance[:, :dofs, :dofs]
    shown = np.asarray(known & _shown(adjustment, fitted, kept))
    position = np.where(shown, fitted.position[:, :dofs], np.nan)
    seen_rows = np.all(shown, axis=1)
    names = tuple(joint.name for joint in joints)
    doubted = replace(scene.doubted, jitter=adjustment.jitter)
    shifts = np.where(shown, common_shifts(doubted, fitted, kept, scene.off)[:, :, :dofs], 0.0)
    poses = Poses(
        names, tracks.frame, tracks.time, position, covariance, seen_rows, metric=False, joint_seen=shown,
        roll=scene.camera.roll, shifts=shifts,
    )  # fmt: skip
    return unwound(poses, scene.mechanism.tree.kind == HINGE)


def _named_anew(scene: PointScene, seen: Seen, moving: bool) -> Named:
    """Return the points of another table by their right names, and the poses that they show."""
    noise = np.full(seen.px.shape[1], START_NOISE * scene.camera.width)
    for _ in range(ROUNDS):
        found = _named(scene, seen, noise, moving=moving)
        # the points of another table have a noise of their own, and all the camera's motion that is left
        noise = noise_of(found.adjustment, found.fitted, found.seen, noise)
    return _named(scene, seen, noise, moving=moving)


def _named(scene: PointScene, seen: Seen, noise: np.ndarray, *, moving: bool) -> Named:
    """Return points of a noise (point,) by their right names, and the poses that they show."""
    count, fitted = len(seen.px), scene.fitted
    dofs = len(scene.mechanism.joints) + (2 if moving else 0)
    # the poses of the scene are a start where there are as many
    begun = fitted.position if fitted.position.shape == (count, dofs) else np.zeros((count, dofs))
    fitted = replace(fitted, mechanism=scene.mechanism, camera=scene.camera, position=begun, noise=noise)
    jitter = scene.adjustment.jitter or START_JITTER_PX
    adjustment = replace(scene.adjustment, jitter=jitter if moving else 0.0)
    renamed, position, exchanges = named_rightly(adjustment, fitted, seen, told_apart=scene.tracks.told_apart)
    return Named(adjustment, replace(fitted, position=position), renamed, tuple(exchanges))


def _with_motion(
    adjustment: Adjustment, fitted: Fitted, seen: Seen, believed: np.ndarray
) -> tuple[Fitted, np.ndarray]:
    """Return the poses with those of frames whose points leave a choice as the motion goes, and which joints
    of each frame are believed, bool (frame, dof), by those that were."""
    dofs = len(fitted.mechanism.joints)
    kept = inside(adjustment, fitted, seen)
    whole = np.all(kept.weight > 0.0, axis=1, keepdims=True)
    sure = _shown(adjustment, fitted, kept) & whole & believed
    hinge = fitted.mechanism.tree.kind == HINGE
    expected, spread = predicted(fitted.position[:, :dofs], sure, hinge)
    start = fitted.position.copy()
    start[:, :dofs] = np.where(np.isfinite(expected), expected, start[:, :dofs])
    other = solved(adjustment, fitted, seen, start)
    scores = []
    for position in (fitted.position, other):
        off = _apart(position[:, :dofs], expected, hinge) / spread
        motion = 0.5 * np.sum(np.minimum(np.nan_to_num(off) ** 2, UNUSUAL**2), axis=1)
        found = cost(seen, project(adjustment.shown(fitted), position), fitted.noise)
        scores.append(found + motion + 0.5 * np.sum(adjustment.hold * position**2, axis=1))
    better = scores[1] < scores[0] - 1e-6
    position = np.where(better[:, None], other, fitted.position)
    fitted = replace(fitted, position=position)
    lost = np.any(inside(adjustment, fitted, seen).weight <= 0.0, axis=1)
    std = np.sqrt(np.diagonal(covariances(adjustment, fitted, seen), axis1=1, axis2=2))[:, :dofs]
    off = np.abs(_apart(position[:, :dofs], expected, hinge)) / np.hypot(spread, std)
    # a pose on the wrong side has every joint wrong, and not only the one that shows it
    farthest = off.max(axis=1)
    complete = farthest[~lost & np.isfinite(farthest)]
    # a link that whips round leaves the cubic in several frames, an outlier in one
    rare = RARER * float(np.percentile(complete, RARE)) if len(complete) else 0.0
    believed = ~(farthest > np.where(lost, UNUSUAL, max(IMPOSSIBLE, rare)))
    return fitted, np.repeat(believed[:, np.newaxis], dofs, axis=1)


def predicted(position: np.ndarray, sure: np.ndarray, hinge: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where the cubic through the certain frames around it has each joint, and how well it predicts.

    What a cubic misses grows with the square of the gap that it bridges, as does what a mean acceleration
    does.

    Args:
        position: Joint positions, (frame, dof).
        sure: True where they are certain, bool (frame, dof).
        hinge: True for hinges, whose turns do not count, bool (dof,).

    Returns:
        Expected positions and their typical errors, (frame, dof); NaN with too few certain frames.
    """
    expected, spread = (np.full(position.shape, np.nan) for _ in range(2))
    for dof in range(position.shape[1]):
        rows = np.flatnonzero(sure[:, dof])
        if len(rows) < LEAST_SURE:
            continue
        path = np.unwrap(position[rows, dof]) if hinge[dof] else position[rows, dof]
        value, gap = _between(np.arange(len(position)), rows, path)
        expected[:, dof] = value
        # a certain frame, predicted by the others, shows how well the cubic does
        off = np.abs(path - value[rows]) / gap[rows] ** 2
        spread[:, dof] = (1.5 * float(np.median(off)) + LEAST_SPREAD) * gap**2
    return expected, spread


def _between(frames: np.ndarray, rows: np.ndarray, path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the cubic through the two certain rows before and after each frame, itself left out, and half
    the gap that it bridges, each (frame,)."""
    before = np.searchsorted(rows, frames, side="left")
    after = np.searchsorted(rows, frames, side="right")
    picks = np.stack([before - 2, before - 1, after, after + 1], axis=1)
    # at the ends the four nearest certain rows serve
    for k in np.flatnonzero((picks[:, 0] < 0) | (picks[:, 3] >= len(rows))):
        far = np.abs(rows - frames[k]).astype(np.float64)
        far[rows == frames[k]] = np.inf
        picks[k] = np.sort(np.argsort(far, kind="stable")[:4])
    at = rows[picks].astype(np.float64)
    apart = at[:, None, :] - at[:, :, None]
    share = np.where(np.eye(4, dtype=bool), 1.0, (at - frames[:, None])[:, None, :])
    weight = share.prod(axis=2) / np.where(apart, apart, 1.0).prod(axis=2)
    near = np.sort(np.abs(at - frames[:, None]), axis=1)
    gap = np.maximum(0.5 * (near[:, 0] + near[:, 1]), 1.0)
    return np.sum(weight * path[picks], axis=1), gap


def _apart(position: np.ndarray, expected: np.ndarray, hinge: np.ndarray) -> np.ndarray:
    """Return how far positions are from the expected ones, turns of hinges aside, (frame, dof)."""
    off = position - expected
    return np.where(hinge, np.arctan2(np.sin(off), np.cos(off)), off)


def _shown(adjustment: Adjustment, fitted: Fitted, kept: Seen) -> np.ndarray:
    """Return which joints the points determine, bool (frame, dof)."""
    dofs = len(fitted.mechanism.joints)
    covariance = covariances(adjustment, fitted, kept, robust=False)
    std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))[:, :dofs]
    hinge = fitted.mechanism.tree.kind == HINGE
    return np.asarray(std < np.where(hinge, DETERMINED, DETERMINED * mean_length(fitted.mechanism)))
