"""Frames read on a thread of their own, handed over through a queue that never grows.

A source that waits is read no faster than its frames are taken; of one that does not wait the oldest frame in
the queue gives way to the newest, and is counted.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, wait
from typing import Any, NamedTuple

from monodyn.live.sources import Source
from monodyn.types import Frame

AHEAD = 4
"""Frames of a source that waits that are read before they are wanted: decoding goes on meanwhile."""


class Arrival(NamedTuple):
    """A frame and when it came.

    Attributes:
        frame: The frame.
        at: When it was there [s], by ``time.perf_counter``.
    """

    frame: Frame
    at: float


class Feed:
    """The frames of a source while they come.

    Args:
        source: Where they come from.
        capacity: How many may wait; of a source that waits a few are enough.

    Attributes:
        skipped: Frames that gave way to newer ones so far.
    """

    def __init__(self, source: Source, capacity: int) -> None:
        self.skipped = 0
        source.closing.clear()
        self._source, self._capacity = source, capacity if source.live else min(capacity, AHEAD)
        self._waiting: deque[Arrival] = deque()
        self._change = threading.Condition()
        self._ended, self._closed = False, False
        self._error: BaseException | None = None
        self._direct: Iterator[Frame] | None = source.opened() if source.direct else None
        self._thread: threading.Thread | None = None
        if self._direct is None:
            self._thread = threading.Thread(target=self._read, name="frames", daemon=True)
            self._thread.start()

    def next(self, timeout: float | None = None) -> Arrival | None:
        """Return the next frame.

        Args:
            timeout: How long to wait for it [s]; None waits until there is one.

        Returns:
            The frame; None where there was none within that time.

        Raises:
            StopIteration: the source has ended.
            MonodynError: the source gives no more, for a reason that it states.
        """
        if self._direct is not None:
            frame = next(self._direct)
            return Arrival(frame, time.perf_counter())
        with self._change:
            self._change.wait_for(lambda: self._waiting or self._ended, timeout)
            if self._waiting:
                taken = self._waiting.popleft()
                self._change.notify_all()
                # what waits for us was there as soon as we wanted it
                return taken if self._source.live else Arrival(taken.frame, time.perf_counter())
            if self._error is not None:
                raise self._error
            if self._ended:
                raise StopIteration
            return None

    @property
    def behind(self) -> bool:
        """Whether the next frame of a source that does not wait is there already."""
        return self._source.live and len(self._waiting) > 0

    def waits(self, job: Future[Any]) -> None:
        """Wait until a job is done, or there is something better to do: a frame waits, or nobody wants more.

        Args:
            job: The job.
        """
        if self._direct is not None or not self._source.live:
            wait([job])
            return
        job.add_done_callback(lambda _: self._wake())
        with self._change:
            self._change.wait_for(lambda: self._waiting or self._closed or job.done())

    def _wake(self) -> None:
        with self._change:
            self._change.notify_all()

    def close(self) -> None:
        """End the reading; a frame that is being read is the last one."""
        self._source.closing.set()
        with self._change:
            self._closed = True
            self._waiting.clear()
            self._change.notify_all()
        if self._thread is not None:
            self._thread.join(timeout=2.0)
        if self._direct is not None and hasattr(self._direct, "close"):
            self._direct.close()  # pyright: ignore[reportAttributeAccessIssue]

    def _read(self) -> None:
        """Read frames until there are no more, or nobody wants them."""
        frames: Any = ()
        try:
            frames = self._source.opened()
            for frame in frames:
                if not self._put(Arrival(frame, time.perf_counter())):
                    break
        except BaseException as error:
            self._error = error
        finally:
            if hasattr(frames, "close"):
                frames.close()
            with self._change:
                self._ended = True
                self._change.notify_all()

    def _put(self, arrival: Arrival) -> bool:
        """Put a frame into the queue; return whether more are wanted."""
        with self._change:
            if not self._source.live:
                self._change.wait_for(lambda: self._closed or len(self._waiting) < self._capacity)
            elif len(self._waiting) >= self._capacity:
                self._waiting.popleft()
                self.skipped += 1
            if not self._closed:
                self._waiting.append(arrival)
            self._change.notify_all()
            return not self._closed
