"""Starts of the local search."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from chains import POSE, chain, silhouette_of, view_of
from monodyn.paper import starts
from monodyn.paper.sequential import interleaved
from monodyn.paper.starts import evolved_starts, grid_starts, pose_by_beam
from support import slow


@pytest.mark.slow
@pytest.mark.parametrize("search", [grid_starts, slow(evolved_starts)])
def test_starts_lead_to_the_pose(tmp_path: Path, search: object) -> None:
    """From no pose at all; a chain may be read from either end, so one of the starts comes out right."""
    mechanism = chain(tmp_path, lengths=(0.1, 0.1), widths=(0.02, 0.02))
    image = silhouette_of()
    found, drawings = search(image, view_of(mechanism, q=np.zeros(2)), 4)  # pyright: ignore[reportCallIssue]
    assert drawings > 1000
    ends = [interleaved(image, start)[0] for start in found]
    errors = [np.abs((end.position - POSE + np.pi) % (2 * np.pi) - np.pi).max() for end in ends]
    assert min(errors) < np.radians(0.3)


@pytest.mark.parametrize("links", [2, 4, slow(6)])
def test_the_grid_keeps_to_its_number_of_poses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: int
) -> None:
    """A grid of four values a joint would have 4,096 poses for six links; each is drawn three times."""
    monkeypatch.setattr(starts, "GRID_POSES", 600)
    mechanism = chain(tmp_path, lengths=(0.04,) * links, widths=(0.02,) * links)
    found, drawings = grid_starts(silhouette_of(), view_of(mechanism, q=np.zeros(links)), 4)
    assert len(found) == 4
    assert drawings <= 3 * 600 * links


def test_the_evolution_takes_its_seed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same seed gives the same starts, another seed none of them."""
    monkeypatch.setattr(starts, "GENERATIONS", 5)
    image, at = silhouette_of(), view_of(chain(tmp_path), q=np.zeros(2))
    first, again, other = (evolved_starts(image, at, 2, seed=seed)[0] for seed in (0, 0, 1))
    np.testing.assert_array_equal([s.position for s in first], [s.position for s in again])
    for a in first:
        assert not any(np.array_equal(a.position, b.position) for b in other)


def test_a_pose_is_found_anywhere_before_a_known_camera(tmp_path: Path) -> None:
    far = np.array([2.0, -2.2])
    found, left, _ = pose_by_beam(silhouette_of(far), view_of(chain(tmp_path)))
    np.testing.assert_allclose(
        (found.position - far + np.pi) % (2 * np.pi) - np.pi, 0.0, atol=np.radians(0.5)
    )
    assert left < 100.0
