"""What the published problems work on: a seen silhouette, and a mechanism whose sizes may change."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from monodyn.errors import VideoError
from monodyn.mechanism import Mechanism
from monodyn.paper.placed import moment_sums
from monodyn.paper.threshold import OPEN
from monodyn.types import Camera
from monodyn.vision.drawing.camera import DEPTH as DEPTH
from monodyn.vision.drawing.camera import X as X
from monodyn.vision.drawing.camera import Y as Y
from monodyn.vision.drawing.rig import Rig, rig_of
from monodyn.vision.drawing.silhouette import row_sums

SIZES = (".length", ".width", ".tail", ".tip")
"""Sizes that a silhouette shows."""
RATIO_RANGE = 30.0
"""An aspect ratio may become so many times larger or smaller than in the file."""


@dataclass(frozen=True, eq=False)
class Seen:
    """A binary silhouette as the problems need it; pixels without a known background count nowhere.

    Attributes:
        sums: Row prefix sums of the silhouette, (height, width + 1).
        weight: 1 where the background is known, else 0; shares where pixels were merged, float32 (height,
            width).
        area: Its area A_o [px^2].
        x: Its centroid x_co [px].
        y: Its centroid y_co [px].
    """

    sums: np.ndarray
    weight: np.ndarray
    area: float
    x: float
    y: float

    @cached_property
    def moments(self) -> np.ndarray:
        """Row prefix sums of the weight w, of w x and of w y, (3, height, width + 1)."""
        return moment_sums(self.weight)


@dataclass(frozen=True, eq=False)
class View:
    """A mechanism of changeable sizes before a camera, in a pose.

    The arrays that are drawn are affine in the sizes.

    Attributes:
        names: Sizes that the aspect ratios consist of.
        reference: The free size that stays, to which they are ratios; empty where none has to.
        sizes: Their values [m], (param,).
        lower: Lower bounds [m], (param,).
        upper: Upper bounds [m], (param,).
        base: The rig at sizes of zero, with the camera as it is now.
        slopes: Derivatives of links, points and radius by size, each (param, ...).
        position: Joint positions, (dof,).
        limits: Lower and upper joint limits, (2, dof).
        moves: Which of the camera's x, y and depth are estimated, (3,).
    """

    names: tuple[str, ...]
    reference: str
    sizes: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    base: Rig
    slopes: tuple[np.ndarray, ...]
    position: np.ndarray
    limits: np.ndarray
    moves: tuple[bool, bool, bool]

    @property
    def rig(self) -> Rig:
        """The arrays that are drawn."""
        return self.rig_with(self.sizes)

    def rig_with(self, sizes: np.ndarray) -> Rig:
        """Return the arrays that are drawn at other sizes.

        Args:
            sizes: Sizes [m], (param,).
        """
        links, points, radius = (
            array + np.tensordot(sizes, slope, 1)
            for array, slope in zip(
                (self.base.links, self.base.points, self.base.radius), self.slopes, strict=True
            )
        )
        # searches look a little beyond their bounds; a negative radius would have another number of points
        return self.base._replace(links=links, points=points, radius=np.maximum(radius, 0.0))

    def before(self, camera: np.ndarray) -> View:
        """Return the same before another packed camera.

        Args:
            camera: From ``camera_array``, (15,).
        """
        return replace(self, base=self.base.before(camera))


def seen(silhouette: np.ndarray, *, shrink: int = 1) -> Seen:
    """Take area, centroid and row sums of a binary silhouette.

    Args:
        silhouette: uint8 (height, width), ``FULL`` on the mechanism, ``OPEN`` where that is not known.
        shrink: Pixels by side that are merged into one.

    Raises:
        VideoError: the silhouette is empty.
    """
    import cv2

    height, width = silhouette.shape[0] // shrink, silhouette.shape[1] // shrink
    part = silhouette[: height * shrink, : width * shrink]
    weight = (part != OPEN).astype(np.float32)
    covered = cv2.threshold(part, OPEN, 1, cv2.THRESH_BINARY)[1]
    if shrink > 1:
        size = (width, height)
        part, weight, covered = (
            cv2.resize(a, size, interpolation=cv2.INTER_AREA)
            for a in (part, weight, covered.astype(np.float32))
        )
    moments = cv2.moments(covered)
    area = moments["m00"]
    if not area > 0.0:
        raise VideoError(
            "silhouette: expected some of the mechanism, got an empty picture; give --background a picture "
            "without the mechanism, or use another method."
        )
    return Seen(row_sums(part), weight, area, moments["m10"] / area, moments["m01"] / area)


def view_of(
    mechanism: Mechanism, camera: Camera, position: np.ndarray, moves: tuple[bool, bool, bool]
) -> View:
    """Prepare a mechanism before a camera for the problems.

    Of the free sizes the first length stays when the depth is estimated: a picture does not tell the common
    scale, so the others are ratios to it.

    Args:
        mechanism: Its parameters that are not free stay.
        camera: The camera.
        position: Joint positions [rad; m in the start scale], (dof,).
        moves: Which of the camera's x, y and depth are estimated.
    """
    sized = [p for p in mechanism.parameters if p.name.endswith(SIZES)]
    free = [p for p in sized if p.free]
    held = ""
    if moves[2] and len(free) == len(sized) and free:
        reference = next((p for p in free if p.name.endswith(".length")), free[0])
        free = [p for p in free if p is not reference]
        held = reference.name
    names = tuple(p.name for p in free)
    sizes = np.array([p.value for p in free])
    rig = rig_of(mechanism, camera)
    slopes: list[list[np.ndarray]] = []
    for name, size in zip(names, sizes.tolist(), strict=True):
        other = rig_of(mechanism.with_values({name: 2.0 * size + 1.0}), camera)
        step = size + 1.0
        slopes.append([(getattr(other, a) - getattr(rig, a)) / step for a in ("links", "points", "radius")])
    arrays = (rig.links, rig.points, rig.radius)
    stacked = tuple(
        np.array([slope[i] for slope in slopes]).reshape(len(names), *array.shape)
        for i, array in enumerate(arrays)
    )
    links, points, radius = (
        array - np.tensordot(sizes, slope, 1) for array, slope in zip(arrays, stacked, strict=True)
    )
    base = rig._replace(links=links, points=points, radius=radius)
    scale = float(np.mean([p.value for p in sized])) if sized else 1.0
    least = np.array([0.0 if p.name.endswith((".tail", ".tip")) else p.value / RATIO_RANGE for p in free])
    lower = np.maximum([p.lower for p in free], least)
    upper = np.minimum([p.upper for p in free], RATIO_RANGE * np.maximum(sizes, 0.1 * scale))
    limits = np.array([[j.lower for j in mechanism.joints], [j.upper for j in mechanism.joints]], dtype=float)
    at = np.array(position, dtype=float)
    return View(names, held, sizes, lower, upper, base, stacked, at, limits, moves)
