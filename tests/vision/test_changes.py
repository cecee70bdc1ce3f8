"""From which difference on a pixel has changed."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.vision.foreground.background import background_of
from monodyn.vision.foreground.changes import (
    CHANGED_SHARE,
    MOST_CONTRAST,
    least_contrast,
    moving_pixels,
    surroundings,
)
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
    pixels = moving_pixels(made, background, around, True, 14.0, None)
    assert np.median(pixels[:, 0]) == pytest.approx(90, abs=2)
    assert np.median(pixels[:, 3]) == pytest.approx(160, abs=3)
