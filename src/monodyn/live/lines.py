"""One JSON object a frame, line by line (NDJSON), on a thread of their own: a slow reader delays no frame."""

from __future__ import annotations

import contextlib
import json
import queue
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from monodyn.live.document import step_document
from monodyn.live.step import Step

WAITING = 2000
"""Lines that wait for a slow reader at most."""
LAST_WAIT = 5.0
"""How long a reader may take for what is left at the end [s]."""
BEGIN = b'{"schema":'
"""What a line begins with: no other file of Monodyn's does."""


def is_lines(path: Path) -> bool:
    """Return whether a file has lines of a stream, or nothing: what may be replaced by other ones.

    Args:
        path: A file.

    Raises:
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        return file.read(len(BEGIN)) in (b"", BEGIN)


class Lines:
    """Writes a line for every frame, flushed line by line; a reader that goes away ends nothing else.

    Args:
        stream: A text stream to write to.
        owned: Close the stream at the end.

    Attributes:
        lost: Lines that were left out.
        error: Why no more can be written; None while all is well, and where the reader went away.
    """

    def __init__(self, stream: Any, owned: bool = False) -> None:
        self.lost, self.error = 0, None
        self._stream, self._owned = stream, owned
        self._open, self._queue = True, queue.Queue[str | None](WAITING)
        self._thread = threading.Thread(target=self._write, name="lines", daemon=True)
        self._thread.start()

    def add(self, step: Step, *, wait: bool) -> None:
        """Write the line of a frame.

        Args:
            step: What is known at it.
            wait: Wait where a slow reader leaves no room for it; else it is left out and counted.
        """
        if not self._open:
            return
        text = json.dumps(step_document(step), allow_nan=False, separators=(",", ":"))
        try:
            self._queue.put(text, block=wait)
        except queue.Full:
            self.lost += 1

    def close(self) -> None:
        """Write what is left, as far as the reader takes it soon."""
        with contextlib.suppress(queue.Full):
            self._queue.put(None, timeout=LAST_WAIT)
            self._thread.join(LAST_WAIT)
        if not self._thread.is_alive():
            return
        # a reader that has stalled: what waits for it is lost, and the thread ends once it is let go
        with contextlib.suppress(queue.Empty):
            while True:
                self.lost += self._queue.get_nowait() is not None
        self._queue.put(None)

    def _write(self) -> None:
        """Write lines as they come; once nobody reads them take them all the same, so that nothing waits."""
        while (line := self._queue.get()) is not None:
            self._open = self._open and self._tried(self._put, line)
        if self._owned:
            self._tried(self._stream.close)

    def _put(self, line: str) -> None:
        self._stream.write(line + "\n")
        self._stream.flush()

    def _tried(self, work: Callable[..., object], *given: str) -> bool:
        """Return whether something could be done with the stream."""
        try:
            work(*given)
        # the reader has gone
        except BrokenPipeError:
            return False
        # a full disk, or a stream that was closed
        except (OSError, ValueError) as error:
            self.error = self.error or error
            return False
        return True
