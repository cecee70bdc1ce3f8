"""Differences of successive pictures in, the pictures that repeat the one before out.

A scene of 25 pictures a second in a film of 30 shows every fifth of them twice. The one idea: a mechanism
that comes to rest slows down first and then moves off slowly, or goes back the way it came. Where the scene
moved on before and after, and in the same direction, a picture without a change of its own is a repeat. What
is no change is measured where nothing ever moves: there two pictures differ by noise alone.
"""

from __future__ import annotations

import itertools
from collections import deque
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from monodyn.vision.clip.stamps import Steps, explaining_steps, usual_rate

BLOCKS = 16
"""The picture is divided into this many blocks along each side, at most."""
LONGEST = 8
"""Most repeats of one picture."""
QUIET = 0.25
"""A pair of pictures that differs by less than this share of its neighbours is looked at closely [of
squares]."""
NOISE_QUANTILE = 98.0
"""The noise of a still scene is that of all but the worst pairs of pictures [%]."""
CERTAIN, LIKELY = 0.005, 0.05
"""A repeat differs from its picture by less than this share of the motion around it [of squares], 7 % and
22 % of the way: by less than the first of them before anything is known of a clip, by less than the second in
a clip with repeats, whose encoder may not have copied them faithfully."""
MOVING = 1.0 / LIKELY
"""Motion is certain where pictures differ by more than this many times the noise [of squares]."""
ONWARD = 0.5
"""The pictures before and after differ by more than this share of the larger step when the motion went on [of
squares]; when it went back they differ by about four times what the picture in question does."""
ESTABLISHED = 3
"""Certain repeats from which on a clip is one with repeats: one or two may be chance where the pictures are
few a second, and the fit leaves them out as gross errors."""

UNEVEN = 1e-3
"""Most that the steps of a clip's own clock may differ, as a share of one, for a constant rate behind it."""


class _Pause(NamedTuple):
    """Successive pairs of pictures that hardly differ, between two that do.

    Attributes:
        first: Number of the first such pair; pair k is that of pictures k and k + 1.
        stop: Number of the pair after the last one.
        across: Squared difference of the pictures before and after, by block.
    """

    first: int
    stop: int
    across: np.ndarray


class Repeats(NamedTuple):
    """Pictures of a clip that repeat the one before.

    Attributes:
        frames: Their frame numbers.
        rate: Pictures of the scene a second, if a constant rate explains which pictures are new [Hz]; else 0.
        times: Times of all frames at that rate [s], (frame,); empty without one.
    """

    frames: tuple[int, ...] = ()
    rate: float = 0.0
    times: np.ndarray = np.zeros(0)


NO_REPEATS = Repeats()
"""Every picture is new."""


class Differences:
    """Squared differences of the pictures of a clip, gathered while they stream by."""

    def __init__(self) -> None:
        self.frames: list[int] = []
        self._past: deque[np.ndarray] = deque(maxlen=LONGEST + 3)
        self._pairs: list[np.ndarray] = []
        self._sums: list[float] = []
        self._pauses: list[_Pause] = []

    def add(self, frame: int, small: np.ndarray) -> None:
        """Take the next picture.

        Args:
            frame: Its frame number.
            small: The picture, reduced, of any type, (channel, height, width).
        """
        self.frames.append(frame)
        if self._past:
            self._pairs.append(_squares(small, self._past[-1]))
            self._sums.append(float(self._pairs[-1].sum()))
        self._past.append(small)
        last = len(self._sums) - 1
        first = last
        # the pictures before and after a pause are both at hand only while it is short
        while last - first < LONGEST and first > 0 and self._sums[first - 1] < QUIET * self._sums[last]:
            first -= 1
        if 0 < first < last and max(self._sums[first:last]) < QUIET * self._sums[first - 1]:
            across = _squares(small, self._past[first - last - 3])
            self._pauses.append(_Pause(first, last, across))

    def repeats(self, moves: np.ndarray, times: np.ndarray) -> Repeats:
        """Return the frames that repeat the one before.

        Args:
            moves: True where anything moves in the reduced pictures, bool (height, width).
            times: Time stamps of the clip [s], (frame,).
        """
        if not self._pauses:
            return NO_REPEATS
        blocks = _squares(moves[np.newaxis], np.zeros_like(moves[np.newaxis])) > 0
        pairs = np.array(self._pairs)
        sizes = pairs[:, blocks].sum(axis=1)
        # where nothing ever moves the pictures differ as those of a still scene do
        still = pairs[:, ~blocks].mean(axis=1) * blocks.sum() if not blocks.all() else np.zeros(len(pairs))
        noise = float(np.percentile(still, NOISE_QUANTILE))
        if self._paused(sizes, noise, blocks, CERTAIN).sum() < ESTABLISHED:
            return NO_REPEATS
        repeated, numbers = self._paused(sizes, noise, blocks, LIKELY), np.array(self.frames[1:])
        moving = _moving(repeated, sizes, noise)
        steps = _scene_steps(numbers, moving, repeated)
        frame = float(times[-1] - times[0]) / (len(times) - 1)
        if steps is None or np.ptp(np.diff(times)) > UNEVEN * frame:
            return Repeats(tuple(numbers[repeated].tolist()))
        rate = float(usual_rate(steps, Fraction(frame)))
        first, places = _places(steps, 1.0 / (rate * frame), len(times))
        # where the scene moves too little to show a repeat, its rate does
        repeated |= ~moving & ~np.isin(numbers, first)
        return Repeats(tuple(numbers[repeated].tolist()), rate, times[0] + frame * places)

    def _paused(self, sizes: np.ndarray, noise: float, blocks: np.ndarray, share: float) -> np.ndarray:
        """Mark the pairs of pictures that differ by less than a share of the motion around, (pair,)."""
        found = np.zeros(len(sizes), dtype=bool)
        for pause in self._pauses:
            before, after = sizes[pause.first - 1], sizes[pause.stop]
            least, most = min(before, after), max(before, after)
            if least < MOVING * noise or pause.across[blocks].sum() < ONWARD * most:
                continue
            found[pause.first : pause.stop] = sizes[pause.first : pause.stop].max() <= max(
                noise, share * least
            )
        return found


def _moving(repeated: np.ndarray, sizes: np.ndarray, noise: float) -> np.ndarray:
    """Mark the pairs of pictures that certainly differ by motion, (pair,)."""
    padded = np.pad(sizes, 1, mode="edge")
    around = np.maximum(padded[:-2], padded[2:])
    return ~repeated & (sizes > MOVING * noise) & (sizes > QUIET * around)


def _scene_steps(numbers: np.ndarray, moving: np.ndarray, repeated: np.ndarray) -> Steps | None:
    """Return the steps of a scene of constant rate in frames of the clip; None where it has none.

    Args:
        numbers: Frame number of the second picture of each pair, int (pair,).
        moving: True where a picture is certainly new, (pair,).
        repeated: True where it is certainly not, (pair,).
    """
    new = np.flatnonzero(moving)
    # from one new picture to the next is a single step where all that lies between them are repeats
    known = np.cumsum(moving | repeated)
    single = np.diff(known[new]) == np.diff(numbers[new])
    if not np.any(single):
        return None
    count = _counted(numbers[new], single)
    steps = None if np.any(np.diff(count) < 1) else explaining_steps(numbers[new], count)
    return None if steps is None or steps.shortest <= 1.0 else steps


def _counted(numbers: np.ndarray, single: np.ndarray) -> np.ndarray:
    """Count the scene's pictures from the longest run of single steps outward, int (picture,)."""
    ends = np.flatnonzero(np.concatenate(([True], ~single, [True])))
    runs = list(itertools.pairwise(ends.tolist()))
    longest = int(np.argmax(np.diff(ends)))
    count = np.arange(len(numbers))
    # A run without a repeat does not determine the step; its mean over all runs does, to one over their
    # number. A rounded number having a variance of 1 / 12, that is worth so much against the line of a run:
    usual, weight = float(np.mean(np.diff(numbers)[single])), single.sum() ** 2 / 12.0
    first, stop = runs[longest]
    for first_run, stop_run in [*runs[longest + 1 :], *runs[:longest][::-1]]:
        known = slice(first, stop)
        middle = count[known].mean()
        along = count[known] - middle
        step = float(along @ numbers[known] + weight * usual) / float(along @ along + weight)
        # all pictures of the next run together say which the first of them is
        run = slice(first_run, stop_run)
        places = (numbers[run] - numbers[known].mean()) / step + middle
        count[run] += round(float(np.mean(places - count[run])))
        first, stop = min(first, first_run), max(stop, stop_run)
    return count


def _places(steps: Steps, step: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return where the pictures of a scene belong.

    Args:
        steps: Steps of the scene's pictures, in frames of the clip.
        step: The one of them that is taken.
        count: Number of frames of the clip.

    Returns:
        The frames that are the first to show a picture of the scene, int (frame,), and the place of every
        frame within the clip [frames], (frame,); repeats lie between the pictures around them.
    """
    # in the middle of where it may be the rounding of the pictures that are not known is most certain
    begin = float(np.mean(steps.begin(step)))
    numbers = np.arange(-int((begin + 1.0) / step) - 1, int((count - begin) / step) + 2)
    exact = begin + step * numbers
    first = np.rint(exact).astype(int)
    return first, np.interp(np.arange(count), first, exact)


def _squares(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the mean squared difference of two pictures in each block, over the channels, (block,)."""
    from monodyn.vision.clip.blocks import block_squares

    squares = np.empty([min(BLOCKS, side) for side in one.shape[1:]], dtype=np.float32)
    block_squares(one, other, squares)
    return squares.ravel()
