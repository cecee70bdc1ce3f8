"""The run folder: nothing that is not ours is touched, and an old run stays until the new one is whole."""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from monodyn.errors import SettingsError
from monodyn.results import folder as folder_module
from monodyn.results import swap
from monodyn.results.controlled import CONTROL
from monodyn.results.folder import RECORDING, RUN, FolderKind, RunFolder, recover
from monodyn.results.lock import LOCK
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
    folder.close()
    assert contents(tmp_path) == {"poses.csv": "new", "mine.txt": "mine"}


def contents(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir() if path.is_file()}


def no_step(one: Path, other: Path) -> None:
    raise OSError(errno.ENOSYS, "Function not implemented")


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_a_swap_that_is_stopped_before_its_step_leaves_the_old_run_whole(
    error: type[BaseException], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = {"poses.csv": "old", "overlay.mp4": "old", "mine.txt": "mine"}
    for name, text in old.items():
        (tmp_path / name).write_text(text)
    folder = RunFolder(tmp_path, force=True)
    folder.write_text("poses.csv", "new")
    folder.write_text("run.json", "new")

    def stopped(*_: object) -> None:
        raise error

    # an error leads to the other way, which begins with a folder of its own
    monkeypatch.setattr(swap, "exchange", stopped)
    monkeypatch.setattr(swap, "_move", stopped)
    with pytest.raises(SettingsError if error is OSError else error):
        folder.finish()
    folder.close()
    assert contents(tmp_path) == old
    assert [path.name for path in tmp_path.iterdir() if path.is_dir()] == ["unfinished"]
    assert contents(tmp_path / "unfinished") == {"poses.csv": "new", "run.json": "new"}
    assert (folder.finished, folder.stage) == (False, tmp_path / "unfinished")
    assert not list(tmp_path.parent.glob(f".{tmp_path.name}*"))


def test_a_swap_that_is_stopped_after_its_step_is_complete(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "poses.csv").write_text("old")
    (tmp_path / "mine.txt").write_text("mine")
    folder = RunFolder(tmp_path, force=True)
    folder.write_text("run.json", "new")
    carry, calls = swap._carry_over, []

    def stopped(real: Path) -> None:
        calls.append(real)
        if len(calls) == 1:
            raise KeyboardInterrupt
        carry(real)

    monkeypatch.setattr(swap, "_carry_over", stopped)
    with pytest.raises(KeyboardInterrupt):
        folder.finish()
    assert (folder.finished, folder.stage) == (True, tmp_path)
    folder.close()
    assert contents(tmp_path) == {"run.json": "new", "mine.txt": "mine"}


@pytest.mark.parametrize("stays", ["no step", "working folder"])
def test_a_folder_that_has_to_stay_gets_the_files_one_by_one(
    stays: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if stays == "no step":
        monkeypatch.setattr(swap, "exchange", no_step)
    else:
        monkeypatch.chdir(tmp_path)
    (tmp_path / "poses.csv").write_text("old")
    (tmp_path / "mine.txt").write_text("mine")
    before = tmp_path.stat().st_ino
    folder = RunFolder(tmp_path, force=True)
    folder.write_text("run.json", "new")
    folder.finish()
    folder.close()
    assert contents(tmp_path) == {"run.json": "new", "mine.txt": "mine"}
    assert (tmp_path.stat().st_ino, len(list(tmp_path.iterdir()))) == (before, 2)


@pytest.mark.parametrize("moved", range(5))
def test_files_that_were_moved_one_by_one_are_settled_by_whoever_reads_them(
    moved: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = {"poses.csv": "old", "overlay.mp4": "old"}
    for name, text in old.items():
        (tmp_path / name).write_text(text)
    folder = RunFolder(tmp_path, force=True)
    folder.write_text("poses.csv", "new")
    folder.write_text("run.json", "new")
    move, moves = os.replace, []

    def killed(source: Path, target: Path) -> None:
        if len(moves) >= moved:
            raise OSError(errno.EIO, "Input/output error")
        moves.append(source)
        move(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(swap, "exchange", no_step)
        patch.setattr(os, "replace", killed)
        # nothing can be undone either
        patch.setattr(folder_module, "settle", lambda _: None)
        if moved < 4:
            with pytest.raises(SettingsError):
                folder.finish()
        else:
            folder.finish()
        folder.close()
    recover(tmp_path)
    assert contents(tmp_path) == (old if moved < 2 else {"poses.csv": "new", "run.json": "new"})
    assert not list(tmp_path.glob(".monodyn*"))


def test_what_an_interrupted_run_left_is_kept_and_named(tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text("old")
    (tmp_path / "unfinished").mkdir()
    for name in ("fit.json", ".poses.csv.part"):
        (tmp_path / "unfinished" / name).write_text("interrupted")
    folder = RunFolder(tmp_path, force=True)
    assert list((tmp_path / "unfinished").iterdir()) == []
    kept = tmp_path / "unfinished_1"
    assert contents(kept) == {"fit.json": "interrupted", ".poses.csv.part": "interrupted"}
    assert folder.notes == [f"What a run that was stopped before had written is kept in '{kept}'."]
    folder.write_text("fit.json", "new")
    folder.finish()
    folder.close()
    assert contents(kept)["fit.json"] == "interrupted"


def test_what_was_recorded_of_a_stream_is_kept(tmp_path: Path) -> None:
    (tmp_path / RECORDING).write_text("half a film")
    (tmp_path / "recording.mp4").write_text("mine")
    folder = RunFolder(tmp_path)
    folder.close()
    assert contents(tmp_path / "unfinished_1") == {"recording.mp4": "half a film"}
    assert contents(tmp_path) == {"recording.mp4": "mine"}


def test_a_folder_of_somebody_else_is_not_taken_for_a_run(tmp_path: Path) -> None:
    (tmp_path / "unfinished").mkdir()
    (tmp_path / "unfinished" / "symphony.txt").write_text("mine")
    folder = RunFolder(tmp_path)
    folder.close()
    assert folder.notes == []
    assert contents(tmp_path / "unfinished") == {"symphony.txt": "mine"}


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")
def test_a_run_that_is_killed_while_it_replaces_another_leaves_one_of_them() -> None:
    script = Path(__file__).parents[2] / "benchmarks" / "killed.py"
    for words in (("swap", "--every", "17"), ("recovery", "--every", "61")):
        done = subprocess.run([sys.executable, script, *words], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
def test_of_two_runs_at_once_one_is_done_and_the_other_told_of_it() -> None:
    script = Path(__file__).parents[2] / "benchmarks" / "killed.py"
    done = subprocess.run(
        [sys.executable, script, "together", "--rounds", "4"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    # both orders of the two runs, into a new folder and over an old one: none waits until the other is done
    assert re.search(r"^ *[1-4] second refused at once, its holder named$", done.stdout, re.MULTILINE)


DAMAGED = ("", "\0\0\0\0", "{}", "[1]", '["../mine.txt"]', "[\xff")


def between(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    """Kill a process right after the step; return the folder and the one that gave it its name."""
    path = tmp_path / "run"
    path.mkdir()
    for name, text in {"poses.csv": "old", "overlay.mp4": "old", "mine.txt": "mine"}.items():
        (path / name).write_text(text)
    folder = RunFolder(path, force=True)
    folder.write_text("poses.csv", "new")
    with monkeypatch.context() as patch:
        patch.setattr(swap, "_carry_over", lambda _: None)
        folder.finish()
    folder.close()
    return path, tmp_path / ".run.replacing"


@pytest.mark.parametrize("text", DAMAGED)
def test_a_list_that_is_damaged_is_named_and_nothing_lost(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, beside = between(tmp_path, monkeypatch)
    (path / swap.NEW).write_bytes(text.encode("latin-1"))
    (tmp_path / "mine.txt").write_text("outside")
    said = (
        f"'{path / swap.NEW}': expected the list of the files of the run that was replaced, got a file that "
        f"is damaged; these files are in '{beside}': move what you need of them elsewhere, then remove both."
    )
    for _ in range(2):
        with refuses(SettingsError, said):
            RunFolder(path, force=True)
    # whoever only reads is not kept from it
    recover(path)
    assert not (path / "mine.txt").is_symlink()
    assert {"poses.csv": "old", "overlay.mp4": "old"}.items() <= contents(beside).items()
    assert (tmp_path / "mine.txt").read_text() == "outside"
    # what is to be done helps
    (path / swap.NEW).unlink()
    assert contents(path) == {"poses.csv": "new", "mine.txt": "mine"}
    beside.rename(tmp_path / "elsewhere")
    RunFolder(path, force=True).close()
    assert contents(path) == {"poses.csv": "new", "mine.txt": "mine"}


def test_a_list_of_which_all_is_done_need_not_be_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, beside = between(tmp_path, monkeypatch)
    recover(path)
    assert not beside.exists()
    (path / swap.NEW).write_text("")
    RunFolder(path, force=True).close()
    assert contents(path) == {"poses.csv": "new", "mine.txt": "mine"}


@pytest.mark.parametrize("link", [False, True])
def test_the_root_of_a_disk_is_refused(link: bool, tmp_path: Path) -> None:
    root = Path(tmp_path.anchor)
    if link:
        (tmp_path / "link").symlink_to(root)
        root = tmp_path / "link"
    said = f"out '{root}': expected a folder with a name, got the root of a disk; give another with --out."
    with refuses(SettingsError, said):
        RunFolder(root)
    assert not swap.is_unsettled(root)
    swap.settle(root)
    recover(root)


def test_files_are_named_in_the_order_of_their_kind(tmp_path: Path) -> None:
    """Not in that in which they were done: one of them may be written beside the others."""
    for number, names in enumerate(
        (("overlay.mp4", "fit.json", "poses.csv"), ("fit.json", "poses.csv", "overlay.mp4"))
    ):
        folder = RunFolder(tmp_path / str(number))
        for name in names:
            folder.write_text(name, "new")
        folder.close()
        assert folder.written == ["poses.csv", "fit.json", "overlay.mp4"]


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
    assert [path.name for path in (tmp_path / "run").iterdir()] == [LOCK]
    folder.close()
    assert not (tmp_path / "run").exists()


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

    monkeypatch.setattr(swap, "exchange", fail)
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
