"""A picture of the clip with the outline of a pose over it, drawn by matplotlib."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from monodyn.errors import VideoError
from monodyn.extras import extra
from monodyn.markup import card, sentences, table
from monodyn.mechanism import Mechanism
from monodyn.numbers import number
from monodyn.types import Camera, Frame, Poses
from monodyn.vision.clip.colour import rgb
from monodyn.vision.clip.repeats import NO_REPEATS
from monodyn.vision.clip.video import Video
from monodyn.vision.drawing.camera import PARAMETERS, value_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OUTLINE, AROUND = "#ffd400", "#101010"
"""Colours of an outline and of its border, which show before any background."""
SIZES = ("length", "width", "tail", "tip", "extent")
"""Kinds of sizes that a picture shows."""
WIDE = 7.0
"""Width of a figure of its own [inches]."""


def frame_of(video: Video, frame: int) -> Frame:
    """Return one picture of a clip as it was filmed.

    Args:
        video: The clip.
        frame: Its number.

    Raises:
        VideoError: The clip has no such frame, or it cannot be decoded.
    """
    if not 0 <= frame < video.count:
        raise VideoError(f"show: expected a frame from 0 to {video.count - 1}, got {frame}.")
    # one that repeats the one before is a picture all the same
    found = next(iter(replace(video.as_filmed, repeats=NO_REPEATS).frames(frame, frame + 1)), None)
    if found is None:
        raise VideoError(f"show: frame {frame} of '{video.path}' cannot be decoded; name another one.")
    return found


def pose_row(poses: Poses | None, frame: int) -> int | None:
    """Return the row of a frame in a record if it was measured there; a record may lack frames.

    Args:
        poses: The record, or None.
        frame: Frame number.
    """
    if poses is None:
        return None
    row = int(np.searchsorted(poses.frame, frame))
    if row >= len(poses) or poses.frame[row] != frame or not poses.seen[row]:
        return None
    return row


def check_followed(poses: Poses | None, roll: float) -> None:
    """Refuse poses that were not followed before the camera of a scene.

    Args:
        poses: The poses, or None.
        roll: The camera's roll [rad].

    Raises:
        VideoError: They are against gravity, or before another camera.
    """
    if poses is not None and poses.roll != roll:
        raise VideoError(
            "show: expected poses as track returns them for this scene, got others; leave them out, or pass "
            "those."
        )


def show_outlines(
    frame: Frame, outlines: Sequence[np.ndarray], said: str, axes: Axes | None = None, *, sure: bool = True
) -> Axes:
    """Draw a picture with outlines over it.

    Args:
        frame: The picture.
        outlines: Polygons [px], each (point, 2).
        said: What the outlines are, for the title.
        axes: Axes of matplotlib to draw into; None makes a figure.
        sure: False draws them with dashes: they are not of this frame.

    Returns:
        The axes.
    """
    height, width = frame.luma.shape
    if axes is None:
        pyplot = extra("show", "matplotlib.pyplot", "plots")
        _, axes = pyplot.subplots(figsize=(WIDE, WIDE * height / width + 0.5), layout="constrained")
    assert axes is not None
    axes.imshow(rgb(frame))
    for corners in outlines:
        closed = np.concatenate((corners, corners[:1]))
        for colour, line in ((AROUND, 3.0), (OUTLINE, 1.5)):
            axes.plot(*closed.T, color=colour, linewidth=line, linestyle="-" if sure else (0, (4, 2)))
    # what leaves the picture does not make it smaller
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    axes.set_title(f"frame {frame.index}, {frame.time:.2f} s: {said}", fontsize="medium")
    axes.set_axis_off()
    return axes


def scene_card(
    line: str, mechanism: Mechanism, camera: Camera, std: Mapping[str, float], advice: Sequence[str]
) -> str:
    """Return a scene as HTML, for notebooks: camera and sizes, in the start scale.

    Args:
        line: The one line of a prompt.
        mechanism: The located mechanism.
        camera: The camera.
        std: Standard deviations of what was refined of the camera, by name.
        advice: Sentences for the user.
    """
    places = []
    for name, row in PARAMETERS.items():
        sure = std.get(name)
        how = "held" if sure is None else f"{sure:.3g}"
        places.append([name, number(value_of(camera, name)), how, row.unit])
    seen = [p for p in mechanism.parameters if p.kind in SIZES and p.unit == "m"]
    sizes = [[p.name, number(p.value), "", p.unit] for p in seen]
    shown = table(("parameter", "value", "std", "unit"), [*places, *sizes], words=("unit",))
    return card(line, shown, sentences(["Lengths are in the scale of the file.", *advice]))
