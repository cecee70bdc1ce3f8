"""Key frames: masks that differ from one another, reduced, with the sums that the search reads."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from monodyn.types import FULL, Mask
from monodyn.vision.foreground.background import Window
from monodyn.vision.foreground.masks import plain_view
from monodyn.vision.locating.keyframes import LEAST_COVERAGE, key_frame, key_frames, no_frames

HEIGHT, WIDTH, SHRINK = 90, 510, 3
"""A picture that is three times as wide as the reduced one may be [px]."""


def masks_of(planes: list[np.ndarray], trust: np.ndarray | None = None) -> Any:
    """Return masks, as a segmentation gives them, of frames whose planes are known."""
    trusted = np.ones((HEIGHT, WIDTH), np.float32) if trust is None else trust
    return SimpleNamespace(
        samples=SimpleNamespace(frames=range(len(planes))),
        background=SimpleNamespace(window=Window(0, HEIGHT, 0, WIDTH)),
        varied=False,
        view=lambda geoms: plain_view(trusted, geoms),
        of=lambda i: Mask(i, i / 30.0, planes[i]),
    )


def block(left: int, width: int = 60) -> np.ndarray:
    """Draw a covered block over the whole height, (1, height, width)."""
    plane = np.zeros((1, HEIGHT, WIDTH), np.uint8)
    plane[0, :, left : left + width] = FULL
    return plane


def test_the_most_distinct_masks_are_chosen_and_copies_come_last() -> None:
    """Two blocks far apart, copies of both, and one in between that half overlaps the first."""
    lefts = (0, 0, 300, 30, 300)
    planes = [block(left, 72 if i == 2 else 60) for i, left in enumerate(lefts)]
    frames = key_frames(masks_of(planes), 1)
    assert frames.most_distinct(2)[0] == 2  # the fullest
    assert set(frames.most_distinct(3)) in ({2, 0, 3}, {2, 1, 3})
    assert sorted(frames.most_distinct(9)) == [0, 1, 2, 3, 4]
    assert [frame.index for frame in frames.only([3, 1]).frames] == [3, 1]


def test_reduced_masks_are_means_and_their_sums_cumulative() -> None:
    rng = np.random.default_rng(0)
    planes = rng.integers(0, FULL + 1, (2, HEIGHT, WIDTH), dtype=np.uint8)
    trust = np.ones((HEIGHT, WIDTH), np.float32)
    trust[:, :30] = 0.0
    masks = masks_of([planes], trust)
    frames = key_frames(masks, 1)
    (frame,) = frames.frames
    assert frames.shrink == SHRINK
    shape = (HEIGHT // SHRINK, SHRINK, WIDTH // SHRINK, SHRINK)
    mean = planes.max(axis=0).astype(float).reshape(shape).mean(axis=(1, 3))
    known = np.arange(WIDTH // SHRINK) >= 10
    np.testing.assert_array_equal(frames.unknown, np.broadcast_to(~known, frame.coarse.shape))
    assert np.abs(np.where(mean < LEAST_COVERAGE, 0, mean) - frame.coarse)[:, known].max() <= 0.51
    assert np.all(frame.coarse[:, ~known] == FULL // 2)
    expected = np.cumsum(frame.coarse.astype(float), axis=1) / FULL
    np.testing.assert_allclose(frame.sums[:, 1:], expected, rtol=1e-5)
    # what covering the pixels to the left costs
    costs = np.cumsum(1.0 - 2.0 * frame.coarse / FULL, axis=1)
    np.testing.assert_allclose(frame.balance[:, 1:], costs, atol=1e-4)
    np.testing.assert_array_equal(frame.sums[:, 0], 0.0)
    # a view of one plane reads several planes by the largest
    np.testing.assert_array_equal(frame.planes, planes.max(axis=0)[None])
    alone = key_frame(Mask(7, 0.2, planes), no_frames(masks, masks.view(1)))
    assert (alone.index, alone.time) == (7, 0.2)
    np.testing.assert_array_equal(alone.coarse, frame.coarse)
    assert alone.area == frame.area


def test_frames_reduced_further_keep_their_area() -> None:
    rng = np.random.default_rng(1)
    planes = rng.integers(LEAST_COVERAGE + 1, FULL + 1, (1, HEIGHT, WIDTH), dtype=np.uint8)
    frames = key_frames(masks_of([planes], np.ones((HEIGHT, WIDTH), np.float32)), 1)
    half = frames.reduced(2)
    assert frames.reduced(1) is frames
    assert half.shrink == 2 * frames.shrink
    assert half.coarse_trust.shape == tuple(side // 2 for side in frames.coarse_trust.shape)
    (whole,), (part,) = frames.frames, half.frames
    height, width = (2 * side for side in part.coarse.shape)
    mean = whole.coarse[:height, :width].reshape(height // 2, 2, width // 2, 2).mean(axis=(1, 3))
    assert np.abs(part.coarse - mean).max() <= 0.51
    assert part.area == whole.area / 4
    np.testing.assert_allclose(part.sums[:, -1], part.coarse.sum(axis=1) / FULL, rtol=1e-5)
