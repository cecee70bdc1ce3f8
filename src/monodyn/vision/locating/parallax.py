"""How far the mechanism stands before the scene that a moving camera is registered on.

A camera that is displaced moves what is near by more than what is far: over the registered scene the
mechanism sways along with the way of the camera, in the same proportion at all times. The one idea: in each
key frame the edges show where the whole mechanism is, next to its pose; the parallax is what these places
have in common with the way.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monodyn.vision.clip.steady import Parallax
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.foreground.masks import planes_for
from monodyn.vision.locating.locate import Sought
from monodyn.vision.locating.scene import Scene
from monodyn.vision.locating.sway import Sway, sway_of

OUTLYING_PX = 1.0
"""Distance from the line at which a displacement counts half [px]."""
ROUNDS = 5
"""Rounds of that line."""
CLEAR_STDS = 3.0
"""Standard deviations from which a parallax is not zero."""
SETTLED_PX = 0.15
"""Displacement that it makes below which the mechanism is not located again [px]."""
TRIES = 3
"""Times that the mechanism is located again, at most."""

Find = Callable[[Sought], Scene]


class Nearer(NamedTuple):
    """By how much more the mechanism moves in the pictures than the scene behind it.

    Attributes:
        parallax: Beyond that of its masks.
        std_px: Standard deviation of the displacement that it makes in the key frames [px].
        rms_px: That displacement [px].
    """

    parallax: Parallax
    std_px: float
    rms_px: float


def find_past_parallax(sought: Sought, find: Find) -> Scene:
    """Locate the mechanism, again where a moving camera shows that it stands before the scene.

    Args:
        sought: The masks, the mechanism, and what is known of the camera.
        find: Locates it in masks.

    Returns:
        The scene.
    """
    scene = find(sought)
    for _ in range(TRIES):
        found = parallax_of(scene)
        if found is None or found.rms_px < max(SETTLED_PX, CLEAR_STDS * found.std_px):
            break
        known = scene.masks.parallax
        parallax = Parallax(known.share + found.parallax.share, known.turning + found.parallax.turning)
        scene = find(replace(sought, masks=sought.masks.nearer(parallax)))
    return scene


def parallax_of(scene: Scene) -> Nearer | None:
    """Measure by how much more the mechanism moves than the scene behind it, beyond what its masks know.

    Args:
        scene: A located mechanism.

    Returns:
        The parallax over that of the masks; None before a camera that stands still.
    """
    path = scene.masks.video.camera_path
    if path is None:
        return None
    sway = scene_sway(scene)
    # columns: the parallax, its perspective part in pixels, and a displacement of all frames alike, which the
    # camera's place takes up
    area = float(np.prod(path.size)) / 4.0
    design = np.stack([np.column_stack([path.swaying(k) * [1.0, area], np.eye(2)]) for k in scene.key_frames])
    normal = np.einsum("kij,kil,klm->kjm", design, sway.information, design)
    right = np.einsum("kij,kil,kl->kj", design, sway.information, sway.shift)
    weight, line = np.ones(len(design)), np.zeros(4)
    for _ in range(ROUNDS):
        line = _solved(weight, normal, right)
        off = np.hypot(*(sway.shift - design @ line).T) / OUTLYING_PX
        weight = 1.0 / (1.0 + off**2)
    # each frame left out once: they differ by more than the noise of their edges
    count, moving = len(design), design[:, :, :2] - design[:, :, :2].mean(axis=0)
    others = np.array(
        [_solved(*(np.delete(part, k, axis=0) for part in (weight, normal, right))) for k in range(count)]
    )
    spread = np.einsum("kij,nj->nki", moving, (others - others.mean(axis=0))[:, :2])
    std = math.sqrt(float(np.sum(spread**2)) / count * (count - 1) / count)
    rms = math.sqrt(float(np.sum((moving @ line[:2]) ** 2)) / count)
    return Nearer(Parallax(float(line[0]), float(line[1]) * area), std, rms)


def _solved(weight: np.ndarray, normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return parallax and common displacement, (4,), from the normal equations of the frames."""
    # a camera that only turns or is only displaced leaves one of the two columns open: then they share
    whole = np.einsum("k,kij->ij", weight, normal) + np.diag([1.0, 1.0, 1e-6, 1e-6])
    return np.linalg.solve(whole, np.einsum("k,ki->i", weight, right))


def scene_sway(scene: Scene) -> Sway:
    """Measure where the edges show the whole mechanism in the key frames of a scene, next to its pose.

    Args:
        scene: A located mechanism.

    Returns:
        Displacements against the masks.
    """
    frames = {frame.index: frame for frame in scene.masks.samples.frames}
    rig = rig_of(scene.mechanism, scene.camera)
    view = scene.masks.view(len(rig.radius))
    planes = [planes_for(scene.masks.of(frames[number]), view) for number in scene.key_frames]
    return sway_of(planes, view, rig, scene.key_positions)
