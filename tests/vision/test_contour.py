"""What became of every sample of an outline, on drawn masks whose edges are known."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.vision.drawing.contour import (
    COVERED,
    ELSEWHERE,
    NO_CONTRAST,
    NO_EDGE,
    OFF_PICTURE,
    ON_EDGE,
    contour,
)
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.foreground.masks import plain_view
from pictures import CAMERA, drawn_mask, trusted

Q = np.array([-0.5])


def fates(mask: np.ndarray, q: np.ndarray = Q, name: str = "single") -> np.ndarray:
    mechanism = load(name)
    return contour(mask, trusted(mechanism), rig_of(mechanism, CAMERA), q, 4.0, 3.0).fate


def test_an_outline_in_its_place_lies_on_the_edges() -> None:
    mask = drawn_mask(load("single"), CAMERA, Q)
    found = contour(mask, trusted(load("single")), rig_of(load("single"), CAMERA), Q, 4.0, 3.0)
    assert len(found.fate) > 20
    assert (found.fate == ON_EDGE).all()
    assert found.edge == pytest.approx(found.place, abs=0.3)


def test_an_outline_nearby_finds_the_edges_where_they_are() -> None:
    mechanism = load("single")
    mask, rig = drawn_mask(mechanism, CAMERA, Q), rig_of(mechanism, CAMERA)
    away = contour(mask, trusted(mechanism), rig, Q + 0.05, 4.0, 3.0)
    assert (away.fate == ELSEWHERE).sum() > 5
    there = contour(mask, trusted(mechanism), rig, Q, 4.0, 0.5).place
    for edge in away.edge[away.fate == ELSEWHERE]:
        assert np.min(np.hypot(*(there - edge).T)) < 0.8


def test_an_empty_mask_has_no_edge() -> None:
    assert set(fates(np.zeros((1, CAMERA.height, CAMERA.width), np.uint8))) == {NO_EDGE}


def test_what_is_left_out_has_its_reason() -> None:
    mechanism = load("double")
    q = np.array([-0.5, 0.9])
    mask, rig = drawn_mask(mechanism, CAMERA, q), rig_of(mechanism, CAMERA)
    trust = np.ones((CAMERA.height, CAMERA.width), np.float32)
    found = contour(mask, plain_view(trust, 2), rig, q, 4.0, 3.0)
    assert set(found.fate) == {ON_EDGE, COVERED}
    # the same without any contrast on the right
    right = int(np.median(found.place[:, 0]))
    trust[:, right:] = 0.0
    blind = contour(mask, plain_view(trust, 2), rig, q, 4.0, 3.0)
    beyond = (blind.place[:, 0] > right + 5) & (found.fate != COVERED)
    assert beyond.sum() > 10
    assert (blind.fate[beyond] == NO_CONTRAST).all()
    assert np.array_equal(blind.place, found.place)


def test_what_leaves_the_picture_is_said() -> None:
    rig = rig_of(load("single"), CAMERA)
    rig.camera[9] -= 0.55
    mask = np.zeros((1, CAMERA.height, CAMERA.width), np.uint8)
    found = contour(mask, trusted(load("single")), rig, Q, 4.0, 3.0)
    outside = found.place[:, 0] > CAMERA.width
    assert outside.any()
    assert (found.fate[outside] == OFF_PICTURE).all()


def test_a_pose_that_cannot_be_drawn_has_no_samples() -> None:
    assert len(fates(np.zeros((1, CAMERA.height, CAMERA.width), np.uint8), np.array([np.nan]))) == 0
