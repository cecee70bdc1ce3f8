"""The poses that best explain one mask: a beam search, link by link.

Each round sets one more joint of every pose kept so far. Geoms come in the order of their links, so the geoms
of the links that are set are the first ones, and a partial pose is scored by these alone (paper eq. 3).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.mechanism.tree import ANCHOR_X, ANCHOR_Y, ANGLE, AXIS_X, AXIS_Y, HINGE
from monodyn.vision.drawing.camera import on_plane
from monodyn.vision.drawing.mismatch import pose_balance
from monodyn.vision.drawing.rig import Rig, joint_limits
from monodyn.vision.locating.keyframes import KeyFrame

BEYOND = 0.1
"""How far a root may slide beyond the foreground, as a share of its extent."""


FINER = 3
"""Parts of a step to which the best positions are improved."""


class Beam(NamedTuple):
    """How wide a beam search is.

    Attributes:
        kept: Partial poses kept per link.
        angles: Positions tried per hinge.
        places: Positions tried per slide.
    """

    kept: int
    angles: int
    places: int


def extended(
    frame: KeyFrame, rig: Rig, mechanism: Mechanism, link: int, poses: np.ndarray, beam: Beam
) -> tuple[np.ndarray, np.ndarray]:
    """Set one more joint of partial poses.

    Args:
        frame: The key frame.
        rig: The mechanism before the reduced camera.
        mechanism: For joint limits.
        link: Row of the joint; those before it are set.
        poses: The partial poses, (pose, dof).
        beam: How wide the search is.

    Returns:
        The best poses with that joint set, (pose, dof), and their mismatch less the area of the mask [px^2],
        (pose,); all of them where the link has no geom to judge by.
    """
    values = _joint_values(frame, rig, mechanism, link, beam)
    grid = np.repeat(poses, len(values), axis=0)
    grid[:, link] = np.tile(values, len(poses))
    geoms = int(np.sum(rig.link <= link))
    costs = pose_balance(frame.balance, rig, grid, geoms)
    if geoms == int(np.sum(rig.link < link)):
        # a link without geoms scores nothing: its positions all go on to the next joint
        return grid, costs
    circular = rig.kind[link] == HINGE and len(values) == beam.angles
    kept = best_peaks(costs.reshape(len(poses), len(values)), circular, beam.kept)
    step = (values[1] - values[0]) / FINER if len(values) > 1 else 0.0
    return _between(frame, rig, link, (grid[kept], costs[kept]), step, joint_limits(mechanism))


def _between(
    frame: KeyFrame,
    rig: Rig,
    link: int,
    found: tuple[np.ndarray, np.ndarray],
    step: float,
    limits: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Move the last joint of some poses, and the one that it hangs on, by a step to either side.

    A link that lies beside its place by half a step of the one before explains less of the mask than a wrong
    one: structures would be told apart by where the steps fall.
    """
    poses, costs = found
    parent = int(rig.parent[link])
    moves = np.zeros((1, poses.shape[1]))
    for joint in (parent, link):  # the last joint changes from pose to pose: that costs least
        if joint >= 0 and rig.kind[joint] == rig.kind[link]:
            shifts = np.zeros((3, poses.shape[1]))
            shifts[:, joint] = [0.0, -step, step]
            moves = (moves[:, np.newaxis] + shifts).reshape(-1, poses.shape[1])
    tried = np.clip(poses[:, np.newaxis] + moves, *limits)
    geoms = int(np.sum(rig.link <= link))
    others = pose_balance(frame.balance, rig, tried[:, 1:].reshape(-1, poses.shape[1]), geoms)
    every = np.column_stack([costs, others.reshape(len(poses), -1)])
    rows, best = np.arange(len(poses)), every.argmin(axis=1)
    return tried[rows, best], every[rows, best]


def slide_places(frame: KeyFrame, rig: Rig, row: int, count: int) -> np.ndarray:
    """Return positions of a slide that span the foreground of a frame.

    Args:
        frame: The key frame.
        rig: The mechanism before the reduced camera.
        row: Row of the slide.
        count: How many.

    Returns:
        The positions [m], (candidate,).
    """
    rows, columns = frame.extent
    link = rig.links[row]
    corners = on_plane(rig.camera, np.array([(x, y) for x in columns for y in rows], dtype=float))
    half = 0.5 * float(np.hypot(*np.ptp(corners, axis=0)))
    if rig.parent[row] >= 0:
        return np.linspace(-2.0 * half, 2.0 * half, count)
    turn = link[ANGLE]
    along = (
        np.cos(turn) * link[AXIS_X] - np.sin(turn) * link[AXIS_Y],
        np.sin(turn) * link[AXIS_X] + np.cos(turn) * link[AXIS_Y],
    )
    places = (corners - link[[ANCHOR_X, ANCHOR_Y]]) @ np.array(along)
    margin = BEYOND * half
    return np.linspace(places.min() - margin, places.max() + margin, count)


def best_peaks(costs: np.ndarray, circular: bool, count: int) -> np.ndarray:
    """Return the flat indices of the best local minima along the rows of a table.

    Neighbouring positions have nearly equal scores: without the choice of minima the beam would fill with
    copies of one pose, and lose the others that a later link may need.

    Args:
        costs: The table, (pose, candidate).
        circular: True where the last value is next to the first.
        count: Most minima.

    Returns:
        Their indices, the least first, (entry,).
    """
    # beyond the ends of a row there is the other end, or nothing
    ends = (costs[:, -1:], costs[:, :1]) if circular else (np.full((len(costs), 1), np.inf),) * 2
    left, right = np.hstack([ends[0], costs[:, :-1]]), np.hstack([costs[:, 1:], ends[1]])
    # one of the two comparisons is strict: a plateau counts once
    peaks = np.nonzero(((costs <= left) & (costs < right)).ravel())[0]
    if not len(peaks):
        peaks = np.array([int(np.argmin(costs))])
    return peaks[np.argsort(costs.ravel()[peaks], kind="stable")[:count]]


def _joint_values(frame: KeyFrame, rig: Rig, mechanism: Mechanism, row: int, beam: Beam) -> np.ndarray:
    """Return the positions to try of one joint, within its limits [rad or m]."""
    joint = mechanism.joints[row]
    if rig.kind[row] == HINGE:
        values = np.linspace(-np.pi, np.pi, beam.angles, endpoint=False)
    else:
        values = slide_places(frame, rig, row, beam.places)
    values = values[(values >= joint.lower) & (values <= joint.upper)]
    return values if len(values) else np.linspace(joint.lower, joint.upper, 5)
