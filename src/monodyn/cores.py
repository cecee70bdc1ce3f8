"""Work on all cores: kernels leave the interpreter to other threads."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


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
    with ThreadPoolExecutor(_cores()) as pool:
        return list(pool.map(function, items))


def _cores() -> int:
    """Return how many cores this process may use."""
    allowed = getattr(os, "sched_getaffinity", None)  # Linux alone has it
    return len(allowed(0)) if allowed else os.cpu_count() or 1
