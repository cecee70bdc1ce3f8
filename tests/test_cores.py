"""Work on all cores: order, errors, more than one thread, work within work."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

from monodyn import cores
from monodyn.cores import beside, on_all_cores


def test_results_come_in_the_order_of_the_items(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cores, "_cores", lambda: 2)
    both = threading.Barrier(2, timeout=20.0)

    def square(number: int) -> int:
        # neither the first nor the last ends before the other has begun
        if number in (0, 49):
            both.wait()
        return number * number

    assert on_all_cores(square, iter(range(50))) == [number * number for number in range(50)]
    assert on_all_cores(square, []) == []


def test_the_error_of_the_first_item_that_has_one_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    # another one fails before it has
    monkeypatch.setattr(cores, "_cores", lambda: 2)

    later = threading.Event()

    def refused(number: int) -> int:
        if number == 17:
            assert later.wait(20.0)
        if number > 17:
            later.set()
        if number >= 17:
            raise ValueError(number)
        return number

    with pytest.raises(ValueError, match=r"^17$"):
        on_all_cores(refused, range(60))


@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt])
def test_after_an_error_the_rest_is_left_undone(
    error: type[BaseException], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cores, "_cores", lambda: 2)
    asking, begun = threading.current_thread(), threading.Event()
    asked, done = [], []

    def work(number: int) -> None:
        if threading.current_thread() is asking:
            asked.append(number)
            assert begun.wait(20.0)
            raise error
        begun.set()
        # all of them would take 8 s
        time.sleep(0.01)
        done.append(number)

    with pytest.raises(error):
        on_all_cores(work, range(800))
    # the one other thread comes here after its part
    cores._threads(os.getpid(), 1).submit(int).result(20.0)
    assert len(asked) == 1
    assert 1 <= len(done) < 400


def test_the_thread_that_asks_works_while_the_others_are_busy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cores, "_cores", lambda: 2)
    free = threading.Event()
    busy = cores._threads(os.getpid(), 1).submit(free.wait, 20.0)
    assert on_all_cores(lambda number: 2 * number, range(5)) == [0, 2, 4, 6, 8]
    assert not busy.done()
    free.set()


def test_work_within_work_waits_for_no_thread() -> None:
    """All threads are taken by what waits for more of them."""
    found = on_all_cores(lambda k: on_all_cores(lambda number: k * number, range(20)), range(40))
    assert found == [[k * number for number in range(20)] for k in range(40)]


def test_no_more_work_at_a_time_than_is_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cores, "_cores", lambda: 4)
    lock, going, most = threading.Lock(), [0], [0]

    def work(number: int) -> int:
        with lock:
            going[0] += 1
            most[0] = max(most[0], going[0])
        threading.Event().wait(0.01)
        with lock:
            going[0] -= 1
        return number

    assert on_all_cores(work, range(9), most=2) == list(range(9))
    assert most[0] <= 2


def test_the_block_goes_on_beside_the_work() -> None:
    both = threading.Barrier(2, timeout=20.0)

    def work(go_on: Callable[[], None]) -> int:
        both.wait()
        go_on()
        return 7

    with beside(work) as result:
        both.wait()
        assert result() == 7


def test_an_error_of_the_work_is_raised_where_its_result_is_asked_for() -> None:
    with pytest.raises(ZeroDivisionError), beside(lambda go_on: 1 // 0) as result:
        result()


def test_work_ends_where_its_block_is_left() -> None:
    begun, ended = threading.Event(), threading.Event()

    def work(go_on: Callable[[], None]) -> None:
        begun.set()
        try:
            while True:
                go_on()
        finally:
            ended.set()

    def leave() -> None:
        with beside(work):
            assert begun.wait(20.0)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        leave()
    assert ended.is_set()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the allocator of Linux")
def test_a_large_array_that_is_let_go_leaves_the_process() -> None:
    code = (
        "import ctypes, numpy as np\n"
        "from monodyn.cores import LARGE, give_back_large\n"
        "def held(): return int(open('/proc/self/statm').read().split()[1]) * 4096\n"
        "give_back_large()\n"
        # without it the first array of a size is enough for the next ones to stay among what is small
        "np.ones(4 * LARGE, np.uint8)\n"
        "many = [np.ones(2 * LARGE, np.uint8) for _ in range(10)]\n"
        "before, last = held(), many.pop()\n"
        "many.clear()\n"
        "assert before - held() > 8 * 2 * LARGE\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the allocator of Linux")
def test_threads_share_one_heap() -> None:
    code = (
        "import sys, threading\n"
        "from monodyn.cores import share_one_heap\n"
        "if sys.argv[1] == 'shared': share_one_heap()\n"
        "both = threading.Barrier(3)\n"
        "def work():\n"
        "    held = [bytearray(1000) for _ in range(2000)]\n"
        "    both.wait(20.0); both.wait(20.0)\n"
        "threads = [threading.Thread(target=work) for _ in range(2)]\n"
        "for thread in threads: thread.start()\n"
        "both.wait(20.0)\n"
        "# each further heap is a reservation of 64 MB that nothing may read or write yet\n"
        "lines = open('/proc/self/smaps').read().split('VmFlags')\n"
        "sizes = [int(a.split('-')[1].split()[0], 16) - int(a.split('-')[0].split()[-1], 16)\n"
        "         for a in lines if '---p' in a]\n"
        "print(sum(60e6 < size < 67_108_864 for size in sizes))\n"
        "both.wait(20.0)\n"
    )
    found = [
        int(subprocess.run([sys.executable, "-c", code, how], check=True, capture_output=True).stdout)
        for how in ("own", "shared")
    ]
    assert found[0] >= 2
    assert found[1] == 0


def test_numbers_that_overflow_are_let_pass_where_the_caller_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two items meet: each is worked on by a thread of its own."""
    monkeypatch.setattr(cores, "_cores", lambda: 2)
    both = threading.Barrier(2, timeout=10.0)

    def overflowed(value: float) -> float:
        both.wait()
        return float(np.exp(np.array([value]))[0])

    with np.errstate(over="ignore"):
        assert on_all_cores(overflowed, [1e4, 2e4]) == [np.inf, np.inf]
    with np.errstate(over="raise"), pytest.raises(FloatingPointError):
        on_all_cores(overflowed, [1e4, 2e4])
