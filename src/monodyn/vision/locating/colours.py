"""From a located mechanism to the colours of its geoms, measured inside of their outlines, and their order:
where two overlap the one in front shows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.types import Frame
from monodyn.vision.drawing.outline import outline
from monodyn.vision.foreground.background import SHOWN_NOISE, Background
from monodyn.vision.foreground.changes import BEHIND, SHOWN
from monodyn.vision.foreground.masks import BACK, FRONT, NOT_SHOWN, VARIED, GeomColours, no_order
from monodyn.vision.foreground.palette import BLACK, CHROMA_WEIGHT
from monodyn.vision.locating.search import SceneGuess

SHARED_COLOUR, SHARED_SHARE = 10.0, 0.15
"""Geoms whose colours differ by less share one: grey levels, and share of their contrast with the
background."""
MOST_FRAMES = 16
"""Frames in which the colours are measured."""
INNER_PX = 3.0
"""Distance from every outline at which a pixel shows its geom alone; 80 % of the half width where a geom is
thin."""
THIN_PX = 5.0
"""Half width below which blur mixes even the inner pixels with the background."""
RIM_PX = 6.0
"""Distance from every outline beyond which a pixel of a wide geom does not count where motion blurs pictures:
edges are judged against all coverage beside them there, and light makes rims darker or brighter."""
MARGIN_PX = 2
"""What is looked at goes beyond the outlines by this much."""
LEAST_GEOM_PIXELS = 20
"""Least number of pixels for a colour."""
SHADED_PERCENT, SHADED_LEVEL = 15.0, 0.75
"""A geom is shaded if this share of its pixels shows less than this level of its colour."""
UNLIKE_SHARE = 0.25
"""Share of pixels unlike the median colour from which a geom has no single colour (a shiny rod)."""
SHOWS_NOISE = 10.0
"""Contrast over the noise from which a pixel shows whether it has its geom's colour."""
FAINT_NOISE = 40.0
"""Contrast over the noise below which a geom is faint."""
HIDDEN_NOISE = 6.0
"""Contrast over the noise below which a geom does not stand out from the background."""
CAMOUFLAGED_SHARE = 0.1
"""Share of the pixels of a geom that do not stand out from which its borders are looked for too."""
NOT_SHOWN_PERCENT = 80.0
"""A geom of which this share of pixels does not stand out from what is behind it is not shown at all."""
UNSEEN = -3
"""Stands for the colour of a geom that shows too few pixels to measure it."""
ALONE_PX = 1.5
"""Half width of the place that two geoms share from which some of its pixels show one of them alone."""
LIKE_ONE, ALIKE_SHARE = 0.25, 0.8
"""How far from one colour towards another a pixel still has the first, as a share of the way, and share of
the pixels that both geoms cover which have that of the one in front."""
HALF_WIDTH = 6
"""Column of a table of pixels, after ``SHOWN`` and ``BEHIND``: the geom's half width in the picture
[px]."""
PIXEL_COLUMNS = HALF_WIDTH + 1
"""Number of columns of that table."""


def geom_colours(
    samples: Sequence[Frame],
    background: Background,
    guess: SceneGuess,
    fits: np.ndarray,
    away: Sequence[np.ndarray] = (),
    meanwhile: Sequence[np.ndarray] = (),
) -> GeomColours | None:
    """Measure the colour of every geom where no other geom is near.

    Args:
        samples: Sample frames.
        background: What they show without the mechanism.
        guess: The located mechanism, with its pose in every sample frame.
        fits: True where that pose lies on the mask, bool (frame,).
        away: Where each frame shows the mechanism against that pose, to the right and down [px], (2,) each;
            empty where it is there.
        meanwhile: Poses from the beginning to the end of each frame's exposure, (time, dof) each; empty where
            the frames are sharp. A blurred pixel shows its geom alone where that covers it all the time. How
            much differs from the background does not say how long it was covered; then a geom of several
            colours has their median too, where that stands out.

    Returns:
        The colours, near ones joined, and which geoms lie in front of which; or None where no geom shows one
        colour over enough pixels. A geom too thin to show its own has the nearest of the others.
    """
    good = np.flatnonzero(fits)
    good = good[:: max(1, len(good) // MOST_FRAMES)]
    geoms = len(guess.mechanism.shapes.radius)

    pairs = [(g, h) for g in range(geoms) for h in range(g)]

    def inner(i: int) -> list[np.ndarray]:
        poses = meanwhile[i] if len(meanwhile) else guess.positions[i : i + 1]
        by = away[i] if len(away) else np.zeros(2)
        outlines = [[p + by for _, p in outline(guess.mechanism, guess.camera, q)] for q in poses]
        # what is behind the camera has no outline, and then the others would not be in the order of the geoms
        if min(len(drawn) for drawn in outlines) < geoms:
            return [np.zeros((0, PIXEL_COLUMNS))] * (geoms + len(pairs))
        return _inner_pixels(samples[i], background, outlines, pairs)

    rows = zip(*on_all_cores(inner, good), strict=True) if len(good) else [[]] * (geoms + len(pairs))
    tables = [np.concatenate([np.zeros((0, PIXEL_COLUMNS)), *own]) for own in rows]
    pixels, shared = tables[:geoms], dict(zip(pairs, tables[geoms:], strict=True))
    shown = _shown(pixels, background.noise)
    part, colours, light = _joined(pixels, shown, background.noise, blurred=len(meanwhile) > 0)
    if not colours:
        return None
    order = _order(shared, part, colours)
    part[part == UNSEEN] = 0
    # how much differs from the background where colours vary is not how much of a pixel is covered
    shaded = np.array([part[g] >= 0 and _is_shaded(pixels[g], colours[part[g]]) for g in range(geoms)])
    shaded |= part == VARIED
    hidden = any(
        part[g] >= 0 and _hidden_share(pixels[g], colours[part[g]], background.noise) > CAMOUFLAGED_SHARE
        for g in range(geoms)
    )
    return GeomColours(np.array(colours), part, shaded, hidden, np.array(light), order)


def _order(
    shared: dict[tuple[int, int], np.ndarray], part: np.ndarray, colours: list[np.ndarray]
) -> np.ndarray:
    """Return which geoms lie in front of which, int8 (geom, geom), from the pixels that two of them cover and
    the colour of each, (geom,): what both cover shows the colour of the one in front."""
    order = no_order(len(part))
    for (g, h), both in shared.items():
        if min(part[g], part[h]) < 0 or part[g] == part[h] or len(both) < LEAST_GEOM_PIXELS:
            continue
        one, other = colours[part[g]], colours[part[h]]
        way = np.nan_to_num(other - one)
        share = np.nan_to_num(both[:, SHOWN] - one) @ way / max(float(way @ way), 1.0)
        for front, back, like in ((g, h, share < LIKE_ONE), (h, g, share > 1.0 - LIKE_ONE)):
            if np.mean(like) >= ALIKE_SHARE:
                order[front, back], order[back, front] = FRONT, BACK
    return order


def _hidden_share(pixels: np.ndarray, colour: np.ndarray, noise: float) -> float:
    """Return the share of a geom's inner pixels behind which the background nearly has its colour."""
    return float(np.mean(_contrast(pixels, colour) < HIDDEN_NOISE * noise)) if len(pixels) else 0.0


def _shown(pixels: list[np.ndarray], noise: float) -> np.ndarray:
    """Return which geoms stand out from what is behind them, bool (geom,); all where none does.

    A thread that the camera does not see has the colours of the wall: of a wall with a pattern, many. What is
    wider is seen, and where it looks like what is behind it, it stands before its own picture.
    """
    enough = np.array([len(own) >= LEAST_GEOM_PIXELS for own in pixels])
    thin = np.array([np.median(own[:, HALF_WIDTH]) < THIN_PX if len(own) else False for own in pixels])
    contrasts = [
        np.percentile(_contrast(o, o[:, SHOWN]), NOT_SHOWN_PERCENT) if len(o) else 0.0 for o in pixels
    ]
    apart = np.array(contrasts) > SHOWN_NOISE * noise
    return ~enough | ~thin | apart | (not (enough & apart).any())


def _joined(
    pixels: list[np.ndarray], shown: np.ndarray, noise: float, *, blurred: bool
) -> tuple[np.ndarray, list[np.ndarray], list[float]]:
    """Return the colour of each geom, (geom,), the colours, and the light on each, from the inner pixels of
    the geoms, which of these are shown at all, bool (geom,), and whether motion blurs pictures."""
    medians = [_colour(own, noise) for own in pixels]
    colours: list[np.ndarray] = []
    light: list[float] = []
    part = np.full(len(pixels), UNSEEN, dtype=np.int64)
    depth = [float(np.median(own[:, HALF_WIDTH])) if len(own) else 0.0 for own in pixels]
    # the widest geom first: its colour is the purest, and a thinner one of nearly that colour takes it over
    for g in np.argsort(depth)[::-1]:
        if not shown[g]:
            part[g] = NOT_SHOWN
        elif (
            len(pixels[g]) >= LEAST_GEOM_PIXELS
            and _is_varied(pixels[g], noise)
            and not (blurred and _hidden_share(pixels[g], medians[g], noise) < CAMOUFLAGED_SHARE)
        ):
            part[g] = VARIED
        elif np.isfinite(medians[g][0]):
            alike = min(SHARED_COLOUR, SHARED_SHARE * float(np.median(_contrast(pixels[g], medians[g]))))
            own = _light_spread(pixels[g], medians[g], noise)
            near = [
                k for k, other in enumerate(colours) if _apart(other, medians[g], max(light[k], own)) < alike
            ]
            if not near:
                colours.append(medians[g])
                light.append(own)
            part[g] = near[0] if near else len(colours) - 1
    if not colours and not shown.all():
        # what is left out is left out of the plane of any difference too, which comes with some colour
        g = int(np.argmax(np.where(shown, depth, -1.0)))
        colours, light = [medians[g]], [0.0]
    return part, colours, light


def _light_spread(pixels: np.ndarray, colour: np.ndarray, noise: float) -> float:
    """Return the standard deviation of the light on a colour, as a share of it, beyond the noise.

    Light multiplies what a colour has beyond black, in all channels alike. The inner pixels of a thin geom
    are mixed with the background, which would pass for light.
    """
    if np.isnan(colour).any() or float(np.median(pixels[:, HALF_WIDTH])) < THIN_PX:
        return 0.0
    own = (colour - BLACK) * [1.0, CHROMA_WEIGHT, CHROMA_WEIGHT]
    power = max(float(own @ (colour - BLACK)), 1.0)
    low, high = np.percentile((pixels[:, SHOWN] - colour) @ own / power, [15.9, 84.1])
    return float(np.sqrt(max((0.5 * (high - low)) ** 2 - noise**2 / power, 0.0)))


def _colour(pixels: np.ndarray, noise: float) -> np.ndarray:
    """Return the median colour of a geom's inner pixels; of a thin one's, some of which are mixed with the
    background, that of the half whose contrasts are most alike."""
    if len(pixels) < LEAST_GEOM_PIXELS:
        return np.full(3, np.nan)
    if float(np.median(pixels[:, HALF_WIDTH])) < THIN_PX:
        contrast = _contrast(pixels, pixels[:, SHOWN])
        changed = contrast > SHOWN_NOISE * noise
        if changed.sum() >= LEAST_GEOM_PIXELS and np.median(contrast[changed]) < FAINT_NOISE * noise:
            # a faint one's contrasts differ by what is behind it: what shows at all counts alike
            return np.median(pixels[changed][:, SHOWN], axis=0)
        # Mixing lowers the contrast of some pixels, noise moves that of all of them either way. Most alike
        # are those that show the geom alone; to take those that stand out most would be to choose by their
        # noise, and every width would come out too small.
        order = np.argsort(contrast, kind="stable")
        half = (len(order) + 1) // 2
        spread = contrast[order[half - 1 :]] - contrast[order[: len(order) - half + 1]]
        first = int(np.argmin(spread))
        pixels = pixels[order[first : first + half]]
    return np.median(pixels[:, SHOWN], axis=0)


def _contrast(pixels: np.ndarray, colours: np.ndarray) -> np.ndarray:
    """Return the distance of colours, (3,) or (pixel, 3), from the background of each pixel [grey levels]."""
    return np.sqrt(np.nansum((colours - pixels[:, BEHIND]) ** 2, axis=1))


def _apart(one: np.ndarray, other: np.ndarray, light: float) -> float:
    """Return the distance of two colours [grey levels], but for what so much light on the first one
    explains; channels that are missing do not count."""
    lit, off = np.nan_to_num(one - BLACK), np.nan_to_num(one - other)
    size = max(float(np.linalg.norm(lit)), 1.0)
    along = float(off @ lit) / size
    beyond = max(abs(along) - light * size, 0.0)
    return float(np.sqrt(max(off @ off - along**2, 0.0) + beyond**2))


def _is_varied(pixels: np.ndarray, noise: float) -> bool:
    """Return whether many pixels of a geom are nearer to the background than to the geom's median colour.

    Where the background nearly has that colour, noise and shading would decide: such pixels do not count.
    """
    median = np.median(pixels[:, SHOWN], axis=0)
    contrast = _contrast(pixels, median)
    shows = contrast > SHOWS_NOISE * noise
    if shows.sum() < LEAST_GEOM_PIXELS:
        return False
    off = np.sqrt(np.nansum((pixels[:, SHOWN] - median) ** 2, axis=1))
    return float(np.mean(off[shows] > 0.5 * contrast[shows])) > UNLIKE_SHARE


def _is_shaded(pixels: np.ndarray, colour: np.ndarray) -> bool:
    """Return whether many inner pixels of a geom show much less of its colour than all of it."""
    if len(pixels) < LEAST_GEOM_PIXELS or float(np.median(pixels[:, HALF_WIDTH])) < THIN_PX:
        return False
    # each pixel's level of the colour, by projection as for the masks; only the channels that exist count
    full = colour - pixels[:, BEHIND]
    share = np.nansum((pixels[:, SHOWN] - pixels[:, BEHIND]) * full, axis=1) / np.maximum(
        np.nansum(full**2, axis=1), 1.0
    )
    return float(np.percentile(share, SHADED_PERCENT)) < SHADED_LEVEL


def _inner_pixels(
    frame: Frame, background: Background, outlines: list[list[np.ndarray]], pairs: list[tuple[int, int]]
) -> list[np.ndarray]:
    """Return the pixels that are deep inside of each geom and outside of the others at all times of an
    exposure, then those that are deep inside of two geoms and outside of the others, each (pixel, column);
    the outlines are those of the geoms at each time."""
    import cv2

    # only the part of the picture that the mechanism covers, with a margin that no geom enters
    corners = np.concatenate([polygon for drawn in outlines for polygon in drawn])
    size = np.array(frame.luma.shape[::-1])
    first = np.clip(np.floor(corners.min(axis=0)).astype(np.int64) - MARGIN_PX, 0, size - 1)
    last = np.clip(np.ceil(corners.max(axis=0)).astype(np.int64) + MARGIN_PX + 1, first + 1, size)
    shape = tuple((last - first)[::-1])
    masks, touched = [], np.zeros(shape, dtype=np.uint8)
    for polygons in zip(*outlines, strict=True):
        always, ever = np.ones(shape, np.uint8), np.zeros(shape, np.uint8)
        for polygon in polygons:
            mask = np.zeros(shape, np.uint8)
            cv2.fillPoly(mask, [np.round((polygon - first) * 16.0).astype(np.int32)], 1, cv2.LINE_8, 4)
            always &= mask
            ever |= mask
        masks.append(always)
        touched += ever
    found = []
    for mask, geoms in [(mask, 1) for mask in masks] + [(masks[g] & masks[h], 2) for g, h in pairs]:
        if not mask.any():
            found.append(np.zeros((0, PIXEL_COLUMNS)))
            continue
        depth = cv2.distanceTransform(mask, cv2.DIST_L2, 3)
        deepest = float(depth.max())
        shows = (
            (depth >= min(INNER_PX, 0.8 * deepest)) & (touched == geoms) & (geoms == 1 or deepest >= ALONE_PX)
        )
        y, x = np.nonzero(shows & (depth <= RIM_PX) if len(outlines) > 1 else shows)
        # at most a few hundred pixels of each frame: medians need no more
        step = max(1, len(y) // 400)
        at = y[::step] + first[1], x[::step] + first[0]
        values = [*_colours_at(frame, *at), *_colours_at(background, *at)]
        found.append(np.column_stack([*values, np.full(len(at[0]), deepest)]))
    return found


def _colours_at(picture: Frame | Background, rows: np.ndarray, columns: np.ndarray) -> list[np.ndarray]:
    """Return grey level, blue and red difference of some pixels, each (pixel,); NaN for missing ones."""
    import cv2

    found = [picture.luma[rows, columns].astype(np.float64)]
    for plane in (picture.chroma or ()) if len(rows) else ():
        # as if it were enlarged to the size of the picture
        scale = np.divide(plane.shape, picture.luma.shape)
        y, x = ((at + 0.5) * by - 0.5 for at, by in zip((rows, columns), scale, strict=True))
        at_x, at_y = (places.astype(np.float32)[:, np.newaxis] for places in (x, y))
        shown = cv2.remap(plane, at_x, at_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        found.append(shown[:, 0].astype(np.float64))
    return found + [np.full(len(rows), np.nan)] * (3 - len(found))
