"""From poses and thumbnails to the frames in which the mechanism moves freely.

Two signs end a hold: in the picture, much more foreground than usual that touches the mechanism comes to its
end; in the poses, a rest that lasts longer than the motion after it explains. What is usual in the clip (a
shadow, cables that move along) is no sign of a hand, and a rest at the end is friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from monodyn.arrays import usual_step
from monodyn.cores import on_all_cores
from monodyn.mechanism import Mechanism
from monodyn.mechanism.simulate import energy
from monodyn.types import Poses
from monodyn.vision.clip.stamps import jumps
from monodyn.vision.drawing.outline import outline
from monodyn.vision.foreground.in_front import changed, changed_area, still_cells
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.foreground.sampling import frames_between
from monodyn.vision.foreground.thumbnails import Thumbnails
from monodyn.vision.locating.scene import Scene

LEAST_EXCESS = 0.2
"""Foreground beyond the usual, over the area of the mechanism, that something else must have."""
SPREADS = 5.0
"""Spreads of what is usual beyond which a frame is not usual."""
MOST_CHANGED = 0.5
"""Share of the region that changes when the light does, and not because of a hand."""
GAP_SECONDS = 0.15
"""Shorter stretches between two touches do not count as free, nor do shorter touches [s]."""
REST_STDS, REST_FLOOR = 6.0, 1e-3
"""A joint rests while it departs by no more than this many standard deviations and this share of its way, of
a hinge's way at most a radian."""
DEPARTED = 4.0
"""Rest limits by which a joint has surely departed; constant acceleration takes twice as long as to one."""
LEAST_REST = 3
"""Frames by which a rest must be longer than free motion explains."""

OUT_OF_LEVEL = 0.1
"""Angle off its lowest place at which a mechanism still hangs: a camera held by hand is out of level by less,
about twice the standard deviation of its roll [rad]."""
BY = 1e-3
"""Step of the joints by which that is found [rad or m]."""
PARTS = 4
"""Parts of a clip that are divided among the cores."""


class FreeSpan(NamedTuple):
    """Where the mechanism moves freely.

    Attributes:
        first: Number of the first such frame.
        stop: Number of the frame after the last one.
        notes: Sentences for the user; none where that is the whole clip.
        hanging: Number of frames before the first one in which it hangs at rest, though nothing holds it.
    """

    first: int
    stop: int
    notes: tuple[str, ...]
    hanging: int = 0


def free_span(masks: Masks, scene: Scene, poses: Poses) -> FreeSpan:
    """Find the stretch of the clip in which nothing holds or touches the mechanism.

    Args:
        masks: The masks of the clip.
        scene: The mechanism before the camera.
        poses: Its tracked poses.

    Returns:
        The stretch: the longest one between two touches, after any rest at its begin; the user's own as it
        is.
    """
    samples, count = masks.samples, len(poses)
    first, stop = (0, count) if samples.span is None else samples.span
    # frames that did not decode at the end of the clip have no row
    span = (min(first, count), min(stop, count))
    if samples.given or samples.thumbnails is None:
        return FreeSpan(*span, ())
    rows = samples.thumbnails.number
    touched = np.zeros(max(count, int(rows.max(initial=0)) + 1), dtype=bool)
    sampled = np.isin(rows, [frame.index for frame in samples.frames])
    touched[rows] = touching(samples.thumbnails, sampled, scene, poses)
    touched = _lasting(touched[:count], poses.time)
    first, stop = longest_free(touched, poses.seen, span, jumps(poses.time))
    begin = released(poses, first, stop, slides=scene.mechanism.slides)
    hanging = _hung(scene.mechanism, poses, first, begin)
    free = FreeSpan(begin, stop, (), hanging * (begin - first))
    return free._replace(notes=tuple(_notes(poses, span, first, free, touched=bool(touched.any()))))


def _hung(mechanism: Mechanism, poses: Poses, first: int, begin: int) -> bool:
    """Return whether the mechanism hangs in the rows of a rest: what sets it in motion then is none of what
    held it."""
    rows = first + np.flatnonzero(poses.seen[first:begin])
    return len(rows) > 0 and hangs(mechanism, np.median(poses.position[rows], axis=0))


def hangs(mechanism: Mechanism, position: np.ndarray) -> bool:
    """Return whether a mechanism at rest stays where it is without being held: its energy of height and
    springs is least there, but for a camera that may be out of level.

    Args:
        mechanism: The mechanism, its masses those of its sizes.
        position: Joint positions [rad or m], (dof,).
    """
    dofs = len(position)
    around = np.concatenate([[position], *(position + sign * BY * np.eye(dofs) for sign in (1.0, -1.0))])
    height = energy(mechanism.tree, around, np.zeros_like(around))
    up, down = height[1 : dofs + 1], height[dofs + 1 :]
    slope, bend = (up - down) / (2.0 * BY), (up - 2.0 * height[0] + down) / BY**2
    # a level slide has neither
    least = 1e-6 * float(np.abs(bend).max(initial=0.0))
    return bool(np.all(bend >= -least) and np.all(np.abs(slope) <= OUT_OF_LEVEL * bend + least))


def span_of_poses(poses: Poses, mechanism: Mechanism, given: tuple[float, float | None] | None) -> FreeSpan:
    """Find the stretch in which the mechanism moves freely from its poses alone.

    Args:
        poses: The poses of a whole clip.
        mechanism: The mechanism.
        given: Begin and end that the user gave [s]; None finds the end of a rest at the begin.

    Returns:
        The stretch; the user's own as it is.
    """
    whole = (int(poses.frame[0]), int(poses.frame[-1]) + 1)
    if given is not None:
        first, stop = frames_between(poses.time, given)
        return FreeSpan(int(poses.frame[first]), int(poses.frame[stop - 1]) + 1, ())
    untouched = np.zeros(len(poses), dtype=bool)
    begin, stop = longest_free(untouched, poses.seen, (0, len(poses)), jumps(poses.time))
    row = released(poses, begin, stop, slides=mechanism.slides)
    held = int(poses.frame[begin])
    first = int(poses.frame[min(row, len(poses) - 1)])
    hanging = _hung(mechanism, poses, begin, row) * (first - held)
    free = FreeSpan(first, int(poses.frame[stop - 1]) + 1, (), hanging)
    return free._replace(notes=tuple(_notes(poses, whole, held, free, touched=False)))


def blanked(poses: Poses, span: FreeSpan) -> Poses:
    """Return poses of which those outside of a stretch are not seen.

    Args:
        poses: Poses of a whole clip.
        span: The stretch.
    """
    outside = (poses.frame < span.first - span.hanging) | (poses.frame >= span.stop)
    position, covariance = poses.position.copy(), poses.covariance.copy()
    position[outside], covariance[outside] = np.nan, np.nan
    joint_seen = None if poses.joint_seen is None else poses.joint_seen & ~outside[:, np.newaxis]
    return replace(
        poses, position=position, covariance=covariance, seen=poses.seen & ~outside, joint_seen=joint_seen
    )


def touching(thumbnails: Thumbnails, sampled: np.ndarray, scene: Scene, poses: Poses) -> np.ndarray:
    """Return in which frames something other than the mechanism lies against it in the picture.

    Args:
        thumbnails: Frames of the clip.
        sampled: True for frames at equal steps of the motion, which show what is usual, bool (frame,).
        scene: The mechanism before the camera.
        poses: Its poses in all frames of the clip.

    Returns:
        True where it is touched, bool (frame,).
    """
    still, shape = still_cells(thumbnails, scene.masks.background), thumbnails.planes.shape[2:]
    parts = np.array_split(thumbnails.planes, PARTS)
    areas = on_all_cores(lambda part: changed_area(part, still), parts)
    area = np.concatenate(areas).astype(np.float64)
    own = float(np.median([_drawn(scene, q, shape).sum() for q in scene.key_positions[::4]]))
    # only a frame with more foreground than usual can show a hand; a pose gone astray adds none
    more = _beyond(area, sampled, own) & (area < MOST_CHANGED * np.count_nonzero(still.inside))
    if not np.any(more):
        return more
    against = np.full(len(area), np.nan)
    for row in np.flatnonzero(more | sampled):
        number = int(thumbnails.number[row])
        if poses.seen[number]:
            foreground = changed(thumbnails.planes[row], still)
            against[row] = _against(foreground, _drawn(scene, poses.position[number], shape))
    usual = sampled & np.isfinite(against)
    # where the mechanism was not found there is nothing to touch, and no free motion either
    return more & (np.isnan(against) | _beyond(np.nan_to_num(against), usual, own))


def longest_free(
    touched: np.ndarray, seen: np.ndarray, span: tuple[int, int], broken: np.ndarray | Sequence[int] = ()
) -> tuple[int, int]:
    """Return the stretch between two touches or jumps of the time with the most seen frames.

    Args:
        touched: True where something touches the mechanism, bool (frame,).
        seen: True where it was seen, bool (frame,).
        span: First frame and the one after the last that may belong to it.
        broken: Frames before which the time jumps, int (frame,).

    Returns:
        First frame of the stretch, and the one after its last.
    """
    blocked = touched.copy()
    blocked[: span[0]] = blocked[span[1] :] = True
    ends = np.flatnonzero(np.diff(np.concatenate([[True], blocked, [True]]).astype(np.int8)))
    # a jump between two free frames ends one stretch and begins another
    inner = [row for row in broken if 0 < row < len(blocked) and not blocked[row - 1] and not blocked[row]]
    stretches = np.sort(np.concatenate([ends, inner, inner])).astype(int).reshape(-1, 2)
    if not len(stretches):
        return span
    first, stop = max(stretches, key=lambda ends: int(np.sum(seen[ends[0] : ends[1]])))
    return int(first), int(stop)


def released(poses: Poses, first: int, stop: int, *, slides: np.ndarray | None = None) -> int:
    """Return the frame in which a mechanism that is held at rest begins to move.

    With constant acceleration from the release at t, a joint departs by one limit after sqrt(2 / a) and by
    ``DEPARTED`` limits after twice that. A free mechanism that turns back rests as long before t as after it;
    one that rests longer is held.

    Args:
        poses: The tracked poses.
        first: First frame of the stretch.
        stop: The frame after its last.
        slides: True for slides, whose positions have no scale of their own, (dof,); None for hinges alone.

    Returns:
        Number of the frame; ``first`` where nothing was held.
    """
    rows = first + np.flatnonzero(poses.seen[first:stop])
    if len(rows) < 2 * LEAST_REST:
        return first
    q = poses.position[rows]
    variance = np.median(np.diagonal(poses.covariance[rows], axis1=1, axis2=2), axis=0)
    way = np.ptp(q, axis=0)
    share = np.minimum(1.0, way) if slides is None else np.where(slides, way, np.minimum(1.0, way))
    limit = REST_STDS * np.sqrt(variance) + REST_FLOOR * share
    rest = np.median(q[: 2 * LEAST_REST], axis=0)
    departure = np.max(np.abs(q - rest) / limit, axis=1)
    gone = np.flatnonzero(departure > DEPARTED)
    if not len(gone) or departure[0] > 1.0:
        return first
    resting = np.flatnonzero(departure[: gone[0]] <= 1.0)[-1]
    dwell = gone[0] - resting
    begin = resting - dwell
    if begin <= dwell + LEAST_REST:
        return first
    return int(rows[begin]) + 1


def _beyond(values: np.ndarray, usual: np.ndarray, own: float) -> np.ndarray:
    """Return which areas exceed the usual ones, by their spread and by the mechanism's own area."""
    middle = float(np.median(values[usual])) if np.any(usual) else 0.0
    spread = 1.4826 * float(np.median(np.abs(values[usual] - middle))) if np.any(usual) else 0.0
    return values > middle + max(LEAST_EXCESS * own, SPREADS * spread)


def _drawn(scene: Scene, position: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return the cells of a thumbnail that the mechanism covers, uint8 (height, width)."""
    import cv2

    camera = scene.camera
    scale = np.array([shape[1] / camera.width, shape[0] / camera.height])
    picture = np.zeros(shape, np.uint8)
    for _, polygon in outline(scene.mechanism, camera, position):
        corners = (polygon + 0.5) * scale - 0.5
        cv2.fillPoly(picture, [np.round(corners * 16.0).astype(np.int32)], 1, cv2.LINE_8, 4)
    return picture


def _against(foreground: np.ndarray, drawn: np.ndarray) -> float:
    """Return the area of the foreground beyond the mechanism that hangs together with it [cells]."""
    import cv2

    cell = np.ones((3, 3), np.uint8)
    # an edge between two cells shows in both
    near = cv2.dilate(drawn, cell)
    beyond = (foreground & (near == 0)).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(beyond, connectivity=8)
    met = np.unique(labels[(cv2.dilate(near, cell) > 0) & (beyond > 0)])
    return float(stats[met[met > 0], cv2.CC_STAT_AREA].sum())


def _lasting(touched: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Close short gaps between touches, then leave out short touches."""
    short = max(1, round(GAP_SECONDS / usual_step(time)))
    return ~_without_short(~_without_short(touched, short, value=False), short, value=False)


def _without_short(states: np.ndarray, short: int, *, value: bool) -> np.ndarray:
    """Turn inner stretches of ``value`` of at most ``short`` frames into the other state."""
    out = states.copy()
    edges = [0, *(np.flatnonzero(np.diff(states.astype(np.int8))) + 1), len(states)]
    for first, stop in pairwise(edges[1:-1]):
        if states[first] == value and stop - first <= short:
            out[first:stop] = not value
    return out


def _notes(poses: Poses, shown: tuple[int, int], first: int, free: FreeSpan, *, touched: bool) -> list[str]:
    """Write the sentences about the frames that do not count.

    ``first`` is where the free stretch begins with a rest at its begin, ``touched`` whether any frame was
    left out for what lies against the mechanism.
    """
    notes = []
    if shown != (int(poses.frame[0]), int(poses.frame[-1]) + 1):
        notes.append(
            f"The scene shows in frames {shown[0]}:{shown[1]} only; the clip fades there, or shows something "
            "else at first or in the end."
        )
    if free.hanging:
        notes.append(
            f"The mechanism hardly moves before frame {free.first}, near where it hangs; the fit begins "
            "there unless --fit-frames A:B says otherwise."
        )
    why = ["it hardly moves before, and may be held"] if free.first - free.hanging > first else []
    if (first, free.stop) != shown:
        beside = ["more than usual stands out beside it in other frames, which may touch it"] * touched
        why += [*beside, *["the time jumps"] * (len(jumps(poses.time)) > 0)]
    if why:
        rows = np.searchsorted(poses.frame, [free.first, free.stop])
        begin, end = (float(poses.time[row]) for row in (rows[0], rows[1] - 1))
        notes.append(
            f"The motion of the mechanism is taken to be free in frames {free.first}:{free.stop}, "
            f"{begin:.3f} to {end:.3f} s: {'; '.join(why)} (--time-range A:B [s] gives another range)."
        )
    return notes
