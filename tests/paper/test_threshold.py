"""The binary silhouette of one frame."""

from __future__ import annotations

import numpy as np

from chains import CAMERA, POSE, chain_picture
from monodyn.errors import SettingsError
from monodyn.paper.threshold import OPEN, Threshold, difference, holds, otsu_threshold, silhouette
from monodyn.types import FULL, Frame
from monodyn.vision.foreground.background import Background, Window
from support import refuses


def background(grey: float = 170.0, known: np.ndarray | None = None) -> Background:
    luma = np.full((CAMERA.height, CAMERA.width), grey, np.float32)
    known = np.ones(luma.shape, dtype=bool) if known is None else known
    return Background(luma, None, 1.0, known, (0, CAMERA.height, 0, CAMERA.width))


def frame(noise: float = 2.0) -> tuple[Frame, np.ndarray]:
    mask = chain_picture(POSE) > 0
    rng = np.random.default_rng(2)
    luma = np.where(mask, 60.0, 170.0) + noise * rng.standard_normal(mask.shape)
    luma[5:8, 5:8] = 60.0
    return Frame(0, 0.0, np.clip(np.round(luma), 0, 255).astype(np.uint8)), mask


def test_silhouette_by_background_subtraction_and_threshold() -> None:
    shot, mask = frame()
    threshold = otsu_threshold([shot], background())
    assert 20.0 < threshold.level < 100.0
    out = silhouette(shot, background(), threshold)
    np.testing.assert_array_equal(out, np.where(mask, FULL, 0))  # the patch of nine pixels is left out
    assert holds(out)
    assert not holds(silhouette(shot, background(), Threshold(200.0)))


def test_otsu_level_maximizes_the_variance_between_the_classes() -> None:
    shot, _ = frame(noise=9.0)
    values = difference(shot, background()).ravel().astype(float)
    spread = [
        np.mean(values <= t)
        * np.mean(values > t)
        * (values[values <= t].mean() - values[values > t].mean()) ** 2
        for t in range(1, 110)
    ]
    best = 1 + np.flatnonzero(np.array(spread) >= max(spread) * (1 - 1e-12))
    assert best.min() <= otsu_threshold([shot], background()).level <= best.max()


def test_a_link_of_the_background_grey_stands_out_by_its_colour() -> None:
    """Red before grey of the same luma; where grey divides as well, colour is not asked."""
    shot, mask = frame()
    small = mask[::2, ::2]
    red = np.where(small, 200, 128).astype(np.uint8)
    plain = np.full(small.shape, 128, np.uint8)
    still = Background(
        np.full(mask.shape, 170.0, np.float32), (plain.astype(np.float32), plain.astype(np.float32)), 1.0,
        np.ones(mask.shape, dtype=bool), Window(0, CAMERA.height, 0, CAMERA.width),
    )  # fmt: skip
    even = Frame(0, 0.0, np.full(mask.shape, 170, np.uint8), (plain, red))
    threshold = otsu_threshold([even], still)
    assert threshold.colour
    assert 25.0 < threshold.level < 45.0
    out = silhouette(even, still, threshold)
    # a colour sample covers four pixels
    assert np.mean(out != np.where(mask, FULL, 0)) < 0.2 * np.mean(mask)
    assert not otsu_threshold([Frame(0, 0.0, shot.luma, (plain, plain))], still).colour


def test_the_distance_of_colours() -> None:
    """Three, four and twelve grey levels apart in luma, blue and red are thirteen in all."""
    size = (8, 8)
    luma, small = np.full(size, 100, np.uint8), np.full((4, 4), 100, np.uint8)
    still = Background(
        luma + np.float32(3), (small - np.float32(4), small + np.float32(12)), 1.0, np.ones(size, dtype=bool),
        Window(0, 8, 0, 8),
    )  # fmt: skip
    shot = Frame(0, 0.0, luma, (small, small))
    np.testing.assert_array_equal(difference(shot, still), 3)
    np.testing.assert_array_equal(difference(shot, still, colour=True), 13)


def test_pixels_without_a_background() -> None:
    """A small patch that the mechanism touches is its own; a stand that it crosses is left open."""
    shot, mask = frame()
    known = np.ones(mask.shape, dtype=bool)
    y, x = (round(float(values.mean())) for values in np.nonzero(mask))
    known[y - 3 : y + 3, x - 3 : x + 3] = False
    known[:60, 300:340] = False
    out = silhouette(shot, background(known=known), Threshold(50.0))
    np.testing.assert_array_equal(out[:60, 300:340], OPEN)
    assert np.all(out[y - 3 : y + 3, x - 3 : x + 3] == FULL)
    assert np.all(silhouette(shot, background(known=known), Threshold(50.0), settle=False)[~known] == OPEN)


def test_a_level_out_of_range_is_refused() -> None:
    with refuses(SettingsError, "silhouette: expected a level above 0 and below 255, got 0."):
        silhouette(frame()[0], background(), Threshold(0.0))
