"""From samples and background to the colours of what moves, and where these show in the background itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monodyn.arrays import medians
from monodyn.cores import on_all_cores
from monodyn.errors import VideoError
from monodyn.types import Frame
from monodyn.vision.foreground.background import CHANGED_NOISE, Background
from monodyn.vision.foreground.changes import (
    BEHIND,
    FRAME,
    SHOWN,
    apart,
    least_contrast,
    moving_pixels,
    surroundings,
)
from monodyn.vision.foreground.chroma import whole_samples
from monodyn.vision.foreground.covered import Covered
from monodyn.vision.foreground.shadow import Shadow, find_shadow
from monodyn.vision.foreground.thinned import at_pixels
from monodyn.vision.foreground.thumbnails import Window

NEAR_COLOUR = 2.0
"""Pixels within this distance of one of the mechanism's colours look like it [least contrasts]."""
VARIED_SHARE = 0.1
"""Share of moving pixels unlike every colour from which the mechanism counts as varied."""
COLOURS = 3
"""Most colours a mechanism may have."""
MERGED = 3.2
"""Clusters of moving pixels closer than this are one colour [least contrasts]."""
RARE = 0.12
"""Share of the moving pixels below which a cluster is no colour of the mechanism."""
LEAST_PIXELS = 50
"""Moving pixels below which nothing moves, and pixels of a part of it in the background."""
BALANCED = 0.5
"""Pixels of a colour that are gone from the background and those that show elsewhere, the fewer over the
more of each frame, from which it is the mechanism's: what moves shows where it has gone, a wall does not."""


class MovingColours(NamedTuple):
    """Colours of what moves.

    Attributes:
        colours: Grey level, blue and red difference of each colour, (colour, 3); the last two stand for
            nothing where grey alone counts.
        grey_only: True where grey alone distinguishes what moves from the background.
        varied: True where the colours leave much of it unexplained (a shiny rod).
        contrast: Least difference of a pixel that has changed [grey levels].
        shadow: Its shadow, which does not count; None without one.
        around: What is around all that moves, grey level and colours, each float32 (row, column), reduced.
        resting: Further colours of it, of parts that the background holds for the most part, (colour, 3).
    """

    colours: np.ndarray
    grey_only: bool
    varied: bool
    contrast: float
    shadow: Shadow | None
    around: list[np.ndarray]
    resting: np.ndarray


def moving_colours(
    samples: Sequence[Frame], background: Background, colour: str, contrast: float
) -> MovingColours:
    """Find the mechanism's colours among the pixels that differ from the background.

    Args:
        samples: Frames of the clip.
        background: Its background.
        colour: ``auto``, ``grey`` or ``colour``.
        contrast: Least difference of a pixel that has changed [grey levels]; 0 takes it from what moves.

    Returns:
        The colours.

    Raises:
        VideoError: Next to no pixel differs from the background.
    """
    grey_only = colour == "grey" or background.chroma is None or any(f.chroma is None for f in samples)
    contrast = contrast or least_contrast(samples, background, grey_only)
    shadow = find_shadow(samples, background, contrast)
    around = surroundings(samples, background, contrast)
    pixels, absent = moving_pixels(samples, background, around, grey_only, contrast, shadow)
    if len(pixels) < LEAST_PIXELS:
        raise VideoError(
            "the clip: expected a mechanism that moves before a still background, got next to nothing "
            f"that differs from the background by more than {contrast:.2g} grey levels and "
            f"{CHANGED_NOISE:g} times its noise there. Either nothing moves, or it hardly stands out, or "
            "it covers the same place most of the time, or the camera moves before a background that does "
            "not show how: give a clip that shows motion, a lower --segment.contrast, or --background "
            "with a picture without the mechanism."
        )
    ways = [grey_only, True] if colour == "auto" and not grey_only else [grey_only]
    shown = pixels[:, SHOWN]
    found = on_all_cores(lambda grey: _clusters(shown, grey, contrast), ways)
    colours = found[0]
    if len(ways) > 1 and _grey_suffices(pixels, colours, contrast):
        grey_only, colours = True, found[1]
    varied = _is_varied(pixels, colours, grey_only)
    resting = _resting(pixels, absent, colours, grey_only, contrast)
    return MovingColours(colours, grey_only, varied, contrast, shadow, around, resting)


def lingering(samples: Sequence[Frame], background: Background, found: MovingColours) -> Covered | None:
    """Find where the first background shows the mechanism itself, because it stays there most of the time.

    Args:
        samples: Frames of the clip.
        background: Its background, which may hold parts of the mechanism.
        found: Colours of the mechanism.

    Returns:
        The pixels of such places that look like the mechanism, for each sample; None without any.
    """
    shape, near = background.luma.shape, NEAR_COLOUR * found.contrast
    # what is not of its grey level need not be looked at, nor most of the other pictures
    suspect = np.zeros(shape, dtype=np.bool_)
    colours = np.concatenate((found.colours, found.resting)).astype(np.float32)
    for grey in colours[:, 0]:
        suspect |= np.abs(background.luma - grey) < near
    rows, columns = np.divmod(np.flatnonzero(suspect), shape[1])
    usual = at_pixels(found.around, shape, rows, columns)

    def looks_like(picture: Frame | Background) -> np.ndarray:
        """Return at which of the pixels a picture is near a colour of the mechanism, and nearer than to what
        is around."""
        planes = [picture.luma, *(() if found.grey_only else picture.chroma or ())]
        shown = at_pixels(planes, shape, rows, columns)
        off = np.min([apart(shown, list(colour)) for colour in colours], axis=0)
        return (off < near**2) & (off < 0.25 * apart(shown, usual))

    likely = looks_like(background)
    rows, columns, usual = rows[likely], columns[likely], [plane[likely] for plane in usual]
    if not len(rows):
        return None
    small = None if background.chroma is None else background.chroma[0].shape
    extent = Window(int(rows.min()), int(rows.max()) + 1, int(columns.min()), int(columns.max()) + 1)
    window = whole_samples(extent, shape, small)
    masks = np.zeros((len(samples), window.bottom - window.top, window.right - window.left), dtype=np.bool_)
    masks[:, rows - window.top, columns - window.left] = on_all_cores(looks_like, samples)
    return Covered(list(masks), window) if masks.any() else None


def _is_varied(pixels: np.ndarray, colours: np.ndarray, grey_only: bool) -> bool:
    """Return whether many moving pixels are as far from every colour as from their background.

    Blur makes such pixels too, but not in the frames in which the mechanism is slow: the steadier fifth
    counts.
    """
    used = [0] if grey_only else [0, 1, 2]
    shown, behind = pixels[:, SHOWN][:, used], pixels[:, BEHIND][:, used]
    near = np.min([np.linalg.norm(shown - colour[used], axis=1) for colour in colours], axis=0)
    contrast = np.linalg.norm(shown - behind, axis=1)
    far = near > 0.7 * contrast
    shares = [float(np.mean(far[pixels[:, FRAME] == frame])) for frame in np.unique(pixels[:, FRAME])]
    return float(np.percentile(shares, 20.0)) > VARIED_SHARE


def _resting(
    pixels: np.ndarray, absent: np.ndarray, colours: np.ndarray, grey_only: bool, contrast: float
) -> np.ndarray:
    """Return colours of what moves, beside the main ones, of which the background holds a part, (colour, 3).

    A cart that moves by less than its length shows at its two ends only, too little for a main colour; but
    the background, in which it stands, shows it wherever a frame does not.
    """
    used = [0] if grey_only else [0, 1, 2]

    def near(values: np.ndarray, colour: np.ndarray, reach: float) -> np.ndarray:
        """Return which of some colours are near one, bool (pixel,)."""
        return np.linalg.norm(values[:, used] - colour[used], axis=1) < reach * contrast

    for colour in colours:
        absent = absent[~near(absent[:, BEHIND], colour, NEAR_COLOUR)]
    if len(absent) < LEAST_PIXELS:
        return np.zeros((0, 3))
    frames, found = 1 + int(max(pixels[:, FRAME].max(), absent[:, FRAME].max())), []
    for colour in _clusters(absent[:, BEHIND], grey_only, contrast):
        again, gone = (
            np.bincount(some[near(some[:, columns], colour, 1.0), FRAME].astype(int), minlength=frames)
            for some, columns in ((pixels, SHOWN), (absent, BEHIND))
        )
        if np.minimum(again, gone).sum() >= BALANCED * np.maximum(again, gone).sum():
            found.append(colour)
    return np.array(found).reshape(-1, 3)


def _clusters(some: np.ndarray, grey_only: bool, contrast: float) -> np.ndarray:
    """Return the main colours (colour, 3) by k-means, near ones merged, rare ones dropped."""
    import cv2

    values = some.astype(np.float32)
    if grey_only:
        values[:, 1:] = 0.0
    if float(values.std(axis=0).max()) < 1.0:
        return np.median(values, axis=0)[None].astype(np.float64)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.5)
    # k-means starts from random centres: the seed makes two runs identical
    cv2.setRNGSeed(1)
    _, labels, _ = cv2.kmeans(values, COLOURS, np.zeros(0, np.int32), criteria, 3, cv2.KMEANS_PP_CENTERS)
    # the largest cluster first, so that a smaller one near it is merged into it and not the other way round
    groups = [values[labels[:, 0] == k] for k in range(COLOURS)]
    groups = sorted((g for g in groups if len(g)), key=len, reverse=True)
    centres: list[np.ndarray] = []
    sizes: list[int] = []
    for group in groups:
        centre = medians(group)
        near = [i for i, other in enumerate(centres) if np.linalg.norm(other - centre) < MERGED * contrast]
        if near:
            i = near[0]
            centres[i] = (centres[i] * sizes[i] + centre * len(group)) / (sizes[i] + len(group))
            sizes[i] += len(group)
        else:
            centres.append(centre)
            sizes.append(len(group))
    kept = [c for c, n in zip(centres, sizes, strict=True) if n >= RARE * len(values)]
    return np.array(kept or centres[:1], dtype=np.float64)


def _grey_suffices(pixels: np.ndarray, colours: np.ndarray, contrast: float) -> bool:
    """Return whether the grey level alone distinguishes nearly every moving pixel from its background."""
    nearest = np.argmin(np.linalg.norm(pixels[:, None, SHOWN] - colours[None], axis=2), axis=1)
    grey = np.abs(colours[nearest, 0] - pixels[:, BEHIND][:, 0])
    return float(np.mean(grey > 2.5 * contrast)) > 0.9
