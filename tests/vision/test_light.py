"""The light of a frame against a reference: pictures that were made brighter and darker by known amounts."""

import numpy as np
import pytest

from monodyn.types import Frame
from monodyn.vision.foreground.light import in_one_light, light_of

HEIGHT, WIDTH = 120, 160
RNG = np.random.default_rng(7)
WALL = np.clip(np.linspace(60, 180, WIDTH)[None] + RNG.normal(scale=1.0, size=(HEIGHT, WIDTH)), 0, 255)
TINT = np.full((HEIGHT // 2, WIDTH // 2), 148.0)


def frame(gain=1.0, offset=0.0, index=0, place=None):
    """The wall in another light, with a dark body that covers a sixth of it."""
    luma = WALL.copy()
    if place is not None:
        luma[:, place : place + WIDTH // 6] = 20.0
    tint = np.round((TINT - 128.0) * gain + 128.0).astype(np.uint8)
    grey = np.clip(np.round(luma * gain + offset), 0, 255).astype(np.uint8)
    return Frame(index, 0.1 * index, grey, (tint, tint.copy()))


@pytest.mark.parametrize(("gain", "offset"), [(0.8, 0.0), (1.2, 0.0), (1.0, 12.0), (0.9, -8.0), (1.3, -20.0)])
def test_gain_and_offset_are_taken_out(gain, offset):
    light = light_of(np.round(WALL))
    for place in (None, 0, 70):
        even = light.evened(frame(gain, offset, place=place))
        off = even.luma.astype(float) - frame(place=place).luma
        # rounding to whole grey levels twice, and the noise of the wall
        assert abs(np.median(off)) <= 1.0
        assert np.percentile(np.abs(off), 95.0) <= 3.0
        assert even.chroma is not None
        assert np.abs(even.chroma[0].astype(float) - TINT).max() <= 3.0


def test_a_frame_in_the_same_light_stays_as_it_is():
    light = light_of(np.round(WALL))
    for place in (None, 0, 70):
        same = frame(place=place)
        assert light.evened(same) is same


def test_two_grey_levels_are_another_light():
    light, brighter = light_of(np.round(WALL)), frame(offset=2.0, place=70)
    even = light.evened(brighter)
    assert even is not brighter
    assert abs(np.mean(even.luma.astype(float) - frame(place=70).luma)) < 0.3


def test_a_flat_wall_shows_a_gain_alone():
    light = light_of(np.full((HEIGHT, WIDTH), 100.0))
    dim = Frame(0, 0.0, np.full((HEIGHT, WIDTH), 80, np.uint8))
    even = light.evened(dim)
    assert even.chroma is None
    assert np.abs(even.luma.astype(float) - 100.0).max() <= 1.0


def test_a_range_at_the_limit_of_a_gain_of_its_own():
    """Walls of about the least range: as the places that count change, so does the range between them."""
    for seed in range(20):
        wall = 77.0 + 46.0 * np.random.default_rng(seed).random((HEIGHT, WIDTH))
        bright = Frame(0, 0.0, np.round(1.2 * wall).astype(np.uint8))
        even = light_of(np.round(wall)).evened(bright)
        assert abs(np.median(even.luma - wall)) <= 1.0


def test_frames_come_into_the_light_of_the_middle_one():
    gains = [0.7, 0.8, 1.0, 1.2, 1.3]
    even = in_one_light([frame(gain, index=i) for i, gain in enumerate(gains)])
    assert [f.index for f in even] == list(range(5))
    for found in even:
        assert abs(np.median(found.luma - WALL)) < 1.5
    dim = in_one_light([frame(1.0)], 0.8 * WALL)[0]
    assert abs(np.median(dim.luma - 0.8 * WALL)) < 1.5
