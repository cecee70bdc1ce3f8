"""Searches for the first pose from starts all around it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments import lost, mechanism, seen
from monodyn.paper.view import CAMERA_HELD, model_view, silhouette_image
from monodyn.reproduce.pose_starts import directions, pose_starts, settled
from monodyn.types import FULL, Camera
from monodyn.vision.drawing.outline import covered_pixels

CAMERA = Camera(640, 480, 2000.0, 0.05, -0.07, 1.0)


def test_repeated_searches_end_in_the_drawn_pose() -> None:
    pose = np.array([-0.9, 0.5])
    covered = covered_pixels(mechanism(), CAMERA, pose, margin=0.0)
    image = silhouette_image((FULL * covered).astype(np.uint8))
    view = model_view(mechanism(), CAMERA, pose + np.array([0.1, -0.08]), CAMERA_HELD)
    found = settled(image, view).position
    # 1 px at the ends of the links, 200 px long, whose silhouette is drawn in whole pixels
    assert found == pytest.approx(pose, abs=1.0 / 200.0)


def test_starts_are_counted_once() -> None:
    rng = np.random.default_rng(0)
    np.testing.assert_array_equal(directions(rng, 1), [[1.0], [-1.0]])
    turns = np.array(directions(rng, 2))
    assert turns.shape == (24, 2)
    np.testing.assert_array_equal(np.abs(turns).max(axis=1), 1.0)


def test_only_a_scene_of_the_published_method_is_searched() -> None:
    assert pose_starts(seen(), None, 0) is None
    assert pose_starts(lost().seen, None, 0) is None
    other: Any = SimpleNamespace(scene=None)
    assert pose_starts(other, None, 0) is None
