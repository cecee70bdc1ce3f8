"""The same record in another table: the fit must be the same, or the refusal must say what is different."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import monodyn
from monodyn.errors import MonodynError
from monodyn.estimation.fit import Fit
from swings import motion

NOISE, SEED = 1e-3, 0
"""Standard deviation of a reading [rad], and the seed of the readings."""
OUT = np.array([10, 11, 30, 50, 51])
"""Rows that are left out."""
Table = tuple[np.ndarray, np.ndarray]
"""Times, (row,), and positions, (row, dof)."""


@dataclass(frozen=True)
class Pair:
    """A change of a table, and what follows.

    Attributes:
        name: What is changed.
        change: Changes times and positions.
        refusal: What the refusal says; empty where the fit has to be the same.
        close: Largest relative change of a length: readings that are left out take some knowledge along.
    """

    name: str
    change: Callable[[np.ndarray, np.ndarray], Table]
    refusal: str = ""
    close: float = 1e-4


SAME = (
    Pair("shifted in time", lambda t, q: (t + 1.7e3, q)),
    Pair("begun before zero", lambda t, q: (t - 1.0, q)),
    Pair("a turn more at each joint", lambda t, q: (t, q + np.array([2.0 * np.pi, -2.0 * np.pi]))),
    Pair("rows left out", lambda t, q: (np.delete(t, OUT), np.delete(q, OUT, axis=0)), close=5e-3),
    Pair("every second row", lambda t, q: (t[::2], q[::2]), close=1e-2),
    Pair("begun later", lambda t, q: (t[15:], q[15:]), close=1e-2),
)
UNITS = (
    Pair(
        "in degrees", lambda t, q: (t, np.degrees(q)), "these look like degrees; multiply them by pi / 180."
    ),
    Pair("in milliseconds", lambda t, q: (1e3 * t, q), "these look like milliseconds; give seconds, or free"),
    Pair(
        "in frames", lambda t, q: (30.0 * t, q), "these look like frame numbers or another unit; give seconds"
    ),
)
OTHERWISE = (
    Pair("hanging is zero", lambda t, q: (t, q + 0.5 * np.pi), "With gravity 90 deg from straight down"),
    Pair("other sign", lambda t, q: (t, -q), "With gravity 180 deg from straight down"),
)
"""Of a single pendulum: one of two is searched for half a minute."""
OF_TWO = (
    Pair("other sign of the second joint", lambda t, q: (t, q * [1.0, -1.0]), "does not follow the record"),
    Pair("joints exchanged", lambda t, q: (t, q[:, ::-1]), "does not follow the record"),
)
"""Of two joints, and friction alone."""


def table(model: str = "double") -> Table:
    """Return a record of two and a half seconds."""
    time, mechanism = np.arange(75) / 30.0, monodyn.load(model)
    start = (-0.55, 0.9)[: len(mechanism.joints)]
    position = motion(mechanism, time, start, np.zeros(len(start)))
    return time, position + NOISE * np.random.default_rng(SEED).normal(size=position.shape)


def identified(
    folder: Path, time: np.ndarray, position: np.ndarray, *, order: int = 1, torque: str = "auto"
) -> Fit:
    """Write a table, its columns in their order or against it, and identify it."""
    mechanism, path = monodyn.load(("single", "double")[position.shape[1] - 1]), folder / "table.csv"
    names = [joint.name for joint in mechanism.joints]
    header = ",".join(["time", *names[::order]])
    cells = np.column_stack([time, position[:, ::order]])
    np.savetxt(path, cells, fmt="%.17g", delimiter=",", header=header, comments="")
    settings = monodyn.IdentifySettings(torque=torque)  # pyright: ignore[reportArgumentType]
    return monodyn.identify(monodyn.read_poses(path, mechanism), mechanism, settings)


@pytest.fixture(scope="module")
def plain(tmp_path_factory) -> Fit:
    """Return the fit of the table as it is."""
    return identified(tmp_path_factory.mktemp("plain"), *table())


@pytest.mark.parametrize("pair", SAME, ids=lambda pair: pair.name)
def test_the_same_record(pair: Pair, plain: Fit, tmp_path: Path) -> None:
    compare(plain, identified(tmp_path, *pair.change(*table())), pair.close)


def test_columns_in_another_order(plain: Fit, tmp_path: Path) -> None:
    compare(plain, identified(tmp_path, *table(), order=-1), 1e-9)


@pytest.mark.parametrize("pair", UNITS, ids=lambda pair: pair.name)
def test_other_units_are_named(pair: Pair, tmp_path: Path) -> None:
    with pytest.raises(MonodynError) as refused:
        identified(tmp_path, *pair.change(*table()))
    assert pair.refusal in str(refused.value)


@pytest.mark.slow
@pytest.mark.parametrize("pair", OTHERWISE, ids=lambda pair: pair.name)
def test_angles_that_mean_something_else_are_refused(pair: Pair, tmp_path: Path) -> None:
    refused(identified(tmp_path, *pair.change(*table("single"))), pair)


@pytest.mark.slow
@pytest.mark.parametrize("pair", OF_TWO, ids=lambda pair: pair.name)
def test_joints_that_mean_something_else_are_refused(pair: Pair, tmp_path: Path) -> None:
    refused(identified(tmp_path, *pair.change(*table()), torque="friction"), pair)


def refused(fit: Fit, pair: Pair) -> None:
    """Expect a refusal that says why."""
    assert fit.grade == "refused"
    assert pair.refusal in " ".join([fit.status, *fit.advice])


def compare(before: Fit, fit: Fit, close: float) -> None:
    """Compare lengths and grade with those of the table as it is."""
    assert (before.grade, fit.grade) == ("trusted", "trusted")
    for name in ("link1.length", "link2.length"):
        assert fit.mechanism.values[name] == pytest.approx(before.mechanism.values[name], rel=close)
