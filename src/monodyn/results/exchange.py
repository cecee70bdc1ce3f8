"""Two names exchanged in one indivisible step; what was written made to outlast a power failure."""

from __future__ import annotations

import ctypes
import errno
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

AT_FDCWD = -100
"""In place of a descriptor, on Linux: names begin in the working folder."""
EXCHANGE = 2
"""The flag of Linux (``RENAME_EXCHANGE``) and that of macOS (``RENAME_SWAP``)."""


def can_exchange() -> bool:
    """Return whether the system knows how, wherever it may be."""
    return _function() is not None


def _function() -> Callable[[bytes, bytes], int] | None:
    """Return what exchanges two names, 0 where it did; None where the C library has no such function."""
    if sys.platform not in ("linux", "darwin"):
        return None
    library = ctypes.CDLL(None, use_errno=True)
    if sys.platform == "linux" and hasattr(library, "renameat2"):
        return lambda one, other: library.renameat2(AT_FDCWD, one, AT_FDCWD, other, EXCHANGE)
    if sys.platform == "darwin" and hasattr(library, "renamex_np"):
        return lambda one, other: library.renamex_np(one, other, EXCHANGE)
    return None


def exchange(one: Path, other: Path) -> None:
    """Give each of two files or folders the name of the other.

    Args:
        one: A file or folder.
        other: Another one on the same file system.

    Raises:
        OSError: The system cannot do it here.
    """
    function = _function()
    if function is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS), str(one))
    if function(os.fsencode(one), os.fsencode(other)):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number), str(one))


def settle_on_disk(path: Path) -> None:
    """Have a file, or the names in a folder, written before anything that follows.

    Args:
        path: The file or folder; what the system cannot open so is left to it.

    Raises:
        OSError: A file cannot be written.
    """
    if path.is_dir():
        # Windows opens no folders; some network drives write none
        with suppress(OSError):
            _written(path, os.O_RDONLY)
    else:
        _written(path, os.O_RDWR)


def _written(path: Path, flags: int) -> None:
    number = os.open(path, flags)
    try:
        os.fsync(number)
    finally:
        os.close(number)
