from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fits import identified
from monodyn.estimation.fit import Doubt
from monodyn.results.fill import fill
from monodyn.results.heldout import excluded, excluded_note, held_out, heldout_doubts
from monodyn.results.horizon import horizon
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
    assert heldout_doubts(fit, [trace]) == []


def test_nothing_is_held_out_where_nothing_was_measured() -> None:
    fit, count = identified(), len(identified().time[0])
    trace = traced(after(1.0), seen=np.arange(len(TIMES)) < count)
    assert held_out(fit, trace) is None
    assert heldout_doubts(fit, [trace]) == []


def test_a_motion_that_goes_another_way_at_once_is_refused() -> None:
    assert heldout_doubts(identified(), [traced(after(0.6 * swing()))]) == [
        Doubt(
            "refused",
            "The motion does not go on as identified: within 0.13 s the prediction misses it by more than "
            "50% of its range, farther than its band has it (joint1).",
            0.0,
        )
    ]


def banded(std: np.ndarray, off: np.ndarray) -> Trace:
    """Return a record off its prediction, whose band is given, both (frame,) after the fitted ones [rad]."""
    trace = traced(np.concatenate((np.zeros(len(TIMES) - len(off)), off)))
    assert trace.future is not None
    return replace(trace, future=replace(trace.future, std=std[:, np.newaxis]))


def test_a_band_that_grows_as_the_errors_do_leaves_no_doubt() -> None:
    """Of a chaotic motion the error grows by a factor of 500, and so does the band."""
    grown = 1e-3 * 2.0 ** np.arange(10)
    assert heldout_doubts(identified(), [banded(grown, 2.0 * grown)]) == []
    found = held_out(identified(), banded(grown, 2.0 * grown))
    assert found is not None
    assert found.bands[0] == pytest.approx(2.0, rel=0.1)


def test_early_errors_count_in_terms_of_the_early_band() -> None:
    """Together with the late rows they would be nothing: rms over rms is 0.01 here."""
    std = np.where(np.arange(10) < 5, 1e-3, 0.2)
    (doubt,) = heldout_doubts(identified(), [banded(std, np.where(np.arange(10) < 5, 0.02, 0.0))])
    assert doubt.grade == "approximate"
    assert doubt.holds == 0.0
    # after the band has said that it knows nothing more it is judged no longer, narrow as it may become
    late = np.where(np.arange(10) < 5, 0.2, 1e-3)
    assert heldout_doubts(identified(), [banded(late, np.full(10, 0.05))]) == []


def test_one_row_of_another_kind_says_nothing_about_a_band() -> None:
    assert (
        heldout_doubts(identified(), [banded(np.full(10, 5e-3), np.where(np.arange(10) == 4, 1.0, 0.0))])
        == []
    )


def test_a_prediction_that_is_no_number_misses() -> None:
    fit, trace = identified(), traced(np.zeros(len(TIMES)))

    def lost(begin: int) -> Trace:
        """Let the prediction have no numbers from some frame after the fitted ones on."""
        assert trace.future is not None
        position, std = trace.future.position.copy(), trace.future.std.copy()
        position[begin:], std[begin:] = np.nan, np.inf
        return replace(trace, future=replace(trace.future, position=position, std=std))

    (doubt,) = heldout_doubts(fit, [lost(7)])
    assert doubt == Doubt(
        "approximate",
        "The frames that were held out lie 4.9 standard deviations from their prediction (joint1): its band "
        "is too narrow, and so may be the intervals of the parameters.",
        pytest.approx(7 / 30.0),
    )
    # not one row of it is a number
    (doubt,) = heldout_doubts(fit, [lost(0)])
    assert (doubt.grade, doubt.holds) == ("refused", 0.0)
    assert lost(0).heldout() == {"joint1": np.inf}


def test_soon_is_in_the_time_of_the_own_record() -> None:
    """A record of 20 frames is fitted beside one that is ten times as long."""
    fit = identified()
    long = np.arange(200) / 30.0
    both = replace(fit, time=(long, fit.time[0]), residual=(np.zeros((200, 1)), fit.residual[0]))
    # a quarter of the own record is 0.16 s: what goes astray later leaves a prediction that holds for a while
    trace = traced(after(0.6 * swing(), 6))
    assert [doubt.grade for doubt in heldout_doubts(both, [trace])] == ["approximate"]


def test_a_fit_whose_predictions_show_no_force_is_approximate() -> None:
    """The start state is known so badly that the last rates alone would do as well."""
    fit = identified()
    states = slice(len(fit.shared), len(fit.shared) + 2)
    covariance = fit.covariance.copy()
    covariance[states, states] = np.diag([0.2, 0.2]) ** 2
    vague = replace(fit, covariance=covariance)
    trace = replace(traced(np.zeros(len(TIMES))), future=None)
    seconds = horizon(vague).seconds
    assert 0.0 <= seconds < 0.1
    assert heldout_doubts(vague, [trace]) == [
        Doubt(
            "approximate",
            f"A prediction may be off by 5 deg {seconds:.2g} s after the fitted frames, before anything that "
            "acts has changed the motion by as much: it shows the last rates and hardly what was identified.",
        )
    ]
    # it is enough that one reason is said
    assert heldout_doubts(vague.doubted([Doubt("approximate", "No.", 0.1)]), [trace]) == []


def test_frames_outside_of_their_band_are_said() -> None:
    fit = identified()
    found = held_out(fit, traced(after(0.05 * swing())))
    assert found is not None
    bands = float(found.bands[0])
    assert bands > 3.0
    assert heldout_doubts(fit, [traced(after(0.05 * swing()))]) == [
        Doubt(
            "approximate",
            f"The frames that were held out lie {bands:.2g} standard deviations from their prediction "
            "(joint1): its band is too narrow, and so may be the intervals of the parameters.",
            0.0,
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
