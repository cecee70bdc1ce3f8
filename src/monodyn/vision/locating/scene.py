"""A mechanism before a camera, as a clip shows it: what ``locate`` hands to ``track``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from monodyn.markup import counted
from monodyn.mechanism import Mechanism
from monodyn.types import Camera, Poses
from monodyn.vision.clip.video import Video
from monodyn.vision.drawing.outline import outline
from monodyn.vision.drawing.rig import Rig, rig_of
from monodyn.vision.drawing.shown import check_followed, frame_of, pose_row, scene_card, show_outlines
from monodyn.vision.drawing.shutter import Shutter
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.locating.doubt import Doubt

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class Scene:
    """A mechanism before a camera, as a clip shows it.

    What comes back from a pickle, as ``multiprocessing`` makes them, holds the background and the colours of
    the mechanism but no picture of the clip: it can be followed and shown as before, and reads the frames
    that it needs from the file when it needs them.

    Attributes:
        mechanism: With sizes in the start scale and the picture's information about them (``measured``).
        camera: The camera, in the start scale.
        masks: The clip's masks over the background without the mechanism.
        frame: Number of the frame of the first pose.
        position: Joint positions there [rad; m in the start scale], (dof,).
        key_frames: Numbers of the frames that were refined jointly.
        key_positions: Joint positions there, (key frame, dof).
        camera_std: Standard deviations of the refined camera parameters by name [m, rad, px], the common
            scale held.
        rms_px: Root mean square distance between outline and mask edges [px].
        advice: Sentences for the user.
        thicker: By how much everything is made thicker in the reduced masks in which a pose is looked for
            [reduced px]; None where these are as they come.
        beside: What moves along with each body outside of its outline, as a share of the foreground.
        shutter: How each picture is exposed while the mechanism moves; None for pictures of one instant.
        doubt: What is not known of sizes and camera; None where nothing is said of it.
    """

    mechanism: Mechanism
    camera: Camera
    masks: Masks = field(repr=False)
    frame: int
    position: np.ndarray
    key_frames: tuple[int, ...]
    key_positions: np.ndarray
    camera_std: Mapping[str, float]
    rms_px: float
    advice: tuple[str, ...]
    thicker: float | None = None
    beside: Mapping[str, float] = field(default_factory=dict)
    shutter: Shutter | None = None
    doubt: Doubt | None = field(default=None, repr=False)

    def moving(self, frame: int) -> Rig:
        """Return the mechanism before the camera, as it moves while a picture is exposed.

        Args:
            frame: Number of the picture.
        """
        rig = rig_of(self.mechanism, self.camera)
        return rig if self.shutter is None else self.shutter.of(rig, frame)

    def located(self, frame: int) -> tuple[int, np.ndarray]:
        """Return the key frame nearest to a frame, and the pose that was located there.

        Args:
            frame: Frame number.

        Returns:
            Number of the key frame and joint positions, (dof,).
        """
        nearest = int(np.argmin(np.abs(np.asarray(self.key_frames) - frame)))
        return self.key_frames[nearest], self.key_positions[nearest]

    def show(self, frame: int | None = None, poses: Poses | None = None, *, axes: Axes | None = None) -> Axes:
        """Draw a picture of the clip with the outline of the mechanism (needs monodyn[plots]).

        Without ``poses`` the outline is as it was located in the frame, or, with dashes, in the nearest key
        frame.

        Args:
            frame: Number of the picture; None is that of the first pose.
            poses: As ``track`` returns them for this scene.
            axes: Axes of matplotlib to draw into; None makes a figure.

        Returns:
            The axes.

        Raises:
            VideoError: From deeper down: there is no such frame, it cannot be decoded, or the poses are of
                another scene.

        Example:
            ``scene.show(40, poses).figure.savefig("frame.png")``
        """
        check_followed(poses, self.camera.roll)
        picture = frame_of(self.video, self.frame if frame is None else frame)
        key, position = self.located(picture.index)
        said, outlines = "as located" if key == picture.index else f"outline as in frame {key}", []
        if poses is not None:
            row = pose_row(poses, picture.index)
            said, position = ("not seen", None) if row is None else ("as tracked", poses.position[row])
        if position is not None:
            outlines = [polygon for _, polygon in outline(self.mechanism, self.camera, position)]
        filmed = as_filmed(self.masks, picture.index, outlines)
        sure = poses is not None or key == picture.index
        return show_outlines(picture, filmed, said, axes, sure=sure)

    @property
    def video(self) -> Video:
        """The clip."""
        return self.masks.video

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} of {self.mechanism.name!r} in {self.video.path.name}: outline within "
            f"{self.rms_px:.2f} px in {counted(len(self.key_frames), 'key frame')}, first pose in frame "
            f"{self.frame}>"
        )

    def _repr_html_(self) -> str:
        """Return the scene as HTML, for notebooks: the camera, and the sizes before it."""
        return scene_card(repr(self), self.mechanism, self.camera, self.camera_std, self.advice)


def as_filmed(masks: Masks, frame: int, outlines: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return outlines where the picture of a frame shows them as it was filmed.

    Args:
        masks: The masks of the clip, which know how a camera moves.
        frame: Frame number.
        outlines: Polygons before a camera at rest [px], each (point, 2).

    Returns:
        The polygons, each (point, 2); none where that is not known of the frame.
    """
    path = masks.video.camera_path
    if path is None:
        return list(outlines)
    at, away = path.at(frame), masks.away(frame)
    return [] if at is None else [at.of(corners + away) for corners in outlines]
