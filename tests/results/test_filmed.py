"""The clip that a fit comes from: its camera and poses in metres of the identified scale."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fits import made_fit
from monodyn.mechanism import load
from monodyn.results.filmed import filmed_of
from monodyn.types import Camera, Poses
from monodyn.vision.drawing.outline import outline

POSES = Poses(
    ("slider", "hinge"),
    np.arange(2),
    np.arange(2.0),
    np.ones((2, 2)),
    np.ones((2, 2, 2)),
    np.ones(2, bool),
    metric=False,
)


def scene(**changes: Any) -> Any:
    camera = Camera(64, 48, 100.0, x=1.0, y=2.0, depth=3.0, roll=0.5)
    spread = {"camera.depth": 0.1, "camera.roll": 0.2}
    found = {"camera": camera, "camera_std": spread, "masks": SimpleNamespace(video="the clip")}
    return SimpleNamespace(**found, mechanism=load("cartpole"), **changes)


@pytest.mark.parametrize(("torque", "std"), [("friction", 0.2), ("free", np.inf)])
def test_lengths_grow_with_the_scale_and_angles_do_not(torque: str, std: float) -> None:
    fit = made_fit(mechanism=load("cartpole"), scale=2.0, torque=torque)
    filmed = filmed_of(fit, scene(), POSES)
    camera = filmed.camera
    assert (camera.x, camera.y, camera.depth, camera.roll, camera.focal) == (2.0, 4.0, 6.0, 0.5, 100.0)
    assert filmed.camera_std == {"camera.depth": std, "camera.roll": 0.2}
    assert filmed.tracked.position[0].tolist() == [2.0, 1.0]
    assert filmed.mechanism.values["link1.length"] == fit.mechanism.values["link1.length"]


def test_a_body_is_drawn_as_thick_as_it_was_located() -> None:
    """A fit may make a thickness metres, for a mass; before the camera at 3 m it would be drawn nowhere."""
    heavy = load("cartpole").with_values({"link1.thickness": 9.0})
    filmed = filmed_of(made_fit(mechanism=heavy, scale=2.0), scene(), POSES)
    located = load("cartpole").values["link1.thickness"]
    assert filmed.mechanism.values["link1.thickness"] == 2.0 * located
    assert len(outline(filmed.mechanism, filmed.camera, np.zeros(2))) == len(heavy.shapes.body)


def test_where_nothing_was_identified_the_located_mechanism_is_drawn() -> None:
    found = scene()
    assert filmed_of(made_fit(starts=()), found, POSES).mechanism is found.mechanism
