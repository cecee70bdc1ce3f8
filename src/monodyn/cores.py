"""Work on all cores: kernels leave the interpreter to other threads."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")
NAME = "monodyn-core"
"""How the names of the threads begin."""


def on_all_cores(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Apply a function to every item, several at a time.

    Args:
        function: What is done; it changes nothing that it shares.
        items: What it is done to.

    Returns:
        The results in the order of the items.

    Raises:
        Exception: Whatever the function raises, of the first item for which it does.
    """
    # one of these threads that waited for the others could wait for itself
    if threading.current_thread().name.startswith(NAME):
        return [function(item) for item in items]
    return list(_threads(os.getpid(), _cores()).map(function, items))


@cache
def _threads(process: int, count: int) -> ThreadPoolExecutor:
    """Return the threads of a process; they stay, for starting them takes longer than many a task."""
    return ThreadPoolExecutor(count, thread_name_prefix=NAME)


def _cores() -> int:
    """Return how many cores this process may use."""
    allowed = getattr(os, "sched_getaffinity", None)  # Linux alone has it
    return len(allowed(0)) if allowed else os.cpu_count() or 1
