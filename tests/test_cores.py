"""Work on all cores: order, errors, more than one thread, work within work."""

from __future__ import annotations

import threading

import pytest

from monodyn import cores
from monodyn.cores import on_all_cores


def test_results_come_in_the_order_of_the_items(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cores, "_cores", lambda: 2)
    both = threading.Barrier(2, timeout=20.0)

    def square(number: int) -> int:
        # neither of the first two ends before the other has begun
        if number < 2:
            both.wait()
        return number * number

    assert on_all_cores(square, iter(range(50))) == [number * number for number in range(50)]
    assert on_all_cores(square, []) == []


def test_an_error_of_the_function_is_raised() -> None:
    with pytest.raises(ZeroDivisionError):
        on_all_cores(lambda number: 1 // number, [2, 1, 0, 3])


def test_work_within_work_waits_for_no_thread() -> None:
    """All threads are taken by what waits for more of them."""
    found = on_all_cores(lambda k: on_all_cores(lambda number: k * number, range(20)), range(40))
    assert found == [[k * number for number in range(20)] for k in range(40)]
