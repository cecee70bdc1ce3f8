"""From tracked points and topology to the scene: camera, sizes up to one common scale, and poses.

Geometry gives the first poses and sizes; a robust refinement over all frames fits camera, sizes, places of
marks and poses; every frame is then fitted from several starts, names that were exchanged are put right, and
the refinement is repeated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monodyn.errors import MechanismError, VideoError
from monodyn.mechanism import Mechanism
from monodyn.mechanism.tree import HINGE
from monodyn.names import quoted
from monodyn.vision.points.adjust import OUTSIDE, Adjustment, Fitted, Seen, refine, weights
from monodyn.vision.points.begin import rigid_marks
from monodyn.vision.points.found import scene_of
from monodyn.vision.points.marks import SCENE, Mark, marks_of
from monodyn.vision.points.oblique import Looking, looking
from monodyn.vision.points.poses import combined, named_rightly
from monodyn.vision.points.rest import Named, at_rest, own_points
from monodyn.vision.points.scene import PointScene
from monodyn.vision.points.shown import (
    SHIFT_PX,
    mean_length,
    pose_slopes,
    project,
)
from monodyn.vision.points.start import SoughtPoints, named
from monodyn.vision.points.tracks import PointTracks

JITTER_ROUNDS = 4
"""Times that the shift from frame to frame is estimated anew."""
FEW_ROUNDS = 6
"""Steps of a refinement that is repeated."""
LEAST_SEEN = 5
"""Frames in which the joints must be shown."""
ANYWHERE, SHORT = np.pi, 3.0
"""Standard deviation of a hinge [rad] and of a slide [mean lengths] that nothing shows."""


def locate_points(sought: SoughtPoints) -> PointScene:
    """Find camera, sizes and poses from tracked points.

    Args:
        sought: The points, the mechanism, and what is known of the camera.

    Returns:
        The scene.
    """
    mechanism, tracks = sought.mechanism, sought.tracks
    marks = tuple(marks_of(mechanism, tracks.names, sought.mapped))
    own = tuple(mark for mark in marks if mark.kind != SCENE)
    check_shown(own, mechanism, own_points(tracks, marks), tracks)
    sought.progress("locate", 0, 2)
    found = at_rest(tracks, marks, mechanism, lambda seen, moving: _named(sought, own, seen, moving=moving))
    looks = looking(sought, found)
    if looks.clear:
        found = _named_again(found, looks, told_apart=tracks.told_apart)
    sought.progress("locate", 1, 2)
    kept = inside(found.adjustment, found.fitted, found.seen)
    fitted = refine(found.adjustment, found.fitted, kept, robust=False)
    sought.progress("locate", 2, 2)
    return scene_of(sought, marks, replace(found, fitted=fitted), kept, looks)


def _named(sought: SoughtPoints, marks: tuple[Mark, ...], seen: Seen, *, moving: bool) -> Named:
    """Refine from the begin by geometry, and put names right."""
    start, (adjustment, fitted), always = named(sought, marks, seen, moving=moving)
    renamed, exchanges = start, always
    for _ in range(2):
        # better sizes show better which names were exchanged
        renamed, position, found = named_rightly(
            adjustment, fitted, start, told_apart=sought.tracks.told_apart
        )
        exchanges = combined([*always, *found])
        adjustment, fitted = _settled(adjustment, replace(fitted, position=position), renamed)
    return Named(adjustment, fitted, renamed, tuple(exchanges))


def _named_again(found: Named, looks: Looking, *, told_apart: bool) -> Named:
    """Refine before a camera that is turned, and put names right once more: before one that looks squarely
    other names may have explained the points better."""
    renamed, position, more = named_rightly(looks.doubted, looks.away, found.seen, told_apart=told_apart)
    adjustment, fitted = _settled(looks.doubted, replace(looks.away, position=position), renamed)
    exchanges = tuple(combined([*found.exchanges, *more]))
    return replace(found, adjustment=adjustment, fitted=fitted, seen=renamed, exchanges=exchanges)


def check_shown(marks: Sequence[Mark], mechanism: Mechanism, seen: Seen, tracks: PointTracks) -> None:
    """Refuse points that cannot show the joints.

    Args:
        marks: The marks of the mechanism.
        mechanism: The mechanism.
        seen: Their points.
        tracks: The table, for the message.

    Raises:
        MechanismError: there are too few points for a joint.
        VideoError: a point is never found, or too few frames show the joints.
    """
    empty = [m.track for i, m in enumerate(marks) if not (seen.weight[:, i] > 0.0).any()]
    if empty:
        raise VideoError(
            f"{tracks.path.name}: expected places of point '{empty[0]}' with a likelihood above 0, got none "
            f"in {len(tracks)} frames; leave it out with --points.map {empty[0]}=none."
        )
    lacking = [
        mechanism.joints[i].name for i in range(len(mechanism.joints)) if not _directed(marks, mechanism, i)
    ]
    if lacking:
        raise MechanismError(
            f"points: expected a point for each joint that its body moves, got none for "
            f"{quoted(lacking)}; track the "
            "far end of that body, its next joint or a site on it."
        )
    most = int(np.max(np.sum(seen.weight > 0.0, axis=0), initial=0))
    if most < LEAST_SEEN:
        raise VideoError(
            f"{tracks.path.name}: expected points in at least {LEAST_SEEN} frames, got {most}; track more "
            "frames."
        )


def _directed(marks: Sequence[Mark], mechanism: Mechanism, link: int) -> bool:
    """Return whether some mark shows where a joint stands."""
    if mechanism.joints[link].kind == "hinge":
        return bool(rigid_marks(marks, mechanism, link))
    return any(mark.link == link for mark in marks) or any(
        mechanism.tree.parent[mark.link] == link for mark in marks
    )


def _settled(adjustment: Adjustment, fitted: Fitted, seen: Seen) -> tuple[Adjustment, Fitted]:
    """Refine; where the camera moves, with its shift from frame to frame estimated along."""
    if not adjustment.jitter:
        return adjustment, refine(adjustment, fitted, seen)
    for _ in range(JITTER_ROUNDS):
        fitted = refine(adjustment, fitted, seen, rounds=FEW_ROUNDS)
        covariance = covariances(adjustment, fitted, seen)
        shifts = fitted.position[:, -2:] ** 2 + np.diagonal(covariance, axis1=1, axis2=2)[:, -2:]
        adjustment = replace(adjustment, jitter=SHIFT_PX * float(np.sqrt(np.mean(shifts))))
    return adjustment, fitted


def covariances(adjustment: Adjustment, fitted: Fitted, seen: Seen, *, robust: bool = True) -> np.ndarray:
    """Return the covariance of each frame's pose.

    Args:
        adjustment: The marks.
        fitted: Mechanism, camera and poses.
        seen: The tracked points.
        robust: True counts what lies outside for little.

    Returns:
        Covariances, (frame, dof, dof).
    """
    shown = adjustment.shown(fitted)
    base = project(shown, fitted.position)
    slopes = np.nan_to_num(pose_slopes(shown, fitted.position, base))
    weight = weights(seen, base, fitted.noise, robust=robust) / fitted.noise**2
    # before any point is seen a hinge may be anywhere, and a slide as far as the mechanism is long
    least = np.where(adjustment.hold > 0.0, adjustment.hold, 0.0)
    hinge = fitted.mechanism.tree.kind == HINGE
    least[: len(hinge)] = np.where(hinge, ANYWHERE, SHORT * mean_length(fitted.mechanism)) ** -2.0
    block = np.einsum("npci,np,npcj->nij", slopes, weight, slopes) + np.diag(least)
    return np.linalg.inv(block)


def registered(
    adjustment: Adjustment, fitted: Fitted, seen: Seen, covariance: np.ndarray, std: np.ndarray
) -> np.ndarray:
    """Add what the registration of a moving camera leaves open: it displaces all points of a frame.

    Args:
        adjustment: The marks.
        fitted: Mechanism, camera and poses.
        seen: The points that lie on their marks; the others have no weight.
        covariance: Covariance of each frame's pose by the noise of its points, (frame, dof, dof).
        std: Standard deviation of the displacement of each frame [px], (frame,); NaN where it is not known.

    Returns:
        Covariances, (frame, dof, dof).
    """
    base = project(adjustment.shown(fitted), fitted.position)
    slopes = np.nan_to_num(pose_slopes(adjustment.shown(fitted), fitted.position, base))
    weight = weights(seen, base, fitted.noise, robust=False) / fitted.noise**2
    gain = np.einsum("nij,npcj,np->nic", covariance, slopes, weight)
    # the whole displacement is stated, of which each axis has one half
    half = 0.5 * np.nan_to_num(std) ** 2
    return covariance + half[:, None, None] * np.einsum("nic,njc->nij", gain, gain)


def inside(adjustment: Adjustment, fitted: Fitted, seen: Seen) -> Seen:
    """Return the points that lie on their marks; the others have no weight.

    Args:
        adjustment: The marks.
        fitted: Mechanism, camera and poses.
        seen: The tracked points.
    """
    base = project(adjustment.shown(fitted), fitted.position)
    off = np.linalg.norm(np.nan_to_num(seen.px - base, nan=np.inf), axis=2)
    return replace(seen, weight=np.where(off <= OUTSIDE * fitted.noise, seen.weight, 0.0))
