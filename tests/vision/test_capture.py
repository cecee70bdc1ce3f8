"""The rate at which a file says that it was captured, and its time stamps."""

from __future__ import annotations

import os
import struct
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

import monodyn
from monodyn.errors import VideoError
from monodyn.vision.clip.repeats import Repeats
from monodyn.vision.clip.video import read
from support import ClipMaker, refuses

ANDROID = "com.android.capture.fps"


def tagged(path: Path, tags: dict[str, str], suffix: str = ".mp4", *, stream: bool = False) -> Path:
    """Return a copy of a clip with keys of the file, or of its picture stream."""
    to = path.with_name(f"tagged{suffix}")
    options = {} if suffix == ".mkv" else {"movflags": "use_metadata_tags"}
    with av.open(str(path)) as source, av.open(str(to), "w", options=options) as file:
        copy = file.add_stream_from_template(source.streams.video[0])
        (copy if stream else file).metadata.update(tags)
        for packet in source.demux(source.streams.video[0]):
            if packet.dts is not None:
                packet.stream = copy
                file.mux(packet)
    return to


def box(kind: bytes, content: bytes) -> bytes:
    """Return a box of an MP4 file."""
    return struct.pack(">I4s", 8 + len(content), kind) + content


def of_android(path: Path, rate: float) -> Path:
    """Write the capture rate as ``MPEG4Writer`` does: a float of 32 bits under a key, in ``moov``."""
    handler = box(b"hdlr", struct.pack(">II4s12xx", 0, 0, b"mdta"))
    key = box(b"mdta", ANDROID.encode())
    keys = box(b"keys", struct.pack(">II", 0, 1) + key)
    value = box(b"data", struct.pack(">IIf", 23, 0, rate))
    meta = box(b"meta", handler + keys + box(b"ilst", box(struct.pack(">I", 1), value)))
    return with_box(path, meta)


def with_box(path: Path, meta: bytes) -> Path:
    """Put a box to the end of ``moov``, which is the last one of the file."""
    data = path.read_bytes()
    at = data.rfind(b"moov") - 4
    size = int.from_bytes(data[at : at + 4])
    assert at + size == len(data)
    path.write_bytes(data[:at] + struct.pack(">I", size + len(meta)) + data[at + 4 :] + meta)
    return path


def of_sony(path: Path, captured: str, shown: str, *, inside: bool = False) -> Path:
    """Write the XML of Sony's cameras, behind the media or in ``moov``."""
    xml = (
        '<NonRealTimeMeta xmlns="urn:schemas-professionalDisc:nonRealTimeMeta:ver.2.00"><VideoFormat>'
        f'<VideoFrame videoCodec="AVC_1920_1080_HP@L42" captureFps="{captured}" formatFps="{shown}"/>'
        "</VideoFormat></NonRealTimeMeta>"
    )
    meta = box(
        b"meta",
        bytes(4) + box(b"hdlr", bytes(8) + b"nrtm" + bytes(13)) + box(b"xml ", bytes(4) + xml.encode()),
    )
    if inside:
        return with_box(path, meta)
    path.write_bytes(path.read_bytes() + meta)
    return path


def slowed(rate: float, shown: str, by: str, *, name: str = ANDROID) -> str:
    """Return the note on slow motion."""
    return (
        f"The file states that {rate:g} pictures a second were taken ({name}), and shows {shown}: slow "
        f"motion. All times are divided by {by}; if it shows the motion at its true speed, give --rate "
        f"{shown}."
    )


@pytest.mark.parametrize(
    ("suffix", "stream"), [(".mp4", False), (".mov", False), (".mkv", False), (".mkv", True)]
)
def test_slow_motion_has_the_times_of_its_capture(make_clip: ClipMaker, suffix: str, stream: bool) -> None:
    """Matroska writes keys in capitals, and keeps those of a stream."""
    video = read(tagged(make_clip(), {ANDROID: "120.000000"}, suffix, stream=stream))
    np.testing.assert_allclose(video.times, np.arange(12) / 120.0, atol=1e-9)
    assert video.notes == (slowed(120, "30", "4"),)
    assert [frame.time for frame in video.frames()] == video.times.tolist()


def test_the_rate_is_read_where_a_phone_writes_it(make_clip: ClipMaker) -> None:
    video = read(of_android(make_clip(), 240.0))
    np.testing.assert_allclose(video.times, np.arange(12) / 240.0, atol=1e-9)
    assert video.notes == (slowed(240, "30", "8"),)


@pytest.mark.parametrize("inside", [False, True])
def test_the_rate_of_a_camera_of_sony_is_read(make_clip: ClipMaker, inside: bool) -> None:
    path = of_sony(make_clip(base=Fraction(1, 25)), "100p", "25p", inside=inside)
    video = read(path)
    np.testing.assert_allclose(video.times, np.arange(12) / 100.0, atol=1e-9)
    assert video.notes == (slowed(100, "25", "4", name="captureFps"),)


def test_half_pictures_are_no_frames(make_clip: ClipMaker) -> None:
    video = read(of_sony(make_clip(base=Fraction(1, 25)), "50i", "50i"))
    assert (video.count, video.times[-1], video.notes) == (12, 11 / 25.0, ())


@pytest.mark.parametrize(
    ("rate", "base"),
    [("30", Fraction(1, 30)), ("29.97", Fraction(1, 30)), ("24", Fraction(1, 30)), ("30", Fraction(1, 24))],
)
def test_a_rate_that_is_that_of_the_stamps_changes_nothing(
    make_clip: ClipMaker, rate: str, base: Fraction
) -> None:
    """A camera that slows down in the dark says 30 and takes 24."""
    video = read(tagged(make_clip(base=base), {ANDROID: rate}))
    np.testing.assert_allclose(video.times, np.arange(12) * float(base), atol=1e-9)
    assert video.notes == ()


def test_a_camera_in_the_dark_is_no_slow_motion(make_clip: ClipMaker) -> None:
    video = read(tagged(make_clip(base=Fraction(1, 15)), {ANDROID: "30.000000"}))
    np.testing.assert_allclose(video.times, np.arange(12) / 15.0, atol=1e-9)
    assert video.notes == (
        "The file states that 30 pictures a second were taken (com.android.capture.fps), and shows 15, "
        "as a camera does that slows down in the dark; its time stamps are taken as they are. If it is "
        "slow motion, give --rate 30.",
    )


def test_the_stamps_of_ntsc_were_stretched_by_a_whole_number(make_clip: ClipMaker) -> None:
    video = read(tagged(make_clip(base=Fraction(1001, 30000)), {ANDROID: "240"}))
    np.testing.assert_allclose(video.times, np.arange(12) * 1001 / 240000, atol=1e-9)
    assert video.notes == (slowed(240, "29.97", "8"),)


def test_a_variable_rate_stays_one(make_clip: ClipMaker) -> None:
    stamps = [0, 1, 2, 3, 5, 6, 7, 9, 10, 11, 12, 13]
    video = read(tagged(make_clip(stamps=stamps), {ANDROID: "120"}))
    np.testing.assert_allclose(video.times, np.array(stamps) / 120.0, atol=1e-9)


def test_rounded_stamps_are_rounded_less(make_clip: ClipMaker) -> None:
    """Those of Matroska follow no constant rate here: each is a whole millisecond of the slow picture."""
    stamps = [0, 33, 70, 99, 133, 171, 200, 233, 270, 300, 333, 366]
    path = make_clip(stamps=stamps, base=Fraction(1, 1000))
    assert read(tagged(path, {}, ".mkv")).tick == 1e-3
    assert read(tagged(path, {ANDROID: "120"}, ".mkv")).tick == 0.25e-3


def test_a_time_lapse_takes_longer_than_it_shows(make_clip: ClipMaker) -> None:
    video = read(tagged(make_clip(), {ANDROID: "2.000000"}))
    np.testing.assert_allclose(video.times, np.arange(12) / 2.0, atol=1e-9)
    assert video.notes == (
        "The file states that 2 pictures a second were taken (com.android.capture.fps), and shows 30: time "
        "lapse. All times are multiplied by 15; if it shows the motion at its true speed, give --rate 30.",
    )


@pytest.mark.parametrize("text", ["0.000000", "-120", "nan", "inf", "fast", "120 fps"])
def test_what_is_no_rate_is_said_and_changes_nothing(make_clip: ClipMaker, text: str) -> None:
    video = read(tagged(make_clip(), {ANDROID: text}, ".mkv"))
    np.testing.assert_allclose(video.times, np.arange(12) / 30.0, atol=1e-9)
    assert video.notes == (
        f"The file states a capture rate of {text!r} (com.android.capture.fps), which is no number of "
        "frames a second; its time stamps are taken as they are.",
    )


def test_a_rate_that_is_given_wins(make_clip: ClipMaker) -> None:
    video = read(tagged(make_clip(), {ANDROID: "120"}), rate=60.0)
    np.testing.assert_allclose(video.times, np.arange(12) / 60.0, atol=1e-9)
    assert video.notes == ("Time stamps replaced by 60 frames a second.",)


@pytest.mark.parametrize(
    "tag", [{"com.apple.quicktime.full-frame-rate-playback-intent": "0"}, {"encoder": "120"}]
)
def test_other_keys_say_nothing_of_the_rate(make_clip: ClipMaker, tag: dict[str, str]) -> None:
    video = read(tagged(make_clip("clip.mov"), tag))
    assert (video.times[-1], video.notes) == (11 / 30.0, ())


@pytest.mark.parametrize("content", [b"", b"\0\0\0\x01mdat" + bytes(8), b"\0"])
def test_broken_boxes_behind_the_media_end_the_search(make_clip: ClipMaker, content: bytes) -> None:
    path = make_clip()
    path.write_bytes(path.read_bytes() + content)
    assert read(path).notes == ()


@pytest.mark.slow
@pytest.mark.skipif("MONODYN_DATA" not in os.environ, reason="MONODYN_DATA names no folder of recordings")
def test_slow_motion_of_a_phone_has_its_lengths(tmp_path: Path) -> None:
    folder = Path(os.environ["MONODYN_DATA"]) / "faults" / "V1"
    run = monodyn.run(folder / "android_small.mp4", folder / "double_hd120.xml", tmp_path / "run")
    assert run.document["ok"]
    sizes = {p["name"]: (p["value"], p["std"]) for p in run.document["parameters"]}
    # a standard deviation and a half of 75 small pictures is 0.7 %; at 30 a second lengths are 16 times these
    for name, length in (("link1.length", 0.26), ("link2.length", 0.19)):
        assert sizes[name][0] == pytest.approx(length, rel=0.01)
        assert abs(sizes[name][0] - length) < 3.0 * sizes[name][1]
    assert slowed(120, "30", "4") in run.notes


def test_a_copy_at_another_rate_is_refused(make_clip: ClipMaker) -> None:
    """Of slow motion at 30 a second a copy has 60: the ratio to what the phone wrote is another one."""
    places = [k // 2 for k in range(24)]
    video = read(tagged(make_clip(count=24, places=places, base=Fraction(1, 60)), {ANDROID: "120"}))
    with refuses(
        VideoError,
        f"clip '{video.path}': expected new pictures, as the file states at what rate they were "
        "taken, got 12 of 24 that repeat the one before: it was copied to another rate since. If what "
        "it states is of the new pictures, give --rate 240.",
    ):
        video.without(Repeats(tuple(range(1, 24, 2))))
    # where nothing was scaled, and where a camera repeats some, the clip goes on
    assert read(video.path, rate=240.0).without(Repeats(tuple(range(1, 24, 2)))).count == 24
    assert video.without(Repeats((5, 11, 17))).notes[-1] == (
        "3 of 24 pictures repeat the one before; they count as not seen."
    )
