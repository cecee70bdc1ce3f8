"""An error that nobody foresaw in, a file with its traceback out, which its makers can be sent."""

from __future__ import annotations

import platform
import tempfile
import traceback
from contextlib import suppress
from pathlib import Path

from monodyn.results.lock import command_line

TRACEBACK = "monodyn-error.log"
"""Name of the file, which stands beside what was written before the error; no run that is complete has it."""
SENT = "please report it to its makers with"
"""How the note begins that an error has when its traceback is kept."""


def keep_traceback(error: BaseException, folder: Path) -> bool:
    """Write the traceback of an error, with what was run, into a folder; the error has a note of it then.

    Args:
        error: The error.
        folder: The folder; what has the name of the file in it stays.

    Returns:
        Whether it was written.
    """
    place = folder / TRACEBACK
    try:
        file = place.open("x", encoding="utf-8", errors="backslashreplace", newline="\n")
    except OSError:
        return False
    try:
        with file:
            file.write(traceback_text(error))
    except OSError:
        with suppress(OSError):
            place.unlink()
        return False
    error.add_note(f"{SENT} '{place}', which has the details.")
    return True


def traceback_text(error: BaseException) -> str:
    """Return the traceback of an error, after what was run and where.

    Args:
        error: The error.
    """
    from importlib.metadata import version

    return (
        f"monodyn {version('monodyn')}, Python {platform.python_version()}, {platform.platform()}\n"
        f"{command_line()}\n\n{''.join(traceback.format_exception(error))}"
    )


def where_sent(error: BaseException) -> str:
    """Return the note on where the traceback of an error is; a temporary folder has it if no other one does.

    Args:
        error: The error.

    Returns:
        The note; empty where no disk takes the file.
    """
    if not _note(error):
        with suppress(OSError):
            keep_traceback(error, Path(tempfile.mkdtemp(prefix="monodyn-")))
    return _note(error)


def _note(error: BaseException) -> str:
    notes = getattr(error, "__notes__", [])
    return next((note for note in notes if note.startswith(SENT)), "")
