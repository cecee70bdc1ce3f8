"""Tables of joint positions: round trip, encoder logs, whole messages."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.estimation.record.tables import read_poses, write_poses
from monodyn.types import Poses
from support import refuses


def poses(count=12):
    rng = np.random.default_rng(5)
    position = rng.normal(size=(count, 2))
    position[3] = np.nan
    seen = np.ones(count, dtype=bool)
    seen[3] = False
    covariance = np.zeros((count, 2, 2))
    covariance[:, 0, 0], covariance[:, 1, 1] = 0.001**2, rng.uniform(0.001, 0.1, count) ** 2
    time = np.cumsum(rng.uniform(0.01, 0.1, count))
    return Poses(("a", "b"), np.arange(7, 7 + count), time, position, covariance, seen)


def test_round_trip(tmp_path):
    before = poses()
    write_poses(before, tmp_path / "poses.csv")
    after = read_poses(tmp_path / "poses.csv", ["a", "b"])
    for name in ("frame", "time", "position", "seen"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    np.testing.assert_allclose(after.covariance, before.covariance, rtol=1e-15)  # square of a square root
    assert after.joints == before.joints
    assert after.metric


def test_errors_that_positions_share_come_back(tmp_path):
    before, shared = poses(), np.random.default_rng(2).normal(size=(2, 12, 2))
    write_poses(before, tmp_path / "poses.csv", shared=shared)
    after = read_poses(tmp_path / "poses.csv", ["b", "a"])
    np.testing.assert_array_equal(after.shifts, shared[:, :, ::-1])
    assert read_poses(tmp_path / "poses.csv", ["a"]).shifts.shape == (2, 12, 1)
    text = (tmp_path / "poses.csv").read_text()
    (tmp_path / "poses.csv").write_text(text.replace(repr(float(shared[1, 4, 0])), "inf"))
    with refuses(
        VideoError,
        "poses.csv: line 6, column 'a_shared2': expected an error within 1e+30 of 0, or nothing, got inf.",
    ):
        read_poses(tmp_path / "poses.csv", ["a", "b"])


def test_what_is_missing_is_an_empty_cell(tmp_path):
    gap = poses()
    covariance = gap.covariance.copy()
    covariance[3] = np.nan
    write_poses(replace(gap, covariance=covariance), tmp_path / "poses.csv")
    lines = (tmp_path / "poses.csv").read_text().splitlines()
    assert lines[4] == f"10,{float(gap.time[3])!r},0,,,,,0,0"
    # other tools write nan, which is read as well
    (tmp_path / "other.csv").write_text("\n".join(lines).replace(",,,,,", ",nan,nan,nan,nan,"))
    found = [read_poses(tmp_path / name, ["a", "b"]) for name in ("poses.csv", "other.csv")]
    np.testing.assert_array_equal(found[0].position, found[1].position)


def test_a_hidden_joint_comes_back_as_one(tmp_path):
    whole = poses()
    joint_seen = np.isfinite(whole.position)
    joint_seen[[5, 6], 1] = False
    position = np.where(joint_seen, whole.position, np.nan)
    before = replace(whole, position=position, seen=joint_seen.all(axis=1), joint_seen=joint_seen)
    write_poses(before, tmp_path / "poses.csv")
    header = (tmp_path / "poses.csv").read_text().splitlines()[0]
    assert header == "frame,time,seen,a,b,a_std,b_std,a_seen,b_seen"
    after = read_poses(tmp_path / "poses.csv", ["a", "b"])
    np.testing.assert_array_equal(after.seen, joint_seen.all(axis=1))
    np.testing.assert_array_equal(after.measured, joint_seen)
    np.testing.assert_allclose(after.covariance[5, 1, 1], before.covariance[5, 1, 1], rtol=1e-15)


def test_a_row_taken_out_by_hand_stays_out(tmp_path):
    write_poses(poses(), tmp_path / "poses.csv")
    lines = (tmp_path / "poses.csv").read_text().splitlines()
    cells = lines[3].split(",")
    (tmp_path / "poses.csv").write_text(
        "\n".join([*lines[:3], ",".join([*cells[:2], "0", *cells[3:]]), *lines[4:]])
    )
    after = read_poses(tmp_path / "poses.csv", ["a", "b"])
    assert not after.measured[2].any()
    assert after.measured[4].all()


def test_encoder_log_in_the_order_of_the_mechanism(tmp_path):
    time = np.arange(50) * 0.01
    a, b = np.sin(5 * time) + 0.001 * np.random.default_rng(6).normal(size=50), 2.0 * time
    lines = ["time,b,extra,a"] + [f"{t},{y},0,{x}" for t, x, y in zip(time, a, b, strict=True)]
    (tmp_path / "log.csv").write_text("\ufeff" + "\r\n".join(lines) + "\r\n\r\n")
    found = read_poses(tmp_path / "log.csv", ["a", "b"])
    np.testing.assert_array_equal(found.position[:, 0], a)
    np.testing.assert_array_equal(found.position[:, 1], b)
    std = np.sqrt(found.covariance[0, 0, 0])
    assert 0.0005 < std < 0.002  # the noise put in is 0.001
    assert found.seen.all()


def test_one_sample_of_1e20_makes_the_others_no_noisier(tmp_path):
    """The noise of a joint weighs all of its samples: with 7e14 for one gross error, none would count."""
    time = np.arange(50) * 0.01
    values = np.sin(5 * time) + 0.001 * np.random.default_rng(6).normal(size=50)
    noise = []
    for spoilt in (values[25], 1e20):
        values[25] = spoilt
        lines = ["time,a", *(f"{t},{x}" for t, x in zip(time, values, strict=True))]
        (tmp_path / "log.csv").write_text("\n".join(lines))
        noise.append(np.sqrt(read_poses(tmp_path / "log.csv", ["a"]).covariance[0, 0, 0]))
    assert noise[1] == pytest.approx(noise[0], rel=0.2)


def test_a_joint_that_was_never_measured_is_a_gap(tmp_path):
    (tmp_path / "log.csv").write_text("time,a,b\n" + "".join(f"{i},{i % 3},\n" for i in range(9)))
    found = read_poses(tmp_path / "log.csv", ["a", "b"])
    assert np.isnan(found.position[:, 1]).all()
    assert np.isfinite(found.covariance).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,b\n0,1\n", "log.csv: column 'a' is missing; columns: 'time', 'b'."),
        ("a,b\n0,1\n", "log.csv: column 'time' is missing; columns: 'a', 'b'."),
        ("time,a\n0,1\n1,x\n", "log.csv: line 3, column 'a': expected a number, got 'x'."),
        ("time,a\n0,1\n\n1\n", "log.csv: line 4 has 1 cells, expected 2 as in the header."),
        ("time,a\n1,1\n0.5,1\n", "log.csv: column 'time': must increase, but sample 1 is 0.5 s after 1 s."),
        ("time,a\n,1\n0.5,1\n", "log.csv: column 'time': expected finite times, got nan."),
        ("", "log.csv: expected a header line and rows of numbers, got 0 lines."),
        ("time,a\n", "log.csv: expected a header line and rows of numbers, got 1 lines."),
        ("time,a\n0,\n1,nan\n", "log.csv: expected measured joint positions, got none in 2 rows."),
        (
            "frame,time,a\n0,0,1\n,1,2\n",
            "log.csv: line 3, column 'frame': expected a whole number, got an empty cell.",
        ),
        ("frame,time,a\n0.5,0,1\n", "log.csv: line 2, column 'frame': expected a whole number, got 0.5."),
        (
            "time,a,a_std\n0,1,0.1\n\n1,2,-0.1\n",
            "log.csv: line 4, column 'a_std': expected a deviation from 0 to 1e+30, or nothing, got -0.1.",
        ),
        (
            "time,a\n0,1\n1,inf\n",
            "log.csv: line 3, column 'a': expected a number within 1e+30 of 0, or nothing for a gap, got "
            "inf.",
        ),
        (
            "time,a\n0,1\n1,1e299\n",
            "log.csv: line 3, column 'a': expected a number within 1e+30 of 0, or nothing for a gap, got "
            "1e299.",
        ),
        (
            "time,a\n0,1\n1e299,1\n",
            "log.csv: column 'time': expected times within 1e+30 s of 0, got 1e+299; give them in seconds.",
        ),
        (
            "time,a\n0,1\n1e-300,1\n",
            "log.csv: column 'time': expected rows 1e-09 s apart or more, got two with 1e-300 s between "
            "them; give the times in seconds.",
        ),
        *(
            (
                f"time{sign}a\n0{sign}1,5\n",
                f"log.csv: expected commas between the cells, got {word}; save it with commas, and with "
                "points in its numbers.",
            )
            for sign, word in ((";", "semicolons"), ("\t", "tabs"), ("|", "bars"), (" ", "blanks"))
        ),
        (
            "0,1\n1,2\n",
            "log.csv: expected a header line, got numbers in line 1; name the columns there, "
            "'time' and others.",
        ),
        ("Time,A\n0,1\n", "log.csv: column 'time', 'a' is missing; did you mean 'Time' and 'A'?"),
        (
            "time," + ",".join(f"q{k}" for k in range(30)) + "\n0" + ",1" * 30 + "\n",
            "log.csv: column 'a' is missing; columns: 'time', 'q0', 'q1', 'q2', 'q3', 'q4', 'q5', 'q6', "
            "'q7', 'q8', 'q9', 'q10' and 19 more.",
        ),
        (
            f"time,a\n0,{'x' * 100}\n",
            f"log.csv: line 2, column 'a': expected a number, got '{'x' * 40}...{'x' * 17}'.",
        ),
        ("time,a,a\n0,1,2\n", "log.csv: column 'a' is there 2 times; keep one."),
    ],
)
def test_bad_tables_have_whole_messages(tmp_path, text, message):
    (tmp_path / "log.csv").write_text(text)
    with refuses(VideoError, message):
        read_poses(tmp_path / "log.csv", ["a"])


def test_the_column_of_another_joint_was_not_meant(tmp_path):
    (tmp_path / "log.csv").write_text("time,joint1,joint1_std\n0,1,1\n")
    with refuses(VideoError, "log.csv: column 'joint2' is missing; columns: 'time', 'joint1'."):
        read_poses(tmp_path / "log.csv", ["joint1", "joint2"])


def test_files_that_are_no_tables(tmp_path):
    none = tmp_path / "none.csv"
    with refuses(
        VideoError,
        f"{none}: cannot be read (No such file or directory); name a table of joint positions.",
    ):
        read_poses(none, ["a"])
    (tmp_path / "clip.mp4").write_bytes(bytes(range(128, 256)))
    with refuses(VideoError, "clip.mp4: expected a table of comma-separated values, got binary data."):
        read_poses(tmp_path / "clip.mp4", ["a"])
    (tmp_path / "long.csv").write_text("time,a\n0," + "1" * (csv.field_size_limit() + 1) + "\n")
    with refuses(
        VideoError,
        "long.csv: expected a table of comma-separated values, but field larger than field limit "
        f"({csv.field_size_limit()}).",
    ):
        read_poses(tmp_path / "long.csv", ["a"])


def test_more_rows_than_can_be_fitted_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("monodyn.estimation.record.tables.MOST_ROWS", 5)
    table = tmp_path / "long.csv"
    table.write_text("time,a\n" + "".join(f"{k},0\n" for k in range(12)))
    with refuses(
        VideoError,
        "long.csv: expected at most 5 rows, got 12; keep one of every 3, a motion needs some ten rows "
        "a swing.",
    ):
        read_poses(table, ["a"])


def test_a_table_without_an_end_is_refused():
    with refuses(VideoError, "'/dev/zero': expected a file, got a device; save its content to a file."):
        read_poses("/dev/zero", ["a"])


@pytest.mark.parametrize(("name", "expected"), [("excluded", "12, 2"), ("shared", "any, 12, 2")])
def test_what_is_written_has_the_shape_of_the_record(tmp_path, name, expected):
    with refuses(VideoError, f"write_poses: {name}: expected an array of shape ({expected}), got (1,)."):
        write_poses(poses(), tmp_path / "poses.csv", **{name: np.array([1.0])})
    assert not (tmp_path / "poses.csv").exists()
