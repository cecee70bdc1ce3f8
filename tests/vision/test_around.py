"""Pixels around the outline of a pose, against polygons filled and widened by OpenCV."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.mechanism.tree import HINGE
from monodyn.types import Camera
from monodyn.vision.drawing.around import _find_sides, rows_around
from monodyn.vision.drawing.follow import BESIDE_PX, EdgeSearch, MoveLimits, follow_kernel
from monodyn.vision.drawing.outline import outline
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.foreground.masks import LEFT, PLANE, RIGHT, ROW
from pictures import CAMERA, drawn_mask, trusted

SEARCH = EdgeSearch(np.array([8.0, 6.0, 4.0, 4.0, 4.0]), 2.0)
SHIFT = 8
"""Pixels are 256ths to OpenCV."""


def shown(rows: np.ndarray, plane: int, size: tuple[int, int]) -> np.ndarray:
    """Return the pixels of the stretches of a plane, bool (height, width)."""
    found = np.zeros(size, bool)
    for row in rows[rows[:, PLANE] == plane]:
        found[row[ROW], row[LEFT] : row[RIGHT]] = True
    return found


@pytest.mark.parametrize("name", ["double", "bob", "cartpole", "chain:4"])
@pytest.mark.parametrize("by", [0, 3, 12])
def test_the_pixels_around_an_outline(name: str, by: int) -> None:
    mechanism, rng = load(name), np.random.default_rng(by)
    rig, size = rig_of(mechanism, CAMERA), (CAMERA.height, CAMERA.width)
    hinge = mechanism.tree.kind == HINGE
    for _ in range(30):
        # some poses reach out of the picture
        q = np.where(hinge, rng.uniform(-3.0, 3.0, len(hinge)), rng.uniform(-0.6, 0.6, len(hinge)))
        part = rng.integers(-1, 2, len(rig.radius))
        rows, window = rows_around(rig, q, part, by, size)
        for plane in (0, 1):
            polygons = [
                polygon
                for geom, (_, polygon) in enumerate(outline(mechanism, CAMERA, q))
                if part[geom] == plane
            ]
            found = shown(rows, plane, size)
            least, most = (widened(polygons, size, by + more) for more in (-1, 3))
            assert not np.any(least & ~found)
            assert not np.any(found & ~most)
        if len(rows):
            assert window.top == rows[:, ROW].min()
            assert window.bottom == rows[:, ROW].max() + 1
            assert (window.left, window.right) == (rows[:, LEFT].min(), rows[:, RIGHT].max())


def widened(polygons: list[np.ndarray], size: tuple[int, int], by: int) -> np.ndarray:
    """Return the pixels within so many rows and columns of polygons, bool (height, width)."""
    margin = 40
    picture = np.zeros((size[0] + 2 * margin, size[1] + 2 * margin), np.uint8)
    for polygon in polygons:
        corners = np.round((polygon + margin) * 2**SHIFT).astype(np.int32)
        cv2.fillPoly(picture, [corners], 1, cv2.LINE_8, SHIFT)
    if by > 0:
        picture = cv2.dilate(picture, np.ones((2 * by + 1, 2 * by + 1), np.uint8))
    inside = picture[margin:-margin, margin:-margin] > 0
    return inside if by >= 0 else np.zeros_like(inside)


@pytest.mark.parametrize("height", [0.0, 1e-12, 1e-10, 1e-6, 0.4, 3.0])
def test_the_sides_of_a_flat_outline(height: float) -> None:
    px = np.array([[10.2, 5.5], [90.7, 5.5 + height]])
    for order in ([0, 1], [1, 0]):
        sides = np.empty((2, 8), np.int64)
        _find_sides(px, np.array(order), 5, 9, sides)
        assert sides[0, :4].min() == 10
        assert sides[1, :4].max() == 91


def test_nothing_lies_around_a_pose_that_cannot_be_drawn() -> None:
    near = Camera(CAMERA.width, CAMERA.height, CAMERA.focal, 0.0, 0.0, -1.0)
    rig = rig_of(load("single"), near)
    rows, window = rows_around(rig, np.zeros(1), np.zeros(1, np.int64), 5, (near.height, near.width))
    assert len(rows) == 0
    assert window == (0, 0, 0, 0)


@pytest.mark.parametrize("off", [0.02, 0.06, 0.1, 0.14, 0.18])
def test_nothing_else_of_a_mask_is_looked_at(off: float) -> None:
    """What lies farther from the start's outline than is known may be anything, or the pose says so."""
    mechanism, truth, by = load("double"), np.array([0.4, -0.7]), 14
    rig, size = rig_of(mechanism, CAMERA), (CAMERA.height, CAMERA.width)
    view, free = trusted(mechanism), np.full(2, np.inf)
    mask, start = drawn_mask(mechanism, CAMERA, truth), truth + off * np.array([1.0, -1.0])
    around = shown(rows_around(rig, start, view.part, by, size).rows, 0, size)
    limits = MoveLimits(-free, free, np.ones(2))
    whole = follow_kernel(mask, view, rig, start, limits, SEARCH, np.inf)
    assert whole[3]
    kept = []
    for seed in range(4):
        noise = np.random.default_rng(seed).integers(0, 256, mask.shape, dtype=np.uint8)
        part = follow_kernel(np.where(around, mask, noise), view, rig, start, limits, SEARCH, float(by))
        kept.append(part[3])
        if part[3]:
            for one, other in zip(part[:3], whole[:3], strict=True):
                np.testing.assert_array_equal(one, other)
    # the first search alone reaches as far as this
    assert SEARCH.reaches[0] + BESIDE_PX < by
    assert kept == [off < 0.12] * 4


def test_the_last_step_counts_too() -> None:
    """A single search, whose step leads out of what is known: the end of it is looked at elsewhere."""
    mechanism, truth, by = load("single"), np.array([0.4]), 12
    rig, free, search = rig_of(mechanism, CAMERA), np.full(1, np.inf), EdgeSearch(np.array([10.0]), 2.0)
    mask, limits = drawn_mask(mechanism, CAMERA, truth), MoveLimits(-free, free, np.ones(1))
    kept = [
        follow_kernel(mask, trusted(mechanism), rig, truth + off, limits, search, float(by))[3]
        for off in (0.0, 0.1)
    ]
    assert search.reaches[0] + BESIDE_PX < by
    assert kept == [True, False]
