"""A closed loop in, a film of it out: the mechanism before grey paper, with the time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.results.closed import ClosedLoop
from monodyn.results.overlay import FITTED, Drawing, write_overlay
from monodyn.results.sight import outlines_of
from monodyn.types import Camera, Frame, Progress
from monodyn.vision.clip.video import Video

WIDTH, HEIGHT = 720, 480
"""Size of the film [px]."""
FILM_RATE = 30.0
"""Frames a second of the film [Hz]."""
PAPER = 220
"""Grey level behind the mechanism."""
FAR_AWAY = 6.0
"""Distance of the camera of the film, in sizes of what it shows."""
MARGIN = 1.15
"""How much larger what it shows is than the motion."""


def write_loop(
    path: Path,
    mechanism: Mechanism,
    loop: ClosedLoop,
    *,
    swinging: float = 0.0,
    progress: Progress | None = None,
) -> None:
    """Write the motion of a closed loop as a film.

    Args:
        path: Where to.
        mechanism: The mechanism that moves.
        loop: Its motion.
        swinging: How long it swings up [s]; the rest of the time it is balanced.
        progress: Called with the frames drawn.
    """
    every = max(1, round(1.0 / (FILM_RATE * float(loop.time[1] - loop.time[0]))))
    time, position = loop.time[::every], loop.position[::every]
    camera = camera_for(mechanism, position)
    paper = np.full((HEIGHT, WIDTH), PAPER, np.uint8)

    def frames(first: int, stop: int) -> Iterator[Frame]:
        for row in range(first, min(stop, len(time))):
            yield Frame(row, float(time[row]), paper, None)

    def drawing(frame: Frame) -> Drawing:
        outlines = outlines_of(mechanism, camera, position[frame.index])
        said = f"{frame.time:.2f} s  {'swing up' if frame.time < swinging else 'balance'}"
        return Drawing([(polygon, FITTED) for polygon in outlines], said)

    write_overlay(path, Video(path, WIDTH, HEIGHT, time, frames), drawing, progress=progress)


def camera_for(mechanism: Mechanism, position: np.ndarray) -> Camera:
    """Return a camera that sees all of a motion.

    Args:
        mechanism: The mechanism.
        position: Joint positions [rad or m], (frame, dof).
    """
    # a camera far away shows where everything is: from there the real one is placed
    reach = float(np.sum(np.hypot(*mechanism.tree.links[:, :2].T)) + np.abs(mechanism.shapes.points).max())
    slides = [i for i, joint in enumerate(mechanism.joints) if joint.kind == "slide"]
    reach += float(np.abs(position[:, slides]).sum(axis=1).max(initial=0.0))
    far = Camera(WIDTH, HEIGHT, focal=1e3, depth=1e3 * reach)
    corners = np.vstack(
        [
            polygon
            for q in position[:: max(1, len(position) // 100)]
            for polygon in outlines_of(mechanism, far, q)
        ]
    )
    metre = far.focal / far.depth
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle = (0.5 * (low + high) - [(WIDTH - 1) / 2.0, (HEIGHT - 1) / 2.0]) / metre
    size = MARGIN * float(np.max((high - low) / [WIDTH, HEIGHT])) * HEIGHT / metre
    return Camera(
        WIDTH, HEIGHT, focal=FAR_AWAY * HEIGHT, x=float(middle[0]), y=float(-middle[1]), depth=FAR_AWAY * size
    )
