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
from monodyn.paper.subproblems import History, independent, mismatch, outline_points, size_range
from monodyn.paper.view import ModelView, SilhouetteImage
from monodyn.vision.drawing.camera import DEPTH, FOCAL, X, Y

STEP_PX, TOLERANCE_PX, MOST = 2.0, 0.02, 6000
"""First step and accuracy of the outline [px], and the most trials."""
SMALL_PX = 0.1
"""Step of an unknown for the slopes of the outline's points [px]."""


def fit_together(image: SilhouetteImage, view: ModelView) -> tuple[ModelView, History]:
    """Find place and depth of the camera, pose and aspect ratios by the mismatch, all at once: Powell.

    It starts along the directions that move the outline independently. What a picture does not show, a
    common factor of all sizes and of the depth, stays as it is.

    Args:
        image: The seen silhouette.
        view: The mechanism as found so far.

    Returns:
        The mechanism as found, and the history of the search.

    Source:
        The objective of the 2012 paper's eq. (3) and (4).
    """
    unknowns = _Unknowns(view)
    count, here = len(unknowns.step), outline_points(view.rig, view.position)
    slopes = np.empty((count, here.size))
    for row, along in zip(slopes, SMALL_PX * np.eye(count), strict=True):
        ahead, back = (outline_points(v.rig, v.position) for v in map(unknowns.at, (along, -along)))
        row[:] = ((ahead - back) / (2.0 * SMALL_PX)).ravel()
    directions = independent(slopes)

    def gap(along: np.ndarray) -> float:
        moved = unknowns.at(directions @ along)
        return mismatch(image, moved.rig, moved.position)

    settings = DirectSettings(TOLERANCE_PX / STEP_PX, MOST)
    found = powell(gap, np.zeros(count), STEP_PX, settings=settings)
    history = History("together", found.history[:, 0].astype(np.int64), found.history[:, 1])
    return unknowns.at(directions @ found.x), history


class _Unknowns:
    """The unknowns of a mechanism before a camera, each in steps of about a pixel.

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
        # a reference among the sizes that are searched takes the place of the depth
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
