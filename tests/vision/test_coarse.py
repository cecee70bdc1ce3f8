"""Guesses refined on reduced masks that are drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from models import with_discs
from monodyn.types import Camera
from monodyn.vision.locating.coarse import reconsidered, variables_of
from monodyn.vision.locating.grow import SceneStart
from monodyn.vision.locating.search import SceneGuess
from pictures import drawn_frames

CAMERA = Camera(200, 160, 150.0, x=0.0, y=0.02, depth=0.75)
POSES = np.array([[0.1, 0.9], [-0.6, 0.4], [0.7, -0.8], [1.3, 0.3], [-1.2, -0.5], [2.1, 0.6]])
NAMES = ["link1.length", "link1.elbow.width", "link2.length", "link2.tip.width"]


def test_a_hinge_in_the_wrong_place_is_mended_on_better_masks(tmp_path: Path) -> None:
    true = with_discs(tmp_path, 0.008)
    wrong = true.with_values({"link1.length": 0.145, "link1.elbow.width": 0.04, "link2.length": 0.125})
    guess = SceneGuess(wrong, CAMERA, POSES, np.zeros(len(POSES)))
    frames = drawn_frames(true, CAMERA, POSES)
    start = SceneStart(wrong, CAMERA, frozenset())
    better = reconsidered(frames, guess, variables_of(guess, start, NAMES), start)
    assert better is not guess
    # a pixel is 5 mm
    for name in NAMES:
        assert better.mechanism.values[name] == pytest.approx(true.values[name], abs=0.004)


def test_a_guess_that_explains_its_masks_stays_as_it_is(tmp_path: Path) -> None:
    true = with_discs(tmp_path, 0.008)
    guess = SceneGuess(true, CAMERA, POSES, np.zeros(len(POSES)))
    start = SceneStart(true, CAMERA, frozenset())
    variables = variables_of(guess, start, NAMES)
    assert reconsidered(drawn_frames(true, CAMERA, POSES), guess, variables, start) is guess


def test_a_disc_without_a_size_is_found_on_better_masks(tmp_path: Path) -> None:
    true = with_discs(tmp_path, 0.008)
    closed = true.with_values({"link1.width": 0.03, "link1.elbow.width": 0.005, "link1.length": 0.15})
    guess = SceneGuess(closed, CAMERA, POSES, np.zeros(len(POSES)))
    start, names = SceneStart(closed, CAMERA, frozenset()), [*NAMES, "link1.width"]
    frames = drawn_frames(true, CAMERA, POSES)
    found = reconsidered(frames, guess, variables_of(guess, start, names), start).mechanism.values
    for name in names:
        assert found[name] == pytest.approx(true.values[name], abs=0.004)


def test_lengths_are_held_to_those_of_the_guess(tmp_path: Path) -> None:
    file = with_discs(tmp_path, 0.008)
    grown = file.with_values({"link1.length": 0.32, "link2.length": 0.22, "link1.elbow.width": 0.02})
    variables = variables_of(
        SceneGuess(grown, CAMERA, POSES, np.zeros(len(POSES))), SceneStart(file, CAMERA, frozenset()), NAMES
    )
    assert variables.names == tuple(NAMES)
    assert variables.start["link1.length"] == 0.32
    # in proportion to the lengths, as in the file
    assert variables.start["link1.elbow.width"] == pytest.approx(2.0 * 0.06)
