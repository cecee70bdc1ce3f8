"""The background that samples leave free."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.types import Frame
from monodyn.vision.foreground.background import background_of, within
from monodyn.vision.foreground.chroma import whole_samples
from monodyn.vision.foreground.covered import Covered, covered_whole
from monodyn.vision.foreground.thumbnails import Window
from pictures import samples, wandering


def test_background_is_what_the_square_leaves_free() -> None:
    made = wandering()
    found = background_of(samples(made))
    # covered up to 10 times of 24, always darker: the median is then a low percentile of the noise of 1
    np.testing.assert_allclose(found.luma, 160, atol=3.0)
    assert found.known.all()
    assert 0.5 <= found.noise <= 1.5


def test_within_a_part_nothing_is_known_of_what_else_moves() -> None:
    found = background_of(samples(wandering()))
    others = np.zeros(found.luma.shape, dtype=bool)
    others[30:, :40] = True
    part = within(found, Window(10, 50, 20, 70), others)
    assert part.window == Window(10, 50, 20, 70)
    assert not part.known[30:, :40].any()
    assert part.known[:30].all()
    # columns 20 to 70 and rows 10 to 50, without rows from 30 on of the columns before 40
    assert part.counts.sum() == 40 * 50 - 20 * 20


def test_pixels_covered_in_a_frame_show_the_others_alone() -> None:
    made = wandering(colour=(90, 80, 170), places=[10 + 2 * (i // 4) for i in range(24)])
    covered = [frame.luma < 125 for frame in made]
    found, plain = background_of(samples(made), covered_whole(covered)), background_of(samples(made))
    shown = np.ma.masked_array([frame.luma for frame in made], covered)
    free = ~np.all(covered, axis=0)
    # of an even number of samples any level between the middle two is a median
    np.testing.assert_allclose(found.luma[free], np.ma.median(shown, axis=0).filled(0)[free], atol=1.01)
    never = ~np.any(covered, axis=0)
    np.testing.assert_array_equal(found.luma[never], plain.luma[never])
    # columns 20 to 29 are dark in every frame, and nobody knows what is behind
    assert not found.known[20:40, 20:30].any()
    assert found.known[free].all()
    assert found.chroma is not None
    np.testing.assert_allclose(found.chroma[0][10:20, 5:9], 128, atol=0.51)
    np.testing.assert_allclose(found.chroma[1][10:20, 16:19], 128, atol=0.51)


@pytest.mark.parametrize("small", [(30, 40), (30, 20)])
def test_a_part_that_is_covered_counts_as_in_the_whole_picture(small: tuple[int, int]) -> None:
    """Samples of the colours of 2x2 and of 2x4 pixels."""
    rng = np.random.default_rng(5)
    masks = [np.zeros((60, 80), bool) for _ in range(24)]
    for mask in masks:
        mask[13:28, 31:46] = rng.random((15, 15)) < 0.3
    window = whole_samples(Window(13, 28, 31, 46), (60, 80), small)
    planes = [tuple(rng.integers(0, 256, small, dtype=np.uint8) for _ in range(2)) for _ in masks]
    frames = [
        Frame(i, i / 30, rng.integers(0, 256, (60, 80), dtype=np.uint8), (blue, red))
        for i, (blue, red) in enumerate(planes)
    ]
    parts = [mask[window.top : window.bottom, window.left : window.right] for mask in masks]
    found = background_of(samples(frames), Covered(parts, window))
    expected = background_of(samples(frames), covered_whole(masks))
    assert found.chroma is not None
    assert expected.chroma is not None
    for one, other in ((found.luma, expected.luma), *zip(found.chroma, expected.chroma, strict=True)):
        np.testing.assert_array_equal(one, other)
    for one, other in ((found.deviation, expected.deviation), (found.known, expected.known)):
        assert one is not None
        assert other is not None
        np.testing.assert_array_equal(one, other)


def test_a_mask_that_does_not_fit_its_window_is_refused() -> None:
    masks = [np.zeros((15, 15), bool)] * 24
    with pytest.raises(ValueError, match=r"masks: expected the size of Window\(top=13, .* got \(15, 15\)"):
        Covered(masks, Window(13, 28, 31, 47))
    with pytest.raises(ValueError, match=r"window: expected whole samples of \(30, 40\) in \(60, 80\)"):
        Covered(masks, Window(13, 28, 31, 46)).of_samples((60, 80), (30, 40))


def test_blue_and_red_stay_apart_and_pictures_may_lie_in_any_order() -> None:
    made = wandering(back=(160, 100, 140))
    found = background_of(samples(made))
    assert found.chroma is not None
    assert [float(np.median(plane)) for plane in found.chroma] == pytest.approx([100.0, 140.0], abs=0.5)
    turned = [
        replace(frame, luma=np.asfortranarray(frame.luma), chroma=tuple(map(np.asfortranarray, frame.chroma)))
        for frame in made
        if frame.chroma is not None
    ]
    np.testing.assert_array_equal(background_of(samples(turned)).luma, found.luma)


def test_a_window_of_whole_samples_stays_within_the_picture() -> None:
    assert whole_samples(Window(-5, 28, 31, 99), (60, 80), (30, 40)) == Window(0, 28, 30, 80)
    assert whole_samples(Window(13, 28, 31, 46), (60, 80), (30, 20)) == Window(12, 28, 28, 48)
    assert whole_samples(Window(13, 28, 31, 46), (60, 80), None) == Window(13, 28, 31, 46)
    assert whole_samples(Window(13, 28, 31, 46), (60, 80), (29, 40)) == Window(0, 60, 0, 80)
