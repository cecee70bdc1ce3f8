"""The shadow of what moves, painted with a known ratio."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from monodyn.types import FULL, Frame
from monodyn.vision.foreground.background import Background, Samples, Window, background_of, within
from monodyn.vision.foreground.coverage import coverage_of
from monodyn.vision.foreground.shadow import find_shadow, in_shadow
from pictures import palette_found
from support import slow

H, W, LINK, RATIO = 240, 320, 60.0, 0.6


def swinging(
    *,
    shadow: bool,
    second: float = LINK,
    checker: float = 30.0,
    soft: float = 0.0,
    grain: float = 0.0,
    late: float = 0.0,
) -> list[Frame]:
    """Paint two links that turn apart before a wall, with a shadow of them 44 px to the right and 36 down;
    its border is ``soft`` [px], the wall has a ``grain`` [grey levels], and all is some frames ``late``."""
    rng = np.random.default_rng(5)
    y, x = np.indices((H, W)).astype(float)
    wall = 190.0 - checker * (((x // 40) + (y // 40)) % 2)
    wall += grain * cv2.GaussianBlur(rng.normal(size=wall.shape), (0, 0), 2.0) * 7.0
    frames = []
    for i in range(40):
        first, other = 0.2 + 0.07 * (i + late), 2.4 - 0.13 * (i + late)
        elbow = (140 + 60 * np.cos(first), 50 + 60 * np.sin(first))
        picture = wall.copy()
        for right, down, dark in ((44, 36, shadow), (0, 0, False)):
            if (right or down) and not dark:
                continue
            for (cx, cy), angle, level in (((140, 50), first, LINK), (elbow, other, second)):
                along = (x - cx - right) * np.cos(angle) + (y - cy - down) * np.sin(angle)
                across = (y - cy - down) * np.cos(angle) - (x - cx - right) * np.sin(angle)
                inside = (along > 0) & (along < 60) & (np.abs(across) < 8)
                if dark:
                    deep = cv2.GaussianBlur(inside.astype(float), (0, 0), soft) if soft else inside
                    picture = np.minimum(picture, wall * (1.0 - (1.0 - RATIO) * deep))
                else:
                    picture[inside] = level
        noisy = picture + rng.normal(scale=1.0, size=picture.shape)
        frames.append(Frame(i, i / 30, np.round(noisy).clip(0, 255).astype(np.uint8)))
    return frames


def background_of_all(made: list[Frame]) -> Background:
    return background_of(Samples(tuple(made), Window(0, H, 0, W)))


def test_a_shadow_is_found_and_covers_nothing() -> None:
    made = swinging(shadow=True)
    background = background_of_all(made)
    shadow = find_shadow(made, background, 14.0)
    assert shadow is not None
    assert shadow.low < RATIO < shadow.high < 0.95
    palette = palette_found(made, background, "grey", 14.0)
    # the shadow has levels of 96 and 114
    assert palette.colours[:, 0].max() < 90.0
    cast, plain = made[12], swinging(shadow=False)[12]
    planes = coverage_of(cast, background, palette)[0].astype(float)
    # as without the shadow, over the uncovered background of the clip without it
    without = background_of_all(swinging(shadow=False))
    expected = coverage_of(plain, without, palette_found(made, without, "grey", 14.0))[0].astype(float)
    assert np.abs(planes - expected).mean() < 0.02 * FULL
    assert in_shadow(cast, background, shadow).sum() > 800


def test_links_of_two_colours_are_no_shadow() -> None:
    made = swinging(shadow=False, second=110.0)
    assert find_shadow(made, background_of_all(made), 14.0) is None


def test_before_a_plain_wall_what_is_hidden_more_often_is_the_shadow() -> None:
    made = swinging(shadow=True, checker=0.0)
    shadow = find_shadow(made, background_of_all(made), 14.0)
    assert shadow is not None
    assert shadow.low < RATIO < shadow.high


def test_a_soft_shadow_shows_the_grain_of_the_wall() -> None:
    made = swinging(shadow=True, checker=0.0, soft=4.0, grain=4.0)
    shadow = find_shadow(made, background_of_all(made), 14.0)
    assert shadow is not None
    assert shadow.low < RATIO + 0.1 < shadow.high
    links = swinging(shadow=False, second=110.0, checker=0.0, grain=4.0)
    assert find_shadow(links, background_of_all(links), 14.0) is None


def test_what_moves_elsewhere_hides_no_shadow() -> None:
    made = swinging(shadow=True, checker=0.0, soft=4.0, grain=4.0)
    rng = np.random.default_rng(2)
    for i, frame in enumerate(made):
        # someone at the right edge, of many grey levels, who sways
        frame.luma[:, 250 + round(15.0 * np.sin(0.9 * i)) :] = rng.integers(30, 150)
    others = np.zeros((H, W), dtype=np.bool_)
    others[:, 230:] = True
    background = background_of_all(made)
    assert find_shadow(made, background, 14.0) is None
    assert find_shadow(made, within(background, background.window, others), 14.0) is not None


@pytest.mark.slow
@pytest.mark.parametrize("exposure", [slow(1), slow(3), 4])
def test_what_blurs_as_it_moves_casts_no_shadow(exposure: int) -> None:
    """A link that moves while the shutter is open lets the wall through, as a shadow does."""
    parts = [swinging(shadow=False, checker=0.0, grain=4.0, late=exposure * k / 8) for k in range(8)]
    made = [
        Frame(i, i / 30, np.mean([part[i].luma for part in parts], axis=0).round().astype(np.uint8))
        for i in range(len(parts[0]))
    ]
    assert find_shadow(made, background_of_all(made), 14.0) is None


def test_a_still_clip_has_no_shadow() -> None:
    made = [Frame(i, i / 30, np.full((H, W), 120, np.uint8)) for i in range(8)]
    assert find_shadow(made, background_of_all(made), 14.0) is None
