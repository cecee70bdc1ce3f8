"""Repeated pictures of drawn scenes whose motion and content are known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from monodyn.vision.clip.repeats import NO_REPEATS, Differences, Repeats

HEIGHT, WIDTH = 48, 96
Place = Callable[[np.ndarray], np.ndarray]
"""Where a bar is at given times [cells]."""


def swinging(t: np.ndarray) -> np.ndarray:
    return 48.0 + 30.0 * np.sin(4.0 * t)


def two(t: np.ndarray) -> np.ndarray:
    return np.stack([swinging(t), 40.0 + 25.0 * np.sin(6.3 * t + 1.0)])


def found(content: np.ndarray, place: Place, *, noise: float = 0.5, copied: float = 0.3) -> Repeats:
    """Search drawn pictures: bars before a dark wall, sensor noise in each picture, coder noise in each copy.

    Args:
        content: Time of the scene that each picture shows [s], (frame,).
        place: Where the bars are.
        noise: Of the sensor, the same in a copy [grey levels].
        copied: Of the encoder, in every picture anew [grey levels].
    """
    rng = np.random.default_rng(11)
    column, differences, low, high = np.arange(WIDTH), Differences(), None, None
    shown, picture = None, np.zeros((1, HEIGHT, WIDTH))
    for k, time in enumerate(content):
        if time != shown:
            picture, shown = rng.normal(scale=noise, size=(1, HEIGHT, WIDTH)), time
            for row, x in enumerate(np.atleast_1d(place(np.float64(time)))):
                # the border of a bar covers a part of its cell
                bar = np.clip(4.0 - np.abs(column - x), 0.0, 1.0)
                picture[0, 8 + 12 * row : 16 + 12 * row] += 90.0 * bar
        small = (picture + rng.normal(scale=copied, size=picture.shape)).astype(np.float32)
        differences.add(k, small)
        low = small if low is None else np.minimum(low, small)
        high = small if high is None else np.maximum(high, small)
    return differences.repeats((high - low > 8.0).any(axis=0), np.arange(len(content)) / 30.0)


def copies(content: np.ndarray) -> list[int]:
    return (1 + np.flatnonzero(np.diff(content) == 0)).tolist()


def held(count: int, scene: float, phase: float = 0.0) -> np.ndarray:
    """Return content times [s] of a film of 30 pictures a second of a scene with fewer."""
    return np.floor(np.arange(count) * scene / 30.0 + phase + 1e-9) / scene


@pytest.mark.parametrize("place", [swinging, two])
@pytest.mark.parametrize(
    ("scene", "phase"), [(25.0, 0.0), (24.0, 0.5), (20.0, 0.2), (15.0, 0.0), (12.0, 0.0), (29.0, 0.3)]
)
def test_a_scene_of_another_rate_is_found_with_its_times(place: Place, scene: float, phase: float) -> None:
    content = held(150, scene, phase)
    repeats = found(content, place)
    assert list(repeats.frames) == copies(content)
    assert repeats.rate == pytest.approx(scene, rel=1e-9)
    fresh = np.setdiff1d(np.arange(150), repeats.frames)
    # but for a delay that is the same for all, and less than a frame
    delay = repeats.times[fresh] - content[fresh]
    assert np.ptp(delay) < 1e-9
    assert abs(delay[0]) < 1 / 30
    assert np.all(np.diff(repeats.times) > 0)


def test_copies_without_a_pattern_are_found() -> None:
    content = np.arange(150) / 30.0
    for k in (20, 33, 34, 61, 90, 131):
        content[k] = content[k - 1]
    repeats = found(content, two)
    assert list(repeats.frames) == copies(content)
    assert repeats.rate == 0.0
    assert len(repeats.times) == 0


def test_one_or_two_copies_may_be_chance() -> None:
    content = np.arange(90) / 30.0
    content[50], content[70] = content[49], content[69]
    assert found(content, swinging) is NO_REPEATS


def settling(t: np.ndarray) -> np.ndarray:
    return 48.0 + 30.0 * np.exp(-0.8 * t) * np.sin(5.0 * t)


def stopping(t: np.ndarray) -> np.ndarray:
    # it slows down evenly and stays
    return 20.0 + 40.0 * (1.0 - np.maximum(1.0 - t / 2.0, 0.0) ** 2)


def released(t: np.ndarray) -> np.ndarray:
    return 20.0 + 12.0 * np.maximum(t - 1.0, 0.0) ** 2


def slow(t: np.ndarray) -> np.ndarray:
    return 40.0 + 0.4 * np.sin(2.0 * t)


def resting(t: np.ndarray) -> np.ndarray:
    return np.full_like(t, 40.0)


@pytest.mark.parametrize("place", [swinging, two, settling, stopping, released, slow, resting])
@pytest.mark.parametrize("rate", [6.0, 10.0, 30.0, 120.0])
def test_motion_that_turns_stops_rests_or_is_slow_repeats_nothing(place: Place, rate: float) -> None:
    for phase in np.arange(5) / 5.0:
        repeats = found((np.arange(120) + phase) / rate, place)
        assert repeats.frames == ()
        assert repeats.rate == 0.0


def test_copies_where_the_scene_rests_follow_from_its_rate() -> None:
    content = held(240, 25.0)
    repeats = found(content, settling)
    assert set(copies(content)) == set(repeats.frames)


def test_a_clip_of_few_pictures_repeats_nothing() -> None:
    assert found(np.array([0.0, 0.1, 0.1]), swinging) is NO_REPEATS
