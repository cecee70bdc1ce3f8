"""Readings that a log repeats while a joint moves on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from monodyn.estimation.record.held import held_note, held_rows
from monodyn.estimation.record.tables import read_poses

TIME = np.arange(300) / 60.0
SWING = 0.8 * np.sin(5.0 * TIME)


def noisy(seed: int = 0) -> np.ndarray:
    """Return a swing with noise [rad], (frame,)."""
    return SWING + 1e-3 * np.random.default_rng(seed).standard_normal(len(TIME))


def held(values: np.ndarray, factor: int, first: int = 0) -> np.ndarray:
    """Hold every so many-th value, (frame,)."""
    return values[np.maximum((np.arange(len(values)) - first) // factor * factor + first, 0)]


def marked(values: np.ndarray) -> np.ndarray:
    """Return which of the values of a joint are held, (frame,)."""
    return held_rows(values[:, None], np.isfinite(values)[:, None])[:, 0]


@pytest.mark.parametrize(("factor", "first"), [(2, 0), (2, 1), (3, 0), (4, 2), (8, 0)])
def test_all_repeats_of_a_held_joint_are_marked(factor: int, first: int) -> None:
    values = held(noisy(), factor, first)
    repeats = np.append(False, np.diff(values) == 0.0)
    np.testing.assert_array_equal(marked(values), repeats)


def test_what_was_lost_now_and_then_is_marked_alone() -> None:
    values = noisy()
    # while it moves, and while it hangs at rest, where an encoder has the same number each time
    values[148:156] = values[147]
    values[200:] = values[200]
    np.testing.assert_array_equal(np.flatnonzero(marked(values)), np.arange(148, 156))


@pytest.mark.parametrize("counts", [100, 400, 2000, 8192])
@pytest.mark.parametrize("size", [0.05, 1.0, 3.0])
def test_an_encoder_that_resolves_little_holds_nothing(counts: int, size: float) -> None:
    step = 2.0 * np.pi / counts
    for values in (size * SWING, size * noisy(), size * SWING * np.exp(-TIME)):
        assert not marked(step * np.round(values / step)).any()


def test_a_joint_that_rests_or_meets_a_stop_holds_nothing() -> None:
    assert not marked(np.zeros(300)).any()
    assert not marked(np.clip(SWING, -0.4, None)).any()
    assert not marked(noisy()).any()
    assert not marked(np.full(300, np.nan)).any()


def test_a_table_that_holds_readings_has_gaps_there(tmp_path: Path) -> None:
    table, values = tmp_path / "log.csv", noisy(1)
    columns = np.column_stack([TIME, noisy(), held(values, 2)])
    np.savetxt(table, columns, delimiter=",", header="time,joint1,joint2", comments="")
    poses = read_poses(table, ("joint1", "joint2"))
    assert poses.measured.sum(axis=0).tolist() == [300, 150]
    # the noise is that of the readings, not what the joint moved while they were held
    assert np.sqrt(np.median(poses.covariance[:, 1, 1])) == pytest.approx(1e-3, rel=0.5)
    assert held_note(poses, "log.csv") == [
        "log.csv: joint2 repeats its last reading in 150 of 300 rows while it moves on, as where a log is "
        "written faster than a sensor answers; these rows do not count as measured."
    ]
    np.savetxt(table, columns[:, :2], delimiter=",", header="time,joint1", comments="")
    assert held_note(read_poses(table, ("joint1",)), "log.csv") == []
