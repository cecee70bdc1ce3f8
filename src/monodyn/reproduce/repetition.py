"""The experiment with one pendulum: what each method sees in its clip and fits to it; several in two
processes."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from multiprocessing.process import BaseProcess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

from monodyn.arrays import usual_step
from monodyn.errors import SettingsError
from monodyn.paper.assumptions import Assumption
from monodyn.reproduce.assumptions import assumptions
from monodyn.reproduce.cases import run_case, run_cases
from monodyn.reproduce.clip import ClipSettings, Pendulum, make_clip
from monodyn.reproduce.evidence import Evidence
from monodyn.reproduce.given import opened
from monodyn.reproduce.plans import CASE_TORQUES, Design, own_form
from monodyn.reproduce.pose_starts import pose_starts
from monodyn.reproduce.truth import Truth
from monodyn.reproduce.vision import see
from monodyn.stages import segment
from monodyn.types import Camera, Progress

START = (Path(__file__).parent / "start.xml").read_text(encoding="utf-8")
"""The mechanism file that both methods are given."""
WARMING = ClipSettings(
    pendulum=Pendulum(length=(0.34, 0.02), width=(0.04, 0.04)),
    camera=Camera(144, 96, 140.0, 0.03, -0.17, 1.15),
    frames=20,
)
"""A small clip on which every stage is run once before it is timed: what is seen is about one rod."""
WARMING_SIZES = {"link1.length": 0.36, "link1.width": 0.04, "link1.tail": 0.0}
"""Sizes of that rod [m]."""

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class Repetition:
    """The experiment with one pendulum.

    Attributes:
        name: What the pendulum is called.
        clip: Its clip.
        settings: How the clip was made; None where it was given.
        truth: The true motion, or None.
        evidence: What each method found, by method.
    """

    name: str
    clip: Path
    settings: ClipSettings | None
    truth: Truth | None
    evidence: Mapping[str, Evidence]

    @property
    def assumptions(self) -> list[Assumption]:
        """Whether the assumptions of the paper hold for its clip."""
        return assumptions(self.evidence, given=self.settings is None)


@dataclass(frozen=True, eq=False)
class Trying:
    """One method to try on one clip.

    Attributes:
        method: ``paper`` or ``fast``.
        clip: The clip.
        model: The mechanism file that the method is given.
        truth: The true motion, or None.
        design: What is fitted.
        processes: Processes that work side by side.
    """

    method: str
    clip: str | Path
    model: str | Path
    truth: Truth | None
    design: Design
    processes: int = 1


def tried(trying: Trying, progress: Progress | None = None) -> Evidence:
    """Find poses and fits with one method.

    Args:
        trying: The method and the clip.
        progress: Called with the steps done.
    """
    warm_up(trying.method)
    return _found(trying, progress)


def _found(trying: Trying, progress: Progress | None) -> Evidence:
    video, mechanism = opened(trying.clip, trying.model)
    design, truth = trying.design.within(video.count), trying.truth
    seen = see(trying.method, segment(video, progress=progress), mechanism, truth, progress)
    cases = run_cases(seen, truth, design, progress)
    starts = pose_starts(seen, truth, design.seed)
    interval = usual_step(video.times)
    return Evidence(seen, cases, design, interval, starts, trying.processes)


@cache
def warm_up(method: str) -> None:
    """Run every stage of a method once on a small clip, so that loading and compiling are not timed.

    Args:
        method: ``paper`` or ``fast``.
    """
    with TemporaryDirectory() as folder:
        clip = Path(folder) / "clip.mp4"
        make_clip(clip, WARMING)
        # with a single joint and known sizes the searches are short, and the compiled functions are the same
        video, mechanism = opened(clip, "single")
        mechanism = mechanism.with_choices(fix=WARMING_SIZES)
        design = Design(frames=WARMING.frames, ahead=0, lengths=())
        seen = see(method, segment(video), mechanism, None, both_forms=False)
        for name in CASE_TORQUES:
            run_case(own_form(method, name, WARMING.frames), seen, None, design)


def _stopped_by_interrupt() -> None:
    """Let Ctrl-C end a worker at once; the first process reports it and tidies up."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@contextmanager
def _ended_with(others: set[BaseProcess]) -> Iterator[None]:
    """End the worker processes where the block does not come to its end: nobody waits for their results."""
    try:
        yield
    except BaseException:
        for worker in set(multiprocessing.active_children()) - others:
            worker.terminate()
        raise


def each(
    function: Callable[[Item, Progress | None], Result],
    items: Sequence[Item],
    processes: int,
    progress: Progress | None,
) -> Iterator[Result]:
    """Yield what a function makes of each item, in their order, in several processes where that is allowed.

    Args:
        function: A function of a module, called with an item and with progress or None.
        items: The items.
        processes: Processes at most; 1 stays in this one.
        progress: Passed on within this process; else called with the items done.

    Yields:
        The results.

    Raises:
        SettingsError: the system has ended a worker process.
    """
    count = min(processes, len(items))
    if count < 2:
        for item in items:
            yield function(item, progress)
        return
    # a fresh interpreter each: a fork would copy locks of the threads that decoding has started
    context = multiprocessing.get_context("spawn")
    with (
        ProcessPoolExecutor(count, mp_context=context, initializer=_stopped_by_interrupt) as pool,
        _ended_with(set(multiprocessing.active_children())),
    ):
        waiting = [pool.submit(function, item, None) for item in items]
        for done, future in enumerate(waiting):
            if progress is not None:
                progress("experiments", done, len(items))
            try:
                yield future.result()
            except BrokenProcessPool:
                raise SettingsError(
                    f"reproduce: expected {count} worker processes that finish, got one that the system has "
                    "ended, as it does where memory runs out; free memory, or give --seeds 1."
                ) from None
    if progress is not None:
        progress("experiments", len(items), len(items))
