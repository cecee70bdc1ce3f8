"""The beam search: which partial poses go on, and where a slide is tried."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from models import read
from monodyn.mechanism import load
from monodyn.mechanism.tree import HINGE
from monodyn.types import FULL, Camera
from monodyn.vision.drawing.camera import from_origin
from monodyn.vision.drawing.mismatch import pose_balance, row_balance
from monodyn.vision.drawing.rig import joint_limits, rig_of
from monodyn.vision.locating.beam import BEYOND, Beam, best_peaks, extended, slide_places
from monodyn.vision.locating.keyframes import KeyFrame
from pictures import drawn_mask

CAMERA = Camera(160, 120, 150.0, x=0.05, y=-0.1, depth=0.9)


def frame_of(planes: np.ndarray) -> KeyFrame:
    return KeyFrame(0, 0.0, planes, planes[0], float(planes.sum()) / FULL)


def test_minima_of_a_table_are_kept_once_and_around_a_turn() -> None:
    costs = np.array([[3.0, 1.0, 1.0, 2.0, 0.5]])
    assert best_peaks(costs, circular=True, count=9).tolist() == [4, 2]
    assert best_peaks(costs, circular=True, count=1).tolist() == [4]
    rising = np.array([[0.0, 1.0, 2.0]])
    assert best_peaks(rising, circular=False, count=9).tolist() == [0]
    assert best_peaks(np.ones((1, 3)), circular=True, count=9).tolist() == [0]


def test_the_best_partial_pose_is_the_drawn_one() -> None:
    mechanism = load("double")
    truth = np.array([-0.9, 1.3])
    frame = frame_of(drawn_mask(mechanism, CAMERA, truth))
    poses, costs = extended(frame, rig_of(mechanism, CAMERA), mechanism, 0, np.zeros((1, 2)), Beam(4, 72, 8))
    assert len(poses) == len(costs) <= 4
    # half of the 5 degrees between two tried positions
    assert abs(poses[0, 0] - truth[0]) < 0.05
    assert costs[0] == costs.min() < 0.0


def test_a_slide_is_tried_where_the_foreground_is() -> None:
    mechanism = load("cartpole")
    frame = frame_of(drawn_mask(mechanism, CAMERA, np.array([0.04, -1.5])))
    columns = np.nonzero((frame.coarse > 0.5 * FULL).any(axis=0))[0]
    places = slide_places(frame, rig_of(mechanism, CAMERA), 0, 5)
    seen = (columns[[0, -1]] - 79.5) * 0.9 / 150.0 + CAMERA.x
    rows = np.nonzero((frame.coarse > 0.5 * FULL).any(axis=1))[0]
    half = 0.5 * np.hypot(np.ptp(columns), np.ptp(rows)) * 0.9 / 150.0
    np.testing.assert_allclose(places[[0, -1]], seen + BEYOND * half * np.array([-1.0, 1.0]), atol=1e-12)
    assert places[0] < 0.04 < places[-1]


def test_a_slide_is_tried_where_the_foreground_is_before_a_turned_camera() -> None:
    """The camera's place, told far aside, is not where the foreground is."""
    mechanism = load("cartpole")
    camera = from_origin(replace(CAMERA, yaw=0.5))
    frame = frame_of(drawn_mask(mechanism, camera, np.array([0.04, -1.5])))
    places = slide_places(frame, rig_of(mechanism, camera), 0, 5)
    assert abs(camera.x) > 0.3
    assert places[0] < 0.04 < places[-1]
    assert np.ptp(places) < 0.5


def test_poses_are_improved_between_the_tried_positions() -> None:
    mechanism = load("double")
    rig = rig_of(mechanism, CAMERA)
    truth = np.array([-0.93, 1.36])
    frame = frame_of(drawn_mask(mechanism, CAMERA, truth))
    beam = Beam(4, 36, 8)
    poses = np.zeros((1, 2))
    for link in range(2):
        poses, costs = extended(frame, rig, mechanism, link, poses, beam)
    best = poses[int(np.argmin(costs))]
    # a third of half the 10 degrees between two tried positions
    assert np.abs(best - truth).max() < np.radians(10.0) / 6 + 0.02
    np.testing.assert_allclose(costs, pose_balance(row_balance(frame.coarse), rig, poses, 2), rtol=1e-9)


@pytest.mark.parametrize("model", ["double", "cartpole"])
def test_a_step_is_that_of_a_slow_twin(model: str) -> None:
    """Each position of a joint on its own, minima by comparing neighbours, the nine places around them."""
    mechanism = load(model)
    rig, (lower, upper) = rig_of(mechanism, CAMERA), joint_limits(mechanism)
    truth = np.array([-0.93, 1.36] if model == "double" else [0.04, -1.5])
    frame = frame_of(drawn_mask(mechanism, CAMERA, truth))
    poses, beam = np.zeros((1, 2)), Beam(5, 30, 12)
    for link in range(2):
        hinge = rig.kind[link] == HINGE
        turns = np.arange(30) * 2.0 * np.pi / 30 - np.pi
        values = turns if hinge else slide_places(frame, rig, link, 12)
        geoms = int(np.sum(rig.link <= link))

        def cost(pose: np.ndarray, geoms: int = geoms) -> float:
            return float(pose_balance(frame.balance, rig, pose[np.newaxis], geoms)[0])

        table = {}
        for i, pose in enumerate(poses):
            for j, value in enumerate(values):
                table[i, j] = cost(np.where(np.arange(2) == link, value, pose))
        last = len(values) - 1
        minima = []
        for (i, j), own in table.items():
            before = table[i, j - 1 if j else last] if j or hinge else np.inf
            after = table[i, j + 1 if j < last else 0] if j < last or hinge else np.inf
            if own <= before and own < after:
                minima.append((own, i, j))
        step, wanted = (values[1] - values[0]) / 3.0, []
        for own, i, j in sorted(minima)[:5]:
            at = np.where(np.arange(2) == link, values[j], poses[i])
            best = own, at
            moves = (0.0, -step, step)
            with_parent = link == 1 and rig.kind[0] == rig.kind[1]
            for of_parent in moves if with_parent else (0.0,):
                for of_joint in moves:
                    moved = at + np.array([of_parent, of_joint] if link == 1 else [of_joint, 0.0])
                    moved = np.clip(moved, lower, upper)
                    best = min(best, (cost(moved), moved), key=lambda one: one[0])
            wanted.append(best)
        poses, costs = extended(frame, rig, mechanism, link, poses, beam)
        np.testing.assert_allclose(costs, [one for one, _ in wanted], rtol=1e-9)
        np.testing.assert_allclose(poses, [pose for _, pose in wanted], atol=1e-12)


def test_improved_poses_stay_within_the_limits(tmp_path: Path) -> None:
    text = """<mujoco><worldbody><body name="a"><joint name="j" axis="0 -1 0" limited="true" range="-60 -34"/>
<geom type="capsule" size="0.01" fromto="0 0 0 0.2 0 0"/></body></worldbody></mujoco>"""
    mechanism = read(tmp_path, text)
    # drawn beyond the limit: the best pose is at it
    frame = frame_of(drawn_mask(mechanism, CAMERA, np.radians([-32.0])))
    poses, _ = extended(frame, rig_of(mechanism, CAMERA), mechanism, 0, np.zeros((1, 1)), Beam(4, 72, 8))
    assert poses.max() <= np.radians(-34.0) + 1e-12
    assert poses[0, 0] == pytest.approx(np.radians(-34.0))
