"""Clips as the stages see them, whatever they are stored in."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.vision.clip.repeats import Repeats
from monodyn.vision.clip.video import read
from support import ClipMaker, left_edge, left_edges, refuses, square


def test_frames_stay_valid_and_are_read_only(make_clip: ClipMaker) -> None:
    video = read(make_clip(count=30))
    held = list(video.frames())
    assert [left_edge(frame.luma) for frame in held] == left_edges(video)
    with pytest.raises(ValueError, match="read-only"):
        held[0].luma[0, 0] = 1


def test_range_outside_the_clip(make_clip: ClipMaker) -> None:
    path = make_clip()
    with refuses(VideoError, f"frames: expected a range within 0:12, got 5:13; clip '{path}' has 12 frames."):
        read(path).frames(5, 13)


def test_missing_file() -> None:
    with refuses(
        VideoError,
        "clip 'nowhere.mp4': expected a video file or a folder of pictures, found nothing; check the path.",
    ):
        read("nowhere.mp4")


def test_a_still_compares_with_the_clip(make_clip: ClipMaker, tmp_path: Path) -> None:
    video = read(make_clip(pixel="yuvj420p", full_range=True))
    path = tmp_path / "back.png"
    cv2.imwrite(str(path), cv2.cvtColor(square(0, 64, 48), cv2.COLOR_GRAY2BGR))
    picture = next(read(path, still=True).frames())
    first = next(video.frames())
    # 2 grey levels for the codec
    assert np.median(np.abs(picture.luma.astype(int) - first.luma)) <= 2
    path.write_bytes(b"no picture")
    said = f"picture '{path}': expected a png, jpg, bmp or tif picture, cannot read it as one; save it anew."
    with refuses(VideoError, said):
        read(path, still=True)


def test_a_pipe_is_no_clip(tmp_path: Path) -> None:
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with refuses(
        VideoError,
        f"clip '{path}': expected a file or a folder, got a device or pipe; save the clip to a file.",
    ):
        read(path)


@pytest.mark.parametrize(
    ("frames", "note"),
    [
        ((3,), "1 of 12 pictures repeats the one before; it counts as not seen."),
        ((3, 5), "2 of 12 pictures repeat the one before; they count as not seen."),
    ],
)
def test_repeats_are_left_out_and_noted_once(
    make_clip: ClipMaker, frames: tuple[int, ...], note: str
) -> None:
    video = read(make_clip())
    repeats = Repeats(frames)
    for _ in range(2):
        fresh = video.without(repeats)
        assert [frame.index for frame in fresh.frames()] == [k for k in range(12) if k not in frames]
        assert [frame.index for frame in fresh.frames(2, 5)] == [k for k in (2, 3, 4) if k not in frames]
    assert fresh.count == 12
    assert video.notes == (note,)
    assert len(list(video.frames())) == 12


def test_a_clip_at_other_times_is_whole(make_clip: ClipMaker) -> None:
    video = read(make_clip()).without(Repeats((3, 5)))
    timed = video.timed(np.array([0, 1, 2]), np.array([0.01, 0.04, 0.07]))
    assert len(list(timed.frames())) == 12
    assert np.allclose(timed.times[:4], [0.01, 0.04, 0.07, 0.1])
    assert np.allclose(video.times, np.arange(12) / 30)


def test_a_clip_says_in_one_line_what_it_is(make_clip: ClipMaker) -> None:
    video = read(make_clip())
    assert repr(video) == "<Video clip.mp4: 64x48 px, 12 frames, 0.00 to 0.37 s, 30 Hz>"
    video.remarks.append("One <frame> is missing.")
    assert "One &lt;frame&gt; is missing." in video._repr_html_()
