"""From where on the motion of a stream goes on without a break, and why: poses are made up."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fits import identified
from lives import double
from monodyn.estimation.settings import IdentifySettings
from monodyn.live.identifier import Cut, Identifier
from monodyn.live.record import Record, joined
from monodyn.live.settings import LiveSettings
from monodyn.types import Poses

RATE = 30.0


def rows(first: int, stop: int, seen: bool = True) -> Poses:
    """Return poses of a hinge by the numbers of their frames."""
    count = stop - first
    position = np.sin(np.arange(first, stop) / 10.0)[:, None] if seen else np.full((count, 1), np.nan)
    return Poses(
        ("joint1",), np.arange(first, stop), np.arange(first, stop) / RATE, position,
        np.full((count, 1, 1), 1e-6), np.full(count, seen),
    )  # fmt: skip


@pytest.fixture
def begun():
    """Return an identifier that has begun with frames 0 to 44, and with later ones."""
    made = []

    def beginning(later: Poses | None = None) -> Identifier:
        identifier = Identifier(LiveSettings(), IdentifySettings(), in_order=False)
        made.append(identifier)
        found: Any = SimpleNamespace(
            scene=SimpleNamespace(mechanism=None), poses=rows(0, 45), fit=identified()
        )
        begun: Any = SimpleNamespace(found=found, horizon=None, later=later, estimate=None)
        identifier.begin(begun)
        return identifier

    yield beginning
    for identifier in made:
        identifier.close()


def test_a_search_that_takes_long_breaks_nothing_off_where_its_frames_were_followed(begun):
    identifier = begun(rows(45, 222))
    identifier.take(rows(222, 223))
    assert identifier.cut == Cut(0.0)


def test_why_a_motion_begins_anew_is_known(begun):
    cases: tuple[Any, ...] = (
        (None, [rows(100, 101)], 100, "searching"),
        (rows(45, 60), [rows(200, 201)], 200, "searching"),
        (rows(45, 60), [rows(60, 61), rows(100, 101)], 100, "too fast"),
        (None, [*(rows(k, k + 1, seen=False) for k in range(45, 90)), rows(90, 91)], 90, "unseen"),
        (None, [*(rows(k, k + 1, seen=False) for k in range(45, 60)), rows(60, 61)], 0, ""),
    )
    for later, taken, first, why in cases:
        identifier = begun(later)
        for row in taken:
            identifier.take(row)
        assert identifier.cut == Cut(first / RATE, why)
    identifier = begun()
    identifier.take(rows(45, 46), broken=True)
    assert identifier.cut == Cut(45 / RATE, "stamps")


def test_poses_that_come_together_count_as_one_after_the_other(begun):
    """Behind what was followed while the mechanism was looked for, gaps and all."""
    together = joined(
        [rows(45, 60), rows(60, 100, seen=False), rows(100, 120), rows(160, 170), rows(170, 180, seen=False)]
    )
    at_once, each = begun(together), begun()
    # as while it begins
    each._begun = -math.inf
    for k in range(len(together)):
        each._recorded(together[k : k + 1])
    for identifier in (at_once, each):
        identifier.take(rows(195, 196))
    assert at_once.cut == each.cut == Cut(160 / RATE, "searching")
    for time, after in ((0.0, False), (100 / RATE, False), (100 / RATE, True), (6.5, True), (7.0, False)):
        one, other = (identifier.record.since(time, after=after) for identifier in (at_once, each))
        assert (one is None) == (other is None)
        assert one is None or one.frame.tolist() == other.frame.tolist()
    for name in ("frame", "time", "position", "seen"):
        one, other = (getattr(identifier.record.whole, name) for identifier in (at_once, each))
        np.testing.assert_array_equal(one, other)


def test_the_record_keeps_what_moves_all_positions_for_a_while_and_the_rest_for_good():
    record = Record(2.0)
    record.add(rows(0, 30))
    for k in range(30, 150):
        record.add(rows(k, k + 1))
    recent, last, whole = record.since(0.0), record.last, record.whole
    assert recent is not None
    assert last is not None
    assert whole is not None
    assert recent.frame.tolist() == list(range(89, 150))
    assert last.frame.tolist() == [149]
    assert whole.frame.tolist() == list(range(150))
    np.testing.assert_allclose(whole.position, rows(0, 150).position)


def test_where_poses_are_late_identification_rests_for_as_long_as_it_took(begun, monkeypatch):
    handed, now = [], [0.0]
    monkeypatch.setattr("monodyn.live.identifier.time", SimpleNamespace(perf_counter=lambda: now[0]))
    identifier = begun()
    identifier._horizon = SimpleNamespace(add=lambda poses: handed.append(poses.frame.tolist()))

    def taken(frame: int, at: float, *, late: bool) -> None:
        # what was handed over before is done by then
        if identifier._estimating is not None:
            identifier._estimating.result()
        now[0] = at
        identifier.take(rows(frame, frame + 1), late=late)

    taken(45, 0.0, late=True)
    # a second was spent on the first one
    for frame, at in ((46, 1.0), (47, 1.5), (48, 1.9), (49, 2.0)):
        taken(frame, at, late=True)
    # without delay there is no rest
    for frame in (50, 51):
        taken(frame, 3.0, late=False)
    identifier.settle(lambda job: job.result())
    assert handed == [[45], [46, 47, 48, 49], [50], [51]]


def test_verdict_and_status_are_those_of_the_fit_that_the_estimate_rests_on(begun):
    """A stretch that was identified anew counts from the first frame that is identified with it."""
    identifier = begun()
    assert identifier.base is identifier.fit
    before = identified()
    estimate: Any = SimpleNamespace(base=before)
    identifier.estimate = estimate
    identifier.fit = double()
    assert identifier.base is before
