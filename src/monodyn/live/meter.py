"""How fast a stream goes: frames a second, and how long poses and fits take."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import NamedTuple

import numpy as np

from monodyn.live.step import Step

LAST = 300
"""Frames that count."""
RECENT = 2.0
"""Seconds in which frames a second are counted."""


class Spread(NamedTuple):
    """How long something took.

    Attributes:
        median: Half of the times took at most as long [s].
        worst: 99 of 100 took at most as long [s].
    """

    median: float
    worst: float


class Pace(NamedTuple):
    """How fast a stream goes at one moment.

    Attributes:
        rate: Frames a second; None before two frames.
        pose: From the arrival of a frame to its pose; None before one.
        fit: From the arrival of a frame to what was identified with it; None before one.
    """

    rate: float | None
    pose: Spread | None
    fit: Spread | None


class Meter:
    """Takes the frames of a stream; any thread may ask how fast they go."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._at, self._poses, self._fits = (deque[float](maxlen=LAST) for _ in range(3))

    def add(self, step: Step, now: float | None = None) -> None:
        """Take the next frame.

        Args:
            step: What is known at it.
            now: When it was done [s], by ``time.perf_counter``; None for now.
        """
        with self._lock:
            self._at.append(time.perf_counter() if now is None else now)
            # before the mechanism is found nothing is followed
            if step.phase == "following":
                self._poses.append(step.latency)
            if step.fresh is not None:
                self._fits.append(step.fresh)

    @property
    def pace(self) -> Pace:
        """How fast the last frames went."""
        with self._lock:
            at, poses, fits = np.array(self._at), np.array(self._poses), np.array(self._fits)
        recent = at[at > at[-1] - RECENT] if len(at) else at
        recent = recent if len(recent) > 1 else at[-2:]
        passed = float(recent[-1] - recent[0]) if len(recent) > 1 else 0.0
        return Pace((len(recent) - 1) / passed if passed > 0.0 else None, _spread(poses), _spread(fits))


def _spread(seconds: np.ndarray) -> Spread | None:
    return Spread(*np.percentile(seconds, [50.0, 99.0]).tolist()) if len(seconds) else None
