"""The framework of all four problems."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chains import CAMERA, POSE, chain, falls, silhouette_of, view_of
from monodyn.paper.placed import DEPTH, X
from monodyn.paper.sequential import strict
from monodyn.paper.subproblems import mismatch


def test_the_framework_finds_all_of_them(tmp_path: Path) -> None:
    """Fig. 2 from wrong sizes, camera and pose: the scale of the file stays, so the depth takes it."""
    mechanism = chain(tmp_path, lengths=(0.1, 0.1), widths=(0.02, 0.02))
    image = silhouette_of()
    start = view_of(mechanism, replace(CAMERA, depth=0.8, x=0.0, y=0.0), np.array([-0.7, 0.55]))
    found, histories = strict(image, start)
    sizes = dict(zip(found.names, found.sizes, strict=True))
    np.testing.assert_allclose(found.position, POSE, atol=np.radians(0.3))
    assert sizes == pytest.approx(
        {"link1.width": 0.015, "link2.length": 0.075, "link2.width": 0.012}, rel=0.03
    )
    np.testing.assert_allclose(found.base.camera[X : DEPTH + 1], [0.015, -0.06, 0.55], rtol=0.02)
    assert mismatch(image, found.rig, found.position) < 0.03 * image.area
    assert [h.problem for h in histories[:4]] == ["depth", "place", "pose", "ratios"]
    assert all(falls(h) for h in histories)
