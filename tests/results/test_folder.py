"""The run folder: nothing that is not ours is touched, and an old run stays until the new one is whole."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from monodyn.errors import SettingsError
from monodyn.results.controlled import CONTROL
from monodyn.results.folder import RUN, FolderKind, RunFolder
from monodyn.results.predicted import PREDICTION
from support import refuses


def test_force_replaces_our_own_files_alone(tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text("old")
    (tmp_path / "overlay.mp4").write_text("old")
    (tmp_path / "mine.txt").write_text("mine")
    folder = RunFolder(tmp_path, force=True)
    folder.write_text("poses.csv", "new")
    assert (tmp_path / "poses.csv").read_text() == "old"
    folder.finish()
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {
        "poses.csv": "new",
        "mine.txt": "mine",
    }


@pytest.mark.parametrize("stop", range(4))
@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_a_swap_that_is_stopped_leaves_the_old_run_whole(
    stop: int, error: type[BaseException], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = {"poses.csv": "old", "overlay.mp4": "old"}
    for name, text in old.items():
        (tmp_path / name).write_text(text)
    folder = RunFolder(tmp_path, force=True)
    folder.write_text("poses.csv", "new")
    folder.write_text("run.json", "new")
    move, moves = os.replace, []

    def stopped(source: Path, target: Path) -> None:
        moves.append(source)
        if len(moves) == stop + 1:
            raise error
        move(source, target)

    monkeypatch.setattr(os, "replace", stopped)
    with pytest.raises(SettingsError if error is OSError else error):
        folder.finish()
    assert {path.name: path.read_text() for path in tmp_path.iterdir() if path.is_file()} == old
    assert {path.name for path in tmp_path.iterdir() if path.is_dir()} == {"unfinished"}
    kept = {path.name: path.read_text() for path in (tmp_path / "unfinished").iterdir()}
    assert kept == {"poses.csv": "new", "run.json": "new"}


def test_what_an_interrupted_run_left_does_not_get_into_the_next(tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text("old")
    (tmp_path / "unfinished").mkdir()
    for name in ("fit.json", ".poses.csv.part"):
        (tmp_path / "unfinished" / name).write_text("interrupted")
    RunFolder(tmp_path, force=True)
    assert list((tmp_path / "unfinished").iterdir()) == []


OTHER = FolderKind("experiment", ("page.html",), whole=True)


def test_an_empty_name_is_refused() -> None:
    said = "out: expected the name of a folder, got an empty one; give one with --out."
    with refuses(SettingsError, said):
        RunFolder("")


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    said = f"out '{tmp_path / 'file'}': expected a folder, got a file; give another name."
    with refuses(SettingsError, said):
        RunFolder(tmp_path / "file")


def test_a_folder_that_holds_a_run_is_refused(tmp_path: Path) -> None:
    (tmp_path / "fit.json").write_text("old")
    said = (
        f"out '{tmp_path}': expected a folder without a run, it holds fit.json; "
        "give another folder, or --force to replace the run."
    )
    with refuses(SettingsError, said):
        RunFolder(tmp_path)
    other = tmp_path / "other"
    other.mkdir()
    (other / "page.html").write_text("old")
    said = (
        f"out '{other}': expected a folder without an experiment, it holds page.html; "
        "give another folder, or --force to replace the experiment."
    )
    with refuses(SettingsError, said):
        RunFolder(other, kind=OTHER)


@pytest.mark.parametrize(
    ("kind", "word", "sign"),
    [
        (CONTROL, "run", "fit.json"), (CONTROL, "prediction", "prediction.json"),
        (PREDICTION, "run", "run.json"), (PREDICTION, "controller", "control.json"),
        (RUN, "controller", "control.json"), (RUN, "prediction", "prediction.json"),
        (OTHER, "run", "fit.json"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("force", [False, True])
def test_a_result_of_another_kind_is_never_replaced(
    tmp_path: Path, kind: FolderKind, word: str, sign: str, force: bool
) -> None:
    """They share model.xml and prediction.csv, which a swap would take from the other."""
    files = [sign, "model.xml", "prediction.csv"]
    for name in files:
        (tmp_path / name).write_text("old")
    said = (
        f"out '{tmp_path}': expected a folder without a {word}, it holds {sign}; give another folder with "
        "--out."
    )
    with refuses(SettingsError, said):
        RunFolder(tmp_path, force=force, kind=kind)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(files)


def test_an_input_is_never_replaced(tmp_path: Path) -> None:
    model = tmp_path / "model.xml"
    model.write_text("given")
    said = (
        f"out '{tmp_path}': expected another folder than that of the inputs, got the one of '{model}', "
        "which the run would replace; give another with --out."
    )
    with refuses(SettingsError, said):
        RunFolder(tmp_path, force=True, inputs=(model, None, "double"))
    assert model.read_text() == "given"


@pytest.mark.parametrize(
    ("number", "cure"), [(errno.ENOSPC, "free some space or give"), (errno.EACCES, "give")]
)
def test_a_file_that_cannot_be_written_leaves_nothing(tmp_path: Path, number: int, cure: str) -> None:
    def fail(path: Path) -> None:
        path.write_text("half a f")
        raise OSError(number, os.strerror(number))

    folder = RunFolder(tmp_path / "run")
    said = (
        f"out '{tmp_path / 'run'}': cannot write fit.json ({os.strerror(number)}); {cure} another folder "
        "with --out."
    )
    with refuses(SettingsError, said):
        folder.write("fit.json", fail)
    assert list((tmp_path / "run").iterdir()) == []


def test_a_folder_that_cannot_be_made_says_why(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    out = tmp_path / "file" / "run"
    said = f"out '{out}': cannot create the folder (Not a directory); give another folder with --out."
    with refuses(SettingsError, said):
        RunFolder(out)


def test_an_old_run_that_cannot_be_moved_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "fit.json").write_text("old")
    folder = RunFolder(tmp_path, force=True)
    folder.write_text("fit.json", "new")

    def fail(source: Path, target: Path) -> None:
        raise OSError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(os, "replace", fail)
    said = (
        f"out '{tmp_path}': cannot replace the old run (Permission denied); give another folder with --out."
    )
    with refuses(SettingsError, said):
        folder.finish()
    assert (tmp_path / "fit.json").read_text() == "old"


def stop(path: Path) -> None:
    """Write half of a file and be interrupted."""
    path.write_text("half a f")
    raise KeyboardInterrupt


def test_a_whole_kind_comes_to_its_names_at_once(tmp_path: Path) -> None:
    out = tmp_path / "new"
    folder = RunFolder(out, kind=OTHER)
    with folder.filling():
        folder.write_text("page.html", "text")
        assert not (out / "page.html").exists()
    assert {path.name for path in out.iterdir()} == {"page.html"}
    broken = RunFolder(tmp_path / "broken", kind=OTHER)
    with pytest.raises(KeyboardInterrupt), broken.filling():
        broken.write("page.html", stop)
    assert not (tmp_path / "broken").exists()


def test_only_files_of_the_kind_are_written(tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match=r"^mine.txt is not among the files of this folder$"):
        RunFolder(tmp_path).write_text("mine.txt", "")
