"""What the refinement on tracked points found: the scene in the scale of the file, and sentences about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.mechanism.parts import PLACE_KINDS
from monodyn.types import Camera
from monodyn.vision.drawing.camera import PARAMETERS, with_values
from monodyn.vision.drawing.rig import SIZE_KINDS
from monodyn.vision.locating.advice import vague_from
from monodyn.vision.locating.knowledge import size_information
from monodyn.vision.locating.unit import growth
from monodyn.vision.points.adjust import Adjustment, Fitted, Seen
from monodyn.vision.points.drift import Drift
from monodyn.vision.points.marks import Mark
from monodyn.vision.points.oblique import Looking
from monodyn.vision.points.poses import MOST_PAIRS, Exchange
from monodyn.vision.points.rest import Named
from monodyn.vision.points.scene import PointScene
from monodyn.vision.points.shown import (
    project,
    shown_by,
)
from monodyn.vision.points.start import SoughtPoints
from monodyn.vision.points.tracks import PointTracks


def scene_of(
    sought: SoughtPoints, marks: tuple[Mark, ...], found: Named, kept: Seen, looks: Looking
) -> PointScene:
    """Collect the result in the scale of the file, and what the points know of the sizes.

    Args:
        sought: What was to be located.
        marks: What the points are, those of the scene included.
        found: Points by their right names, what was refined, and where it ended.
        kept: The points that lie on their marks; the others have no weight.
        looks: How the camera looks at the plane.

    Returns:
        The scene.
    """
    adjustment, fitted = found.adjustment, found.fitted
    names, file = adjustment.variables.names, sought.mechanism
    sizes = [p.name for p in file.parameters if p.kind in SIZE_KINDS and p.name in sought.pinned]
    scale_free = "camera.depth" in names and not any(_moves(adjustment, name) for name in sizes)
    if scale_free:
        fitted = _in_file_scale(fitted, file)
        looks = replace(looks, away=_in_file_scale(looks.away, file))
    bundle = adjustment.bundle(fitted)
    unseen = unseen_sizes(file, names, sought.pinned)
    measured = size_information(bundle, scale_free=scale_free)
    std = looks.camera_std(adjustment, fitted, scale_free=scale_free)
    doubted = adjustment if looks.clear else looks.doubted
    off = np.zeros(len(doubted.read(fitted))) if looks.clear else looks.off(fitted)
    base = project(adjustment.shown(fitted), fitted.position)
    squares = np.sum((kept.px - base) ** 2, axis=2)
    lying = kept.weight > 0.0
    outside = 1.0 - float(lying.sum()) / max(int(np.sum(found.seen.weight > 0.0)), 1)
    mechanism = _in_proportion(fitted.mechanism, file, unseen)
    fitted = replace(fitted, mechanism=mechanism)
    return PointScene(
        mechanism=mechanism.with_measured(measured),
        camera=with_values(fitted.camera, dict(sought.fix)),
        tracks=sought.tracks,
        marks=marks,
        adjustment=adjustment,
        doubted=doubted,
        off=off,
        fitted=fitted,
        drift=found.drift,
        seen=found.seen,
        lying=lying,
        camera_std={n: value for n, value in std.items() if n in PARAMETERS},
        rms_px=float(np.sqrt(np.mean(squares[lying]) / 2.0)) if lying.any() else float("nan"),
        outside=outside,
        extent_px=float(np.nanmax(np.nanmax(base, axis=(0, 1)) - np.nanmin(base, axis=(0, 1)))),
        advice=(
            *motion_notes(found.drift, sought.tracks),
            *exchange_notes(found.exchanges, adjustment.places.marks, sought.tracks),
            *pair_notes(adjustment.places.marks, sought.tracks),
            *camera_notes(fitted.camera, {n: value for n, value in std.items() if n in sought.free}),
        ),
    )


def _moves(adjustment: Adjustment, name: str) -> bool:
    """Return whether a size that is held moves a mark: then it fixes the scale."""
    places = adjustment.places
    file, own = places.start, np.zeros((len(places.free), 2))
    moved = file.with_values({name: 1.5 * file.values[name] + 1e-6})
    one, other = (shown_by(places, m, Camera(2, 2, 1.0), own) for m in (file, moved))
    return bool(
        np.abs(one.links[:, :2] - other.links[:, :2]).max() > 0.0
        or np.abs(one.place - other.place).max() > 0.0
    )


def _in_file_scale(fitted: Fitted, file: Mechanism) -> Fitted:
    """Return the same at the mean length of the file."""
    factor, camera = growth(fitted.mechanism, file), fitted.camera
    sizes = {
        p.name: p.value / factor
        for p in fitted.mechanism.parameters
        if p.kind in ("length", "offset") and not p.follows and p.free
    }
    slides = [i for i, joint in enumerate(file.joints) if joint.kind == "slide"]
    position = fitted.position.copy()
    position[:, slides] /= factor
    camera = replace(camera, x=camera.x / factor, y=camera.y / factor, depth=camera.depth / factor)
    return replace(fitted, mechanism=fitted.mechanism.with_values(sizes), camera=camera, position=position)


def unseen_sizes(file: Mechanism, names: Sequence[str], pinned: frozenset[str]) -> dict[str, str]:
    """List the sizes that no point shows, and the lengths that they keep their proportion to.

    Args:
        file: The mechanism of the file.
        names: Parameters that the points show.
        pinned: Parameters that may not change.

    Returns:
        Name of the length by that of the size.
    """
    known = file.values
    return {
        p.name: f"{p.owner}.length"
        for p in file.parameters
        if p.kind in (*SIZE_KINDS, *PLACE_KINDS) and p.kind != "length" and f"{p.owner}.length" in known
        and p.name not in names and p.name not in pinned and not p.follows
    }  # fmt: skip


def _in_proportion(mechanism: Mechanism, file: Mechanism, unseen: Mapping[str, str]) -> Mechanism:
    """Return the mechanism with the sizes that no point shows in proportion to their bodies' lengths."""
    known, start = mechanism.values, file.values
    return mechanism.with_values({n: start[n] * known[size] / start[size] for n, size in unseen.items()})


def camera_notes(camera: Camera, std: Mapping[str, float]) -> list[str]:
    """Write the sentence about freed parameters of the camera that the points hardly determine.

    Args:
        camera: The camera.
        std: Standard deviations of the refined parameters by name.

    Returns:
        The sentence; none where all are determined.
    """
    vague = [name for name, value in std.items() if value > vague_from(camera, name)]
    if not vague:
        return []
    return [
        f"The points hardly determine {', '.join(vague)}: leave out --free, or give the value with --fix."
    ]


def motion_notes(drift: Drift | None, tracks: PointTracks) -> list[str]:
    """Write the sentences about a camera that moves.

    Args:
        drift: How the points that stand still show it to move, or None.
        tracks: The points.

    Returns:
        The sentences; none for a camera that stands still.
    """
    notes = []
    if tracks.clip is not None and tracks.clip.camera_path is not None:
        notes.append(
            "No parallax is measured of dots: before this camera, which moves, they are taken to be as far "
            "away as the still scene. A mechanism that is nearer sways with the camera, which no interval "
            "contains: put the camera on a tripod."
        )
    if drift is not None:
        far, turn = float(np.hypot(*drift.shift.T).max()), float(np.degrees(np.abs(drift.turn).max()))
        turned = f" and {turn:.2f} deg" if turn > 0.0 else ""
        notes.append(
            f"The camera moves: points that stand still shift by up to {far:.1f} px{turned} from their mean "
            "place; taken out of all points (camera.csv)."
        )
    return notes


def pair_notes(marks: Sequence[Mark], tracks: PointTracks) -> list[str]:
    """Write the sentence about pairs of points of which it was not found out whether they exchanged names.

    Args:
        marks: The marks.
        tracks: The table.

    Returns:
        The sentence; none where all pairs were looked at.
    """
    left = len(marks) * (len(marks) - 1) // 2 - MOST_PAIRS
    if tracks.told_apart or left <= 0:
        return []
    return [
        f"Of {left} of {left + MOST_PAIRS} pairs of points it was not found out whether they have exchanged "
        f"names, '{marks[-2].track}' and '{marks[-1].track}' among them; leave points out with --points.map "
        "NAME=none where tracks may have."
    ]


def exchange_notes(exchanges: Sequence[Exchange], marks: Sequence[Mark], tracks: PointTracks) -> list[str]:
    """Write the sentences about tracks that have exchanged names.

    Args:
        exchanges: What was exchanged.
        marks: The marks.
        tracks: The table.

    Returns:
        One sentence for each pair of tracks.
    """
    notes = []
    for pair in dict.fromkeys(e.tracks for e in exchanges):
        first, second = (marks[row].track for row in pair)
        where = ", ".join(
            f"{int(tracks.frame[e.first])}:{int(tracks.frame[e.stop - 1]) + 1}"
            for e in exchanges
            if e.tracks == pair
        )
        notes.append(
            f"The points '{first}' and '{second}' have exchanged names in frames {where}; put right."
        )
    return notes
