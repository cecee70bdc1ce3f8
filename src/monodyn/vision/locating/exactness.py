"""How exactly the edges of a clip are known: their noise, and what is the same in all frames.

The noise is the distance that single samples keep from the refined outline; more key frames average it out.
What they do not average out shows place by place. The mean over the key frames of where the coverage passes
half of its level, seen from the outline, is zero where the outline has the body's shape, the blur is
symmetric, and the colours of figure and ground are right. A body of another shape, a side in another light, a
halo of the codec and a level that is a little off all move it away from zero. What moves all edges together
and leaves their profile as it is does not: that is in ``light``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from monodyn.vision.drawing import probe
from monodyn.vision.drawing.edges import MATCHED_PX, MOST_SAMPLES
from monodyn.vision.drawing.halfway import half_ways
from monodyn.vision.drawing.normals import edge_samples
from monodyn.vision.drawing.rig import Rig, rig_of
from monodyn.vision.drawing.shutter import swept_points
from monodyn.vision.drawing.silhouette import blank_outlines, draw
from monodyn.vision.locating.bundle import NOISE_PX, SYSTEMATIC_PX, Bundle, KeyMasks
from monodyn.vision.locating.sway import sway_of

REACH_PX, SPACING_PX = 4.0, 3.0
"""Length of the search to either side of the outline, and distance between its samples [px]."""
PLACE_PX = 12.0
"""Length of outline that counts as one place: farther apart the edges of a codec's blocks are not alike."""
LEAST_PX = 0.01
"""Least standard deviation of either kind: a coverage has 160 levels, and between pixels it is taken to be
linear [px]."""
TAKEN_UP = 2.0
"""A sway over what is left of it once camera and sizes have followed it: they take up a part. Of a pole whose
pivot gave way by 8 mm any factor above 1 leaves the camera's pitch within 4 deviations."""
SIDES = 2.0
"""A size lies between two edges, and what shifts one of them outwards shifts the other one outwards too."""


@dataclass(frozen=True)
class Exactness:
    """How exactly edges are known.

    Attributes:
        noise_px: Standard deviation of an edge sample that more of them reduce [px].
        systematic_px: Standard deviation of a size that more of them do not reduce [px].
        sway_px: Standard deviation of the place of the whole mechanism in a frame, next to its pose [px].
    """

    noise_px: float = NOISE_PX
    systematic_px: float = SYSTEMATIC_PX
    sway_px: float = 0.0

    def of(self, bundle: Bundle) -> Bundle:
        """Return a refinement with what it knows by this noise in place of that assumed for it.

        Args:
            bundle: The refinement.
        """
        assumed = np.diag(bundle.variables.assumed)
        seen = (bundle.information - assumed) * (NOISE_PX / self.noise_px) ** 2
        return replace(
            bundle, information=seen + assumed, systematic_px=self.systematic_px, sway_px=self.sway_px
        )


def exactness_of(masks: KeyMasks, bundle: Bundle, rows: np.ndarray) -> Exactness:
    """Measure how exactly the edges of a clip are known.

    Args:
        masks: Masks of the key frames that motion does not blur.
        bundle: A refinement over these and others.
        rows: Rows of these frames among its own, (frame,).

    Returns:
        What was found; as is assumed without a clip where no sample lies on an edge.
    """
    near = bundle.samples * bundle.matched
    if not near.any():
        return Exactness()
    noise = max(float(np.sqrt(near @ bundle.rms_px**2 / near.sum())), LEAST_PX)
    rig = rig_of(bundle.mechanism, bundle.camera, shrink=masks.shrink)
    found = [
        _half_ways(planes, masks, rig, pose)
        for planes, pose in zip(masks.planes, bundle.positions[rows], strict=True)
    ]
    places, away, weight = (np.concatenate(parts) for parts in zip(*found, strict=True))
    if not len(away):
        return Exactness(noise)
    sway = sway_of(masks.planes, masks.view, rig, bundle.positions[rows])
    _, at = np.unique(places, axis=0, return_inverse=True)
    total = np.bincount(at.ravel(), weight)
    mean = np.bincount(at.ravel(), weight * away) / total
    same = SIDES * float(np.sqrt(total @ mean**2 / total.sum()))
    return Exactness(noise, max(same, LEAST_PX), TAKEN_UP * sway.rms_px)


def _half_ways(
    planes: np.ndarray, masks: KeyMasks, rig: Rig, pose: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the places of samples along the outline in one mask, int64 (sample, 3): the points between which
    they lie, and which part of the way; how far outwards of it the coverage passes half of its level there
    [px], and how much they count, (sample,) each."""
    outlines = blank_outlines(rig, len(rig.radius))
    if not draw(rig, pose, outlines):
        return np.zeros((0, 3), dtype=np.int64), np.zeros(0), np.zeros(0)
    ends = np.empty((MOST_SAMPLES, probe.END_COLUMNS), dtype=np.int64)
    samples = np.empty((MOST_SAMPLES, probe.SAMPLE_COLUMNS))
    swept = swept_points(rig, pose, outlines)
    count = edge_samples(planes, masks.view, outlines, swept, (REACH_PX, SPACING_PX), ends, samples)
    away = half_ways(planes, masks.view, samples[:count], REACH_PX)
    # what lies on an edge: elsewhere it is some other thing that is seen
    use = np.flatnonzero(np.isfinite(away) & (np.abs(samples[:count, probe.AWAY]) < MATCHED_PX))
    between, samples = ends[use][:, [probe.FROM, probe.TO]], samples[use]
    length = np.hypot(*(outlines.px[between[:, 1]] - outlines.px[between[:, 0]]).T)
    part = (samples[:, probe.SHARE] * np.maximum(length // PLACE_PX, 1.0)).astype(np.int64)
    return np.column_stack([between, part]), away[use], samples[:, probe.WEIGHT]
