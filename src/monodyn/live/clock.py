"""The time stamps of a stream as a clock that only goes forward.

A stamp before the last one, or far behind it, is the error of a camera's clock, or the begin of another
connection: the clock goes on from there by its usual step, and the motion is taken not to.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from monodyn.types import Frame
from monodyn.vision.clip.stamps import JUMP

USUAL_STEP = 1.0 / 30.0
"""Time between two frames before two of them were seen [s]."""
GAIN = 0.1
"""Share of a new step in the usual one."""


class Timed(NamedTuple):
    """A frame on the stream's own clock.

    Attributes:
        frame: The frame.
        broken: True where it is not known how much time has passed since the frame before.
    """

    frame: Frame
    broken: bool


class Clock:
    """Puts frames on one clock.

    Args:
        begin: Time of the first frame [s]; None keeps its stamp.

    Attributes:
        step: Usual time between two frames [s].
        breaks: How often the stamps broke off so far.
    """

    def __init__(self, begin: float | None = None) -> None:
        self.step, self.breaks = USUAL_STEP, 0
        self._begin = begin
        self._last: float | None = None
        self._offset, self._count = 0.0, 0

    def take(self, frame: Frame) -> Timed:
        """Return the next frame on the clock.

        Args:
            frame: The next frame, with the stamp of its source.
        """
        if self._last is None and self._begin is not None:
            self._offset = self._begin - frame.time
        time = frame.time + self._offset
        if self._last is None:
            self._last = time
            return Timed(replace(frame, time=time), False)
        passed = time - self._last
        broken = not 0.0 < passed <= JUMP
        if broken:
            self.breaks += 1
            self._offset += self._last + self.step - time
            time = self._last + self.step
        else:
            # the first steps count in full: a stream's rate is known after a few frames
            self._count += 1
            self.step += max(GAIN, 1.0 / self._count) * (passed - self.step)
        self._last = time
        return Timed(replace(frame, time=time) if time != frame.time else frame, broken)
