"""Poses: which joints of which frames were measured, stretches of a record, a record as tables."""

import sys
from dataclasses import fields, replace

import numpy as np
import pytest

from monodyn.errors import SettingsError, VideoError
from monodyn.estimation.record.tables import read_poses, write_poses
from monodyn.paper.track import PaperPoses
from monodyn.types import Frame, Poses, TorqueLog
from support import refuses


def poses():
    position = np.arange(6.0).reshape(3, 2)
    position[1, 1] = np.nan
    joint_seen = np.array([[True, True], [True, False], [False, False]])
    covariance = np.tile(np.eye(2), (3, 1, 1))
    return Poses(
        ("a", "b"), np.arange(3), np.arange(3.0), position, covariance, joint_seen.all(axis=1),
        joint_seen=joint_seen,
    )  # fmt: skip


def long_record(count=8):
    """Return a record in which no field is as by default, and no two rows are alike."""
    rng = np.random.default_rng(5)
    roots = rng.normal(size=(count, 2, 2))
    joint_seen = np.arange(2 * count).reshape(count, 2) % 5 > 0
    log = TorqueLog(("b",), np.array([0.0, 9.0]), np.array([[1.0], [2.0]]))
    return Poses(
        ("a", "b"), 3 + np.arange(count), 0.5 + np.arange(count) / 30, rng.normal(size=(count, 2)),
        np.einsum("fij,fkj->fik", roots, roots), joint_seen.all(axis=1), False, joint_seen, 0.1,
        rng.normal(size=(3, count, 2)), log, True,
    )  # fmt: skip


def test_a_joint_of_a_frame_counts_by_itself():
    found = poses()
    np.testing.assert_array_equal(found.measured, found.joint_seen)
    np.testing.assert_array_equal(found[1:3].measured, found.measured[1:])
    alone = replace(found, joint_seen=None)
    np.testing.assert_array_equal(alone.measured, [[True, True], [False, False], [False, False]])


def test_frames_and_joints_that_contradict_each_other():
    with refuses(
        VideoError,
        "Poses.seen: expected the frames in which every joint was seen, got others; change 'joint_seen' too.",
    ):
        replace(poses(), seen=np.ones(3, dtype=bool))


@pytest.mark.parametrize("rows", [slice(2, 5), slice(None, -3), slice(6, 99), slice(1, None, 3), slice(4, 4)])
def test_a_stretch_has_all_that_belongs_to_its_rows(rows):
    record = long_record()
    part = record[rows]
    by_row = {"frame", "time", "position", "covariance", "seen", "joint_seen"}
    for one in fields(Poses):
        whole, cut = getattr(record, one.name), getattr(part, one.name)
        if one.name in by_row:
            np.testing.assert_array_equal(cut, whole[rows], err_msg=one.name)
        elif one.name == "shifts":
            np.testing.assert_array_equal(cut, whole[:, rows])
        else:
            # a field that is added to a record is cut, or is the same: this says which
            assert cut is whole, one.name
    assert len(part) == len(np.arange(8)[rows])


def test_a_stretch_of_the_published_method_keeps_what_it_cost():
    record = long_record()
    values = {one.name: getattr(record, one.name) for one in fields(Poses)}
    part = PaperPoses(**values, evaluations=np.arange(8))[2:5]
    assert isinstance(part, PaperPoses)
    np.testing.assert_array_equal(part.evaluations, [2, 3, 4])


@pytest.mark.parametrize(
    ("asked", "shown"),
    [
        (3, "3"),
        (slice(5, 2, -1), "5:2:-1"),
        (slice(None, None, 0), "::0"),
        (slice(0.5, 2), "0.5:2:"),
        ("a", "a"),
        (np.ones(90, dtype=bool), "a value of type ndarray"),
    ],
)
def test_rows_are_cut_in_the_order_of_time_alone(asked, shown):
    with refuses(
        VideoError,
        f"Poses: expected rows in the order of time, such as poses[40:80], got poses[{shown}]; a single one "
        "is poses[40:41].",
    ):
        poses()[asked]
    with pytest.raises(TypeError, match="not iterable"):
        iter(poses())


def test_a_table_of_pandas_is_that_of_the_file(tmp_path):
    pandas = pytest.importorskip("pandas")
    record = replace(long_record(), position=poses_without_a_cell(), cleared=False)
    write_poses(record, tmp_path / "poses.csv", shared=record.shifts)
    written = pandas.read_csv(tmp_path / "poses.csv")
    table = record.to_pandas()
    assert list(table.columns) == list(written.columns)
    assert table["seen"].dtype == bool
    # not every pandas reads a number to its last digit
    pandas.testing.assert_frame_equal(table.astype(float), written.astype(float), rtol=1e-14)
    # what a run has read back is the same table again
    again = read_poses(tmp_path / "poses.csv", record.joints).to_pandas()
    pandas.testing.assert_frame_equal(again.astype(float), table.astype(float), rtol=1e-14)


def poses_without_a_cell():
    position = long_record().position.copy()
    position[0, 0] = np.nan
    return position


def test_a_data_set_of_xarray_has_covariances_and_shared_errors():
    pytest.importorskip("xarray")
    record = long_record()
    found = record.to_xarray()
    assert dict(found.sizes) == {"time": 8, "joint": 2, "other_joint": 2, "direction": 3}
    np.testing.assert_array_equal(
        found["covariance"].sel(joint="a", other_joint="b"), record.covariance[:, 0, 1]
    )
    np.testing.assert_array_equal(found["shared"].sel(joint="b"), record.shifts[:, :, 1])
    np.testing.assert_array_equal(found["seen"], record.measured)
    np.testing.assert_array_equal(found["frame"], record.frame)
    np.testing.assert_array_equal(found["position"].sel(time=record.time[4]), record.position[4])
    assert "shared" not in replace(record, shifts=None).to_xarray()


@pytest.mark.parametrize(("verb", "package"), [("to_pandas", "pandas"), ("to_xarray", "xarray")])
def test_without_the_package_one_line_says_how_to_get_it(verb, package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    with refuses(
        SettingsError,
        f"{verb}: expected the package '{package}', which is not installed; install it with pip install "
        "'monodyn[tables]'.",
    ):
        getattr(poses(), verb)()


def test_a_record_says_in_one_line_what_it_is():
    assert repr(long_record()) == "<Poses of a, b: 8 frames, 0.50 to 0.73 s, 4 seen>"
    assert repr(long_record()[:1]) == "<Poses of a, b: 1 frame, 0.50 to 0.50 s, 0 seen>"
    assert repr(long_record()[:0]) == "<Poses of a, b: 0 frames, no time, 0 seen>"
    assert repr(long_record().torques) == "<TorqueLog of b: 2 rows, 0.00 to 9.00 s>"
    many = tuple("abcde")
    none = Poses(many, np.arange(0), np.zeros(0), np.zeros((0, 5)), np.zeros((0, 5, 5)), np.zeros(0, bool))
    assert repr(none) == "<Poses of 5 joints: 0 frames, no time, 0 seen>"


def test_a_notebook_shows_a_record_by_joint():
    found = poses()._repr_html_()
    assert "<b>Poses of a, b: 3 frames, 0.00 to 2.00 s, 1 seen</b>" in found
    assert found.count("<tr>") == 3
    # one joint was measured in two frames, the other in one
    assert ">2</td>" in found
    assert ">1</td>" in found
    assert replace(poses(), joints=("<a>", "b"))._repr_html_().count("&lt;a&gt;") == 2
    assert "–" in replace(poses(), position=np.full((3, 2), np.nan))._repr_html_()


def test_a_frame_that_is_no_picture_is_refused():
    grey = np.zeros((48, 64), np.uint8)
    for given, message in (
        (("x", 0.0, grey), "Frame: expected index to be a whole number, got 'x'; give another."),
        ((0, "x", grey), "Frame: expected time to be a number, got 'x'; give another."),
        ((0, 0.0, "x"), "Frame: expected luma to be ndarray, got 'x'; give another."),
    ):
        with refuses(SettingsError, message):
            Frame(*given)
    with refuses(VideoError, "Frame.time: expected a finite time stamp, got nan; give another."):
        Frame(0, np.nan, grey)
    for luma in (grey[None], grey / 2):
        kind, shape = luma.dtype, luma.shape
        with refuses(
            VideoError,
            f"Frame.luma: expected a uint8 array (row, column), got {kind} {shape}; give another.",
        ):
            Frame(0, 0.0, luma)
    for luma, chroma, name, got in (
        ([[1, 2]], None, "luma", "a value of type list"),
        (grey, (grey[0], grey), "chroma", "uint8 (64,)"),
    ):
        with refuses(
            VideoError, f"Frame.{name}: expected a uint8 array (row, column), got {got}; give another."
        ):
            Frame(0, 0.0, luma, chroma)


@pytest.mark.parametrize("roll", [np.inf, -np.inf, np.nan, 1e308, 90.0])
def test_a_roll_is_an_angle(roll):
    with refuses(
        VideoError,
        f"Poses.roll: expected an angle within a turn [rad], got {roll:g}; give it in radians.",
    ):
        replace(poses(), roll=roll)


def test_rows_are_as_far_apart_as_a_clock_shows():
    record = poses()
    with refuses(
        VideoError,
        "Poses.time: expected rows 1e-09 s apart or more, got two with "
        f"{np.diff(1e-12 * record.time).min():g} s between them; give the times in seconds.",
    ):
        replace(record, time=1e-12 * record.time)
    with refuses(
        VideoError,
        "TorqueLog.time: expected times within 1e+30 s of 0, got 1e+31; give them in seconds.",
    ):
        TorqueLog(("a",), np.array([0.0, 1e31]), np.ones((2, 1)))


@pytest.mark.parametrize("wrong", [np.array(1.0), np.float64(np.nan)])
@pytest.mark.parametrize("name", ["time", "joints", "frame"])
def test_a_number_is_no_list(name, wrong):
    shown = "an array of shape () and type float64" if isinstance(wrong, np.ndarray) else repr(wrong)
    what = "tuple of a text" if name == "joints" else "ndarray"
    with refuses(SettingsError, f"Poses: expected {name} to be {what}, got {shown}; give another."):
        replace(poses(), **{name: wrong})


def test_a_frame_number_is_a_number():
    with refuses(
        VideoError, "Poses.frame: expected an array of numbers, got a value of type ndarray; give another."
    ):
        replace(poses(), frame=np.full(len(poses()), np.nan))
