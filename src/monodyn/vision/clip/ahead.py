"""Items in, the same items out, the next ones being made by a thread while one is worked on.

Decoding, kernels and most of numpy leave other threads alone, so that a clip is decoded on one core while its
pictures are looked at on another.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from queue import SimpleQueue
from threading import Thread
from typing import TypeVar

Item = TypeVar("Item")


def made_ahead(items: Generator[Item], count: int) -> Iterator[Item]:
    """Make items on a thread of its own, in their order, a few before they are asked for.

    The thread ends with the items, with what they raise, which is raised here in its turn, or when the
    iterator is closed or given up.

    Args:
        items: What makes them; it is closed in the end.
        count: How many may wait.

    Yields:
        The items.
    """
    # an item takes a free place, which is given back when the next one is asked for
    free: SimpleQueue[bool] = SimpleQueue()
    made: SimpleQueue[tuple[Item] | BaseException | None] = SimpleQueue()
    wanted = [True] * count

    def make() -> None:
        try:
            while free.get() and wanted:
                made.put((next(items),))
        except StopIteration:
            made.put(None)
        except BaseException as error:
            made.put(error)
        finally:
            items.close()

    for place in wanted:
        free.put(place)
    thread = Thread(target=make, name="made ahead", daemon=True)
    thread.start()
    try:
        while (item := made.get()) is not None:
            if isinstance(item, BaseException):
                raise item
            yield item[0]
            free.put(True)
    finally:
        wanted.clear()
        free.put(False)
        thread.join()
