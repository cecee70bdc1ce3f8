from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fits import identified
from monodyn.estimation.fit import Doubt
from monodyn.results.fill import fill
from monodyn.results.heldout import excluded, excluded_note, held_out, heldout_doubts
from monodyn.results.predict import predict
from monodyn.results.trace import Trace, trace_of
from monodyn.types import Poses

TIMES = np.arange(30) / 30.0


def traced(off: np.ndarray, *, seen: np.ndarray | None = None) -> Trace:
    """Return a record that differs from the fitted motion by ``off`` (frame,) [rad], with its prediction."""
    fit = identified()
    position = fill(fit, TIMES).position + off[:, np.newaxis]
    seen = np.ones(len(TIMES), dtype=bool) if seen is None else seen
    poses = Poses(("joint1",), np.arange(len(TIMES)), TIMES, position, np.zeros((len(TIMES), 1, 1)), seen)
    return trace_of(fit, poses, predict(fit, times=TIMES[len(fit.time[0]) :]))


def after(value: float, begin: int = 0) -> np.ndarray:
    """Return zero in the fitted frames, and a value from some frame after them on."""
    count = len(identified().time[0])
    return np.where(np.arange(len(TIMES)) >= count + begin, value, 0.0)


def swing() -> float:
    """Return the range of the fitted motion [rad]."""
    return float(np.ptp(fill(identified(), identified().time[0]).position))


def test_a_prediction_that_holds_leaves_no_doubt() -> None:
    fit, trace = identified(), traced(np.zeros(len(TIMES)))
    found = held_out(fit, trace)
    assert found is not None
    assert found.holds == np.inf
    assert found.bands[0] == pytest.approx(0.0, abs=1e-3)
    assert heldout_doubts(fit, trace) == []


def test_nothing_is_held_out_where_nothing_was_measured() -> None:
    fit, count = identified(), len(identified().time[0])
    trace = traced(after(1.0), seen=np.arange(len(TIMES)) < count)
    assert held_out(fit, trace) is None
    assert heldout_doubts(fit, trace) == []


def test_the_time_for_which_a_prediction_holds_is_said() -> None:
    fit = replace(identified(), rms={"joint1": 1.0})
    off = 0.2 * swing()
    trace = traced(after(off, 7))
    found = held_out(fit, trace)
    assert found is not None
    assert found.holds == pytest.approx(8 / 30.0)
    rms = np.degrees(off * np.sqrt(3 / 10))
    assert heldout_doubts(fit, trace) == [
        Doubt(
            "approximate",
            "The prediction holds for 0.27 s after the fitted frames; then joint1 is off by more than "
            f"10% of its range, {rms:.3g} deg rms over the 0.33 s that were held out.",
        )
    ]


def test_a_motion_that_goes_another_way_at_once_is_refused() -> None:
    fit = replace(identified(), rms={"joint1": 10.0})
    off = 0.6 * swing()
    assert heldout_doubts(fit, traced(after(off))) == [
        Doubt(
            "refused",
            "The motion does not go on as identified: after 0.033 s joint1 is off by more than 10% of its "
            f"range, {np.degrees(off):.3g} deg rms over the 0.33 s that were held out.",
        )
    ]


def test_a_prediction_that_is_no_number_misses() -> None:
    fit, trace = replace(identified(), rms={"joint1": 1.0}), traced(np.zeros(len(TIMES)))

    def lost(begin: int) -> Trace:
        """Let the prediction have no numbers from some frame after the fitted ones on."""
        assert trace.future is not None
        position, std = trace.future.position.copy(), trace.future.std.copy()
        position[begin:], std[begin:] = np.nan, np.inf
        return replace(trace, future=replace(trace.future, position=position, std=std))

    found = held_out(fit, lost(7))
    assert found is not None
    assert found.holds == pytest.approx(8 / 30.0)
    assert np.isfinite(found.bands).all()
    assert heldout_doubts(fit, lost(7)) == [
        Doubt(
            "approximate",
            "The prediction holds for 0.27 s after the fitted frames; then the identified motion of joint1 "
            "grows beyond all numbers.",
        )
    ]
    # not one row of it is a number
    (doubt,) = heldout_doubts(fit, lost(0))
    assert doubt == Doubt(
        "refused",
        "The motion does not go on as identified: after 0.033 s the identified motion of joint1 grows beyond "
        "all numbers.",
    )
    assert lost(0).heldout() == {"joint1": np.inf}


def test_soon_is_in_the_time_of_the_own_record() -> None:
    """A record of 20 frames is fitted beside one that is ten times as long."""
    fit = replace(identified(), rms={"joint1": 10.0})
    long = np.arange(200) / 30.0
    both = replace(fit, time=(long, fit.time[0]), residual=(np.zeros((200, 1)), fit.residual[0]))
    # a quarter of the own record is 0.16 s: what goes astray later leaves a prediction that holds for a while
    trace = traced(after(0.6 * swing(), 6))
    assert [doubt.grade for doubt in heldout_doubts(both, trace)] == ["approximate"]


def test_frames_outside_of_their_band_are_said() -> None:
    fit = identified()
    found = held_out(fit, traced(after(0.05 * swing())))
    assert found is not None
    bands = float(found.bands[0])
    assert bands > 3.0
    assert heldout_doubts(fit, traced(after(0.05 * swing()))) == [
        Doubt(
            "approximate",
            f"The frames that were held out lie {bands:.2g} standard deviations from their prediction "
            "(joint1): its band is too narrow, and so may be the intervals of the parameters.",
        )
    ]


def test_a_turn_counts_unless_a_gap_hides_it() -> None:
    count = len(identified().time[0])
    turn = after(2.0 * np.pi, 6)
    whole = traced(turn).heldout()["joint1"]
    assert whole is not None
    assert whole > 3.0
    # out of sight for so long that it may have turned once
    rows = np.arange(len(TIMES))
    hidden = (rows >= count + 1) & (rows < count + 6)
    fast = traced(turn, seen=~hidden)
    assert fast.future is not None
    slow = fast.heldout()["joint1"]
    moving = replace(fast, future=replace(fast.future, velocity=np.full_like(fast.future.velocity, 9.0)))
    assert slow == pytest.approx(2.0 * np.pi * np.sqrt(4 / 5), rel=1e-6)
    assert moving.heldout()["joint1"] == pytest.approx(0.0, abs=1e-6)


def test_a_pose_is_excluded_where_the_motion_goes_on_beside_it() -> None:
    fit, jump = identified(), np.zeros(len(TIMES))
    jump[[4, 22, 23]] = 0.5
    trace = traced(jump)
    found = excluded(fit, trace)
    assert np.flatnonzero(found[:, 0]).tolist() == [4, 22, 23]
    assert excluded_note(found, trace.poses) == [
        "The identified dynamics exclude the position of joint1 in frame 4, 22 and 23: the tracking was "
        "wrong there; <joint>_excluded marks it in poses.csv."
    ]
    assert excluded_note(found, trace.poses, "b.csv", marked=False) == [
        "The identified dynamics exclude the position of joint1 in frame 4, 22 and 23 of b.csv: the "
        "measurement was wrong there."
    ]
    inside = np.full(len(TIMES), 5.0 * fit.rms["joint1"])
    assert not excluded(fit, traced(inside)).any()
    assert excluded_note(excluded(fit, traced(inside)), trace.poses) == []


def test_a_motion_that_is_left_excludes_no_pose() -> None:
    """The prediction goes astray, and crosses the record now and then."""
    astray = after(0.5)
    astray[[24, 28]] = 0.0
    assert not excluded(identified(), traced(astray)).any()


def test_a_turn_that_a_gap_hides_excludes_no_pose() -> None:
    turn = np.zeros(len(TIMES))
    turn[4] = 2.0 * np.pi
    assert not excluded(identified(), traced(turn)).any()
