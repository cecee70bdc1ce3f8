"""The default segmentation as a whole."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.stages import segment
from monodyn.types import FULL
from monodyn.vision.clip.video import read
from monodyn.vision.foreground import soft
from monodyn.vision.foreground.background import background_of
from monodyn.vision.foreground.masks import VARIED, GeomColours
from monodyn.vision.foreground.moving_colours import moving_colours
from monodyn.vision.settings import SegmentSettings
from pictures import samples, wandering
from support import ClipMaker, refuses


def test_a_still_clip_is_refused(make_clip: ClipMaker) -> None:
    video = read(make_clip("still.mp4", step=0))
    with refuses(
        VideoError,
        "the clip: expected a mechanism that moves before a still background, got next to nothing that "
        "differs from the background by more than 2.5 grey levels and 5 times its noise there. Either "
        "nothing moves, or it hardly stands out, or it covers the same place most of the time, or the "
        "camera moves before a background that does not show how: give a clip that shows motion, a lower "
        "--segment.contrast, or --background with a picture without the mechanism.",
    ):
        segment(video)


def test_a_background_of_another_size_is_refused(make_clip: ClipMaker, tmp_path: Path) -> None:
    path = tmp_path / "wall.png"
    cv2.imwrite(str(path), np.full((24, 32), 60, np.uint8))
    with refuses(
        VideoError,
        f"{path}: expected a background of 64x48 like the clip, got 32x24; give a frame of the same camera "
        "without the mechanism.",
    ):
        segment(read(make_clip()), background=path)


def test_a_background_that_was_given_stays(make_clip: ClipMaker, tmp_path: Path) -> None:
    path = tmp_path / "wall.png"
    cv2.imwrite(str(path), np.full((48, 64), 60, np.uint8))
    masks = segment(read(make_clip(count=30, size=(64, 48))), background=path)
    assert masks.background.given
    covered = [np.zeros((48, 64), bool) for _ in masks.samples.frames]
    assert masks.refined(covered).background is masks.background


def test_masks_stream_in_the_order_of_time(make_clip: ClipMaker) -> None:
    masks = segment(read(make_clip(count=30, size=(128, 96))))
    streamed = list(masks)
    assert [mask.index for mask in streamed] == list(range(30))
    frame = next(masks.video.frames(7, 8))
    np.testing.assert_array_equal(masks.of(frame).planes, streamed[7].planes)
    # the square of 10 px whose left edge is at column 9
    assert masks.of(frame).coverage[6:16, 9:19].mean() > 0.9 * FULL
    assert masks.of(frame).coverage[30:].max() == 0


def test_repeated_pictures_are_no_samples_and_have_no_mask(make_clip: ClipMaker) -> None:
    """A square that moves on by 2 px in four pictures of five."""
    places = [2 * (k - k // 5) for k in range(60)]
    masks = segment(read(make_clip(count=60, size=(160, 96), places=places)))
    repeats = [k for k in range(60) if k % 5 == 0 and k > 0]
    assert list(masks.video.repeats.frames) == repeats
    assert masks.video.repeats.rate == 24.0
    assert not set(repeats) & {frame.index for frame in masks.samples.frames}
    assert [mask.index for mask in masks] == [k for k in range(60) if k not in repeats]
    assert masks.video.notes[-1] == "11 of 60 pictures repeat the one before; they count as not seen."


def test_measured_colours_are_taken_over(make_clip: ClipMaker) -> None:
    masks = segment(read(make_clip(count=30, size=(128, 96))))
    assert masks.coloured(None) is masks
    colours = GeomColours(np.array([[205.0, 128.0, 128.0]]), np.array([0, VARIED]), np.array([False, False]))
    measured = masks.coloured(colours)
    assert measured.varied
    view = measured.view(2)
    # the plane of any difference comes after that of the one colour
    assert view.part.tolist() == [0, 1]
    assert len(view.trust) == 2
    assert len(next(iter(measured)).planes) == 2


@pytest.mark.parametrize(("side", "searches"), [(4, 1), (20, 2)])
def test_of_little_that_lingers_the_colours_stay(
    side: int, searches: int, monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker
) -> None:
    """Two thirds of the time a part of what moves rests: of all that moves in, 0.3 % or 8 %."""
    made = wandering(48, places=[5 + 2 * (i % 28) for i in range(48)])
    for frame in made[16:]:
        frame.luma[44 : 44 + side, 55 : 55 + side] = 90
    asked = []

    def counted(*arguments: object) -> object:
        asked.append(arguments)
        return moving_colours(*arguments)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(soft, "moving_colours", counted)
    settings = SegmentSettings(colour="grey", contrast=14.0)
    masks = soft._masks_over(read(make_clip()), samples(made), settings, None)
    assert background_of(samples(made)).luma[46, 57] == pytest.approx(90, abs=2)
    assert masks.background.luma[46, 57] == pytest.approx(160, abs=2)
    assert masks.palette.colours[:, 0].tolist() == pytest.approx([90], abs=2)
    assert masks.of(made[40]).coverage[46, 57] > 0.9 * FULL
    assert len(asked) == searches


@pytest.mark.parametrize("moves", [10, 16])
def test_a_colour_that_rests_most_of_the_time_is_found(moves: int, make_clip: ClipMaker) -> None:
    """A dark part moves all the time, a bright one of its own colour for a fifth or a third of it."""
    made = wandering(48, places=[5 + 2 * (i % 28) for i in range(48)])
    for i, frame in enumerate(made):
        across = 20 + 3 * i if i < moves else 55
        frame.luma[40:58, across : across + 18] = 225
    settings = SegmentSettings(colour="grey", contrast=14.0)
    masks = soft._masks_over(read(make_clip()), samples(made), settings, None)
    assert background_of(samples(made)).luma[48, 65] == pytest.approx(225, abs=2)
    assert masks.background.luma[48, 65] == pytest.approx(160, abs=2)
    assert sorted(masks.palette.colours[:, 0].tolist()) == pytest.approx([90, 225], abs=2)
    assert masks.of(made[40]).coverage[48, 65] > 0.9 * FULL
