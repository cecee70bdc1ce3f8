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
from monodyn.uncounted import UNCOUNTED
from monodyn.vision.drawing.probe import OUT_AT, OUT_X, OUT_Y, TRUSTED, Normal, meets, outline_lines
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.drawing.silhouette import Outlines, blank_outlines, draw
from monodyn.vision.foreground.masks import BACK, View

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
        return (cells > 0).repeat(CELL_PX, axis=0).repeat(CELL_PX, axis=1)[:height, :width]


def without(view: View, hidden: np.ndarray) -> View:
    """Return a view in which some pixels carry no information.

    Args:
        view: How the planes of the masks are to be read.
        hidden: True for these pixels, bool (height, width).

    Returns:
        The view.
    """
    return view._replace(trust=np.where(hidden, np.float32(0.0), view.trust))


@njit(cache=True, nogil=True)
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
    first = outlines.first
    lines = outline_lines(outlines.px, outlines.hull, first)
    for g in range(rig.radius.shape[0]):
        if not links[rig.link[g]] or view.part[g] < 0 or first[g + 1] - first[g] < 3:
            continue
        top, bottom = _rows(outlines, g, hits.shape[0])
        plane, trust = planes[view.part[g]], view.trust[view.part[g]]
        for row in range(top, bottom):
            y = row * CELL_PX
            low, high = _columns(lines, first[g], first[g + 1], float(y), (hits.shape[1] - 1) * CELL_PX)
            for column in range(math.ceil(low / CELL_PX), math.floor(high / CELL_PX) + 1):
                x = column * CELL_PX
                here = Normal(float(x), float(y), 0.0, 0.0)
                if trust[y, x] < TRUSTED or meets(lines, first, view.order, g, here, 0.0, BACK):
                    continue
                if plane[y, x] < EMPTY:
                    hits[row, column] += 1
                elif plane[y, x] > SHOWN:
                    shows[row, column] += 1


@njit(cache=True, **UNCOUNTED)
def _rows(outlines: Outlines, g: int, rows: int) -> tuple[int, int]:
    """Return the first row of cells within a geom's outline and the one past the last."""
    low, high = 1e9, -1e9
    for i in range(outlines.first[g], outlines.first[g + 1]):
        y = outlines.px[outlines.hull[i], 1]
        low, high = min(low, y), max(high, y)
    return max(0, math.ceil(low / CELL_PX)), min(rows, math.floor(high / CELL_PX) + 1)


@njit(cache=True, **UNCOUNTED)
def _columns(lines: np.ndarray, a: int, b: int, y: float, last: float) -> tuple[float, float]:
    """Return the first and the last place of a row, from 0 to ``last``, that lie well inside of the convex
    outline ``lines[a:b]``, the second less than the first where none does."""
    low, high = 0.0, last
    for i in range(a, b):
        # well inside of this edge is where ``along x <= room``
        along, room = lines[i, OUT_X], lines[i, OUT_AT] - WITHIN_PX - lines[i, OUT_Y] * y
        if along > 1e-12:
            high = min(high, room / along)
        elif along < -1e-12:
            low = max(low, room / along)
        elif room < 0.0:
            return 0.0, -1.0
    return low, high
