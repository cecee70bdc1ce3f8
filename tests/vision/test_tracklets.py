"""Runs of spots that are surely one thing."""

from __future__ import annotations

import numpy as np

from monodyn.vision.dots.spots import Spots
from monodyn.vision.dots.tracklets import tracklets_of


def spots(paths: np.ndarray, area: np.ndarray | None = None) -> Spots:
    """Return the spots of paths (frame, point, 2), NaN where not found."""
    known = np.isfinite(paths[..., 0])
    row = np.nonzero(known)[0]
    areas = np.full(known.shape, 100.0) if area is None else area
    return Spots(row, paths[known], areas[known], np.arange(len(paths)), np.arange(len(paths)) / 30.0)


def line(start: tuple[float, float], step: tuple[float, float], count: int = 30) -> np.ndarray:
    return np.array(start) + np.arange(count)[:, None] * np.array(step)


def test_two_things_apart_are_two_runs() -> None:
    found = tracklets_of(spots(np.stack([line((0, 0), (9, 2)), line((0, 300), (7, -3))], axis=1)), 1000.0)
    assert sorted(len(t.row) for t in found) == [30, 30]
    for run in found:
        np.testing.assert_allclose(np.diff(run.px, axis=0), np.broadcast_to(run.px[1] - run.px[0], (29, 2)))


def test_runs_end_where_two_things_meet_in_one_place() -> None:
    one, other = line((0.0, 100.0), (6.0, 0.0)), line((180.0, 100.0), (-6.0, 0.5))
    paths = np.stack([one, other], axis=1)
    near = np.abs(one[:, 0] - other[:, 0]) < 10.0
    paths[near, 0] = paths[near].mean(axis=1)
    paths[near, 1] = np.nan
    found = tracklets_of(spots(paths), 1000.0)
    # no run holds places of both
    for run in found:
        of_one = [np.abs(one[row] - at).max() < 1.0 for row, at in zip(run.row, run.px, strict=True)]
        of_other = [np.abs(other[row] - at).max() < 1.0 for row, at in zip(run.row, run.px, strict=True)]
        assert sum(of_one) * sum(of_other) <= 1


def test_a_short_gap_does_not_end_a_run_and_a_long_one_does() -> None:
    path = line((0.0, 0.0), (8.0, 3.0))[:, None]
    path[10:12] = np.nan
    assert [len(t.row) for t in tracklets_of(spots(path), 1000.0)] == [28]
    path[10:16] = np.nan
    assert [len(t.row) for t in tracklets_of(spots(path), 1000.0)] == [10, 14]


def test_a_spot_that_is_half_hidden_does_not_count() -> None:
    area = np.full((30, 1), 100.0)
    area[12:15] = 30.0
    (found,) = tracklets_of(spots(line((0, 0), (8, 3))[:, None], area), 1000.0)
    assert found.row.tolist() == [*range(12), *range(15, 30)]
    assert found.between(5, 14).row.tolist() == [*range(5, 12)]
