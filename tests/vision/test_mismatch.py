"""The mismatch of silhouettes with a mask against drawn pictures."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.mechanism.tree import SLIDE
from monodyn.types import FULL
from monodyn.vision.drawing.mismatch import pose_mismatch, row_sums
from monodyn.vision.drawing.outline import outline
from monodyn.vision.drawing.rig import rig_of
from pictures import CAMERA


@pytest.mark.parametrize("name", ["double", "bob", "cartpole"])
def test_mismatch_against_drawn_pictures(name: str) -> None:
    """sum |I_a - I_m| of drawn masks, four times finer, against the row sums' exact spans."""
    mechanism = load(name)
    rng = np.random.default_rng(5)
    soft = cv2.GaussianBlur((rng.random((240, 320)) > 0.5).astype(np.float32), (0, 0), 6.0)
    mask = np.clip((soft - 0.45) * 10 * FULL, 0, FULL).astype(np.uint8)
    rig = rig_of(mechanism, CAMERA)
    dofs = len(rig.parent)
    poses = rng.normal(scale=0.8, size=(6, dofs)) * np.where(rig.kind == SLIDE, 0.1, 1.0)
    costs = pose_mismatch(row_sums(mask), rig, poses, len(rig.radius))
    fine = 8
    big = cv2.resize(mask, None, fx=fine, fy=fine, interpolation=cv2.INTER_NEAREST).astype(np.float64) / FULL
    for q, cost in zip(poses, costs, strict=True):
        drawn = np.zeros(big.shape, np.uint8)
        for _, polygon in outline(mechanism, CAMERA, q):
            corners = np.round(((polygon + 0.5) * fine - 0.5) * 16).astype(np.int32)
            cv2.fillPoly(drawn, [corners], 1, cv2.LINE_8, 4)
            assert polygon.min() > 0, "keep the test's poses in the picture"
            assert (polygon < [319, 239]).all(), "keep the test's poses in the picture"
        expected = np.sum(np.where(drawn > 0, 1.0 - 2.0 * big, 0.0)) / fine**2
        # a row is taken along its middle line: half a pixel's slope at the ends of each outline
        assert cost == pytest.approx(expected, abs=12.0)
