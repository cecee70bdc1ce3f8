"""Video files into frames with their time stamps, whole and damaged ones."""

from __future__ import annotations

import itertools
import struct
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.vision.clip import container
from monodyn.vision.clip.stamps import jumps, without_pauses
from monodyn.vision.clip.video import read
from support import ClipMaker, left_edges, refuses, square


@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv", ".webm", ".avi", ".gif"])
def test_every_container_gives_all_frames_in_order(make_clip: ClipMaker, suffix: str) -> None:
    base = Fraction(1, 25) if suffix == ".gif" else Fraction(1, 30)
    video = read(make_clip("clip" + suffix, base=base))
    assert (video.width, video.height, video.count) == (64, 48, 12)
    # webm and gif keep stamps in milliseconds and hundredths of a second
    assert np.allclose(video.times - video.times[0], np.arange(12) * float(base), atol=0.0051)
    assert [frame.index for frame in video.frames()] == list(range(12))
    assert [frame.time for frame in video.frames()] == video.times.tolist()
    assert np.allclose(left_edges(video), 2 + np.arange(12), atol=1)
    assert video.notes == ()


def test_variable_frame_rate_keeps_its_stamps(make_clip: ClipMaker) -> None:
    stamps = [0, 3, 4, 9, 10, 11, 20, 21, 25, 26, 40, 41]
    video = read(make_clip(stamps=stamps, base=Fraction(1, 600)))
    assert np.allclose(video.times, np.array(stamps) / 600, atol=1e-9)


@pytest.mark.parametrize("suffix", [".mkv", ".webm"])
@pytest.mark.parametrize("rate", [Fraction(30000, 1001), Fraction(60000, 1001), Fraction(240)])
def test_a_constant_rate_survives_a_container_of_milliseconds(
    make_clip: ClipMaker, suffix: str, rate: Fraction
) -> None:
    video = read(make_clip("clip" + suffix, count=60, base=1 / rate))
    stored = np.array([frame_time(video.path, k) for k in range(60)])
    assert np.abs(video.times - stored).max() > 1e-4
    assert np.allclose(np.diff(video.times), float(1 / rate), rtol=0, atol=1e-12)
    assert video.tick == 0.0
    assert not any("rounded" in note for note in video.notes)


def frame_time(path: Path, number: int) -> float:
    """Return the stamp of a frame as the file has it [s]."""
    with av.open(str(path)) as stored:
        return float(next(itertools.islice(stored.decode(video=0), number, None)).time)


@pytest.mark.parametrize("suffix", [".mkv", ".mp4"])
def test_a_clock_that_began_long_before_cuts_nothing_short(make_clip: ClipMaker, suffix: str) -> None:
    """Some containers count their duration from time 0 on, others from the first stamp."""
    stamps = (25_000_000 + np.arange(12)).tolist()
    video = read(make_clip("clip" + suffix, stamps=stamps, base=Fraction(1, 25)))
    assert np.allclose(np.diff(video.times), 0.04)
    assert video.notes == ()


def test_a_variable_rate_in_milliseconds_says_so(make_clip: ClipMaker) -> None:
    stamps = [0, 30, 75, 100, 131, 180, 201, 240, 266, 300, 340, 377]
    video = read(make_clip("clip.mkv", stamps=stamps, base=Fraction(1, 1000)))
    assert np.allclose(video.times, np.array(stamps) / 1000, atol=1e-12)
    assert video.tick == 0.001
    assert video.notes == (
        "The time stamps are rounded to 1 ms and follow no constant rate; the rounding counts as noise.",
    )


def test_a_jump_of_the_stamps_counts_as_a_short_pause(make_clip: ClipMaker) -> None:
    stamps = 40 * np.arange(12) + np.where(np.arange(12) < 5, 0, 3 * 3_600_000 - 40)
    video = read(make_clip("clip.mkv", stamps=stamps.tolist(), base=Fraction(1, 1000)))
    steps = np.diff(video.times)
    assert np.allclose(np.delete(steps, 4), 0.04, rtol=0, atol=1e-12)
    assert steps[4] == pytest.approx(10.0, abs=1e-9)
    assert jumps(video.times).tolist() == [5]
    assert video.notes == (
        "The times of the frames jump by 10800 s before frame 5: a pause of 10 s is taken in place of that.",
    )
    # each picture is still found by the stamp of its file
    assert np.allclose(left_edges(video), 2 + np.arange(12), atol=1)
    assert [frame.index for frame in video.frames(7, 9)] == [7, 8]


def test_several_jumps_are_one_sentence_and_short_ones_are_none() -> None:
    notes: list[str] = []
    counts = np.cumsum([0, 1, 1, 300, 1, 1, 9000, 1, 1, 3000, 1])
    shorter = without_pauses(counts, 1.0 / 30.0, notes)
    assert np.diff(shorter).tolist() == [1, 1, 300, 1, 1, 300, 1, 1, 300, 1]
    assert notes == [
        "The times of the frames jump 2 times, by up to 300 s, first before frame 6: a pause of 10 s is "
        "taken in place of that."
    ]


def test_a_picture_every_few_seconds_is_no_jump() -> None:
    times = np.array([0, 7, 14, 28, 35, 42.0])
    assert not len(jumps(times))
    assert jumps(np.append(times, 800.0)).tolist() == [6]
    assert without_pauses(np.array([3]), 1.0, []).tolist() == [3]


def test_ntsc_rate_is_not_rounded(make_clip: ClipMaker) -> None:
    video = read(make_clip(stamps=[1001 * i for i in range(12)], base=Fraction(1, 30000)))
    assert np.allclose(video.times, np.arange(12) * 1001 / 30000, rtol=0, atol=1e-12)


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".avi", ".gif"])
def test_a_pass_may_start_anywhere(make_clip: ClipMaker, suffix: str) -> None:
    video = read(make_clip("clip" + suffix, count=40))
    whole = {frame.index: frame.luma for frame in video.frames()}
    for start in (0, 1, 17, 39):
        part = list(video.frames(start, min(start + 5, 40)))
        assert [frame.index for frame in part] == list(range(start, min(start + 5, 40)))
        assert all(np.array_equal(frame.luma, whole[frame.index]) for frame in part)


def test_rate_replaces_the_stamps(make_clip: ClipMaker) -> None:
    video = read(make_clip(), rate=240.0)
    assert np.allclose(video.times, np.arange(12) / 240)
    assert video.notes == ("Time stamps replaced by 240 frames a second.",)
    with refuses(VideoError, "rate: expected 0.001 to 1e+06 frames a second, got 0; give the true rate."):
        read("x.mp4", rate=0.0)


def test_no_time_stamps(make_clip: ClipMaker) -> None:
    path = make_clip("raw.h264")
    with refuses(
        VideoError,
        f"clip '{path}': expected time stamps, the file has none; give its frame rate with --rate.",
    ):
        read(path)
    video = read(path, rate=30.0)
    assert np.allclose(left_edges(video), 2 + np.arange(12), atol=1)
    assert [frame.index for frame in video.frames(7, 9)] == [7, 8]


def test_truncated_file_gives_what_decodes_and_says_how_much(make_clip: ClipMaker) -> None:
    path = make_clip("cut.mkv", count=60, size=(320, 240))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 6 // 10])
    video = read(path)
    frames = list(video.frames())
    assert 5 < len(frames) < 60
    end = video.times[-1]
    assert video.notes[0] == f"The file announces 2.00 s but ends at {end:.2f} s; it may be cut short."


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
    path = make_clip()
    real = container._packet_stamps
    monkeypatch.setattr(container, "_packet_stamps", lambda p: [*(real(p) or []), (real(p) or [])[-1]])
    video = read(path)
    assert video.count == 12
    assert video.notes == ("1 of 13 frames dropped: their time stamps do not increase.",)


def test_not_a_video(tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"")
    why = "Invalid data found when processing input"
    with refuses(
        VideoError,
        f"clip '{path}': expected a video file, cannot read it as one ({why}); "
        "check the file or convert it to mp4.",
    ):
        read(path)


def test_one_frame_and_a_picture(make_clip: ClipMaker, tmp_path: Path) -> None:
    path = make_clip(count=1)
    with refuses(
        VideoError,
        f"clip '{path}': expected a clip of at least two frames, got one frame; record a longer clip.",
    ):
        read(path)
    picture = tmp_path / "still.png"
    cv2.imwrite(str(picture), square(0, 64, 48))
    with refuses(
        VideoError,
        f"clip '{picture}': expected a video file, got a single picture; "
        "give a clip or a folder of numbered pictures.",
    ):
        read(picture)


def test_sound_alone(tmp_path: Path) -> None:
    path = tmp_path / "sound.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=44100)
        for i in range(20):
            frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
            frame.sample_rate, frame.pts = 44100, 1024 * i
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    with refuses(
        VideoError, f"clip '{path}': expected a video, the file holds only sound; give a file with pictures."
    ):
        read(path)


def test_subtitles_alone(tmp_path: Path) -> None:
    path = tmp_path / "words.srt"
    path.write_text("1\n00:00:00,000 --> 00:00:01,000\nHello\n\n")
    with refuses(
        VideoError,
        f"clip '{path}': expected a video, the file holds no picture stream; give a file with pictures.",
    ):
        read(path)


@pytest.mark.parametrize(
    ("name", "content", "kind"),
    [
        ("list.mp4", "ffconcat version 1.0\nfile 'clip.mp4'\n", "a list of other files (concat)"),
        ("art.txt", "hello " * 100, "text"),
    ],
)
def test_a_playlist_opens_no_other_file(
    make_clip: ClipMaker, tmp_path: Path, name: str, content: str, kind: str
) -> None:
    make_clip()
    path = tmp_path / name
    path.write_text(content)
    with refuses(
        VideoError,
        f"clip '{path}': expected a video file, got {kind}; give a clip or a folder of numbered pictures.",
    ):
        read(path)


def test_nothing_decodes(make_clip: ClipMaker) -> None:
    path = make_clip("blank.mp4")
    data = bytearray(path.read_bytes())
    start = data.find(b"mdat") + 4
    stop = data.find(b"moov", start)
    data[start:stop] = bytes(stop - start)
    path.write_bytes(bytes(data))
    with refuses(
        VideoError,
        f"clip '{path}': expected pictures, none of them decodes; the file is empty or damaged.",
    ):
        read(path)


def test_a_turn_by_another_angle_is_said(make_clip: ClipMaker) -> None:
    video = read(make_clip(rotation=30))
    assert video.notes == (
        "The file requires a rotation that is not a quarter turn; the nearest quarter turn is used.",
    )


def test_a_cut_file_says_what_it_announces(make_clip: ClipMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    path = make_clip(count=30)
    real = container._packets
    monkeypatch.setattr(container, "_packets", lambda c, s: itertools.islice(real(c, s), 20))
    video = read(path)
    assert video.notes == ("The file announces 30 frames but holds 20; it may be cut short.",)


def test_what_an_edit_list_hides_is_not_missing(make_clip: ClipMaker) -> None:
    """Behind a cut without coding anew stand pictures that are decoded for others and never shown."""
    path = make_clip("clip.mov", count=60)
    data = bytearray(path.read_bytes())
    # duration in the clock of the film, which counts milliseconds, and where it begins in that of the media
    at = data.find(b"elst") + 12
    duration, begin = struct.unpack(">Ii", data[at : at + 8])
    per_second = struct.unpack(">I", data[(at := data.find(b"mdhd") + 16) : at + 4])[0]
    for hidden, first in ((20, 20), (20, 0)):
        kept = struct.pack(">Ii", duration * (60 - hidden) // 60, begin + first * per_second // 30)
        at = data.find(b"elst") + 12
        data[at : at + 8] = kept
        path.write_bytes(data)
        video = read(path)
        assert (video.count, video.notes) == (40, ())
        assert left_edges(video)[0] == pytest.approx(2 + first, abs=1)


def test_a_cut_file_without_a_count_says_how_long_it_announces(make_clip: ClipMaker) -> None:
    path = make_clip("clip.mkv", count=60)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 6 // 10])
    video = read(path)
    end = video.times[-1]
    assert end < 1.5
    assert f"The file announces 2.00 s but ends at {end:.2f} s; it may be cut short." in video.notes


def test_frames_that_do_not_decode_are_counted(make_clip: ClipMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    path = make_clip()
    video = read(path)
    real = container.pictures
    monkeypatch.setattr(container, "pictures", lambda c, s: itertools.islice(real(c, s), 0, None, 2))
    assert len(list(video.frames())) == 6
    list(video.frames())
    assert video.notes == ("6 of 12 frames cannot be decoded; 6 are used.",)


def test_a_title_in_another_code_is_no_obstacle(make_clip: ClipMaker) -> None:
    path = make_clip("clip.mkv")
    titled = path.read_bytes().replace(b"Lavf", b"\xe9\xe8\xff\xfe")
    assert titled != path.read_bytes()
    path.write_bytes(titled)
    assert read(path).count == 12


def test_av_19_takes_no_word_for_titles(make_clip: ClipMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    path, usual = make_clip(), av.open

    def of_19(address: str, **how: object) -> object:
        assert "metadata_errors" not in how
        return usual(address, **how)  # pyright: ignore

    monkeypatch.setattr(av, "open", of_19)
    monkeypatch.setattr(av, "__version__", "19.0.2")
    assert read(path).count == 12
