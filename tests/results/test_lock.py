"""One process writes to a folder; whoever comes meanwhile is told who, and a dead one keeps nobody out."""

from __future__ import annotations

import errno
import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import filelock
import pytest

from monodyn.errors import SettingsError
from monodyn.results.folder import RunFolder
from monodyn.results.lock import LOCK, FolderLock
from support import refuses

HELD = """
import sys, time
from pathlib import Path
from monodyn.results.folder import RunFolder
folder = RunFolder(sys.argv[1], force=True)
print(flush=True)
time.sleep(60.0)
"""


def owner(path: Path) -> dict:
    return json.loads((path / LOCK).read_bytes()[1:])


def test_a_second_run_in_the_same_folder_is_told_who_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["/usr/bin/monodyn", "run", "my clip.mp4"])
    path = tmp_path / "run"
    folder = RunFolder(path)
    since = owner(path)["since"]
    said = (
        f"out '{path}': expected a folder that nothing else writes to, got one in use by process "
        f"{os.getpid()} since {since} (monodyn run 'my clip.mp4'); wait for its end, or give another with "
        "--out."
    )
    for force in (False, True):
        with refuses(SettingsError, said):
            RunFolder(path, force=force)
    # by another name it is the same folder
    (tmp_path / "link").symlink_to(path)
    with pytest.raises(SettingsError, match="in use by process"):
        RunFolder(tmp_path / "link")
    folder.close()
    assert not path.exists()
    RunFolder(path).close()


def test_another_machine_is_named_and_a_long_command_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["monodyn", "x" * 100])
    lock = FolderLock(tmp_path)
    said, since = f"monodyn {'x' * 72}", owner(tmp_path)["since"]
    with refuses(
        SettingsError,
        f"out '{tmp_path}': expected a folder that nothing else writes to, got one in use by process "
        f"{os.getpid()} since {since} ({said}...); wait for its end, or give another with --out.",
    ):
        FolderLock(tmp_path)
    here = socket.gethostname()
    monkeypatch.setattr(socket, "gethostname", lambda: "elsewhere")
    with refuses(
        SettingsError,
        f"out '{tmp_path}': expected a folder that nothing else writes to, got one in use by process "
        f"{os.getpid()} of {here} since {since} ({said}...); wait for its end, or give another with --out.",
    ):
        FolderLock(tmp_path)
    lock.release()


def test_who_has_not_noted_it_yet_keeps_others_out_as_well(tmp_path: Path) -> None:
    lock = FolderLock(tmp_path)
    (tmp_path / LOCK).write_bytes(b"")
    said = (
        f"out '{tmp_path}': expected a folder that nothing else writes to, got one in use by another "
        "process; wait for its end, or give another with --out."
    )
    with refuses(SettingsError, said):
        FolderLock(tmp_path)
    lock.release()


def test_a_run_keeps_its_folder_while_the_folder_is_exchanged(tmp_path: Path) -> None:
    path = tmp_path / "run"
    path.mkdir()
    (path / "fit.json").write_text("old")
    folder = RunFolder(path, force=True)
    folder.write_text("fit.json", "new")
    folder.finish()
    assert [place.name for place in tmp_path.iterdir()] == ["run"]
    with pytest.raises(SettingsError, match="in use by process"):
        RunFolder(path, force=True)
    folder.close()
    assert [place.name for place in path.iterdir()] == ["fit.json"]


def test_a_lock_that_was_given_back_leaves_that_of_another_alone(tmp_path: Path) -> None:
    first = FolderLock(tmp_path)
    (tmp_path / LOCK).rename(tmp_path / "moved")
    second = FolderLock(tmp_path)
    first.release()
    assert (tmp_path / LOCK).exists()
    second.release()
    second.release()
    assert not (tmp_path / LOCK).exists()


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.ENOLCK, errno.EIO])
def test_where_the_file_system_has_no_locks_a_run_goes_on(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> bool:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(filelock, "lock_descriptor", fail)
    if number == errno.EIO:
        with pytest.raises(SettingsError, match="cannot create the folder"):
            RunFolder(tmp_path / "run")
    else:
        RunFolder(tmp_path / "run").close()
        assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="sends SIGKILL")
def test_what_a_dead_process_held_is_taken_over(tmp_path: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", HELD, str(tmp_path / "run")], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        with pytest.raises(SettingsError, match=f"in use by process {process.pid} since"):
            RunFolder(tmp_path / "run")
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert owner(tmp_path / "run")["process"] == process.pid
    folder = RunFolder(tmp_path / "run")
    assert owner(tmp_path / "run")["process"] == os.getpid()
    folder.close()
