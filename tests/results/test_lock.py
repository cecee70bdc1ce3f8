"""One process writes to a folder; whoever comes meanwhile is told who, and a dead one keeps nobody out."""

from __future__ import annotations

import errno
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import filelock
import pytest

from monodyn.errors import SettingsError
from monodyn.results import lock as lock_module
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


NOBODY = 65534
"""The number of another user."""


@contextmanager
def another_user() -> Iterator[None]:
    """Be somebody who may not write to the files that were there before."""
    os.seteuid(NOBODY)
    try:
        yield
    finally:
        os.seteuid(0)


@pytest.fixture
def shared() -> Iterator[Path]:
    """Make a folder to which everybody may write; those of the tests are their owner's alone."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o777)
        yield Path(folder)


by_root = pytest.mark.skipif(getattr(os, "geteuid", lambda: 1)() != 0, reason="needs two users")


@by_root
def test_another_user_is_named_and_what_they_left_is_taken_over(shared: Path) -> None:
    lock = FolderLock(shared)
    since = owner(shared)["since"]
    command = lock_module.command_line()
    command = command if len(command) <= lock_module.LONGEST else f"{command[: lock_module.LONGEST]}..."
    with (
        refuses(
            SettingsError,
            f"out '{shared}': expected a folder that nothing else writes to, got one in use by process "
            f"{os.getpid()} since {since} ({command}); wait for its end, or give another with --out.",
        ),
        another_user(),
    ):
        FolderLock(shared)
    # as after SIGKILL: the file is there, and nobody has locked it
    left = (shared / LOCK).read_bytes()
    lock.release()
    (shared / LOCK).write_bytes(left)
    with another_user():
        lock = FolderLock(shared)
        assert (shared / LOCK).stat().st_uid == NOBODY
        lock.release()
    assert list(shared.iterdir()) == []


@by_root
@pytest.mark.parametrize(("folder", "file"), [(0o1777, 0o644), (0o777, 0o600)])
def test_what_another_user_alone_can_remove_is_named(folder: int, file: int, shared: Path) -> None:
    (shared / LOCK).write_bytes(b" {}")
    (shared / LOCK).chmod(file)
    shared.chmod(folder)
    said = (
        f"out '{shared}': expected a folder that nothing else writes to, got one with the .monodyn.lock of "
        "the user 'root', which only they can remove; have it removed when their run has ended, or give "
        "another with --out."
    )
    with refuses(SettingsError, said), another_user():
        FolderLock(shared)


@by_root
def test_a_user_without_a_name_is_another_user(shared: Path) -> None:
    (shared / LOCK).write_bytes(b" {}")
    (shared / LOCK).chmod(0o600)
    os.chown(shared / LOCK, 4242, -1)
    said = (
        f"out '{shared}': expected a folder that nothing else writes to, got one with the .monodyn.lock of "
        "another user, which only they can remove; have it removed when their run has ended, or give "
        "another with --out."
    )
    with refuses(SettingsError, said), another_user():
        FolderLock(shared)


@by_root
@pytest.mark.parametrize("left", [False, True])
def test_a_folder_of_another_user_cannot_be_written(left: bool, shared: Path) -> None:
    if left:
        (shared / LOCK).write_bytes(b" {}")
    shared.chmod(0o755)
    said = f"out '{shared}': cannot create the folder (Permission denied); give another folder with --out."
    with refuses(SettingsError, said), another_user():
        RunFolder(shared)


@pytest.mark.parametrize("held", [False, True])
def test_a_lock_needs_no_right_to_write(held: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As for another user, where there is only one."""
    other = FolderLock(tmp_path)
    if not held:
        left = (tmp_path / LOCK).read_bytes()
        other.release()
        (tmp_path / LOCK).write_bytes(left)
    usual, there = os.open, (tmp_path / LOCK).stat()

    def refused(path: object, flags: int, mode: int = 0o777) -> int:
        with suppress(FileNotFoundError):
            if flags & os.O_RDWR and os.path.samestat((tmp_path / LOCK).stat(), there):
                raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return usual(path, flags, mode)  # type: ignore[arg-type]

    monkeypatch.setattr(os, "open", refused)
    if held:
        with pytest.raises(SettingsError, match=f"in use by process {os.getpid()} since"):
            FolderLock(tmp_path)
    else:
        FolderLock(tmp_path).release()
        assert not (tmp_path / LOCK).exists()
