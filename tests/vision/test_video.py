"""Clips of every kind into frames with their time stamps."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.vision.clip.video import Video, read
from support import ClipMaker, left_edge, square


def edges(video: Video) -> list[int]:
    return [left_edge(frame.luma) for frame in video.frames()]


@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv", ".webm", ".avi", ".gif"])
def test_every_container_gives_all_frames_in_order(make_clip: ClipMaker, suffix: str) -> None:
    base = Fraction(1, 25) if suffix == ".gif" else Fraction(1, 30)
    video = read(make_clip("clip" + suffix, base=base))
    assert (video.width, video.height, video.count) == (64, 48, 12)
    # webm and gif keep stamps in milliseconds and hundredths of a second
    assert np.allclose(video.times - video.times[0], np.arange(12) * float(base), atol=0.0051)
    assert [frame.index for frame in video.frames()] == list(range(12))
    assert [frame.time for frame in video.frames()] == video.times.tolist()
    assert np.allclose(edges(video), 2 + np.arange(12), atol=1)
    assert video.notes == ()


def test_variable_frame_rate_keeps_its_stamps(make_clip: ClipMaker) -> None:
    stamps = [0, 3, 4, 9, 10, 11, 20, 21, 25, 26, 40, 41]
    video = read(make_clip(stamps=stamps, base=Fraction(1, 600)))
    assert np.allclose(video.times, np.array(stamps) / 600, atol=1e-9)


def test_ntsc_rate_is_not_rounded(make_clip: ClipMaker) -> None:
    video = read(make_clip(stamps=[1001 * i for i in range(12)], base=Fraction(1, 30000)))
    assert np.allclose(video.times, np.arange(12) * 1001 / 30000, rtol=0, atol=1e-12)


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


def test_frames_stay_valid_and_are_read_only(make_clip: ClipMaker) -> None:
    video = read(make_clip(count=30))
    held = list(video.frames())
    assert [left_edge(frame.luma) for frame in held] == edges(video)
    with pytest.raises(ValueError, match="read-only"):
        held[0].luma[0, 0] = 1


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".avi", ".gif"])
def test_a_pass_may_start_anywhere(make_clip: ClipMaker, suffix: str) -> None:
    video = read(make_clip("clip" + suffix, count=40))
    whole = {frame.index: frame.luma for frame in video.frames()}
    for start in (0, 1, 17, 39):
        part = list(video.frames(start, min(start + 5, 40)))
        assert [frame.index for frame in part] == list(range(start, min(start + 5, 40)))
        assert all(np.array_equal(frame.luma, whole[frame.index]) for frame in part)


def test_range_outside_the_clip(make_clip: ClipMaker) -> None:
    path = make_clip()
    with pytest.raises(VideoError) as error:
        read(path).frames(5, 13)
    assert str(error.value) == f"frames: expected a range within 0:12, got 5:13; clip '{path}' has 12 frames."


def test_rate_replaces_the_stamps(make_clip: ClipMaker) -> None:
    video = read(make_clip(), rate=240.0)
    assert np.allclose(video.times, np.arange(12) / 240)
    assert video.notes == ("Time stamps replaced by 240 frames a second.",)
    with pytest.raises(VideoError) as error:
        read("x.mp4", rate=0.0)
    assert str(error.value) == "rate: expected 0.001 to 1e+06 frames a second, got 0; give the true rate."


def test_no_time_stamps(make_clip: ClipMaker) -> None:
    path = make_clip("raw.h264")
    with pytest.raises(VideoError) as error:
        read(path)
    assert str(error.value) == (
        f"clip '{path}': expected time stamps, the file has none; give its frame rate with --rate."
    )
    video = read(path, rate=30.0)
    assert np.allclose(edges(video), 2 + np.arange(12), atol=1)
    assert [frame.index for frame in video.frames(7, 9)] == [7, 8]


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
    assert edges(video) == [3, 4, 5, 7, 12]
    assert next(video.frames()).chroma is None


def test_pictures_numbered_in_steps_are_equally_spaced(tmp_path: Path) -> None:
    for i in (0, 10, 20):
        cv2.imwrite(str(tmp_path / f"{i:03d}.jpg"), square(i, 64, 48))
    video = read(tmp_path, rate=50.0)
    assert np.allclose(video.times, [0, 0.02, 0.04])
    assert video.notes == ()


def test_folders_that_are_no_clip(tmp_path: Path) -> None:
    suffixes = ".png, .jpg, .jpeg, .bmp, .tif, .tiff"
    with pytest.raises(VideoError) as error:
        read(tmp_path)
    assert str(error.value) == (
        f"clip '{tmp_path}': expected numbered pictures ({suffixes}) in the folder, found none; "
        "name them like frame0001.png."
    )
    cv2.imwrite(str(tmp_path / "a1.png"), square(0, 64, 48))
    with pytest.raises(VideoError) as error:
        read(tmp_path)
    assert str(error.value) == (
        f"clip '{tmp_path}': expected a folder of at least two numbered pictures, got one; add the others."
    )
    cv2.imwrite(str(tmp_path / "b1.png"), square(0, 64, 48))
    with pytest.raises(VideoError) as error:
        read(tmp_path)
    assert str(error.value) == (
        f"clip '{tmp_path}': expected one series of numbered pictures, got 2 ('a#.png', 'b#.png'); "
        "keep each in a folder of its own."
    )


def test_pictures_of_two_sizes_and_a_broken_one(tmp_path: Path) -> None:
    for i in range(3):
        cv2.imwrite(str(tmp_path / f"p{i}.png"), square(i, 64, 48))
    (tmp_path / "p3.png").write_bytes(b"broken")
    video = read(tmp_path, rate=30.0)
    assert edges(video) == [2, 3, 4]
    assert video.notes == ("Picture 'p3.png' cannot be read and is left out.",)
    cv2.imwrite(str(tmp_path / "p3.png"), square(0, 32, 48))
    with pytest.raises(VideoError) as error:
        edges(read(tmp_path, rate=30.0))
    assert str(error.value) == (
        f"picture '{tmp_path / 'p3.png'}': expected 64x48 px like the first one, got 32x48 px; "
        "give pictures of one size."
    )


def test_a_still_compares_with_the_clip(make_clip: ClipMaker, tmp_path: Path) -> None:
    video = read(make_clip(pixel="yuvj420p", full_range=True))
    path = tmp_path / "back.png"
    cv2.imwrite(str(path), cv2.cvtColor(square(0, 64, 48), cv2.COLOR_GRAY2BGR))
    picture = next(read(path, still=True).frames())
    first = next(video.frames())
    # 2 grey levels for the codec
    assert np.median(np.abs(picture.luma.astype(int) - first.luma)) <= 2
    path.write_bytes(b"no picture")
    with pytest.raises(VideoError) as error:
        read(path, still=True)
    assert str(error.value) == (
        f"picture '{path}': expected a png, jpg, bmp or tif picture, cannot read it as one."
    )


def test_truncated_file_gives_what_decodes_and_says_how_much(make_clip: ClipMaker) -> None:
    path = make_clip("cut.mkv", count=60, size=(320, 240))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 6 // 10])
    video = read(path)
    frames = list(video.frames())
    assert 5 < len(frames) < 60
    assert video.notes
    assert "cut short" in video.notes[0]


def test_damage_in_the_middle_is_skipped_and_counted(make_clip: ClipMaker) -> None:
    path = make_clip("torn.mp4", count=60, size=(320, 240))
    data = bytearray(path.read_bytes())
    start = data.find(b"mdat") + len(data) // 3
    rng = np.random.default_rng(3)
    data[start : start + 1500] = rng.integers(0, 256, 1500, dtype=np.uint8).tobytes()
    path.write_bytes(bytes(data))
    video = read(path)
    indices = [frame.index for frame in video.frames()]
    assert indices == sorted(set(indices))
    assert len(indices) >= 5


def test_duplicate_stamps_are_dropped_with_a_note(
    make_clip: ClipMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    from monodyn.vision.clip import container

    path = make_clip()
    real = container._packet_stamps
    monkeypatch.setattr(container, "_packet_stamps", lambda p: [*(real(p) or []), (real(p) or [])[-1]])
    video = read(path)
    assert video.count == 12
    assert video.notes == ("1 of 13 frames dropped: their time stamps do not increase.",)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "expected a video file, cannot read it as one (Invalid data found when processing input); "
              "check the file or convert it to mp4."),
        (b"hello " * 100, "expected a video file, "),
    ],
)  # fmt: skip
def test_not_a_video(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "clip.mp4"
    path.write_bytes(content)
    with pytest.raises(VideoError) as error:
        read(path)
    assert str(error.value).startswith(f"clip '{path}': {message}")


def test_missing_file() -> None:
    with pytest.raises(VideoError) as error:
        read("nowhere.mp4")
    assert str(error.value) == (
        "clip 'nowhere.mp4': expected a video file or a folder of pictures, found nothing; check the path."
    )


def test_one_frame_and_a_picture(make_clip: ClipMaker, tmp_path: Path) -> None:
    path = make_clip(count=1)
    with pytest.raises(VideoError) as error:
        read(path)
    assert str(error.value) == (
        f"clip '{path}': expected a clip of at least two frames, got one frame; record a longer clip."
    )
    picture = tmp_path / "still.png"
    cv2.imwrite(str(picture), square(0, 64, 48))
    with pytest.raises(VideoError) as error:
        read(picture)
    assert str(error.value) == (
        f"clip '{picture}': expected a video file, got a single picture; "
        "give a clip or a folder of numbered pictures."
    )


def test_sound_alone(tmp_path: Path) -> None:
    import av

    path = tmp_path / "sound.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=44100)
        for i in range(20):
            frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
            frame.sample_rate, frame.pts = 44100, 1024 * i
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    with pytest.raises(VideoError) as error:
        read(path)
    assert str(error.value) == (
        f"clip '{path}': expected a video, the file holds only sound; give a file with pictures."
    )


def test_a_playlist_opens_no_other_file(make_clip: ClipMaker, tmp_path: Path) -> None:
    clip = make_clip()
    playlist = tmp_path / "list.mp4"
    playlist.write_text(f"ffconcat version 1.0\nfile '{clip.name}'\n")
    with pytest.raises(VideoError):
        read(playlist)
