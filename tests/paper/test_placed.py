"""Sums over the drawn silhouette against the picture of the chain, pixel by pixel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chains import CAMERA, FINE, POSE, chain, chain_picture, silhouette_of
from monodyn.paper.placed import drawn
from monodyn.paper.subproblems import area_gap, centroid_gap, mismatch
from monodyn.paper.threshold import OPEN
from monodyn.paper.view import silhouette_image
from monodyn.types import FULL
from monodyn.vision.drawing.rig import rig_of


def test_area_centroid_and_mismatch_are_those_of_the_drawn_picture(tmp_path: Path) -> None:
    """Rows are taken along their middle lines: half a pixel's slope at the ends of an outline."""
    mechanism, other = chain(tmp_path), np.array([-0.6, 0.3])
    image, rig = silhouette_of(), rig_of(mechanism, CAMERA)
    fine = chain_picture(other, fine=FINE)
    y, x = np.nonzero(fine)
    area, (common, sum_x, sum_y) = drawn(image.moments, rig, other)
    assert area == pytest.approx(len(x) / FINE**2, rel=0.005)
    assert common == pytest.approx(area)
    assert sum_x / common == pytest.approx((x.mean() + 0.5) / FINE - 0.5, abs=0.1)
    assert sum_y / common == pytest.approx((y.mean() + 0.5) / FINE - 0.5, abs=0.1)
    assert area_gap(image, rig, other) == pytest.approx((image.area - area) ** 2)
    apart = (image.x - sum_x / common) ** 2 + (image.y - sum_y / common) ** 2
    assert centroid_gap(image, rig, other) == pytest.approx(apart)
    difference = np.sum(chain_picture(POSE, fine=FINE) != fine) / FINE**2
    assert mismatch(image, rig, other) == pytest.approx(difference, rel=0.02)


def test_what_lies_outside_of_the_picture_or_is_not_known_has_no_area(tmp_path: Path) -> None:
    mechanism = chain(tmp_path)
    rig = rig_of(mechanism, replace(CAMERA, x=CAMERA.x + 0.5))
    shifted = chain_picture(POSE, replace(CAMERA, x=CAMERA.x + 0.5), fine=FINE)
    blank = np.full((CAMERA.height, CAMERA.width), FULL, np.uint8)
    assert drawn(silhouette_image(blank).moments, rig, POSE)[1][0] == pytest.approx(
        shifted.sum() / FINE**2, rel=0.02
    )
    blank[:140] = OPEN
    lower = chain_picture(POSE, fine=FINE)[140 * FINE :]
    assert drawn(silhouette_image(blank).moments, rig_of(mechanism, CAMERA), POSE)[1][0] == pytest.approx(
        lower.sum() / FINE**2, rel=0.02
    )
