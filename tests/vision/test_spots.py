"""Centres and areas of drawn discs."""

from __future__ import annotations

import numpy as np

from dotted import DrawnMasks, coverage
from monodyn.vision.dots.spots import spots_in, spots_of

PLACES = np.array([[200.3, 300.7], [640.25, 80.5]])


def test_centres_are_found_to_a_fraction_of_a_pixel() -> None:
    found = spots_in(coverage(PLACES, 6.0))
    found = found[np.argsort(found[:, 0])]
    np.testing.assert_allclose(found[:, :2], PLACES, atol=0.03)
    np.testing.assert_allclose(found[:, 2], np.pi * 36.0, rtol=0.02)


def test_what_the_border_cuts_and_what_is_faint_is_left_out() -> None:
    plane = coverage(np.array([[3.0, 300.0], [700.0, 300.0]]), 6.0)
    assert len(spots_in(plane)) == 1
    assert len(spots_in(plane // 3)) == 0
    assert spots_in(np.zeros((20, 30), np.uint8)).shape == (0, 3)


def test_spots_are_listed_frame_after_frame() -> None:
    paths = np.array([PLACES, PLACES + 5.0, PLACES + 10.0])
    paths[1, 0] = np.nan
    steps: list[int] = []
    spots = spots_of(DrawnMasks(paths), lambda step, done, total: steps.append(done))  # type: ignore[arg-type]
    assert spots.row.tolist() == [0, 0, 1, 2, 2]
    assert steps == [1, 2, 3]
    assert spots.frame.tolist() == [0, 1, 2]
    assert len(spots.most(1)) == 3
    assert len(spots.most(2)) == 2
    assert spots.of(spots.row == 1).px.shape == (1, 2)
