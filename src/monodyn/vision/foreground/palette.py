"""From samples and background to the colours of the mechanism and every pixel's contrast with them.

Where the mechanism has the background's own colour the picture carries no information: such pixels are not
trusted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.types import FULL
from monodyn.vision.foreground import masks
from monodyn.vision.foreground.background import SHOWN_NOISE, Background
from monodyn.vision.foreground.changes import MOST_CONTRAST, full_size
from monodyn.vision.foreground.covered import reduced_mask
from monodyn.vision.foreground.moving_colours import MovingColours
from monodyn.vision.foreground.shadow import Shadow

CHROMA_WEIGHT = 0.25
"""Weight of a colour difference against a grey difference: a chroma sample covers four pixels."""
BLACK = (16.0, 128.0, 128.0)
"""What a pixel without light shows: grey level, blue and red difference."""
_WEIGHTS = np.array([1.0, CHROMA_WEIGHT, CHROMA_WEIGHT])
"""Weights of the three channels."""
TRUSTED_NOISE = 60.0
"""Contrast over the noise of a pixel from which it has full weight: then noise moves an edge less than
shading does."""
VARIED_TRUST = 0.1
"""Trust of a pixel that differs from the background but has none of the mechanism's colours."""
APART = 0.1
"""Coverage by a geom's colour that another geom shows, up to which edges of the first show before it."""
UNMIXED, UNMIXED_SHARE = 0.3, 0.9
"""What is left of the squared contrast of a colour without what another one has of it, from which that is
taken out; and share of the pixels where as much is left."""
THINNED = 8
"""Every so many pixels along a side tell it."""
ALIKE = 1 / 3
"""Distance from the wall around it, or from a colour of the mechanism, from which on a pixel shows neither,
as a share of their distance."""
AROUND_PX = 3.0
"""How far around a pixel the wall is looked at [px]."""
AT_ONCE = 50_000
"""Pixels whose contrast is computed at a time."""


@dataclass(frozen=True, eq=False)
class Palette:
    """Colours of the mechanism.

    Attributes:
        colours: Grey level, blue and red difference of each colour, (colour, 3); the last two are NaN for a
            grey clip.
        scale: ``FULL`` over the squared contrast ``|F - B|^2``, 0 where the contrast is too low, float32
            (colour, height, width); over what is left of that where another colour is taken out.
        grey_only: True where grey alone distinguishes the mechanism from the background.
        trust: How reliably a pixel distinguishes the mechanism from the background in each plane of the mask,
            0 to 1, float32 (plane, height, width).
        varied: True where the colours leave much of the mechanism unexplained (a shiny rod): then a last
            plane of the mask counts any difference from the background as foreground too.
        part: Plane of the mask for each geom once its colour has been measured, int64 (geom,), or None.
        shaded: True for geoms that show their colour at many levels, bool (geom,), or None before.
        order: Which geoms lie in front of which, see `View`, int8 (geom, geom), or None.
        contrast: Least difference of a pixel that has changed [grey levels].
        shadow: The mechanism's shadow, which does not count; None without one.
        dimmed: How much of each colour is taken out of its difference from the background, because more or
            less light would do the same: at full size and at that of the chroma, float32 (colour, height,
            width) each; None where light is even or grey alone counts.
        other: Colour that is taken out of the coverage by each, and vice versa, -1 for none, int64 (colour,);
            None for all.
        taken: How much of the other's product with the difference is taken out, 0 where either is not seen or
            too little would be left, float32 (colour, height, width), or None.
    """

    colours: np.ndarray
    scale: np.ndarray
    grey_only: bool
    trust: np.ndarray
    varied: bool = False
    part: np.ndarray | None = None
    shaded: np.ndarray | None = None
    order: np.ndarray | None = None
    contrast: float = MOST_CONTRAST
    shadow: Shadow | None = None
    dimmed: tuple[np.ndarray, np.ndarray] | None = None
    other: np.ndarray | None = None
    taken: np.ndarray | None = None

    def view(self, geoms: int) -> masks.View:
        """Return how the planes are to be read; before the colours are measured, one plane for all geoms.

        Args:
            geoms: Number of geoms of the mechanism.

        Returns:
            Trust of the planes and the plane of each geom.
        """
        if self.part is None or self.shaded is None:
            return masks.plain_view(self.least_trust, geoms)
        border = len(self.colours) if self.any_difference and not self.varied else -1
        order = masks.no_order(geoms) if self.order is None else self.order
        return masks.View(self.trust, self.part, self.shaded, order, border)

    @property
    def least_trust(self) -> np.ndarray:
        """Trust in the least distinct colour, float32 (height, width)."""
        return self.trust[-1] if self.varied else self.trust[: len(self.colours)].min(axis=0)

    @property
    def any_difference(self) -> bool:
        """True where the mask has a last plane that counts any difference from the background."""
        return len(self.trust) > len(self.colours)


def palette_of(found: MovingColours, background: Background) -> Palette:
    """Return the palette of colours over a background of the clip.

    Args:
        found: The colours of what moves.
        background: The background.
    """
    any_trust = VARIED_TRUST if found.varied else None
    palette = _palette(found.colours, background, found.grey_only, any_trust)
    return replace(palette, varied=found.varied, contrast=found.contrast, shadow=found.shadow)


def measured_palette(palette: Palette, background: Background, measured: masks.GeomColours) -> Palette:
    """Return the palette by colours that were measured on the located mechanism.

    Args:
        palette: The palette without them. The choice between grey and colour has been made from the moving
            pixels, and stays, as do the least contrast and the shadow.
        background: The clip's background.
        measured: The colours.

    Returns:
        A palette with a plane for each geom.
    """
    varied = bool(np.any(measured.part == masks.VARIED))
    any_trust = VARIED_TRUST if varied else None
    if measured.camouflaged and not varied:
        # a border stands out by the least contrast or more
        any_trust = max(VARIED_TRUST, palette.contrast / (TRUSTED_NOISE * background.noise))
    found = _palette(measured.colours, background, palette.grey_only, any_trust, measured.light)
    # the plane of any difference comes after those of the colours
    part = np.where(measured.part == masks.VARIED, len(measured.colours), measured.part)
    part = np.where(measured.part == masks.NOT_SHOWN, masks.LEFT_OUT, part)
    order = None if measured.order is None else np.array(measured.order)
    other = np.full(len(measured.colours), -1) if order is None else _shown(order, part, found, background)
    if np.any(other >= 0):
        found = _palette(
            measured.colours, background, palette.grey_only, any_trust, measured.light, other=other
        )
    return replace(
        found,
        varied=varied,
        part=part,
        shaded=measured.shaded,
        order=order,
        contrast=palette.contrast,
        shadow=palette.shadow,
    )


def with_wall(background: Background, colours: np.ndarray, *, grey_only: bool) -> Background:
    """Return a background that is known, too, where an outline covered a pixel in all frames.

    Taken for unknown there, it could never show that an outline reaches too far. A pixel that looks like the
    wall around it shows the wall; behind one that looks like the mechanism the wall is filled in from around.
    One that looks like neither stays unknown: something may stand before the mechanism.

    Args:
        background: The background.
        colours: Of the mechanism, (colour, 3).
        grey_only: True where grey alone distinguishes the mechanism from the background.
    """
    import cv2

    covered = background.counts & ~background.known
    if background.given or not covered.any():
        return background
    planes = [background.luma, *(background.chroma or ())]
    few = [reduced_mask(covered, plane.shape) for plane in planes]
    walls = [
        np.asarray(cv2.inpaint(plane, own.view(np.uint8), AROUND_PX, cv2.INPAINT_TELEA))
        for plane, own in zip(planes, few, strict=True)
    ]
    count = 1 if grey_only else len(planes)
    shown, wall = (
        np.stack([plane[covered] for plane in full_size(some[0], (some[1], some[2]) if count > 1 else None)])
        for some in (planes, walls)
    )

    def apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        return np.tensordot(_WEIGHTS[:count], (one - other) ** 2, axes=(0, 0))

    every = colours.T[:count, :, np.newaxis]
    away = ALIKE**2 * apart(every, wall[:, np.newaxis])
    seen, known = background.known.copy(), background.known.copy()
    seen[covered] = apart(shown, wall) < away.min(axis=0)
    known[covered] = seen[covered] | np.any(apart(shown[:, np.newaxis], every) < away, axis=0)
    hidden = [own & reduced_mask(known & ~seen, plane.shape) for own, plane in zip(few, planes, strict=True)]
    luma, *chroma = (
        np.where(own, behind, plane) for own, behind, plane in zip(hidden, walls, planes, strict=True)
    )
    return replace(background, luma=luma, chroma=(chroma[0], chroma[1]) if chroma else None, known=known)


def _shown(order: np.ndarray, part: np.ndarray, palette: Palette, background: Background) -> np.ndarray:
    """Return which colour has to be taken out of each, -1 for none, int64 (colour,), so that geoms show their
    edges before those they lie in front of; in ``order``, int8 (geom, geom), only those stay that do so then.

    Where another colour lies behind an edge in place of the background, its coverage by the edge's own colour
    has to be none, neither more nor less, or the edge would seem to lie elsewhere. What a pair of colours has
    of one another can be taken out, unless they differ from the background in the same way.
    """
    other = np.full(len(palette.colours), -1)
    thin = (slice(None, None, THINNED), slice(None, None, THINNED))
    behind = [background.luma[thin]]
    if not palette.grey_only and background.chroma is not None:
        behind += [_resized(plane, behind[0].shape[::-1]) for plane in background.chroma]
    ordered = [(part[front], part[back]) for front, back in np.argwhere(order == masks.FRONT)]
    for front, back in np.argwhere(order == masks.FRONT):
        pair = part[front], part[back]
        gains = [palette.scale[k][thin] / FULL for k in pair]
        dimmed = [0.0 if palette.dimmed is None else palette.dimmed[0][k][thin] for k in pair]
        one, two = (palette.colours[k] for k in pair)
        level = _shared(behind, one, two, dimmed[0]) * gains[0]
        seen = gains[0] > 0.0
        if seen.any() and np.mean(np.abs(level[seen])) <= APART:
            continue
        # what is taken out of a colour is something else before a third one
        alone = all(set(pair) == set(both) or not set(pair) & set(both) for both in ordered)
        seen &= gains[1] > 0.0
        left = (1.0 - level * _shared(behind, two, one, dimmed[1]) * gains[1])[seen]
        if alone and len(left) and np.mean(left > UNMIXED) > UNMIXED_SHARE:
            other[pair[0]], other[pair[1]] = pair[1], pair[0]
        else:
            order[front, back] = 0
    return other


def _shared(
    behind: Sequence[np.ndarray], colour: np.ndarray, shown: np.ndarray, dimmed: np.ndarray | float
) -> np.ndarray:
    """Return the weighted product of a colour that is shown with what another counts by, (row, column)."""
    product = np.zeros(behind[0].shape, np.float32)
    for k, (weight, plane) in enumerate(zip(_WEIGHTS.tolist(), behind, strict=False)):
        # numbers of Python keep planes in single precision
        its, own = float(shown[k]), float(colour[k])
        product += weight * (its - plane) * (own - plane - dimmed * (own - BLACK[k]))
    return product


def _palette(
    colours: np.ndarray,
    background: Background,
    grey_only: bool,
    any_trust: float | None,
    light: np.ndarray | None = None,
    *,
    other: np.ndarray | None = None,
) -> Palette:
    """Compute each pixel's contrast with every colour, zero where the noise hides it.

    With ``light``, the standard deviation of the light on each colour, light counts as noise does;
    ``any_trust`` is the trust in a last plane of any difference, None for no such plane. With ``other``, the
    colour that is taken out of each, -1 for none, a pixel that shows that one alone is not covered: of the
    coverages c by both, and the level l that each has where the other covers a pixel, that leaves
    (c_1 - l_1 c_2) / (1 - l_1 l_2).
    """
    planes = full_size(background.luma, None if grey_only else background.chroma)
    shape, dimmed = (len(colours), *background.luma.shape), None
    if light is not None and not grey_only and background.chroma is not None:
        small = [_resized(background.luma, background.chroma[0].shape[::-1]), *background.chroma]
        dimmed = np.empty(shape, np.float32), _dimming(small, colours, light, background.noise)
    noise = background.pixel_noise
    scale, taken = np.empty(shape, np.float32), None if other is None else np.zeros(shape, np.float32)
    trust = np.empty((shape[0] + (any_trust is not None), *shape[1:]), np.float32)
    step = max(1, AT_ONCE // shape[2])

    def fill(first: int) -> None:
        """Fill some of the rows: what they need is at hand, and all of them at once would fill the memory."""
        rows = slice(first, first + step)
        part = [plane[rows] for plane in planes]
        full = strength = _contrast(part, colours)
        whole = np.zeros(len(colours), np.float32)
        if light is not None and dimmed is not None:
            dimmed[0][:, rows] = whole = _dimming(part, colours, light, background.noise)
            strength = full - whole * _contrast(part, colours, lit=True)
        # too little contrast would blow the noise up to full coverage: such a pixel shows nothing
        seen, known = strength > (SHOWN_NOISE * noise[rows]) ** 2, background.known[rows]
        scale[:, rows] = np.where(seen, FULL / np.maximum(strength, 1.0), 0.0)
        if other is not None and taken is not None:
            level = np.stack(
                [
                    _shared(part, colour, colours[j], whole[k])
                    for k, (colour, j) in enumerate(zip(colours, other, strict=True))
                ]
            ) / np.maximum(strength, 1.0)
            left = 1.0 - level * level[other]
            both = (other >= 0)[:, None, None] & seen & seen[other]
            mixed = both & (left > UNMIXED)
            by = np.where(mixed, left, 1.0)
            scale[:, rows] /= by
            taken[:, rows] = np.where(mixed, level * FULL / (np.maximum(strength, 1.0)[other] * by), 0.0)
            # noise grows by as much as the contrast shrinks
            full = full * np.where(both, np.clip(left, 0.0, 1.0), 1.0)
        sure = np.sqrt(np.where(seen, full, 0.0)) / (TRUSTED_NOISE * noise[rows])
        trust[: len(colours), rows] = np.minimum(sure, 1.0) * known
        if any_trust is not None:
            trust[-1, rows] = any_trust * known

    on_all_cores(fill, range(0, shape[1], step))
    shown = colours.copy()
    if grey_only:
        shown[:, 1:] = np.nan
    return Palette(shown, scale, grey_only, trust, dimmed=dimmed, other=other, taken=taken)


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
