"""What Kinovea exports, laid out as it does, and the unit of its times."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.vision.formats import kinovea as reader
from monodyn.vision.points.read import read_points
from support import refuses
from tables import film, written

KINOVEA = (
    "#Kinovea Trajectory data export\n#T X Y\n\n# pivot\n0 0 0\n0.033 0 0\n0.067 0 0\n\n"
    "# tip 1\n0 5 -6\n0.033 5,5 -6\n0.067 6 -7\n\n"
)
OLD_KINOVEA = (
    "#Kinovea Trajectory data export\n#T X Y\n0:00:00:00 866.00 320.00 \n0:00:00:03 847.00 321.00 \n"
    "0:00:00:07 830.00 322.00 \n\n\n0:00:00:00 118.00 45.00 \n0:00:00:03 131.00 37.00 \n\n\n"
)
KINOVEA_CSV = (
    '"Time","pivot/0/X","pivot/0/Y","arm/a/X","arm/a/Y","arm/b/X","arm/b/Y"\r\n'
    '"0","1.0","2.0","3.0","4.0","5.0","6.0"\r\n"33","1.5","2.0",,,"5.5","6.0"\r\n"67","2","2","3","4","5","6"\r\n'
)


def test_text_of_kinovea(tmp_path: Path) -> None:
    found = read_points(written(tmp_path, "a.txt", KINOVEA))
    assert found.names == ("pivot", "tip 1")
    # below the pivot, in a system whose second axis goes up
    assert (found.px[:, 1, 1] > found.px[:, 0, 1]).all()
    # times were rounded to milliseconds: a constant rate explains them
    np.testing.assert_allclose(np.diff(found.time), 0.0335, atol=1e-4)
    assert found.tick == 0.0
    old = read_points(written(tmp_path, "b.txt", OLD_KINOVEA))
    assert old.names == ("track1", "track2")
    np.testing.assert_allclose(np.diff(old.time), 0.035, atol=1e-6)


def test_csv_of_kinovea(tmp_path: Path) -> None:
    found = read_points(written(tmp_path, "a.csv", KINOVEA_CSV))
    assert found.names == ("pivot", "arm/a", "arm/b")
    np.testing.assert_allclose(np.diff(found.time), 0.0335, atol=1e-4)
    assert found.found.tolist() == [[True, True, True], [True, False, True], [True, True, True]]
    semicolons = KINOVEA_CSV.replace(",", ";").replace(".", ",")
    assert np.array_equal(read_points(written(tmp_path, "b.csv", semicolons)).px, found.px, equal_nan=True)


def kinovea(folder: Path, stamps: str, *, named: bool = True) -> Path:
    """Write a trajectory of Kinovea at the times that are separated by ``|``."""
    rows = "".join(f"{stamp} {i} {-i}\n" for i, stamp in enumerate(stamps.split("|")))
    name = "# tip\n" if named else ""
    return written(folder, "k.txt", f"#Kinovea Trajectory data export\n#T X Y\n{name}{rows}")


@pytest.mark.parametrize(
    ("stamps", "times"),
    [
        ("0:00:00:00|0:00:00:03|0:00:00:07", (0.0, 0.03, 0.07)),
        ("0:00:00:000|0:00:00:008|0:00:00:017", (0.0, 0.008, 0.017)),
        ("1:01:59:97|1:02:00:00|1:02:00:03", (3719.97, 3720.0, 3720.03)),
        # 0.996 s come as 100 hundredths
        ("0:00:00:96|0:00:00:100|0:00:01:03", (0.96, 1.0, 1.03)),
        ("- 0:00:00:03|0:00:00:00|0:00:00:03", (-0.03, 0.0, 0.03)),
        ("59:97|01:00:00|01:00:03", (59.97, 60.0, 60.03)),
        ("59:992|01:00:000|01:00:008", (59.992, 60.0, 60.008)),
        ("97|01:00|01:03", (0.97, 1.0, 1.03)),
        ("992|01:000|01:008", (0.992, 1.0, 1.008)),
        ("00|03|07", (0.0, 0.03, 0.07)),
        ("000|008|017", (0.0, 0.008, 0.017)),
        ("0.97|1.00|1.03", (0.97, 1.0, 1.03)),
        ("59.97|1:00.00|1:00.03", (59.97, 60.0, 60.03)),
        # numbers: seconds, then milliseconds
        ("0|0,04|0,08", (0.0, 0.04, 0.08)),
        ("0|0.001|0.002", (0.0, 0.001, 0.002)),
        ("0|33.33333|66.66666", (0.0, 1.0 / 30.0, 2.0 / 30.0)),
        ("0|2|4", (0.0, 0.002, 0.004)),
    ],
)
def test_times_of_kinovea(tmp_path: Path, stamps: str, times: tuple[float, ...]) -> None:
    path = kinovea(tmp_path, stamps)
    # the reader's own stamps, before a constant rate explains them
    found = reader.from_text(path, path.read_text()).time
    assert found is not None
    np.testing.assert_allclose(found, times, atol=1e-8)


@pytest.mark.parametrize(
    ("stamps", "message"),
    [
        # microseconds; time stamps of the file
        ("0|33333.33|66666.66", "steps of 33333.3"),
        ("0|12800|25600", "steps of 12800"),
        # hundredths of a minute, and ten-thousandths of an hour, at 30 Hz
        ("0|0.055|0.1116667", "steps of 0.05583 that are no whole milliseconds"),
        ("0|0.09166667|0.1861111", "steps of 0.09306 that are no whole milliseconds"),
        ("0:00|0:05|0:11", "codes such as '0:00', which may count hundredths of a minute"),
        ("12:00|12:05|12:11", "codes such as '12:00', which may count hundredths of a minute"),
        # 5 Hz in s or 5 kHz in ms; 5 Hz in ms or 5 kHz in microseconds
        ("0|0.2|0.4", "steps of 0.2"),
        ("0|200|400", "steps of 200"),
        ("50|53|57", "numbers of two digits, which may be hundredths of a second"),
        ("12", "a single number"),
    ],
)
def test_times_of_kinovea_in_no_sure_unit(tmp_path: Path, stamps: str, message: str) -> None:
    path = kinovea(tmp_path, stamps)
    with refuses(
        VideoError,
        f"k.txt: expected times in frames, milliseconds or seconds, got {message}; give --rate HZ, or the "
        "clip with --clip.",
    ):
        read_points(path)
    found = read_points(path, rate=50.0)
    np.testing.assert_allclose(found.time, 0.02 * np.arange(len(found.time)))


def test_a_clip_tells_the_unit_of_kinovea(tmp_path: Path) -> None:
    # tracked from frame 90 on, without frame 150, in hundredths of a minute of whole milliseconds
    frame = np.delete(np.arange(90, 290), 60)
    stamps = "|".join(f"{round(1000 * k / 30) / 600:.7g}" for k in frame)
    path = kinovea(tmp_path, stamps)
    assert np.array_equal(read_points(path, clip=film(300, rate=30.0)).frame, frame)


def test_frames_of_kinovea_keep_their_numbers(tmp_path: Path) -> None:
    text = kinovea(tmp_path, "|".join(map(str, range(30, 38))))
    found = read_points(text, clip=film(50))
    assert found.frame.tolist() == list(range(30, 38))
    assert found.time[0] == 1.2
    assert found.notes[0] == (
        "The frame numbers of Kinovea, which begin with 30, are taken to be counted from 0, as its present "
        "versions do; correct them in the table where the points are a frame off."
    )
    old = read_points(kinovea(tmp_path, "30|31|32|33", named=False), rate=25.0)
    assert old.frame.tolist() == [29, 30, 31, 32]
    assert old.notes[0] == (
        "The frame numbers of Kinovea, which begin with 30, are taken to be counted from 1, as its older "
        "versions, which give trajectories no name, do; correct them in the table where the points are a "
        "frame off."
    )
    for named in (True, False):
        begun = read_points(kinovea(tmp_path, "0|1|2", named=named), rate=25.0)
        assert begun.frame.tolist() == [0, 1, 2]
        assert len(begun.notes) == 1
    with refuses(
        VideoError,
        "k.txt: expected time stamps, but a table of Kinovea has none; give --rate HZ, or the clip with "
        "--clip.",
    ):
        read_points(kinovea(tmp_path, "0|1|2"))


def test_other_codes_of_kinovea_are_refused(tmp_path: Path) -> None:
    for stamps, got in (
        ("0:00:00:0|0:00:00:1", "0"),
        ("0:00:00:000|0:00:00:0083", "0083"),
        ("0:0a|1", "0:0a"),
    ):
        with refuses(
            VideoError,
            "k.txt: expected times as h:mm:ss:cc or h:mm:ss:fff, hundredths or thousandths of a second, got "
            f"'{got}'; export them again, or as CSV.",
        ):
            read_points(kinovea(tmp_path, stamps), rate=30.0)
