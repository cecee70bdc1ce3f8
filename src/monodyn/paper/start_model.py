"""What the published search is given: a mechanism with start sizes before a start camera.

Where a root slides, its slide and the camera's place along it mean the same. While the scene is sought the
camera moves and the slide stays; what was found is then written as a slide before the camera that was given.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.mechanism.tree import ANGLE, AXIS_X, AXIS_Y
from monodyn.paper.placed import CameraFree
from monodyn.paper.view import CAMERA_HELD, ModelView, model_view
from monodyn.types import Camera
from monodyn.vision.drawing.camera import DEPTH, X, Y, camera_array
from monodyn.vision.drawing.rig import SIZE_KINDS, RootSlide, joint_limits, longest_reach, rig_of, root_slides

START_SHARE = 0.3
"""The stretched mechanism reaches over this share of the picture's smaller side before the start camera."""
AXIS = slice(AXIS_X, AXIS_Y + 1)
"""Columns of the link table that hold the direction of a slide."""


@dataclass(frozen=True, eq=False)
class StartModel:
    """What the search is given.

    Attributes:
        mechanism: Topology and start sizes; parameters that are not free stay.
        camera: Start camera.
        pinned: ``camera.x``, ``camera.y`` and ``camera.depth`` as far as they must stay.
    """

    mechanism: Mechanism
    camera: Camera
    pinned: Collection[str]

    @property
    def scale_free(self) -> bool:
        """True where nothing pins the common scale of the sizes."""
        sizes = [p.free for p in self.mechanism.parameters if p.kind in SIZE_KINDS and not p.follows]
        return all(sizes) and "camera.depth" not in self.pinned

    def view(self, *, reference_held: bool = True) -> ModelView:
        """Return the mechanism before the camera, its first joint in the middle of the picture.

        Args:
            reference_held: The size that the others are ratios to is not searched. Else it is, and who
                searches brings the common scale back to it; where the scale is not free there is none.
        """
        camera, free = self.camera, self.camera_free(slide=False)
        if free.depth:
            reach = longest_reach(rig_of(self.mechanism, camera))
            side = START_SHARE * min(camera.width, camera.height)
            camera = replace(camera, depth=camera.focal * reach / side)
        camera = replace(camera, x=0.0 if free.x else camera.x, y=0.0 if free.y else camera.y)
        rest = np.zeros(len(self.mechanism.joints))
        view = model_view(self.mechanism, camera, rest, free)
        # a common scale stands for a camera that backs away from one root, and no coordinate may be pinned
        if not reference_held and all(free) and np.sum(view.base.parent < 0) == 1:
            # a camera that stays shows every size
            every = model_view(self.mechanism, camera, rest, CAMERA_HELD)
            view = replace(every, free=free, reference=view.reference)
        limits = view.limits.copy()
        root = self._root_slide
        if root is not None and free[root.column - X]:
            limits[:, root.joint] = 0.0  # the camera moves in place of the slide
        position = np.clip(np.zeros(limits.shape[1]), limits[0], limits[1])
        return replace(view, limits=limits, position=position)

    def camera_free(self, *, slide: bool) -> CameraFree:
        """Return which of the camera's coordinates are estimated.

        Args:
            slide: A root's slide is estimated in place of the camera's place along it.
        """
        x, y, depth = (name not in self.pinned for name in ("camera.x", "camera.y", "camera.depth"))
        root = self._root_slide
        if root is not None and slide:
            x, y = x and root.column != X, y and root.column != Y
        return CameraFree(x, y, depth)

    def released(self, view: ModelView) -> ModelView:
        """Return the same picture with the joints' own limits, a root's slide in place of the camera's place.

        Args:
            view: From ``view``, or what was found from it.
        """
        out = replace(view, limits=np.array(joint_limits(self.mechanism)))
        root = self._root_slide
        if root is None or view.limits[1, root.joint] > view.limits[0, root.joint]:
            return out
        row, column = root
        angle, along = float(view.base.links[row, ANGLE]), view.base.links[row, AXIS]
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        direction = turn @ along
        packed = view.base.camera.copy()
        # the slide takes the camera back to the given place along its own coordinate, and the mechanism with
        # it: camera and mechanism move by the same vector, so that the picture stays
        slide = float(camera_array(self.camera)[column] - packed[column]) / float(direction[column - X])
        position = view.position.copy()
        position[row] += slide
        packed[X : Y + 1] += slide * direction
        return replace(out, position=position).before(packed)

    def sized(self, view: ModelView) -> Mechanism:
        """Return the mechanism with the sizes that were found.

        Args:
            view: What was found.
        """
        return self.mechanism.with_values(dict(zip(view.names, view.sizes.tolist(), strict=True)))

    def placed(self, view: ModelView) -> Camera:
        """Return the camera at the place that was found.

        Args:
            view: What was found.
        """
        x, y, depth = (float(value) for value in view.base.camera[X : DEPTH + 1])
        return replace(self.camera, x=x, y=y, depth=depth)

    @property
    def _root_slide(self) -> RootSlide | None:
        """The first root that slides, and the camera's coordinate that means the same."""
        return next(iter(root_slides(self.mechanism)), None)
