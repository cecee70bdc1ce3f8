"""A controller and a mechanism together, in MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pytest

from controllable import identified, regulated
from monodyn.errors import SettingsError
from monodyn.mechanism import load, write_mjcf
from monodyn.mechanism.simulate import simulate
from monodyn.results.closed import closed_loop
from support import refuses


@dataclass(frozen=True)
class Constant:
    """The same torque at all times."""

    joints: tuple[str, ...]
    actuated: tuple[str, ...]
    torque: float
    rate: float = 50.0

    @property
    def position(self) -> np.ndarray:
        return np.zeros(len(self.joints))

    @property
    def turns(self) -> np.ndarray:
        return np.zeros(len(self.joints), dtype=bool)

    def torque_at(self, time: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.array([self.torque])


def test_the_true_mechanism_is_balanced_by_what_the_identified_one_says() -> None:
    for kind, away in (("cartpole", [0.0, 0.2]), ("double", [0.05, -0.05])):
        true, fit = identified(kind)
        regulator = regulated(kind)
        for mechanism in (fit.mechanism, true):
            loop = closed_loop(mechanism, regulator, regulator.position + np.array(away), seconds=6.0)
            assert loop.balanced
            assert loop.off.max() < 1e-3
            assert loop.time[-1] == 6.0
            assert np.abs(loop.position[0] - regulator.position) == pytest.approx(np.abs(away))


def test_where_the_numbers_end_it_runs_away_and_leaves_no_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    # from where MuJoCo begins anew by itself: at rest, and so without a torque it would be balanced
    loop = closed_loop(
        load("double"), Constant(("joint1", "joint2"), ("joint1",), 1e15), np.zeros(2), seconds=0.1
    )
    assert len(loop.time) == 1
    assert np.isinf(loop.off).all()
    assert not loop.balanced
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_without_a_controller_it_is_the_free_motion() -> None:
    mechanism = load("double")
    start, rates = np.array([0.3, -0.2]), np.array([1.0, 0.5])
    loop = closed_loop(mechanism, Constant(("joint1", "joint2"), ("joint1",), 0.0), start, rates, seconds=1.0)
    free = simulate(mechanism, loop.time, start, rates, tolerance=1e-9)
    # MuJoCo's steps of 1 ms, of order four
    np.testing.assert_allclose(loop.position, free.position, atol=1e-6)
    assert not loop.balanced


def test_a_torque_acts_at_its_joint_times_the_factor() -> None:
    mechanism = load("cartpole").with_values({"slide.damping": 0.0, "joint1.damping": 0.0})
    push = Constant(("slide", "joint1"), ("slide",), 0.3)
    loop = closed_loop(mechanism, push, np.array([0.0, -np.pi / 2.0]), seconds=0.2, factor=2.0)
    body = mechanism.tree.links[:, 5].sum()
    # momentum along the slide: the force times the time, whatever the pole does
    link, q, v = mechanism.tree.links[1], loop.position[-1], loop.velocity[-1]
    momentum = body * v[0] - link[5] * link[6] * np.sin(q[1]) * v[1]
    assert momentum == pytest.approx(0.6 * 0.2, rel=1e-5)
    np.testing.assert_array_equal(loop.torque, 0.6)


def test_joints_are_found_by_name_in_a_foreign_file(tmp_path: Path) -> None:
    true, _ = identified("cartpole")
    path = tmp_path / "true.xml"
    write_mjcf(true, path)
    body = mujoco.MjModel.from_xml_path(str(path))
    assert body.njnt == 2
    regulator = regulated("cartpole")
    begin = regulator.position + np.array([0.0, 0.1])
    ours, theirs = (closed_loop(model, regulator, begin, seconds=2.0) for model in (true, path))
    np.testing.assert_array_equal(ours.position, theirs.position)


def test_a_start_is_given_by_name_too() -> None:
    mechanism, none = load("double"), Constant(("joint1", "joint2"), ("joint1",), 0.0)
    named = closed_loop(mechanism, none, {"joint2": 0.4}, {"joint1": 1.0}, seconds=0.2)
    listed = closed_loop(mechanism, none, np.array([0.0, 0.4]), np.array([1.0, 0.0]), seconds=0.2)
    np.testing.assert_array_equal(named.position, listed.position)
    expected = "closed_loop: position: joint 'elbow' is not in the mechanism; joints: 'joint1', 'joint2'."
    with refuses(SettingsError, expected):
        closed_loop(mechanism, none, {"elbow": 0.4})


def test_a_motion_that_runs_away_ends() -> None:
    push = Constant(("slide", "joint1"), ("slide",), 1e6)
    loop = closed_loop(load("cartpole"), push, np.zeros(2), seconds=5.0)
    assert loop.time[-1] < 1.0
    assert not loop.balanced
    assert np.isinf(loop.off).all()


def test_bad_input_is_refused(tmp_path: Path) -> None:
    said = "closed_loop: expected a model with the joints slide, joint1, got one with joint1, joint2."
    with refuses(SettingsError, said):
        closed_loop(load("double"), regulated("cartpole"), np.zeros(2))
    path = tmp_path / "none.xml"
    with pytest.raises(SettingsError) as found:
        closed_loop(path, regulated("cartpole"), np.zeros(2))
    why = str(found.value).partition("(")[2].partition("); give")[0]
    assert why
    assert str(found.value) == (
        f"closed_loop: expected a file that MuJoCo reads, got '{path}' ({why}); give another."
    )


def test_times_and_factors_that_are_none_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo would write its complaint of a torque that is no number into the working directory."""
    monkeypatch.chdir(tmp_path)
    none = Constant(("joint1", "joint2"), ("joint1",), 0.0)
    for name, values, most in (
        ("seconds", (-1.0, 0.0, np.nan, np.inf), 1e5),
        ("factor", (0.0, np.nan, np.inf), 1e6),
    ):
        for value in values:
            said = f"closed_loop: expected {name} above 0 and up to {most:g}, got {value:g}; change it."
            with refuses(SettingsError, said):
                closed_loop(load("double"), none, np.zeros(2), **{name: value})
    assert list(tmp_path.iterdir()) == []
