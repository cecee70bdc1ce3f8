"""Where the root is, told by what keeps its distance from it in drawn masks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from models import read
from monodyn.mechanism import load
from monodyn.types import FULL, Camera
from monodyn.vision.foreground.masks import plain_view
from monodyn.vision.locating.keyframes import KeyFrame, KeyFrames
from monodyn.vision.locating.roots import root_lines, root_points
from pictures import drawn_frames, root_in

BALL = """<mujoco><worldbody><body name="link1"><joint name="joint1" axis="0 -1 0"/>
<geom type="sphere" size="0.02" pos="0.5 0 0"/></body></worldbody></mujoco>"""
"""A ball whose thread nobody sees."""


def test_a_ball_that_hangs_from_above_the_picture(tmp_path: Path) -> None:
    camera = Camera(160, 120, 150.0, x=0.02, y=-0.5, depth=0.9)
    poses = np.linspace(-np.pi / 2 - 0.5, -np.pi / 2 + 0.4, 7)[:, None]
    root = root_points(drawn_frames(read(tmp_path, BALL), camera, poses))[0]
    truth = root_in(camera)
    assert truth[1] < -20.0
    # a thread of 83 px, a ball of 7
    assert np.hypot(*(truth - root[:2])) < 6.0
    assert root.reach == pytest.approx((0.5 + 0.02) * 150.0 / 0.9, abs=4.0)


def test_the_hinge_of_a_chain() -> None:
    camera = Camera(160, 120, 150.0, x=0.05, y=-0.1, depth=0.9)
    rng = np.random.default_rng(3)
    poses = np.column_stack([rng.uniform(-2.5, -0.5, 7), rng.uniform(-2.0, 2.0, 7)])
    roots = root_points(drawn_frames(load("double"), camera, poses))
    away = [np.hypot(*(root_in(camera) - root[:2])) for root in roots]
    assert away[0] < 6.0
    assert min(away) < 3.0


@pytest.mark.parametrize("upright", [False, True])
def test_the_line_of_a_cart(upright: bool) -> None:
    camera = Camera(160, 120, 150.0, x=0.0, y=-0.1, depth=0.9)
    rng = np.random.default_rng(4)
    poses = np.column_stack([rng.uniform(-0.2, 0.2, 7), rng.uniform(-2.5, -0.5, 7)])
    frames = drawn_frames(load("cartpole"), camera, poses)
    place = root_in(camera)[1]
    if upright:
        turned = [
            KeyFrame(f.index, f.time, f.planes, coarse, f.area)
            for f in frames.frames
            for coarse in (np.ascontiguousarray(f.coarse.T),)
        ]
        frames = KeyFrames(tuple(turned), 1, frames.view, *[np.ascontiguousarray(frames.coarse_trust.T)] * 2)
    places = [root.x if upright else root.y for root in root_lines(frames, upright=upright)]
    assert all(np.isnan(root.y if upright else root.x) for root in root_lines(frames, upright=upright))
    assert min(abs(p - place) for p in places) < 2.0


def test_no_foreground_has_no_line() -> None:
    mechanism, camera = load("cartpole"), Camera(160, 120, 150.0)
    empty = drawn_frames(mechanism, camera, np.array([[9.0, 0.0], [9.0, 0.1]]))
    assert root_lines(empty) == []


@pytest.mark.parametrize("upright", [False, True])
def test_a_cart_before_its_own_picture_shows_how_long_it_is(upright: bool) -> None:
    # The background shows the cart where it always is: its ends alone stand out from it, by turns.
    frames = []
    for left in (20, 23, 26):
        coarse = np.zeros((60, 120), np.uint8)
        coarse[30:42, left : left + 50] = FULL
        frames.append(coarse)
    trust = np.ones((60, 120), np.float32)
    trust[30:42, 26:70] = 0.0
    if upright:
        frames, trust = [np.ascontiguousarray(f.T) for f in frames], np.ascontiguousarray(trust.T)
    view = plain_view(trust, 1)
    keys = KeyFrames(
        tuple(KeyFrame(i, 0.1 * i, f[None], f, float(f.sum()) / FULL) for i, f in enumerate(frames)),
        2,
        view,
        trust,
        trust,
    )
    root = min(root_lines(keys, upright=upright), key=lambda r: abs((r.x if upright else r.y) - 71.0))
    # twice as long in the picture as in the reduced one; at most what the ends of its way add
    np.testing.assert_allclose(root.extents, [100.0, 100.0, 100.0], atol=0.1)
