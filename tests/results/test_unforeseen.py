"""The traceback of an error that nobody foresaw: kept where the run was written, in nobody's way."""

from __future__ import annotations

import errno
import json
from pathlib import Path

import pytest

from monodyn.errors import FitError, SettingsError, is_unforeseen
from monodyn.results import unforeseen
from monodyn.results.controlled import CONTROL
from monodyn.results.folder import FILES, RUN, FolderKind, RunFolder
from monodyn.results.log import RunLog, recorded
from monodyn.results.predicted import PREDICTION
from monodyn.results.unforeseen import TRACEBACK

OTHER = FolderKind("experiment", ("page.html",), whole=True)


def run(
    path: Path,
    error: BaseException | None = None,
    files: tuple[str, ...] = ("poses.csv",),
    *,
    force: bool = False,
    kind: FolderKind = RUN,
) -> list[str]:
    """Write files as a run does, which an error ends; return what is noted."""
    folder, log = RunFolder(path, force=force, kind=kind), RunLog("run", {}, {})
    with folder.filling() if kind.whole else recorded(folder, log):
        for name in files:
            folder.write_text(name, "new")
        if error is not None:
            raise error
    return folder.notes


def fail(path: Path, files: tuple[str, ...] = ("poses.csv",), *, force: bool = False) -> ZeroDivisionError:
    """Have a run fail as nobody foresaw."""
    with pytest.raises(ZeroDivisionError) as found:
        run(path, ZeroDivisionError(), files, force=force)
    return found.value


def names(path: Path) -> list[str]:
    return sorted(place.name for place in path.iterdir())


def test_a_run_that_fails_has_it_next_to_its_files(tmp_path: Path) -> None:
    error = fail(tmp_path / "run")
    file = tmp_path / "run" / TRACEBACK
    assert error.__notes__ == [f"please report it to its makers with '{file}', which has the details."]
    assert unforeseen.where_sent(error) == error.__notes__[0]
    log = json.loads((tmp_path / "run" / "run.json").read_text())
    assert (log["status"], log["files"]) == ("failed", ["poses.csv", TRACEBACK])


def test_it_alone_is_in_nobody_s_way(tmp_path: Path) -> None:
    path = tmp_path / "run"
    fail(path, ())
    assert names(path) == [TRACEBACK]
    kept = path / "unfinished_1"
    assert run(path) == [f"What a run that was stopped before had written is kept in '{kept}'."]
    assert names(path) == ["poses.csv", "run.json", "unfinished_1"]
    assert names(kept) == [TRACEBACK]


def test_one_that_was_to_replace_a_run_leaves_that_run_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "fit.json").write_text("old")
    fail(tmp_path, force=True)
    assert names(tmp_path) == ["fit.json", "unfinished"]
    assert names(tmp_path / "unfinished") == [TRACEBACK, "poses.csv", "run.json"]


@pytest.mark.parametrize("name", [TRACEBACK, "error.log"])
@pytest.mark.parametrize("force", [False, True])
def test_a_file_of_that_name_is_never_replaced_or_removed(name: str, force: bool, tmp_path: Path) -> None:
    if force:
        (tmp_path / "fit.json").write_text("old")
    (tmp_path / name).write_text("mine")
    fail(tmp_path, force=force)
    run(tmp_path, force=True)
    assert "mine" in [file.read_text() for file in tmp_path.rglob(name)]
    # one that came meanwhile
    (tmp_path / TRACEBACK).write_text("late")
    assert not unforeseen.keep_traceback(ZeroDivisionError(), tmp_path)
    assert (tmp_path / TRACEBACK).read_text() == "late"


@pytest.mark.parametrize("kind", [PREDICTION, CONTROL, OTHER])
def test_what_is_written_as_a_whole_leaves_it_alone(kind: FolderKind, tmp_path: Path) -> None:
    out, file = tmp_path / "out", tmp_path / "out" / "unfinished" / TRACEBACK
    with pytest.raises(ZeroDivisionError) as found:
        run(out, ZeroDivisionError(), kind.files[:1], kind=kind)
    assert (names(out), names(file.parent)) == (["unfinished"], [TRACEBACK])
    assert str(file) in found.value.__notes__[0]
    run(out, None, kind.files[:1], kind=kind)
    assert names(out) == sorted([kind.files[0], "unfinished_1"])


def test_a_run_that_is_complete_has_no_such_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def finished(folder: RunFolder) -> None:
        folder.finished = True
        raise ZeroDivisionError

    monkeypatch.setattr(RunFolder, "finish", finished)
    with pytest.raises(ZeroDivisionError):
        run(tmp_path / "run")
    assert names(tmp_path / "run") == ["poses.csv", "run.json"]
    assert TRACEBACK not in FILES


@pytest.mark.parametrize(
    "error",
    [
        FitError("no"),
        SettingsError("no"),
        KeyboardInterrupt(),
        OSError(errno.ENOSPC, "Full"),
        FileNotFoundError(errno.ENOENT, "None", "x"),
        SystemExit(1),
    ],
)
def test_other_errors_have_none(error: BaseException, tmp_path: Path) -> None:
    assert not is_unforeseen(error)
    with pytest.raises(type(error)):
        run(tmp_path / "run", error)
    assert names(tmp_path / "run") == ["poses.csv", "run.json"]


def test_where_the_disk_is_full_no_half_of_it_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: object) -> str:
        raise OSError(errno.ENOSPC, "Full")

    monkeypatch.setattr(unforeseen, "traceback_text", full)
    error = ZeroDivisionError()
    assert not unforeseen.keep_traceback(error, tmp_path)
    assert (names(tmp_path), hasattr(error, "__notes__")) == ([], False)
