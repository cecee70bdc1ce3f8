"""Drawn clips of dots with known truth, for the tests of what is found in them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from monodyn.types import FULL, Mask
from monodyn.vision.clip.video import Video
from monodyn.vision.foreground.thumbnails import Window

WIDTH, HEIGHT, RATE = 1280, 720, 30.0
"""Size of the pictures [px] and frames a second [Hz]."""

BALLS = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
<body name="link1"><joint name="joint1" type="hinge" axis="0 -1 0" damping="0.001"/>
<geom type="sphere" size="0.01" pos="0.1 0 0"/>
<body name="link2" pos="0.1 -0.01 0"><joint name="joint2" type="hinge" axis="0 -1 0" damping="0.001"/>
<geom name="tip" type="sphere" size="0.01" pos="0.1 0 0"/></body></body></worldbody></mujoco>"""
"""Two balls on links that cannot be seen."""


def coverage(places: np.ndarray, radius: float = 6.0) -> np.ndarray:
    """Return the mask of discs at places (point, 2), their borders covered in part, uint8 (height, width)."""
    plane = np.zeros((HEIGHT, WIDTH))
    for x, y in places[np.isfinite(places).all(axis=1)]:
        left, top = int(x - radius) - 2, int(y - radius) - 2
        rows = np.arange(max(top, 0), min(top + 2 * int(radius) + 6, HEIGHT))[:, None]
        columns = np.arange(max(left, 0), min(left + 2 * int(radius) + 6, WIDTH))[None]
        if rows.size and columns.size:
            share = np.clip(radius + 0.5 - np.hypot(columns - x, rows - y), 0.0, 1.0)
            part = (slice(rows[0, 0], rows[-1, 0] + 1), slice(columns[0, 0], columns[0, -1] + 1))
            plane[part] = np.maximum(plane[part], share)
    return np.round(FULL * plane).astype(np.uint8)


class DrawnMasks:
    """Masks of discs on given paths, (frame, point, 2); NaN is not drawn."""

    def __init__(self, px: np.ndarray, radius: float = 6.0) -> None:
        self.px, self.radius = px, radius
        times = np.arange(len(px)) / RATE
        self.video = Video(Path("dots.mp4"), WIDTH, HEIGHT, times, lambda start, stop: iter(()))
        self.background = SimpleNamespace(window=Window(0, HEIGHT, 0, WIDTH))

    def __iter__(self) -> Iterator[Mask]:
        for i, places in enumerate(self.px):
            yield Mask(i, i / RATE, coverage(places, self.radius)[np.newaxis])
