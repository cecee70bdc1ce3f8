"""Every exception that Monodyn raises on purpose; whether another one is Ctrl-C in other clothes, or ours.

The children are named by what has to be corrected: the mechanism file, the clip or the setting. A message is
one sentence: where, expected, got, what to do.
"""

from __future__ import annotations

import errno
from collections.abc import Iterator
from pathlib import Path
from traceback import walk_tb

SPENT = ("ENOSPC", "EDQUOT", "EFBIG", "EMFILE", "ENFILE", "ENOMEM")
"""What the system says when its disks or its limits are reached, whatever file it happens at."""


class MonodynError(Exception):
    """Base of every exception that Monodyn raises on purpose."""


class MechanismError(MonodynError):
    """The mechanism file, or a parameter named for it, cannot be used."""


class VideoError(MonodynError):
    """The clip (or the encoder record) cannot be used."""


class SettingsError(MonodynError):
    """A setting, a frame range or an output folder cannot be used."""


class FitError(MonodynError):
    """A result is not to be trusted; raised by ``check()``, carries the status sentence."""


signals: list[int] = []
"""Signals that have come to end the program: what fails then fails for the want of what they stopped. Empty
where somebody else handles them."""


def is_interrupt(error: BaseException) -> bool:
    """Return whether Ctrl-C, or another signal that ends the program, is behind an error.

    Args:
        error: What was raised.
    """
    return bool(signals) or holds_interrupt(error)


def holds_interrupt(error: BaseException | None) -> bool:
    """Return whether an error is what a signal's handler raised, whatever it came out as.

    Within a compiled function it is a ``SystemError``, while a library is loaded an ``ImportError``.

    Args:
        error: What was raised; None is nothing.
    """
    return any(isinstance(each, KeyboardInterrupt) for each in _chain(error))


def is_of_cache(error: BaseException) -> bool:
    """Return whether an error is that a file of compiled functions cannot be read.

    Args:
        error: What was raised.
    """
    codes = (frame.f_code for frame, _ in walk_tb(error.__traceback__))
    return not isinstance(error, MemoryError | OSError) and any(
        (Path(code.co_filename).parts[-3:] == ("numba", "core", "caching.py") and name.startswith("load"))
        or (Path(code.co_filename).parts[-3:] == ("monodyn", "cli", "loaded.py") and name == "parse")
        for code, name in ((code, code.co_name.lstrip("_")) for code in codes)
    )


def behind(error: BaseException) -> BaseException:
    """Return what a signal's handler raised where it came out as something else; any other error itself.

    Args:
        error: What was raised.
    """
    if isinstance(error, SystemError):
        return next((each for each in _chain(error) if not isinstance(each, SystemError)), error)
    if isinstance(error, ImportError):
        return next((each for each in _chain(error) if isinstance(each, KeyboardInterrupt)), error)
    return error


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error, then those that led to it."""
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def is_spent(error: OSError) -> bool:
    """Return whether a disk or a limit of the system is behind an error, and not a file.

    Args:
        error: What the system said.
    """
    return error.errno in [getattr(errno, name) for name in SPENT if hasattr(errno, name)]


def is_unforeseen(error: BaseException) -> bool:
    """Return whether an error is one of Monodyn itself.

    It is neither raised on purpose, nor Ctrl-C, nor what the system says of a file that has a name or of its
    limits, nor a damaged file of compiled functions.

    Args:
        error: What was raised.
    """
    if not isinstance(error, Exception) or isinstance(error, MonodynError):
        return False
    if is_interrupt(error) or is_of_cache(error):
        return False
    return not (isinstance(error, OSError) and (error.filename or is_spent(error)))
