"""Swinging an identified mechanism up."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from controllable import UPRIGHT, identified, regulated
from monodyn.errors import SettingsError
from monodyn.mechanism import load
from monodyn.results.closed import closed_loop
from monodyn.results.regulator import lqr
from monodyn.results.swing import GUESSES, SwingUp, hanging, swing_up
from support import refuses


@lru_cache
def cart() -> SwingUp:
    return swing_up(identified("cartpole")[1], regulated("cartpole"), draws=3)


def test_mechanisms_hang_down() -> None:
    assert hanging(load("cartpole"), np.array([0.3, 1.0])) == pytest.approx([0.3, -np.pi / 2.0], abs=1e-6)
    assert hanging(load("triple"), np.ones(3)) == pytest.approx([-np.pi / 2.0, 0.0, 0.0], abs=1e-5)


@pytest.mark.slow
def test_the_true_mechanism_is_swung_up_by_what_the_identified_one_says() -> None:
    """With the factor between the masses, which a clip does not show."""
    for kind, row in (("cartpole", 0), ("double", 0)):
        true, fit = identified(kind)
        swing = cart() if kind == "cartpole" else swing_up(fit, regulated(kind), draws=3)
        assert swing.draws == swing.reached == 3
        assert np.abs(swing.torque).max() <= 0.8 * swing.limit[0] * (1.0 + 1e-9)
        factor = moved(true, swing.position, row) / moved(fit.mechanism, swing.position, row)
        loop = closed_loop(true, swing, swing.start, seconds=swing.seconds + 4.0, factor=factor)
        assert loop.balanced
        assert loop.off.max() < 1e-3
        assert np.abs(loop.torque).max() <= factor * swing.limit[0] * (1.0 + 1e-9)


def moved(mechanism, q, row) -> float:
    """Return what a motor moves with the other joints free."""
    from monodyn.results.linear import inertia

    return 1.0 / np.linalg.inv(inertia(mechanism.tree, q))[row, row]


@pytest.mark.slow
def test_a_way_begins_hanging_ends_upright_and_hands_over() -> None:
    swing, regulator = cart(), regulated("cartpole")
    assert swing.start == pytest.approx([0.0, -np.pi / 2.0], abs=1e-6)
    assert np.cos(swing.states[-1, 1] - np.pi / 2.0) == pytest.approx(1.0)
    assert (swing.joints, swing.actuated, swing.rate) == (("slide", "joint1"), ("slide",), 200.0)
    assert len(swing.gain) == len(swing.torque) == len(swing.time) - 1 == round(swing.seconds * swing.rate)
    q, v = np.split(swing.states[50], 2)
    assert swing.torque_at(0.25, q, v) == pytest.approx(swing.torque[50])
    late, rest = swing.seconds + 1.0, np.zeros(2)
    near = regulator.position + np.array([0.0, 0.01])
    assert swing.torque_at(late, near, rest) == pytest.approx(regulator.torque_at(late, near, rest))
    assert swing.torque_at(late, near + 1.0, rest) == pytest.approx(-swing.limit) or swing.torque_at(
        late, near + 1.0, rest
    ) == pytest.approx(swing.limit)


@pytest.mark.slow
def test_limits_room_time_and_start_are_kept() -> None:
    _, fit = identified("cartpole")
    swing = swing_up(
        fit, regulated("cartpole"), start={"slide": 0.1, "joint1": -1.2}, limit={"slide": 4.0},
        within={"slide": (-0.25, 0.25)}, seconds=2.0, draws=0,
    )  # fmt: skip
    assert swing.start == pytest.approx([0.1, -1.2])
    assert swing.seconds == pytest.approx(2.0)
    assert np.abs(swing.torque).max() <= 3.2 * (1.0 + 1e-9)
    # nodes keep the room; between two of them it is left by little
    assert np.abs(swing.states[:, 0]).max() < 0.26
    assert swing.draws == swing.reached == 0


@pytest.mark.slow
def test_bad_input_is_refused() -> None:
    _, fit = identified("cartpole")
    regulator = regulated("cartpole")
    with refuses(SettingsError, "limit: joint 'joint1' has no motor; motors: 'slide'."):
        swing_up(fit, regulator, limit={"joint1": 1.0})
    with refuses(SettingsError, "limit: joint 'sldie' has no motor; did you mean 'slide'?"):
        swing_up(fit, regulator, limit={"sldie": 1.0})
    with refuses(SettingsError, "limit: expected a torque above 0, got slide=-1; give a larger one."):
        swing_up(fit, regulator, limit={"slide": -1.0})
    with refuses(SettingsError, "within: joint 'elbow' is not in the mechanism; joints: 'slide', 'joint1'."):
        swing_up(fit, regulator, within={"elbow": (0.0, 1.0)})


@pytest.mark.slow
def test_times_and_room_that_are_none_are_refused() -> None:
    fit, regulator = identified("cartpole")[1], regulated("cartpole")
    for seconds in (np.nan, 1e300, 0.0):
        with refuses(
            SettingsError,
            f"swing_up: expected a time above 0 and up to 100 s, got {seconds:g}; change it.",
        ):
            swing_up(fit, regulator, seconds=seconds)
    with refuses(
        SettingsError, "within: expected the least position of slide first, got 2 and 1; exchange them."
    ):
        swing_up(fit, regulator, within={"slide": (2.0, 1.0)})


@pytest.mark.slow
def test_no_way_is_refused() -> None:
    _, fit = identified("cartpole")
    said = (
        "swing_up: expected a way up within the torques slide=0.001, but found none in 0.25 s at 200 "
        "measurements a second; give larger limits, more room, or another time."
    )
    told: list[tuple[str, int, int | None]] = []
    with refuses(SettingsError, said):
        swing_up(
            fit, regulated("cartpole"), limit={"slide": 1e-3}, seconds=0.25, draws=0,
            progress=lambda *step: told.append(step),
        )  # fmt: skip
    assert told == [("swing", done, GUESSES) for done in range(GUESSES)]
    within = (
        "swing_up: expected a way up within the torques slide=0.001 and the positions slide=-0.001:0.001, "
        "but found none in 0.25 s at 200 measurements a second; give larger limits, more room, or another "
        "time."
    )
    with refuses(SettingsError, within):
        swing_up(
            fit, regulated("cartpole"), limit={"slide": 1e-3}, within={"slide": (-1e-3, 1e-3)}, seconds=0.25,
            draws=0,
        )  # fmt: skip


@pytest.mark.slow
def test_a_rate_at_which_there_may_be_no_way_is_named() -> None:
    """At five measurements a second the shortest way is one of ten seconds, whatever time is tried."""
    _, fit = identified("cartpole")
    seldom = lqr(fit, UPRIGHT, actuated=["slide"], rate=5.0, draws=0)
    said = (
        "swing_up: expected a way up within the torques slide=0.001 and the positions slide=-0.3:0.3, but "
        "found none in 10 s at 5 measurements a second; measure more often (--rate) or give larger limits, "
        "more room, or another time."
    )
    with refuses(SettingsError, said):
        swing_up(fit, seldom, limit={"slide": 1e-3}, within={"slide": (-0.3, 0.3)}, draws=0)
