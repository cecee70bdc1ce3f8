"""Pictures whose rows are exposed for a while, and one after the other."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.vision.drawing.follow import EdgeSearch, MoveLimits, follow
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.drawing.shutter import Shutter, way
from monodyn.vision.drawing.silhouette import blank_outlines, draw
from pictures import CAMERA, exposed_mask, trusted

SEARCH = EdgeSearch(np.array([12.0, 8.0, 6.0, 5.0, 4.0, 4.0, 4.0]), 3.0)


@pytest.mark.parametrize("readout", [0.3, -0.3])
def test_rows_that_are_exposed_one_after_the_other(readout: float) -> None:
    """The mechanism turns by 0.3 rad between the first row and the last."""
    mechanism, q = load("double"), np.array([-1.9, 0.5])
    rates = np.array([1.0, -0.7])
    mask = exposed_mask(mechanism, CAMERA, q, skew=readout * rates, count=1)
    limits = MoveLimits(q - 1.0, q + 1.0, np.full(2, 1.0))
    rig = rig_of(mechanism, CAMERA)
    moving = Shutter(0.0, 0.0, readout, q[None], rates[None], np.zeros((1, 2))).of(rig, 0)
    found, _, agreement = follow(mask, trusted(mechanism), moving, q + 0.02, limits, SEARCH)
    assert np.abs(np.degrees(found - q)).max() < 0.15
    assert agreement.matched > 0.95
    at_once = follow(mask, trusted(mechanism), rig, q + 0.02, limits, SEARCH)[0]
    assert np.abs(np.degrees(at_once - q)).max() > 0.5


def test_a_point_is_caught_when_its_row_is_exposed() -> None:
    mechanism, q, rate = load("single"), np.array([-0.4]), 2.0
    rig = rig_of(mechanism, CAMERA)
    readout = 0.05
    skewed, still = blank_outlines(rig, len(rig.radius)), blank_outlines(rig, len(rig.radius))
    assert draw(rig._replace(skew=np.array([readout * rate])), q, skewed)
    for point, (x, y) in enumerate(skewed.px):
        time = readout * (y / (CAMERA.height - 1) - 0.5)
        assert draw(rig, q + time * rate, still)
        assert (x, y) == pytest.approx(tuple(still.px[point]), abs=0.02)


def test_a_shutter_knows_the_motion_of_its_pictures_alone() -> None:
    rig = rig_of(load("double"), CAMERA)
    rates = np.array([[0.0, 0.0], [1.0, 2.0], [3.0, 4.0]])
    shutter = Shutter(0.02, 0.001, 0.01, np.zeros((3, 2)), rates, 800.0 * rates)
    moving = shutter.of(rig, 1)
    assert (moving.sweep.tolist(), moving.skew.tolist()) == ([0.02, 0.04], [0.01, 0.02])
    # half an exposure of 0.02 s with 800 rad/s^2
    assert moving.bend == pytest.approx([0.04, 0.08])
    assert moving.lean == pytest.approx([0.01, 0.02])
    ends = shutter.during(1, np.zeros(2), np.array([-0.01, 0.0, 0.01]))
    assert ends == pytest.approx(
        np.array([moving.bend - 0.5 * moving.sweep, [0, 0], moving.bend + 0.5 * moving.sweep])
    )
    assert shutter.of(rig, 3) is rig
    assert shutter.span == pytest.approx(0.03)
    part = shutter.only([2], np.array([1.0, 10.0]))
    assert (part.rate.tolist(), part.exposure, part.std) == ([[3.0, 40.0]], 0.02, 0.001)
    assert part.acceleration.tolist() == [[2400.0, 32000.0]]
    assert way(rig, np.zeros(2)) == 0.0
    # the end of the last link: its distance from the camera's axis does not matter before a plane
    assert way(moving, np.zeros(2)) > way(shutter.of(rig, 0), np.zeros(2)) == 0.0
