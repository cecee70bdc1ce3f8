"""Key frames: masks that differ from one another, reduced, with the sums that the search reads."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from monodyn.types import FULL, Mask
from monodyn.vision.foreground.background import Window
from monodyn.vision.foreground.masks import View, no_order, plain_view
from monodyn.vision.locating.keyframes import MOST_STRAY, key_frame, key_frames, no_frames

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
    assert np.abs(np.where(mean < MOST_STRAY + 0.5, 0, mean) - frame.coarse)[:, known].max() <= 0.51
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
    planes = rng.integers(MOST_STRAY + 1, FULL + 1, (1, HEIGHT, WIDTH), dtype=np.uint8)
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


def test_what_shows_counts_where_some_colours_cannot_be_seen() -> None:
    """Two colours: the first cannot be seen in the left third, none in the next, both in the last."""
    third = WIDTH // 3
    planes = np.zeros((2, HEIGHT, WIDTH), np.uint8)
    planes[1, 30:60, :] = FULL
    trust = np.ones((2, HEIGHT, WIDTH), np.float32)
    trust[0, :, :third] = 0.0
    trust[:, :, third : 2 * third] = 0.0
    masks = masks_of([planes])
    masks.view = lambda geoms: View(trust, np.arange(2), np.zeros(2, bool), no_order(2))
    frames = key_frames(masks, 2)
    (frame,) = frames.frames
    columns = WIDTH // SHRINK // 3
    # without the columns that lie on both sides of a border
    left, middle, right = (frame.coarse[:, i * columns + 1 : (i + 1) * columns - 1] for i in range(3))
    # half covered costs nothing either way; what shows costs as everywhere
    assert set(np.unique(left[11:19])) == {FULL}
    assert set(np.unique(left[:9])) == {FULL // 2}
    assert set(np.unique(middle)) == {FULL // 2}
    assert set(np.unique(right[:9])) == {0}
    assert set(np.unique(right[11:19])) == {FULL}
    np.testing.assert_array_equal(frames.shown(frame)[:9], 0)


def test_thin_and_faint_masks_are_made_thicker() -> None:
    """Rods of two pixels of which a reduced one covers a part only."""
    planes = []
    for row in (20, 40, 60):
        plane = np.zeros((1, HEIGHT, WIDTH), np.uint8)
        plane[0, row : row + 2, 100:400] = 120
        planes.append(plane)
    masks = masks_of(planes)
    frames = key_frames(masks, 1)
    assert frames.thicker == 2.0
    rows = np.flatnonzero(frames.frames[1].coarse[:, 80])
    assert rows.tolist() == [11, 12, 13, 14, 15]
    assert frames.frames[1].coarse.max() == FULL
    # a single frame of the clip is made like the others
    like = replace(no_frames(masks, masks.view(1)), thicker=frames.thicker)
    alone = key_frame(Mask(1, 0.1, planes[1]), like)
    np.testing.assert_array_equal(alone.coarse, frames.frames[1].coarse)
    assert alone.area == frames.frames[1].area
    assert frames.reduced(2).thicker == 1.0
    assert key_frames(masks_of([block(0), block(300)]), 1).thicker is None


def test_frames_made_afresh_keep_nothing_that_was_worked_out_of_them() -> None:
    frames = key_frames(masks_of([block(left) for left in (0, 90)]), 1)
    worked_out = [frame.balance for frame in frames.frames]
    afresh = frames.afresh()
    assert not any("balance" in vars(frame) for frame in afresh.frames)
    for frame, balance in zip(afresh.frames, worked_out, strict=True):
        assert np.array_equal(frame.balance, balance)
        assert frame.balance is not balance
