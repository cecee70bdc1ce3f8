"""From samples and background to the colours of the mechanism and every pixel's contrast with them.

Where the mechanism has the background's own colour the picture carries no information: such pixels are not
trusted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.errors import VideoError
from monodyn.types import FULL, Frame
from monodyn.vision.foreground.background import Background
from monodyn.vision.foreground.masks import VARIED, GeomColours, View, plain_view

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
COLOURS = 3
"""Most colours a mechanism may have."""
MERGED = 45.0
"""Clusters of moving pixels closer than this are one colour [grey levels]."""
RARE = 0.12
"""Share of the moving pixels below which a cluster is no colour of the mechanism."""
LEAST_PIXELS = 50
"""Moving pixels below which nothing moves."""

SHOWN, BEHIND, FRAME = slice(0, 3), slice(3, 6), 6
"""Columns of a table of pixels: colour, colour of the background there, and number of the frame."""
PIXEL_COLUMNS = FRAME + 1
"""Number of these columns."""


@dataclass(frozen=True, eq=False)
class Palette:
    """Colours of the mechanism.

    Attributes:
        colours: Grey level, blue and red difference of each colour, (colour, 3); the last two are NaN for a
            grey clip.
        scale: ``FULL`` over the squared contrast ``|F - B|^2``, 0 where the contrast is too low, float32
            (colour, height, width).
        grey_only: True where grey alone distinguishes the mechanism from the background.
        trust: How reliably a pixel distinguishes the mechanism from the background in each plane of the mask,
            0 to 1, float32 (plane, height, width).
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

        Returns:
            Trust of the planes and the plane of each geom.
        """
        if self.part is None or self.shaded is None:
            return plain_view(self.least_trust, geoms)
        return View(self.trust, self.part, self.shaded)

    @property
    def least_trust(self) -> np.ndarray:
        """Trust in the least distinct colour, float32 (height, width)."""
        return self.trust[-1] if self.varied else self.trust.min(axis=0)


def choose_palette(
    samples: Sequence[Frame],
    background: Background,
    colour: str,
    contrast: float,
    measured: GeomColours | None = None,
) -> Palette:
    """Find the mechanism's colours among the pixels that differ from the background.

    Args:
        samples: Frames of the clip.
        background: Its background.
        colour: ``auto``, ``grey`` or ``colour``.
        contrast: Least difference that counts as seen [grey levels].
        measured: Colours measured on the mechanism; else the main colours of the moving pixels are taken.

    Returns:
        The palette.

    Raises:
        VideoError: No pixel differs from the background: nothing moves.
    """
    grey_only = colour == "grey" or background.chroma is None or any(f.chroma is None for f in samples)
    pixels = _moving_pixels(samples, background, grey_only, contrast)
    if len(pixels) < LEAST_PIXELS:
        raise VideoError(
            "the clip: expected a mechanism that moves, got a still picture; nothing differs from the "
            f"background by more than {contrast:g} grey levels (--segment.contrast lowers that)."
        )
    colours = _clusters(pixels, grey_only) if measured is None else measured.colours
    if colour == "auto" and not grey_only:
        grey_only = _grey_suffices(pixels, colours, contrast)
    if grey_only and measured is None:
        colours = _clusters(pixels, True)
    if measured is None:
        return _palette(colours, background, grey_only, contrast, _is_varied(pixels, colours, grey_only))
    palette = _palette(colours, background, grey_only, contrast, bool(np.any(measured.part == VARIED)))
    # the plane of any difference comes after those of the colours
    part = np.where(measured.part == VARIED, len(colours), measured.part)
    return replace(palette, part=part, shaded=measured.shaded)


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
    """Gather the colours of inner foreground pixels, those of their backgrounds and the frames' numbers, in
    the columns named above, (pixel, column)."""
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
        # Where the first background shows the mechanism itself, what moves is its absence: such a pixel is
        # more like its surroundings than the background is, and does not count.
        moving &= _apart(planes, around) > _apart(behind, around)
        # pixels at an edge are mixed with the background; only a thin mechanism has no others
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
    return np.concatenate(rows).astype(np.float64) if rows else np.zeros((0, PIXEL_COLUMNS))


def _surroundings(samples: Sequence[Frame], background: Background) -> list[np.ndarray]:
    """Return the background's planes, where anything moves filled from around it, each (height, width)."""
    import cv2

    stack = np.stack([frame.luma for frame in samples[:: max(1, len(samples) // 24)]])
    moves = (stack.max(axis=0).astype(np.int16) - stack.min(axis=0)) > max(16.0, 8.0 * background.noise)
    # A blur in which moving pixels have no weight, normalized by the blurred weights: it fills the places
    # where anything moves from the still ones around them.
    still = 1.0 - cv2.dilate(moves.astype(np.uint8), np.ones((5, 5), np.uint8)).astype(np.float32)
    size = (still.shape[1] // 8, still.shape[0] // 8)
    blur = 0.06 * max(size)

    def blurred(plane: np.ndarray) -> np.ndarray:
        return cv2.GaussianBlur(cv2.resize(plane, size, interpolation=cv2.INTER_AREA), (0, 0), blur)

    weight = np.maximum(blurred(still), 1e-6)
    full = (still.shape[1], still.shape[0])
    planes = _full_size(background.luma, background.chroma)
    return [cv2.resize(blurred(still * p) / weight, full, interpolation=cv2.INTER_LINEAR) for p in planes]


def _clusters(pixels: np.ndarray, grey_only: bool) -> np.ndarray:
    """Return the main colours (colour, 3) by k-means, near ones merged, rare ones dropped."""
    import cv2

    values = pixels[:, SHOWN].astype(np.float32)
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
        centre = np.median(group, axis=0)
        near = [i for i, other in enumerate(centres) if np.linalg.norm(other - centre) < MERGED]
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
    # too little contrast would blow the noise up to full coverage: such a pixel shows nothing
    seen = strength > contrast**2
    scale = np.where(seen, FULL / np.maximum(strength, 1.0), 0.0)
    trust = np.clip(np.sqrt(np.where(seen, strength, 0.0)) / TRUSTED_CONTRAST, 0.0, 1.0) * background.known
    if varied:
        trust = np.concatenate([trust, VARIED_TRUST * background.known[np.newaxis]])
    shown = colours.copy()
    if grey_only:
        shown[:, 1:] = np.nan
    return Palette(shown, scale.astype(np.float32), grey_only, trust.astype(np.float32), varied, None, None)
