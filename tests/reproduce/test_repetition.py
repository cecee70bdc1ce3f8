"""The experiment with one pendulum: work in one process or in several, and what is not timed."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from pathlib import Path

import pytest

from experiments import repetition
from monodyn.errors import SettingsError
from monodyn.mechanism import load
from monodyn.reproduce.repetition import START, each, warm_up
from support import refuses


def squared(number: int, progress: object = None) -> int:
    """Square a number."""
    return number * number


@pytest.mark.slow
def test_results_come_in_their_order_from_one_process_or_two() -> None:
    steps: list[tuple[int, int | None]] = []

    def progress(step: str, done: int, total: int | None) -> None:
        steps.append((done, total))

    assert list(each(squared, [3, 1, 2], 1, None)) == [9, 1, 4]
    assert list(each(squared, [3, 1, 2], 2, progress)) == [9, 1, 4]
    assert steps == [(0, 3), (1, 3), (2, 3), (3, 3)]


def ended(number: int, progress: object = None) -> None:
    """Be ended by the system."""
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.slow
def test_a_worker_that_the_system_ends_is_reported_in_one_line() -> None:
    with refuses(
        SettingsError,
        "reproduce: expected 2 worker processes that finish, got one that the system has ended, as it does "
        "where memory runs out; free memory, or give --seeds 1.",
    ):
        list(each(ended, [1, 2], 2, None))


def slow(number: int, progress: object = None) -> int:
    """Take for ever, but for the first one."""
    if number:
        time.sleep(600.0)
    return number


@pytest.mark.slow
def test_workers_end_with_who_wanted_their_results() -> None:
    before = set(multiprocessing.active_children())
    results = each(slow, [0, 1], 2, None)
    assert next(results) == 0
    with pytest.raises(KeyboardInterrupt):
        results.throw(KeyboardInterrupt)
    assert set(multiprocessing.active_children()) <= before


def test_the_mechanism_that_methods_are_given_has_two_hinges(tmp_path: Path) -> None:
    path = tmp_path / "start.xml"
    path.write_text(START)
    assert [joint.kind for joint in load(path).joints] == ["hinge", "hinge"]


@pytest.mark.slow
def test_stages_are_warmed_once() -> None:
    warm_up("fast")
    hits = warm_up.cache_info().hits
    warm_up("fast")
    assert warm_up.cache_info().hits == hits + 1


def test_a_given_clip_has_one_more_assumption() -> None:
    made, given = repetition(), repetition(given=True)
    assert len(given.assumptions) == len(made.assumptions) + 1
