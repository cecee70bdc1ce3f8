"""Poses in as they come, what is identified out: at every frame, and anew from nothing every now and then."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np

from monodyn.estimation.fit import Doubt, Fit
from monodyn.estimation.settings import IdentifySettings
from monodyn.live.begin import Found, numbered
from monodyn.live.estimate import Estimate
from monodyn.live.horizon import LONGEST_GAP, Acting, Horizon, followed_from, horizon_of
from monodyn.live.record import Record, joined
from monodyn.live.settings import LiveSettings
from monodyn.redrawn import redrawn
from monodyn.stages import identify
from monodyn.types import Poses

HARDLY = 0.2
"""Share of the widest motion so far up to which a stretch hardly moves."""
LEAST_POSES = 20
"""Whole poses of a stretch that is identified anew, at least."""
FOLLOWED = 0.5
"""Share of a stretch, at its end, that has to be followed as one motion for it to be identified anew."""
GROWTH = 2.0
"""How much longer the next stretch that is identified anew is, until it is as long as it may be."""


Why = Literal["", "another motion", "stamps", "unseen", "searching", "too fast"]
"""Why no motion goes on from before: it does; the mechanism was touched, or has changed; the clock jumps; it
was out of sight; no frame was followed, during the search or because they came too fast."""


class Cut(NamedTuple):
    """Where the motion that goes on without a break begins.

    Attributes:
        time: Time of its first frame [s].
        why: Why it begins there.
    """

    time: float
    why: Why = ""


class Reviewed(NamedTuple):
    """A stretch identified anew.

    Attributes:
        fit: The fit.
        horizon: What goes on from it; None where nothing does.
        until: Time of its last row [s].
    """

    fit: Fit
    horizon: Horizon | None
    until: float


class Identifier:
    """Identifies while poses come.

    Args:
        live: How long the window is, how far ahead is predicted, how long a stretch is at most.
        settings: How a stretch is identified.
        in_order: Whether every pose waits for what is identified with it, so that the same poses give the
            same numbers.
        acting: Returns the torques that are known to have acted from one time to another.

    Attributes:
        record: The poses so far.
        fit: The last fit of a whole stretch; None before one.
        cut: Where the motion that goes on without a break begins.
        estimate: What was identified last at a frame; None before that, and while no fit can be used.
    """

    def __init__(
        self, live: LiveSettings, settings: IdentifySettings, *, in_order: bool,
        acting: Acting = lambda *_: None,
    ) -> None:  # fmt: skip
        self.record, self.fit, self.estimate = Record(live.review), None, None
        self._live, self._settings, self._in_order, self._acting = live, settings, in_order, acting
        # one worker for what every frame needs, one for what takes longer
        self._quick, self._long = ThreadPoolExecutor(1, "identify"), ThreadPoolExecutor(1, "review")
        self._found: Found | None = None
        self._horizon: Horizon | None = None
        self._pending: list[Poses] = []
        self._estimating: Future[Estimate | None] | None = None
        self._review: Future[Reviewed | None] | None = None
        self._seen, self._astray, self._moved = -math.inf, -math.inf, np.zeros(0)
        self._fresh = False
        self._rests = -math.inf
        self.cut, self._next, self._begun = Cut(-math.inf), math.inf, -math.inf

    @property
    def base(self) -> Fit | None:
        """The fit of a whole stretch that what was identified last rests on, and whose verdict holds; a later
        one counts from the first frame that is identified with it. None before one."""
        return self.fit if self.estimate is None else self.estimate.base

    def begin(self, found: Found, later: Poses | None = None) -> None:
        """Begin with what the first seconds have shown.

        Args:
            found: It.
            later: Poses of what came while the mechanism was looked for; None for nothing.
        """
        self._found = found
        self.record.add(found.poses)
        self.cut, self._seen = Cut(float(found.poses.time[0])), float(found.poses.time[-1])
        self._moved = np.nanstd(found.poses.position, axis=0)
        if later is not None:
            self._recorded(later)
        self._begun, self._next = self._seen, -math.inf
        self._look_again(self._seen)
        if self._in_order:
            self.finish()

    def take(self, pose: Poses, *, broken: bool = False) -> None:
        """Take the next pose, and identify with it as soon as the one before is done.

        Args:
            pose: One row.
            broken: True where it is not known how much time has passed since the one before.
        """
        now = float(pose.time[0])
        if broken:
            # what waits is of the motion before
            self._submit(rest=False)
            self.settle(Future.exception, rest=False)
            self._horizon = None if self._horizon is None else self._horizon.broken_off()
        self._recorded(pose, broken=broken)
        if self._horizon is not None:
            self._pending.append(pose)
        self._collect()
        self._submit(rest=not self._in_order)
        self._look_again(now)
        if self._in_order:
            self.finish()

    def _recorded(self, poses: Poses, *, broken: bool = False) -> None:
        """Record poses; no motion goes on across a break, or while it is out of sight for long."""
        done = 0
        for row in np.flatnonzero(poses.measured.any(axis=1)).tolist():
            now = float(poses.time[row])
            if broken or now - self._seen > LONGEST_GAP:
                # what came before tells why
                if done < row:
                    self.record.add(poses[done:row])
                    done = row
                self._cut_off(now, "stamps" if broken else self._gap())
                broken = False
            self._seen = now
        self.record.add(poses[done:] if done else poses)

    def _gap(self) -> Why:
        """Return why nothing was seen since it was seen last."""
        if self.record.since(self._seen, after=True) is not None:
            return "unseen"
        return "searching" if self._seen <= self._begun or self._begun == -math.inf else "too fast"

    def _cut_off(self, now: float, why: Why) -> None:
        """Let the motion begin anew; it is identified as soon as it has gone on for long enough."""
        self.cut, self._next = Cut(now, why), now + self._live.begin

    def settle(self, give_up: Callable[[Future[Any]], object], *, rest: bool = True) -> bool:
        """Wait for what is being identified.

        Args:
            give_up: Waits for the future or until there is something better to do.
            rest: Leave what waits waiting where what identifies is to rest.

        Returns:
            Whether what is known is that of the last pose.
        """
        while self._estimating is not None:
            give_up(self._estimating)
            if not self._estimating.done():
                return False
            self._collect()
            self._submit(rest=rest)
        return self._fresh and not self._pending

    def close(self) -> None:
        """End the work that goes on."""
        for worker in (self._quick, self._long):
            worker.shutdown(wait=True, cancel_futures=True)

    def _submit(self, *, rest: bool = True) -> None:
        """Hand the pending poses to the worker that identifies frame by frame, once it is free.

        Where poses come faster than it works, it rests for as long as it has worked before it takes all that
        wait: that leaves the interpreter, which threads share, to what follows the mechanism.
        """
        if self._horizon is None or self._estimating is not None or not self._pending:
            return
        if rest and len(self._pending) > 1 and time.perf_counter() < self._rests:
            return
        rows, self._pending = joined(self._pending), []
        self._estimating = self._quick.submit(self._estimated, self._horizon, rows)

    def _estimated(self, horizon: Horizon, poses: Poses) -> Estimate | None:
        """Estimate anew with poses, and tell until when to rest if more of them wait."""
        began = time.perf_counter()
        found = horizon.add(poses)
        now = time.perf_counter()
        self._rests = now + (now - began)
        return found

    def _collect(self) -> None:
        """Take what the workers have finished."""
        if self._estimating is not None and self._estimating.done():
            found, self._estimating = self._estimating.result(), None
            # where nothing is seen the prediction goes on
            self.estimate, self._fresh = found or self.estimate, found is not None
            if found is not None and found.astray:
                self._look_anew(float(found.time[-1]))
        if self._review is not None and self._review.done() and self._estimating is None:
            done, self._review = self._review.result(), None
            if done is not None:
                self._take_up(done)

    def _look_anew(self, now: float) -> None:
        """Identify anew what moves from now on: what came before tells nothing of it."""
        # what goes astray again and again does so since the first time
        if now - self._astray > self._live.begin:
            self._cut_off(now, "another motion")
        self._astray = now

    def _take_up(self, done: Reviewed) -> None:
        """Go on from a stretch that was identified anew."""
        length = done.until - self.cut.time
        self._next = done.until + min((GROWTH - 1.0) * length, self._live.review)
        if done.horizon is None and self._horizon is not None:
            # what follows every frame goes on; undoubted where the model holds, and only its motion grows
            if not done.fit.ok:
                self._horizon = self._horizon.doubted(done.fit.status)
            elif done.fit.torque not in ("friction", "known"):
                self._horizon = self._horizon.doubted("a torque over time acts in it.")
            return
        self.fit, self._horizon = done.fit, done.horizon
        # what came while it was looked at is still to be taken
        later = self.record.since(done.until, after=True)
        self._pending = [] if later is None else [later]

    def _look_again(self, now: float) -> None:
        """Begin to identify a stretch anew where it is time to."""
        if self._review is not None or now < self._next or self._found is None:
            return
        rows = self.record.since(max(self.cut.time, now - self._live.review))
        if rows is None or int(rows.measured.all(axis=1).sum()) < LEAST_POSES:
            return
        moved = np.nanstd(rows.position, axis=0)
        # what hardly moves tells nothing of how it is made
        if self._horizon is not None and np.all(moved < HARDLY * self._moved):
            self._next = now + self._live.begin
        else:
            self._moved, self._next = np.maximum(moved, self._moved), now + self._live.begin
            known = None if self._horizon is None else self.fit
            self._review = self._long.submit(self._reviewed, rows, self._found, known)

    def _reviewed(self, poses: Poses, found: Found, known: Fit | None) -> Reviewed | None:
        """Identify a stretch from nothing, or the end of it that one motion follows by what is known.

        None for a short end: while it is held upright no motion does, and the search for one takes a minute.
        """
        if known is not None:
            later = poses[followed_from(known, poses) :]
            few = int(later.measured.all(axis=1).sum()) < LEAST_POSES
            if few or np.ptp(later.time) < FOLLOWED * np.ptp(poses.time):
                return None
            poses = later
        scene, acted = found.scene, self._acting(float(poses.time[0]), float(poses.time[-1]))
        fit = identify(replace(poses, torques=acted), scene.mechanism, self._settings)
        fit = redrawn(fit, scene, numbered(poses, scene.video.times))
        if found.doubt:
            fit = replace(fit, doubts=(), advice=()).doubted([Doubt("refused", found.doubt)])
        horizon = horizon_of(fit, scene.mechanism, poses, self._live, self._acting)
        return Reviewed(fit, horizon, float(poses.time[-1]))

    def finish(self) -> None:
        """Wait for all that is being identified."""
        while self._estimating is not None or self._review is not None:
            jobs: list[Future[Any]] = [job for job in (self._estimating, self._review) if job is not None]
            wait(jobs)
            self._collect()
            self._submit(rest=False)
