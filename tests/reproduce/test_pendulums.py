"""Drawn pendulums: others each time, the same from the same seed, inside of the picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.reproduce.clip import ClipSettings, faces, simulated
from monodyn.reproduce.pendulums import drawn_clip, inside

SETTINGS = ClipSettings(frames=60)


def test_the_first_pendulum_is_the_usual_one() -> None:
    assert drawn_clip(SETTINGS, 0) is SETTINGS


def test_drawn_pendulums_differ_and_stay_in_the_picture() -> None:
    first, second = drawn_clip(SETTINGS, 1), drawn_clip(SETTINGS, 2)
    assert drawn_clip(SETTINGS, 1) == first
    assert drawn_clip(replace(SETTINGS, seed=5), 1).pendulum != first.pendulum
    for name in ("length", "width", "thickness", "damping", "start"):
        assert getattr(first.pendulum, name) != getattr(second.pendulum, name)
    assert first.colour != second.colour
    assert (first.seed, second.seed) == (1, 2)
    corners = np.concatenate([
        polygon
        for position in simulated(first).position
        for rod in faces(first, position)
        for polygon, _ in rod
    ])  # fmt: skip
    assert corners.min() > 8.0
    assert (corners < np.array([711.0, 471.0])).all()


def test_a_pendulum_that_leaves_the_picture_is_seen() -> None:
    near = replace(SETTINGS.camera, depth=0.5)
    assert inside(SETTINGS)
    assert not inside(replace(SETTINGS, camera=near))
