"""Foreground of a clip and a mechanism of which only dots can be seen in, points by name out.

Each mask falls into spots; spots go on from frame to frame as long as that is clear; which dot each of them
is follows from the mechanism: in the right names every body keeps its length, and the pivot its place.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from monodyn.errors import MechanismError, VideoError
from monodyn.mechanism import Mechanism
from monodyn.mechanism.dots import dots_of
from monodyn.types import Progress
from monodyn.vision.dots.begin import LEAST_ROWS, guesses, seen_in
from monodyn.vision.dots.names import NONE, named_best
from monodyn.vision.dots.spots import Spots, spots_of
from monodyn.vision.dots.tracklets import Tracklet, tracklets_of
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.points.marks import marks_of
from monodyn.vision.points.start import SoughtPoints
from monodyn.vision.points.tracks import PointTracks

SPECK = 0.15
"""Area of a spot over that of the smallest dot below which it is dirt or noise."""
OTHERS = 0.05
"""Share of the spots that are no dots from which there is a note."""
MOST_DOTS = 6
"""Dots that can be told apart at most."""


def find_dots(
    masks: Masks,
    mechanism: Mechanism,
    *,
    focal: float = 0.0,
    fix: Mapping[str, float] | None = None,
    progress: Progress | None = None,
) -> PointTracks:
    """Find equal dots in a clip and tell them apart by the motion.

    Args:
        masks: The foreground of the clip.
        mechanism: The mechanism; all of it that can be seen are dots.
        focal: Focal length [px]; 0 takes the picture's longer side.
        fix: Values of ``camera.*`` parameters that are known.
        progress: Called with the number of frames done.

    Returns:
        The dots by name, in place of points that another tool tracked.

    Raises:
        MechanismError: the mechanism shows more than dots, or more dots than can be told apart.
        VideoError: too few things move at once.
    """
    dots, video = dots_of(mechanism), masks.video
    if not 1 <= len(dots) <= MOST_DOTS:
        raise MechanismError(
            f"mechanism '{mechanism.name}': expected 1 to {MOST_DOTS} dots (balls or sites) and nothing else "
            f"that can be seen, got {len(dots)}; locate it by its outline, or track its points."
        )
    names = tuple(dot.name for dot in dots)
    report = progress or (lambda step, done, total: None)
    spots = spots_of(masks, report)
    tracklets = tracklets_of(_without_specks(spots, len(dots)), float(max(video.width, video.height)))
    empty = np.zeros((len(spots.frame), len(dots)))
    tracks = PointTracks(
        video.path, names, spots.frame, spots.time, empty[..., np.newaxis] + np.full(2, np.nan), empty,
        video.width, video.height, told_apart=True, clip=video,
    )  # fmt: skip
    marks = tuple(marks_of(mechanism, names))
    sought = SoughtPoints(tracks, mechanism, focal, fix or {}, (), {}, report)
    begun = guesses(sought, marks, tracklets)
    if not begun:
        raise VideoError(
            f"clip '{video.path}': expected {len(dots)} dots that move, all of them in the picture for "
            f"{LEAST_ROWS} frames or more, got {_at_once(tracklets)} at once; diagnosis.png shows what moves."
            " Where they hardly stand out, a lower --segment.contrast may help."
        )
    naming = named_best(begun, tracklets)
    return _tracks(tracks, tracklets, naming.names)


def _without_specks(spots: Spots, count: int) -> Spots:
    """Return the spots without those much smaller than the dots are."""
    areas = spots.most(count)
    return spots.of(spots.area >= SPECK * float(np.median(areas))) if len(areas) else spots


def _at_once(tracklets: Sequence[Tracklet]) -> int:
    """Return how many things move at once in as many frames as count."""
    rows = np.concatenate([t.row for t in tracklets]) if tracklets else np.zeros(0, dtype=np.int64)
    counts = np.sort(np.bincount(rows))[::-1] if len(rows) else np.zeros(0, dtype=np.int64)
    return int(counts[min(LEAST_ROWS, len(counts)) - 1]) if len(counts) else 0


def _tracks(tracks: PointTracks, tracklets: Sequence[Tracklet], names: np.ndarray) -> PointTracks:
    """Return the points of the dots, with a note on what moves in addition."""
    px, rows = tracks.px.copy(), np.arange(len(tracks))
    for tracklet, name in zip(tracklets, names, strict=True):
        if name != NONE:
            own = seen_in([tracklet], rows).px[:, 0]
            here = np.isfinite(own[:, 0])
            px[here, name] = own[here]
    likelihood = np.isfinite(px[..., 0]).astype(np.float64)
    others = sum(len(t.row) for t, name in zip(tracklets, names, strict=True) if name == NONE)
    share = others / max(1, sum(len(t.row) for t in tracklets))
    notes = (f"{share:.0%} of the spots that move are none of the dots.",) if share >= OTHERS else ()
    return replace(tracks, px=px, likelihood=likelihood, notes=notes)
