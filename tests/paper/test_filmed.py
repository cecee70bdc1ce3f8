"""What is measured in a film to judge it by."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from chains import CAMERA, LENGTHS, THICK, WIDTHS
from films import COUNT, film
from monodyn.paper.assumptions import ALONE, failed, failed_advice
from monodyn.paper.filmed import background_drift, measured, outlook
from monodyn.paper.silhouettes import ClipSilhouettes


@pytest.mark.slow
def test_a_film_of_the_drawn_mechanism(tmp_path: Path) -> None:
    """Against what the film was made of: a mechanism of grey 60 before a wall of 165 on average."""
    scene, poses = film(tmp_path, lost=(3, 4))
    found = measured(scene, poses, ClipSilhouettes(scene.masks))
    assert len(found.looks) == COUNT - 2
    assert len(found.unseen) == 2
    assert found.seen == 1.0 - 2 / COUNT
    assert len(found.drift) == len(found.looks) - 1
    assert max(found.drift) < 0.05
    # two rectangles that overlap at the elbow, seen from a little nearer than their middle plane
    px = CAMERA.focal / (CAMERA.depth - THICK / 2)
    area = sum(length * width for length, width in zip(LENGTHS, WIDTHS, strict=True)) * px**2
    assert abs(found.usual("area") / area - 1.0) < 0.1
    for look in found.looks:
        assert max(look.missed, look.excess, look.far, look.outside) < 0.01
        np.testing.assert_allclose(look.centroids[:2], look.centroids[2:], atol=1.5)


def test_silhouettes_without_poses(tmp_path: Path) -> None:
    """A ball of 50 px wanders along the bottom, and out of the picture."""

    def ball(k: int, picture: np.ndarray) -> np.ndarray:
        return cv2.circle(picture.copy(), (20 + 10 * k, 250), 25, 60.0, -1)

    scene, _ = film(tmp_path, ball)
    silhouettes = ClipSilhouettes(scene.masks)
    found = outlook(silhouettes)
    assert found.level == silhouettes.threshold.level
    assert found.noise == scene.masks.background.noise
    assert 0.2 < found.apart < 0.5
    # its edge lies outside in the first frame and from the 32nd on
    assert abs(found.cut - 7 / COUNT) < 0.06
    assert found.undecided < 0.1
    assert max(background_drift(silhouettes)) < 0.05
    assert ALONE in [own.name for own in failed(silhouettes)]
    assert failed_advice(silhouettes)[0] == (
        'The published method assumes: "The mechanism moves alone and is seen in one piece." This film is '
        f"otherwise. {found.apart:.0%} of the silhouette lie apart from its largest patch."
    )
