"""The background that samples leave free."""

from __future__ import annotations

import numpy as np

from monodyn.vision.foreground.background import background_of, within
from monodyn.vision.foreground.covered import Covered
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
    found, plain = background_of(samples(made), Covered(covered)), background_of(samples(made))
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
