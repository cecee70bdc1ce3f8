"""Coverage of pixels with known content."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.types import FULL, Frame
from monodyn.vision.foreground.background import background_of
from monodyn.vision.foreground.coverage import coverage_of
from monodyn.vision.foreground.palette import choose_palette
from pictures import H, W, samples, wandering


def test_coverage_is_the_share_of_a_mixed_pixel() -> None:
    made = wandering(noise=0.0)
    background = background_of(samples(made))
    palette = choose_palette(made, background, "grey", 14.0)
    for share in (0.25, 0.5, 0.9):
        luma = np.full((H, W), 160, np.uint8)
        luma[30, 40] = round(160 + share * (90 - 160))
        mask = coverage_of(Frame(0, 0.0, luma), background, palette)[0]
        # one grey level of 70
        assert mask[30, 40] == pytest.approx(FULL * share, abs=3)
        assert mask[0, 0] == 0


def test_colour_counts_where_grey_does_not_tell() -> None:
    made = wandering(colour=(160, 100, 190), back=(160, 128, 128))
    background = background_of(samples(made))
    palette = choose_palette(made, background, "auto", 14.0)
    assert not palette.grey_only
    mask = coverage_of(made[10], background, palette).max(axis=0)
    assert mask[25:35, 29:41].min() > 0.9 * FULL
    assert mask[:15].max() < 0.1 * FULL
    assert choose_palette(wandering(), background_of(samples(wandering())), "auto", 14.0).grey_only
