"""A painted double pendulum as a stream of pictures, for the tests of what is followed live."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from monodyn.live.sources import pictures_of
from monodyn.reproduce.clip import ClipSettings, painted, simulated, wall
from monodyn.reproduce.truth import Truth
from monodyn.types import Camera, Frame

SMALL = ClipSettings(camera=Camera(288, 192, 280.0, 0.03, -0.17, 1.15), frames=330)
"""Eleven seconds in small pictures."""


def pictures(settings: ClipSettings, truth: Truth) -> Iterator[np.ndarray]:
    """Yield the painted pictures of a motion, uint8 (height, width, 3)."""
    rng = np.random.default_rng(settings.seed)
    behind, shape = wall(settings, rng), (settings.camera.height, settings.camera.width, 1)
    for position in truth.position:
        picture = painted(settings, position, behind) + settings.noise * rng.standard_normal(shape)
        yield np.clip(np.round(picture), 0, 255).astype(np.uint8)


def frames(settings: ClipSettings = SMALL) -> tuple[list[Frame], Truth]:
    """Return the frames of a painted pendulum, and its true motion."""
    truth = simulated(settings)
    return list(pictures_of(pictures(settings, truth), settings.rate).opened()), truth
