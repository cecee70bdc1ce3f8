"""Tracked points in HDF5.

The files in ``data`` are made by the libraries that write them, with made-up numbers, and packed:
``deeplabcut*`` by pandas 2.2.3 as DeepLabCut calls it (``DataFrame.to_hdf(..., key="df_with_missing",
format="table", mode="w")``, and ``to_csv``), ``sleap*`` by ``save_analysis_h5`` of sleap-io 0.9.5. Others are
written here, by h5py, in the layout that the readers expect.
"""

from __future__ import annotations

import gzip
import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.vision.points.read import read_points
from support import refuses
from tables import written

SCORER = "DLC_resnet50_pendulumApr1shuffle1_100000"
DATA = Path(__file__).parent / "data"


def unpacked(folder: Path, name: str) -> Path:
    pytest.importorskip("h5py")
    return written(folder, name, gzip.decompress((DATA / f"{name}.gz").read_bytes()))


def made_up(parts: int, frames: np.ndarray) -> np.ndarray:
    """Return the places in the files of ``data``, (frame, part, 2)."""
    offset = 10.0 * np.arange(parts)
    return np.stack([100.0 + offset + frames[:, None], 200.0 + offset + 0.5 * frames[:, None]], axis=2)


def test_what_pandas_writes_for_deeplabcut(tmp_path: Path) -> None:
    frames = np.arange(6)
    truth = made_up(2, frames)
    truth[3, 1] = np.nan
    likelihood = 0.99 - 0.01 * frames[:, None] - 0.1 * np.arange(2)
    likelihood[3, 1] = 0.0
    for path in (unpacked(tmp_path, "deeplabcut.h5"), DATA / "deeplabcut.csv"):
        found = read_points(path, rate=50.0)
        assert found.names == ("pivot", "tip")
        assert found.frame.tolist() == frames.tolist()
        assert np.array_equal(found.px, truth, equal_nan=True)
        np.testing.assert_allclose(found.likelihood, likelihood, atol=1e-12)


def test_what_pandas_writes_for_several_individuals(tmp_path: Path) -> None:
    found = read_points(unpacked(tmp_path, "deeplabcut_animals.h5"), rate=50.0)
    assert found.names == ("left.joint1", "left.tip", "right.joint1", "right.tip", "single.floor")
    assert np.array_equal(found.px, made_up(5, np.arange(6)))


def pandas_table(
    path: Path, columns: list[tuple[str, ...]], values: np.ndarray, axes: bytes | None = None
) -> Path:
    """Write what ``DataFrame.to_hdf(path, key="df_with_missing", format="table")`` writes."""
    h5py: Any = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        group = file.create_group("df_with_missing")
        group.attrs["pandas_type"] = np.bytes_(b"frame_table")
        group.attrs["non_index_axes"] = np.bytes_(pickle.dumps([(1, columns)], 0) if axes is None else axes)
        kind = np.dtype([("index", "<i8"), ("values_block_0", "<f8", (values.shape[1],))])
        rows = np.zeros(len(values), kind)
        rows["index"], rows["values_block_0"] = np.arange(len(values)), values
        group.create_dataset("table", data=rows)
    return path


COLUMNS = [(SCORER, part, what) for part in ("pivot", "tip") for what in ("x", "y", "likelihood")]
VALUES = np.array([[1.0, 2.0, 0.9, 3.0, 4.0, 0.8], [1.5, 2.5, 0.7, np.nan, np.nan, 0.0]])


def test_hdf5_of_deeplabcut(tmp_path: Path) -> None:
    found = read_points(pandas_table(tmp_path / "a.h5", COLUMNS, VALUES), rate=50.0)
    assert found.names == ("pivot", "tip")
    assert found.px[0].tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert found.likelihood.tolist() == [[0.9, 0.8], [0.7, 0.0]]


def test_a_frame_of_fixed_form_of_pandas(tmp_path: Path) -> None:
    h5py: Any = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("df_with_missing")
        group.attrs["pandas_type"], group.attrs["axis0_nlevels"] = np.bytes_(b"frame"), 3
        levels = [[SCORER], ["pivot", "tip"], ["likelihood", "x", "y"]]
        codes = [[0] * 6, [0, 0, 0, 1, 1, 1], [1, 2, 0, 1, 2, 0]]
        for i, (words, code) in enumerate(zip(levels, codes, strict=True)):
            group[f"axis0_level{i}"] = np.array([word.encode() for word in words])
            group[f"axis0_label{i}"] = np.array(code, np.int8)
        group["axis1"], group["block0_values"] = np.arange(2), VALUES
    assert read_points(path, rate=50.0).px[1, 0].tolist() == [1.5, 2.5]


def test_a_pickle_that_would_run_code_is_refused(tmp_path: Path) -> None:
    path = pandas_table(tmp_path / "a.h5", COLUMNS, VALUES, b"cos\nsystem\n(S'true'\ntR.")
    with refuses(
        VideoError,
        "a.h5: expected the names of the columns as plain words, got something else (os.system); give the "
        "CSV file that DeepLabCut writes next to it.",
    ):
        read_points(path, rate=50.0)


def analysis(path: Path, tracks: np.ndarray, names: list[bytes], scores: np.ndarray | None = None) -> Path:
    """Write what SLEAP writes: arrays (frame, node, 2, track) turned round."""
    h5py: Any = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file["node_names"] = names
        file["track_names"] = [b"track_0", b"track_1"][: tracks.shape[3]]
        file.create_dataset("tracks", data=np.transpose(tracks), compression="gzip")
        if scores is not None:
            file.create_dataset("point_scores", data=np.transpose(scores), compression="gzip")
    return path


def test_analysis_of_sleap(tmp_path: Path) -> None:
    tracks = np.arange(24.0).reshape(4, 3, 2, 1)
    scores = np.full((4, 3, 1), 0.7)
    scores[0, 0, 0] = np.nan
    found = read_points(analysis(tmp_path / "a.h5", tracks, [b"p", b"e", b"t"], scores), rate=50.0)
    assert found.names == ("p", "e", "t")
    assert np.array_equal(found.px, tracks[..., 0])
    # a label made by hand has no score and counts whole
    assert found.likelihood[0].tolist() == [1.0, 0.7, 0.7]


def test_tracks_of_sleap_that_follow_one_another_are_one(tmp_path: Path) -> None:
    tracks = np.full((4, 3, 2, 2), np.nan)
    tracks[:2, ..., 0], tracks[2:, ..., 1] = 1.0, 2.0
    found = read_points(analysis(tmp_path / "a.h5", tracks, [b"p", b"e", b"t"]), rate=50.0)
    assert found.px[:, 0, 0].tolist() == [1.0, 1.0, 2.0, 2.0]
    tracks[:, ..., 1] = 2.0
    both = read_points(analysis(tmp_path / "b.h5", tracks, [b"p", b"e", b"t"]), rate=50.0)
    assert both.names == ("track_0.p", "track_0.e", "track_0.t", "track_1.p", "track_1.e", "track_1.t")


def test_what_sleap_writes(tmp_path: Path) -> None:
    found = read_points(unpacked(tmp_path, "sleap.h5"), rate=50.0)
    truth = np.full((7, 3, 2), np.nan)
    # the labels begin at frame 2, and the tip of frame 4 is not found
    truth[2:] = made_up(3, np.arange(2, 7))
    truth[4, 2] = np.nan
    assert found.names == ("joint1", "joint2", "tip")
    assert np.array_equal(found.px, truth, equal_nan=True)
    # the first node's score is 1.04
    np.testing.assert_allclose(found.likelihood[3], [1.0, 0.87, 0.77])
    # two animals, whose axes are in either order
    both = read_points(unpacked(tmp_path, "sleap_tracks.h5"), rate=50.0)
    assert both.names == tuple(f"track_{i}.{node}" for i in range(2) for node in ("joint1", "joint2", "tip"))
    assert np.array_equal(both.px[:, :3], truth, equal_nan=True)
    assert np.array_equal(both.px[:, 3:], truth + 20.0, equal_nan=True)
    other = read_points(unpacked(tmp_path, "sleap_standard.h5"), rate=50.0)
    assert other.names == both.names
    assert np.array_equal(other.px, both.px, equal_nan=True)
    assert np.array_equal(other.likelihood, both.likelihood)


def test_scores_of_sleap_above_those_of_peaks_are_refused(tmp_path: Path) -> None:
    scores = np.full((4, 3, 1), 1.1)
    path = analysis(tmp_path / "a.h5", np.ones((4, 3, 2, 1)), [b"p", b"e", b"t"], scores)
    assert np.array_equal(read_points(path, rate=50.0).likelihood, np.ones((4, 3)))
    for wrong in (1.11, -0.01):
        scores[1, 1, 0] = wrong
        path = analysis(tmp_path / "b.h5", np.ones((4, 3, 2, 1)), [b"p", b"e", b"t"], scores)
        with refuses(
            VideoError,
            f"b.h5: expected likelihoods from 0 to 1, got {wrong:g}; scale them, and leave the places of "
            "points that were not found empty.",
        ):
            read_points(path, rate=50.0)


def test_other_hdf5_is_refused(tmp_path: Path) -> None:
    with refuses(
        VideoError,
        "a.h5: expected 'tracks' as (track, 2, 2, frame), got (1, 2, 3, 4); export the analysis HDF5 of "
        "SLEAP.",
    ):
        read_points(analysis(tmp_path / "a.h5", np.zeros((4, 3, 2, 1)), [b"p", b"q"]), rate=50.0)
    h5py: Any = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["numbers"] = np.arange(3)
    with refuses(
        VideoError,
        "b.h5: expected tracked points of DeepLabCut or an analysis file of SLEAP, got HDF5 with 'numbers'.",
    ):
        read_points(tmp_path / "b.h5", rate=50.0)


def test_hdf5_without_h5py(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    path = written(tmp_path, "a.h5", b"\x89HDF\r\n\x1a\n" + bytes(20))
    with refuses(
        VideoError,
        "a.h5: reading HDF5 needs the package h5py, which is not installed; pip install 'monodyn[hdf5]', or "
        "give the points as CSV.",
    ):
        read_points(path)


def test_damaged_hdf5(tmp_path: Path) -> None:
    h5py: Any = pytest.importorskip("h5py")
    path = pandas_table(tmp_path / "a.h5", COLUMNS, VALUES[:, :3])
    with refuses(
        VideoError,
        "a.h5: expected 6 columns of one kind of number, got 3 in the first block; give the CSV file that "
        "DeepLabCut writes next to it.",
    ):
        read_points(path, rate=50.0)
    with h5py.File(path, "a") as file:
        del file["df_with_missing"].attrs["non_index_axes"]
    with pytest.raises(VideoError) as found:
        read_points(path, rate=50.0)
    reason = str(found.value).split("points (", 1)[1].rsplit(");", 1)[0]
    with refuses(
        VideoError,
        f"a.h5: cannot be read as a table of points ({reason}); export it again, or as CSV.",
    ):
        read_points(path, rate=50.0)


def analysis_with(path: Path, **arrays: Any) -> Path:
    """Write an analysis file of two nodes in three frames, some of its arrays replaced."""
    h5py: Any = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file["node_names"] = [b"pivot", b"tip"]
        for name, array in ({"tracks": np.zeros((1, 2, 2, 3))} | arrays).items():
            file[name] = array
    return path


def test_arrays_that_are_no_table_of_points(tmp_path: Path) -> None:
    with refuses(VideoError, "a.h5: expected numbers in '/tracks', got complex128."):
        read_points(analysis_with(tmp_path / "a.h5", tracks=np.zeros((1, 2, 2, 3), complex)), rate=30.0)
    with refuses(
        VideoError,
        "b.h5: expected 'point_scores' as (track, node, frame), (1, 2, 3), got (3, 7); export the analysis "
        "HDF5 of SLEAP.",
    ):
        read_points(analysis_with(tmp_path / "b.h5", point_scores=np.ones((3, 7))), rate=30.0)


def test_arrays_in_other_files_and_too_large_ones(tmp_path: Path) -> None:
    h5py: Any = pytest.importorskip("h5py")
    (tmp_path / "other.bin").write_bytes(bytes(96))
    for name in ("external.h5", "linked.h5", "large.h5"):
        with h5py.File(tmp_path / name, "w") as file:
            file["node_names"] = [b"pivot", b"tip"]
            if name == "external.h5":
                places = [(str(tmp_path / "other.bin"), 0, 96)]
                file.create_dataset("tracks", (1, 2, 2, 3), "f8", external=places)
            elif name == "linked.h5":
                file["tracks"] = h5py.ExternalLink("external.h5", "/tracks")
            else:
                file.create_dataset("tracks", (1, 2, 2, 10**11), "f8", chunks=(1, 2, 2, 1000))
    for name, found in (("external.h5", "tracks"), ("linked.h5", "/")):
        with refuses(
            VideoError,
            f"{name}: expected all numbers in the file itself, got '{found}', which takes them from another "
            "one; export the points anew.",
        ):
            read_points(tmp_path / name, rate=30.0)
    with refuses(
        VideoError,
        "large.h5: expected arrays of up to 2 GB, got 'tracks' of 3.2e+03 GB; export the points of one clip "
        "alone.",
    ):
        read_points(tmp_path / "large.h5", rate=30.0)
