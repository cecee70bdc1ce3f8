"""A mechanism of which only dots are seen, as sticks in the picture: what cannot be seen, for showing."""

from __future__ import annotations

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.mechanism.dots import shows_dots
from monodyn.mechanism.tree import ANCHOR_X, ANCHOR_Y
from monodyn.types import Camera
from monodyn.vision.points.marks import SITE, targets_of
from monodyn.vision.points.shown import Places, Shown, project

RING_PX = 6.0
"""Radius of the ring around a dot that is not drawn as a geom [px]."""
CORNERS = 16
"""Corners of such a ring."""


def sticks(mechanism: Mechanism, camera: Camera, position: np.ndarray) -> list[np.ndarray]:
    """Return a line from each hinge to what is on its link, and a ring around each site.

    Args:
        mechanism: The mechanism.
        camera: The camera, in the same scale.
        position: Joint positions [rad or m], (dof,); all known.

    Returns:
        Lines and rings [px], each (point, 2); none where more than dots can be seen, or behind the camera.
    """
    if not shows_dots(mechanism):
        return []
    tree, drawn = mechanism.tree, bool(mechanism.plan.drawn)
    dots = [mark for mark in targets_of(mechanism).values() if mark.kind == SITE]
    place, height = Places(tuple(dots), mechanism, np.zeros(0, dtype=np.int64)).at(
        mechanism, np.zeros((0, 2))
    )
    depths = mechanism.plan.depths @ np.append(mechanism.plan_numbers, 1.0)
    ends = [(mark.link, place[i], height[i]) for i, mark in enumerate(dots)]
    # a link without a dot of its own is shown by the next hinge
    bare = set(range(len(tree.parent))) - {mark.link for mark in dots}
    ends += [
        (int(p), tree.links[i, [ANCHOR_X, ANCHOR_Y]], depths[p])
        for i, p in enumerate(tree.parent)
        if p in bare
    ]
    pairs = [end for link, at, z in ends for end in ((link, np.zeros(2), depths[link]), (link, at, z))]
    shown = Shown(
        tree.parent, tree.kind, tree.links, np.array([link for link, _, _ in pairs]),
        np.array([at for _, at, _ in pairs]), np.array([z for _, _, z in pairs]), camera,
    )  # fmt: skip
    lines = project(shown, position[np.newaxis])[0].reshape(-1, 2, 2)
    turn = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
    ring = RING_PX * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    rings = [] if drawn else [line[1] + ring for line in lines[: len(dots)]]
    return [part for part in (*lines, *rings) if np.all(np.isfinite(part))]
