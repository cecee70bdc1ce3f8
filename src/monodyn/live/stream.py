"""A stream in, what is known at every one of its frames out.

Decoding, following and identifying run side by side: frames come on a thread of their own, one worker
identifies frame by frame, another searches or identifies anew from nothing. What a source waits for is done
in order, so that the same frames give the same numbers; of a source that does not wait nothing is waited for:
a pose is shown when it is there, with what was identified last.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np

from monodyn.checks import drawn_mechanism
from monodyn.errors import MonodynError, VideoError
from monodyn.live.applied import Applied
from monodyn.live.begin import Beginning, Begun, Found, Guessed, begin
from monodyn.live.clock import Clock
from monodyn.live.feed import Arrival, Feed
from monodyn.live.foreseen import Foreseen
from monodyn.live.identifier import Identifier
from monodyn.live.settings import LiveSettings
from monodyn.live.sources import Pictures, Source, open_source
from monodyn.live.step import Phase, Step
from monodyn.live.tracker import Tracker
from monodyn.mechanism import Mechanism
from monodyn.mechanism.dots import shows_dots
from monodyn.settings import RunSettings
from monodyn.types import Frame, Poses

Apply = Callable[[Step], Mapping[str, float] | None]
"""Applies torques at a frame, and returns them by joint; None for none."""
FORGOTTEN = 2.0
"""How long torques are kept, in stretches that are identified anew."""
TICK = 0.2
"""Longest wait at a time, so that an interrupt gets through [s]."""


def stream(
    source: int | str | Path | Pictures | Source,
    mechanism: Mechanism | str | Path,
    live: LiveSettings | None = None,
    settings: RunSettings | None = None,
    *,
    apply: Apply | None = None,
) -> Iterator[Step]:
    """Follow and identify a mechanism while frames come.

    Args:
        source: Number of a camera, address of a stream, a clip, ``-`` for raw frames on the standard input,
            an iterable of pictures (`Frame`, or uint8 arrays (height, width) or (height, width, 3)), or what
            `open_source` returned.
        mechanism: The mechanism, a file, or a bundled name.
        live: How the stream is read and followed.
        settings: How each stage goes; ``fix``, ``free`` and ``bounds`` as in a run.
        apply: Called with each step before it is yielded. What it returns, torques by joint [N m; a slide's
            N] that it has applied from this frame on until the next, is part of the dynamics.

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
    opened = source
    if not isinstance(opened, Source):
        opened = open_source(opened, live, rate=settings.rate, whole=settings.in_pixels)
    with Session(opened, mechanism, live, settings, apply) as session:
        yield from session.steps()


class Session:
    """A stream while it goes on.

    Args:
        source: Where the frames come from.
        mechanism: The mechanism with the user's choices.
        live: How the stream is read and followed.
        settings: How each stage goes.
        apply: Applies torques at each frame, or None.

    Attributes:
        source: The source.
        found: What the first seconds have shown; None before that.
        identifier: Poses, and what was identified from them.
        said: What there is to say at this moment.
        notes: What people should know, in sentences.
        last: What was known at the last frame so far; None before one.
        recorded: Number in its recording of each frame, by its number in the stream; None where the source
            is a clip itself.
    """

    def __init__(
        self, source: Source, mechanism: Mechanism, live: LiveSettings, settings: RunSettings,
        apply: Apply | None = None,
    ) -> None:  # fmt: skip
        if shows_dots(mechanism):
            raise VideoError(
                f"{source.name}: expected a mechanism that shows its outline, got '{mechanism.name}', which "
                "is followed by its dots; record a clip and take monodyn run."
            )
        self.source: Source = source
        self.found: Found | None = None
        self.notes: list[str] = []
        self.last: Step | None = None
        self.recorded: Mapping[int, int] | None = None
        self._applied, self._apply = Applied([joint.name for joint in mechanism.joints]), apply
        self.identifier = Identifier(
            live, settings.identify, in_order=not source.live, acting=self._applied.between
        )
        self._live, self._sought = live, (source.name, mechanism, settings)
        # a clip keeps its clock, which its tables and its film have too
        self._feed, self._clock = Feed(source, live.queue), Clock(None if source.video else 0.0)
        self._beginning = Beginning(live.begin)
        self._worker = ThreadPoolExecutor(1, "search")
        self._search: Future[Begun | Guessed | MonodynError] | None = None
        self._tracker: Tracker | None = None
        self._foreseen = Foreseen(live.ahead)
        self.said = self._beginning.lacks
        self._stopped = False

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self._feed.close()
        self.identifier.close()
        self._worker.shutdown(wait=True, cancel_futures=True)

    def stop(self) -> None:
        """End the stream: the step that is being made is the last one."""
        self._stopped = True

    def steps(self) -> Iterator[Step]:
        """Yield what is known at each frame, until the source ends or somebody stops it."""
        while not self._stopped:
            try:
                arrival = self._feed.next(TICK)
            except StopIteration:
                break
            if arrival is not None:
                step = self.last = self._step(arrival)
                if self._apply is not None:
                    self._applied.add(step.time, self._apply(step))
                    self._applied.forget(step.time - FORGOTTEN * self._live.review)
                yield step
        # what is being looked at when the stream ends counts as well
        while self._search is not None:
            self._take_over(self._search.result())
            self._look()
        self.identifier.finish()

    def _step(self, arrival: Arrival) -> Step:
        """Return what is known with one more frame."""
        frame, broken = self._clock.take(arrival.frame)
        tracker, found = self._tracker, self.found
        # what is watched for the search comes first: no frame gives way to following a guess
        waits = found is None and self._feed.behind
        pose = None if tracker is None or waits else tracker.follow(frame, self._expected(frame.time))
        if found is None:
            self._watch(frame, broken=broken)
            # what a guess shows is worth showing where all of it lies on the picture
            pose = pose if pose is not None and self._tracker is tracker and pose.seen.all() else None
            pose = pose if self.found is None else self.identifier.record.last
        latency, fresh = time.perf_counter() - arrival.at, None
        if found is not None and pose is not None:
            self.identifier.take(pose, broken=broken)
        if self.found is not None and self.identifier.settle(self._feed.waits):
            fresh = time.perf_counter() - arrival.at
        estimate, base = self.identifier.estimate, self.identifier.base
        errors = self._foreseen.add(pose, estimate)
        scene = None if pose is None or self._tracker is None else self._tracker.scene
        phase: Phase = "watching" if self._search is None else "searching"
        return Step(
            frame.index, frame.time, phase if pose is None else "following", frame, pose, scene,
            estimate, base, self._sentence(pose), self._feed.skipped, latency, fresh, errors,
        )  # fmt: skip

    def _expected(self, time: float) -> np.ndarray | None:
        """Return where the dynamics have the joints at a time, as pictures have them, (dof,)."""
        estimate = self.identifier.estimate
        if estimate is None or estimate.astray:
            return None
        expected = estimate.expected(time)
        return expected if np.isfinite(expected).all() else None

    def _watch(self, frame: Frame, *, broken: bool) -> None:
        """Take a frame before the mechanism is found; look for it when enough has moved."""
        if broken and self._search is None:
            self._beginning, self._tracker = Beginning(self._live.begin), None
        self._beginning.add(frame)
        if self._search is None:
            self._look()
        if self._search is not None and (self._search.done() or not self.source.live):
            self._take_over(self._search.result())

    def _look(self) -> None:
        """Take the next step of the search where enough has moved for it; say what it lacks."""
        watched = self._beginning
        self.said = watched.lacks if self.found is None else self.said
        if self.found is None and watched.ready:
            watched.holds = True
            seconds = watched.frames[-1].time - watched.frames[0].time
            self.said = f"Looking for the mechanism in the last {seconds:.1f} s. {watched.why}".rstrip()
            self._search = self._worker.submit(begin, watched, *self._sought)

    def _take_over(self, begun: Begun | Guessed | MonodynError) -> None:
        """Go on from what a step of the search has found."""
        self._search, watched = None, self._beginning
        if not isinstance(begun, Begun):
            self._tracker = begun.tracker if isinstance(begun, Guessed) else None
            watched.go_on(begun)
            self.said = watched.lacks
            return
        self.said = "The mechanism is followed; its parameters are being identified."
        self.found, self._tracker = begun.found, begun.tracker
        self.identifier.begin(begun.found, begun.later)
        for later in watched.frames[begun.count :]:
            self.identifier.take(self._tracker.follow(later, self._expected(later.time)))
        self._beginning = Beginning(self._live.begin)

    def _sentence(self, pose: Poses | None) -> str:
        """Return what there is to say."""
        base, estimate = self.identifier.base, self.identifier.estimate
        if self.found is None and pose is not None:
            return f"It is followed as a first guess has it. {self.said}"
        if self.found is not None and base is not None:
            self.said = estimate.astray if estimate is not None and estimate.astray else base.status
            if pose is not None and not pose.measured.any():
                self.said = "The mechanism is not in sight."
        return self.said
