"""The global search on reduced key frames of drawn masks."""

from __future__ import annotations

import numpy as np

from monodyn.mechanism import Mechanism, load
from monodyn.types import FULL, Camera
from monodyn.vision.drawing.mismatch import row_sums
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.locating.keyframes import KeyFrame, KeyFrames
from monodyn.vision.locating.search import (
    SceneGuess,
    SceneStart,
    _best_peaks,
    search_pose,
    search_scene,
)
from pictures import drawn_mask, trusted

SMALL = Camera(160, 120, 150.0, x=0.05, y=-0.1, depth=0.9)


def drawn_frames(mechanism: Mechanism, poses: np.ndarray) -> KeyFrames:
    """Draw key frames that are not reduced."""
    frames = []
    for i, q in enumerate(poses):
        planes = drawn_mask(mechanism, SMALL, q)
        area = float(planes.sum()) / FULL
        frames.append(KeyFrame(i, i / 30, planes, planes[0], row_sums(planes[0]), area))
    view = trusted(mechanism, SMALL)
    return KeyFrames(tuple(frames), 1, view, view.trust[0])


def test_a_pose_is_found_from_the_mask_alone() -> None:
    mechanism = load("double")
    truth = np.array([-0.9, 1.3])
    frames = drawn_frames(mechanism, truth[None])
    q, left = search_pose(frames.frames[0], frames, rig_of(mechanism, SMALL), mechanism)
    # a few hundredths of a pixel on links of 40 px
    np.testing.assert_allclose((q - truth + np.pi) % (2 * np.pi) - np.pi, 0.0, atol=5e-3)
    # blur makes half of every edge pixel a mismatch, on links of 5 px
    assert left < 0.4


def test_a_scene_is_found_from_the_topology() -> None:
    mechanism = load("single")
    poses = np.array([[-2.2], [-1.4], [-0.6], [0.1]])
    frames = drawn_frames(mechanism, poses)
    start = SceneStart(mechanism, Camera(160, 120, 150.0), frozenset())
    best = search_scene(frames, start, 4)[0]
    assert best.score < 0.45
    # the link's end is on it in every frame, up to the root's unknown place along it
    assert 0.7 < best.camera.depth / SMALL.depth < 1.4


def test_minima_of_a_table_are_kept_once_and_around_a_turn() -> None:
    costs = np.array([[3.0, 1.0, 1.0, 2.0, 0.5]])
    assert _best_peaks(costs, circular=True).tolist() == [4, 2]
    rising = np.array([[0.0, 1.0, 2.0]])
    assert _best_peaks(rising, circular=False).tolist() == [0]
    assert _best_peaks(np.ones((1, 3)), circular=True).tolist() == [0]


def test_the_score_is_that_of_the_better_frames() -> None:
    guess = SceneGuess(load("single"), SMALL, np.zeros((4, 1)), np.array([0.1, 0.9, 0.2, 0.3]))
    assert np.isclose(guess.score, 0.2)


def test_key_frames_are_ordered_by_what_they_add() -> None:
    mechanism = load("single")
    frames = drawn_frames(mechanism, np.array([[-0.5], [-0.48], [1.2], [-0.52]]))
    order = frames.most_distinct(4)
    assert sorted(order) == [0, 1, 2, 3]
    assert 2 in order[:2]
    assert [frame.index for frame in frames.only(order[:2]).frames] == order[:2]
