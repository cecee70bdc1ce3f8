from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import monodyn
from monodyn import load
from monodyn.errors import VideoError
from monodyn.estimation.record.units import wrong_units
from monodyn.pipeline import identify_tables
from monodyn.types import Poses
from support import refuses
from swings import motion, record

TIMES = np.arange(180) / 60.0


@pytest.fixture(scope="module")
def swinging() -> Poses:
    """Return five swings of a double pendulum."""
    double = load("double")
    return record(double, TIMES, motion(double, TIMES, [0.3, 0.5], [0.0, 1.0]), noise=1e-3)


def spoilt(poses: Poses) -> Poses:
    """Return a record with one sample that is far off."""
    position = poses.position.copy()
    position[70, 1] = 100.0
    return replace(poses, position=position)


def test_radians_and_seconds_are_right(swinging: Poses) -> None:
    double = load("double")
    assert wrong_units([swinging], double) is None
    assert wrong_units([swinging, spoilt(swinging)], double) is None
    still = replace(swinging, position=np.random.default_rng(1).normal(scale=1e-3, size=(len(TIMES), 2)))
    assert wrong_units([still], double) is None
    assert wrong_units([replace(swinging, seen=np.zeros(len(TIMES), dtype=bool))], double) is None


def test_whirling_is_no_degrees() -> None:
    double = load("double")
    whirling = record(double, TIMES, motion(double, TIMES, [1.5, 0.0], [25.0, 10.0]), noise=1e-3)
    assert np.ptp(whirling.position) > 8.0 * np.pi
    assert wrong_units([whirling], double) is None


def test_degrees_are_named(swinging: Poses) -> None:
    said = wrong_units([replace(swinging, position=np.degrees(swinging.position))], load("double"))
    # as many radians as a swing of about two has degrees
    turns = 20.0
    assert said is not None
    found = float(said.split("swings of ")[1].split()[0])
    assert found == pytest.approx(turns, rel=0.5)
    assert said == (
        f"expected angles in radians, got swings of {found:.3g} turns from one reversal to the next: these "
        "look like degrees; multiply them by pi / 180."
    )


def test_python_names_degrees_too(swinging: Poses) -> None:
    with pytest.raises(VideoError, match=r"^poses: expected angles in radians, got swings of "):
        monodyn.identify(replace(swinging, position=np.degrees(swinging.position)), load("double"))


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "milliseconds"), (60.0, "frame numbers or another unit")])
def test_other_units_of_time_are_named_where_time_counts(swinging: Poses, factor: float, unit: str) -> None:
    slow, double = replace(swinging, time=factor * TIMES), load("double")
    said = wrong_units([slow], double)
    assert said is not None
    found = float(said.split("lengths of ")[1].split()[0])
    assert found == pytest.approx(0.2 * factor**2, rel=1.0)
    assert said == (
        f"expected times in seconds, got a motion so slow that gravity would move lengths of {found:.2g} m "
        f"like that: these look like {unit}; give seconds, or free the clock with --free time_scale."
    )
    assert wrong_units([slow], double.with_choices(free=["time_scale"])) is None
    assert wrong_units([slow], double.with_choices(free=["gravity"])) is None


def test_a_motion_that_is_too_quick_is_in_another_unit(swinging: Poses) -> None:
    quick, double = replace(swinging, time=1e-4 * TIMES), load("double")
    said = wrong_units([quick], double)
    assert said is not None
    found = float(said.split("lengths of ")[1].split()[0])
    assert found == pytest.approx(0.2e-8, rel=1.0)
    assert said == (
        f"expected times in seconds, got a motion so quick that gravity would move lengths of {found:.2g} m "
        "like that: these look like another unit; give seconds, or free the clock with --free time_scale."
    )
    with refuses(VideoError, f"poses: {said}"):
        monodyn.identify(quick, double)


def test_a_table_in_degrees_is_refused_before_the_search(swinging: Poses, tmp_path: Path) -> None:
    table = tmp_path / "log.csv"
    rows = np.column_stack([TIMES, np.degrees(swinging.position)])
    np.savetxt(table, rows, delimiter=",", header="time,joint1,joint2", comments="")
    said = wrong_units([replace(swinging, position=np.degrees(swinging.position))], load("double"))
    with refuses(VideoError, f"log.csv: {said}"):
        identify_tables([table], "double", tmp_path / "run")
    assert not (tmp_path / "run").exists()
