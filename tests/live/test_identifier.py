"""From where on the motion of a stream goes on without a break, and why: poses are made up."""

from __future__ import annotations

import math
import threading
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from fits import identified
from lives import double
from monodyn.estimation.fit import Doubt
from monodyn.estimation.settings import IdentifySettings
from monodyn.live.identifier import Cut, Identifier, Reviewed
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
def begun(monkeypatch):
    """Return an identifier that has begun with frames 0 to 44, and with later ones."""
    made = []

    def beginning(later: Poses | None = None) -> Identifier:
        identifier = Identifier(LiveSettings(), IdentifySettings(), in_order=False)
        made.append(identifier)
        found: Any = SimpleNamespace(poses=rows(0, 45))
        with monkeypatch.context() as patched:
            patched.setattr(identifier, "_look_again", lambda _: None)
            identifier.begin(found, later)
        identifier._found = None
        identifier._take_up(Reviewed(identified(), None, 44 / RATE))
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


@pytest.mark.parametrize(
    ("stop", "wanted"), [(120, Cut(100 / RATE, "unseen")), (180, Cut(160 / RATE, "searching"))]
)
def test_poses_that_come_together_count_as_one_after_the_other(begun, stop, wanted):
    """Behind what was followed while the mechanism was looked for, gaps and all."""
    together = joined(
        [rows(45, 60), rows(60, 100, seen=False), rows(100, 120), rows(160, 170), rows(170, 180, seen=False)]
    )
    together = together[: int(np.searchsorted(together.frame, stop))]
    at_once, each = begun(together), begun()
    # as while it begins
    each._begun = -math.inf
    for k in range(len(together)):
        each._recorded(together[k : k + 1])
    for identifier in (at_once, each):
        identifier.take(rows(stop + 15, stop + 16))
    assert at_once.cut == each.cut == wanted
    for since, after in ((0.0, False), (100 / RATE, False), (100 / RATE, True), (6.5, True), (7.0, False)):
        one, other = (identifier.record.since(since, after=after) for identifier in (at_once, each))
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


def located(mechanism: object, doubt: str | None = None) -> Any:
    """Return what was found in the frames from 30 to 44."""
    video = SimpleNamespace(times=np.arange(30, 45) / RATE)
    return SimpleNamespace(scene=SimpleNamespace(mechanism=mechanism, video=video), doubt=doubt)


class Estimating:
    """In place of a horizon: what it was given, by the clock that it sets forward."""

    def __init__(self, now: list[float]) -> None:
        self.given: list[list[int]] = []
        self.now, self.takes, self.goes_on = now, 0.0, threading.Event()
        self.goes_on.set()

    def add(self, poses: Poses) -> None:
        self.goes_on.wait()
        self.given.append(poses.frame.tolist())
        self.now[0] += self.takes

    def broken_off(self) -> Estimating:
        self.given.append([])
        return self


@pytest.fixture
def estimating(begun, monkeypatch):
    """Return an identifier, what estimates for it, and a way to take a frame once all before is done."""
    now = [0.0]
    monkeypatch.setattr("monodyn.live.identifier.time", SimpleNamespace(perf_counter=lambda: now[0]))
    identifier, horizon = begun(), Estimating(now)
    identifier._horizon = horizon

    def taken(frame: int, at: float, **how: bool) -> None:
        if identifier._estimating is not None:
            identifier._estimating.result()
        now[0] = at
        identifier.take(rows(frame, frame + 1), **how)

    return identifier, horizon, taken


def test_where_poses_come_faster_than_it_works_identification_rests_for_as_long_as_it_took(estimating):
    identifier, horizon, taken = estimating
    horizon.takes = 1.0
    # done at 1, so that it rests until 2
    taken(45, 0.0)
    two_wait(identifier, taken)
    taken(48, 1.9)
    taken(49, 2.0)
    # one that waits alone is taken at once
    taken(50, 2.5)
    identifier.settle(lambda job: job.result())
    assert horizon.given == [[45], [46, 47, 48, 49], [50]]


def test_nor_does_who_waits_for_it_begin_before_it_has_rested(estimating):
    identifier, horizon, taken = estimating
    horizon.takes = 1.0
    taken(45, 0.0)
    two_wait(identifier, taken)
    assert not identifier.settle(lambda job: job.result())
    assert horizon.given == [[45]]


def test_what_waits_when_the_clock_breaks_is_of_the_motion_before(estimating):
    identifier, horizon, taken = estimating
    horizon.takes = 1.0
    taken(45, 0.0)
    two_wait(identifier, taken)
    taken(48, 1.6, broken=True)
    taken(49, 5.0)
    identifier.settle(lambda job: job.result())
    assert horizon.given == [[45], [46, 47], [], [48], [49]]


def test_where_every_pose_waits_for_what_is_identified_nothing_rests(estimating):
    """The same poses give the same numbers, however long each of them took."""
    identifier, horizon, taken = estimating
    identifier._in_order, horizon.takes = True, 1.0
    taken(45, 0.0)
    identifier._pending = [rows(46, 47)]
    taken(47, 1.1)
    assert horizon.given == [[45], [46, 47]]


def two_wait(identifier: Identifier, taken: Any) -> None:
    """Have two poses come while what came before is identified."""
    busy = identifier._estimating
    assert busy is not None
    busy.result()
    identifier._estimating = cast("Any", SimpleNamespace(done=lambda: False, result=lambda: None))
    taken(46, 1.2)
    taken(47, 1.4)
    identifier._estimating = busy


def test_what_waits_is_handed_over_before_a_break_that_comes_while_it_works(estimating):
    identifier, horizon, taken = estimating
    horizon.takes = 1.0
    horizon.goes_on.clear()
    taken(45, 0.0)
    for frame in (46, 47):
        identifier.take(rows(frame, frame + 1))
    threading.Timer(0.1, horizon.goes_on.set).start()
    identifier.take(rows(48, 49), broken=True)
    assert horizon.given[:3] == [[45], [46, 47], []]


def test_verdict_and_status_are_those_of_the_fit_that_the_estimate_rests_on(begun):
    """A stretch that was identified anew counts from the first frame that is identified with it."""
    identifier = begun()
    assert identifier.base is identifier.fit
    before = identified()
    estimate: Any = SimpleNamespace(base=before)
    identifier.estimate = estimate
    identifier.fit = double()
    assert identifier.base is before


@pytest.mark.parametrize(
    ("grade", "torque", "why"),
    [
        ("refused", "friction", "It is another mechanism."),
        ("trusted", "free", "a torque over time acts in it."),
        # held upright, say: the model holds, only that its motion cannot be followed for as long
        ("trusted", "known", ""),
    ],
)
def test_a_stretch_from_which_nothing_goes_on_is_a_doubt_where_its_model_does_not_hold(
    begun, grade, torque, why
):
    identifier, doubts = begun(), list[str]()
    going_on: Any = SimpleNamespace(doubted=lambda why: doubts.append(why) or going_on)
    identifier._horizon = going_on
    fit = replace(identified(), torque=torque)
    fit = fit if grade == "trusted" else fit.doubted([Doubt(grade, why)])
    identifier._take_up(Reviewed(fit, None, 3.0))
    assert identifier._horizon is going_on
    assert doubts == ([why] if why else [])


@pytest.mark.parametrize(
    ("followed", "whole", "identified_from"),
    [(0, 91, 0), (45, 91, 45), (46, 91, None), (90, 91, None), (40, 60, 40), (40, 59, None)],
)
def test_of_a_stretch_that_ends_upright_nothing_is_identified(
    begun, monkeypatch, followed, whole, identified_from
):
    """Where half of it can be followed as one motion that is, and the next look comes as ever."""
    given: list[list[int]] = []
    fit = identified()

    def identify(poses: Poses, *_: object) -> object:
        given.append(poses.frame.tolist())
        return fit

    monkeypatch.setattr("monodyn.live.identifier.identify", identify)
    monkeypatch.setattr("monodyn.live.identifier.horizon_of", lambda *_: None)
    monkeypatch.setattr("monodyn.live.identifier.redrawn", lambda fit, *_: fit)
    monkeypatch.setattr("monodyn.live.identifier.followed_from", lambda *_: followed)
    stretch = joined([rows(0, whole), rows(whole, 91, seen=False)] if whole < 91 else [rows(0, 91)])
    identifier, nothing = begun(), located(None)
    done = identifier._reviewed(stretch, nothing, fit)
    assert given == ([] if identified_from is None else [list(range(identified_from, 91))])
    assert (done is None) == (identified_from is None)
    # what nothing is known of is identified as it is
    assert identifier._reviewed(stretch, nothing, None) is not None
    assert given[-1] == list(range(91))


def test_a_stretch_that_the_pictures_contradict_is_refused(begun, monkeypatch):
    """As after a run: what is reported of a stretch is drawn again before it gets its grade."""
    fit, found, drawn = identified(), located("the mechanism"), []

    def contradicted(*given: Any) -> Any:
        drawn.append(given)
        return fit.doubted([Doubt("refused", "The pictures show another motion.")])

    monkeypatch.setattr("monodyn.live.identifier.identify", lambda *_: fit)
    monkeypatch.setattr("monodyn.live.identifier.horizon_of", lambda fit, *_: fit.ok or None)
    monkeypatch.setattr("monodyn.live.identifier.redrawn", contradicted)
    done = begun()._reviewed(rows(30, 91), found, None)
    ((given, scene, poses),) = drawn
    assert (given, scene) == (fit, found.scene)
    # by the pictures of the clip in which the scene was found, which began after a second
    assert poses.frame[:15].tolist() == list(range(15))
    assert min(poses.frame[15:]) > 14
    assert (done.fit.grade, done.horizon) == ("refused", None)


def test_no_fit_of_a_scene_that_is_in_doubt_is_trusted(begun, monkeypatch):
    fit = identified()
    monkeypatch.setattr("monodyn.live.identifier.identify", lambda *_: fit)
    monkeypatch.setattr("monodyn.live.identifier.horizon_of", lambda fit, *_: fit.ok or None)
    monkeypatch.setattr("monodyn.live.identifier.redrawn", lambda fit, *_: fit)
    identifier = begun()
    assert identifier._reviewed(rows(0, 91), located(None), None).fit.grade == "trusted"
    refused = identifier._reviewed(rows(0, 91), located(None, "It is something else."), None).fit
    assert (refused.grade, refused.status) == ("refused", "It is something else.")


def test_it_is_looked_again_soon_after_a_stretch_that_was_left_out(begun, monkeypatch):
    """But not later than where the motion has begun anew meanwhile."""
    for broken in (False, True):
        identifier = begun(rows(45, 120))
        identifier._found = cast(Any, "what was found")
        left_out = cast(Any, SimpleNamespace(done=lambda: True, result=lambda: None))
        monkeypatch.setattr(identifier._long, "submit", lambda *_, left_out=left_out: left_out)
        now, before = identifier._next, identifier.fit
        identifier._look_again(now)
        again = now + LiveSettings().begin
        assert identifier._next == pytest.approx(again)
        identifier.take(rows(120, 121), broken=broken)
        assert identifier._review is None
        assert identifier.fit is before
        assert identifier._next == pytest.approx(120 / RATE + LiveSettings().begin if broken else again)


@pytest.mark.parametrize("goes_on", [True, False])
def test_only_a_fit_that_something_goes_on_from_says_what_can_be_followed(begun, monkeypatch, goes_on):
    identifier, asked = begun(rows(45, 120)), []
    identifier._found = cast(Any, "what was found")
    identifier._horizon = cast(Any, SimpleNamespace()) if goes_on else None
    monkeypatch.setattr(identifier._long, "submit", lambda *given: asked.append(given))
    identifier._look_again(identifier._next)
    ((_, poses, found, known),) = asked
    assert found == "what was found"
    assert len(poses) == 120
    assert known is (identifier.fit if goes_on else None)
