"""Foreground in, spots out: the connected pieces of every mask, each with its centre and its area.

A mask is linear in the picture, so the mean place of a piece, weighted by its coverage, keeps its sub-pixel
place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.types import FULL, Progress
from monodyn.vision.foreground.masks import Masks

EDGE = 0.2
"""Coverage from which a pixel belongs to a spot, as a share of ``FULL``."""
CORE = 0.5
"""Coverage that a spot reaches somewhere, at least, as a share of ``FULL``."""
LEAST_AREA = 3.0
"""Area of a spot, at least [px]."""
MOST_SPOTS = 40
"""Spots of one frame that are kept, the largest ones."""


@dataclass(frozen=True, eq=False)
class Spots:
    """Spots of a clip, frame after frame.

    Attributes:
        row: Row of the frame of each spot, (point,), not decreasing.
        px: Column and row of its centre [px], (point, 2).
        area: Its area [px], (point,).
        frame: Frame numbers by row, (frame,).
        time: Time stamps by row [s], (frame,).
    """

    row: np.ndarray
    px: np.ndarray
    area: np.ndarray
    frame: np.ndarray
    time: np.ndarray

    def of(self, kept: np.ndarray) -> Spots:
        """Return some of the spots.

        Args:
            kept: True for these, bool (point,).
        """
        return Spots(self.row[kept], self.px[kept], self.area[kept], self.frame, self.time)

    def most(self, count: int) -> np.ndarray:
        """Return the area of the spot of a rank in each frame that has as many [px], (frame,).

        Args:
            count: The rank, 1 for the largest.
        """
        parts = np.split(self.area, np.searchsorted(self.row, np.arange(1, len(self.frame))))
        return np.array([np.sort(part)[-count] for part in parts if len(part) >= count])


def spots_of(masks: Masks, progress: Progress) -> Spots:
    """Find the spots of every frame.

    Args:
        masks: The foreground of the clip.
        progress: Called with the number of frames done.

    Returns:
        The spots.
    """
    window, count = masks.background.window, masks.video.count
    rows, px, area, frames, times = [], [], [], [], []
    for mask in masks:
        found = spots_in(mask.coverage[window.top : window.bottom, window.left : window.right])
        rows.append(np.full(len(found), len(frames)))
        px.append(found[:, :2] + [window.left, window.top])
        area.append(found[:, 2])
        frames.append(mask.index)
        times.append(mask.time)
        progress("dots", len(frames), count)
    return Spots(
        np.concatenate(rows), np.concatenate(px), np.concatenate(area), np.array(frames), np.array(times)
    )


def spots_in(coverage: np.ndarray) -> np.ndarray:
    """Find the spots of one mask.

    Args:
        coverage: The mask, uint8 (height, width).

    Returns:
        Column, row and area of each [px], the largest first, (point, 3). What touches the border is left out:
        its centre is not seen.
    """
    import cv2

    inside = (coverage > EDGE * FULL).astype(np.uint8)
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(inside, connectivity=8)
    found = []
    largest = 1 + np.argsort(-boxes[1:count, cv2.CC_STAT_AREA])[:MOST_SPOTS]
    for k in largest:
        left, top, width, height = boxes[k, :4].tolist()
        if left == 0 or top == 0 or left + width == inside.shape[1] or top + height == inside.shape[0]:
            continue
        box = slice(top, top + height), slice(left, left + width)
        level = np.where(labels[box] == k, np.minimum(coverage[box], FULL), 0) / FULL
        total = float(level.sum())
        if total < LEAST_AREA or level.max() < CORE:
            continue
        y, x = level.sum(axis=1) @ np.arange(height), level.sum(axis=0) @ np.arange(width)
        found.append((left + x / total, top + y / total, total))
    found.sort(key=lambda spot: -spot[2])
    return np.array(found).reshape(-1, 3)
