"""Logs of known torques from files, and what of them is refused."""

from pathlib import Path

import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.estimation.record.logs import read_torques
from support import refuses

JOINTS = ("joint1", "joint2")


def written(folder: Path, *lines: str) -> Path:
    path = folder / "torques.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_columns_are_named_as_the_joints_or_with_a_suffix(tmp_path: Path) -> None:
    log = read_torques(written(tmp_path, "time,joint2", "0,0.5", "0.1,-0.5"), JOINTS)
    assert log.joints == ("joint2",)
    assert log.time.tolist() == [0.0, 0.1]
    assert log.torque.tolist() == [[0.5], [-0.5]]
    # next to positions the suffix tells them apart
    both = written(tmp_path, "time,joint1,joint2,joint1_torque", "0,1,2,0.5", "0.1,,2,0")
    log = read_torques(both, JOINTS)
    assert log.joints == ("joint1",)
    assert np.array_equal(log.torque, [[0.5], [0.0]])


def test_the_torques_of_a_run_folder_are_read(tmp_path: Path) -> None:
    rows = (
        "frame,time,joint1,joint2,joint1_std,joint2_std",
        "0,0.0,0.5,0,0.1,",
        ",0.05,0.25,0,0.1,",
        "1,0.1,0,0,,",
    )
    log = read_torques(written(tmp_path, *rows), JOINTS)
    assert log.joints == JOINTS
    assert log.torque.tolist() == [[0.5, 0.0], [0.25, 0.0], [0.0, 0.0]]


KNOWN = "joints: 'joint1', 'joint2'."


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (
            ("time", "0", "1"),
            "torques.csv: expected columns 'time' and '<joint>_torque' or '<joint>' of joints with a torque, "
            f"got 'time'; {KNOWN}",
        ),
        (
            ("time,elbw", "0,1", "1,1"),
            "torques.csv: column 'elbw' is of no joint of the mechanism; name it as its joint, or leave it "
            f"out; {KNOWN}",
        ),
        (
            ("time,joint1,Joint2", "0,1,1", "1,1,1"),
            "torques.csv: column 'Joint2' is of no joint of the mechanism; name it as its joint, or leave it "
            "out; did you mean 'joint2'?",
        ),
        (
            ("time,joint1,joint1", "0,1,1", "1,1,1"),
            "torques.csv: column 'joint1' is there 2 times; keep one.",
        ),
        (
            ("time,joint1", "0,1", "1,nan"),
            "torques.csv: line 3, column 'joint1': expected a number within 1e+30 of 0, got nan; a torque "
            "has to be known throughout.",
        ),
        (("time,joint1", "0,1"), "torques.csv: expected two rows of torques or more, got 1."),
        (
            ("time,joint1", "0,0", "1,0"),
            "torques.csv: expected torques that act, got zeros alone, which say nothing of masses; leave the "
            "log out.",
        ),
    ],
)
def test_a_log_that_cannot_be_used_is_refused(tmp_path: Path, lines: tuple[str, ...], message: str) -> None:
    with refuses(VideoError, message):
        read_torques(written(tmp_path, *lines), JOINTS)
