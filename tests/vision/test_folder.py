"""Folders of numbered pictures as clips."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.vision.clip.video import read
from support import left_edges, refuses, square


def test_folder_of_numbered_pictures(tmp_path: Path) -> None:
    for i in (1, 2, 3, 5, 10):
        cv2.imwrite(str(tmp_path / f"frame{i}.png"), square(i, 64, 48))
    (tmp_path / "notes.txt").write_text("not a picture")
    video = read(tmp_path)
    assert video.notes == (
        "A folder of pictures has no time stamps: 30 pictures a second assumed; give --rate if it differs.",
        "The numbers of the pictures jump 2 times; a missing number is taken as a missing picture.",
    )
    assert np.allclose(video.times, np.array([0, 1, 2, 4, 9]) / 30)
    assert left_edges(video) == [3, 4, 5, 7, 12]
    assert next(video.frames()).chroma is None


def test_pictures_numbered_in_steps_are_equally_spaced(tmp_path: Path) -> None:
    for i in (0, 10, 20):
        cv2.imwrite(str(tmp_path / f"{i:03d}.jpg"), square(i, 64, 48))
    video = read(tmp_path, rate=50.0)
    assert np.allclose(video.times, [0, 0.02, 0.04])
    assert video.notes == ()


def test_a_hole_of_many_numbers_is_a_pause(tmp_path: Path) -> None:
    for i in (*range(6), *range(9000, 9006)):
        cv2.imwrite(str(tmp_path / f"{i:04d}.png"), square(i % 100, 64, 48))
    video = read(tmp_path, rate=25.0)
    steps = np.diff(video.times)
    assert np.allclose(np.delete(steps, 5), 0.04, rtol=0, atol=1e-9)
    assert steps[5] == pytest.approx(10.0, abs=1e-9)
    assert video.notes == (
        "The numbers of the pictures jump once; a missing number is taken as a missing picture.",
        "The times of the frames jump by 359.8 s before frame 6: a pause of 10 s is taken in place of that.",
    )
    assert left_edges(video) == [*range(2, 8), *range(2, 8)]


def test_numbers_of_any_size(tmp_path: Path) -> None:
    first = 2**63 - 3
    for i in range(6):
        cv2.imwrite(str(tmp_path / f"{first + i}.png"), square(i, 64, 48))
    assert np.allclose(read(tmp_path, rate=25.0).times, np.arange(6) / 25.0)
    cv2.imwrite(str(tmp_path / "0.png"), square(0, 64, 48))
    with refuses(
        VideoError,
        f"clip '{tmp_path}': expected pictures with numbers up to 1000000 apart, got 0 to {first + 5}; "
        "remove what is no part of the series.",
    ):
        read(tmp_path)


def test_folders_that_are_no_clip(tmp_path: Path) -> None:
    suffixes = ".png, .jpg, .jpeg, .bmp, .tif, .tiff"
    with refuses(
        VideoError,
        f"clip '{tmp_path}': expected numbered pictures ({suffixes}) in the folder, found none; "
        "name them like frame0001.png.",
    ):
        read(tmp_path)
    cv2.imwrite(str(tmp_path / "a1.png"), square(0, 64, 48))
    with refuses(
        VideoError,
        f"clip '{tmp_path}': expected a folder of at least two numbered pictures, got one; add the others.",
    ):
        read(tmp_path)
    cv2.imwrite(str(tmp_path / "b1.png"), square(0, 64, 48))
    with refuses(
        VideoError,
        f"clip '{tmp_path}': expected one series of numbered pictures, got 2 ('a#.png', 'b#.png'); "
        "keep each in a folder of its own.",
    ):
        read(tmp_path)


def test_pictures_of_two_sizes_and_a_broken_one(tmp_path: Path) -> None:
    for i in range(3):
        cv2.imwrite(str(tmp_path / f"p{i}.png"), square(i, 64, 48))
    (tmp_path / "p3.png").write_bytes(b"broken")
    video = read(tmp_path, rate=30.0)
    assert left_edges(video) == [2, 3, 4]
    assert video.notes == ("Picture 'p3.png' cannot be read and is left out.",)
    cv2.imwrite(str(tmp_path / "p3.png"), square(0, 32, 48))
    with refuses(
        VideoError,
        f"picture '{tmp_path / 'p3.png'}': expected 64x48 px like the first one, got 32x48 px; "
        "give pictures of one size.",
    ):
        left_edges(read(tmp_path, rate=30.0))


def test_two_pictures_of_one_number(tmp_path: Path) -> None:
    for name in ("f1.png", "f01.png", "f2.png"):
        cv2.imwrite(str(tmp_path / name), square(0, 64, 48))
    with refuses(
        VideoError,
        f"clip '{tmp_path}': expected one picture for each number, got 'f01.png' and 'f1.png'; "
        "remove one of them.",
    ):
        read(tmp_path)


def test_a_missing_picture(tmp_path: Path) -> None:
    path = tmp_path / "none.png"
    with refuses(VideoError, f"picture '{path}': expected a picture file, found none; check the path."):
        read(path, still=True)


def test_pictures_that_are_too_small(tmp_path: Path) -> None:
    for k in range(3):
        cv2.imwrite(str(tmp_path / f"{k}.png"), np.zeros((4, 40, 3), np.uint8))
    with refuses(
        VideoError,
        f"clip '{tmp_path}': expected pictures of at least 16x16 px, got 40x4; give the clip at its full "
        "size.",
    ):
        read(tmp_path)


def test_pictures_that_are_too_large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for k in range(3):
        cv2.imwrite(str(tmp_path / f"{k}.png"), np.zeros((1000, 1002, 3), np.uint8))
    assert read(tmp_path).count == 3
    monkeypatch.setattr("monodyn.vision.clip.video.MOST_PIXELS", 1_000_000)
    with refuses(
        VideoError,
        f"clip '{tmp_path}': expected pictures of at most 1 million pixels, got 1002x1000; give the clip at "
        "half its size, for example as made by ffmpeg -i CLIP -vf scale=iw/2:-2 SMALLER.mp4.",
    ):
        read(tmp_path)


def test_pictures_that_are_too_long(tmp_path: Path) -> None:
    for k in range(2):
        cv2.imwrite(str(tmp_path / f"{k}.png"), np.zeros((20, 16_400, 3), np.uint8))
    with refuses(
        VideoError,
        f"clip '{tmp_path}': expected pictures of at most 16384 px to a side, got 16400x20; give the part "
        "that shows the mechanism.",
    ):
        read(tmp_path)
