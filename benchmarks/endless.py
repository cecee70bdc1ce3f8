"""A stream without an end: a pendulum that swings for ever, and the memory of the process that follows it.

Without friction a double pendulum that is let go in the right place comes to rest there again and again. The
pictures of one period, each time with noise of its own, are a stream of any length.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO

import numpy as np
from scipy.optimize import root

from cases import chain
from clips import simulate, wrong
from paint import Painter
from spec import Case, mjcf
from speed import monodyn_command

SWING = Case("endless", chain((0.22, 0.18), (0.03, 0.027), damping=0.0), (), noise=0.0)
"""What swings; where it is let go follows from its period."""
HANGING = (-np.pi / 2.0, 0.0)
"""Joint positions at rest [rad]."""
ASIDE = (1.5, -0.5)
"""About where it is let go, from there [rad]."""
PERIOD = 36
"""Frames until it is there again: a quarter of it is whole, and it is longer than that of small swings."""
NOISE = 2.0
"""Standard deviation of the noise of a pixel [grey levels]."""
EVERY = 10.0
"""Between two looks at the memory [s of the stream]."""


@dataclass(frozen=True, eq=False)
class Followed:
    """What became of a stream.

    Attributes:
        time: Time in the stream at which its process was looked at [s], (sample,).
        memory: Its resident memory then [MB], (sample,).
        peak: The most it ever was [MB].
        frames: Frames that came.
        since: Those from the first one on that was identified with.
        known: Those of them that were identified with, and are motion of the mechanism.
    """

    time: np.ndarray
    memory: np.ndarray
    peak: float
    frames: int
    since: int
    known: int

    def most(self, begin: float, end: float) -> float:
        """Return the most memory over a stretch of the stream [MB].

        Args:
            begin: Its begin [s].
            end: Its end [s].
        """
        return float(self.memory[(self.time >= begin) & (self.time <= end)].max(initial=0.0))


def let_go(case: Case, frames: int = PERIOD) -> Case:
    """Return a case whose motion has a period: at rest where the case begins, hanging a quarter later.

    Args:
        case: A double pendulum without friction.
        frames: The period; a quarter of it is a whole number.

    Raises:
        ValueError: no motion like that was found.
    """
    quarter = frames // 4

    def off(start: np.ndarray) -> np.ndarray:
        tried = replace(case, start=tuple(start.tolist()), seconds=(quarter + 1) / case.rate)
        # not to hang there all along, which is a solution as well
        return (simulate(tried)[quarter, 0] - HANGING) / np.linalg.norm(start - HANGING)

    # swung to one side it goes to the other as it came: hanging after a quarter is all that is needed
    found = root(off, np.add(HANGING, ASIDE), tol=1e-10)
    if not found.success or np.abs(found.x - HANGING).max() < 0.1:
        raise ValueError(f"no motion of {case.name} with a period of {frames} frames: {found.message}")
    return replace(case, start=tuple(found.x.tolist()), seconds=frames / case.rate)


def pictures(case: Case, count: int) -> Iterator[np.ndarray]:
    """Yield grey pictures of a motion over and over again, uint8 (height, width), each with its own noise.

    Args:
        case: A motion with a period, one of which it shows.
        count: How many pictures.
    """
    painter, states = Painter(case), simulate(case)[:, :1]
    once = [np.round(painter.picture(q) @ (0.299, 0.587, 0.114)).astype(np.int16) for q in states]
    width, height = case.size
    rng = np.random.default_rng(case.seed)
    grains = np.round(rng.normal(scale=NOISE, size=(2 * height, 2 * width))).astype(np.int16)
    for number in range(count):
        row, column = rng.integers(height), rng.integers(width)
        noise = grains[row : row + height, column : column + width]
        yield np.clip(once[number % len(once)] + noise, 0, 255).astype(np.uint8)


def followed(case: Case, seconds: float) -> Followed:
    """Follow a stream by ``monodyn live`` in a process of its own, as fast as it goes.

    Args:
        case: A motion with a period.
        seconds: Length of the stream [s].

    Returns:
        What became of it.

    Raises:
        RuntimeError: the process ended before the stream.
    """
    width, height = case.size
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "model.xml"
        model.write_text(mjcf(tuple(wrong(part) for part in case.parts)))
        words = ["live", "-", "--model", str(model), "--rate", str(case.rate), "--quiet", "--ndjson", "-"]
        words += ["--live.size", f"{width},{height}", "--live.pixels", "gray"]
        command = [*monodyn_command(), *words]
        child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert child.stdin is not None
        assert child.stdout is not None
        count = round(seconds * case.rate)
        feeder = threading.Thread(target=_feed, args=(child.stdin, case, count), daemon=True)
        feeder.start()
        with child.stdout as lines:
            found = _watched(lines, child.pid)
        feeder.join()
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode not in (0, 1) or found.frames < count:
        code, frames = child.returncode, found.frames
        raise RuntimeError(f"monodyn live ended with {code} after {frames} of {count} frames.")
    peak = usage.ru_maxrss / (1024.0 if sys.platform != "darwin" else 1024.0**2)
    return replace(found, peak=peak)


def _feed(pipe: IO[bytes], case: Case, count: int) -> None:
    """Write pictures to a process, until it takes no more."""
    try:
        with pipe:
            for picture in pictures(case, count):
                pipe.write(picture.tobytes())
    except BrokenPipeError:
        return


def _watched(lines: IO[bytes], pid: int) -> Followed:
    """Return what a process writes of every frame, and its memory meanwhile."""
    looks, frames, since, known = [], 0, 0, 0
    for line in lines:
        step = json.loads(line)
        frames += 1
        since += since > 0 or step["fresh"] is not None
        known += step["fresh"] is not None and step["verdict"] != "refused"
        if step["time"] >= len(looks) * EVERY:
            looks.append((step["time"], resident(pid)))
    time, memory = np.array(looks).reshape(-1, 2).T
    return Followed(time, memory, 0.0, frames, since, known)


def resident(pid: int) -> float:
    """Return the resident memory of a process [MB].

    Args:
        pid: Its number.
    """
    said = subprocess.run(["ps", "-o", "rss=", "-p", str(pid)], capture_output=True, text=True, check=True)
    return float(said.stdout) / 1024.0
