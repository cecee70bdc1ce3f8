"""What a run saw of its clip as far as it came, and how well the outline lies on some of its frames.

A run fills it stage by stage, so that one that is refused can still be shown.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.errors import VideoError
from monodyn.types import FULL, Camera, Frame, Poses
from monodyn.vision.clip.steady import displaced
from monodyn.vision.clip.video import Video
from monodyn.vision.drawing.probe import LEAST_LEVEL, TRUSTED
from monodyn.vision.drawing.shown import pose_row
from monodyn.vision.drawing.shutter import SLOW_PX, way
from monodyn.vision.foreground.background import (
    CHANGED_NOISE,
    SHOWN_NOISE,
    Background,
    Samples,
    background_of,
)
from monodyn.vision.foreground.changes import apart, full_size
from monodyn.vision.foreground.masks import planes_for
from monodyn.vision.foreground.palette import TRUSTED_NOISE
from monodyn.vision.foreground.sampling import sample_frames
from monodyn.vision.foreground.thumbnails import Window
from monodyn.vision.locating.scene import as_filmed

if TYPE_CHECKING:
    from monodyn.estimation.fit import Grade
    from monodyn.mechanism import Mechanism
    from monodyn.vision.foreground.masks import Masks, View
    from monodyn.vision.locating.scene import Scene
    from monodyn.vision.points.scene import PointScene
    from monodyn.vision.points.tracks import PointTracks

JUDGED_PIXELS = 8_000_000
"""Pixels of the frames whose outline is judged, all together: bounds the time that it takes."""
LEAST_JUDGED = 12
"""Frames that are judged at least, however large they are: their median decides."""
FINER = 2
"""Rows and columns by pixel in which an outline is drawn to be compared with a mask."""
MOST_NOISE = 0.5
"""Coverage that noise alone may make, at most."""
GROWN = 0.15
"""Margin around the outlines in which a mask is compared with them, as a share of their extent."""
REACH_PX, SPACING_PX = 4.0, 3.0
"""Length of the search along the normals, and distance of the outline samples [px]: those of the tracking."""
LEAST_ALONE, LEAST_SHOWN = 0.02, 0.25
"""Share of a body's outline that the picture has to show by itself, and share of that which has to stand out
from the background, below which the picture does not show the body."""
EDGE = np.ones((3, 3), np.uint8)
"""What is so near to another body, by a pixel, may be its edge."""
CLEAR = 0.9
"""Trust from which on a colour stands out so clearly that nothing of it is overlooked: of outlines that lie
right, bars like the wall behind them showed bare wall at up to 0.8."""
MOST_DURING = 24
"""Times of an exposure, at most, at which a moving outline is drawn."""
FARTHEST_PX = 1e6
"""Distance from the picture up to which an outline is drawn [px]."""


@dataclass(frozen=True, eq=False)
class Judged:
    """One frame of the clip and the outline over it.

    Attributes:
        frame: The frame.
        position: Joint positions [rad; m in the start scale], (dof,).
        tracked: True where the frame was tracked; False for a key frame that was located alone.
        matched: Share of the outline samples on an edge.
        inside: Coverage just inside of the outline.
        mismatch: Mismatch of outline and mask as a share of the mask's area.
        beyond: What of it is of the mask, outside of the outline; the rest is of the outline, off the mask.
        alone: Of each body the area of its outline, how much of the picture it alone covers, and how much of
            that stands out from the background [px], (body, 3).
        bare_px: How far the outline reaches over bare background, away from the mask [px].
    """

    frame: Frame
    position: np.ndarray
    tracked: bool
    matched: float
    inside: float
    mismatch: float
    beyond: float = 0.0
    alone: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    bare_px: float = 0.0

    @property
    def score(self) -> float:
        """How well the outline lies on its mask, 2 at best."""
        return self.matched + self.inside


@dataclass(eq=False)
class Sight:
    """What a run saw of its clip, filled stage by stage.

    Attributes:
        video: The clip.
        masks: Its foreground, or None where none was found.
        scene: Mechanism and camera, or None where nothing was located.
        poses: The tracked clip, slides in the start scale, or None where nothing was followed.
        fit_frames: First frame of the fit and the one after its last, or None.
        free_frames: First frame in which the mechanism moves freely and the one after the last, or None.
        status: What came of it, a sentence.
        grade: How far the result can be relied on; None where nothing was to be identified.
        tracks: Points that take the place of the pictures, or None.
        points: Mechanism and camera as the points show them, or None.
        unsettled: What of scene and poses still changed when they were last found, a sentence; empty for
            nothing.
    """

    video: Video
    masks: Masks | None = None
    scene: Scene | None = None
    poses: Poses | None = None
    fit_frames: tuple[int, int] | None = None
    free_frames: tuple[int, int] | None = None
    status: str = ""
    grade: Grade | None = None
    tracks: PointTracks | None = None
    points: PointScene | None = None
    unsettled: str = ""

    @property
    def name(self) -> str:
        """Name of what was looked at: the points where these take the place of the pictures."""
        return (self.video if self.tracks is None else self.tracks).path.name

    @property
    def filmed(self) -> bool:
        """Whether there are pictures over which the mechanism can be drawn."""
        tracks = self.tracks
        if tracks is None or tracks.clip is not None:
            return True
        return tracks.in_picture and self.video.path != tracks.path

    @property
    def shown_masks(self) -> Masks | None:
        """The best masks there are: those of the scene, whose colours were measured on the mechanism."""
        return self.masks if self.scene is None else self.scene.masks

    @cached_property
    def samples(self) -> Samples:
        """Frames spread over the motion."""
        return sample_frames(self.video) if self.masks is None else self.masks.samples

    @cached_property
    def background(self) -> Background:
        """What the camera sees without the mechanism; the plain median where nothing moves."""
        masks = self.shown_masks
        return background_of(self.samples) if masks is None else masks.background

    @property
    def readable(self) -> bool:
        """Whether the clip has pictures to show, or points."""
        if self.tracks is not None:
            return True
        try:
            return len(self.samples.frames) > 0
        except VideoError:
            return False

    def followed(self, frame: Frame) -> Frame:
        """Return one of the samples as the masks show it, which follow a mechanism before a moving camera.

        Args:
            frame: The frame.
        """
        by = np.zeros(2) if self.shown_masks is None else -self.shown_masks.away(frame.index)
        return replace(frame, luma=displaced(frame.luma[np.newaxis], by)[0])

    def as_filmed(self, frame: int, outlines: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return outlines where the picture of a frame shows them as it was filmed.

        Args:
            frame: Frame number.
            outlines: Polygons before a camera at rest [px], each (point, 2).

        Returns:
            The polygons, each (point, 2); none where that is not known of the frame.
        """
        if self.points is not None and self.points.drift is not None:
            return self.points.as_filmed(frame, outlines)
        masks = self.shown_masks
        return list(outlines) if masks is None else as_filmed(masks, frame, outlines)

    @property
    def anything_tracked(self) -> bool:
        """Whether any frame was tracked."""
        return self.poses is not None and bool(np.any(self.poses.measured))

    @property
    def stage(self) -> str:
        """How far the run came where nothing was tracked, a few words."""
        if self.tracks is not None:
            return "nothing was located" if self.points is None else "no joint is shown"
        if self.masks is None:
            return "nothing moves"
        return "nothing was located" if self.scene is None else "nothing was tracked"

    @property
    def reason(self) -> str:
        """The status without the name of the clip, which whoever sees the pictures knows."""
        return re.sub(r"^clip '[^']*': ", "", self.status)

    @cached_property
    def judged(self) -> tuple[Judged, ...]:
        """The sample frames whose pose is known, in the order of time."""
        if self.scene is None:
            return ()
        scene, frames = self.scene, self.samples.frames
        size = self.video.width * self.video.height
        located = dict(zip(scene.key_frames, scene.key_positions, strict=True))
        poses = {frame.index: _pose(self.poses, frame.index) for frame in frames}
        known = [f for f in frames if poses[f.index] is not None or f.index in located]
        step = max(1, min(round(len(known) * size / JUDGED_PIXELS), len(known) // LEAST_JUDGED))
        found = []
        for frame in known[::step]:
            tracked = poses[frame.index]
            position = located[frame.index] if tracked is None else tracked
            found.append((frame, np.array(position), tracked is not None))
        around = _around(scene, [position for _, position, _ in found])
        return tuple(on_all_cores(lambda one: _judge(scene, one[0], one[1], one[2], around), found))

    @cached_property
    def hidden(self) -> np.ndarray | None:
        """Where something stands before the mechanism, bool (height, width); None where every joint was seen
        in every frame, or none."""
        scene, poses = self.scene, self.poses
        if scene is None or poses is None or poses.measured.all() or not poses.measured.any(axis=0).all():
            return None
        from monodyn.vision.drawing.rig import rig_of
        from monodyn.vision.tracking.occluders import Occluders

        rig = rig_of(scene.mechanism, scene.camera)
        view = scene.masks.view(len(rig.radius))
        occluders = Occluders(rig, view)
        first, last = (int(poses.frame[row]) for row in np.flatnonzero(poses.measured.any(axis=1))[[0, -1]])
        for frame in self.samples.frames:
            position = _between(poses, frame.index)
            # what a picture shows faintly because it moves is not hidden
            fast = scene.shutter is not None and way(scene.moving(frame.index), position) > SLOW_PX
            if first <= frame.index <= last and not fast:
                planes = planes_for(scene.masks.of(frame), view)
                occluders.note(planes, position, np.ones(len(rig.parent), dtype=bool))
        found = occluders.hidden()
        return found if found.any() else None

    @property
    def mismatch(self) -> float:
        """Median mismatch of the outline over the tracked frames, as a share of the mask's area; NaN without
        any."""
        return self._usual("mismatch")

    @property
    def beyond(self) -> float:
        """Median of what of the mismatch is outside of the outline, likewise."""
        return self._usual("beyond")

    @property
    def bare_px(self) -> float:
        """Median of how far the outline reaches over bare background [px], likewise: what stands before the
        mechanism hides it in some of the frames."""
        return self._usual("bare_px")

    def _usual(self, name: str) -> float:
        values = [getattr(judged, name) for judged in self.judged if judged.tracked]
        return float(np.median(values)) if values else float("nan")

    @property
    def unshown(self) -> list[str]:
        """The bodies of which the tracked frames show nothing: their outline lies outside of the picture, or
        behind the other bodies, or where nothing stands out."""
        tracked = [judged.alone for judged in self.judged if judged.tracked]
        if self.scene is None or not tracked:
            return []
        outline, alone, shown = np.sum(tracked, axis=0).T
        missing = (alone <= LEAST_ALONE * outline) | (shown <= LEAST_SHOWN * alone)
        return [body for body, lacks in zip(_bodies(self.scene.mechanism), missing, strict=True) if lacks]


def _bodies(mechanism: Mechanism) -> list[str]:
    """Return the names of the bodies that are drawn, each once."""
    return list(dict.fromkeys(mechanism.shapes.body))


def _pose(poses: Poses | None, frame: int) -> np.ndarray | None:
    row = pose_row(poses, frame)
    return None if poses is None or row is None else poses.position[row]


def _between(poses: Poses, frame: int) -> np.ndarray:
    """Return where the joints are in a frame, (dof,): between measured frames on a straight line."""
    seen = poses.measured
    return np.array(
        [np.interp(frame, poses.frame[s], q[s]) for s, q in zip(seen.T, poses.position.T, strict=True)]
    )


def outlines_of(
    mechanism: Mechanism, camera: Camera, position: np.ndarray, bodies: Collection[str] | None = None
) -> list[np.ndarray]:
    """Return the outlines of a pose near the picture [px], each (point, 2); none where it is not known.

    Args:
        mechanism: The mechanism.
        camera: The camera.
        position: Joint positions, (dof,); NaN where not known.
        bodies: Those that are drawn; None for all of them, and for what cannot be seen.
    """
    if not np.all(np.isfinite(position)):
        return []
    from monodyn.vision.drawing.outline import outline
    from monodyn.vision.points.sticks import sticks

    drawn = outline(mechanism, camera, position) if mechanism.plan.drawn else []
    every = [polygon for body, polygon in drawn if bodies is None or body in bodies]
    every += sticks(mechanism, camera, np.asarray(position)) if bodies is None else []
    # what is drawn beyond all whole numbers is in no picture
    return [polygon for polygon in every if np.abs(polygon).max() < FARTHEST_PX]


def _around(scene: Scene, positions: Sequence[np.ndarray]) -> Window:
    """Return the part of the picture around all outlines: what moves elsewhere is not the mechanism's."""
    outlines = [corners for q in positions for corners in outlines_of(scene.mechanism, scene.camera, q)]
    window = scene.masks.background.window
    if not outlines:
        return window
    corners = np.concatenate(outlines)
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = GROWN * float((high - low).max())
    left, top = np.maximum(low - margin, [window.left, window.top]).astype(int)
    right, bottom = np.minimum(high + margin + 1.0, [window.right, window.bottom]).astype(int)
    # outlines wholly outside of the window leave nothing to compare
    return Window(top, bottom, left, right) if left < right and top < bottom else window


def _judge(scene: Scene, frame: Frame, position: np.ndarray, tracked: bool, around: Window) -> Judged:
    """Measure how well a pose lies on the mask of its frame, as tracking does."""
    from monodyn.vision.drawing.edges import edge_terms, no_shifts

    rig = scene.moving(frame.index)
    view = scene.masks.view(len(rig.radius))
    mask = scene.masks.of(frame)
    planes = planes_for(mask, view)
    found = edge_terms(planes, view, rig, no_shifts(rig), position, REACH_PX, SPACING_PX).agreement
    during = _during(scene, frame.index, position)
    missing, more, bare_px = _mismatch(scene, frame, planes, view, during, around)
    alone = _alone(scene, planes, view, position)
    return Judged(frame, position, tracked, found.matched, found.inside, missing + more, more, alone, bare_px)


def _alone(scene: Scene, planes: np.ndarray, view: View, position: np.ndarray) -> np.ndarray:
    """Return of each body the area of its outline, how much of the picture it alone covers, but for what may
    be another one's edge, and how much of that stands out from the background [px], (body, 3)."""
    import cv2

    covered, known = planes.max(axis=0), view.trust.max(axis=0) >= TRUSTED
    whole = Window(0, covered.shape[0], 0, covered.shape[1])
    polygons = [
        outlines_of(scene.mechanism, scene.camera, position, {body}) for body in _bodies(scene.mechanism)
    ]
    areas = [sum(cv2.contourArea(one.astype(np.float32)) for one in own) for own in polygons]
    drawn = [_drawn(own, whole) for own in polygons]
    every = np.sum(drawn, axis=0, dtype=np.int32)
    others = [cv2.dilate((every - own > FULL // 2).astype(np.uint8), EDGE) for own in drawn]
    alone = [known & (own > FULL // 2) & (other == 0) for own, other in zip(drawn, others, strict=True)]
    shown = [np.minimum(covered[own], FULL).sum() / FULL for own in alone]
    return np.column_stack((areas, [own.sum() for own in alone], shown))


def _during(scene: Scene, frame: int, position: np.ndarray) -> list[np.ndarray]:
    """Return poses at equal steps of time of a picture's exposure, each (dof,)."""
    shutter = scene.shutter
    blur = 0.0 if shutter is None else way(scene.moving(frame), position)
    if shutter is None or blur <= SLOW_PX:
        return [position]
    count = min(math.ceil(blur / SLOW_PX), MOST_DURING)
    times = ((np.arange(count) + 0.5) / count - 0.5) * shutter.exposure
    return [*shutter.during(frame, position, times)]


def _mismatch(
    scene: Scene,
    frame: Frame,
    planes: np.ndarray,
    view: View,
    positions: Sequence[np.ndarray],
    window: Window,
) -> tuple[float, float, float]:
    """Return the mismatch of outline and mask within a window as shares of the mask's area there: what the
    outline has and the mask has not, and the other way round; and how far the first reaches from the mask
    [px]. Of the mask only what touches the outline counts: other things may move beside the mechanism.

    The outline covers a pixel as it does in the mean of ``positions``, the poses during the exposure. Where
    the background has a geom's colour nothing of the geom is expected, and coverage that noise alone makes is
    none: over the whole window it would outweigh a thin rod.
    """
    import cv2

    part = (slice(None), slice(window.top, window.bottom), slice(window.left, window.right))
    planes, trust = planes[part], view.trust[part]
    noise = SHOWN_NOISE / (TRUSTED_NOISE * np.maximum(trust, TRUSTED))
    shown = np.where(planes > FULL * np.minimum(noise, MOST_NOISE), np.minimum(planes, FULL), 0)
    covered, known = shown.max(axis=0).astype(np.int16), trust.max(axis=0) >= TRUSTED
    poses = [outlines_of(scene.mechanism, scene.camera, position) for position in positions]
    # a geom behind the camera has no outline: then it is open which ones the others are
    same = all(len(pose) == len(view.part) for pose in poses)
    parts = view.part if same else np.zeros(max(map(len, poses)), dtype=np.int64)
    model, expected = np.zeros_like(covered), np.zeros_like(covered)
    for plane in np.unique(parts):
        drawn = np.zeros(covered.shape)
        for pose in poses:
            own = [corners for corners, of in zip(pose, parts, strict=False) if of == plane]
            drawn += _drawn(own, window) / len(poses)
        drawn = np.round(drawn).astype(np.int16)
        model = np.maximum(model, drawn)
        if plane >= 0:
            # how much differs where colours vary is not how much is covered: it is there from a level on
            varied = scene.masks.varied and plane == len(planes) - 1
            level = (LEAST_LEVEL * drawn).astype(np.int16) if varied else drawn
            expected = np.maximum(expected, np.where(trust[plane] >= TRUSTED, level, 0))
    covered = np.where(_touching(covered, model), covered, 0)
    missing, more = np.maximum(expected - covered, 0), np.maximum(covered - model, 0)
    area = max(float(covered[known].sum()), float(FULL))
    away = cv2.distanceTransform(_bare(scene, frame, window).astype(np.uint8), cv2.DIST_L2, 5)
    bare_px = float(away[(missing > FULL // 2) & (trust.max(axis=0) >= CLEAR)].max(initial=0.0))
    return float(missing.sum()) / area, float(more[known].sum()) / area, bare_px


def _bare(scene: Scene, frame: Frame, window: Window) -> np.ndarray:
    """Return which pixels of a window show the background in a frame, bool (height, width)."""
    background = scene.masks.background
    part = (slice(window.top, window.bottom), slice(window.left, window.right))
    shown = np.stack(full_size(frame.luma, frame.chroma))
    shown = displaced(shown, -scene.masks.away(frame.index))[:, part[0], part[1]]
    behind = [plane[part] for plane in full_size(background.luma, background.chroma)]
    return apart(list(shown), behind) < (CHANGED_NOISE * background.pixel_noise[part]) ** 2


def _touching(covered: np.ndarray, model: np.ndarray) -> np.ndarray:
    """Return which covered pixels hang together with an outline, bool (height, width): all where it lies
    outside."""
    import cv2

    together = cv2.connectedComponents(((covered > 0) | (model > 0)).astype(np.uint8))[1]
    own = np.unique(together[model > 0])
    return np.isin(together, own) if len(own) else np.ones(covered.shape, dtype=np.bool_)


def _drawn(outlines: Sequence[np.ndarray], window: Window) -> np.ndarray:
    """Return how much of each pixel of a window some outlines cover, int16 (height, width)."""
    import cv2

    size = (window.right - window.left, window.bottom - window.top)
    # drawn finer than the pixels and averaged: a hard edge would be the larger part of a thin rod
    drawn = np.zeros((size[1] * FINER, size[0] * FINER), np.uint8)
    for polygon in outlines:
        corners = ((polygon - [window.left, window.top] + 0.5) * FINER - 0.5) * 16.0
        cv2.fillPoly(drawn, [np.round(corners).astype(np.int32)], FULL, cv2.LINE_8, 4)
    return cv2.resize(drawn, size, interpolation=cv2.INTER_AREA).astype(np.int16)
