"""The pose of every frame by itself, from several starts, and which tracks have exchanged their names in it.

An outlier, or two tracks that have exchanged names, leads a single start astray. Every frame is therefore
fitted from the geometry of its own points and from its neighbours' poses, as the tracks are named and with
any two of them exchanged; the names go on from frame to frame unless the points say otherwise for long
enough.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.vision.points.adjust import Adjustment, Fitted, Seen, cost, held, weights
from monodyn.vision.points.begin import begin
from monodyn.vision.points.shown import in_plane, pose_slopes, project

POSE_ROUNDS = 12
"""Steps of the search for a pose."""
POSE_STEP = 0.4
"""Largest change of a joint in one of them [rad or m]."""
CHANGING = 9.0
"""Cost of a change of names between two frames: as much as a point that is nowhere near its mark."""
MOST_PAIRS = 120
"""Most pairs of tracks that may have exchanged names."""
NEAR = 7
"""Frames around one whose median pose is a start in it."""


@dataclass(frozen=True)
class Exchange:
    """Two tracks that have exchanged names for a while.

    Attributes:
        tracks: Rows of the two.
        first: First row of the stretch.
        stop: Row after its last.
    """

    tracks: tuple[int, int]
    first: int
    stop: int


def best_poses(adjustment: Adjustment, fitted: Fitted, seen: Seen) -> tuple[np.ndarray, np.ndarray]:
    """Find the pose of every frame from all of its starts.

    Args:
        adjustment: The marks.
        fitted: Mechanism and camera; its poses are starts, too.
        seen: The tracked points.

    Returns:
        Joint positions, (frame, dof), and the cost of each frame, (frame,).
    """
    shown = adjustment.shown(fitted)
    own = geometric(adjustment, fitted, seen)
    best, least = fitted.position, np.full(len(seen.px), np.inf)
    for start in (fitted.position, filled(own, fitted.position), around(own, fitted.position)):
        position = solved(adjustment, fitted, seen, start)
        found = cost(seen, project(shown, position), fitted.noise)
        found += 0.5 * np.sum(adjustment.hold * position**2, axis=1)
        better = found < least - 1e-9
        best, least = np.where(better[:, None], position, best), np.where(better, found, least)
    return best, least


def solved(adjustment: Adjustment, fitted: Fitted, seen: Seen, start: np.ndarray) -> np.ndarray:
    """Fit the pose of every frame from one start.

    Args:
        adjustment: The marks.
        fitted: Mechanism and camera.
        seen: The tracked points.
        start: Joint positions, (frame, dof).

    Returns:
        Joint positions, (frame, dof).
    """
    shown, hold, position = adjustment.shown(fitted), adjustment.hold, start.copy()
    for _ in range(POSE_ROUNDS):
        base = project(shown, position)
        weight = weights(seen, base, fitted.noise) / fitted.noise**2
        slopes = np.nan_to_num(pose_slopes(shown, position, base))
        off = np.nan_to_num(seen.px - base)
        block = np.einsum("npci,np,npcj->nij", slopes, weight, slopes) + np.diag(hold)
        right = np.einsum("npci,np,npc->ni", slopes, weight, off) - hold * position
        step = np.linalg.solve(held(block), right[..., None])[..., 0]
        position = position + np.clip(step, -POSE_STEP, POSE_STEP)
    return position


def geometric(adjustment: Adjustment, fitted: Fitted, seen: Seen) -> np.ndarray:
    """Return the poses that the points show by geometry, (frame, dof); NaN where they do not.

    Args:
        adjustment: The marks.
        fitted: Mechanism and camera.
        seen: The tracked points.
    """
    camera, marks = fitted.camera, adjustment.places.marks
    px = np.where(seen.weight[..., None] > 0.0, seen.px, np.nan)
    plane = in_plane(camera, px) * camera.depth + [camera.x, camera.y]
    shifts = np.zeros((len(px), fitted.position.shape[1] - len(fitted.mechanism.joints)))
    return np.column_stack([begin(marks, fitted.mechanism, plane).position, shifts])


def filled(own: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """Return poses with others in place of what is not known, (frame, dof).

    Args:
        own: Poses, NaN where not known, (frame, dof).
        otherwise: The others, (frame, dof).
    """
    return np.where(np.isfinite(own), own, otherwise)


def around(own: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """Return for each frame the line through the poses of the frames around it, (frame, dof).

    Args:
        own: Poses by geometry, NaN where not known, (frame, dof).
        otherwise: Poses in place of what is not known, (frame, dof).
    """
    poses, count = filled(own, otherwise), len(own)
    reach = min(NEAR // 2, max(1, (count - 1) // 2))
    rows = np.clip(np.arange(count)[:, None] + np.arange(-reach, reach + 1), 0, count - 1)
    # angles are brought within half a turn of the middle one before their median
    return poses + np.median(np.angle(np.exp(1j * (poses[rows] - poses[:, None]))), axis=1)


def named_rightly(
    adjustment: Adjustment, fitted: Fitted, seen: Seen, *, told_apart: bool = False
) -> tuple[Seen, np.ndarray, list[Exchange]]:
    """Undo exchanges of names between two tracks.

    Args:
        adjustment: The marks.
        fitted: Mechanism, camera and first poses.
        seen: The tracked points.
        told_apart: True where no names can have been exchanged.

    Returns:
        The points by their right names, the pose of every frame, (frame, dof), and what was exchanged.
    """
    count = seen.px.shape[1]
    pairs = [] if told_apart else list(itertools.combinations(range(count), 2))[:MOST_PAIRS]
    poses, costs = [], []
    for pair in [None, *pairs]:
        position, found = best_poses(adjustment, fitted, seen if pair is None else exchanged(seen, pair))
        poses.append(position)
        costs.append(found)
    states = likeliest(np.array(costs), CHANGING)
    px, weight, position = seen.px.copy(), seen.weight.copy(), poses[0].copy()
    found = []
    for state, pair in enumerate(pairs, start=1):
        rows = np.flatnonzero(states == state)
        other = exchanged(seen, pair)
        px[rows], weight[rows], position[rows] = other.px[rows], other.weight[rows], poses[state][rows]
        for part in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
            if len(part):
                found.append(Exchange(pair, int(part[0]), int(part[-1]) + 1))
    return replace(seen, px=px, weight=weight), position, sorted(found, key=lambda e: e.first)


def combined(exchanges: Sequence[Exchange]) -> list[Exchange]:
    """Return exchanges of names with those of one pair put together: twice exchanged is not exchanged.

    Args:
        exchanges: Exchanges, one after the other.

    Returns:
        The same in effect, no two of a pair in one frame, the first stretch first.
    """
    found = []
    for pair in dict.fromkeys(e.tracks for e in exchanges):
        # names change at the ends of a stretch; two changes at one place are none
        ends = [end for e in exchanges if e.tracks == pair for end in (e.first, e.stop)]
        odd = sorted(end for end in set(ends) if ends.count(end) % 2)
        found += [Exchange(pair, first, stop) for first, stop in zip(odd[::2], odd[1::2], strict=True)]
    return sorted(found, key=lambda e: e.first)


def exchanged(seen: Seen, pair: Sequence[int]) -> Seen:
    """Return tracked points with two tracks exchanged.

    Args:
        seen: The points.
        pair: Rows of the two tracks.
    """
    order = np.arange(seen.px.shape[1])
    order[list(pair)] = order[list(pair)[::-1]]
    return Seen(seen.px[:, order], seen.weight[:, order])


def likeliest(costs: np.ndarray, change: float) -> np.ndarray:
    """Return the sequence of states with the least cost (Viterbi).

    Args:
        costs: Cost of each state in each frame, (way, frame).
        change: Cost of a change of state between two frames.

    Returns:
        The state in each frame, int (frame,).
    """
    states, count = costs.shape
    total, back = costs[:, 0].copy(), np.zeros((states, count), dtype=np.int64)
    for k in range(1, count):
        least = int(np.argmin(total))
        stays = total <= total[least] + change
        back[:, k] = np.where(stays, np.arange(states), least)
        total = np.where(stays, total, total[least] + change) + costs[:, k]
    path = np.empty(count, dtype=np.int64)
    path[-1] = int(np.argmin(total))
    for k in range(count - 1, 0, -1):
        path[k - 1] = back[path[k], k]
    return path
