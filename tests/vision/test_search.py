"""The global search on reduced key frames of drawn masks."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.mechanism import load
from monodyn.types import Camera
from monodyn.vision.drawing.mismatch import pose_balance
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.locating.grow import SceneStart
from monodyn.vision.locating.search import (
    WHOLE_POSES,
    WORTH,
    SceneGuess,
    _beam,
    as_thick,
    search_pose,
    search_scene,
    thinned,
)
from monodyn.vision.locating.thin import lacking
from pictures import drawn_frames
from support import refuses, slow

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


def test_a_slide_of_which_nothing_shows_is_refused() -> None:
    mechanism = load("cartpole")
    empty = drawn_frames(mechanism, SMALL, np.array([[9.0, 0.0], [9.0, 0.1]]))
    with refuses(
        VideoError,
        "the clip: expected foreground along which the first joint slides, got hardly any in the key frames; "
        "a lower --segment.contrast, or --background with a picture without the mechanism, may show it.",
    ):
        search_scene(empty, SceneStart(mechanism, SMALL, frozenset()))


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


@pytest.mark.slow
@pytest.mark.parametrize(("thicker", "score"), [(0, 0.5), slow(1, 0.41), slow(2, 0.35)])
def test_rods_thinner_than_the_steps_of_the_search_are_found(thicker: int, score: float) -> None:
    """Rods of little more than a pixel, half covered at most: as they are, the score sees nothing of them.
    Their levels are evened, and for the thinnest rods everything is made thicker."""
    start = load("double")
    sizes = {name: 0.0 for name in start.values if name.endswith((".tail", ".tip"))}
    sizes |= {f"link{i}.{kind}": 0.008 for i in (1, 2) for kind in ("width", "thickness")}
    mechanism = start.with_values({**sizes, "link1.length": 0.24, "link2.length": 0.17})
    poses = np.array([[-2.2, 0.9], [-1.4, -0.7], [-0.6, 0.4], [-1.0, 1.2], [-2.0, -0.5], [-1.6, 0.2]])
    frames = drawn_frames(mechanism, SMALL, poses)
    begin = SceneStart(start, Camera(160, 120, 150.0, depth=1.0), frozenset())
    assert search_scene(frames, begin, len(poses))[0].score > 0.95
    assert lacking([frame.coarse for frame in frames.frames]) == 0
    thick = frames.thickened(thicker)
    best = search_scene(thick, begin, len(poses))[0]
    assert best.score < score
    found, px = best.mechanism.values, best.camera.focal / best.camera.depth
    # a step of the grid of lengths is a fifth
    assert found["link1.length"] * px == pytest.approx(40.0, rel=0.2)
    assert found["link2.length"] * px == pytest.approx(28.3, rel=0.2)
    # widths are those of the rods, and not of what they are searched for in
    assert max(found["link1.width"], found["link2.width"]) * px < 3.5
    away = best.positions - poses[thick.most_distinct(len(poses))]
    assert np.mean(np.abs((away + np.pi) % (2 * np.pi) - np.pi) < 0.3) > 0.9


def test_a_mechanism_is_drawn_as_thick_as_its_masks_are() -> None:
    mechanism = load("double")
    frames = drawn_frames(mechanism, SMALL, np.array([[-0.5, 0.3]]))
    assert as_thick(frames, mechanism, SMALL) is mechanism
    thick = frames.thickened(2)
    wider = as_thick(thick, mechanism, SMALL).values["link1.width"] - mechanism.values["link1.width"]
    assert wider == pytest.approx(4.0 * SMALL.depth / SMALL.focal)
    back = thinned(thick, as_thick(thick, mechanism, SMALL), SMALL)
    assert back.values == pytest.approx(mechanism.values)


def test_poses_that_explain_much_less_than_the_best_are_not_polished() -> None:
    mechanism = load("single")
    camera = Camera(160, 120, 150.0, depth=0.9)
    rig = rig_of(mechanism, camera)
    frames = drawn_frames(mechanism, camera, np.array([[-0.9]]))
    poses = _beam(frames.frames[0], rig, mechanism)
    costs = pose_balance(frames.frames[0].balance, rig, poses, len(rig.radius))
    assert len(poses) < WHOLE_POSES
    assert costs.max() <= WORTH * costs.min() < 0.0
