"""Camera, pose and aspect ratios together, from where the published problems have led.

Equal areas (1) and equal centroids (2) place the camera. Where the silhouette lacks a part of the mechanism
they place it beside it, and pose and ratios give way to the camera: each problem alone has then nothing to
gain, and all of them together still have.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.mechanism.tree import HINGE
from monodyn.optimize.minimum import DirectSettings
from monodyn.optimize.powell import powell
from monodyn.paper.subproblems import History, mismatch, size_range
from monodyn.paper.view import ModelView, SilhouetteImage
from monodyn.vision.drawing.camera import DEPTH, FOCAL, X, Y

STEP_PX, TOLERANCE_PX, MOST = 2.0, 0.02, 6000
"""First step and accuracy of each unknown [px], and the most trials."""


def fit_together(image: SilhouetteImage, view: ModelView) -> tuple[ModelView, History]:
    """Find place and depth of the camera, pose and aspect ratios by the mismatch, all at once: Powell.

    Args:
        image: The seen silhouette.
        view: The mechanism as found so far; a reference among the sizes that are searched leaves the depth as
            it is.

    Returns:
        The mechanism as found, and the history of the search.

    Source:
        The objective of the 2012 paper's eq. (3) and (4).
    """
    unknowns = _Unknowns(view)

    def gap(steps: np.ndarray) -> float:
        moved = unknowns.at(steps)
        return mismatch(image, moved.rig, moved.position)

    settings = DirectSettings(TOLERANCE_PX / STEP_PX, MOST)
    found = powell(gap, np.zeros(len(unknowns.step)), STEP_PX, settings=settings)
    history = History("together", found.history[:, 0].astype(np.int64), found.history[:, 1])
    return unknowns.at(found.x), history


class _Unknowns:
    """The unknowns of a mechanism before a camera in steps of a pixel, of the largest size where it turns.

    Attributes:
        step: What one step is of each unknown [m or rad], or as a share of the depth, (param,).
    """

    def __init__(self, view: ModelView) -> None:
        camera = view.base.camera
        px = float(camera[DEPTH] / camera[FOCAL])
        size = max(float(np.max(view.sizes, initial=0.0)), px)
        self.view = view
        self.range = size_range(view)
        self.place = [column for column, free in ((X, view.free.x), (Y, view.free.y)) if free]
        self.depth = [DEPTH] if view.free.depth and view.reference not in view.searched else []
        self.joints = np.flatnonzero(view.limits[1] > view.limits[0])
        turns = np.where(view.base.kind[self.joints] == HINGE, px / size, px)
        self.step = np.concatenate(
            ([px] * len(self.place), [px / size] * len(self.depth), turns, [px] * len(view.sizes))
        )

    def at(self, steps: np.ndarray) -> ModelView:
        """Return the mechanism some steps away (param,); limits and bounds hold."""
        place, depth, joints, sizes = np.split(
            self.step * steps, np.cumsum([len(self.place), len(self.depth), len(self.joints)])
        )
        view, camera = self.view, self.view.base.camera.copy()
        camera[self.place] += place
        camera[self.depth] *= np.exp(depth)
        position = view.position.copy()
        position[self.joints] += joints
        return replace(
            view, position=np.clip(position, *view.limits), sizes=np.clip(view.sizes + sizes, *self.range)
        ).before(camera)
