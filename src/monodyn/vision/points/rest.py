"""Tracked points in, points by their right names as a camera at rest shows them out.

Points that should stand still show how the camera moves. A pivot that has exchanged its name with a point
that moves would show the same: names are put right as before a camera at rest first, and what still moves
then is the camera.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.vision.points.adjust import Adjustment, Fitted, Seen, cost
from monodyn.vision.points.drift import Drift, drift_of
from monodyn.vision.points.marks import JOINT, SCENE, Mark
from monodyn.vision.points.poses import Exchange, combined
from monodyn.vision.points.shown import project
from monodyn.vision.points.tracks import PointTracks

CALM = 0.5
"""Motion of a point that stands still before a moving camera, over that of the others, at most."""
BETTER = 0.5
"""Share of the cost that a moving camera must leave where exchanged names explain the points, too."""


@dataclass(frozen=True, eq=False)
class Named:
    """Points by their right names, and the poses that they show.

    Attributes:
        adjustment: The marks, and what is refined.
        fitted: Mechanism, camera and poses.
        seen: The points by their right names, as a camera at rest shows them.
        exchanges: Names that were exchanged.
        drift: How the camera moved, or None.
    """

    adjustment: Adjustment
    fitted: Fitted
    seen: Seen
    exchanges: tuple[Exchange, ...] = ()
    drift: Drift | None = None


Solve = Callable[[Seen, bool], Named]
"""Puts names right and finds poses from points and whether the camera moves."""


def at_rest(tracks: PointTracks, marks: tuple[Mark, ...], mechanism: Mechanism, solve: Solve) -> Named:
    """Find how the camera moved, and what the points show without that.

    Args:
        tracks: The table.
        marks: What its points are.
        mechanism: The mechanism.
        solve: Puts names right and finds poses.

    Returns:
        What explains the points best; a camera at rest where no point shows that it moves.
    """
    seen = own_points(tracks, marks)
    drift = camera_motion(tracks, marks, mechanism, seen)
    still = solve(seen, False)
    if drift is None:
        return still
    moving = _moving(seen, drift, solve)
    if not still.exchanges:
        return moving
    later = camera_motion(tracks, marks, mechanism, still.seen)
    renamed = still
    if later is not None:
        renamed = _moving(still.seen, later, solve)
        renamed = replace(renamed, exchanges=tuple(combined([*still.exchanges, *renamed.exchanges])))
    # one noise for all: where the camera moves, its shift follows the pivot, which then shows none of its own
    noise = float(np.median([moving.fitted.noise, renamed.fitted.noise]))
    return moving if _unexplained(moving, noise) < BETTER * _unexplained(renamed, noise) else renamed


def own_points(tracks: PointTracks, marks: tuple[Mark, ...]) -> Seen:
    """Return the points of the marks that are no points of the scene.

    Args:
        tracks: The table.
        marks: What its points are.
    """
    own = [tracks.names.index(mark.track) for mark in marks if mark.kind != SCENE]
    found = tracks.found[:, own]
    return Seen(
        np.where(found[..., None], tracks.px[:, own], np.nan), np.where(found, tracks.likelihood[:, own], 0.0)
    )


def camera_motion(
    tracks: PointTracks, marks: tuple[Mark, ...], mechanism: Mechanism, seen: Seen
) -> Drift | None:
    """Find how the camera moved by the points that should stand still.

    Args:
        tracks: The table.
        marks: What its points are.
        mechanism: The mechanism.
        seen: The points of the mechanism, by their right names.

    Returns:
        Its motion; None where it stands still, or no point shows it.
    """
    own = [mark for mark in marks if mark.kind != SCENE]
    scene = [tracks.names.index(mark.track) for mark in marks if mark.kind == SCENE]
    pivots = [
        row for row, mark in enumerate(own)
        if mark.kind == JOINT and mechanism.tree.parent[mark.link] < 0
        and mechanism.joints[mark.link].kind == "hinge"
    ]  # fmt: skip
    # the first of them shows the shift: the pivot is as far away as the mechanism, the background is not
    background = np.where(tracks.found[:, scene, None], tracks.px[:, scene], np.nan)
    still = np.concatenate([seen.px[:, pivots], background], axis=1)
    if not still.shape[1] or _unrest(still) >= CALM * _unrest(np.concatenate([still, seen.px], axis=1)):
        return None
    return drift_of(still, tracks.width)


def _unrest(px: np.ndarray) -> float:
    """Return how far the most moving of some points (frame, point, 2) typically is from its usual place."""
    most = 0.0
    for point in range(px.shape[1]):
        known = px[np.isfinite(px[:, point]).all(axis=1), point]
        if len(known):
            away = np.linalg.norm(known - np.median(known, axis=0), axis=1)
            most = max(most, float(np.median(away)))
    return most


def _moving(seen: Seen, drift: Drift, solve: Solve) -> Named:
    """Return what points show that a moving camera saw."""
    return replace(solve(replace(seen, px=drift.removed(seen.px)), True), drift=drift)


def _unexplained(named: Named, noise: float) -> float:
    """Return the robust cost of all points at a noise [px]."""
    position = named.fitted.position
    base = project(named.adjustment.shown(named.fitted), position)
    away = cost(named.seen, base, np.full(base.shape[1], noise))
    return float(np.sum(away) + 0.5 * np.sum(named.adjustment.hold * position**2))
