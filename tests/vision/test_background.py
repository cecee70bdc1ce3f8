"""The background that samples leave free."""

from __future__ import annotations

import numpy as np

from monodyn.vision.foreground.background import background_of, within
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
