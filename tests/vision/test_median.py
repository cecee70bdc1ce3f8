"""The median over the frames of a stack of pictures."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.vision.foreground.median import masked_median


def test_median_against_numpy() -> None:
    stack = np.random.default_rng(0).integers(0, 256, (15, 6, 7), dtype=np.uint8)
    median, _, count = masked_median(stack, np.zeros((0, 0, 0), np.bool_))
    # interpolated within the middle grey level, so at most half a level from the plain median of an odd count
    np.testing.assert_allclose(median, np.median(stack, axis=0), atol=0.5)
    assert (count == 15).all()


def test_median_leaves_hidden_samples_out() -> None:
    stack = np.full((9, 3, 3), 50, np.uint8)
    stack[:6] = 200
    hidden = np.zeros(stack.shape, np.bool_)
    hidden[:6, 1, 1] = True
    median, _, count = masked_median(stack, hidden)
    assert median[1, 1] == pytest.approx(50, abs=0.5)
    assert median[0, 0] == pytest.approx(200, abs=0.5)
    assert count[1, 1] == 3


@pytest.mark.parametrize(("low", "high"), [(0, 2), (0, 256), (90, 107), (200, 256), (255, 256)])
@pytest.mark.parametrize("frames", [2, 3, 72, 255, 300])
def test_every_range_of_levels_and_number_of_frames(low: int, high: int, frames: int) -> None:
    """Against a sorted list; a block is of 512 pixels, and the last one is not full."""
    rng = np.random.default_rng(frames)
    stack = rng.integers(low, high, (frames, 3, 211), dtype=np.uint8)
    hidden = rng.random(stack.shape) < 0.3
    for shown in (np.ones_like(hidden), ~hidden):
        counted = shown.sum(axis=0)
        median, _, count = masked_median(stack, np.zeros((0, 0, 0), np.bool_) if shown.all() else hidden)
        for y, x in np.argwhere(counted > 0):
            ordered = np.sort(stack[shown[:, y, x], y, x]).astype(int)
            level = ordered[-(-len(ordered) // 2) - 1]
            below, at = np.searchsorted(ordered, level), np.sum(ordered == level)
            assert median[y, x] == pytest.approx(level - 0.5 + (len(ordered) / 2 - below) / at, abs=1e-4)
        np.testing.assert_array_equal(count, counted)


def test_median_takes_the_steps_out_of_shading() -> None:
    rng = np.random.default_rng(1)
    stack = np.round(100.3 + rng.normal(scale=1.5, size=(400, 2, 2))).astype(np.uint8)
    median, noise, _ = masked_median(stack, np.zeros((0, 0, 0), np.bool_))
    # standard error of a median of 400: 1.25 * 1.5 / 20
    np.testing.assert_allclose(median, 100.3, atol=0.4)
    # rounding adds 1/12 to the variance
    np.testing.assert_allclose(noise, 1.53, rtol=0.15)


def test_what_passes_is_no_noise_however_faint() -> None:
    """A third of the time something 5 grey levels darker stands before the pixel."""
    rng = np.random.default_rng(2)
    level = np.where(rng.random((600, 2, 2)) < 0.33, 95.0, 100.0)
    stack = np.round(level + rng.normal(scale=0.6, size=level.shape)).astype(np.uint8)
    median, noise, _ = masked_median(stack, np.zeros((0, 0, 0), np.bool_))
    np.testing.assert_allclose(median, 100.0, atol=0.7)
    # the standard deviation of all samples is 2.4
    assert noise.max() < 1.6
