"""What the assumptions about a film are judged by: silhouettes, drawn mechanism and background, measured.

Some numbers need no pose, so they can be had where the mechanism was not found; the others compare the drawn
mechanism with the silhouette in frames spread over the poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monodyn.paper.silhouettes import ClipSilhouettes
from monodyn.paper.threshold import OPEN, difference, holds
from monodyn.types import FULL, Frame, Poses
from monodyn.vision.clip.steady import CameraPath
from monodyn.vision.drawing.outline import covered_pixels, outline
from monodyn.vision.locating.scene import Scene

LOOKED_AT = 40
"""Frames that are measured at most, spread evenly over the poses."""
EDGE_PX, FAR_PX = 2, 16
"""Pixels this near to a drawn outline count on neither side of it, and pixels farther away than the other
belong to something else [px]."""
AROUND_PX = 4
"""Width of the band around a silhouette that is left out where the background is aligned [px]."""
WELL_DRAWN = 0.1
"""Share of its area by which the drawn mechanism may miss the silhouette, or leave it uncovered."""
UNDECIDED = 0.3
"""A pixel's difference is undecided when it is this near to the threshold, as a share of it."""
ALIKE = 0.93
"""Least correlation of two pictures of the background from which a displacement is taken."""
ALIGNED = 12
"""Sample frames that are aligned at most where there are no poses."""
ALIGNED_SIDE_PX = 360
"""Width of the reduced pictures that are aligned [px]."""


@dataclass(frozen=True)
class Outlook:
    """What the silhouettes alone show.

    Attributes:
        level: Threshold [grey levels].
        noise: Standard deviation of a pixel [grey levels].
        undecided: Pixels near the threshold, as a share of those above it.
        cut: Share of the frames in which the silhouette ends at the border of the picture.
        apart: Median share of the silhouette that does not hang together with its largest patch.
    """

    level: float
    noise: float
    undecided: float
    cut: float
    apart: float


@dataclass(frozen=True, eq=False)
class Look:
    """What was measured in a frame with a pose; areas as shares of that of the drawn mechanism.

    Attributes:
        missed: Drawn, but not in the silhouette.
        excess: In the silhouette near the drawn mechanism, but not covered by it.
        far: Different from the background far from the drawn mechanism.
        area: Area of the silhouette [px^2].
        outside: Share of the outline's corners that lie outside of the picture.
        centroids: Of the silhouette near the drawn mechanism, then of that, x and y [px], (4,).
    """

    missed: float
    excess: float
    far: float
    area: float
    outside: float
    centroids: np.ndarray


@dataclass(frozen=True, eq=False)
class Film:
    """What was measured in a film.

    Attributes:
        outlook: What the silhouettes alone show.
        seen: Share of the frames with a pose.
        looks: Frames with a pose.
        unseen: Areas of the silhouettes in frames without one [px^2].
        drift: Displacements of the background [px], in the frames that allow to measure it.
    """

    outlook: Outlook
    seen: float
    looks: tuple[Look, ...]
    unseen: tuple[float, ...]
    drift: tuple[float, ...]

    def usual(self, what: str) -> float:
        """Return the median of an attribute over the frames with a pose.

        Args:
            what: Name of the attribute.
        """
        return float(np.median([getattr(look, what) for look in self.looks])) if self.looks else np.nan

    @property
    def drawn_well(self) -> bool:
        """True where the drawn mechanism is the one in the film, so that it can serve as a measure."""
        return max(self.usual("missed"), self.usual("excess")) <= WELL_DRAWN


def measured(scene: Scene, poses: Poses, silhouettes: ClipSilhouettes) -> Film:
    """Measure a film in frames spread over the poses.

    Args:
        scene: Mechanism, camera and masks, as they were located.
        poses: The poses before that camera, slides in the scene's scale.
        silhouettes: Its silhouettes.

    Returns:
        The film: what the silhouettes alone show, and what the drawn mechanism shows.
    """
    picks = np.unique(np.linspace(0, len(poses) - 1, min(LOOKED_AT, len(poses))).round().astype(int))
    rows = {int(poses.frame[row]): row for row in picks}
    looks, unseen, still = [], [], []
    path = scene.masks.video.camera_path
    for frame in scene.masks.video.frames(min(rows), max(rows) + 1):
        row = rows.get(frame.index)
        if row is None:
            continue
        covered = np.zeros(0, dtype=bool)
        if poses.seen[row]:
            covered = covered_pixels(scene.mechanism, scene.camera, poses.position[row], margin=0.0)
        # a slide may have been followed out of the picture, where nothing can be compared
        if covered.any() and holds(silhouettes.picture(frame)):
            looks.append(_look(frame, scene, silhouettes, poses.position[row], covered))
            shown = _wider(covered, FAR_PX) | _wider(_over(frame, silhouettes), AROUND_PX)
            still.append((_reduced(frame.luma), _reduced(np.uint8(1) - shown.astype(np.uint8))))
        else:
            unseen.append(float(np.sum(silhouettes.picture(frame) == FULL)))
    return Film(
        outlook=outlook(silhouettes),
        seen=float(np.mean(poses.seen)),
        looks=tuple(looks),
        unseen=tuple(unseen),
        drift=_drift(still, scene.camera.width) if path is None else _way(path, sorted(rows)),
    )


def outlook(silhouettes: ClipSilhouettes) -> Outlook:
    """Measure the silhouettes of a clip's sample frames, without any pose.

    Args:
        silhouettes: The silhouettes.

    Returns:
        What they show.
    """
    import cv2

    background, threshold = silhouettes.masks.background, silhouettes.threshold
    top, bottom, left, right = background.window
    counts, cut, apart = np.zeros(256), [], []
    for frame in silhouettes.masks.samples.frames:
        values = difference(frame, background, colour=threshold.colour)[top:bottom, left:right]
        counts += np.bincount(values.ravel(), minlength=256)
        seen = (silhouettes.picture(frame) == FULL).astype(np.uint8)
        cut.append(bool(seen[0].any() or seen[-1].any() or seen[:, 0].any() or seen[:, -1].any()))
        # label 0 is the background; one silhouette has no area outside of its largest patch
        areas = cv2.connectedComponentsWithStats(seen, connectivity=8)[2][1:, cv2.CC_STAT_AREA]
        apart.append(1.0 - float(areas.max() / areas.sum()) if len(areas) else 0.0)
    above = float(counts[int(threshold.level) + 1 :].sum())
    near = slice(int((1.0 - UNDECIDED) * threshold.level), int((1.0 + UNDECIDED) * threshold.level) + 1)
    return Outlook(
        level=threshold.level,
        noise=background.noise,
        undecided=float(counts[near].sum()) / max(above, 1.0),
        cut=float(np.mean(cut)),
        apart=float(np.median(apart)),
    )


def background_drift(silhouettes: ClipSilhouettes) -> tuple[float, ...]:
    """Measure how far the background moves, without any pose: where nothing differs by the threshold.

    Args:
        silhouettes: The silhouettes of the clip.

    Returns:
        Displacements since the first sample frame [px], in those that allow to measure it.
    """
    frames, path = silhouettes.masks.samples.frames, silhouettes.masks.video.camera_path
    if path is not None:
        return _way(path, [frame.index for frame in frames])
    still = []
    for frame in frames[:: -(-len(frames) // ALIGNED)]:
        over = _wider(_over(frame, silhouettes), AROUND_PX)
        still.append((_reduced(frame.luma), _reduced(np.uint8(1) - over.astype(np.uint8))))
    return _drift(still, silhouettes.masks.video.width)


def _look(
    frame: Frame, scene: Scene, silhouettes: ClipSilhouettes, position: np.ndarray, covered: np.ndarray
) -> Look:
    """Compare the drawn mechanism with a frame."""
    picture, known = silhouettes.picture(frame), scene.masks.background.known
    seen = picture == FULL
    inner, outer = ~_wider(~covered, EDGE_PX) & known, _wider(covered, EDGE_PX)
    near, over = _wider(covered, FAR_PX), _over(frame, silhouettes)
    area = max(float(covered.sum()), 1.0)
    corners = np.concatenate([polygon for _, polygon in outline(scene.mechanism, scene.camera, position)])
    size = np.array([frame.luma.shape[1], frame.luma.shape[0]])
    beyond = np.any((corners < -0.5) | (corners > size - 0.5), axis=1)
    return Look(
        missed=float(np.sum(inner & ~seen & (picture != OPEN))) / area,
        excess=float(np.sum(seen & known & near & ~outer)) / area,
        far=float(np.sum(over & ~near)) / area,
        area=float(seen.sum()),
        outside=float(beyond.mean()),
        centroids=np.append(_centroid(seen & near), _centroid(covered & (picture != OPEN))),
    )


def _centroid(where: np.ndarray) -> np.ndarray:
    """Return the centroid of an area, x and y [px], (2,); the picture's corner where it is empty."""
    return np.argwhere(where).mean(axis=0)[::-1] if where.any() else np.zeros(2)


def _over(frame: Frame, silhouettes: ClipSilhouettes) -> np.ndarray:
    """Return the pixels above the threshold, small patches too, bool (height, width)."""
    background, threshold = silhouettes.masks.background, silhouettes.threshold
    return (difference(frame, background, colour=threshold.colour) > threshold.level) & background.known


def _drift(still: list[tuple[np.ndarray, np.ndarray]], width: int) -> tuple[float, ...]:
    """Return by how far the background has moved since the first frame [px], where the pictures are alike.

    The pictures are aligned by the rigid motion of greatest correlation, the mechanism left out.
    """
    import cv2

    found = []
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 50, 1e-5)
    for picture, free in still[1:]:
        first, first_free = still[0]
        height, wide = first.shape
        try:
            alike, moved = cv2.findTransformECC(
                first, picture, np.eye(2, 3, dtype=np.float32), cv2.MOTION_EUCLIDEAN, stop,
                np.bitwise_and(first_free, free), 5,
            )  # fmt: skip
        except cv2.error:
            # it ends so where nothing can be aligned: an even wall, or a picture all of whose parts move
            continue
        if alike >= ALIKE:
            corners = np.array([[0, wide, 0, wide], [0, 0, height, height], [1, 1, 1, 1]], dtype=float)
            apart = np.linalg.norm(np.asarray(moved) @ corners - corners[:2], axis=0)
            found.append(float(apart.mean()) * width / wide)
    return tuple(found)


def _way(path: CameraPath, frames: Sequence[int]) -> tuple[float, ...]:
    """Return by how far a camera that moves displaces the scene since the first of some frames [px]."""
    places = [at for frame in frames if (at := path.at(frame)) is not None]
    return tuple(at.apart(places[0]) for at in places[1:])


def _reduced(picture: np.ndarray) -> np.ndarray:
    """Return a picture at about ``ALIGNED_SIDE_PX``; the shift of its content is measured to a fraction."""
    import cv2

    factor = max(1, round(picture.shape[1] / ALIGNED_SIDE_PX))
    size = (picture.shape[1] // factor, picture.shape[0] // factor)
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def _wider(covered: np.ndarray, by: int) -> np.ndarray:
    """Return an area with a band around it, bool (height, width)."""
    import cv2

    return cv2.dilate(covered.astype(np.uint8), np.ones((2 * by + 1, 2 * by + 1), np.uint8)) > 0
