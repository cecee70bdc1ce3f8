"""What the published problems work on: a seen silhouette, and a mechanism whose sizes may change."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from monodyn.errors import VideoError
from monodyn.mechanism import Mechanism, Parameter
from monodyn.paper.placed import AreaCentroid, CameraFree, moment_sums
from monodyn.paper.threshold import OPEN
from monodyn.types import Camera
from monodyn.vision.drawing.mismatch import row_sums
from monodyn.vision.drawing.rig import SIZE_KINDS, Rig, joint_limits, rig_of

OVERHANGS = ("tail", "tip")
"""Kinds of sizes by which a body reaches beyond its hinges; they may be zero."""
RATIO_RANGE = 30.0
"""Factor by which an aspect ratio may become larger or smaller than in the file."""
LEAST_SCALE = 0.1
"""A size counts as at least this share of the mean size where its range is set, so that a zero may grow."""
CAMERA_HELD = CameraFree(x=False, y=False, depth=False)
"""A camera that stays where it is."""


@dataclass(frozen=True, eq=False)
class SilhouetteImage:
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

    @cached_property
    def target(self) -> AreaCentroid:
        """Area and centroid, as the kernel takes them."""
        return AreaCentroid(self.area, self.x, self.y)


@dataclass(frozen=True, eq=False)
class ModelView:
    """A mechanism whose sizes may change before a camera, in a pose.

    The arrays that are drawn are affine in the sizes.

    Attributes:
        searched: Sizes that the aspect ratios consist of.
        reference: The free size that stays, to which they are ratios; None where none has to.
        sizes: Their values [m], (param,).
        lower: Lower bounds [m], (param,).
        upper: Upper bounds [m], (param,).
        base: The rig at sizes of zero, with the present camera.
        slopes: Derivatives of links, points and radius by size, each (param, ...).
        position: Joint positions, (dof,).
        limits: Lower and upper joint limits, (2, dof).
        free: Which of the camera's coordinates are estimated.
    """

    searched: tuple[Parameter, ...]
    reference: Parameter | None
    sizes: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    base: Rig
    slopes: tuple[np.ndarray, ...]
    position: np.ndarray
    limits: np.ndarray
    free: CameraFree

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the sizes that are searched."""
        return tuple(p.name for p in self.searched)

    @property
    def overhang(self) -> np.ndarray:
        """True for the sizes that are overhangs, which may be zero, bool (param,)."""
        return np.array([p.kind in OVERHANGS for p in self.searched], dtype=bool)

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

    def before(self, camera: np.ndarray) -> ModelView:
        """Return the same before another packed camera.

        Args:
            camera: From ``camera_array``, (entry,).
        """
        return replace(self, base=self.base.before(camera))


def silhouette_image(silhouette: np.ndarray, *, shrink: int = 1) -> SilhouetteImage:
    """Return area, centroid and row sums of a binary silhouette.

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
    # merged pixels hold the share that is covered and known, so that area and mismatch stay linear
    if shrink > 1:
        size = (width, height)
        part, weight, covered = (
            cv2.resize(a, size, interpolation=cv2.INTER_AREA)
            for a in (part, weight, covered.astype(np.float32))
        )
    moments = cv2.moments(covered)
    # centroid and area count pixels that the mechanism covers, open ones with neither side
    area = moments["m00"]
    if not area > 0.0:
        raise VideoError(
            "silhouette: expected some of the mechanism, got an empty picture; give --background a picture "
            "without the mechanism, or use another method."
        )
    return SilhouetteImage(row_sums(part), weight, area, moments["m10"] / area, moments["m01"] / area)


def model_view(mechanism: Mechanism, camera: Camera, position: np.ndarray, free: CameraFree) -> ModelView:
    """Return a mechanism before a camera in the form in which the problems use it.

    Of the free sizes the first length stays when the depth is estimated: a picture does not determine the
    common scale, so the others are ratios to it.

    Args:
        mechanism: Its parameters that are not free stay.
        camera: The camera.
        position: Joint positions [rad; m in the start scale], (dof,).
        free: Which of the camera's coordinates are estimated.
    """
    sized = [p for p in mechanism.parameters if p.kind in SIZE_KINDS and not p.follows]
    searched = [p for p in sized if p.free]
    reference = None
    # a size that is fixed sets the common scale; only where none is does the depth need a reference
    if free.depth and len(searched) == len(sized) and searched:
        reference = next((p for p in searched if p.kind == "length"), searched[0])
        searched = [p for p in searched if p is not reference]
    names = tuple(p.name for p in searched)
    sizes = np.array([p.value for p in searched])
    base, slopes = _affine(mechanism, camera, names, sizes)
    lower, upper = _size_bounds(sized, searched, sizes)
    return ModelView(
        searched=tuple(searched),
        reference=reference,
        sizes=sizes,
        lower=lower,
        upper=upper,
        base=base,
        slopes=slopes,
        position=np.array(position, dtype=float),
        limits=np.array(joint_limits(mechanism)),
        free=free,
    )


def _affine(
    mechanism: Mechanism, camera: Camera, names: tuple[str, ...], sizes: np.ndarray
) -> tuple[Rig, tuple[np.ndarray, ...]]:
    """Return the rig at sizes of zero, and the slopes of its links, points and radii by size."""
    rig = rig_of(mechanism, camera)
    slopes: list[list[np.ndarray]] = []
    for name, size in zip(names, sizes.tolist(), strict=True):
        # the arrays are affine in each size, so a step of any length gives the exact slope
        other = rig_of(mechanism.with_values({name: 2.0 * size + 1.0}), camera)
        step = size + 1.0
        slopes.append([(getattr(other, a) - getattr(rig, a)) / step for a in ("links", "points", "radius")])
    arrays = (rig.links, rig.points, rig.radius)
    # one array each for links, points and radii; without a free size they have no rows but the right shape
    stacked = tuple(
        np.array([slope[i] for slope in slopes]).reshape(len(names), *array.shape)
        for i, array in enumerate(arrays)
    )
    links, points, radius = (
        array - np.tensordot(sizes, slope, 1) for array, slope in zip(arrays, stacked, strict=True)
    )
    return rig._replace(links=links, points=points, radius=radius), stacked


def _size_bounds(
    sized: list[Parameter], searched: list[Parameter], sizes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return bounds of the sizes [m], (param,) each: those of the parameters, within ``RATIO_RANGE``."""
    scale = float(np.mean([p.value for p in sized])) if sized else 1.0
    least = np.array([0.0 if p.kind in OVERHANGS else p.value / RATIO_RANGE for p in searched])
    lower = np.maximum([p.lower for p in searched], least)
    upper = np.minimum([p.upper for p in searched], RATIO_RANGE * np.maximum(sizes, LEAST_SCALE * scale))
    return lower, upper
