"""The strip along the clip: bars where joints were seen, scores of the judged frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.results import strip as strips
from monodyn.results.sheet import BLUE, GREEN, MARGIN, ORANGE, RED, WIDTH
from monodyn.results.sight import Sight
from monodyn.types import Poses
from monodyn.vision.clip.video import read
from monodyn.vision.locating.scene import Scene
from support import ClipMaker


def test_bars_are_filled_where_the_joints_were_seen(filmed: tuple[Scene, Poses]) -> None:
    scene, poses = filmed
    half = replace(poses, seen=np.arange(len(poses)) < 10)
    page = strips.strip(
        Sight(scene.masks.video, scene.masks, scene, half, fit_frames=(0, 20), free_frames=(5, 20))
    )
    assert page.shape[1] == WIDTH
    left, right = MARGIN + strips.LABELS, WIDTH - MARGIN
    columns = left + np.array([0.1, 0.2, 0.45, 0.9]) * (right - left)
    free, fitted, first, second = (page[30 + k * (strips.BAR + 6) + 8] for k in range(4))
    assert [tuple(free[round(x)]) == GREEN for x in columns] == [False, True, True, False]
    assert [tuple(fitted[round(x)]) == ORANGE for x in columns] == [True, True, True, False]
    for bar in (first, second):
        assert [tuple(bar[round(x)]) == BLUE for x in columns] == [True, True, False, False]
        assert (bar[left + 400 : right] == RED).all(axis=1).mean() == pytest.approx(2 / 7, abs=0.02)


def test_runs_end_at_gaps() -> None:
    assert strips._runs(np.array([3, 4, 5, 9, 11, 12])) == [(3, 6), (9, 10), (11, 13)]
    assert strips._runs(np.array([], int)) == []


def test_steps_of_the_axis_are_round() -> None:
    assert [strips._round_step(x) for x in (0.3, 1.2, 24.0, 30.0, 80.0)] == [1, 2, 50, 50, 100]


def test_without_poses_that_is_said(make_clip: ClipMaker) -> None:
    page = strips.strip(Sight(read(make_clip())))
    assert page.shape[1] == WIDTH
    assert (page == RED).all(axis=2).sum() == 0
