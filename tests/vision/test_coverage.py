"""Coverage of pixels with known content."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from monodyn.types import FULL, Frame
from monodyn.vision.foreground.background import Background, background_of
from monodyn.vision.foreground.coverage import _closed, coverage_of
from monodyn.vision.foreground.masks import GeomColours, Wanted
from monodyn.vision.foreground.palette import BLACK, Palette, measured_palette
from monodyn.vision.foreground.shadow import Shadow
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


def grown(frame: Frame, more: int) -> Frame:
    """Return a frame with so many rows and columns more."""
    chroma = [np.pad(plane, (0, more), "edge") for plane in frame.chroma or ()]
    return Frame(frame.index, frame.time, np.pad(frame.luma, (0, more), "edge"), (chroma[0], chroma[1]))


@pytest.mark.parametrize("window", [Window(11, 33, 23, 51), Window(0, 20, 0, 30), Window(30, 60, 40, 80)])
@pytest.mark.parametrize("kind", ["grey", "colour", "varied"])
@pytest.mark.parametrize("more", [0, 1])
def test_a_part_of_a_mask_is_that_of_the_whole(kind: str, window: Window, more: int) -> None:
    # stretches from one corner of the window to the other, in one plane after the other, then in all of them
    at = np.arange(window.top, window.bottom)
    slant = np.linspace(window.left, window.right - 9, len(at)).astype(int)
    stretches = [(-1 if y % 3 == 2 else y % 3, y, x, x + 9) for y, x in zip(at, slant, strict=True)]
    made = wandering(colour=(90, 90, 180) if kind == "grey" else (150, 90, 180), noise=0.5)
    # the samples of colour of an odd number of rows are not two pixels high
    made = [grown(frame, more) for frame in made]
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


@pytest.mark.parametrize("kind", ["grey", "colour", "light"])
def test_stretches_are_what_a_pixel_alone_gives(kind: str) -> None:
    """Noise everywhere, up to the border of the background's window, pixel by pixel."""
    rng = np.random.default_rng(11)
    made = wandering(colour=(90 if kind == "grey" else 150, 90, 180), noise=0.5)
    background = replace(background_of(samples(made)), window=Window(5, 55, 11, 74))
    palette = palette_found(made, background, "grey" if kind == "grey" else "colour", 14.0)
    light = np.array([0.2]) if kind == "light" else None
    colours = GeomColours(palette.colours, np.zeros(1, int), np.zeros(1, bool), light=light)
    palette = measured_palette(palette, background, colours)
    if palette.dimmed is not None:
        dimmed = [rng.uniform(0.0, 0.3, part.shape).astype(np.float32) for part in palette.dimmed]
        palette = replace(palette, dimmed=(dimmed[0], dimmed[1]))
    planes = [rng.integers(0, 256, plane.shape, dtype=np.uint8) for plane in (made[0].luma, *made[0].chroma)]
    frame = Frame(0, 0.0, planes[0], (planes[1], planes[2]))
    tint = palette_tint(frame, background, palette)
    (f,), light = palette.colours, palette.colours[0] - BLACK
    behind = background.luma.astype(float)
    share = 0.0 if palette.dimmed is None else palette.dimmed[0][0]
    level = (planes[0] - behind) * (f[0] - behind - share * light[0]) + tint
    expected = np.clip(level * palette.scale[0], 0.0, 255.0)
    expected[:5] = expected[55:] = expected[:, :11] = expected[:, 74:] = 0.0
    found = coverage_of(frame, background, palette)[0].astype(float)
    # rounded to whole levels, and in numbers of seven digits
    assert np.abs(found - expected).max() < 0.51
    assert np.count_nonzero(found[5]) > 5
    assert np.count_nonzero(found[5:55, 73]) > 5


def palette_tint(frame: Frame, background: Background, palette: Palette) -> np.ndarray:
    """Return what the colours add to the level of each pixel of an even picture, (row, column)."""
    if palette.grey_only or frame.chroma is None or background.chroma is None:
        return np.zeros(frame.luma.shape)
    share = 0.0 if palette.dimmed is None else palette.dimmed[1][0]
    small = np.zeros(frame.chroma[0].shape, np.float32)
    for k, (shown, behind) in enumerate(zip(frame.chroma, background.chroma, strict=True), start=1):
        own = palette.colours[0, k]
        small += 0.25 * (shown - behind) * (own - behind - share * (own - BLACK[k]))
    # the colours of the window are enlarged alone: beyond its border they count as at it
    top, bottom, left, right = background.window
    part = small[top // 2 : -(-bottom // 2), left // 2 : -(-right // 2)]
    large = cv2.resize(part, (2 * part.shape[1], 2 * part.shape[0]), interpolation=cv2.INTER_LINEAR)
    whole = np.zeros(frame.luma.shape)
    rows, columns = 2 * (top // 2), 2 * (left // 2)
    whole[rows : rows + large.shape[0], columns : columns + large.shape[1]] = large
    return whole


@pytest.mark.parametrize("more", [0, 1])
@pytest.mark.parametrize("grey", [True, False])
def test_a_part_has_the_shadows_of_the_whole(more: int, grey: bool) -> None:
    rng = np.random.default_rng(5)
    made = [grown(frame, more) for frame in wandering(colour=(90 if grey else 150, 90, 180), noise=0.5)]
    background = replace(background_of(samples(made)), window=Window(5, 55, 11, 74))
    palette = palette_found(made, background, "grey" if grey else "colour", 14.0)
    palette = replace(palette, shadow=Shadow(0.5, 0.8))
    changed = 0
    for _ in range(40):
        # patches of wall in more or less shadow, with some colour
        luma = background.luma * cv2.blur(rng.uniform(0.3, 1.1, background.luma.shape), (9, 9))
        tint = [
            np.clip(plane + rng.normal(scale=3.0, size=plane.shape), 0, 255) for plane in made[0].chroma or ()
        ]
        frame = Frame(0, 0.0, luma.astype(np.uint8), (tint[0].astype(np.uint8), tint[1].astype(np.uint8)))
        top, left = int(rng.integers(0, 40)), int(rng.integers(0, 50))
        window = Window(top, top + 18, left, left + 25)
        rows = np.array([(-1, y, window.left, window.right) for y in range(window.top, window.bottom)])
        part = coverage_of(frame, background, palette, Wanted(rows, window))
        whole = coverage_of(frame, background, palette)
        inside = slice(window.top, window.bottom), slice(window.left, window.right)
        np.testing.assert_array_equal(part[:, *inside], whole[:, *inside])
        without = coverage_of(frame, background, replace(palette, shadow=None))
        changed += int(np.count_nonzero(without != whole))
    assert changed > 500


@pytest.mark.parametrize("shape", [(97, 120), (3, 50), (50, 3), (60, 1), (1, 1)])
def test_gaps_are_closed_as_by_all_pixels_of_the_disc(shape: tuple[int, int]) -> None:
    """Against OpenCV, for the discs of pictures of up to 4,875 px, which reach beyond the smallest planes."""
    random = np.random.default_rng(1)
    for by in range(20):
        plane = (random.integers(0, 256, shape) * (random.random(shape) < 0.3)).astype(np.uint8)
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * by + 1, 2 * by + 1))
        np.testing.assert_array_equal(_closed(plane, by), cv2.morphologyEx(plane, cv2.MORPH_CLOSE, disc))
