"""What a located mechanism says of itself, and which parameters the pictures determine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from films import film
from monodyn.mechanism import load
from monodyn.vision.locating.advice import scene_advice
from monodyn.vision.locating.bundle import Bundle
from monodyn.vision.locating.knowledge import hidden_advice
from monodyn.vision.locating.locate import (
    Sought,
    _alike,
    _with_background,
    refined_names,
)
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.variables import scene_variables
from monodyn.vision.settings import LocateSettings
from pictures import CAMERA


def bundle(matched: float = 1.0, inside: float = 1.0) -> Bundle:
    mechanism = load("single")
    variables = scene_variables(mechanism, ["camera.x"])
    frames = np.ones(4)
    return Bundle(
        mechanism, CAMERA, np.zeros((4, 1)), variables, np.eye(1), 0.1 * frames, matched * frames,
        inside * frames,
    )  # fmt: skip


def test_a_good_scene_has_no_advice() -> None:
    assert scene_advice(bundle(), {"camera.x": 1.0, "camera.yaw": 0.05}, 0.1, varied=False) == []


def test_a_scene_that_fits_in_few_frames() -> None:
    assert scene_advice(bundle(matched=0.3), {}, 0.1, varied=False) == [
        "The mechanism lies on its mask in only 0% of the key frames: look in diagnosis.png whether the "
        "outline is in the right place and what else moves (--roi and --time-range leave that out), and "
        "check the mechanism file."
    ]


@pytest.mark.parametrize(
    ("std", "names"),
    [
        ({"camera.focal": 70.0}, "camera.focal"),
        ({"camera.yaw": 0.2, "camera.pitch": 0.3}, "camera.yaw, camera.pitch"),
    ],
)
def test_a_camera_that_the_clip_does_not_determine(std: Mapping[str, float], names: str) -> None:
    assert scene_advice(bundle(), std, 0.1, varied=False) == [
        f"The clip hardly determines {names}: leave out --free, or give the value with --fix."
    ]


def test_foreground_that_is_not_the_mechanism() -> None:
    assert scene_advice(bundle(), {}, 0.5, varied=False) == [
        "50% of what stands out from the background is not the mechanism as it was found: it may be in the "
        "wrong place or of the wrong size, or other things move; look at diagnosis.png. --roi and "
        "--time-range leave other things out; where the background shows parts of the mechanism, give "
        "--background a picture without it."
    ]
    assert scene_advice(bundle(), {}, 0.5, varied=True) == []


def test_what_hides_inside_of_another_geom_is_named() -> None:
    assert hidden_advice([]) == []
    assert hidden_advice(["a.peg.across", "a.arm.along"]) == [
        "An end that lies inside of another geom cannot be seen: a.peg.across, a.arm.along and the extent in "
        "that direction are known to half the width of what hides it. Give a measured value with --fix where "
        "that counts."
    ]


def sought(name: str, fix: Mapping[str, float], free: tuple[str, ...]) -> Sought:
    masks = None  # the names do not depend on the pictures
    return Sought(masks, load(name), LocateSettings(), fix, free, lambda *_: None)  # type: ignore[arg-type]


def test_what_is_fixed_is_not_refined_and_what_is_freed_is() -> None:
    names = refined_names(sought("double", {"camera.depth": 1.0, "camera.pitch": 0.1}, ("camera.yaw",)))
    assert [n for n in names if n.startswith("camera")] == ["camera.x", "camera.y"]
    assert "link1.length" in names
    # how far the sides of the bodies show
    assert "link1.thickness" in names
    assert "link1.density" not in names


def test_a_sliding_root_takes_the_cameras_place_along_it() -> None:
    names = refined_names(sought("cartpole", {}, ()))
    assert [n for n in names if n.startswith("camera")] == ["camera.y", "camera.depth"]


@pytest.mark.parametrize("fits", [False, True])
def test_a_background_is_taken_again_only_where_frames_fit(tmp_path: Path, fits: bool) -> None:
    """A frame in which the mechanism was not found shows no background: of none of them nothing is left."""
    scene, poses = film(tmp_path)
    numbers = [frame.index for frame in scene.masks.samples.frames]
    found = replace(bundle(), mechanism=scene.mechanism, camera=scene.camera)
    fitting = np.full(len(numbers), fits)
    masks, _ = _with_background(scene.masks, found, poses.position[numbers], fitting)
    assert (masks is not scene.masks) == fits
    assert masks.background.known.mean() > 0.9


def test_two_guesses_are_one_place_if_lengths_and_scores_agree() -> None:
    double, poses = load("double"), np.zeros((4, 2))
    values = double.values

    def guess(first: float, second: float, left: float) -> SceneGuess:
        factors = {"link1.length": first, "link2.length": second}
        sizes = {name: factor * values[name] for name, factor in factors.items()}
        return SceneGuess(double.with_values(sizes), CAMERA, poses, np.full(4, left))

    assert _alike(guess(1.0, 1.0, 0.2), guess(1.01, 0.99, 0.2005))
    assert not _alike(guess(1.0, 1.0, 0.2), guess(1.0, 1.0, 0.202))
    # one long and one short link may explain as much as the other way round
    assert not _alike(guess(1.0, 1.0, 0.2), guess(1.05, 0.95, 0.2))
