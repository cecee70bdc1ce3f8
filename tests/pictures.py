"""Pictures with known content, for the tests of the stages from a clip to poses."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.types import FULL, Camera, Frame
from monodyn.vision.drawing.camera import pixels
from monodyn.vision.drawing.outline import outline
from monodyn.vision.foreground.background import Background, Samples, Window
from monodyn.vision.foreground.masks import BACK, FRONT, View, no_order, plain_view
from monodyn.vision.foreground.moving_colours import moving_colours
from monodyn.vision.foreground.palette import Palette, palette_of
from monodyn.vision.locating.keyframes import KeyFrame, KeyFrames

CAMERA = Camera(320, 240, 300.0, x=0.05, y=-0.1, depth=0.9)
"""A camera before the bundled mechanisms."""
H, W = 60, 80
"""Size of the frames of ``wandering`` [px]."""
WHOLE = Window(0, H, 0, W)


def drawn_mask(mechanism: Mechanism, camera: Camera, q: np.ndarray, blur: float = 0.8) -> np.ndarray:
    """Draw a soft mask sixteen times finer than the pixels, then average and blur it: (1, height, width)."""
    mask = _averaged(mechanism, camera, q, 0, camera.height).astype(np.float32)
    return np.round(cv2.GaussianBlur(mask, (0, 0), blur)).astype(np.uint8)[None]


def stacked_mask(mechanism: Mechanism, camera: Camera, q: np.ndarray) -> np.ndarray:
    """Draw a soft mask with a plane for each geom, of which the later ones cover the earlier ones: (geom,
    height, width)."""
    planes = np.zeros((len(mechanism.shapes.radius), camera.height, camera.width))
    for g in range(len(planes)):
        shown = _averaged(mechanism, camera, q, 0, camera.height, slice(g, g + 1)) / FULL
        planes *= 1.0 - shown
        planes[g] = shown
    return np.stack([np.round(FULL * cv2.GaussianBlur(plane, (0, 0), 0.8)) for plane in planes]).astype(
        np.uint8
    )


def exposed_mask(
    mechanism: Mechanism,
    camera: Camera,
    q: np.ndarray,
    *,
    sweep: np.ndarray | float = 0.0,
    skew: np.ndarray | float = 0.0,
    bend: np.ndarray | float = 0.0,
    lean: np.ndarray | float = 0.0,
    count: int = 25,
) -> np.ndarray:
    """Draw a mask while the joints move by ``sweep`` in the exposure of a row and by ``skew`` from the first
    row to the last; ``q`` is the middle of it all, and ``bend`` and ``lean`` are how much farther than by a
    steady motion they are at the beginnings and ends: (1, height, width)."""
    height = camera.height
    total = np.zeros((height, camera.width))
    rows = np.arange(height) / (height - 1) - 0.5
    for time in (np.arange(count) + 0.5) / count - 0.5:
        # bands of rows stand for single ones: between their times the outline moves by less than a tenth
        bands = np.array_split(np.arange(height), 1 if np.all(np.asarray(skew) == 0.0) else 60)
        for band in bands:
            row = rows[band].mean()
            pose = q + time * (np.asarray(sweep) + 4.0 * time * np.asarray(bend))
            pose = pose + row * (np.asarray(skew) + 4.0 * row * np.asarray(lean))
            total[band] += _averaged(mechanism, camera, pose, band[0], band[-1] + 1)
    return np.round(cv2.GaussianBlur(total / count, (0, 0), 0.8)).astype(np.uint8)[None]


def _averaged(
    mechanism: Mechanism, camera: Camera, q: np.ndarray, first: int, stop: int, geoms: slice = slice(None)
) -> np.ndarray:
    """Draw an outline, or that of some geoms, sixteen times finer than the pixels and average it, in some
    rows: (row, width)."""
    fine, shown = 16, np.zeros((stop - first, camera.width), np.uint8)
    outlines = [
        np.round(((polygon + 0.5) * fine - 0.5) * 16).astype(np.int32)
        for _, polygon in outline(mechanism, camera, q)[geoms]
    ]
    if not outlines:
        return shown
    # only the box that the outlines reach is drawn: all of the picture would take ten times as long
    reached = np.concatenate(outlines) // (16 * fine)
    left, top = np.maximum(reached.min(axis=0) - 1, 0)
    right, bottom = np.minimum(reached.max(axis=0) + 2, (camera.width, camera.height))
    upper, lower = max(top, first), min(bottom, stop)
    if left >= right or upper >= lower:
        return shown
    big = np.zeros(((bottom - top) * fine, (right - left) * fine), np.uint8)
    for corners in outlines:
        cv2.fillPoly(big, [corners - 16 * fine * np.array([left, top], np.int32)], FULL, cv2.LINE_8, 4)
    part = big[(upper - top) * fine : (lower - top) * fine]
    size = (int(right - left), int(lower - upper))
    shown[upper - first : lower - first, left:right] = cv2.resize(part, size, interpolation=cv2.INTER_AREA)
    return shown


def trusted(mechanism: Mechanism, camera: Camera = CAMERA) -> View:
    """Read one plane for all geoms, trusted everywhere."""
    return plain_view(np.ones((camera.height, camera.width), np.float32), len(mechanism.shapes.radius))


def stacked_view(*, known: bool = True) -> View:
    """Read a plane for each of two links, trusted everywhere; the second is known to lie in front, or not."""
    order = np.array([[0, BACK], [FRONT, 0]], np.int8) if known else no_order(2)
    trust = np.ones((2, CAMERA.height, CAMERA.width), np.float32)
    return View(trust, np.arange(2), np.zeros(2, np.bool_), order)


def wandering(
    count: int = 24,
    noise: float = 1.0,
    *,
    colour: Sequence[int] = (90, 128, 128),
    back: Sequence[int] = (160, 128, 128),
    places: Sequence[int] | None = None,
) -> list[Frame]:
    """A square of 20 px wanders over a plain background."""
    rng = np.random.default_rng(4)
    made = []
    for i in range(count):
        x = 5 + 2 * i if places is None else places[i]
        luma = np.full((H, W), float(back[0])) + rng.normal(scale=noise, size=(H, W))
        luma[20:40, x : x + 20] = colour[0]
        planes = []
        for value, behind in zip(colour[1:], back[1:], strict=True):
            plane = np.full((H // 2, W // 2), behind, np.uint8)
            plane[10:20, (x + 1) // 2 : (x + 20) // 2] = value
            planes.append(plane)
        made.append(Frame(i, i / 30, np.clip(luma.round(), 0, 255).astype(np.uint8), (planes[0], planes[1])))
    return made


def samples(made: Sequence[Frame]) -> Samples:
    """Take all frames as samples, with motion anywhere."""
    return Samples(tuple(made), WHOLE)


def drawn_frames(mechanism: Mechanism, camera: Camera, poses: np.ndarray) -> KeyFrames:
    """Draw key frames that are not reduced."""
    frames = []
    for i, q in enumerate(poses):
        planes = drawn_mask(mechanism, camera, q)
        area = float(planes.sum()) / FULL
        frames.append(KeyFrame(i, i / 30, planes, planes[0], area))
    view = trusted(mechanism, camera)
    return KeyFrames(tuple(frames), 1, view, view.trust[0], view.trust[0])


def root_in(camera: Camera) -> np.ndarray:
    """Return where the origin of the plane is seen [px]."""
    return pixels(camera, np.zeros((1, 3)))[0]


def palette_found(frames: Sequence[Frame], background: Background, colour: str, contrast: float) -> Palette:
    """Find the colours of what moves, and their contrast with the background."""
    return palette_of(moving_colours(frames, background, colour, contrast), background)
