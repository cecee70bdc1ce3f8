"""Tables of tracked points, laid out as their tools write them, and what is refused of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from monodyn.errors import SettingsError, VideoError
from monodyn.vision.clip.video import Video
from monodyn.vision.points.read import read_points
from support import refuses
from tables import film, written

SCORER = "DLC_resnet50_pendulumApr1shuffle1_100000"
DLC = f"""scorer,{SCORER},{SCORER},{SCORER},{SCORER},{SCORER},{SCORER}
bodyparts,pivot,pivot,pivot,tip,tip,tip
coords,x,y,likelihood,x,y,likelihood
0,318.5,134.9,0.99,303.3,364.7,0.5
1,318.4,135.1,0.98,,,
2,318.6,135.0,0.97,310.1,360.2,1e-05
"""
SINGLE_TRACKER = "mass_A\nt\tx\ty\n0.0\t-1.0686477620876644\t42.80071293284619\n0.04\t-0.7147\t42.62\n"
TRACKER = (
    "#multi:\n\tmass_A\t\t\t\tmass B\t\t\t\t\nt\tx\ty\tpixelx\tpixely\tx\ty\tpixelx\tpixely\t\n"
    "0.000000000E0\t1.0E0\t2.0E0\t1.00E2\t2.00E2\t3.0E0\t4.0E0\t3.00E2\t4.00E2\t\n"
    "3.333333333E-2\t1.0E0\t2.0E0\t1.01E2\t2.01E2\t\t\t\t\t\n"
)
KINOVEA = (
    "#Kinovea Trajectory data export\n#T X Y\n\n# pivot\n0 0 0\n0.033 0 0\n0.067 0 0\n\n"
    "# tip 1\n0 5 -6\n0.033 5,5 -6\n0.067 6 -7\n\n"
)
PLAIN = "frame,a_x,a_y,a_p,b_x,b_y\n0,1,2,.9,3,4\n1,nan,,0.5,3,4.5\n2,5,6,1,7,8\n"


def test_csv_of_deeplabcut(tmp_path: Path) -> None:
    found = read_points(written(tmp_path, "a.csv", DLC), rate=50.0, size=(640, 480))
    assert found.names == ("pivot", "tip")
    assert found.px[0].tolist() == [[318.5, 134.9], [303.3, 364.7]]
    assert np.isnan(found.px[1, 1]).all()
    assert found.found.tolist() == [[True, True], [True, False], [True, True]]
    assert found.likelihood[:, 1].tolist() == [0.5, 0.0, 1e-05]
    assert found.time.tolist() == [0.0, 0.02, 0.04]
    assert (found.width, found.height, found.in_picture, found.notes) == (640, 480, True, ())


def test_several_individuals_of_deeplabcut(tmp_path: Path) -> None:
    lines = DLC.splitlines()
    who = ["individuals,left,left,left,right,right,right"]
    parts = "\n".join([lines[0], *who, *lines[1:]])
    assert read_points(written(tmp_path, "a.csv", parts), rate=50.0).names == ("pivot", "tip")
    # a spreadsheet fills rows up
    wide = "".join(f"{line},,\n" for line in parts.splitlines())
    assert read_points(written(tmp_path, "w.csv", wide), rate=50.0).names == ("pivot", "tip")
    same = parts.replace("tip", "pivot")
    assert read_points(written(tmp_path, "b.csv", same), rate=50.0).names == ("left.pivot", "right.pivot")


def test_text_of_tracker(tmp_path: Path) -> None:
    found = read_points(written(tmp_path, "a.txt", TRACKER), size=(640, 480))
    assert found.names == ("mass_A", "mass B")
    assert found.px[0].tolist() == [[100.0, 200.0], [300.0, 400.0]]
    assert np.isnan(found.px[1, 1]).all()
    np.testing.assert_allclose(found.time, [0.0, 1.0 / 30.0], atol=1e-9)
    assert found.in_picture


def test_lengths_of_tracker_go_into_a_picture_of_their_own(tmp_path: Path) -> None:
    found = read_points(written(tmp_path, "a.txt", SINGLE_TRACKER))
    assert found.names == ("mass_A",)
    assert not found.in_picture
    right, down = np.diff(found.px[:, 0], axis=0)[0]
    # the point moves to the right and down: x grows, and so does the row of the picture
    assert right > 0.0
    assert down > 0.0
    np.testing.assert_allclose(down / right, 0.1807 / 0.3539, rtol=1e-3)
    assert found.notes == (
        "The table of Tracker has lengths of a scene and no pixels: no overlay can be drawn, and its "
        "second axis is taken to go up (--points.axis chooses).",
    )
    other = read_points(tmp_path / "a.txt", axis="down")
    assert np.diff(other.px[:, 0, 1])[0] < 0.0


def test_pixels_and_lengths_of_tracker_are_not_mixed(tmp_path: Path) -> None:
    rows = "0\t1\t2\t3\t4\n0.1\t1\t2\t3\t4\n"
    mixed = f"#multi:\n\tA\t\tB\t\nt\tx\ty\tpixelx\tpixely\n{rows}"
    with refuses(
        VideoError,
        "a.txt: expected columns of one kind for all points, got x, y of 'A' and pixelx, pixely of 'B'; "
        "choose the same for each in Tracker's table.",
    ):
        read_points(written(tmp_path, "a.txt", mixed))
    # lengths that all of them have are taken where one has no pixels
    rows = "0\t1\t2\t3\t4\t5\t6\n0.1\t1\t3\t4\t4\t5\t6\n"
    shared = f"#multi:\n\tA\t\tB\t\t\t\nt\tx\ty\tx\ty\tpixelx\tpixely\n{rows}"
    found = read_points(written(tmp_path, "b.txt", shared))
    assert not found.in_picture
    right, up = found.px[0, 1] - found.px[0, 0]
    np.testing.assert_allclose([up / right], [-1.0])


def test_plain_table(tmp_path: Path) -> None:
    found = read_points(written(tmp_path, "a.csv", PLAIN), rate=10.0)
    assert found.names == ("a", "b")
    assert found.likelihood[:, 0].tolist() == [0.9, 0.5, 1.0]
    assert found.notes == (
        "The table does not say how large the picture is: 8x9 px assumed, as far as the points reach; give "
        "--points.size W,H, on which the assumed focal length depends.",
    )
    timed = written(tmp_path, "b.csv", "time,a_x,a_y\n0.5,1,2\n0.7,1,3\n1.1,1,4\n")
    assert read_points(timed).frame.tolist() == [0, 1, 2]


def test_the_clip_gives_times_and_size(tmp_path: Path) -> None:
    found = read_points(written(tmp_path, "a.csv", PLAIN), clip=film(5))
    assert found.time.tolist() == [0.0, 0.04, 0.08]
    assert (found.width, found.height, found.notes) == (640, 480, ())


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "t.csv: expected a table of points, got an empty file."),
        ("\x00\x01\x02",
         "t.csv: expected a table of tracked points (CSV, text or HDF5), got other binary data."),
        ("a,b\n1,2\n",
         "t.csv: expected points of DeepLabCut (CSV, HDF5), SLEAP analysis HDF5, Tracker or Kinovea text, or "
         "frame,NAME_x,NAME_y[,NAME_p], got a file that begins with 'a,b'."),
        ("frame,a_x,a_y\n0,1,2\n0,1,2\n",
         "t.csv: expected each frame once, got frame 0 twice; keep one of them."),
        ("time,a_x,a_y\n1,1,2\n1,1,2\n",
         "t.csv: expected each time once, got time 1 twice; keep one of them."),
        ("frame,a_x,a_y\n,1,2\n1,1,2\n",
         "t.csv: expected a frame in every row, got nan in row 1 of the data; complete or remove that row."),
        ("frame,a_x,a_y\n0.5,1,2\n1,1,2\n",
         "t.csv: expected whole frame numbers from 0 on, got 0.5; count the frames of the clip."),
        ("frame,a_x,a_y\n0,1,2\n2000000,1,2\n",
         "t.csv: expected frame numbers below 1000000, got 2e+06; correct the last row."),
        ("time,a_x,a_y\n0,1,2\n0.1,2,2\n0.2,3,2\n0.3,3,3\n72,3,1\n",
         "t.csv: expected rows that follow each other, got pauses of 23.87 s between rows of 0.1333 s, the "
         "longest after 0.1 s; give what comes before and after a pause as records of their own."),
        ("frame,a_x,a_y\n0,1,2\n1,1,2,3\n",
         "t.csv: row 3: expected 3 cells, as the header has columns, got 4; name each column, and write "
         "numbers without a comma between their digits."),
        ("frame,a_x,a_y,a_p\n0,1,2,87\n",
         "t.csv: expected likelihoods from 0 to 1, got 87; scale them, and leave the places of points that "
         "were not found empty."),
        ("frame,a_x,a_y\n0,-70,-20\n",
         "t.csv: expected pixels of a picture of 2x2, got 100% of the places outside of it, from -70, -20 to "
         "-70, -20; give the clip that was tracked, or the size of its pictures with --points.size W,H."),
        ("frame,a_x,a_y\n0,1," + "2" * 140_000,
         "t.csv: cannot be read as a table of points (field larger than field limit (131072)); export it "
         "again, or as CSV."),
        ("scorer,,,s,s\nbodyparts,,,b,b\ncoords,,,x,y\nlabeled-data,v,1.png,1,2\n",
         "t.csv: expected frame numbers in the first column, got 'labeled-data': these are labels for "
         "training; give the table that DeepLabCut writes when it analyses a clip."),
        ("frame,a_x,a_x,a_y\n0,1,2,3\n",
         "t.csv: column 'a_x' is there 2 times, capitals or not; keep one."),
        ("frame,A_x,A_y,a_x,a_y\n0,1,2,3,4\n",
         "t.csv: column 'A_x' is there 2 times, capitals or not; keep one."),
        ("Frame,frame,a_x,a_y\n0,1,2,3\n",
         "t.csv: column 'Frame' is there 2 times, capitals or not; keep one."),
        ("frame,a_x\n0,1\n", "t.csv: expected a column 'a_y' next to 'a_x', got none; add it."),
        ("frame,a_x,a_y\n", "t.csv: expected rows of coordinates after the header, got none."),
        ("frame,a_x,a_y\n0,,\n1,,\n", "t.csv: expected places of points, got none in 2 rows."),
        ("mass_A\nt\tx\ty\n", "t.csv: expected places of points, got none in 0 rows."),
        ("frame,a_x,a_y\n0,one,2\n", "t.csv: row 2, column 2: expected a number, got 'one'."),
        ('"Time","a/0/X","a/0/Y"\n', "t.csv: expected rows of coordinates after the header, got none."),
        ("#Kinovea Trajectory data export\n#T X Y\n",
         "t.csv: expected trajectories after the heading of Kinovea, got none."),
        ("mass_A\nt\tx\n0\t1\n1\t2\n",
         "t.csv: expected columns x and y, or pixelx and pixely, of point 'mass_A', got x; choose them in "
         "Tracker's table."),
        ("scorer,a\nbodyparts,b\n0,1\n",
         "t.csv: expected header rows 'scorer', 'bodyparts' and 'coords' of DeepLabCut, got 'scorer', "
         "'bodyparts', '0'."),
        ("scorer,s,s\nbodyparts,b,b\ncoords,x,y,likelihood\n0,1,2,1\n",
         "t.csv: header row 'scorer': expected 3 cells after its name, as the row 'coords' has, got 2; name "
         "each column."),
        ("scorer,s,s,s,s\nbodyparts,b,b,c,c\ncoords,x,y\n0,1,2,3,4\n",
         "t.csv: header row 'scorer': expected 2 cells after its name, as the row 'coords' has, got 4; name "
         "each column."),
        ("scorer,s,s,s\nbodyparts,b,b,c\ncoords,x,y,x\n0,1,2,3\n",
         "t.csv: expected columns x, y and likelihood of body part 'c', each once, got x; give the table "
         "that DeepLabCut writes when it analyses a clip."),
        ("scorer,s,s,s\nbodyparts,b,b,b\ncoords,x,y,z\n0,1,2,3\n",
         "t.csv: expected columns x, y and likelihood of body part 'b', each once, got x, y, z; give the "
         "table that DeepLabCut writes when it analyses a clip."),
        ("scorer,s,s\nbodyparts,b,b\ncoords,x,y\n",
         "t.csv: expected rows of coordinates after the header, got none."),
        ("scorer,s,s\nbodyparts,b,b\ncoords,x,y\n,1,2\n",
         "t.csv: expected frame numbers in the first column, got an empty cell."),
    ],
)  # fmt: skip
def test_what_is_no_table_is_refused(tmp_path: Path, content: str, message: str) -> None:
    path = written(tmp_path, "t.csv", content)
    with refuses(VideoError, message):
        read_points(path, rate=30.0)


def test_text_of_any_program_and_language(tmp_path: Path) -> None:
    usual = read_points(written(tmp_path, "a.csv", PLAIN), rate=10.0)
    forms = {
        "mark.csv": b"\xef\xbb\xbf" + PLAIN.encode(),
        "wide.csv": PLAIN.encode("utf-16"),
        "returns.csv": PLAIN.replace("\n", "\r").encode(),
        "decimal.csv": PLAIN.replace(",", ";").replace(".", ",").encode(),
        "tabs.csv": PLAIN.replace(",", "\t").encode(),
        "turned.csv": "\n".join([*PLAIN.splitlines()[:1], *PLAIN.splitlines()[:0:-1]]).encode(),
    }
    for name, content in forms.items():
        found = read_points(written(tmp_path, name, content), rate=10.0)
        assert found.names == usual.names
        assert np.array_equal(found.px, usual.px, equal_nan=True), name


def test_rounded_and_uneven_times_count_no_frame_too_many(tmp_path: Path) -> None:
    count = np.delete(np.arange(300), [7, 8, 90])
    rows = "\n".join(f"{int(1000 * k / 30) / 1000},{k % 9},2" for k in count)
    found = read_points(written(tmp_path, "a.csv", f"time,a_x,a_y\n{rows}\n"))
    assert np.array_equal(found.frame, count)
    np.testing.assert_allclose(found.time, count / 30.0, atol=1e-4)
    assert found.tick == 0.0
    rows = "\n".join(f"{0.5 + k / 30 + 0.006 * np.sin(k)},{k % 9},2" for k in count)
    uneven = written(tmp_path, "b.csv", f"time,a_x,a_y\n{rows}\n")
    assert np.array_equal(read_points(uneven).frame, count)
    # next to a clip they are the frames of its stamps
    clip = Video(Path("clip.mp4"), 640, 480, np.arange(400) / 30.0, lambda start, stop: iter(()))
    assert np.array_equal(read_points(uneven, clip=clip).frame, count + 15)


def test_times_and_frames_are_needed(tmp_path: Path) -> None:
    path = written(tmp_path, "t.csv", PLAIN)
    with refuses(
        VideoError,
        "t.csv: expected time stamps, but a table of CSV has none; give --rate HZ, or the clip with --clip.",
    ):
        read_points(path)
    with refuses(
        VideoError,
        "t.csv: expected frames of the clip, 0 to 1, got 3 rows up to frame 2; give the table of this clip.",
    ):
        read_points(path, clip=film(2))
    missing = tmp_path / "none.csv"
    with refuses(
        VideoError, f"{missing}: cannot be read (No such file or directory); name a table of points."
    ):
        read_points(missing)
    with refuses(VideoError, "rate: expected 0.001 to 1e+06 frames a second, got 0; give the true rate."):
        read_points(path, rate=0.0)
    with refuses(SettingsError, "points.axis: expected one of 'auto', 'down', 'up', got 'left'."):
        read_points(path, axis="left")  # type: ignore[arg-type]
    twice = written(tmp_path, "d.txt", KINOVEA.replace("tip 1", "pivot"))
    with refuses(VideoError, "d.txt: expected each point once, got 'pivot' 2 times; rename one of them."):
        read_points(twice)
