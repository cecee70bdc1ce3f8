"""A stream in, what is known at every one of its frames out.

Decoding, following and identifying run side by side: frames come on a thread of their own, one worker
identifies frame by frame, another searches or identifies anew from nothing. What a source waits for is done
in order, so that the same frames give the same numbers; of a source that does not wait nothing is waited for:
a pose is shown when it is there, with what was identified last.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monodyn.checks import drawn_mechanism
from monodyn.errors import MonodynError
from monodyn.live.begin import Beginning, Found, search
from monodyn.live.clock import Clock
from monodyn.live.feed import Arrival, Feed
from monodyn.live.foreseen import Foreseen
from monodyn.live.horizon import Horizon
from monodyn.live.identifier import Identifier, horizon_of
from monodyn.live.settings import LiveSettings
from monodyn.live.sources import Pictures, Source, open_source
from monodyn.live.step import Step
from monodyn.live.tracker import Tracker
from monodyn.mechanism import Mechanism
from monodyn.settings import RunSettings
from monodyn.types import Frame, Poses

TICK = 0.2
"""Longest wait at a time, so that an interrupt gets through [s]."""


def stream(
    source: int | str | Path | Pictures | Source,
    mechanism: Mechanism | str | Path,
    live: LiveSettings | None = None,
    settings: RunSettings | None = None,
) -> Iterator[Step]:
    """Follow and identify a mechanism while frames come.

    Args:
        source: Number of a camera, address of a stream, a clip, ``-`` for raw frames on the standard input,
            an iterable of pictures (`Frame`, or uint8 arrays (height, width) or (height, width, 3)), or what
            `open_source` returned.
        mechanism: The mechanism, a file, or a bundled name.
        live: How the stream is read and followed.
        settings: How each stage goes; ``fix``, ``free`` and ``bounds`` as in a run.

    Yields:
        What is known at each frame, in their order. The same frames give the same numbers, unless the source
        does not wait.

    Raises:
        MonodynError: the source or the mechanism cannot be used.

    Example:
        >>> for step in monodyn.stream(0, "double.xml"):  # doctest: +SKIP
        ...     print(step.time, step.pose, step.fit and step.fit.parameter("link1.length"))
    """
    live, settings = live or LiveSettings(), settings or RunSettings()
    if not isinstance(mechanism, Mechanism):
        mechanism = drawn_mechanism(mechanism, settings)
    opened = source if isinstance(source, Source) else open_source(source, live, rate=settings.rate)
    with Session(opened, mechanism, live, settings) as session:
        yield from session.steps()


class Session:
    """A stream while it goes on.

    Args:
        source: Where the frames come from.
        mechanism: The mechanism with the user's choices.
        live: How the stream is read and followed.
        settings: How each stage goes.

    Attributes:
        source: The source.
        found: What the first seconds have shown; None before that.
        identifier: Poses, and what was identified from them.
        stopped: True once no more frames are wanted.
    """

    def __init__(
        self, source: Source, mechanism: Mechanism, live: LiveSettings, settings: RunSettings
    ) -> None:
        self.source, self.found, self.stopped = source, None, False
        self.identifier = Identifier(live, settings.identify, in_order=not source.live)
        self._mechanism, self._live, self._settings = mechanism, live, settings
        self._feed, self._clock = Feed(source, live.queue), Clock()
        self._beginning = Beginning(live.begin)
        self._worker = ThreadPoolExecutor(1, "search")
        self._search: Future[Begun | MonodynError] | None = None
        self._searched = -1
        self._tracker: Tracker | None = None
        self._foreseen = Foreseen(live.ahead)
        self._said = "Waiting for motion."

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self._feed.close()
        self.identifier.close()
        self._worker.shutdown(wait=True, cancel_futures=True)

    def steps(self) -> Iterator[Step]:
        """Yield what is known at each frame, until the source ends or ``stop`` was called."""
        while not self.stopped:
            try:
                arrival = self._feed.next(TICK)
            except StopIteration:
                return
            if arrival is not None:
                yield self._step(arrival)

    def stop(self) -> None:
        """Take no more frames; what is being done with the last one is done. May be called by a signal."""
        self.stopped = True

    def _step(self, arrival: Arrival) -> Step:
        """Return what is known with one more frame."""
        frame, broken = self._clock.take(arrival.frame)
        if self._tracker is None:
            self._watch(frame)
            pose = self.identifier.record.last
        else:
            pose = self._tracker.follow(frame, self._expected(frame.time))
            self.identifier.take(pose, broken=broken)
        latency, fresh = time.perf_counter() - arrival.at, None
        if self._tracker is None:
            pose, phase = None, "watching" if self._search is None else "searching"
        else:
            phase = "following"
            if self.identifier.settle(self._feed.waits):
                fresh = time.perf_counter() - arrival.at
        estimate = self.identifier.estimate
        errors = self._foreseen.add(pose, estimate)
        return Step(
            frame.index, frame.time, phase, frame, pose, None if self.found is None else self.found.scene,
            estimate, self.identifier.fit, self._sentence(pose), self._feed.skipped, latency, fresh, errors,
        )  # fmt: skip

    def _expected(self, time: float) -> np.ndarray | None:
        """Return where the dynamics have the joints at a time, as pictures have them, (dof,)."""
        estimate = self.identifier.estimate
        return None if estimate is None else estimate.expected(time)

    def _watch(self, frame: Frame) -> None:
        """Take a frame before the mechanism is found; look for it when enough has moved."""
        self._beginning.add(frame)
        if self._search is None and self._beginning.ready:
            frames = tuple(self._beginning.frames)
            self._searched = frames[-1].index
            job = (frames, self.source.name, self._mechanism, self._settings, self._live)
            self._search = self._worker.submit(begin, *job)
            self._said = f"Looking for the mechanism in the last {frames[-1].time - frames[0].time:.1f} s."
        if self._search is None or not (self._search.done() or not self.source.live):
            return
        begun, self._search = self._search.result(), None
        if isinstance(begun, MonodynError):
            self._beginning.in_vain()
            self._said = str(begun)
            return
        self._follow(begun)

    def _follow(self, begun: Begun) -> None:
        """Follow the mechanism from now on, what came during the search first."""
        watched = self._beginning.frames
        seen = [frame for frame in watched if frame.index <= self._searched]
        self.found = begun.found
        self.identifier.begin(begun.found, begun.horizon)
        self._tracker = Tracker(begun.found.scene, self._settings.track, seen)
        for frame in watched[len(seen) :]:
            self.identifier.take(self._tracker.follow(frame))
        self._beginning = Beginning(self._live.begin)

    def _sentence(self, pose: Poses | None) -> str:
        """Return what there is to say."""
        fit, estimate = self.identifier.fit, self.identifier.estimate
        if self._tracker is None or fit is None:
            return self._said
        if pose is not None and not pose.measured.any():
            return "The mechanism is not in sight."
        return estimate.astray if estimate is not None and estimate.astray else fit.status


class Begun(NamedTuple):
    """What the first seconds have shown, and what goes on from it.

    Attributes:
        found: Scene, poses, fit.
        horizon: What goes on from the fit; None where that cannot be used.
    """

    found: Found
    horizon: Horizon | None


def begin(
    frames: Sequence[Frame], name: str, mechanism: Mechanism, settings: RunSettings, live: LiveSettings
) -> Begun | MonodynError:
    """Look for the mechanism in the first seconds; return why in vain where it was not found.

    Args:
        frames: What was watched.
        name: Name of the stream.
        mechanism: The mechanism with the user's choices.
        settings: How each stage goes.
        live: How it goes on.
    """
    try:
        found = search(frames, name, mechanism, settings)
    except MonodynError as error:
        return error
    return Begun(found, horizon_of(found.fit, found.scene.mechanism, found.poses, live))
