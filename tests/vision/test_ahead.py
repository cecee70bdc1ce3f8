"""Items that a thread makes ahead: their order, errors, and that no thread is left."""

from __future__ import annotations

import threading
import time
from collections.abc import Generator

import pytest

from monodyn.vision.clip.ahead import made_ahead


def numbers(count: int, made: list[int], closed: list[bool]) -> Generator[int]:
    try:
        for k in range(count):
            made.append(k)
            yield k
    finally:
        closed.append(True)


def others() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name == "made ahead"]


def test_the_items_are_the_same_in_their_order() -> None:
    made: list[int] = []
    closed: list[bool] = []
    assert list(made_ahead(numbers(500, made, closed), 3)) == list(range(500))
    assert closed == [True]
    assert not others()


def test_nothing_is_made_before_it_is_asked_for_and_then_only_a_few() -> None:
    made: list[int] = []
    items = made_ahead(numbers(100, made, []), 4)
    assert not made
    assert next(items) == 0
    deadline = time.monotonic() + 10.0
    while len(made) < 4 and time.monotonic() < deadline:
        time.sleep(0.001)
    # the fifth would need the place of the first, which is still looked at
    time.sleep(0.02)
    assert made == [0, 1, 2, 3]
    assert next(items) == 1


@pytest.mark.parametrize("taken", [0, 1, 5])
def test_an_iterator_that_is_given_up_leaves_no_thread(taken: int) -> None:
    made: list[int] = []
    closed: list[bool] = []
    items = made_ahead(numbers(1000, made, closed), 4)
    for _ in range(taken):
        next(items)
    del items
    assert not others()
    # what was never begun need not be ended
    assert closed == ([True] if taken else [])
    assert len(made) <= taken + 4


def test_what_an_item_raises_comes_in_its_turn() -> None:
    def broken() -> Generator[int]:
        yield 1
        yield 2
        raise ValueError("the third")

    items = made_ahead(broken(), 4)
    assert [next(items), next(items)] == [1, 2]
    with pytest.raises(ValueError, match="the third"):
        next(items)
    assert not others()


def test_an_error_where_items_are_used_ends_the_thread() -> None:
    closed: list[bool] = []

    def use() -> None:
        for item in made_ahead(numbers(1000, [], closed), 4):
            if item == 7:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        use()
    assert closed == [True]
    assert not others()
