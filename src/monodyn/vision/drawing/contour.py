"""From a pose and a mask to what became of every sample of the outline: for showing why a pose is believed.

The samples are those that a pose is fitted to (``normals``); here those that are left out have their reason.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monodyn.vision.drawing import probe
from monodyn.vision.drawing.edges import MATCHED_PX, MOST_SAMPLES
from monodyn.vision.drawing.normals import edge_samples
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.drawing.shutter import swept_points
from monodyn.vision.drawing.silhouette import blank_outlines, draw
from monodyn.vision.foreground.masks import View

END = 0.9
"""An edge found beyond this share of the search length is none: the coverage does not change along the
normal."""
ON_EDGE, ELSEWHERE, NO_EDGE, COVERED, NO_CONTRAST, OFF_PICTURE = range(6)
"""What became of a sample: the mask has its edge there, or nearby, or nowhere along the normal; another part
covers it; the background looks like the mechanism; its normal leaves the picture."""


class Contour(NamedTuple):
    """The samples of an outline over a mask.

    Attributes:
        place: Where each sample is [px], (sample, 2).
        edge: Where the mask has its edge [px], (sample, 2); the place itself where none was looked for.
        fate: What became of it, ``ON_EDGE`` to ``OFF_PICTURE``, int64 (sample,).
    """

    place: np.ndarray
    edge: np.ndarray
    fate: np.ndarray


def contour(
    planes: np.ndarray, view: View, rig: Rig, position: np.ndarray, reach: float, spacing: float
) -> Contour:
    """Look for the edges of a mask along the outline of a pose, and keep what became of every sample.

    Args:
        planes: Mask by colour, uint8 (colour, height, width).
        view: How its planes are to be read.
        rig: The mechanism and its camera.
        position: Joint positions, (dof,).
        reach: Length of the search along the normals [px].
        spacing: Distance between samples [px].

    Returns:
        The samples; none where the pose cannot be drawn.
    """
    outlines = blank_outlines(rig, len(rig.radius))
    count = 0
    samples = np.empty((MOST_SAMPLES, probe.SAMPLE_COLUMNS))
    if draw(rig, np.array(position, dtype=np.float64), outlines):
        ends = np.empty((MOST_SAMPLES, probe.END_COLUMNS), dtype=np.int64)
        swept = swept_points(rig, np.array(position, dtype=np.float64), outlines)
        count = edge_samples(planes, view, outlines, swept, (reach, spacing), ends, samples, True)
    samples = samples[:count]
    place, reason = samples[:, [probe.AT_X, probe.AT_Y]], samples[:, probe.REASON]
    left_out = [reason == probe.OUTSIDE, reason == probe.HIDDEN, reason == probe.FAINT]
    # displacement and depth are not filled in for what is left out
    judged = ~np.any(left_out, axis=0)
    away = np.where(judged, samples[:, probe.AWAY], 0.0) / np.where(judged, samples[:, probe.GAIN], 1.0)
    inner = np.where(judged, samples[:, probe.INNER], 1.0)
    none = (away > END * reach) | (away < -END * inner)
    fate = np.select(
        [*left_out, np.abs(away) < MATCHED_PX, none],
        [OFF_PICTURE, COVERED, NO_CONTRAST, ON_EDGE, NO_EDGE],
        ELSEWHERE,
    )
    return Contour(place, place + away[:, np.newaxis] * samples[:, [probe.NORMAL_X, probe.NORMAL_Y]], fate)
