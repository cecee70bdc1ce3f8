"""The shadow that a mechanism casts on what is behind it: found in the samples, taken out of the coverage.

A shadow darkens the background and leaves its tint: ``I = r B`` in every channel (of chroma, the distance
from grey), with a ratio r that does not depend on what is behind. A link of its own colour shows that
colour over any background. Before a plain wall the two look alike; but a shadow moves along with the
mechanism at a distance that hardly changes, and is hidden where the mechanism stands before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.types import FULL, Frame
from monodyn.vision.foreground.background import CHANGED_NOISE, SHOWN_NOISE, Background
from monodyn.vision.foreground.chroma import enlarged
from monodyn.vision.foreground.thinned import spacing, thinned, thinning

LIT = 0.95
"""Ratio to the background above which a pixel is no shadow."""
DEEPEST = 0.15
"""Ratio to the background below which a pixel is no shadow: some light comes from all around."""
TINT = 5.0
"""Distance of a shadow's tint from that of the darkened background, at most [grey levels]."""
BINS = 50
"""Bins of the histogram of ratios from 0 to 1."""
VALLEY, MATTERS = 0.7, 0.15
"""Height of a valley of that histogram over its lower side, at most, and of the slopes that count over their
peak, at least."""
LEAST_SHARE = 0.1
"""Share of what moves that a shadow has at least, and that is left without it."""
COPY, PLAIN_COPY = 0.6, 0.85
"""Correlation of what moves with its shadow at a constant offset over all frames, at least: before a wall
that shows whether the shadow follows it, and before a plain one."""
TURNED = 0.1
"""That correlation is better by this, at least, than the one of what moves with itself in other frames."""
APART = 0.02
"""Least offset of a shadow, as a share of the picture's longer side."""
FOLLOWS = 0.5
"""Share of the background's detail that a shadow lacks, at most: a body shows none of it, a shadow all."""
DETAIL = 4
"""Half of the window over which grey levels are compared with those around them, in reduced pixels."""
SIGMAS = 2.5
"""Standard deviations by which a shadow shows more than that, at least."""
LEAST_DETAIL = 1.0
"""Standard deviation of the background's detail below which it is too plain to say [grey levels]."""
FRAMES = 12
"""Samples, about, that are enough to look for a shadow in."""
GREY = 128.0
"""Blue and red difference of a pixel without colour."""
BAND_PX = 3
"""Width of the border of a shadow in which pixels are judged by the ratio next to them [px]."""


@dataclass(frozen=True)
class Shadow:
    """What the shadow of a clip looks like.

    Attributes:
        low: Least ratio to the background.
        high: Largest ratio to the background that counts.
    """

    low: float
    high: float


@dataclass(frozen=True, eq=False)
class _Sample:
    """What moves in a reduced sample.

    Attributes:
        moves: Where anything does, bool (row, column).
        at: Which pixels these are, counted row by row, int (pixel,).
        ratio: Their ratios to the background, float32 (pixel,).
        darkened: Which of them may be shadow, bool (pixel,).
        behind: The background, float32 (row, column).
    """

    moves: np.ndarray
    at: np.ndarray
    ratio: np.ndarray
    darkened: np.ndarray
    behind: np.ndarray

    def within(self, low: float, high: float) -> np.ndarray:
        """Return where a shadow of such ratios may be, bool (row, column)."""
        found = np.zeros(self.moves.shape, dtype=np.bool_)
        found.ravel()[self.at[self.darkened & (self.ratio >= low) & (self.ratio < high)]] = True
        return found

    @property
    def ratio_picture(self) -> np.ndarray:
        """The ratios in their places, 0 elsewhere, float32 (row, column)."""
        found = np.zeros(self.behind.shape, dtype=np.float32)
        found.ravel()[self.at] = self.ratio
        return found


class _Wall(NamedTuple):
    """The reduced background: grey level, blue and red difference if there are any, and the difference from
    which a pixel moves."""

    grey: np.ndarray
    tint: list[np.ndarray]
    least: np.ndarray


def find_shadow(samples: Sequence[Frame], background: Background, contrast: float) -> Shadow | None:
    """Look for the shadow of what moves.

    Args:
        samples: Frames of the clip.
        background: Its background.
        contrast: Least difference of a pixel that has changed [grey levels].

    Returns:
        The shadow, or None where nothing moves like one.
    """
    picks = samples[:: spacing(len(samples), FRAMES)]
    # its offset is looked for at half of that
    step = thinning(background.luma.shape)
    wall = _wall(background, contrast, step)
    reduced = on_all_cores(lambda frame: _reduced(frame, wall, step), picks)
    total = sum(len(sample.at) for sample in reduced)
    ratios = np.concatenate([sample.ratio[sample.darkened] for sample in reduced])
    found = []
    for low, high in _modes(ratios, LEAST_SHARE * total):
        shadows = [sample.within(low, high) for sample in reduced]
        others = [s.moves & ~shadow for s, shadow in zip(reduced, shadows, strict=True)]
        if sum(int(other.sum()) for other in others) >= LEAST_SHARE * total:
            unlike = _unlikeness(reduced, others, shadows)
            if unlike < FOLLOWS:
                found.append((unlike, low, high))
    return Shadow(*min(found)[1:]) if found else None


def unshadowed(
    frame: Frame, background: Background, shadow: Shadow, colours: np.ndarray, planes: np.ndarray
) -> None:
    """Take a shadow out of the coverage: where there is one, the background is as dark as it is around.

    Args:
        frame: The picture.
        background: What it shows without the mechanism.
        shadow: The shadow of the clip.
        colours: Colours of the mechanism; NaN for channels that do not count, (colour, 3).
        planes: Coverage by colour and, as a further plane, by any difference, uint8 (plane, height, width);
            changed in place.
    """
    import cv2

    inside, box = _dark_part(frame, background, shadow)
    # The edge of a link before a lit wall passes through the ratios of the shadow too, within a pixel or two.
    core = cv2.morphologyEx(inside.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    rows, columns = np.flatnonzero(core.any(axis=1)), np.flatnonzero(core.any(axis=0))
    if not len(rows):
        return
    top, left = max(0, rows[0] - BAND_PX), max(0, columns[0] - BAND_PX)
    cut = (slice(top, rows[-1] + BAND_PX + 1), slice(left, columns[-1] + BAND_PX + 1))
    core = core[cut].astype(np.float32)
    luma, behind = frame.luma[box][cut].astype(np.float32), background.luma[box][cut]
    size = (2 * BAND_PX + 1, 2 * BAND_PX + 1)
    weight = cv2.blur(core, size)
    near = np.nonzero(weight > 1e-6)
    dark = cv2.blur(core * luma / np.maximum(behind, 1.0), size)[near] / weight[near]
    # within the shadow nothing is covered; next to it the background is as dark as there
    wall = np.where(core[near] > 0, luma[near], behind[near] * dark)
    noise = background.pixel_noise[box][cut][near]
    apart = luma[near] - wall
    for plane, colour in zip(planes, colours[:, 0], strict=False):
        step = colour - wall
        share = np.where(np.abs(step) > SHOWN_NOISE * noise, apart * step / np.maximum(step**2, 1.0), 0.0)
        plane[box][cut][near] = np.clip(FULL * share + 0.5, 0.0, 255.0).astype(np.uint8)
    for plane in planes[len(colours) :]:
        share = np.abs(apart) / np.maximum(np.abs(luma[near] - behind[near]), 1.0)
        plane[box][cut][near] = (plane[box][cut][near] * np.minimum(share, 1.0)).astype(np.uint8)


def in_shadow(frame: Frame, background: Background, shadow: Shadow) -> np.ndarray:
    """Return where a picture is as dark as in the shadow, bool (height, width).

    Args:
        frame: The picture.
        background: What it shows without the mechanism.
        shadow: The shadow of the clip.
    """
    out = np.zeros(frame.luma.shape, dtype=np.bool_)
    inside, box = _dark_part(frame, background, shadow)
    out[box] = inside
    return out


def _dark_part(
    frame: Frame, background: Background, shadow: Shadow
) -> tuple[np.ndarray, tuple[slice, slice]]:
    """Return where the moving part of a picture is as dark as in the shadow, and that part."""
    shape = frame.luma.shape
    way = enlarged(background.window, shape, shape if frame.chroma is None else frame.chroma[0].shape)
    luma, behind = frame.luma[way.box], background.luma[way.box]
    dark = (luma > shadow.low * behind) & (luma < shadow.high * behind)
    if frame.chroma is not None and background.chroma is not None:
        ratio = luma / np.maximum(behind, 1.0)
        shown, usual = ([plane[way.part] for plane in planes] for planes in (frame.chroma, background.chroma))
        dark &= _keeps_tint(shown, usual, ratio)
    # the samples around the window may be many
    inside = np.zeros_like(dark)
    inside[way.inside] = dark[way.inside]
    return inside, way.box


def _wall(background: Background, contrast: float, step: int) -> _Wall:
    """Return every ``step``-th pixel of the background, to both sides."""
    grey, *tint = thinned(background.luma, background.chroma, step)
    noise = background.pixel_noise[::step, ::step]
    least = np.where(background.counts[::step, ::step], np.maximum(contrast, CHANGED_NOISE * noise), np.inf)
    return _Wall(grey, tint, least)


def _reduced(frame: Frame, wall: _Wall, step: int) -> _Sample:
    """Return every ``step``-th pixel of a sample, to both sides."""
    luma, *tint = thinned(frame.luma, frame.chroma, step)
    moves = np.abs(luma - wall.grey) > wall.least
    at = np.flatnonzero(moves)
    ratio = luma.take(at) / np.maximum(wall.grey.take(at), 1.0)
    darkened = (ratio > DEEPEST) & (ratio < LIT)
    for shown, back in zip(tint, wall.tint, strict=False):
        darkened &= np.abs(shown.take(at) - GREY - ratio * (back.take(at) - GREY)) < TINT
    return _Sample(moves, at, ratio, darkened, wall.grey)


def _keeps_tint(chroma: Sequence[np.ndarray], behind: Sequence[np.ndarray], ratio: np.ndarray) -> np.ndarray:
    """Return where the tint is that of the darkened background, bool (row, column) as the ratio."""
    import cv2

    kept = np.ones(ratio.shape, dtype=np.bool_)
    for shown, back in zip(chroma, behind, strict=True):
        small = cv2.resize(ratio, shown.shape[::-1], interpolation=cv2.INTER_AREA)
        off = np.abs(shown - GREY - small * (back - GREY))
        kept &= cv2.resize(off, ratio.shape[::-1], interpolation=cv2.INTER_LINEAR) < TINT
    return kept


def _modes(ratios: np.ndarray, least: float) -> list[tuple[float, float]]:
    """Return the least and the largest ratio around each mode of their histogram that holds enough pixels."""
    import cv2

    counts, edges = np.histogram(ratios, BINS, (0.0, 1.0))
    smooth = cv2.GaussianBlur(counts.astype(np.float32)[None], (7, 1), 1.2).ravel()
    peaks: list[int] = []
    for k in range(1, BINS - 1):
        if not smooth[k - 1] <= smooth[k] > smooth[k + 1]:
            continue
        # the soft border of a shadow has all ratios, and many a peak of chance: of two without a valley
        # between them the higher one stands for both
        while peaks and smooth[peaks[-1] : k].min() > VALLEY * min(smooth[peaks[-1]], smooth[k]):
            k = max(k, peaks.pop(), key=lambda at: smooth[at])
        peaks.append(k)
    valleys = [a + int(np.argmin(smooth[a:b])) for a, b in pairwise(peaks)]
    modes = []
    for k, first, last in zip(peaks, [0, *valleys], [*valleys, BINS - 1], strict=False):
        matters = first + np.flatnonzero(smooth[first : last + 1] > MATTERS * smooth[k])
        low, high = matters[0], matters[-1]
        if counts[low : high + 1].sum() >= least:
            modes.append((float(edges[low]), float(edges[high + 1])))
    return modes


def _correlation(others: list[np.ndarray], shadows: list[np.ndarray], near: int) -> float:
    """Return the correlation of shadows and the rest at the best constant offset of at least ``near``."""
    import cv2

    size = [max(1, side // 2) for side in others[0].shape[::-1]]
    shape = (2 * size[1], 2 * size[0])
    product, power = np.zeros((shape[0], shape[1] // 2 + 1), np.complex128), [0.0, 0.0]
    for other, shadow in zip(others, shadows, strict=True):
        small = [
            cv2.GaussianBlur(
                cv2.resize(m.astype(np.float32), size, interpolation=cv2.INTER_AREA), (0, 0), 2.0
            )
            for m in (other, shadow)
        ]
        one, two = (np.fft.rfft2(m, shape) for m in small)
        product += one.conj() * two
        power = [p + float(np.sum(m**2)) for p, m in zip(power, small, strict=True)]
    found = np.fft.irfft2(product, shape) / max(np.sqrt(power[0] * power[1]), 1e-9)
    if near:  # the borders of a link are not its shadow, nor what it leaves in pictures that blur as it moves
        beside = np.zeros(shape, dtype=np.bool_)
        beside[:near, :near] = beside[-near:, :near] = beside[:near, -near:] = beside[-near:, -near:] = True
        return float(found[~beside].max()) if found[~beside].max() > found[beside].max() else 0.0
    return float(found.max())


def _unlikeness(samples: list[_Sample], others: list[np.ndarray], shadows: list[np.ndarray]) -> float:
    """Return how much of the background's detail the pixels lack, as a share; infinite where they do not move
    along with the others, or lack too much of it.

    Where the background is too plain to say, the copy has to be better, and what is hidden more often is the
    shadow.
    """
    shown, std, detail = _detail_shown(samples, shadows)
    if detail > LEAST_DETAIL and shown - SIGMAS * std <= 1.0 - FOLLOWS:
        return np.inf
    near = max(2, round(APART * max(others[0].shape) / 2))
    copied = _correlation(others, shadows, near)
    if detail > LEAST_DETAIL:
        return 1.0 - shown if copied > COPY else np.inf
    # What only shifts from frame to frame, such as two parts of a cart, correlates with anything that
    # shifts too.
    half = len(others) // 2
    both = [(a, b) for a, b in zip(others, others[half:], strict=False) if a.any() and b.any()]
    shifted = float(np.mean([_correlation([a], [b], 0) for a, b in both])) if both else 1.0
    if copied < PLAIN_COPY or copied < shifted + TURNED:
        return np.inf
    areas = np.array([float(shadow.sum()) for shadow in shadows])
    return FOLLOWS / (1.001 + float(areas.std() / max(areas.mean(), 1.0)))


def _detail_shown(samples: list[_Sample], shadows: list[np.ndarray]) -> tuple[float, float, float]:
    """Return how much of the darkened background's detail the pixels show, as a share, its standard
    deviation, and that detail [grey levels].

    What a pixel differs by from the shadow around it is compared: a soft border and light that falls off
    across a wall change grey levels more than any detail does, but not from one pixel to the next.
    """
    import cv2

    size = (2 * DETAIL + 1, 2 * DETAIL + 1)

    def shown_by(pair: tuple[_Sample, np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return detail of the picture and of the background, and ratio, at the pixels of one shadow."""
        sample, shadow = pair
        rows, columns = np.flatnonzero(shadow.any(axis=1)), np.flatnonzero(shadow.any(axis=0))
        if not len(rows):
            nothing = np.zeros(0, np.float32)
            return nothing, nothing, nothing
        # what is farther away than a window is in none
        cut = (_grown(rows, DETAIL), _grown(columns, DETAIL))
        shadow, ratio, behind = shadow[cut], sample.ratio_picture[cut], sample.behind[cut]
        weight = shadow.astype(np.float32)
        around = np.maximum(cv2.blur(weight, size), 1e-6)
        level, plain = ((v - cv2.blur(weight * v, size) / around)[shadow] for v in (ratio * behind, behind))
        return level, plain, ratio[shadow]

    found = on_all_cores(shown_by, zip(samples, shadows, strict=True))
    level, behind, ratios = (np.concatenate(values) for values in zip(*found, strict=True))
    power, ratio = max(float(behind @ behind), 1e-9), float(np.median(ratios))
    slope = float(level @ behind) / power
    error = float(np.std(level - slope * behind)) / np.sqrt(power)
    return slope / ratio, error / ratio, float(np.std(behind))


def _grown(numbers: np.ndarray, by: int) -> slice:
    """Return the range of increasing row or column numbers, with a margin."""
    return slice(max(0, int(numbers[0]) - by), int(numbers[-1]) + by + 1)
