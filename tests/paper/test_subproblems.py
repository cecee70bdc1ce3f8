"""Each of the four problems alone, from a start that is off."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chains import ALL_FREE, CAMERA, POSE, chain, falls, silhouette_of, view_of
from monodyn.paper.placed import DEPTH, CameraFree, X, Y, drawn
from monodyn.paper.start_model import StartModel
from monodyn.paper.subproblems import (
    fit_depth,
    fit_place,
    fit_pose,
    fit_ratios,
    mismatch,
    outline_points,
    pose_directions,
)
from monodyn.paper.view import CAMERA_HELD
from monodyn.vision.drawing.rig import rig_of


def test_depth_from_the_area(tmp_path: Path) -> None:
    """Eq. (1): a pixel's share of the outline, 1 % of this area, is 0.5 % of the depth."""
    start = view_of(chain(tmp_path), replace(CAMERA, depth=1.9))
    found, history = fit_depth(silhouette_of(), start)
    assert found.base.camera[DEPTH] == pytest.approx(CAMERA.depth, rel=0.005)
    assert history.problem == "depth"
    assert falls(history)
    assert history.evaluations[-1] < 60


def test_depth_where_the_mechanism_reaches_behind_the_camera(tmp_path: Path) -> None:
    """Nothing can be drawn from there: the search backs off as far as it may, and ends."""
    start = view_of(chain(tmp_path), replace(CAMERA, depth=0.001))
    assert np.isnan(drawn(silhouette_of().moments[:1], start.rig, start.position)[0])
    found, _ = fit_depth(silhouette_of(), start)
    assert found.base.camera[DEPTH] >= 0.001


def test_place_from_the_centroid(tmp_path: Path) -> None:
    """Eq. (2): 0.1 px is 0.3 mm here."""
    start = view_of(chain(tmp_path), replace(CAMERA, x=0.12, y=-0.02))
    found, history = fit_place(silhouette_of(), start)
    np.testing.assert_allclose(found.base.camera[X : Y + 1], [CAMERA.x, CAMERA.y], atol=3e-4)
    assert falls(history)


@pytest.mark.parametrize("free", [CAMERA_HELD, ALL_FREE])
def test_pose_from_the_mismatch(tmp_path: Path, free: CameraFree) -> None:
    """Eq. (3), before a camera that stays and before one that follows."""
    start = view_of(chain(tmp_path), q=np.array([-0.55, 0.4]), free=free)
    found, history = fit_pose(silhouette_of(), start)
    np.testing.assert_allclose(found.position, POSE, atol=np.radians(0.3))
    assert falls(history)


def test_a_joint_limit_holds(tmp_path: Path) -> None:
    start = view_of(
        chain(tmp_path, limits='range="-0.6 0.4" limited="true"'), q=np.array([-0.5, 0.2]), free=CAMERA_HELD
    )
    found, _ = fit_pose(silhouette_of(), start)
    assert np.all((found.position >= -0.6) & (found.position <= 0.4))
    image = silhouette_of()
    grid = [np.array([a, b]) for a in np.linspace(-0.6, -0.5, 11) for b in np.linspace(-0.6, 0.4, 51)]
    best = min(mismatch(image, start.rig, q) for q in grid)
    assert mismatch(image, start.rig, found.position) <= 1.02 * best


def test_aspect_ratios_from_the_mismatch(tmp_path: Path) -> None:
    """Eq. (4): width over length of each body; before a camera that stays lengths are seen as well."""
    start = view_of(chain(tmp_path, lengths=(0.21, 0.18), widths=(0.045, 0.016)), free=CAMERA_HELD)
    found, history = fit_ratios(silhouette_of(), start)
    sizes = dict(zip(found.names, found.sizes, strict=True))
    expected = {"link1.length": 0.2, "link1.width": 0.03, "link2.length": 0.15, "link2.width": 0.024}
    assert sizes == pytest.approx(expected, rel=0.03)
    assert falls(history)


def test_ratios_keep_the_sum_of_the_lengths(tmp_path: Path) -> None:
    """Before a camera that (1) has to find the common scale is not searched: the lengths keep their sum."""
    mechanism = chain(tmp_path, lengths=(0.22, 0.13), widths=(0.04, 0.02))
    start = StartModel(mechanism, CAMERA, ()).view(reference_held=False)
    packed = view_of(mechanism).base.camera
    start = replace(start, free=CAMERA_HELD, position=POSE).before(packed)
    found, history = fit_ratios(silhouette_of(), start)
    sizes = dict(zip(found.names, found.sizes, strict=True))
    assert sizes["link1.length"] + sizes["link2.length"] == pytest.approx(0.35, abs=1e-12)
    expected = {"link1.length": 0.2, "link1.width": 0.03, "link2.length": 0.15, "link2.width": 0.024}
    assert sizes == pytest.approx(expected, rel=0.03)
    assert falls(history)


def test_directions_move_the_picture_by_a_pixel_independently(tmp_path: Path) -> None:
    rig = rig_of(chain(tmp_path), CAMERA)
    directions = pose_directions(rig, POSE, np.arange(2))
    h = 1e-3
    moves = [
        (outline_points(rig, POSE + h * d) - outline_points(rig, POSE - h * d)).ravel() / (2 * h)
        for d in directions.T
    ]
    gram = 2.0 * np.array([[a @ b for b in moves] for a in moves]) / len(moves[0])
    np.testing.assert_allclose(gram, np.eye(2), atol=1e-3)
