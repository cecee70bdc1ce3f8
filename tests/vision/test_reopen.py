"""Geoms without a size on masks that are drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from models import with_discs
from monodyn.mechanism import Mechanism
from monodyn.types import Camera
from monodyn.vision.locating.arrange import resettled
from monodyn.vision.locating.grow import SceneStart
from monodyn.vision.locating.reopen import reopened
from monodyn.vision.locating.search import SceneGuess
from pictures import drawn_frames

CAMERA = Camera(200, 160, 150.0, x=0.0, y=0.02, depth=0.75)
POSES = np.array([[0.1, 0.9], [-0.6, 0.4], [0.7, -0.8], [1.3, 0.3], [-1.2, -0.5], [2.1, 0.6]])


def guessed(mechanism: Mechanism) -> SceneGuess:
    return SceneGuess(mechanism, CAMERA, POSES, np.zeros(len(POSES)))


def test_a_disc_inside_of_its_bar_is_opened(tmp_path: Path) -> None:
    true = with_discs(tmp_path, 0.0125)
    frames, start = drawn_frames(true, CAMERA, POSES), SceneStart(true, CAMERA, frozenset())
    guess = guessed(true.with_values({"link1.width": 0.035, "link1.elbow.width": 0.005}))
    # steps of single sizes leave it there: it is inside of the bar until it is seven times as wide
    assert resettled(frames, guess, start).mechanism.values["link1.elbow.width"] < 0.03
    found = reopened(frames, guess, start).mechanism.values
    # a pixel is 5 mm
    assert found["link1.elbow.width"] == pytest.approx(0.06, abs=0.006)
    assert found["link1.width"] == pytest.approx(0.025, abs=0.006)


def test_sizes_that_explain_the_masks_stay(tmp_path: Path) -> None:
    true = with_discs(tmp_path, 0.0125)
    guess = guessed(true)
    assert reopened(drawn_frames(true, CAMERA, POSES), guess, SceneStart(true, CAMERA, frozenset())) is guess


def test_what_is_held_keeps_its_size(tmp_path: Path) -> None:
    true = with_discs(tmp_path, 0.0125)
    held = frozenset({"link2.tip.width"})
    guess = guessed(true.with_values({"link1.elbow.width": 0.005, "link2.tip.width": 0.05}))
    frames = drawn_frames(true, CAMERA, POSES).thickened(2)
    found = reopened(frames, guess, SceneStart(true, CAMERA, held)).mechanism.values
    assert found["link1.elbow.width"] > 0.05
    assert found["link2.tip.width"] == 0.05


def test_in_thicker_masks_sizes_come_out_as_thick_as_they_are(tmp_path: Path) -> None:
    true = with_discs(tmp_path, 0.0125)
    frames = drawn_frames(true, CAMERA, POSES).thickened(2)
    guess = guessed(true.with_values({"link1.width": 0.035, "link1.elbow.width": 0.005}))
    found = reopened(frames, guess, SceneStart(true, CAMERA, frozenset())).mechanism.values
    assert found["link1.elbow.width"] == pytest.approx(0.06, abs=0.008)
