"""The global search on reduced key frames of drawn masks."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.types import Camera
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.locating.grow import SceneStart
from monodyn.vision.locating.search import SceneGuess, search_pose, search_scene
from pictures import drawn_frames

SMALL = Camera(160, 120, 150.0, x=0.05, y=-0.1, depth=0.9)


def test_a_pose_is_found_from_the_mask_alone() -> None:
    mechanism = load("double")
    truth = np.array([-0.9, 1.3])
    frames = drawn_frames(mechanism, SMALL, truth[None])
    q, left = search_pose(frames.frames[0], frames, rig_of(mechanism, SMALL), mechanism)
    # a few hundredths of a pixel on links of 40 px
    np.testing.assert_allclose((q - truth + np.pi) % (2 * np.pi) - np.pi, 0.0, atol=5e-3)
    # blur makes half of every edge pixel a mismatch, on links of 5 px
    assert left < 0.4


@pytest.mark.parametrize("wrong", [1.0, 0.1, 40.0])
def test_a_scene_is_found_from_the_topology_at_any_scale_and_proportion(wrong: float) -> None:
    mechanism = load("single")
    poses = np.array([[-2.2], [-1.4], [-0.6], [0.1]])
    frames = drawn_frames(mechanism, SMALL, poses)
    thick = mechanism.with_values({"link1.length": 0.2 * wrong, "link1.width": 0.1 * wrong})
    start = SceneStart(thick, Camera(160, 120, 150.0, depth=1.0), frozenset())
    best = search_scene(frames, start, 4)[0]
    # blur makes half of every edge pixel a mismatch, on a link of 5 px
    assert best.score < 0.4
    # in units of the distance from the camera; 2 px of 33
    assert best.mechanism.values["link1.length"] == pytest.approx(0.2 / SMALL.depth, rel=0.06)
    root = SMALL.x / SMALL.depth, SMALL.y / SMALL.depth
    np.testing.assert_allclose((best.camera.x, best.camera.y), root, atol=2.0 / SMALL.focal)
    np.testing.assert_allclose(best.positions[:, 0], poses[frames.most_distinct(4), 0], atol=0.05)


def test_the_score_is_that_of_the_better_frames() -> None:
    guess = SceneGuess(load("single"), SMALL, np.zeros((4, 1)), np.array([0.1, 0.9, 0.2, 0.3]))
    assert np.isclose(guess.score, 0.2)


def test_key_frames_are_ordered_by_what_they_add() -> None:
    mechanism = load("single")
    frames = drawn_frames(mechanism, SMALL, np.array([[-0.5], [-0.48], [1.2], [-0.52]]))
    order = frames.most_distinct(4)
    assert sorted(order) == [0, 1, 2, 3]
    assert 2 in order[:2]
    assert [frame.index for frame in frames.only(order[:2]).frames] == order[:2]
