"""From which difference on a pixel has changed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.vision.foreground import changes
from monodyn.vision.foreground.background import background_of
from monodyn.vision.foreground.changes import (
    CHANGED_SHARE,
    MOST_CONTRAST,
    least_contrast,
    moving_pixels,
    surroundings,
)
from monodyn.vision.foreground.shadow import Shadow
from monodyn.vision.foreground.thumbnails import Window
from pictures import samples, wandering


@pytest.mark.parametrize(("level", "expected"), [(90, MOST_CONTRAST), (140, CHANGED_SHARE * 20.0)])
def test_a_faint_mechanism_counts_from_a_share_of_its_contrast(level: int, expected: float) -> None:
    """Before a wall of 160 grey levels with a noise of 1."""
    made = wandering(colour=(level, 128, 128), back=(160, 128, 128), noise=0.5)
    assert least_contrast(made, background_of(samples(made)), True) == pytest.approx(expected, rel=0.15)


def test_pixels_that_move_show_what_moves() -> None:
    made = wandering()
    background = background_of(samples(made))
    around = surroundings(made, background, 14.0)
    pixels, absent = moving_pixels(made, background, around, True, 14.0, None)
    assert not len(absent)
    assert np.median(pixels[:, 0]) == pytest.approx(90, abs=2)
    assert np.median(pixels[:, 3]) == pytest.approx(160, abs=3)


def test_what_the_background_holds_and_a_frame_does_not_is_absent() -> None:
    """The square stands at one place for most of the time: what it leaves there is no pixel that moves."""
    made = wandering(places=[5 + i for i in range(8)] + [50] * 24, count=32)
    background = background_of(samples(made))
    around = surroundings(made, background, 14.0)
    pixels, absent = moving_pixels(made, background, around, True, 14.0, None)
    assert np.median(pixels[:, 0]) == pytest.approx(90, abs=2)
    np.testing.assert_allclose(absent[:, 3], 90.0, atol=2.0)
    np.testing.assert_allclose(absent[:, 0], 160.0, atol=5.0)
    # a square of 20 px without its border: as much shows of it as is missing
    assert len(absent) == pytest.approx(len(pixels), rel=0.05)


@pytest.mark.parametrize(
    ("window", "kinds"), [(Window(0, 60, 0, 80), [0, 1]), (Window(0, 60, 40, 80), [1])], ids=["all", "gone"]
)
def test_of_each_frame_only_so_many_pixels_are_taken(
    window: Window, kinds: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of both kinds every so many, whichever of them is more: where the square goes to may not count."""
    made = wandering(places=[5 + i for i in range(8)] + [50] * 16, count=24)
    background = replace(background_of(samples(made)), window=window)
    around = surroundings(made, background, 14.0)
    every = moving_pixels(made, background, around, True, 14.0, None)
    monkeypatch.setattr(changes, "PICKED", 40)
    found = moving_pixels(made, background, around, True, 14.0, None)
    assert [kind for kind in range(2) if len(found[kind])] == kinds
    for kind in kinds:
        _, counts = np.unique(found[kind][:, changes.FRAME], return_counts=True)
        assert counts.max() < 2 * 40
        assert len(found[kind]) > 0.05 * len(every[kind])


@pytest.mark.parametrize("core", [0, 10**6])
@pytest.mark.parametrize("shadow", [None, Shadow(0.6, 0.95)])
@pytest.mark.parametrize("window", [Window(21, 39, 14, 47), Window(0, 60, 3, 80), Window(25, 60, 0, 41)])
def test_a_part_of_the_pictures_shows_what_the_whole_does(
    window: Window, shadow: Shadow | None, core: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The square goes through the edges of the window; without a core its own edges count, too."""
    rng = np.random.default_rng(8)
    made = [
        replace(
            frame, chroma=tuple(np.clip(p + rng.normal(0, 9, p.shape), 0, 255).astype(np.uint8) for p in c)
        )
        for frame in wandering(colour=(130, 90, 180), noise=2.0)
        if (c := frame.chroma) is not None
    ]
    background = replace(background_of(samples(made)), window=window)
    around = surroundings(made, background, 8.0)
    monkeypatch.setattr(changes, "LEAST_CORE", core)
    found = moving_pixels(made, background, around, False, 8.0, shadow)
    monkeypatch.setattr(changes, "MARGIN_PX", 1000)
    whole = moving_pixels(made, background, around, False, 8.0, shadow)
    for one, other in zip(found, whole, strict=True):
        np.testing.assert_array_equal(one, other)
    assert len(found.pixels) > 1000
