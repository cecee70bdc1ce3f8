"""One writer a folder: a locked file in it says whose it is, and the system unlocks it when its process ends.

What keeps others out is the lock, not the file: the file of a process that died is taken over.
"""

from __future__ import annotations

import errno
import json
import os
import shlex
import socket
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from monodyn.errors import SettingsError

LOCK = ".monodyn.lock"
"""Name of the file; it is there while somebody writes to its folder."""
SKIPPED = b" "
"""What the file begins with: on Windows nobody else can read the byte that is locked."""
LONGEST = 80
"""Characters of a command that are shown."""
WITHOUT = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP)
"""What file systems say that have no locks: there nobody is kept out."""
NOT_A_LINK = getattr(os, "O_NOFOLLOW", 0)
"""Opens no file to which a link leads, where the system knows how."""
TRIES = 100
"""How often the file may be removed by whoever had the folder before while it is being locked."""


class FolderLock:
    """The right to write to a folder, until it is given back or the process ends."""

    def __init__(self, folder: Path) -> None:
        """Lock a folder, which is made if need be, and note in it whose it is.

        Args:
            folder: The folder.

        Raises:
            SettingsError: somebody else writes to it.
            OSError: the folder, or the file in it, cannot be made.
        """
        self._folder, self._numbers = folder, []
        self.spread(folder)

    def spread(self, folder: Path) -> None:
        """Lock another folder as well, which is to take the name of this one.

        Args:
            folder: The other folder.

        Raises:
            SettingsError: somebody else writes to it.
            OSError: the file in it cannot be made.
        """
        tried = (_locked(folder) for _ in range(TRIES))
        number = next((number for number in tried if number is not None), None)
        if number is None:
            raise _in_use(folder)
        self._numbers.append(number)
        # where the disk is full whoever comes is refused all the same, without a name
        with suppress(OSError):
            os.ftruncate(number, 0)
            os.write(number, SKIPPED + json.dumps(_ourselves()).encode())

    def release(self) -> None:
        """Give the folder back; the file goes with it."""
        numbers, self._numbers, file = self._numbers, [], self._folder / LOCK
        ours = any(_is_same(number, file) for number in numbers)
        # Windows removes no file that is open: neither ours, nor that of whoever comes in between
        if ours and sys.platform != "win32":
            file.unlink(missing_ok=True)
        for number in numbers:
            os.close(number)
        if ours and sys.platform == "win32":
            with suppress(OSError):
                file.unlink()


def _locked(folder: Path) -> int | None:
    """Return the descriptor of the locked file; None where it was removed meanwhile."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / LOCK
    try:
        number = os.open(file, os.O_RDWR | os.O_CREAT | NOT_A_LINK, 0o666)
    except FileNotFoundError:
        # whoever gave the folder back has removed it, too, as it was empty
        return None
    except PermissionError as error:
        _remove_of_another(folder, error)
        return None
    kept = False
    try:
        _lock(number, folder)
        # the lock on a file that was removed keeps nobody out
        kept = _is_same(number, file)
    finally:
        if not kept:
            os.close(number)
    return number if kept else None


def _lock(number: int, folder: Path) -> None:
    """Lock an open file, unless somebody else has done it."""
    from filelock import lock_descriptor

    try:
        if not lock_descriptor(number, blocking=False):
            raise _in_use(folder)
    except OSError as error:
        if error.errno not in WITHOUT:
            raise


def _remove_of_another(folder: Path, refused: PermissionError) -> None:
    """Remove the file of another user, who may not be written to, where no process holds it any more."""
    file = folder / LOCK
    try:
        # a lock takes no right to write
        number = os.open(file, os.O_RDONLY | NOT_A_LINK)
    except FileNotFoundError:
        raise refused from None
    except PermissionError:
        raise _in_the_way(file) from refused
    try:
        _lock(number, folder)
        # whoever removes a file has locked it: what has the name now is this one still
        if _is_same(number, file):
            file.unlink(missing_ok=True)
    except PermissionError as error:
        # in a folder that cannot be written that is the reason, whatever is in it
        raise (_in_the_way(file) if error.errno == errno.EPERM else refused) from None
    finally:
        os.close(number)


def _in_the_way(file: Path) -> SettingsError:
    """Return the complaint about a file that belongs to another user."""
    whose = "another user"
    # a user may have been removed, and Windows names none
    with suppress(OSError, KeyError, NotImplementedError):
        whose = f"the user '{file.owner()}'"
    return SettingsError(
        f"out '{file.parent}': expected a folder that nothing else writes to, got one with the {LOCK} of "
        f"{whose}, which only they can remove; have it removed when their run has ended, or give another "
        "with --out."
    )


def _is_same(number: int, file: Path) -> bool:
    """Return whether a descriptor is that of the file which has a name now."""
    try:
        return os.path.samestat(os.fstat(number), file.stat())
    except FileNotFoundError:
        return False


def _ourselves() -> dict[str, Any]:
    """Return who writes, for whoever comes meanwhile."""
    return {
        "process": os.getpid(),
        "host": socket.gethostname(),
        "command": command_line(),
        "since": time.strftime("%Y-%m-%d %H:%M:%S"),
    }


def command_line() -> str:
    """Return the command line of this process."""
    return shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])


def _in_use(folder: Path) -> SettingsError:
    """Return the complaint that names who writes to a folder."""
    who = "another process"
    # it may be about to note it
    with suppress(OSError, ValueError, KeyError, TypeError):
        with (folder / LOCK).open("rb", buffering=0) as file:
            file.seek(len(SKIPPED))
            found = json.loads(file.read())
        command = found["command"] if len(found["command"]) <= LONGEST else f"{found['command'][:LONGEST]}..."
        where = "" if found["host"] == socket.gethostname() else f" of {found['host']}"
        who = f"process {found['process']}{where} since {found['since']} ({command})"
    return SettingsError(
        f"out '{folder}': expected a folder that nothing else writes to, got one in use by {who}; wait for "
        "its end, or give another with --out."
    )
