"""From a located mechanism to the colours of its geoms, measured inside of their outlines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.types import Camera, Frame
from monodyn.vision.drawing.outline import outline
from monodyn.vision.foreground.background import Background
from monodyn.vision.foreground.palette import VARIED, Parts

ALIKE = 10.0
"""Geoms whose colours differ by less share one [grey levels]."""
FRAMES = 16
"""Frames in which the colours are measured."""
INNER_PX = 3.0
"""Distance from every outline at which a pixel shows its geom alone; 80 % of the half width where a geom is
thin."""
THIN_PX = 5.0
"""Half width below which blur mixes even the inner pixels with the background."""
ENOUGH = 20
"""Least number of pixels for a colour."""
SHADED_PERCENT, SHADED_LEVEL = 15.0, 0.75
"""A geom is shaded if this share of its pixels shows less than this level of its colour."""
VARIED_SHARE = 0.25
"""Share of pixels unlike the median colour from which a geom has no colour of its own (a shiny rod)."""


def measured_parts(
    samples: Sequence[Frame],
    background: Background,
    mechanism: Mechanism,
    camera: Camera,
    positions: np.ndarray,
    fits: np.ndarray,
) -> Parts | None:
    """Measure the colour of every geom where no other geom is near.

    Args:
        samples: Sample frames.
        background: What they show without the mechanism.
        mechanism: The located mechanism.
        camera: The camera.
        positions: Pose in every sample frame, (frame, dof).
        fits: True where that pose lies on the mask, bool (frame,).

    Returns:
        The colours, those alike joined, or None where no geom shows one colour over enough pixels. A geom
        too thin to show its own has the nearest of the others.
    """
    good = np.flatnonzero(fits)
    good = good[:: max(1, len(good) // FRAMES)]
    geoms = len(mechanism.shapes.radius)
    rows: list[list[np.ndarray]] = [[] for _ in range(geoms)]
    for i in good:
        for g, found in enumerate(_inner_pixels(samples[i], background, mechanism, camera, positions[i])):
            rows[g].append(found)
    pixels = [np.concatenate(own) if own else np.zeros((0, 7)) for own in rows]
    medians = [_colour(own) for own in pixels]
    varied = [len(own) >= ENOUGH and _is_varied(own) for own in pixels]
    colours: list[np.ndarray] = []
    part = np.full(geoms, -2, dtype=np.int64)
    depth = [float(np.median(own[:, 6])) if len(own) else 0.0 for own in pixels]
    for g in np.argsort(depth)[::-1]:
        if varied[g]:
            part[g] = VARIED
        elif np.isfinite(medians[g][0]):
            near = [k for k, other in enumerate(colours) if _apart(other, medians[g]) < ALIKE]
            if not near:
                colours.append(medians[g])
            part[g] = near[0] if near else len(colours) - 1
    if not colours:
        return None
    part[part == -2] = 0
    shaded = np.array([part[g] != VARIED and _is_shaded(pixels[g], colours[part[g]]) for g in range(geoms)])
    return Parts(np.array(colours), part, shaded)


def _colour(pixels: np.ndarray) -> np.ndarray:
    """Return the median colour of a geom's inner pixels; of a thin one's, which all are a little mixed with
    the background, that of the quarter that stands out most."""
    if len(pixels) < ENOUGH:
        return np.full(3, np.nan)
    if float(np.median(pixels[:, 6])) < THIN_PX:
        contrast = np.nansum((pixels[:, :3] - pixels[:, 3:6]) ** 2, axis=1)
        pixels = pixels[contrast >= np.percentile(contrast, 75.0)]
    return np.median(pixels[:, :3], axis=0)


def _apart(one: np.ndarray, other: np.ndarray) -> float:
    """Return the distance of two colours [grey levels]; channels that are missing do not count."""
    return float(np.sqrt(np.nansum((one - other) ** 2)))


def _is_varied(pixels: np.ndarray) -> bool:
    """Return whether many pixels of a geom are nearer to the background than to the geom's median colour."""
    median = np.median(pixels[:, :3], axis=0)
    off = np.sqrt(np.nansum((pixels[:, :3] - median) ** 2, axis=1))
    contrast = np.sqrt(np.nansum((median - pixels[:, 3:6]) ** 2, axis=1))
    return float(np.mean(off > 0.5 * contrast)) > VARIED_SHARE


def _is_shaded(pixels: np.ndarray, colour: np.ndarray) -> bool:
    """Return whether many inner pixels of a geom show much less of its colour than all of it."""
    if len(pixels) < ENOUGH or float(np.median(pixels[:, 6])) < THIN_PX:
        return False
    full = colour - pixels[:, 3:6]
    share = np.nansum((pixels[:, :3] - pixels[:, 3:6]) * full, axis=1) / np.maximum(
        np.nansum(full**2, axis=1), 1.0
    )
    return float(np.percentile(share, SHADED_PERCENT)) < SHADED_LEVEL


def _inner_pixels(
    frame: Frame, background: Background, mechanism: Mechanism, camera: Camera, position: np.ndarray
) -> list[np.ndarray]:
    """Return colour, background colour and depth [px] of pixels deep inside of each geom and outside of the
    others, each (pixel, 7)."""
    import cv2

    size = (camera.width, camera.height)
    planes: list[np.ndarray] = []
    for luma, chroma in ((frame.luma, frame.chroma), (background.luma, background.chroma)):
        planes.append(luma)
        planes += [cv2.resize(plane, size, interpolation=cv2.INTER_LINEAR) for plane in chroma or ()]
        planes += [np.full(luma.shape, np.nan, dtype=np.float32)] * (
            3 - len(planes) % 3 if len(planes) % 3 else 0
        )
    masks = []
    for _, polygon in outline(mechanism, camera, position):
        mask = np.zeros((camera.height, camera.width), np.uint8)
        cv2.fillPoly(mask, [np.round(polygon * 16.0).astype(np.int32)], 1, cv2.LINE_8, 4)
        masks.append(mask)
    owners = np.sum(masks, axis=0, dtype=np.int64) if masks else np.zeros((camera.height, camera.width))
    found = []
    for mask in masks:
        depth = cv2.distanceTransform(mask, cv2.DIST_L2, 3)
        deepest = float(depth.max())
        y, x = np.nonzero((depth >= min(INNER_PX, 0.8 * deepest)) & (owners == 1))
        step = max(1, len(y) // 400)
        values = [plane[y[::step], x[::step]].astype(np.float64) for plane in planes]
        found.append(np.column_stack([*values, np.full(len(values[0]), deepest)]))
    return found
