"""Colours of the mechanism and the trust of every pixel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.types import FULL, Frame
from monodyn.vision.foreground.background import Background, background_of
from monodyn.vision.foreground.changes import moving_pixels, surroundings
from monodyn.vision.foreground.coverage import coverage_of
from monodyn.vision.foreground.covered import covered_whole
from monodyn.vision.foreground.masks import VARIED, GeomColours
from monodyn.vision.foreground.moving_colours import lingering, moving_colours
from monodyn.vision.foreground.palette import VARIED_TRUST, measured_palette, palette_of, with_wall
from pictures import WHOLE, H, W, palette_found, samples, wandering


def test_two_colours_are_both_foreground() -> None:
    made = wandering()
    for frame in made:
        x = 5 + 2 * frame.index
        frame.luma[30:40, x : x + 20] = 240
    background = background_of(samples(made))
    palette = palette_found(made, background, "grey", 14.0)
    assert sorted(palette.colours[:, 0].round(-1).tolist()) == [90, 240]
    mask = coverage_of(made[10], background, palette).max(axis=0)
    assert mask[22:38, 27:43].min() > 0.9 * FULL


def test_a_lingering_mechanism_is_not_its_own_background() -> None:
    """Two thirds of the time the square stands still: the plain median shows it."""
    made = wandering(places=[5 + i for i in range(16)] + [50] * 32, count=48)
    first = background_of(samples(made))
    assert first.luma[30, 60] == pytest.approx(90, abs=2)
    found = moving_colours(made, first, "grey", 14.0)
    # a main colour is known without
    assert not len(found.resting)
    second = background_of(samples(made), lingering(made, first, found), fallback=first)
    assert second.luma[30, 60] == pytest.approx(160, abs=2)


def swaying(wall: np.ndarray, *, bar: np.ndarray | int, cart: int | None = 60) -> list[Frame]:
    """A bar of 6 px goes to and fro before a wall, uint8 (height, width), below it a cart of 30 px that sways
    by a few pixels."""
    rng, made = np.random.default_rng(9), []
    for i in range(36):
        luma = wall + rng.normal(0.0, 0.7, wall.shape)
        x, aside = int(37.0 + 33.0 * np.sin(0.7 * i)), int(25.5 - 5.0 * np.sin(0.7 * i))
        if cart is not None:
            luma[40:52, aside : aside + 30] = cart
        luma[6:44, x : x + 6] = bar
        made.append(Frame(i, i / 30, np.clip(luma.round(), 0, 255).astype(np.uint8), None))
    return made


def test_a_cart_that_moves_by_less_than_its_length_is_not_its_own_background() -> None:
    made = swaying(np.full((H, W), 160, np.uint8), bar=230)
    first = background_of(samples(made))
    assert first.luma[46, 40] == pytest.approx(60, abs=2)
    found = moving_colours(made, first, "grey", 14.0)
    # too little of it shows for a colour of what moves
    assert found.colours[:, 0] == pytest.approx([230], abs=2)
    assert found.resting[:, 0] == pytest.approx([60], abs=2)
    second = background_of(samples(made), lingering(made, first, found), fallback=first)
    # where it stands in some frames only the wall shows, and in the middle nothing is known of it
    np.testing.assert_allclose(second.luma[44:52, [22, 58]], 160.0, atol=2.0)
    assert not second.known[44:52, 32:48].any()
    again = moving_colours(made, second, "grey", 14.0)
    assert sorted(again.colours[:, 0].round().tolist()) == pytest.approx([60, 230], abs=2)


CELLS = np.where(np.indices((H, W)).sum(axis=0) // 20 % 2, 170, 90).astype(np.uint8)
POSTER = np.full((H, W), 170, np.uint8)
POSTER[10:36, 20:56] = 80
TIPPED = np.where(np.arange(38)[:, np.newaxis] < 5, 90, 130)


@pytest.mark.parametrize(
    ("wall", "bar"),
    [
        (CELLS, 110), (CELLS, 130), (CELLS, 150), (POSTER, 130), (POSTER, TIPPED),
        (CELLS, np.linspace(20.0, 150.0, 38)[:, np.newaxis]),
        (CELLS, np.linspace(60.0, 220.0, 38)[:, np.newaxis]),
    ],
    ids=["darker", "between", "brighter", "poster", "tipped", "dark to grey", "dark to bright"],
)  # fmt: skip
def test_a_wall_of_two_colours_is_not_what_moves_before_it(wall: np.ndarray, bar: np.ndarray | int) -> None:
    """A bar between the two is more like what is around than either, and may have a shade of one of them."""
    made = swaying(wall, bar=bar, cart=None)
    first = background_of(samples(made))
    around = surroundings(made, first, 14.0)
    assert len(moving_pixels(made, first, around, True, 14.0, None).absent) > 100
    assert not len(moving_colours(made, first, "grey", 14.0).resting)


def test_pixels_never_uncovered_are_not_trusted() -> None:
    made = wandering(places=[30 + i % 3 for i in range(24)])
    first = background_of(samples(made))
    covered = [np.zeros((H, W), bool) for _ in made]
    for frame, mask in zip(made, covered, strict=True):
        mask[20:40, 30 + frame.index % 3 : 50 + frame.index % 3] = True
    background = background_of(samples(made), covered_whole(covered), fallback=first)
    assert not background.known[30, 40]
    palette = palette_found(
        made,
        Background(np.full((H, W), 160, np.float32), None, 1.0, background.known, WHOLE),
        "grey",
        14.0,
    )
    assert palette.trust[0, 30, 40] == 0
    assert palette.trust[0, 5, 5] > 0.5


@pytest.mark.parametrize("coloured", [False, True])
def test_where_an_outline_lay_in_all_frames_the_wall_is_known_or_taken_from_around(coloured: bool) -> None:
    """An outline reaches from the mechanism over the wall, and behind a bracket of another colour."""
    rng = np.random.default_rng(3)
    wall = (160.0 + rng.normal(0.0, 1.0, (H, W))).astype(np.float32)
    luma, known = wall.copy(), np.ones((H, W), bool)
    known[20:32, 20:70] = False
    # from the left: wall, mechanism, bracket
    luma[20:32, 36:52], luma[20:32, 58:64] = 90.0, 230.0
    small = np.full((H // 2, W // 2), 128.0, np.float32)
    chroma = (small.copy(), small.copy())
    chroma[0][10:16, 18:26] = 160.0
    seen = Background(luma, chroma if coloured else None, 1.0, known, WHOLE)
    colour = np.array([[90.0, 160.0 if coloured else 128.0, 128.0]])
    found = with_wall(seen, colour, grey_only=not coloured)
    assert found.known[22:30, 22:34].all()
    assert found.known[22:30, 38:50].all()
    assert not found.known[22:30, 59:63].any()
    np.testing.assert_array_equal(found.luma[22:30, 22:34], wall[22:30, 22:34])
    np.testing.assert_allclose(found.luma[22:30, 38:50], 160.0, atol=8.0)
    np.testing.assert_array_equal(found.luma[~seen.known & ~found.known], luma[~seen.known & ~found.known])
    if found.chroma is not None:
        np.testing.assert_allclose(found.chroma[0][11:15, 19:25], 128.0, atol=1.0)
    assert with_wall(replace(seen, given=True), colour, grey_only=True).known is known


def test_borders_count_by_the_least_contrast_over_the_noise() -> None:
    frames = wandering(noise=1.0)
    background = background_of(samples(frames))
    palette = palette_found(frames, background, "auto", 15.0)
    grey, one = np.array([[90.0, 128.0, 128.0]]), np.array([0])
    hidden = GeomColours(grey, one, np.array([False]), camouflaged=True)
    found = measured_palette(palette, background, hidden)
    # 15 grey levels over the noise, where 60 times the noise counts in full
    trust = 15.0 / (60.0 * background.noise)
    np.testing.assert_allclose(found.trust[-1][background.known], trust, rtol=1e-6)
    assert found.view(1).border == 1
    noisy = replace(background, noise=9.0)
    np.testing.assert_allclose(measured_palette(palette, noisy, hidden).trust[-1].max(), VARIED_TRUST)
    varied = GeomColours(grey, np.array([0, VARIED]), np.array([False, False]), camouflaged=True)
    np.testing.assert_allclose(measured_palette(palette, background, varied).trust[-1].max(), VARIED_TRUST)


def test_over_a_background_cleared_of_a_little_kept_colours_do_as_well_as_new_ones() -> None:
    made = wandering()
    first = background_of(samples(made))
    found = moving_colours(made, first, "grey", 14.0)
    mask = np.zeros((H, W), bool)
    mask[50:54, 60:64] = True
    cleared = background_of(samples(made), covered_whole([mask] * len(made)), fallback=first)
    assert not cleared.known[mask].any()
    np.testing.assert_array_equal(cleared.known | mask, first.known)
    anew = palette_found(made, cleared, "grey", 14.0)
    kept = palette_of(found, cleared)
    np.testing.assert_array_equal(kept.trust > 0, anew.trust > 0)
    for frame in made:
        one, other = (coverage_of(frame, cleared, palette).astype(int) for palette in (kept, anew))
        assert np.abs(one - other).max() <= 0.02 * FULL
    np.testing.assert_allclose(found.colours[:, 0], anew.colours[:, 0], atol=1.0)


def test_nothing_lingers_where_the_background_shows_none_of_it() -> None:
    made = wandering()
    first = background_of(samples(made))
    assert lingering(made, first, moving_colours(made, first, "colour", 14.0)) is None
