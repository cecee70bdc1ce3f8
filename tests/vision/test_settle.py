"""Sizes and turns improved one by one on drawn masks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.types import Camera
from monodyn.vision.locating.grow import SceneStart, Structure
from monodyn.vision.locating.settle import frames_cost, settled
from pictures import drawn_frames

CAMERA = Camera(160, 120, 150.0, x=0.05, y=-0.1, depth=0.9)
POSES = np.array([[-2.2], [-1.4], [-0.6], [0.1]])
NONE: frozenset[str] = frozenset()


def test_a_turn_is_found_and_a_held_one_stays(tmp_path: Path) -> None:
    (tmp_path / "flag.xml").write_text(
        '<mujoco><compiler angle="radian"/><worldbody><body name="a"><joint name="j" axis="0 -1 0"/>'
        '<geom type="box" size=".12 .003 .015" pos=".12 0 0"/><geom name="flag" type="box" '
        'size=".06 .003 .02" pos=".15 0 .06" euler="0 -0.7 0"/></body></worldbody></mujoco>'
    )
    true = load(tmp_path / "flag.xml")
    start = true.with_values({"a.flag.turn": 0.4, "a.flag.width": 0.05})
    frames = drawn_frames(true, CAMERA, POSES)
    begun = Structure(start, CAMERA, 0, (), None, tuple(q[np.newaxis] for q in POSES), (), ())
    found = settled(frames, begun, SceneStart(start, CAMERA, NONE)).mechanism
    # within a step
    assert found.values["a.flag.turn"] == pytest.approx(0.7, abs=0.06)
    # blurred edges leave some of it to the true sizes too
    assert frames_cost(frames, found, CAMERA, POSES) < frames_cost(frames, true, CAMERA, POSES) + 0.02
    held = settled(frames, begun, SceneStart(start, CAMERA, frozenset({"a.flag.turn"}))).mechanism
    assert held.values["a.flag.turn"] == 0.4
