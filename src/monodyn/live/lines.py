"""One JSON object a frame, line by line (NDJSON), on a thread of their own: a slow reader delays no frame."""

from __future__ import annotations

import json
import queue
import threading
from typing import Any

from monodyn.live.document import step_document
from monodyn.live.step import Step

WAITING = 2000
"""Lines that wait for a slow reader at most."""
LAST_WAIT = 5.0
"""How long a reader may take for what is left at the end [s]."""


class Lines:
    """Writes a line for every frame, flushed line by line; a reader that goes away ends nothing else.

    Args:
        stream: A text stream to write to.
        owned: Close the stream at the end.

    Attributes:
        lost: Lines that were left out.
        error: Why no more can be written; None while all is well, and where the reader went away.
    """

    def __init__(self, stream: Any, *, owned: bool = False) -> None:
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
        try:
            self._queue.put(None, timeout=LAST_WAIT)
            self._thread.join(LAST_WAIT)
        except queue.Full:
            pass
        self.lost += sum(1 for line in list(self._queue.queue) if line is not None)

    def _write(self) -> None:
        """Write lines as they come; once nobody reads them take them all the same, so that nothing waits."""
        while (line := self._queue.get()) is not None:
            if not self._open:
                continue
            try:
                self._stream.write(line + "\n")
                self._stream.flush()
            except BrokenPipeError:
                self._open = False
            # a full disk, or a stream that was closed
            except (OSError, ValueError) as error:
                self.error, self._open = error, False
        if self._owned:
            try:
                self._stream.close()
            except OSError as error:
                self.error = self.error or error
