"""The poses that best explain one mask: a beam search, link by link.

Each round sets one more joint of every pose kept so far. Geoms come in the order of their links, so the geoms
of the links that are set are the first ones, and a partial pose is scored by these alone (paper eq. 3). A
round is one numba kernel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.mechanism import Mechanism
from monodyn.mechanism.tree import ANCHOR_X, ANCHOR_Y, ANGLE, AXIS_X, AXIS_Y, HINGE
from monodyn.uncounted import UNCOUNTED
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
    circular = rig.kind[link] == HINGE and len(values) == beam.angles
    return _extended(frame.balance, rig, poses, link, values, circular, beam.kept, *joint_limits(mechanism))


@njit(cache=True, nogil=True)
def _extended(
    balance: np.ndarray, rig: Rig, poses: np.ndarray, link: int, values: np.ndarray, circular: bool,
    kept: int, lower: np.ndarray, upper: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Set one more joint of partial poses, (pose, dof), to each of some values [rad or m], (candidate,), and
    return the ``kept`` best ones as ``extended`` does; ``lower`` and ``upper`` are (dof,)."""
    count, dofs = values.size, poses.shape[1]
    grid = np.empty((len(poses) * count, dofs))
    _fill_grid(grid, poses, link, values)
    before, geoms = int(np.sum(rig.link < link)), int(np.sum(rig.link <= link))
    costs = pose_balance(balance, rig, grid, geoms)
    if geoms == before:
        # a link without geoms scores nothing: its positions all go on to the next joint
        return grid, costs
    best = best_peaks(costs.reshape((len(poses), count)), circular, kept)
    step = (values[1] - values[0]) / FINER if count > 1 else 0.0
    tried = _moved(rig, link, grid[best], step, lower, upper)
    parts = tried.shape[1]
    others = tried[:, 1:].copy().reshape((-1, dofs))
    every = pose_balance(balance, rig, others, geoms).reshape((len(best), parts - 1))
    found, least = tried[:, 0].copy(), costs[best]
    for i in range(len(best)):
        at = np.argmin(every[i])
        if every[i, at] < least[i]:
            found[i], least[i] = tried[i, 1 + at], every[i, at]
    return found, least


@njit(cache=True, **UNCOUNTED)
def _fill_grid(grid: np.ndarray, poses: np.ndarray, link: int, values: np.ndarray) -> None:
    """Fill ``grid``, (pose * candidate, dof), with poses, (pose, dof), of which one joint has each of some
    values, (candidate,)."""
    for i in range(len(grid)):
        for joint in range(grid.shape[1]):
            grid[i, joint] = values[i % len(values)] if joint == link else poses[i // len(values), joint]


@njit(cache=True, nogil=True)
def _moved(
    rig: Rig, link: int, poses: np.ndarray, step: float, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Move the last joint of some poses, (pose, dof), and the one that it hangs on, by a step to either side
    [rad or m]; return (pose, part, dof), the first part being the pose itself.

    A link that lies beside its place by half a step of the one before explains less of the mask than a wrong
    one: structures would be told apart by where the steps fall.
    """
    parent = rig.parent[link]
    both = parent >= 0 and rig.kind[parent] == rig.kind[link]
    parts = 9 if both else 3
    tried = np.empty((len(poses), parts, poses.shape[1]))
    _fill_moved(tried, poses, link, parent if both else -1, step, lower, upper)
    return tried


@njit(cache=True, **UNCOUNTED)
def _fill_moved(
    tried: np.ndarray, poses: np.ndarray, link: int, parent: int, step: float, lower: np.ndarray,
    upper: np.ndarray,
) -> None:  # fmt: skip
    """Do the work of ``_moved``; ``parent`` is below 0 where only the last joint is moved."""
    shifts = (0.0, -step, step)
    for i in range(len(poses)):
        for part in range(tried.shape[1]):
            for joint in range(poses.shape[1]):
                value = poses[i, joint]
                # the last joint changes from pose to pose: that costs least
                if joint == link:
                    value += shifts[part % 3]
                elif joint == parent:
                    value += shifts[part // 3]
                tried[i, part, joint] = min(max(value, lower[joint]), upper[joint])


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


@njit(cache=True, nogil=True)
def best_peaks(costs: np.ndarray, circular: bool, count: int) -> np.ndarray:
    """Return the flat indices of the best local minima along the rows of a table.

    Neighbouring positions have nearly equal scores: without the choice of minima the beam would fill with
    copies of one pose, and lose the others that a later link may need.

    Args:
        costs: The table, (pose, candidate).
        circular: True where the last value is next to the first.
        count: Most minima.

    Returns:
        Their indices, the least first, int (entry,).
    """
    rows, columns = costs.shape
    flat, peaks, found = costs.copy().reshape(-1), np.empty(rows * columns, dtype=np.int64), 0
    for i in range(rows):
        for j in range(columns):
            # beyond the ends of a row there is the other end, or nothing
            left = costs[i, j - 1] if j > 0 else costs[i, columns - 1] if circular else np.inf
            right = costs[i, j + 1] if j + 1 < columns else costs[i, 0] if circular else np.inf
            # one of the two comparisons is strict: a plateau counts once
            if costs[i, j] <= left and costs[i, j] < right:
                peaks[found] = i * columns + j
                found += 1
    if found == 0:
        peaks[0], found = np.argmin(flat), 1
    peaks = peaks[:found]
    return peaks[np.argsort(flat[peaks], kind="mergesort")[:count]]


def _joint_values(frame: KeyFrame, rig: Rig, mechanism: Mechanism, row: int, beam: Beam) -> np.ndarray:
    """Return the positions to try of one joint, within its limits [rad or m]."""
    joint = mechanism.joints[row]
    if rig.kind[row] == HINGE:
        values = np.linspace(-np.pi, np.pi, beam.angles, endpoint=False)
    else:
        values = slide_places(frame, rig, row, beam.places)
    values = values[(values >= joint.lower) & (values <= joint.upper)]
    return values if len(values) else np.linspace(joint.lower, joint.upper, 5)
