"""Reduced pictures, and the stretch of a clip that shows its scene."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.types import Frame
from monodyn.vision.foreground import thumbnails
from monodyn.vision.foreground.thumbnails import Thumbnails, ThumbnailStore, scene_span

COUNT, CONTRAST = 60, 14.0


def dimmed(light: np.ndarray) -> Thumbnails:
    """Make thumbnails of a wall with a moving square, each frame of its own light."""
    planes = np.full((len(light), 1, 24, 32), 160.0)
    for i in range(len(light)):
        planes[i, 0, 8:12, i % 28 : i % 28 + 4] = 60.0
    planes *= light[:, None, None, None]
    rng = np.random.default_rng(3)
    planes += rng.normal(size=planes.shape)
    return Thumbnails(np.arange(len(light)), planes.round().astype(np.uint8), 4.0)


def test_a_store_keeps_means_of_square_blocks() -> None:
    luma = np.arange(48 * 64).reshape(48, 64).astype(np.uint8)
    store = ThumbnailStore(64, 48, 2)
    store.add(Frame(0, 0.0, luma))
    store.add(Frame(1, 0.1, luma))
    kept = store.finished()
    assert kept.planes.shape == (2, 1, 12, 16)
    assert kept.shrink == 4.0
    expected = luma.reshape(12, 4, 16, 4).mean(axis=(1, 3))
    assert np.abs(kept.planes[0, 0] - expected).max() <= 0.5
    assert kept.within((1, 2)).number.tolist() == [1]


def test_long_clips_have_smaller_thumbnails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(thumbnails, "THUMBNAIL_BYTES", 3 * 64 * 48 * 100 // 64)
    store = ThumbnailStore(64, 48, 100)
    assert store.add(Frame(0, 0.0, np.zeros((48, 64), np.uint8))).shape == (1, 6, 8)


def test_a_steady_light_is_all_scene() -> None:
    assert scene_span(dimmed(np.ones(COUNT)), CONTRAST, (0, COUNT)) == (0, COUNT)


@pytest.mark.parametrize("length", [1, 3, 8, 15])
def test_a_fade_ends_where_the_light_is_steady(length: int) -> None:
    light = np.clip(np.arange(COUNT) / length, 0.0, 1.0)
    first, stop = scene_span(dimmed(light), CONTRAST, (0, COUNT))
    # up to four grey levels of 160 are not distinguished from the noise
    assert length - 1 <= first <= length
    assert stop == COUNT
    back = scene_span(dimmed(light[::-1]), CONTRAST, (0, COUNT))
    assert back == (0, COUNT - first)


def test_a_lasting_change_of_the_light_is_no_prelude() -> None:
    light = np.where(np.arange(COUNT) < 25, 0.7, 1.0)
    assert scene_span(dimmed(light), CONTRAST, (0, COUNT)) == (0, COUNT)


def test_where_nothing_rests_all_frames_are_the_scene() -> None:
    rng = np.random.default_rng(5)
    planes = rng.integers(0, 255, (COUNT, 1, 24, 32)).astype(np.uint8)
    assert scene_span(Thumbnails(np.arange(COUNT), planes, 4.0), CONTRAST, (0, COUNT)) == (0, COUNT)


@pytest.mark.parametrize(("contrast", "still"), [(60.0, 8.0), (20.0, 6.0), (6.0, 4.0)])
def test_what_may_be_noise_follows_from_what_changes_most(contrast: float, still: float) -> None:
    """Cells of plus and minus one grey level, and a square of some contrast that passes."""
    planes = np.full((20, 1, 30, 40), 100, np.uint8)
    planes[::2] += 1
    planes[1::2] -= 1
    for i in range(20):
        planes[i, 0, 10:14, i : i + 4] = 100 + contrast
    found = Thumbnails(np.arange(20), planes, 4.0)
    # at most as for strong mechanisms, else 0.3 of the change of the square, at least twice the usual two
    # grey levels
    assert found.still == pytest.approx(still, abs=0.4)
    assert (found.ranges[0][10:14, :20] > found.still).all()
    assert not (found.ranges[0][:10] > found.still).any()
