"""Poses moved onto the edges of drawn masks."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.mechanism.tree import HINGE
from monodyn.vision.drawing.follow import EdgeSearch, MoveLimits, follow
from monodyn.vision.drawing.rig import rig_of
from pictures import CAMERA, drawn_mask, trusted

SEARCH = EdgeSearch(np.array([8.0, 6.0, 4.0, 4.0, 4.0]), 2.0)


@pytest.mark.parametrize("name", ["double", "bob", "cartpole", "chain:3"])
def test_follow_finds_the_pose(name: str) -> None:
    mechanism = load(name)
    hinge = mechanism.tree.kind == HINGE
    truth = np.where(hinge, np.linspace(-0.9, 0.9, len(hinge)), 0.02)
    mask = drawn_mask(mechanism, CAMERA, truth)
    start = truth + np.where(hinge, 0.06, 0.01) * np.where(np.arange(len(hinge)) % 2, -1, 1)
    free = np.full(len(hinge), np.inf)
    limits = MoveLimits(-free, free, np.ones(len(hinge)))
    rig = rig_of(mechanism, CAMERA)
    q, information, agreement = follow(mask, trusted(mechanism), rig, start, limits, SEARCH)
    # a few hundredths of a pixel over links of 30 to 60 px
    np.testing.assert_allclose(q, truth, atol=2e-3)
    assert np.all(np.linalg.eigvalsh(information) > 0)
    assert agreement.inside > 0.95


def test_follow_keeps_within_its_limits() -> None:
    mechanism = load("single")
    mask = drawn_mask(mechanism, CAMERA, np.array([0.3]))
    limits = MoveLimits(np.array([0.0]), np.array([0.25]), np.ones(1))
    rig = rig_of(mechanism, CAMERA)
    q, _, _ = follow(mask, trusted(mechanism), rig, np.array([0.2]), limits, SEARCH)
    assert q[0] == 0.25


def test_pixels_that_are_not_trusted_say_nothing() -> None:
    mechanism = load("single")
    q = np.array([-0.5])
    mask = drawn_mask(mechanism, CAMERA, q)
    rig = rig_of(mechanism, CAMERA)
    blind = trusted(mechanism)._replace(trust=np.zeros(mask.shape, np.float32))
    limits = MoveLimits(np.full(1, -9.0), np.full(1, 9.0), np.ones(1))
    _, information, agreement = follow(mask, blind, rig, q, limits, SEARCH)
    assert agreement.samples == 0
    assert information[0, 0] == 0.0


def test_the_start_holds_what_the_picture_does_not_show() -> None:
    """Without an edge to go by a pose stays where it was."""
    mechanism = load("double")
    mask = np.zeros((1, CAMERA.height, CAMERA.width), np.uint8)
    blind = trusted(mechanism)._replace(trust=np.zeros(mask.shape, np.float32))
    start, free = np.array([0.3, -0.2]), np.full(2, np.inf)
    limits = MoveLimits(-free, free, np.ones(2))
    q, _, _ = follow(mask, blind, rig_of(mechanism, CAMERA), start, limits, SEARCH)
    np.testing.assert_array_equal(q, start)
