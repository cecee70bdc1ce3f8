"""From samples and background to the colours of the mechanism and every pixel's contrast with them.

Where the mechanism has the background's own colour the picture carries no information: such pixels are not
trusted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.arrays import medians
from monodyn.cores import on_all_cores
from monodyn.errors import VideoError
from monodyn.types import FULL, Frame
from monodyn.vision.foreground.background import SHOWN_NOISE, Background
from monodyn.vision.foreground.changes import (
    BEHIND,
    FRAME,
    MOST_CONTRAST,
    SHOWN,
    apart,
    full_size,
    least_contrast,
    moving_pixels,
    surroundings,
)
from monodyn.vision.foreground.covered import Covered, whole_samples
from monodyn.vision.foreground.masks import LEFT_OUT, NOT_SHOWN, VARIED, GeomColours, View, plain_view
from monodyn.vision.foreground.shadow import Shadow, find_shadow
from monodyn.vision.foreground.thinned import at_pixels
from monodyn.vision.foreground.thumbnails import Window

CHROMA_WEIGHT = 0.25
"""Weight of a colour difference against a grey difference: a chroma sample covers four pixels."""
BLACK = (16.0, 128.0, 128.0)
"""What a pixel without light shows: grey level, blue and red difference."""
_WEIGHTS = np.array([1.0, CHROMA_WEIGHT, CHROMA_WEIGHT])
"""Weights of the three channels."""
TRUSTED_NOISE = 60.0
"""Contrast over the noise of a pixel from which it has full weight: then noise moves an edge less than
shading does."""
NEAR_COLOUR = 2.0
"""Pixels within this distance of one of the mechanism's colours look like it [least contrasts]."""
VARIED_SHARE = 0.1
"""Share of moving pixels unlike every colour from which the mechanism counts as varied."""
VARIED_TRUST = 0.1
"""Trust of a pixel that differs from the background but has none of the mechanism's colours."""
COLOURS = 3
"""Most colours a mechanism may have."""
MERGED = 3.2
"""Clusters of moving pixels closer than this are one colour [least contrasts]."""
RARE = 0.12
"""Share of the moving pixels below which a cluster is no colour of the mechanism."""
AT_ONCE = 50_000
"""Pixels whose contrast is computed at a time."""
LEAST_PIXELS = 50
"""Moving pixels below which nothing moves."""


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
        contrast: Least difference of a pixel that has changed [grey levels].
        shadow: The mechanism's shadow, which does not count; None without one.
        dimmed: How much of each colour is taken out of its difference from the background, because more or
            less light would do the same: at full size and at that of the chroma, float32 (colour, height,
            width) each; None where light is even or grey alone counts.
    """

    colours: np.ndarray
    scale: np.ndarray
    grey_only: bool
    trust: np.ndarray
    varied: bool = False
    part: np.ndarray | None = None
    shaded: np.ndarray | None = None
    contrast: float = MOST_CONTRAST
    shadow: Shadow | None = None
    dimmed: tuple[np.ndarray, np.ndarray] | None = None

    def view(self, geoms: int) -> View:
        """Return how the planes are to be read; before the colours are measured, one plane for all geoms.

        Args:
            geoms: Number of geoms of the mechanism.

        Returns:
            Trust of the planes and the plane of each geom.
        """
        if self.part is None or self.shaded is None:
            return plain_view(self.least_trust, geoms)
        border = len(self.colours) if self.any_difference and not self.varied else -1
        return View(self.trust, self.part, self.shaded, border)

    @property
    def least_trust(self) -> np.ndarray:
        """Trust in the least distinct colour, float32 (height, width)."""
        return self.trust[-1] if self.varied else self.trust[: len(self.colours)].min(axis=0)

    @property
    def any_difference(self) -> bool:
        """True where the mask has a last plane that counts any difference from the background."""
        return len(self.trust) > len(self.colours)


def choose_palette(samples: Sequence[Frame], background: Background, colour: str, contrast: float) -> Palette:
    """Find the mechanism's colours among the pixels that differ from the background.

    Args:
        samples: Frames of the clip.
        background: Its background.
        colour: ``auto``, ``grey`` or ``colour``.
        contrast: Least difference of a pixel that has changed [grey levels]; 0 takes it from what moves.

    Returns:
        The palette.

    Raises:
        VideoError: No pixel differs from the background: nothing moves.
    """
    grey_only = colour == "grey" or background.chroma is None or any(f.chroma is None for f in samples)
    contrast = contrast or least_contrast(samples, background, grey_only)
    shadow = find_shadow(samples, background, contrast)
    pixels = moving_pixels(samples, background, grey_only, contrast, shadow)
    if len(pixels) < LEAST_PIXELS:
        raise VideoError(
            "the clip: expected a mechanism that moves, got a still picture; nothing differs from the "
            f"background by more than {contrast:.2g} grey levels; give a clip that shows motion, or a lower "
            "--segment.contrast."
        )
    ways = [grey_only, True] if colour == "auto" and not grey_only else [grey_only]
    found = on_all_cores(lambda grey: _clusters(pixels, grey, contrast), ways)
    colours = found[0]
    if len(ways) > 1 and _grey_suffices(pixels, colours, contrast):
        grey_only, colours = True, found[1]
    varied = _is_varied(pixels, colours, grey_only)
    palette = _palette(colours, background, grey_only, VARIED_TRUST if varied else None)
    return replace(palette, varied=varied, contrast=contrast, shadow=shadow)


def measured_palette(palette: Palette, background: Background, measured: GeomColours) -> Palette:
    """Return the palette by colours that were measured on the located mechanism.

    Args:
        palette: The palette without them. The choice between grey and colour has been made from the moving
            pixels, and stays, as do the least contrast and the shadow.
        background: The clip's background.
        measured: The colours.

    Returns:
        A palette with a plane for each geom.
    """
    varied = bool(np.any(measured.part == VARIED))
    any_trust = VARIED_TRUST if varied else None
    if measured.camouflaged and not varied:
        # a border stands out by the least contrast or more
        any_trust = max(VARIED_TRUST, palette.contrast / (TRUSTED_NOISE * background.noise))
    found = _palette(measured.colours, background, palette.grey_only, any_trust, measured.light)
    # the plane of any difference comes after those of the colours
    part = np.where(measured.part == VARIED, len(measured.colours), measured.part)
    part = np.where(measured.part == NOT_SHOWN, LEFT_OUT, part)
    return replace(
        found,
        varied=varied,
        part=part,
        shaded=measured.shaded,
        contrast=palette.contrast,
        shadow=palette.shadow,
    )


def palette_over(palette: Palette, background: Background) -> Palette:
    """Return a palette over another background of the clip.

    Args:
        palette: The palette, before colours are measured on the located mechanism.
        background: The background.
    """
    any_trust = VARIED_TRUST if palette.varied else None
    found = _palette(palette.colours, background, palette.grey_only, any_trust)
    return replace(found, varied=palette.varied, contrast=palette.contrast, shadow=palette.shadow)


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


def lingering(samples: Sequence[Frame], background: Background, palette: Palette) -> Covered | None:
    """Find where the first background shows the mechanism itself, because it stays there most of the time.

    Args:
        samples: Frames of the clip.
        background: Its background, which may hold parts of the mechanism.
        palette: Colours of the mechanism.

    Returns:
        The pixels of such places that look like the mechanism, for each sample; None without any.
    """
    still = surroundings(samples, background, palette.contrast)
    shape, near = background.luma.shape, NEAR_COLOUR * palette.contrast
    # what is not of its grey level need not be looked at, nor most of the other pictures
    suspect = np.zeros(shape, dtype=np.bool_)
    for grey in palette.colours[:, 0].astype(np.float32):
        suspect |= np.abs(background.luma - grey) < near
    rows, columns = np.nonzero(suspect)
    usual = at_pixels(still, shape, rows, columns)

    def looks_like(picture: Frame | Background) -> np.ndarray:
        """Return at which of the pixels a picture is near a colour of the mechanism, and nearer than to what
        is around."""
        planes = [picture.luma, *(() if palette.grey_only else picture.chroma or ())]
        shown = at_pixels(planes, shape, rows, columns)
        off = np.min([apart(shown, list(colour)) for colour in palette.colours.astype(np.float32)], axis=0)
        return (off < near**2) & (off < 0.25 * apart(shown, usual))

    likely = looks_like(background)
    rows, columns, usual = rows[likely], columns[likely], [plane[likely] for plane in usual]
    if not len(rows):
        return None
    small = None if background.chroma is None else background.chroma[0].shape
    extent = Window(int(rows.min()), int(rows.max()) + 1, int(columns.min()), int(columns.max()) + 1)
    window = whole_samples(extent, shape, small)
    found = np.zeros((len(samples), window.bottom - window.top, window.right - window.left), dtype=np.bool_)
    found[:, rows - window.top, columns - window.left] = on_all_cores(looks_like, samples)
    return Covered(list(found), window)


def _clusters(pixels: np.ndarray, grey_only: bool, contrast: float) -> np.ndarray:
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


def _palette(
    colours: np.ndarray,
    background: Background,
    grey_only: bool,
    any_trust: float | None,
    light: np.ndarray | None = None,
) -> Palette:
    """Compute each pixel's contrast with every colour, zero where the noise hides it.

    With ``light``, the standard deviation of the light on each colour, light counts as noise does;
    ``any_trust`` is the trust in a last plane of any difference, None for no such plane.
    """
    planes = full_size(background.luma, None if grey_only else background.chroma)
    shape, dimmed = (len(colours), *background.luma.shape), None
    if light is not None and not grey_only and background.chroma is not None:
        small = [_resized(background.luma, background.chroma[0].shape[::-1]), *background.chroma]
        dimmed = np.empty(shape, np.float32), _dimming(small, colours, light, background.noise)
    noise = np.broadcast_to(background.pixel_noise, shape[1:])
    scale = np.empty(shape, np.float32)
    trust = np.empty((shape[0] + (any_trust is not None), *shape[1:]), np.float32)
    step = max(1, AT_ONCE // shape[2])
    # what some rows need is at hand, and what all of them need at once would fill the memory
    for rows in (slice(first, first + step) for first in range(0, shape[1], step)):
        part = [plane[rows] for plane in planes]
        full = strength = _contrast(part, colours)
        if light is not None and dimmed is not None:
            dimmed[0][:, rows] = whole = _dimming(part, colours, light, background.noise)
            strength = full - whole * _contrast(part, colours, lit=True)
        # too little contrast would blow the noise up to full coverage: such a pixel shows nothing
        seen, known = strength > (SHOWN_NOISE * noise[rows]) ** 2, background.known[rows]
        scale[:, rows] = np.where(seen, FULL / np.maximum(strength, 1.0), 0.0)
        sure = np.sqrt(np.where(seen, full, 0.0)) / (TRUSTED_NOISE * noise[rows])
        trust[: len(colours), rows] = np.minimum(sure, 1.0) * known
        if any_trust is not None:
            trust[-1, rows] = any_trust * known
    shown = colours.copy()
    if grey_only:
        shown[:, 1:] = np.nan
    return Palette(shown, scale, grey_only, trust, dimmed=dimmed)


def _contrast(planes: Sequence[np.ndarray], colours: np.ndarray, *, lit: bool = False) -> np.ndarray:
    """Return the weighted square of each colour's difference d from the background, or with ``lit`` its
    product with the colour's own f, by which light changes it, (colour, height, width)."""
    weights, f = _WEIGHTS.tolist(), colours - BLACK
    return np.stack(
        [
            sum(
                w * (value - plane) * (own if lit else value - plane)
                for w, value, own, plane in zip(weights, colour, lightened, planes, strict=False)
            )
            for colour, lightened in zip(colours.astype(np.float32), f.astype(np.float32), strict=True)
        ]
    )


def _dimming(
    planes: Sequence[np.ndarray], colours: np.ndarray, light: np.ndarray, noise: float
) -> np.ndarray:
    """Return how much of its own colour f is taken out of each colour's difference d from the background.

    With noise of variance n^2 / W in the channels and light of standard deviation s, what a colour shows has
    the covariance C = n^2 / W + s^2 f f'. The projection with the least error is on C^-1 d, which is W (d -
    k f) but for a factor, with k = s^2 d'W f / (n^2 + s^2 f'W f).

    Source:
        Fisher, "The use of multiple measurements in taxonomic problems", 1936; inverse by Sherman and
        Morrison.
    """
    power = ((colours - BLACK) ** 2 @ _WEIGHTS)[:, np.newaxis, np.newaxis]
    spread = (light**2)[:, np.newaxis, np.newaxis]
    product = _contrast(planes, colours, lit=True)
    share = spread / (noise**2 + spread * power) * product
    # where more or less light alone could make the difference, nothing but the difference shows the mechanism
    rest = _contrast(planes, colours) - share * product
    return np.where(rest > (SHOWN_NOISE * noise) ** 2, share, 0.0).astype(np.float32)


def _resized(plane: np.ndarray, size: tuple[int, ...]) -> np.ndarray:
    """Return a plane reduced to a width and height."""
    import cv2

    return cv2.resize(plane, size, interpolation=cv2.INTER_AREA)
