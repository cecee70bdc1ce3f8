"""Where something stands before the mechanism: places that its outline covers and where no foreground shows.

A pixel inside of the followed outline should show the mechanism. Where it never does although the outline
covers it in several frames, something hides it: an edge there is the occluder's, and no edge there says
nothing about the pose. One frame in which the mechanism shows clears a pixel.
"""

# elements of typed arrays are arrays to the type checker and numbers to numba
# pyright: reportArgumentType=false
from __future__ import annotations

import math

import numpy as np
from numba import njit

from monodyn.types import FULL
from monodyn.vision.drawing.probe import TRUSTED
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.drawing.silhouette import Outlines, blank_outlines, draw
from monodyn.vision.foreground.masks import View

CELL_PX = 2
"""Every second pixel of every second row is looked at."""
WITHIN_PX = 1.5
"""Pixels this far inside of the outline belong to the mechanism, whatever the pose is off by."""
EMPTY, SHOWN = 0.2 * FULL, 0.5 * FULL
"""Coverage below which a pixel does not show the mechanism, and above which it does."""
LEAST_HITS = 3
"""Frames in which a pixel must have been covered without showing the mechanism."""
HITS_A_SHOW = 4
"""Such frames for each in which it did show it; the edge of an occluder is not the same in all frames."""
LEAST_CELLS = 8
"""Cells of the smallest occluder."""


class Occluders:
    """Counts, for cells of the picture, frames in which the mechanism should show and does or does not.

    Args:
        rig: The mechanism before its camera.
        view: How the planes of the masks are to be read.
    """

    def __init__(self, rig: Rig, view: View) -> None:
        self._rig, self._view = rig, view
        height, width = view.trust.shape[1:]
        cells = (height + CELL_PX - 1) // CELL_PX, (width + CELL_PX - 1) // CELL_PX
        self._hits, self._shows = np.zeros(cells, np.int32), np.zeros(cells, np.int32)

    def note(self, planes: np.ndarray, position: np.ndarray, links: np.ndarray) -> None:
        """Count a frame.

        Args:
            planes: Mask by colour, uint8 (colour, height, width).
            position: Joint positions, (dof,).
            links: True for the links whose place is known, (dof,).
        """
        _note(planes, self._view, self._rig, position, links, self._hits, self._shows)

    def hidden(self) -> np.ndarray:
        """Return the pixels behind occluders, bool (height, width)."""
        import cv2

        cells = (self._hits >= LEAST_HITS) & (self._hits >= HITS_A_SHOW * self._shows)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(cells.astype(np.uint8), connectivity=8)
        large = stats[:, cv2.CC_STAT_AREA] >= LEAST_CELLS
        large[0] = False
        cells = large[np.asarray(labels, dtype=np.intp)].astype(np.uint8)
        # the outline's own margin was not counted: one cell more to every side, and what lies between cells
        cells = cv2.dilate(cells, np.ones((3, 3), np.uint8))
        height, width = self._view.trust.shape[1:]
        return np.kron(cells, np.ones((CELL_PX, CELL_PX), np.uint8))[:height, :width] > 0


def without(view: View, hidden: np.ndarray) -> View:
    """Return a view in which some pixels carry no information.

    Args:
        view: How the planes of the masks are to be read.
        hidden: True for these pixels, bool (height, width).

    Returns:
        The view.
    """
    return view._replace(trust=np.where(hidden, np.float32(0.0), view.trust))


@njit(cache=True)
def _note(
    planes: np.ndarray,
    view: View,
    rig: Rig,
    position: np.ndarray,
    links: np.ndarray,
    hits: np.ndarray,
    shows: np.ndarray,
) -> None:
    """Do the work of ``Occluders.note``; ``hits`` and ``shows`` (row, column) are cells."""
    outlines = blank_outlines(rig, rig.radius.shape[0])
    if not draw(rig, position, outlines):
        return
    for g in range(rig.radius.shape[0]):
        if not links[rig.link[g]] or view.part[g] < 0 or outlines.first[g + 1] - outlines.first[g] < 3:
            continue
        left, right, top, bottom = _box(outlines, g, hits.shape)
        plane, trust = planes[view.part[g]], view.trust[view.part[g]]
        for row in range(top, bottom):
            for column in range(left, right):
                x, y = column * CELL_PX, row * CELL_PX
                if trust[y, x] < TRUSTED or not _within(outlines, g, float(x), float(y)):
                    continue
                if plane[y, x] < EMPTY:
                    hits[row, column] += 1
                elif plane[y, x] > SHOWN:
                    shows[row, column] += 1


@njit(cache=True)
def _box(outlines: Outlines, g: int, shape: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return the first column of cells within a geom's outline, the one past the last, and such rows."""
    low_x, high_x, low_y, high_y = 1e9, -1e9, 1e9, -1e9
    for i in range(outlines.first[g], outlines.first[g + 1]):
        x, y = outlines.px[outlines.hull[i], 0], outlines.px[outlines.hull[i], 1]
        low_x, high_x, low_y, high_y = min(low_x, x), max(high_x, x), min(low_y, y), max(high_y, y)
    left, top = max(0, math.ceil(low_x / CELL_PX)), max(0, math.ceil(low_y / CELL_PX))
    right = min(shape[1], math.floor(high_x / CELL_PX) + 1)
    return left, right, top, min(shape[0], math.floor(high_y / CELL_PX) + 1)


@njit(cache=True)
def _within(outlines: Outlines, g: int, x: float, y: float) -> bool:
    """Return whether a pixel lies well inside of a geom's convex outline."""
    px, a, b = outlines.px, outlines.first[g], outlines.first[g + 1]
    for i in range(a, b):
        p = outlines.hull[i]
        q = outlines.hull[i + 1] if i + 1 < b else outlines.hull[a]
        ex, ey = px[q, 0] - px[p, 0], px[q, 1] - px[p, 1]
        length = math.sqrt(ex * ex + ey * ey)
        # the hull turns so that (ey, -ex) points outwards
        if (x - px[p, 0]) * ey - (y - px[p, 1]) * ex > -WITHIN_PX * length:
            return False
    return True
