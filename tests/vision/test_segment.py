"""Background, colours and coverage, on frames with known content."""

import numpy as np
import pytest

from monodyn.errors import SettingsError, VideoError
from monodyn.stages import segment
from monodyn.types import FULL, Frame
from monodyn.vision.clip.video import read
from monodyn.vision.foreground.background import Background, Samples, background_of, sample_frames
from monodyn.vision.foreground.coverage import coverage_of
from monodyn.vision.foreground.median import masked_median
from monodyn.vision.foreground.palette import choose_palette, lingering
from monodyn.vision.settings import SegmentSettings

H, W = 60, 80


def frames(count=24, noise=1.0, *, colour=(90, 128, 128), back=(160, 128, 128), places=None):
    """A square of 20 px wanders over a plain background."""
    rng = np.random.default_rng(4)
    made = []
    for i in range(count):
        x = 5 + 2 * i if places is None else places[i]
        luma = np.full((H, W), float(back[0])) + rng.normal(scale=noise, size=(H, W))
        luma[20:40, x : x + 20] = colour[0]
        planes = []
        for value, behind in zip(colour[1:], back[1:], strict=True):
            plane = np.full((H // 2, W // 2), behind, np.uint8)
            plane[10:20, (x + 1) // 2 : (x + 20) // 2] = value
            planes.append(plane)
        made.append(Frame(i, i / 30, np.clip(luma.round(), 0, 255).astype(np.uint8), (planes[0], planes[1])))
    return made


def samples(made):
    return Samples(tuple(made), (0, H, 0, W))


def test_median_against_numpy():
    stack = np.random.default_rng(0).integers(0, 256, (15, 6, 7), dtype=np.uint8)
    median, _, count = masked_median(stack, np.zeros((0, 0, 0), np.bool_))
    # interpolated within the middle grey level, so at most half a level from the plain median of an odd count
    np.testing.assert_allclose(median, np.median(stack, axis=0), atol=0.5)
    assert (count == 15).all()


def test_median_leaves_hidden_samples_out():
    stack = np.full((9, 3, 3), 50, np.uint8)
    stack[:6] = 200
    hidden = np.zeros(stack.shape, np.bool_)
    hidden[:6, 1, 1] = True
    median, _, count = masked_median(stack, hidden)
    assert median[1, 1] == pytest.approx(50, abs=0.5)
    assert median[0, 0] == pytest.approx(200, abs=0.5)
    assert count[1, 1] == 3


def test_median_takes_the_steps_out_of_shading():
    rng = np.random.default_rng(1)
    stack = np.round(100.3 + rng.normal(scale=1.5, size=(400, 2, 2))).astype(np.uint8)
    median, noise, _ = masked_median(stack, np.zeros((0, 0, 0), np.bool_))
    # standard error of a median of 400: 1.25 * 1.5 / 20
    np.testing.assert_allclose(median, 100.3, atol=0.4)
    # rounding adds 1/12 to the variance
    np.testing.assert_allclose(noise, 1.53, rtol=0.15)


def test_background_is_what_the_square_leaves_free():
    made = frames()
    background = background_of(samples(made))
    # covered up to 10 times of 24, always darker: the median is then a low percentile of the noise of 1
    np.testing.assert_allclose(background.luma, 160, atol=3.0)
    assert background.known.all()
    assert 0.5 <= background.noise <= 1.5


def test_coverage_is_the_share_of_a_mixed_pixel():
    made = frames(noise=0.0)
    background = background_of(samples(made))
    palette = choose_palette(made, background, "grey", 14.0)
    for share in (0.25, 0.5, 0.9):
        luma = np.full((H, W), 160, np.uint8)
        luma[30, 40] = round(160 + share * (90 - 160))
        mask = coverage_of(Frame(0, 0.0, luma), background, palette)[0]
        # one grey level of 70
        assert mask[30, 40] == pytest.approx(FULL * share, abs=3)
        assert mask[0, 0] == 0


def test_colour_counts_where_grey_does_not_tell():
    made = frames(colour=(160, 100, 190), back=(160, 128, 128))
    background = background_of(samples(made))
    palette = choose_palette(made, background, "auto", 14.0)
    assert not palette.grey_only
    mask = coverage_of(made[10], background, palette).max(axis=0)
    assert mask[25:35, 29:41].min() > 0.9 * FULL
    assert mask[:15].max() < 0.1 * FULL
    assert choose_palette(frames(), background_of(samples(frames())), "auto", 14.0).grey_only


def test_two_colours_are_both_foreground():
    made = frames()
    for frame in made:
        x = 5 + 2 * frame.index
        frame.luma[30:40, x : x + 20] = 240
    background = background_of(samples(made))
    palette = choose_palette(made, background, "grey", 14.0)
    assert sorted(palette.colours[:, 0].round(-1).tolist()) == [90, 240]
    mask = coverage_of(made[10], background, palette).max(axis=0)
    assert mask[22:38, 27:43].min() > 0.9 * FULL


def test_a_lingering_mechanism_is_not_its_own_background():
    """Two thirds of the time the square stands still: the plain median shows it."""
    made = frames(places=[5 + i for i in range(16)] + [50] * 32, count=48)
    first = background_of(samples(made))
    assert first.luma[30, 60] == pytest.approx(90, abs=2)
    palette = choose_palette(made, first, "grey", 14.0)
    second = background_of(samples(made), lingering(made, first, palette), fallback=first)
    assert second.luma[30, 60] == pytest.approx(160, abs=2)


def test_pixels_never_uncovered_are_not_trusted():
    made = frames(places=[30 + i % 3 for i in range(24)])
    first = background_of(samples(made))
    covered = [np.zeros((H, W), bool) for _ in made]
    for frame, mask in zip(made, covered, strict=True):
        mask[20:40, 30 + frame.index % 3 : 50 + frame.index % 3] = True
    background = background_of(samples(made), covered, fallback=first)
    assert not background.known[30, 40]
    palette = choose_palette(
        made,
        Background(np.full((H, W), 160, np.float32), None, 1.0, background.known, (0, H, 0, W)),
        "grey",
        14.0,
    )
    assert palette.trust[0, 30, 40] == 0
    assert palette.trust[0, 5, 5] > 0.5


def test_the_reach_holds_all_motion(make_clip):
    path = make_clip("moving.mp4", count=40, size=(128, 96))
    video = read(path)
    found = sample_frames(video)
    assert len(found.frames) <= 72
    top, bottom, left, right = found.reach
    assert top == 0
    assert left == 0
    assert right >= 52
    assert bottom <= 48


def test_a_still_clip_is_refused(make_clip):
    video = read(make_clip("still.mp4", step=0))
    with pytest.raises(VideoError, match="expected a mechanism that moves, got a still picture"):
        segment(video)


def test_settings_say_what_they_take():
    with pytest.raises(SettingsError) as caught:
        SegmentSettings(colour="sepia")
    assert str(caught.value) == "segment.colour: expected 'auto', 'grey' or 'colour', got 'sepia'."
    with pytest.raises(SettingsError) as caught:
        SegmentSettings(contrast=0.0)
    assert str(caught.value) == "segment.contrast: expected more than 0 and at most 255 grey levels, got 0.0."


def test_samples_follow_the_motion_not_the_time(make_clip):
    """Of 200 frames the last 160 stand still; nearly all samples come from the first 40."""
    path = make_clip("rest.mp4", count=200, size=(128, 96), places=[min(i, 40) for i in range(200)])
    found = [frame.index for frame in sample_frames(read(path)).frames]
    assert sum(index > 45 for index in found) <= 3
    assert sum(index <= 45 for index in found) >= 15
