"""The poses in all samples, those that were known before among them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.types import FULL, Camera
from monodyn.vision.drawing.outline import outline
from monodyn.vision.locating import everywhere
from monodyn.vision.locating.bundle import Bundle
from monodyn.vision.locating.everywhere import poses_everywhere
from monodyn.vision.locating.keyframes import KeyFrames
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.variables import scene_variables
from pictures import drawn_frames

SMALL = Camera(160, 120, 150.0, x=0.05, y=-0.1, depth=0.9)
TRUTH = np.array([[-2.2, 0.4], [-1.4, 1.1], [-0.6, -0.9], [0.1, 2.0], [-1.0, -2.0]])


def refined(matched: float, inside: float) -> Bundle:
    """Return a double pendulum of whose outline shares are on an edge and on the mask in all key frames."""
    mechanism, one = load("double"), np.ones(3)
    variables = scene_variables(mechanism, ["camera.x"])
    return Bundle(mechanism, SMALL, TRUTH[:3], variables, np.eye(1), 0.0 * one, matched * one, inside * one)


@pytest.fixture
def looked_for(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the frames that are looked for without a pose to start from."""
    rows: list[int] = []
    search = everywhere.search_poses

    def noted(frames: KeyFrames, *given: object) -> SceneGuess:
        rows.extend(frame.index for frame in frames.frames)
        return search(frames, *given)  # type: ignore[arg-type]

    monkeypatch.setattr(everywhere, "search_poses", noted)
    return rows


def test_known_poses_are_followed_and_a_wrong_one_is_looked_for(looked_for: list[int]) -> None:
    frames = drawn_frames(load("double"), SMALL, TRUTH)
    known = TRUTH + np.random.default_rng(0).normal(scale=0.03, size=TRUTH.shape)
    known[3] += [0.7, -1.5]
    found, lies = poses_everywhere(frames, refined(0.9, 0.9), known)
    assert looked_for == [3]
    assert lies.all()
    # a few hundredths of a pixel on links of 40 px
    np.testing.assert_allclose((found - TRUTH + np.pi) % (2 * np.pi) - np.pi, 0.0, atol=5e-3)


def test_a_link_that_is_folded_over_another_one_is_looked_for(looked_for: list[int]) -> None:
    """Its outline lies on the mask, and the link that it should be on sticks out."""
    frames, known = drawn_frames(load("double"), SMALL, TRUTH), TRUTH.copy()
    known[1, 1] = np.pi - 0.02
    found, lies = poses_everywhere(frames, refined(0.9, 0.9), known)
    assert looked_for == [1]
    assert lies.all()
    np.testing.assert_allclose((found - TRUTH + np.pi) % (2 * np.pi) - np.pi, 0.0, atol=5e-3)


@pytest.mark.parametrize(
    ("known", "matched", "inside"), [(None, 0.9, 0.9), (TRUTH, 1.2, 0.5), (TRUTH, 0.5, 1.2)]
)
def test_all_are_looked_for_where_none_is_known_or_the_refined_ones_lie_better(
    looked_for: list[int], known: np.ndarray | None, matched: float, inside: float
) -> None:
    """Poses cannot lie as well as refined ones of which all, and more than all, is on an edge."""
    frames = drawn_frames(load("double"), SMALL, TRUTH)
    found, lies = poses_everywhere(frames, refined(matched, inside), known)
    assert looked_for == list(range(len(TRUTH)))
    assert lies.all()
    np.testing.assert_allclose((found - TRUTH + np.pi) % (2 * np.pi) - np.pi, 0.0, atol=5e-3)


def test_a_known_pose_lies_nowhere_where_refined_ones_do_not_either(looked_for: list[int]) -> None:
    """Nothing is as bad as a mask without a mechanism, and no measure for a pose that was known."""
    frames = drawn_frames(load("double"), SMALL, TRUTH)
    empty = replace(frames.frames[1], planes=np.zeros_like(frames.frames[1].planes))
    frames = replace(frames, frames=(frames.frames[0], empty, *frames.frames[2:]))
    _, lies = poses_everywhere(frames, refined(0.0, 0.0), TRUTH)
    assert looked_for == [1]
    assert lies.tolist() == [True, False, True, True, True]


def test_a_known_pose_within_a_blot_is_looked_for_where_refined_ones_lie_no_better(
    looked_for: list[int],
) -> None:
    """All of it is on the mask, and less than half of its outline on an edge."""
    mechanism = load("double")
    frames = drawn_frames(mechanism, SMALL, TRUTH[:1])
    x, y = dict(outline(mechanism, SMALL, TRUTH[0]))["link2"].mean(axis=0)
    rows, columns = np.mgrid[:120, :160]
    planes = np.where(np.hypot(columns - x, rows - y) < 22.0, np.uint8(FULL), frames.frames[0].planes)
    frames = replace(frames, frames=(replace(frames.frames[0], planes=planes, coarse=planes[0]),))
    _, lies = poses_everywhere(frames, refined(0.2, 0.2), TRUTH[:1])
    assert looked_for == [0]
    assert not lies.any()
