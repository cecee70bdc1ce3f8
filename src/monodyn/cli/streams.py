"""What may be missing or lost: a closed pipe, a full disk, Ctrl-C.

SIGTERM, by which one program ends another, is as Ctrl-C.
"""

from __future__ import annotations

import codecs
import contextlib
import faulthandler
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from queue import SimpleQueue
from typing import Any

from monodyn.errors import SettingsError, holds_interrupt, signals

SPELT = "monodyn-spelt"
"""Name of what is done with a letter that a stream cannot encode."""
SPELLINGS = {"−": "-", "–": "-", "±": "+-", "×": "x", "∞": "inf"}
"""Letters that numbers are written with, in those that every stream can encode."""
SOON = 0.05
"""How much later a Ctrl-C comes again that may have been lost [s]."""
ENDING = {
    signal.SIGINT: signal.default_int_handler,
    signal.SIGTERM: signal.SIG_DFL,
    # the terminal was closed; Windows has no such signal
    **({signal.SIGHUP: signal.SIG_DFL} if hasattr(signal, "SIGHUP") else {}),
}
"""Signals that end the program, and what Python does at each unless somebody else has taken it."""


class _Lossy:
    """The error stream; what cannot be written is dropped."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text; what cannot be written is dropped.

        Args:
            text: The text.
        """
        try:
            self._stream.write(text)
        except (OSError, ValueError):
            _silence(self._stream)
        return len(text)

    def flush(self) -> None:
        """Write out what the stream still holds; what cannot be written is dropped."""
        try:
            self._stream.flush()
        except (OSError, ValueError):
            _silence(self._stream)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _spell(error: UnicodeError) -> tuple[str, int]:
    """Return what stands for letters that a stream cannot encode: a minus must not become a question mark."""
    assert isinstance(error, UnicodeEncodeError)
    lost = error.object[error.start : error.end]
    return "".join(SPELLINGS.get(letter, "?") for letter in lost), error.end


codecs.register_error(SPELT, _spell)


@contextlib.contextmanager
def alone() -> Iterator[None]:
    """Keep what libraries write on the error stream by themselves away from the user: warnings of Python, and
    the lines of decoders written in C, which know of no other place.

    What they find wrong is found by us as well, and said in one line. The process has to be our own.
    """
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    usual = sys.stderr
    try:
        # theirs is the number 2, whatever Python has behind its name
        if usual is not None and usual.fileno() == 2:
            sys.stderr = os.fdopen(os.dup(2), "w", 1, encoding=usual.encoding, errors=usual.errors)
            # a crash in their code, which leaves nothing else to read
            faulthandler.enable(sys.stderr)
            _silence(usual)
    except (OSError, ValueError):
        sys.stderr = usual
    try:
        yield
    finally:
        ours, sys.stderr = sys.stderr, usual
        if ours is not None and ours is not usual:
            with contextlib.suppress(OSError, ValueError):
                os.dup2(ours.fileno(), 2)
                faulthandler.disable()
                ours.flush()


@contextlib.contextmanager
def safe() -> Iterator[None]:
    """Make both streams print whatever they can and never fail on a name; a lost error stream is no error."""
    with contextlib.suppress(OSError):
        # What is opened later must not get the number of a closed standard stream.
        while (number := os.open(os.devnull, os.O_RDWR)) < 3:
            pass
        os.close(number)
    out, err = sys.stdout, sys.stderr
    if out is None:
        sys.stdout = open(os.devnull, encoding="utf-8")  # noqa: SIM115 (not writable: printing says so)
    if err is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    # a file name that the terminal cannot show must not end a run of several minutes
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors=SPELT)
    sys.stderr = _Lossy(sys.stderr)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = out, err


@contextlib.contextmanager
def never_lost() -> Iterator[list[int]]:
    """Have Ctrl-C end the program also where Python or a library drops it, or makes another error of it.

    Python drops it in callbacks, with a traceback on the error stream: of its own at the end of every
    import, of which there are thousands in the first second, and of the compiler of numba. Libraries written
    in C clear it where they look whether something is there. So it comes again until it is on its way up:
    then it is being handled wherever code of Python runs.

    Yields:
        The signals that came, in their order.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed, and something failed for the want of what it stopped.
    """
    presses = _Presses()
    try:
        presses.watch()
        yield presses.came
    except Exception as error:
        # where a library written in C was loaded, the error does not tell what is behind it
        if presses.came or presses.dropped:
            raise KeyboardInterrupt from error
        raise
    finally:
        try:
            presses.end()
        except KeyboardInterrupt:
            # one that comes as the other ends must leave nothing behind that sends it again
            presses.end()
            raise


class _Presses:
    """The presses of Ctrl-C, and SIGTERM, each sent again until it is on its way up.

    Attributes:
        ours: The signals that are handled here.
        came: Those that came from outside, in their order, also in ``errors.signals`` until the end.
        dropped: Whether Python dropped one.
        sent: Whether the next one is one that was sent again.
        over: Whether none is to be sent any more.
        doubtful: True for each press that may be lost, False at the end. Unlike all that has a lock it may be
            used in a handler, whatever that has interrupted.
    """

    def __init__(self) -> None:
        # whoever calls us from a thread, or has a handler of their own, has other ways to end us
        main = threading.current_thread() is threading.main_thread()
        self.ours = [n for n, handler in ENDING.items() if main and signal.getsignal(n) is handler]
        self.came: list[int] = []
        self.dropped = self.sent = self.over = False
        self.doubtful: SimpleQueue[bool] = SimpleQueue()
        self._usual = sys.unraisablehook
        self._thread = threading.Thread(target=self._repeat, name="ctrl-c", daemon=True)

    def watch(self) -> None:
        """Take the signals."""
        sys.unraisablehook = self._drop
        if self.ours:
            self._thread.start()
        for number in self.ours:
            signal.signal(number, self._press)

    def end(self) -> None:
        """Give the signals back."""
        self.over = True
        self.doubtful.put(False)
        try:
            # what it has sent comes while it can still be told from another press
            if self._thread.ident is not None:
                self._thread.join()
        finally:
            for number in self.ours:
                signal.signal(number, ENDING[number])
            sys.unraisablehook = self._usual
            signals.clear()

    def _repeat(self) -> None:
        while self.doubtful.get():
            time.sleep(SOON)
            if self.over:
                return
            self.sent = True
            _send(self.ours[0])

    def _press(self, number: int, frame: Any) -> None:
        if self.over:
            # all is done: it came too late
            return
        self.doubtful.put(True)
        if not self.sent:
            self.came.append(number)
            signals.append(number)
            raise KeyboardInterrupt
        self.sent = False
        if not holds_interrupt(sys.exc_info()[1]):
            raise KeyboardInterrupt

    def _drop(self, lost: Any) -> None:
        if self.ours and issubclass(lost.exc_type, KeyboardInterrupt):
            self.dropped = True
            self.doubtful.put(True)
        elif not self.came:
            self._usual(lost)
        # after the end was asked for, what libraries drop while they are let go tells nobody anything


def _send(number: int) -> None:
    """Send a signal to the main thread, which wakes it wherever it waits."""
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:
        signal.raise_signal(number)


@contextlib.contextmanager
def first_press(stop: Callable[[], bool]) -> Iterator[list[int]]:
    """Have the first Ctrl-C in the block be its normal end; the next one ends the program, as ever.

    Args:
        stop: What to do then, at once; it must not wait for anything. False says that nothing had begun, and
            the program ends.

    Yields:
        The signals that came and ended the block so.
    """
    came: list[int] = []
    main = threading.current_thread() is threading.main_thread()
    taken = {number: signal.getsignal(number) for number in ENDING if main}
    usual = {number: handler for number, handler in taken.items() if callable(handler)}

    def restore() -> None:
        for number, handler in usual.items():
            signal.signal(number, handler)

    def press(number: int, frame: Any) -> None:
        restore()
        if stop():
            came.append(number)
        else:
            usual[signal.Signals(number)](number, frame)

    try:
        for number in usual:
            signal.signal(number, press)
        yield came
    finally:
        restore()


@contextlib.contextmanager
def printing() -> Iterator[None]:
    """Print on the standard output: a reader that has gone away ends it, without an error.

    Raises:
        SettingsError: the standard output cannot be written.
    """
    try:
        yield
        # a full disk shows when the buffer is written, which would otherwise be at exit
        sys.stdout.flush()
    # ``monodyn models | head`` is no error
    except BrokenPipeError:
        _silence(sys.stdout)
    except OSError as error:
        _silence(sys.stdout)
        raise SettingsError(
            f"standard output: cannot print the result ({error.strerror or error}); give it another place, "
            "or --quiet."
        ) from None


def _silence(stream: Any) -> None:
    """Discard what a stream still holds, and what is written to it later."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        # Python flushes the stream once more at exit, and would complain of the same error again
        number = os.open(os.devnull, os.O_WRONLY)
        os.dup2(number, stream.fileno())
        os.close(number)
