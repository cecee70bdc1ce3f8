"""Camera, pose and sizes together, where a part of the silhouette is missing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chains import ALL_FREE, CAMERA, LENGTHS, POSE, WIDTHS, chain, chain_picture, falls, view_of
from monodyn.paper.placed import DEPTH, FOCAL, X
from monodyn.paper.start_model import StartModel
from monodyn.paper.subproblems import LEAST_SIZE_PX, camera_placed, mismatch
from monodyn.paper.together import fit_together
from monodyn.paper.view import ModelView, SilhouetteImage, silhouette_image
from monodyn.types import FULL

PX = CAMERA.depth / CAMERA.focal
"""A pixel in the plane of the mechanism [m]."""


ACROSS = np.array([-np.sin(POSE[0]), np.cos(POSE[0])])
"""Across the first link, to the right and up."""


def hinge_px(view: ModelView) -> np.ndarray:
    """Return where the first hinge is seen from the middle of the picture, to the right and up [px], (2,)."""
    camera = view.base.camera
    return -camera[X : X + 2] * camera[FOCAL] / camera[DEPTH]


def lacking() -> SilhouetteImage:
    """Return the silhouette of the chain without 12 px about its first hinge."""
    picture = chain_picture(POSE)
    y, x = np.mgrid[: CAMERA.height, : CAMERA.width]
    hinge = (CAMERA.width - 1) / 2 - CAMERA.x / PX, (CAMERA.height - 1) / 2 + CAMERA.y / PX
    picture[np.hypot(x - hinge[0], y - hinge[1]) < 12.0] = 0
    return silhouette_image(picture * np.uint8(FULL))


def test_the_line_of_a_body_is_found_where_areas_and_centroids_miss_it(tmp_path: Path) -> None:
    """The place along the first link is open here; across it and all else comes out to parts of a pixel."""
    image, true = lacking(), view_of(chain(tmp_path))
    by_centroids = camera_placed(image, camera_placed(image, true))
    assert np.hypot(*(hinge_px(by_centroids) - hinge_px(true))) > 2.0
    sizes = true.sizes * np.linspace(0.95, 1.06, len(true.sizes))
    start = replace(by_centroids, position=POSE + np.array([0.03, -0.05]), sizes=sizes)
    found, history = fit_together(image, start)
    assert history.problem == "together"
    assert falls(history)
    assert mismatch(image, found.rig, found.position) == pytest.approx(history.values[-1])
    assert history.values[-1] < mismatch(image, true.rig, POSE)
    np.testing.assert_allclose(found.position, POSE, atol=np.radians(0.3))
    away = hinge_px(found) - hinge_px(true)
    assert abs(away @ ACROSS) < 0.3


@pytest.mark.parametrize("free", ALL_FREE._asdict())
def test_what_is_known_stays(tmp_path: Path, free: str) -> None:
    """A coordinate of the camera that is not free keeps its value to the last bit, as does a held joint."""
    true = view_of(chain(tmp_path))
    held, most = POSE[0] + 0.02, POSE[1] - 0.15
    start = replace(
        true, free=ALL_FREE._replace(**{free: False}), limits=np.array([[held, -3.0], [held, most]]),
        position=np.array([held, most - 0.1]),
    )  # fmt: skip
    found, _ = fit_together(lacking(), start)
    moved = found.base.camera != start.base.camera
    names = ("x", "y", "depth")
    assert {name for name, one in zip(names, moved[X : DEPTH + 1], strict=True) if one} == set(names) - {free}
    # the other one would go beyond its limit
    assert found.position.tolist() == [held, most]


def test_a_reference_that_is_searched_leaves_the_depth(tmp_path: Path) -> None:
    """As the strict framework has it: the first length takes the place of the depth."""
    mechanism = chain(tmp_path)
    view = replace(StartModel(mechanism, CAMERA, ()).view(reference_held=False), position=POSE)
    assert view.reference in view.searched
    start = replace(view, sizes=1.05 * view.sizes).before(view_of(mechanism).base.camera)
    found, _ = fit_together(lacking(), start)
    assert found.base.camera[DEPTH] == start.base.camera[DEPTH]
    place = view.searched.index(view.reference)
    assert found.sizes[place] != start.sizes[place]


def test_bounds_of_sizes_hold(tmp_path: Path) -> None:
    """One size may not reach its true value, and none becomes so small that it is no longer seen."""
    true = view_of(chain(tmp_path))
    upper = true.upper.copy()
    upper[1] = 0.9 * true.sizes[1]
    found, _ = fit_together(lacking(), replace(true, upper=upper, sizes=np.minimum(true.sizes, upper)))
    assert (found.sizes <= upper).all()
    assert found.sizes[1] == upper[1]
    thin = replace(true, upper=np.full(len(true.sizes), 0.1 * PX), lower=np.zeros(len(true.sizes)))
    thin = replace(thin, upper=np.where(true.overhang, thin.upper, 1.2 * LEAST_SIZE_PX * PX))
    found, _ = fit_together(lacking(), replace(thin, sizes=np.minimum(true.sizes, 0.5 * PX)))
    assert (found.sizes[~true.overhang] >= LEAST_SIZE_PX * PX * (1.0 - 1e-9)).all()


def test_the_search_does_not_depend_on_the_unit_of_length(tmp_path: Path) -> None:
    """A mechanism a thousand times as large, from as far away, in the same steps."""
    found = []
    for k, factor in enumerate((1.0, 1000.0)):
        folder = tmp_path / str(k)
        folder.mkdir()
        lengths, widths = (tuple(factor * one for one in sizes) for sizes in (LENGTHS, WIDTHS))
        camera = replace(CAMERA, x=factor * CAMERA.x, y=factor * CAMERA.y, depth=factor * CAMERA.depth)
        # the thickness of a box stays, which is little of the distance
        view = view_of(chain(folder, lengths, widths), camera, POSE + np.array([0.03, -0.05]))
        found.append(fit_together(lacking(), view))
    (one, fell), (other, fell_too) = found
    assert fell_too.values[-1] == pytest.approx(fell.values[-1], rel=0.05)
    np.testing.assert_allclose(one.position, other.position, atol=np.radians(0.5))
