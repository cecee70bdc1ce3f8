"""What a process has of its machine: work on all cores, or beside other work, and memory that is given back.

Kernels leave the interpreter to other threads, but for some that take microseconds.
"""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import copy_context
from functools import cache
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")
NAME = "monodyn-core"
"""How the names of the threads begin."""
MMAP_THRESHOLD = -3
"""Number of the setting from which size on an array has pages of its own, in malloc.h."""
ARENA_MAX = -8
"""Number of the setting of how many heaps there may be, likewise."""
LARGE = 2_000_000
"""Least size of such an array [bytes]: a plane of colours of a picture in 4K; of ordinary ones hardly any."""


def on_all_cores(
    function: Callable[[Item], Result], items: Iterable[Item], *, most: int | None = None
) -> list[Result]:
    """Apply a function to every item, several at a time.

    Args:
        function: What is done; it changes nothing that it shares.
        items: What it is done to.
        most: How many at a time at most, where each of them takes much memory; None for as many as there are
            cores.

    Returns:
        The results in the order of the items.

    Raises:
        Exception: Whatever the function raises, of the first item for which it does.
    """
    every, cores = list(items), _cores()
    others = min(cores, most or len(every), len(every)) - 1
    if others < 1:
        return [function(item) for item in every]
    left, found = deque(range(len(every))), {}
    failed: dict[int, Exception] = {}

    def work() -> None:
        while True:
            try:
                number = left.popleft()
            except IndexError:
                return
            try:
                found[number] = function(every[number])
            except Exception as error:
                failed[number] = error
                left.clear()

    # the thread that asks works, too: to wait for others takes longer than many an item
    threads, jobs = _threads(os.getpid(), cores - 1), []
    try:
        for _ in range(others):
            # numpy's errors are treated as the caller treats them
            jobs.append(threads.submit(copy_context().run, work))
        work()
        for job in jobs:
            # Where all threads are busy, as with work within work, nothing is left for them. One that has
            # begun ends, for it waits for nothing but what was begun within its own items.
            if not job.cancel():
                job.result()
    finally:
        # after Ctrl-C nobody waits for the rest
        left.clear()
    if failed:
        # items are taken in their order: all before the first of these were done
        raise failed[min(failed)]
    return [found[number] for number in range(len(every))]


@contextmanager
def beside(work: Callable[[Callable[[], None]], Result]) -> Iterator[Callable[[], Result]]:
    """Do something on a thread of its own while the block goes on.

    Args:
        work: What is done. It is given a function to call now and then: once the block was left early, as by
            Ctrl-C, this raises, and so ends the work.

    Yields:
        A function that waits for the end of the work and returns what came of it, or raises what it raised.
    """
    left = threading.Event()

    def go_on() -> None:
        if left.is_set():
            raise CancelledError

    with ThreadPoolExecutor(1, thread_name_prefix="monodyn-beside") as thread:
        job = thread.submit(work, go_on)
        try:
            yield job.result
        finally:
            left.set()


@cache
def _threads(process: int, count: int) -> ThreadPoolExecutor:
    """Return the threads of a process; they stay, for starting them takes longer than many a task."""
    return ThreadPoolExecutor(count, thread_name_prefix=NAME)


def _cores() -> int:
    """Return how many cores this process may use."""
    allowed = getattr(os, "sched_getaffinity", None)  # Linux alone has it
    return len(allowed(0)) if allowed else os.cpu_count() or 1


def share_one_heap() -> None:
    """Have all threads of a process take what is small from one heap; before any of them is begun.

    The allocator of Linux gives each thread a heap of its own, in which what a thread has let go stays: some
    40 MB of an ordinary run. Other systems do not do so.
    """
    _allocator_set(ARENA_MAX, 1)


def give_back_large() -> None:
    """Have the arrays of large pictures return their memory to the system as soon as they are let go.

    The allocator of Linux puts what it has seen let go once among what is small, in a heap for each thread,
    and there the gaps that temporary arrays leave stay: a quarter as much memory again for pictures in 4K.
    Other systems do not do so.
    """
    _allocator_set(MMAP_THRESHOLD, LARGE)


def _allocator_set(setting: int, value: int) -> None:
    """Change a setting of the allocator of Linux, and return what it holds in vain."""
    # an allocator without this function is not the one in question
    system = ctypes.CDLL(None) if sys.platform == "linux" else None
    if hasattr(system, "mallopt") and hasattr(system, "malloc_trim"):
        system.mallopt(setting, value)
        system.malloc_trim(0)
