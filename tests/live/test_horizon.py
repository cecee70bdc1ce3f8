"""The horizon of a stream: every search ends at its optimum, in few steps; what goes on from a long stretch
of a wild motion, against the fit of that stretch and the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from monodyn.errors import FitError
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.window import ahead
from monodyn.live import horizon
from monodyn.live.estimate import Estimate
from monodyn.live.horizon import MOST_GROWN, Horizon, _inverses, followed_from, horizon_of
from monodyn.live.settings import LiveSettings
from monodyn.mechanism import Mechanism, load
from monodyn.stages import identify
from monodyn.types import Poses, TorqueLog
from support import refuses
from swings import double_truth, motion, record, white

FIXED = {"link1.thickness": 0.006, "link1.width": 0.02, "link2.width": 0.02}
BEGUN, FRAMES = 60, 150
"""Rows that are fitted first, and rows of all."""
LONG, ALL = 180, 240
"""Rows of a long stretch that begins it, and of the whole record."""


@pytest.fixture(scope="module")
def estimates() -> list[Estimate]:
    """What is known of a double pendulum at each frame after the first ones."""
    times, truth, started = np.arange(FRAMES) / 30.0, double_truth(), load("double").with_choices(fix=FIXED)
    rows = record(truth, times, motion(truth, times, [0.3, 0.5], [0.0, 1.0]))
    first = rows[:BEGUN]
    fit = identify(first, started, IdentifySettings(torque="friction"))
    horizon = Horizon(fit, started, first, window=1.5, ahead=0.5)
    found = [horizon.add(rows[k : k + 1]) for k in range(BEGUN, FRAMES)]
    assert None not in found
    return [estimate for estimate in found if estimate is not None]


def test_a_motion_does_not_go_on_across_a_gap_in_what_comes_together() -> None:
    times, truth, started = np.arange(120) / 30.0, double_truth(), load("double").with_choices(fix=FIXED)
    rows = record(truth, times, motion(truth, times, [0.3, 0.5], [0.0, 1.0]))
    fit = identify(rows[:BEGUN], started, IdentifySettings(torque="friction"))
    # what was lost for longer than a second, and another motion after it
    rows = replace(rows, time=np.where(times < 2.4, times, times + 2.0))
    at_once, each = (Horizon(fit, started, rows[:BEGUN], window=1.5, ahead=0.5) for _ in range(2))
    after = int(np.searchsorted(times, 2.4))
    each.add(rows[BEGUN:after])
    wanted, found = each.add(rows[after:]), at_once.add(rows[BEGUN:])
    assert wanted is not None
    assert found is not None
    assert found.time.tolist() == wanted.time.tolist()
    assert found.time[0] >= rows.time[after]
    np.testing.assert_array_equal(found.found.x, wanted.found.x)


def test_a_stretch_that_no_single_motion_explains_begins_no_window() -> None:
    times, truth, started = np.arange(BEGUN) / 30.0, double_truth(), load("double").with_choices(fix=FIXED)
    rows = record(truth, times, motion(truth, times, [0.3, 0.5], [0.0, 1.0]))
    fit = identify(rows, started, IdentifySettings(torque="friction"))
    Horizon(fit, started, rows, window=1.5, ahead=0.5)
    # pushed where nobody has said so
    other = record(truth, times, motion(truth, times, [0.9, -0.4], [2.0, 1.0]))
    position = np.where(np.arange(BEGUN)[:, None] < BEGUN // 2, rows.position, other.position)
    pushed = replace(rows, position=position)
    with refuses(
        FitError,
        "horizon: expected rows that one motion follows from its first state on, got such as the fit "
        "follows piece by piece; begin with fewer.",
    ):
        Horizon(fit, started, pushed, window=1.5, ahead=0.5)
    assert horizon_of(fit, started, pushed, LiveSettings()) is None


def test_what_is_held_upright_for_long_begins_no_window(monkeypatch: pytest.MonkeyPatch) -> None:
    """The torques are those of a way that is given: a swing, then up, and there for three seconds."""
    truth = load("single").with_choices(fix={"link1.thickness": 0.006})
    times, fine = np.arange(480) / 60.0, np.arange(0.0, 8.0, 1e-3)
    up = np.clip((fine - 4.0) / 0.8, 0.0, 1.0)
    way = -np.pi / 2 + 0.9 * np.sin(6.0 * fine) * (1.0 - up) ** 3 + np.pi * up**3 * (10 - 15 * up + 6 * up**2)
    rate = np.gradient(way, fine)
    values = truth.values
    moment = values["link1.mass"] * values["link1.com_x"]
    inertia = values["link1.inertia"] + moment * values["link1.com_x"]
    torque = inertia * np.gradient(rate, fine) + values["joint1.damping"] * rate
    torque += moment * 9.81 * np.cos(way)
    rows = record(truth, times, np.interp(times, fine, way)[:, None], noise=1e-3)
    rows = replace(rows, torques=TorqueLog(("joint1",), fine, torque[:, None]))
    fit = identify(rows, truth)
    assert fit.ok, fit.status
    assert fit.torque == "known"
    with refuses(
        FitError,
        "horizon: expected rows that one motion follows from its first state on, got such as the fit "
        "follows piece by piece; begin with fewer.",
    ):
        Horizon(fit, truth, rows, window=1.5, ahead=0.5, acting=lambda *_: rows.torques)
    # nor does what rounding leaves of it end a stream
    monkeypatch.setattr(horizon, "_check_followed", lambda *_: None)
    monkeypatch.setattr(horizon, "refit", lambda *_, **__: drowned())
    assert horizon_of(fit, truth, rows, LiveSettings(), lambda *_: rows.torques) is None


def rested(model: Mechanism, position: Sequence[float], frames: int, rate: float = 60.0) -> Poses:
    """Return rows at rest, with a slide in the start scale."""
    names = tuple(joint.name for joint in model.joints)
    return white(names, np.arange(frames) / rate, np.tile(position, (frames, 1)), 1e-9, metric=False)


def known(mechanism: Mechanism, scale: float = 1.0) -> Any:
    """Return what is known of a mechanism."""
    return SimpleNamespace(mechanism=mechanism, scale=scale)


def test_how_long_a_motion_can_be_followed_where_it_falls_over() -> None:
    """Beside the upper equilibrium an error grows as exp(w t) / 2, or w / 2 as much for one of the rate."""
    single = load("single").with_values({"joint1.damping": 0.0})
    values = single.values
    moment = values["link1.mass"] * values["link1.com_x"]
    w = np.sqrt(moment * 9.81 / (values["link1.inertia"] + moment * values["link1.com_x"]))
    assert w > 1.0
    count, rate = 600, 60.0
    first = followed_from(known(single), rested(single, [np.pi / 2], count))
    seconds = (count - 1 - first) / rate
    assert seconds == pytest.approx(np.log(2.0 * MOST_GROWN) / w, abs=2.5 / rate)
    assert followed_from(known(single), rested(single, [-np.pi / 2], count)) == 0
    # a clock that runs at half speed
    slow = single.with_values({"time_scale": 2.0})
    assert count - 1 - followed_from(known(slow), rested(single, [np.pi / 2], count)) == pytest.approx(
        0.5 * (count - 1 - first), abs=2
    )
    # what is out of sight for a while is not known to grow meanwhile, and the first row is a whole one
    rows = rested(single, [np.pi / 2], count)
    for hidden, wanted in (((500, 530), first - 30), ((first - 9, first + 9), first - 19), ((3, count), 0)):
        seen = (np.arange(count) < hidden[0]) | (np.arange(count) >= hidden[1])
        unseen = replace(rows, position=np.where(seen[:, None], rows.position, np.nan), seen=seen)
        assert followed_from(known(single), unseen) == pytest.approx(wanted, abs=3)


def test_a_motion_of_which_one_joint_is_hidden_is_followed_as_without() -> None:
    """No motion is made up where it is not seen: from that errors would seem to grow."""
    times, truth = np.arange(600) / 60.0, double_truth()
    rows = record(truth, times, motion(truth, times, [0.3, 0.5], [0.0, 1.0]))
    assert followed_from(known(truth), rows) == 0
    for begins, ends in ((9.0, 10.0), (5.0, 10.0), (2.0, 4.0)):
        hidden = (times >= begins) & (times < ends)
        position = rows.position.copy()
        position[hidden, 1] = np.nan
        unseen = replace(rows, position=position, joint_seen=np.isfinite(position), seen=~hidden)
        assert followed_from(known(truth), unseen) == 0


def test_a_wild_motion_is_followed_as_far_in_a_clip_that_is_slowed_down() -> None:
    """Rates, by which its errors grow, are those of true seconds."""
    times = np.arange(600) / 60.0
    truth = double_truth().with_values({"joint1.damping": 0.0, "joint2.damping": 0.0})
    rows = record(truth, times, motion(truth, times, [1.5, 0.5], [6.0, -4.0]), noise=1e-5)
    wanted = followed_from(known(truth), rows)
    assert wanted > 100
    slowed, fast = replace(rows, time=4.0 * times), truth.with_values({"time_scale": 0.25})
    assert followed_from(known(fast), slowed) == pytest.approx(wanted, abs=1)


def test_a_slide_is_followed_in_metres(tmp_path: Path) -> None:
    """A mass farther out on an upright rod falls more slowly."""
    path = tmp_path / "bead.xml"
    path.write_text(
        """<mujoco><compiler angle="radian"/><worldbody><body name="rod"><joint name="turn" axis="0 -1 0"/>
        <geom type="box" size="0.05 0.003 0.01" pos="0.05 0 0"/><body name="bead">
        <joint name="slide" type="slide" axis="1 0 0" stiffness="40"/>
        <geom type="box" size="0.01 0.01 0.01" density="8000"/></body></body></worldbody></mujoco>"""
    )
    bead = load(path)
    first = [
        followed_from(known(bead, scale), rested(bead, [np.pi / 2, place], 600))
        for scale, place in ((1.0, 0.4), (4.0, 0.1), (1.0, 0.1))
    ]
    assert first[0] == first[1] < first[2] - 10


def drowned() -> None:
    """Stand for a search whose information has no digit left."""
    raise ArithmeticError


def test_every_frame_ends_at_its_optimum(estimates: list[Estimate]) -> None:
    truth = double_truth()
    for estimate in estimates:
        assert estimate.found.converged
        # the last one proves it
        assert estimate.found.evaluations <= 5
    for name in ("link1.length", "link2.length"):
        off = estimates[-1].fit.parameter(name).value - truth.parameter(name).value
        assert abs(off) < 3.0 * estimates[-1].std[name]


def test_intervals_are_cut_at_the_bounds_as_those_of_a_run_are(estimates: list[Estimate]) -> None:
    """What is hardly known: no size is negative, and what was searched as a logarithm errs by a factor."""
    known = replace(estimates[-1])
    values = known.found.mechanism.values
    vars(known)["std"] = {name: 2.0 * abs(values[name]) for name in known.std}
    kinds = {p.name: p for p in known.found.mechanism.parameters}
    rows = [row for row in known.fit.parameters if row.free]
    for row in rows:
        assert kinds[row.name].lower <= row.lower <= row.value <= row.upper <= kinds[row.name].upper, row.name
    length, damping = (known.fit.parameter(name) for name in ("link1.length", "joint1.damping"))
    assert length.lower == pytest.approx(length.value * np.exp(-2.0 * 1.96))
    assert length.upper == pytest.approx(min(length.value * np.exp(2.0 * 1.96), kinds["link1.length"].upper))
    assert damping.lower == 0.0
    assert damping.upper == pytest.approx(damping.value * (1.0 + 2.0 * 1.96))


@pytest.mark.slow
@pytest.mark.parametrize("damping", [3e-3, 6e-3])
def test_a_long_stretch_of_a_wild_motion_leaves_the_window_as_it_was_known(damping):
    """A triple pendulum: within the stretch some errors grow a hundredfold while others shrink to nothing."""
    values = {"joint1.damping": 2e-3, "joint2.damping": damping, "joint3.damping": damping}
    truth, times = load("triple").with_values(values), np.arange(ALL) / 30.0
    rows = record(truth, times, motion(truth, times, [1.0, 1.5, 0.5], [0.0, 0.0, 0.0]), noise=5e-4)
    mechanism = load("triple")
    fit = identify(rows[:LONG], mechanism)
    horizon = horizon_of(fit, mechanism, rows[:LONG], LiveSettings())
    assert horizon is not None
    for k in range(LONG, ALL):
        found = horizon.add(rows[k : k + 1])
        assert found is not None, k
        assert not found.astray
    lengths = [f"link{number}.length" for number in (1, 2, 3)]
    for name in lengths:
        before, now = fit.parameter(name), found.fit.parameter(name)
        assert now.std == pytest.approx(before.std, rel=0.1)
        assert abs(now.value - truth.values[name]) < 2.0 * now.std
    # the window begins no later than it has to
    assert found.time[0] == pytest.approx(times[-1] - 1.0, abs=0.07)


def test_a_prediction_begins_with_what_is_known_at_the_last_row(estimates: list[Estimate]) -> None:
    future, now = estimates[-1].future, ahead(estimates[-1].found, -1)
    position, velocity = np.split(now.state, 2)
    std = np.split(np.sqrt(np.diag(now.covariance)[-len(now.state) :]), 2)
    for found, wanted in (
        (future.position, position), (future.velocity, velocity),
        (future.std, std[0]), (future.velocity_std, std[1]),
    ):  # fmt: skip
        assert np.allclose(found[0], wanted, rtol=1e-6)


def test_between_its_rows_a_prediction_is_a_cubic(estimates: list[Estimate]) -> None:
    future = estimates[-1].future
    wanted = CubicHermiteSpline(future.time, future.position, future.velocity)
    for time in np.linspace(future.time[0], future.time[-1], 23).tolist():
        position, velocity = estimates[-1].state(time)
        assert np.allclose(position, wanted(time), rtol=1e-12, atol=1e-12)
        assert np.allclose(velocity, wanted(time, 1), rtol=1e-9, atol=1e-9)
    for beyond, end in ((-1.0, 0), (1.0, -1)):
        position, velocity = estimates[-1].state(float(future.time[end]) + beyond)
        assert np.allclose(position, future.position[end])
        assert np.allclose(velocity, future.velocity[end])


def test_what_is_held_and_what_is_determined_is_said_with_the_verdict(estimates: list[Estimate]) -> None:
    last = estimates[-1]
    unclear = replace(last.base.parameter("link1.length"), identifiable=False)
    parameters = tuple(unclear if p.name == unclear.name else p for p in last.base.parameters)
    found = replace(last, base=replace(last.base, parameters=parameters)).fit
    for before, now in zip(parameters, found.parameters, strict=True):
        kept = ("name", "unit", "free", "identifiable", "at_bound")
        assert [getattr(now, name) for name in kept] == [getattr(before, name) for name in kept]
        assert now.value == last.found.mechanism.parameter(now.name).value
        if now.name in FIXED:
            assert now == before


@pytest.mark.parametrize("least", [1.0, 1e-6, 1e-18, 0.0])
def test_what_has_shrunk_to_nothing_is_left_out_of_an_inverse(least: float) -> None:
    matrices = np.stack([np.eye(2), np.array([[1.0, 0.5], [0.0, least]])])
    assert np.allclose(_inverses(matrices), np.linalg.pinv(matrices), rtol=1e-9)
