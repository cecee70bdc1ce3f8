"""The published search's start before the camera, and the choice of where a root's slide is zero.

Where a root's slide and the camera's place mean the same, the camera moves and the slide stays while the
scene is found; what was found is then written as a slide before the camera that was given.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.paper.view import View, X, Y, view_of
from monodyn.types import Camera
from monodyn.vision.drawing.camera import camera_array
from monodyn.vision.drawing.rig import longest_reach, rig_of, root_slides


def start_view(mechanism: Mechanism, camera: Camera, pinned: Collection[str]) -> View:
    """Put the mechanism before the camera, its first joint in the middle of the picture.

    Args:
        mechanism: Topology and start sizes.
        camera: Start camera.
        pinned: ``camera.x``, ``camera.y`` and ``camera.depth`` as far as they must stay.
    """
    moves = camera_moves(mechanism, pinned, slide=False)
    reach = longest_reach(rig_of(mechanism, camera))
    if moves[2]:
        camera = replace(camera, depth=camera.focal * reach / (0.3 * min(camera.width, camera.height)))
    x, y = (float(value) for value in mechanism.tree.links[0, :2])
    camera = replace(camera, x=x if moves[0] else camera.x, y=y if moves[1] else camera.y)
    view = view_of(mechanism, camera, np.zeros(len(mechanism.joints)), moves)
    limits = view.limits.copy()
    gauge = next(iter(root_slides(mechanism)), None)
    if gauge is not None and moves[gauge[1] - X]:
        limits[:, gauge[0]] = 0.0
    position = np.clip(np.zeros(limits.shape[1]), limits[0], limits[1])
    return replace(view, limits=limits, position=position)


def camera_moves(mechanism: Mechanism, pinned: Collection[str], *, slide: bool) -> tuple[bool, bool, bool]:
    """Return which of the camera's x, y and depth are estimated.

    Args:
        mechanism: The mechanism.
        pinned: ``camera.x``, ``camera.y`` and ``camera.depth`` as far as they must stay.
        slide: A root's slide is estimated in place of the camera's place along it.
    """
    x, y, depth = (name not in pinned for name in ("camera.x", "camera.y", "camera.depth"))
    gauge = next(iter(root_slides(mechanism)), None)
    if gauge is not None and slide:
        x, y = x and gauge[1] != X, y and gauge[1] != Y
    return x, y, depth


def released(view: View, mechanism: Mechanism, camera: Camera) -> View:
    """Return the same picture with the joints' own limits, a root's slide for the camera's place along it.

    Args:
        view: From ``start_view``, or what was found from it.
        mechanism: The mechanism.
        camera: The camera that was given.
    """
    limits = np.array([[j.lower for j in mechanism.joints], [j.upper for j in mechanism.joints]], dtype=float)
    out = replace(view, limits=limits)
    gauge = next(iter(root_slides(mechanism)), None)
    if gauge is None or view.limits[1, gauge[0]] > view.limits[0, gauge[0]]:
        return out
    row, column = gauge
    angle, along = float(view.base.links[row, 2]), view.base.links[row, 3:5]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    direction = turn @ along
    packed = view.base.camera.copy()
    slide = float(camera_array(camera)[column] - packed[column]) / float(direction[column - X])
    position = view.position.copy()
    position[row] += slide
    packed[X : Y + 1] += slide * direction
    return replace(out, position=position).before(packed)
