"""The mechanism of changeable sizes, and the silhouette that it is compared with."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from chains import CAMERA, chain, view_of
from monodyn.errors import VideoError
from monodyn.paper.view import silhouette_image
from monodyn.vision.drawing.rig import rig_of
from support import refuses


def test_the_drawn_arrays_are_affine_in_the_sizes(tmp_path: Path) -> None:
    mechanism = chain(tmp_path)
    at = view_of(mechanism)
    assert at.reference is not None
    assert at.reference.name == "link1.length"
    sizes = at.sizes * [1.3, 0.7, 2.0]
    expected = rig_of(mechanism.with_values(dict(zip(at.names, sizes, strict=True))), CAMERA)
    for a, b in zip(at.rig_with(sizes), expected, strict=True):
        np.testing.assert_allclose(
            a if a.shape != (2, 14) else a[:, :5], b if b.shape != (2, 14) else b[:, :5]
        )


def test_an_empty_silhouette_is_refused() -> None:
    with refuses(
        VideoError,
        "silhouette: expected some of the mechanism, got an empty picture; give --background a picture "
        "without the mechanism, or use another method.",
    ):
        silhouette_image(np.zeros((20, 20), np.uint8))
