"""The mechanism of changeable sizes, and the silhouette that it is compared with."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from chains import CAMERA, chain, view_of
from monodyn.errors import VideoError
from monodyn.mechanism.tree import MASS
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
    drawn = at.rig_with(sizes)
    # masses and inertias are no part of the drawing, and not affine
    np.testing.assert_allclose(drawn.links[:, :MASS], expected.links[:, :MASS])
    for field in ("link", "first", "points", "radius", "camera"):
        np.testing.assert_allclose(getattr(drawn, field), getattr(expected, field))


def test_an_empty_silhouette_is_refused() -> None:
    with refuses(
        VideoError,
        "silhouette: expected some of the mechanism, got an empty picture; give --background a picture "
        "without the mechanism, or use another method.",
    ):
        silhouette_image(np.zeros((20, 20), np.uint8))
