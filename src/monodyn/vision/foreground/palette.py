"""From samples and background to the colours of the mechanism and every pixel's contrast with them.

Where the mechanism has the background's own colour the picture says nothing: such pixels are not trusted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from monodyn.errors import VideoError
from monodyn.types import FULL, Frame
from monodyn.vision.foreground.background import Background

CHROMA_WEIGHT = 0.25
"""Weight of a colour difference against a grey difference: a chroma sample covers four pixels."""
NEAR_COLOUR = 30.0
"""Pixels within this distance of one of the mechanism's colours look like it [grey levels]."""
TRUSTED_CONTRAST = 60.0
"""Contrast from which a pixel has full weight [grey levels]."""
VARIED_SHARE = 0.1
"""Share of moving pixels unlike every colour from which the mechanism counts as varied."""
VARIED_TRUST = 0.1
"""Trust of a pixel that differs from the background but has none of the mechanism's colours."""
VARIED = -1
"""Stands for the colour of a geom that has none of its own."""
COLOURS = 3
"""Most colours a mechanism may have."""


class View(NamedTuple):
    """How the planes of a mask are to be read; arguments of the contour kernels, in their order.

    Attributes:
        trust: How well each pixel tells each plane from the background, float32 (plane, height, width).
        part: Plane of each geom, int64 (geom,).
        shaded: True for geoms whose edges are taken against their own level, bool (geom,).
    """

    trust: np.ndarray
    part: np.ndarray
    shaded: np.ndarray


@dataclass(frozen=True, eq=False)
class Palette:
    """Colours of the mechanism.

    Attributes:
        colours: Grey level, blue and red difference of each colour, (colour, 3); the last two are NaN for a
            grey clip.
        scale: ``FULL`` over the squared contrast ``|F - B|^2``, 0 where the contrast is too low, float32
            (colour, height, width).
        grey_only: True where grey alone tells the mechanism from the background.
        trust: How well a pixel tells each plane of the mask from the background, 0 to 1, float32
            (plane, height, width).
        varied: True where the colours leave much of the mechanism unexplained (a shiny rod): then a last
            plane of the mask counts any difference from the background as foreground too.
        part: Plane of the mask for each geom once its colour has been measured, int64 (geom,), or None.
        shaded: True for geoms that show their colour at many levels, bool (geom,), or None before.
    """

    colours: np.ndarray
    scale: np.ndarray
    grey_only: bool
    trust: np.ndarray
    varied: bool
    part: np.ndarray | None
    shaded: np.ndarray | None

    def view(self, geoms: int) -> View:
        """Return how the planes are to be read; before the colours are measured, one plane for all geoms.

        Args:
            geoms: Number of geoms of the mechanism.
        """
        if self.part is None or self.shaded is None:
            return View(self.least_trust[np.newaxis], np.zeros(geoms, np.int64), np.zeros(geoms, np.bool_))
        return View(self.trust, self.part, self.shaded)

    @property
    def least_trust(self) -> np.ndarray:
        """How well a pixel tells the least distinct colour from the background, float32 (height, width)."""
        return self.trust[-1] if self.varied else self.trust.min(axis=0)


@dataclass(frozen=True, eq=False)
class Parts:
    """Colours measured on the geoms of a located mechanism.

    Attributes:
        colours: Grey level, blue and red difference of each colour, (colour, 3).
        part: Colour of each geom, int64 (geom,); ``VARIED`` for one that has none of its own.
        shaded: True for geoms that show it at many levels, bool (geom,).
    """

    colours: np.ndarray
    part: np.ndarray
    shaded: np.ndarray


def choose_palette(
    samples: Sequence[Frame], background: Background, colour: str, contrast: float, parts: Parts | None = None
) -> Palette:
    """Find the mechanism's colours among the pixels that differ from the background.

    Args:
        samples: Frames of the clip.
        background: Its background.
        colour: ``auto``, ``grey`` or ``colour``.
        contrast: Least difference that counts as seen [grey levels].
        parts: Colours measured on the mechanism; else the main colours of the moving pixels are taken.

    Returns:
        The palette.

    Raises:
        VideoError: no pixel differs from the background: nothing moves.
    """
    grey_only = colour == "grey" or background.chroma is None or any(f.chroma is None for f in samples)
    pixels = _moving_pixels(samples, background, grey_only, contrast)
    if len(pixels) < 50:
        raise VideoError(
            "the clip: expected a mechanism that moves, got a still picture; nothing differs from the "
            f"background by more than {contrast:g} grey levels (--segment.contrast lowers that)."
        )
    colours = _clusters(pixels, grey_only) if parts is None else parts.colours
    if colour == "auto" and not grey_only:
        grey_only = _grey_suffices(pixels, colours, contrast)
    if grey_only and parts is None:
        colours = _clusters(pixels, True)
    if parts is None:
        return _palette(colours, background, grey_only, contrast, _is_varied(pixels, colours, grey_only))
    palette = _palette(colours, background, grey_only, contrast, bool(np.any(parts.part == VARIED)))
    part = np.where(parts.part == VARIED, len(colours), parts.part)
    return replace(palette, part=part, shaded=parts.shaded)


def _is_varied(pixels: np.ndarray, colours: np.ndarray, grey_only: bool) -> bool:
    """Return whether many moving pixels are as far from every colour as from their background.

    Blur makes such pixels too, but not in the frames in which the mechanism is slow: the steadier fifth
    counts.
    """
    used = [0] if grey_only else [0, 1, 2]
    near = np.min([np.linalg.norm(pixels[:, used] - colour[used], axis=1) for colour in colours], axis=0)
    contrast = np.linalg.norm(pixels[:, used] - pixels[:, [3 + i for i in used]], axis=1)
    far = near > 0.7 * contrast
    shares = [float(np.mean(far[pixels[:, 6] == frame])) for frame in np.unique(pixels[:, 6])]
    return float(np.percentile(shares, 20.0)) > VARIED_SHARE


def lingering(samples: Sequence[Frame], background: Background, palette: Palette) -> list[np.ndarray]:
    """Find where the first background shows the mechanism itself, because it stays there most of the time.

    Args:
        samples: Frames of the clip.
        background: Its background, which may hold parts of the mechanism.
        palette: Colours of the mechanism.

    Returns:
        For each sample the pixels of such places that look like the mechanism, bool (height, width).
    """
    around = _surroundings(samples, background)
    suspect = _looks_like(background.luma, background.chroma, palette, around)
    return [suspect & _looks_like(frame.luma, frame.chroma, palette, around) for frame in samples]


def _looks_like(
    luma: np.ndarray, chroma: tuple[np.ndarray, np.ndarray] | None, palette: Palette, around: list[np.ndarray]
) -> np.ndarray:
    """Return where a picture is near a colour of the mechanism and nearer to it than to the surroundings."""
    planes = _full_size(luma, None if palette.grey_only else chroma)
    colours = palette.colours.astype(np.float32)
    near = np.min([_apart(planes, list(colour)) for colour in colours], axis=0)
    return (near < NEAR_COLOUR**2) & (near < 0.25 * _apart(planes, around))


def _apart(planes: list[np.ndarray], other: list) -> np.ndarray:
    """Return the squared distance of colours [grey levels squared]."""
    return sum((plane - value) ** 2 for plane, value in zip(planes, other, strict=False))  # type: ignore[return-value]


def _full_size(luma: np.ndarray, chroma: tuple[np.ndarray, np.ndarray] | None) -> list[np.ndarray]:
    """Return the planes of a picture at full size, float32 (height, width) each."""
    import cv2

    size = (luma.shape[1], luma.shape[0])
    small = () if chroma is None else chroma
    return [luma.astype(np.float32)] + [
        cv2.resize(plane.astype(np.float32), size, interpolation=cv2.INTER_LINEAR) for plane in small
    ]


def _moving_pixels(
    samples: Sequence[Frame],
    background: Background,
    grey_only: bool,
    contrast: float,
) -> np.ndarray:
    """Gather colours of inner foreground pixels beside their backgrounds and the frame's number: (pixel,
    7)."""
    import cv2

    rows = []
    behind = _full_size(background.luma, None if grey_only else background.chroma)
    inner = np.ones((3, 3), np.uint8)
    around = _surroundings(samples, background)
    picks = range(0, len(samples), max(1, len(samples) // 24))
    for i in picks:
        frame = samples[i]
        planes = _full_size(frame.luma, None if grey_only else frame.chroma)
        moving = _apart(planes, behind) > max(contrast, 5.0 * background.noise) ** 2
        moving &= _apart(planes, around) > _apart(behind, around)
        core = cv2.erode(moving.astype(np.uint8), inner) > 0
        if core.sum() < 20:
            core = moving
        y, x = np.nonzero(core)
        step = max(1, len(y) // 1500)
        y, x = y[::step], x[::step]
        columns = [plane[y, x] for plane in planes + behind]
        if grey_only:
            blank = np.zeros(len(y))
            columns = [columns[0], blank, blank, columns[1], blank, blank]
        rows.append(np.column_stack([*columns, np.full(len(y), i)]))
    return np.concatenate(rows).astype(np.float64) if rows else np.zeros((0, 7))


def _surroundings(samples: Sequence[Frame], background: Background) -> list[np.ndarray]:
    """Return the background's planes, where anything moves filled from around it, each (height, width)."""
    import cv2

    stack = np.stack([frame.luma for frame in samples[:: max(1, len(samples) // 24)]])
    moves = (stack.max(axis=0).astype(np.int16) - stack.min(axis=0)) > max(16.0, 8.0 * background.noise)
    still = 1.0 - cv2.dilate(moves.astype(np.uint8), np.ones((5, 5), np.uint8)).astype(np.float32)
    size = (still.shape[1] // 8, still.shape[0] // 8)
    blur = 0.06 * max(size)

    def spread(plane: np.ndarray) -> np.ndarray:
        return cv2.GaussianBlur(cv2.resize(plane, size, interpolation=cv2.INTER_AREA), (0, 0), blur)

    weight = np.maximum(spread(still), 1e-6)
    full = (still.shape[1], still.shape[0])
    planes = _full_size(background.luma, background.chroma)
    return [cv2.resize(spread(still * p) / weight, full, interpolation=cv2.INTER_LINEAR) for p in planes]


def _clusters(pixels: np.ndarray, grey_only: bool) -> np.ndarray:
    """Return the main colours (colour, 3) by k-means, near ones merged, rare ones dropped."""
    import cv2

    values = pixels[:, :3].astype(np.float32)
    if grey_only:
        values[:, 1:] = 0.0
    if float(values.std(axis=0).max()) < 1.0:
        return np.median(values, axis=0)[None].astype(np.float64)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.5)
    cv2.setRNGSeed(1)
    _, labels, _ = cv2.kmeans(values, COLOURS, np.zeros(0, np.int32), criteria, 3, cv2.KMEANS_PP_CENTERS)
    groups = [values[labels[:, 0] == k] for k in range(COLOURS)]
    groups = sorted((g for g in groups if len(g)), key=len, reverse=True)
    centres: list[np.ndarray] = []
    sizes: list[int] = []
    for group in groups:
        centre = np.median(group, axis=0)
        near = [i for i, other in enumerate(centres) if np.linalg.norm(other - centre) < 45.0]
        if near:
            i = near[0]
            centres[i] = (centres[i] * sizes[i] + centre * len(group)) / (sizes[i] + len(group))
            sizes[i] += len(group)
        else:
            centres.append(centre)
            sizes.append(len(group))
    kept = [c for c, n in zip(centres, sizes, strict=True) if n >= 0.12 * len(values)]
    return np.array(kept or centres[:1], dtype=np.float64)


def _grey_suffices(pixels: np.ndarray, colours: np.ndarray, contrast: float) -> bool:
    """Return whether the grey level alone tells nearly every moving pixel from its background."""
    nearest = np.argmin(np.linalg.norm(pixels[:, None, :3] - colours[None], axis=2), axis=1)
    grey = np.abs(colours[nearest, 0] - pixels[:, 3])
    return float(np.mean(grey > 2.5 * contrast)) > 0.9


def _palette(
    colours: np.ndarray, background: Background, grey_only: bool, contrast: float, varied: bool
) -> Palette:
    """Compute each pixel's contrast with every colour, zero below the least contrast."""
    planes = _full_size(background.luma, None if grey_only else background.chroma)
    weights = [1.0, CHROMA_WEIGHT, CHROMA_WEIGHT]
    strength = np.stack(
        [
            sum(w * (value - plane) ** 2 for w, value, plane in zip(weights, colour, planes, strict=False))
            for colour in colours.astype(np.float32)
        ]
    )
    seen = strength > contrast**2
    scale = np.where(seen, FULL / np.maximum(strength, 1.0), 0.0)
    trust = np.clip(np.sqrt(np.where(seen, strength, 0.0)) / TRUSTED_CONTRAST, 0.0, 1.0) * background.known
    if varied:
        trust = np.concatenate([trust, VARIED_TRUST * background.known[np.newaxis]])
    shown = colours.copy()
    if grey_only:
        shown[:, 1:] = np.nan
    return Palette(shown, scale.astype(np.float32), grey_only, trust.astype(np.float32), varied, None, None)
