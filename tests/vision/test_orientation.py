"""Stored pictures of any format into upright planes of square pixels in video range."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.vision.clip.video import read
from support import ClipMaker, refuses, square


@pytest.mark.parametrize(("aspect", "size"), [(Fraction(4, 3), (85, 48)), (Fraction(1, 2), (64, 96))])
def test_pixels_become_square(make_clip: ClipMaker, aspect: Fraction, size: tuple[int, int]) -> None:
    video = read(make_clip(aspect=aspect))
    assert (video.width, video.height) == size
    frame = next(video.frames())
    assert frame.luma.shape == size[::-1]
    assert frame.chroma is not None
    assert frame.chroma[0].shape == ((size[1] + 1) // 2, (size[0] + 1) // 2)
    # columns 2 to 11 and rows 6 to 15 are bright: the share of the picture stays what it was
    assert np.mean(frame.luma > 140) == pytest.approx(100 / (64 * 48), rel=0.15)


@pytest.mark.parametrize("turn", [90, 180, 270])
def test_rotation_flag_turns_the_picture_upright(make_clip: ClipMaker, turn: int) -> None:
    video = read(make_clip(rotation=turn))
    plain = square(0, 64, 48)
    upright = np.rot90(plain, turn // 90)
    frame = next(video.frames())
    assert (video.width, video.height) == upright.shape[::-1]
    assert np.mean(np.abs(frame.luma.astype(int) - upright)) < 12
    assert np.mean((frame.luma > 140) != (upright > 140)) < 0.01


def test_odd_sizes(make_clip: ClipMaker) -> None:
    video = read(make_clip("odd.mkv", size=(63, 47), pixel="yuv444p"))
    frame = next(video.frames())
    assert (video.width, video.height) == (63, 47)
    assert frame.luma.shape == (47, 63)
    assert frame.chroma is not None
    assert frame.chroma[1].shape == (24, 32)


@pytest.mark.parametrize(("pixel", "full"), [("yuv420p", False), ("yuvj420p", True), ("yuv422p10le", False)])
def test_luma_is_in_video_range_whatever_the_file_holds(make_clip: ClipMaker, pixel: str, full: bool) -> None:
    frame = next(read(make_clip("range.mkv", pixel=pixel, full_range=full)).frames())
    # 60 and 220 of 255 are 68 and 205 between 16 and 235; 3 levels for the codec
    assert abs(int(np.median(frame.luma)) - 68) <= 3
    assert abs(int(frame.luma[10, 6]) - 205) <= 3


def test_pixels_that_no_format_has_are_refused(make_clip: ClipMaker) -> None:
    clip = make_clip(aspect=Fraction(1, 20))
    with refuses(
        VideoError,
        f"clip '{clip}': expected pixels at most 8 times as wide as high, or as high as wide, got 1:20; "
        "correct the file's sample aspect ratio, for example as made by ffmpeg -i CLIP -vf "
        "setsar=1 FIXED.mp4.",
    ):
        read(clip)
