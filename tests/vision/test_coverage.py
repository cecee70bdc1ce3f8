"""Coverage of pixels with known content."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.types import FULL, Frame
from monodyn.vision.foreground.background import background_of
from monodyn.vision.foreground.coverage import coverage_of
from monodyn.vision.foreground.masks import GeomColours, Wanted
from monodyn.vision.foreground.palette import BLACK, measured_palette
from monodyn.vision.foreground.thumbnails import Window
from pictures import H, W, palette_found, samples, wandering


def test_coverage_is_the_share_of_a_mixed_pixel() -> None:
    made = wandering(noise=0.0)
    background = background_of(samples(made))
    palette = palette_found(made, background, "grey", 14.0)
    for share in (0.25, 0.5, 0.9):
        luma = np.full((H, W), 160, np.uint8)
        luma[30, 40] = round(160 + share * (90 - 160))
        mask = coverage_of(Frame(0, 0.0, luma), background, palette)[0]
        # one grey level of 70
        assert mask[30, 40] == pytest.approx(FULL * share, abs=3)
        assert mask[0, 0] == 0


def test_light_and_shade_leave_the_coverage_of_a_colour() -> None:
    """A colour over a grey background, with a third less light and a third more, and half covered."""
    made = wandering(colour=(120, 90, 165), back=(100, 128, 128), noise=0.5)
    background = background_of(samples(made))
    colours = GeomColours(np.array([[120.0, 90.0, 165.0]]), np.zeros(1, int), np.zeros(1, bool))
    first = palette_found(made, background, "colour", 14.0)
    plain = measured_palette(first, background, colours)
    lit = measured_palette(first, background, replace(colours, light=np.array([0.2])))
    for light, share in ((0.7, 1.0), (1.3, 1.0), (1.0, 0.5), (1.0, 0.0)):
        colour = BLACK + light * (np.array([120.0, 90.0, 165.0]) - BLACK)
        mixed = [
            np.full(plane.shape, back + share * (value - back))
            for value, back, plane in zip(
                colour, (100.0, 128.0, 128.0), (made[0].luma, *made[0].chroma), strict=True
            )
        ]
        grey, blue, red = (np.round(plane).astype(np.uint8) for plane in mixed)
        frame = Frame(0, 0.0, grey, (blue, red))
        found = [coverage_of(frame, background, p)[0, 30, 40] / FULL for p in (plain, lit)]
        # rounding to grey levels moves the coverage by up to 0.03, and light what it does without noise
        assert found[1] == pytest.approx(share, abs=0.06)
        assert light == 1.0 or abs(found[0] - share) > 0.3


def test_colour_counts_where_grey_does_not_tell() -> None:
    made = wandering(colour=(160, 100, 190), back=(160, 128, 128))
    background = background_of(samples(made))
    palette = palette_found(made, background, "auto", 14.0)
    assert not palette.grey_only
    mask = coverage_of(made[10], background, palette).max(axis=0)
    assert mask[25:35, 29:41].min() > 0.9 * FULL
    assert mask[:15].max() < 0.1 * FULL
    assert palette_found(wandering(), background_of(samples(wandering())), "auto", 14.0).grey_only


@pytest.mark.parametrize("varied", [False, True])
def test_a_window_may_begin_in_the_middle_of_a_chroma_pixel(varied: bool) -> None:
    made = wandering(colour=(150, 90, 180), noise=0.5)
    background = background_of(samples(made))
    palette = palette_found(made, background, "colour", 14.0)
    colours = GeomColours(palette.colours, np.array([-1 if varied else 0]), np.zeros(1, bool), True)
    palette = measured_palette(palette, background, colours)
    assert palette.any_difference
    # the square of frame 8 covers columns 21 to 40
    part = slice(11, 49), slice(23, 71)
    window = Window(part[0].start, part[0].stop, part[1].start, part[1].stop)
    whole = coverage_of(made[8], background, palette)[:, *part]
    cut = coverage_of(made[8], replace(background, window=window), palette)[:, *part]
    # beyond the window the colours of its border are repeated
    np.testing.assert_array_equal(cut[:, 2:-2, 2:-2], whole[:, 2:-2, 2:-2])
    assert whole.max() > 0.8 * FULL


def test_a_noise_that_is_one_number_counts_everywhere() -> None:
    made = wandering(noise=0.5)
    background = replace(background_of(samples(made)), deviation=None, noise=6.0)
    palette = palette_found(made, background, "grey", 14.0)
    colours = GeomColours(palette.colours, np.zeros(1, int), np.zeros(1, bool), True)
    other = coverage_of(made[8], background, measured_palette(palette, background, colours))[-1]
    shown = {
        int(noise): coverage_of(
            made[8], replace(background, noise=noise), measured_palette(palette, background, colours)
        )[-1].max()
        for noise in (1.0, 30.0)
    }
    assert other[:, 60:].max() == 0
    # 30 grey levels of noise hide a difference of 70
    assert shown[1] > 0
    assert shown[30] == 0


@pytest.mark.parametrize("window", [Window(11, 33, 23, 51), Window(0, 20, 0, 30), Window(30, 60, 40, 80)])
@pytest.mark.parametrize("kind", ["grey", "colour", "varied"])
def test_a_part_of_a_mask_is_that_of_the_whole(kind: str, window: Window) -> None:
    # stretches from one corner of the window to the other, in one plane after the other, then in all of them
    at = np.arange(window.top, window.bottom)
    slant = np.linspace(window.left, window.right - 9, len(at)).astype(int)
    stretches = [(-1 if y % 3 == 2 else y % 3, y, x, x + 9) for y, x in zip(at, slant, strict=True)]
    made = wandering(colour=(90, 90, 180) if kind == "grey" else (150, 90, 180), noise=0.5)
    background = replace(background_of(samples(made)), window=Window(5, 55, 10, 75))
    palette = palette_found(made, background, "grey" if kind == "grey" else "colour", 14.0)
    part = np.array([-1 if kind == "varied" else 0])
    palette = measured_palette(
        palette, background, GeomColours(palette.colours, part, np.zeros(1, bool), True)
    )
    for frame in made[6:12:2]:
        whole = coverage_of(frame, background, palette)
        some = coverage_of(frame, background, palette, Wanted(np.array(stretches), window))
        for plane, y, left, right in stretches:
            # the plane of any difference is the last one
            for k in range(len(whole)) if plane < 0 else {min(plane, len(whole) - 1), len(whole) - 1}:
                np.testing.assert_array_equal(some[k, y, left:right], whole[k, y, left:right])
