"""Torques that a program applies, as a log of what acted."""

from __future__ import annotations

import numpy as np

from monodyn.errors import SettingsError
from monodyn.live.applied import Applied
from support import refuses


def test_a_torque_is_held_from_frame_to_frame():
    applied, rng = Applied(("slide", "joint1")), np.random.default_rng(0)
    times, torques = np.cumsum(rng.uniform(0.02, 0.05, 30)), rng.normal(size=30)
    for time, torque in zip(times, torques, strict=True):
        applied.add(time, {"slide": torque})
    log = applied.between(times[4], times[20])
    assert log is not None
    assert log.time[0] <= times[4] + 1e-3
    assert log.time[-1] >= times[20] - 1e-9
    fine = np.linspace(times[4], times[20], 20001)
    at = np.searchsorted(times, fine, side="right") - 1
    held, shown = torques[at], np.interp(fine, log.time, log.torque[:, 0])
    # a log is linear between its rows: it differs in the steps alone, which take two thousandths of a frame
    assert np.mean(np.abs(held - shown) > 1e-9) < 0.01
    assert np.mean(held) == np.float64(0.0) or abs(np.mean(shown - held)) < 1e-3 * np.abs(torques).max()
    assert not log.torque[:, 1].any()


def test_nothing_acts_before_the_first_frame_and_where_nothing_was_applied():
    applied = Applied(("joint1",))
    assert applied.between(0.0, 1.0) is None
    applied.add(1.0, None)
    applied.add(2.0, {"joint1": 3.0})
    assert applied.between(0.0, 1.5) is None
    log = applied.between(0.5, 2.5)
    assert np.interp([0.6, 1.5, 2.4], log.time, log.torque[:, 0]).tolist() == [0.0, 0.0, 3.0]
    applied.forget(2.2)
    assert applied.between(2.2, 2.5) is not None


def test_what_is_no_torque_is_refused():
    applied = Applied(("slide", "joint1"))
    with refuses(SettingsError, "apply: joint 'joint2' is not in the mechanism; did you mean 'joint1'?"):
        applied.add(0.0, {"joint2": 1.0})
    with refuses(SettingsError, "apply: expected a finite torque for slide, got nan."):
        applied.add(0.0, {"slide": float("nan")})
    for odd, got in (
        (1.0, "1.0"),
        ({"slide": "x"}, "a value of type dict"),
        ({1: 1.0}, "a value of type dict"),
    ):
        with refuses(
            SettingsError,
            f"apply: expected what it returns to be torques by joint or None, got {got}; give e.g. "
            "{'joint1': 0.5}.",
        ):
            applied.add(0.0, odd)
