"""Sizes, places and turns improved one by one with the poses held, and how much of the masks is left."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.mechanism.parts import PLACE_KINDS
from monodyn.types import Camera
from monodyn.vision.drawing.rig import SIZE_KINDS, Rig, rig_of
from monodyn.vision.locating.grow import SceneStart, Structure, better_mean, left_share
from monodyn.vision.locating.keyframes import KeyFrames
from monodyn.vision.locating.unit import drawn

LEAST_SIZE = 0.7
"""No size becomes smaller than this [reduced px]."""
WIDTH_STEPS = (0.6, 0.3, 0.12)
"""Steps of the logarithms of widths, tails and tips, one round after the other."""
LENGTH_STEPS = (0.1, 0.06, 0.03)
"""Steps of the logarithms of lengths."""
PLACE_STEPS = (3.0, 1.5, 0.7)
"""Steps of the root's place and of places on bodies [reduced px]."""
TURN_STEPS = (0.2, 0.1, 0.05)
"""Steps of the turns of geoms [rad]."""


def settled(frames: KeyFrames, structure: Structure, start: SceneStart) -> Structure:
    """Improve sizes and place one by one, the poses held.

    Args:
        frames: The frames of the structure.
        structure: A whole structure; the first pose of each beam counts.
        start: What may not change.

    Returns:
        The structure with the sizes at which its outlines explain most of the frames.
    """
    poses = [beam[0] for beam in structure.beams]
    mechanism, camera = structure.mechanism, structure.camera
    least = frames_cost(frames, mechanism, camera, poses)
    unit = frames.shrink * camera.depth / camera.focal
    for round_ in range(len(PLACE_STEPS)):
        for (name, step), sign in itertools.product(_moves(mechanism, start, round_, unit), (1.0, -1.0)):
            while True:
                if name.startswith("camera"):
                    axis = name[-1]
                    tried = mechanism, replace(camera, **{axis: getattr(camera, axis) + sign * step})
                else:
                    p = mechanism.parameter(name)
                    grew = max(p.value * float(np.exp(sign * step)), LEAST_SIZE * unit)
                    value = p.value + sign * step if p.kind in (*PLACE_KINDS, "turn") else grew
                    tried = mechanism.with_values({name: value}), camera
                cost = frames_cost(frames, *tried, poses)
                if not cost < least - 1e-6:
                    break
                (mechanism, camera), least = tried, cost
    return replace(structure, mechanism=mechanism, camera=camera)


def _moves(mechanism: Mechanism, start: SceneStart, round_: int, unit: float) -> list[tuple[str, float]]:
    """List what may be changed, and by how much in a round: sizes by logarithms, places by lengths; ``unit``
    is a reduced pixel."""
    moves: list[tuple[str, float]] = []
    for p in drawn(mechanism):
        if p.name in start.pinned or (p.kind in SIZE_KINDS and p.value <= 0.0):
            continue
        if p.kind in SIZE_KINDS:
            moves.append((p.name, (LENGTH_STEPS if p.kind == "length" else WIDTH_STEPS)[round_]))
        elif p.kind in PLACE_KINDS:
            moves.append((p.name, PLACE_STEPS[round_] * unit))
    turns = [p for p in mechanism.parameters if p.kind == "turn" and not p.follows]
    moves += [(p.name, TURN_STEPS[round_]) for p in turns if p.name not in start.pinned]
    cameras = [name for name in ("camera.x", "camera.y") if name not in start.pinned]
    return moves + [(name, PLACE_STEPS[round_] * unit) for name in cameras]


def frames_cost(
    frames: KeyFrames, mechanism: Mechanism, camera: Camera, poses: Iterable[np.ndarray]
) -> float:
    """Return how much of the foreground a mechanism leaves unexplained.

    Args:
        frames: The key frames.
        mechanism: The mechanism.
        camera: The camera.
        poses: Joint positions in each frame, each (dof,).

    Returns:
        Mean share of the better frames.
    """
    rig: Rig = rig_of(mechanism, camera, shrink=frames.shrink)
    shares = [left_share(frame, rig, pose) for frame, pose in zip(frames.frames, poses, strict=True)]
    return better_mean(np.array(shares))
