"""Which sizes a clip would show if its light was mixed before it was coded.

The coverage of a pixel is taken to be linear in its level. That is so where a program mixes coded levels, as
most renderers do. A camera mixes light, in its lens and on its sensor, and codes it then by about the root of
``GAMMA``: where a dark body covers half of a pixel before a bright wall, the pixel shows 73 % of the wall's
level. The coverage comes out too small on all edges of a dark body, too large on those of a bright one; how
much, in pixels, follows from both levels and from how soft the edges are. Profiles stay as smooth as they
were, so that no mask tells which it was.

What this does to the sizes is found by doing it: the coverage is decoded as if the light had been mixed
first, and the sizes are refined on it once more. Their change is one direction, all edges of dark bodies
outwards and all of bright ones inwards. What is not known is a factor on it for the whole clip, with mean 0
and standard deviation 1. Widths change by both of their edges, free ends by one, and the distance between two
hinges by none. Nor do poses: both sides of a body move alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.types import FULL, Frame
from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.drawing.outline import covered_pixels
from monodyn.vision.foreground.background import Background
from monodyn.vision.foreground.palette import BLACK, CHROMA_WEIGHT
from monodyn.vision.foreground.thinned import at_pixels
from monodyn.vision.locating.bundle import Bundle, KeyMasks, refine
from monodyn.vision.locating.search import SceneGuess

GAMMA = 2.2
"""Light is about this power of the level that codes it: standards for video are between 2.0 and 2.4."""
RED_GREEN_BLUE = np.array([[1.0, 0.0, 1.402], [1.0, -0.344136, -0.714136], [1.0, 1.772, 0.0]])
RED_GREEN_BLUE /= [219.0, 224.0, 224.0]
"""Red, green and blue of grey level, blue and red difference beyond ``BLACK``, white being 1 (ITU-R
BT.601)."""
WEIGHTS = np.array([1.0, CHROMA_WEIGHT, CHROMA_WEIGHT])
"""Weights of the three channels in a coverage."""
LEAST_APART = 2.0
"""Difference of figure and ground below which the levels do not tell how light was mixed [grey levels]."""
WHOLE = (round(0.95 * FULL), round(1.05 * FULL))
"""Levels of a mask between which a pixel shows the colour of its plane."""
HALVINGS = 8
"""Halvings of the interval in which a coverage lies: finer than the 160 levels of a mask."""
NEAR_PX = 12.0
"""Band about the outlines within which pixels are looked at [px]: three times the reach of the search."""
AT_ONCE = 50_000
"""Pixels that are looked at at a time."""
SEARCH = EdgeSearch(np.full(4, 4.0), 3.0)
"""How the edges are looked for: they are next to where they were."""


def lit_sizes(
    masks: KeyMasks, pictures: Sequence[Frame], background: Background, bundle: Bundle, rows: Sequence[int]
) -> dict[str, float]:
    """Return by how much each refined variable changes if light was mixed before it was coded.

    Masks of another tool are pictures in white on black, and their edges are as uncertain as those of such a
    clip.

    Args:
        masks: Masks of the key frames that motion does not blur.
        pictures: These frames.
        background: What is behind the mechanism.
        bundle: A refinement over these frames and others.
        rows: Rows of these frames among its own.

    Returns:
        The changes by name: of sizes and depth as logarithms, of places as ratios.
    """
    ground = [background.luma, *(background.chroma or ())]
    colours = _colours(masks.planes, pictures)
    at = np.asarray(rows, dtype=np.int64)

    def lit_at(row: int) -> np.ndarray:
        q = bundle.positions[at[row]]
        near = covered_pixels(bundle.mechanism, bundle.camera, q, margin=NEAR_PX)
        return lit_planes(masks.planes[row], colours, ground, near)

    decoded = replace(masks, planes=on_all_cores(lit_at, range(len(at))))
    guess = SceneGuess(bundle.mechanism, bundle.camera, bundle.positions[at], bundle.rms_px[at])
    coded, lit = (refine(shown, guess, bundle.variables, SEARCH) for shown in (masks, decoded))
    before, after = (bundle.variables.read(found.mechanism, found.camera) for found in (coded, lit))
    return dict(zip(bundle.variables.names, (after - before).tolist(), strict=True))


def lit_planes(
    planes: np.ndarray, colours: np.ndarray, ground: Sequence[np.ndarray], near: np.ndarray
) -> np.ndarray:
    """Return the coverage that a mask would show if light was mixed before it was coded.

    Args:
        planes: A mask by colour, uint8 (colour, height, width).
        colours: Grey level, blue and red difference of each; NaN where they are not known, (colour, 3).
        ground: The planes of what is behind the mechanism, each (row, column) of any size.
        near: Where the coverage is wanted, bool (height, width).

    Returns:
        The coverage, uint8 (colour, height, width), 0 where it is not wanted; the same where figure and
        ground are nearly alike.
    """
    # what is zero everywhere takes no memory until it is written to
    lit = np.zeros(planes.shape, planes.dtype)
    wanted, width = np.flatnonzero(near), planes.shape[2]
    for plane, whole, colour in zip(lit.reshape(len(lit), -1), planes, colours, strict=True):
        plane[wanted] = shown = whole.take(wanted)
        mixed = wanted[(shown > 0) & (shown < FULL)]
        # of a large picture all of them at once would fill the memory
        for start in range(0, len(mixed), AT_ONCE):
            some = mixed[start : start + AT_ONCE]
            behind = _at(ground, near.shape, *np.divmod(some, width))
            # a colour that is not known is not apart from anything
            apart = (colour - behind) ** 2 @ WEIGHTS > LEAST_APART**2
            shares = plane[some[apart]] / np.float32(FULL)
            plane[some[apart]] = np.round(FULL * _lit(shares, colour, behind[apart]))
    return lit


def _lit(share: np.ndarray, colour: np.ndarray, ground: np.ndarray) -> np.ndarray:
    """Return the shares of pixels, (pixel,), of which the light of a colour (3,) before the ground (pixel, 3)
    makes the given shares of their difference."""
    difference = colour - ground
    # the share of a colour's difference is linear in red, green and blue as they are coded
    along = difference * WEIGHTS @ np.linalg.inv(RED_GREEN_BLUE)
    along /= np.sum(difference**2 * WEIGHTS, axis=1, keepdims=True)
    figure, behind = (np.maximum((x - BLACK) @ RED_GREEN_BLUE.T, 0.0) for x in (colour, ground))
    # powers of half as many digits, which a mask of 160 levels does not tell, take a third of the time
    along, figure, behind = (x.astype(np.float32) for x in (along, figure, behind))
    lower, upper = np.zeros_like(share), np.ones_like(share)
    dark, more = behind**GAMMA, figure**GAMMA - behind**GAMMA
    for _ in range(HALVINGS):
        middle = 0.5 * (lower + upper)
        light = dark + middle[:, np.newaxis] * more
        below = np.sum(along * (light ** (1.0 / GAMMA) - behind), axis=1) < share
        lower, upper = np.where(below, middle, lower), np.where(below, upper, middle)
    return 0.5 * (lower + upper)


def _at(
    planes: Sequence[np.ndarray], shape: tuple[int, ...], rows: np.ndarray, columns: np.ndarray
) -> np.ndarray:
    """Return grey level, blue and red difference of some pixels of a picture, (pixel, 3)."""
    found = at_pixels(planes, shape, rows, columns)
    if len(planes) == 1:
        found += [np.full(len(rows), neutral, np.float32) for neutral in BLACK[1:]]
    return np.stack(found, axis=-1)


def _colours(masks: Sequence[np.ndarray], pictures: Sequence[Frame]) -> np.ndarray:
    """Return the colour of each plane of some masks, (colour, 3): that of what it covers as a whole; NaN
    where it covers nothing."""
    shown: list[list[np.ndarray]] = [[] for _ in masks[0]]
    for mask, frame in zip(masks, pictures, strict=True):
        for plane, own in zip(mask, shown, strict=True):
            whole = np.flatnonzero((plane > WHOLE[0]) & (plane < WHOLE[1]))
            own.append(
                _at([frame.luma, *(frame.chroma or ())], plane.shape, *np.divmod(whole, plane.shape[1]))
            )
    pixels = [np.concatenate(own) for own in shown]
    return np.array([np.median(own, axis=0) if len(own) else np.full(3, np.nan) for own in pixels])
