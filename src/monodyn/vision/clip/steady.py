"""The way of a camera that moves, and its pictures as a camera at rest would have filmed them.

The scene is registered to the mean place of the camera. A picture is warped there once; what it does not
show is filled from a picture of the whole scene, so that for everything after it the scene stands still.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np

from monodyn.arrays import Frozen, freeze
from monodyn.errors import VideoError
from monodyn.types import Frame
from monodyn.vision.clip.homography import Homography
from monodyn.vision.clip.warping import put_in_place

GRID = (32, 24)
"""Columns and rows of places at which the light of a whole picture is compared."""
MARGIN_PX = 4
"""By how much more than a window is taken to its place: what looks around a pixel meets the scene there
[px]."""
BENT_PX = 0.03
"""Displacement in a corner, seen from the side, below which a picture is only displaced, turned and zoomed
[px]."""


class Parallax(NamedTuple):
    """By how much more what is nearer moves in the pictures than the scene behind it.

    A camera that is displaced moves the two differently, one that turns does not; a turn shows in the
    perspective of the scene.

    Attributes:
        share: As a share of the scene's displacement.
        turning: By how much a turn in that displacement counts, for its perspective [px^2].
    """

    share: float = 0.0
    turning: float = 0.0


NO_PARALLAX = Parallax()
"""Of the scene itself."""


@dataclass(frozen=True, eq=False)
class CameraPath(Frozen):
    """Where the still scene appears in every frame.

    Attributes:
        maps: Map from the scene to each frame as in ``Homography``, (frame, 3, 3); NaN where the frame could
            not be registered.
        std: Standard deviation of a displacement [px], (frame,); NaN there.
        scene: The whole scene without what moves, its ``index`` and ``time`` without meaning.
        window: The part of the pictures that is looked at, rows and columns; None for all of it. Elsewhere
            ``steady`` shows the scene, but for the places of ``light_grid``.
    """

    maps: np.ndarray
    std: np.ndarray
    scene: Frame
    window: tuple[slice, slice] | None = None

    def __post_init__(self) -> None:
        count = len(self.std)
        freeze(self, (count, 3, 3), "maps", error=VideoError)
        freeze(self, (count,), "std", error=VideoError)

    @property
    def registered(self) -> np.ndarray:
        """True where the frame was registered, bool (frame,)."""
        return np.isfinite(self.std)

    @property
    def shift(self) -> np.ndarray:
        """Displacement to the right and down [px], (frame, 2)."""
        return self.maps[:, :2, 2]

    @property
    def growth(self) -> np.ndarray:
        """Zoom, and turn clockwise as seen, as a complex number, (frame,)."""
        m = self.maps
        return 0.5 * (m[:, 0, 0] + m[:, 1, 1] + 1j * (m[:, 1, 0] - m[:, 0, 1]))

    @property
    def turn(self) -> np.ndarray:
        """Turn of the still scene, counter-clockwise as seen [rad], (frame,)."""
        return -np.angle(self.growth)

    @property
    def zoom(self) -> np.ndarray:
        """Size of the still scene over its own, (frame,)."""
        return np.abs(self.growth)

    @property
    def stretch(self) -> np.ndarray:
        """What perspective adds to turn and zoom in the middle of the picture: the map has
        [[a, b], [b, -a]] in addition, (frame, (a, b))."""
        m = self.maps
        return 0.5 * np.column_stack([m[:, 0, 0] - m[:, 1, 1], m[:, 1, 0] + m[:, 0, 1]])

    @property
    def lean(self) -> np.ndarray:
        """By how much the scene is smaller to the right and down, seen from the side [1/px], (frame, 2)."""
        return self.maps[:, 2, :2]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the pictures [px]."""
        height, width = self.scene.luma.shape
        return width, height

    def at(self, frame: int) -> Homography | None:
        """Return where the scene appears in a frame; None where that is not known.

        Args:
            frame: Frame number.
        """
        if frame >= len(self.std) or not self.registered[frame]:
            return None
        return Homography(self.maps[frame], self.size)

    def sway(self, frame: int, parallax: Parallax) -> np.ndarray:
        """Return where something nearer than the scene is in a frame, against its mean place over the scene.

        Args:
            frame: Frame number.
            parallax: How much nearer it is.

        Returns:
            To the right and down [px], (2,); zero where the frame is not registered.
        """
        if parallax == NO_PARALLAX or frame >= len(self.std) or not self.registered[frame]:
            return np.zeros(2)
        columns = self.swaying(frame)
        return columns @ np.array(parallax)

    def swaying(self, frame: int) -> np.ndarray:
        """Return the derivative of ``sway`` by share and turning, (2, 2).

        Args:
            frame: Frame number.
        """
        m = self.maps[frame]
        # back in the scene's own turn and size
        return np.linalg.solve(m[:2, :2], np.column_stack([m[:2, 2], m[2, :2]]))

    def steady(self, frame: Frame) -> Frame | None:
        """Return a frame as a camera at rest would have filmed it; None where it is not registered.

        Args:
            frame: A frame of the clip as it is.
        """
        at = self.at(frame.index)
        if at is None:
            return None
        luma = _warped(frame.luma, at, self.scene.luma, self.window, lit=True)
        chroma = None
        if frame.chroma is not None and self.scene.chroma is not None:
            blue, red = (
                _warped(plane, at, behind, self.window)
                for plane, behind in zip(frame.chroma, self.scene.chroma, strict=True)
            )
            chroma = (blue, red)
        return replace(frame, luma=luma, chroma=chroma)

    def within(self, top: int, bottom: int, left: int, right: int) -> CameraPath:
        """Return the same way for somebody who looks at a window of the pictures alone, which is faster.

        Args:
            top: First row [px].
            bottom: Row below the last one [px].
            left: First column [px].
            right: Column to the right of the last one [px].
        """
        return replace(self, window=(slice(top, bottom), slice(left, right)))


@cache
def light_grid(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the places at which the light of a whole picture is compared.

    Args:
        height: Height of the picture [px].
        width: Its width [px].

    Returns:
        Rows and columns [px], int64 (point,) each.
    """
    columns, rows = GRID
    row = np.linspace(0, height - 1, rows + 2).round().astype(np.intp)[1:-1].repeat(columns)
    column = np.tile(np.linspace(0, width - 1, columns + 2).round().astype(np.intp)[1:-1], rows)
    # every caller has the same ones
    row.flags.writeable = column.flags.writeable = False
    return row, column


def _warped(
    plane: np.ndarray,
    at: Homography,
    behind: np.ndarray,
    window: tuple[slice, slice] | None,
    *,
    lit: bool = False,
) -> np.ndarray:
    """Return a plane in the place of the scene, what it does not show from ``behind``, and so everything
    outside of a window, with ``lit`` but for the places of ``light_grid``."""
    import cv2

    out = behind.copy()
    if lit and window is not None:
        row, column = light_grid(*plane.shape)
        at_x, at_y = at.of(np.column_stack([column, row])).astype(np.float32).T
        grid = np.ascontiguousarray(out[row, column][np.newaxis])
        out[row, column] = cv2.remap(
            plane, at_x[np.newaxis], at_y[np.newaxis], cv2.INTER_LINEAR, grid, cv2.BORDER_TRANSPARENT
        )[0]
    shown_in_place(plane, at, out, window)
    out.flags.writeable = False
    return out


def shown_in_place(
    plane: np.ndarray, at: Homography, out: np.ndarray, window: tuple[slice, slice] | None = None
) -> None:
    """Write what a plane of a picture shows of the scene to its place there.

    Args:
        plane: The plane, uint8 (height, width); it may be reduced.
        at: Map from the scene to the picture.
        out: Where to write it, uint8 (height, width); what the plane does not show stays.
        window: Rows and columns of the whole picture outside of which it stays too; None for all of it.
    """
    rows, columns = window or (slice(0, at.size[1]), slice(0, at.size[0]))
    ends = [
        end
        for full, count, whole in zip((rows, columns), plane.shape, at.size[::-1], strict=True)
        for end in (
            max(0, (full.start - MARGIN_PX) * count // whole),
            min(count, -(-(full.stop + MARGIN_PX) * count // whole)),
        )
    ]
    matrix = plane_matrix(at, plane.shape)
    if np.abs(at.entries[2, :2]) @ at.middle * float(np.hypot(*at.middle)) < BENT_PX:
        matrix[2] = 0.0, 0.0, 1.0
    put_in_place(np.ascontiguousarray(plane), matrix, out, (ends[0], ends[1], ends[2], ends[3]))


def plane_matrix(at: Homography, shape: tuple[int, ...]) -> np.ndarray:
    """Return a map between pictures for a plane of them that may be reduced, (3, 3).

    Args:
        at: The map.
        shape: Height and width of the plane.
    """
    by_x, by_y = at.size[0] / shape[1], at.size[1] / shape[0]
    # a pixel of the plane lies in the middle of those that it stands for
    x, y = 0.5 * (by_x - at.size[0]), 0.5 * (by_y - at.size[1])
    matrix = at.entries @ np.array([[by_x, 0.0, x], [0.0, by_y, y], [0.0, 0.0, 1.0]])
    matrix[0] = (matrix[0] - x * matrix[2]) / by_x
    matrix[1] = (matrix[1] - y * matrix[2]) / by_y
    return matrix / matrix[2, 2]


def displaced(planes: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Return planes displaced in the picture.

    Args:
        planes: The planes, uint8 (plane, height, width).
        by: To the right and down [px], (2,).

    Returns:
        The planes, uint8 (plane, height, width).
    """
    if not np.any(by):
        return planes
    import cv2

    matrix = np.column_stack([np.eye(2), by])
    size = planes.shape[:0:-1]
    return np.stack([cv2.warpAffine(plane, matrix, size, flags=cv2.INTER_LINEAR) for plane in planes])
