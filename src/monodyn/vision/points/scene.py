"""A mechanism before a camera, as tracked points show it: what ``locate`` hands to ``track``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from monodyn.markup import counted
from monodyn.mechanism import Mechanism
from monodyn.types import Camera, Frame, Poses
from monodyn.vision.clip.steady import CameraPath
from monodyn.vision.clip.video import Video
from monodyn.vision.drawing.outline import outline
from monodyn.vision.drawing.shown import check_followed, frame_of, pose_row, scene_card, show_outlines
from monodyn.vision.points.adjust import Adjustment, Fitted, Seen
from monodyn.vision.points.drift import Drift
from monodyn.vision.points.marks import Mark
from monodyn.vision.points.shown import project
from monodyn.vision.points.sticks import sticks
from monodyn.vision.points.tracks import PointTracks, without_pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class PointScene:
    """A mechanism before a camera, as tracked points show it.

    Attributes:
        mechanism: With sizes in the start scale and the points' information about them (``measured``).
        camera: The camera, in the start scale.
        tracks: The points.
        marks: What they are, points of the scene included.
        adjustment: The marks of the mechanism, and what was refined.
        doubted: The same with what of the camera is held but not known among what is refined.
        off: How far its unknowns would go if none were held, (param,).
        fitted: Mechanism, camera and poses as they were refined.
        drift: How the camera moved, or None.
        seen: The points by mark of the adjustment, names that were exchanged put right, as a camera at rest
            shows them.
        lying: True where a point lies on its mark, bool (frame, point).
        camera_std: Standard deviations of the refined camera parameters by name [m, rad, px], the common
            scale held.
        rms_px: Root mean square distance between marks and the points that lie on them [px].
        outside: Share of the found points that do not lie on their mark.
        extent_px: Extent of the mechanism in the picture: the longer side of the box around its marks in all
            frames [px].
        advice: Sentences for the user.
    """

    mechanism: Mechanism
    camera: Camera
    tracks: PointTracks = field(repr=False)
    marks: tuple[Mark, ...]
    adjustment: Adjustment = field(repr=False)
    doubted: Adjustment = field(repr=False)
    off: np.ndarray = field(repr=False)
    fitted: Fitted = field(repr=False)
    drift: Drift | None = field(repr=False)
    seen: Seen = field(repr=False)
    lying: np.ndarray = field(repr=False)
    camera_std: Mapping[str, float]
    rms_px: float
    outside: float
    extent_px: float
    advice: tuple[str, ...]

    @property
    def video(self) -> Video:
        """The clip of the points; of those of a table one without pictures."""
        return self.tracks.clip or without_pictures(self.tracks)

    def camera_path(self, count: int) -> CameraPath | None:
        """Return the way of a camera that moves, as the still scene or the points that stand still show it.

        Args:
            count: Number of frames of the clip.

        Returns:
            Its way, without a picture of the scene where points show it; None for a camera that stands still.
        """
        if self.drift is None or self.video.camera_path is not None:
            return self.video.camera_path
        tracks, size = self.tracks, np.array([self.tracks.width, self.tracks.height])
        maps, std = np.full((count, 3, 3), np.nan), np.full(count, np.nan)
        maps[tracks.frame] = self.drift.maps(0.5 * (size - 1.0))
        # what of each frame's shift is not smooth is left to its pose
        std[tracks.frame] = np.sqrt(2.0) * self.adjustment.jitter
        nothing = np.broadcast_to(np.zeros(1, dtype=np.uint8), (tracks.height, tracks.width))
        return CameraPath(maps, std, Frame(-1, 0.0, nothing))

    def as_filmed(self, frame: int, outlines: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return outlines where the picture of a frame shows them as it was filmed.

        Args:
            frame: Frame number.
            outlines: Polygons before a camera at rest [px], each (point, 2).

        Returns:
            The polygons, each (point, 2); none where that is not known of the frame.
        """
        if self.drift is not None:
            drift = self.drift.at(min(self._row(frame), len(self.tracks) - 1))
            return [drift.added(corners[np.newaxis])[0] for corners in outlines]
        path = self.video.camera_path
        if path is None:
            return list(outlines)
        at = path.at(frame)
        return [] if at is None else [at.of(corners) for corners in outlines]

    def _row(self, frame: int) -> int:
        """Return the row of a frame among the points, or of the next one that has any."""
        return int(np.searchsorted(self.tracks.frame, frame))

    def show(self, frame: int | None = None, poses: Poses | None = None, *, axes: Axes | None = None) -> Axes:
        """Draw a picture of the clip with the outline of the mechanism (needs monodyn[plots]).

        Args:
            frame: Number of the picture; None is the first one with points.
            poses: As ``track`` returns them for this scene; None takes those with which it was located.
            axes: Axes of matplotlib to draw into; None makes a figure.

        Returns:
            The axes.

        Raises:
            VideoError: From deeper down: there is no such picture, or the poses are not of this scene.
        """
        check_followed(poses, self.camera.roll)
        picture = frame_of(self.video, int(self.tracks.frame[0]) if frame is None else frame)
        row, position = self._row(picture.index), None
        if poses is not None:
            followed = pose_row(poses, picture.index)
            position = None if followed is None else poses.position[followed]
        elif row < len(self.tracks) and self.tracks.frame[row] == picture.index:
            position = self.fitted.position[row, : len(self.mechanism.joints)]
        outlines = []
        if position is not None:
            drawn = outline(self.mechanism, self.camera, position) if self.mechanism.plan.drawn else []
            outlines = [polygon for _, polygon in drawn] + sticks(self.mechanism, self.camera, position)
        said = "not seen" if position is None else "as located" if poses is None else "as tracked"
        return show_outlines(picture, self.as_filmed(picture.index, outlines), said, axes)

    def __repr__(self) -> str:
        return (
            f"<PointScene of {self.mechanism.name!r} in {self.tracks.path.name}: "
            f"{counted(len(self.tracks.names), 'point')} within {self.rms_px:.2f} px in "
            f"{counted(len(self.tracks), 'frame')}>"
        )

    def _repr_html_(self) -> str:
        """Return the scene as HTML, for notebooks: the camera, and the sizes before it."""
        return scene_card(repr(self), self.mechanism, self.camera, self.camera_std, self.advice)

    @property
    def found_px(self) -> np.ndarray:
        """Where the points of the marks are in the picture [px], (frame, point, 2)."""
        return self.seen.px if self.drift is None else self.drift.added(self.seen.px)

    @property
    def marked_px(self) -> np.ndarray:
        """Where the marks of the adjustment are in the picture [px], (frame, point, 2)."""
        px = project(self.adjustment.shown(self.fitted), self.fitted.position)
        return px if self.drift is None else self.drift.added(px)
