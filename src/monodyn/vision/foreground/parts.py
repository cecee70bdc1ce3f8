"""From thumbnails to the parts of the picture that move apart from one another.

The one idea: a mechanism covers about the same area in every frame and sweeps one connected place. Another
pane, a clock, a person at the edge move in places of their own. Which part holds the mechanism only the
mechanism decides; here the parts are put in the order in which they are worth trying.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monodyn.vision.foreground.thumbnails import Thumbnails, Window

SPECK_CELLS = 6
"""Moving cells of the thumbnails below which a place is a flicker of the codec."""
LEAST_PART = 0.03
"""Share of all moving cells below which a place is no part of its own."""


@dataclass(frozen=True, eq=False)
class Parts:
    """Places that move, apart from one another.

    Attributes:
        labels: Number of the part of each cell of the thumbnails, from 1, the likeliest mechanism first; 0
            where nothing moves, int (height, width).
        count: Number of the parts.
        size: Width and height of the clip's pictures [px].
    """

    labels: np.ndarray
    count: int
    size: tuple[int, int]

    def window(self, chosen: Sequence[int]) -> Window:
        """Return the rectangle around some of the parts.

        Args:
            chosen: Their numbers.
        """
        return window_around(np.isin(self.labels, chosen), self.size)

    def others(self, chosen: Sequence[int]) -> np.ndarray:
        """Return where the other parts move, bool (height, width).

        Args:
            chosen: Numbers of the parts that are kept.
        """
        import cv2

        cells = ~np.isin(self.labels, [0, *chosen])
        # an edge that moves shows a little in the cells around
        cells = cv2.dilate(cells.astype(np.uint8), np.ones((3, 3), np.uint8))
        cells[np.isin(self.labels, chosen)] = 0
        return cv2.resize(cells, self.size, interpolation=cv2.INTER_NEAREST) > 0


def moving_parts(thumbnails: Thumbnails, samples: Sequence[int], size: tuple[int, int]) -> Parts | None:
    """Find the parts of the picture that move apart from one another.

    Args:
        thumbnails: All frames of the scene.
        samples: Numbers of frames at equal steps of the motion.
        size: Width and height of the clip's pictures [px].

    Returns:
        The parts, or None where there is only one.
    """
    import cv2

    moves = _changing_cells(thumbnails)
    count, labels, *_ = cv2.connectedComponentsWithStats(
        cv2.dilate(moves.astype(np.uint8), np.ones((3, 3), np.uint8)), connectivity=8
    )
    labels = np.where(moves, labels, 0)
    swept = np.bincount(labels.ravel(), minlength=count)
    large = [k for k in range(1, count) if swept[k] >= max(SPECK_CELLS, LEAST_PART * np.sum(moves))]
    if len(large) < 2:
        return None
    planes = thumbnails.planes[np.searchsorted(thumbnails.number, samples)].astype(np.int16)
    usual = np.median(planes, axis=0)
    foreground = np.any(np.abs(planes - usual) > thumbnails.still, axis=1)
    area = np.array([foreground[:, labels == k].sum(axis=1) for k in large], dtype=np.float64)
    # a mechanism shows in every frame and covers about as much in each; a curve grows, a bar changes
    steady = area.mean(axis=1) ** 2 / np.maximum(area.std(axis=1), 0.05 * area.mean(axis=1) + 1e-9)
    order = np.argsort(-steady, kind="stable")
    ranked = np.zeros(count, dtype=np.int64)
    ranked[[large[k] for k in order]] = np.arange(1, len(large) + 1)
    return Parts(ranked[labels], len(large), size)


def window_around(cells: np.ndarray, size: tuple[int, int]) -> Window:
    """Return the rectangle around cells of the thumbnails, with a margin; without any the picture.

    Args:
        cells: The cells, bool (row, column).
        size: Width and height of the clip's pictures [px].
    """
    width, height = size
    rows, columns = np.nonzero(cells.any(axis=1))[0], np.nonzero(cells.any(axis=0))[0]
    if not len(rows):
        return Window(0, height, 0, width)
    scale_y, scale_x = height / cells.shape[0], width / cells.shape[1]
    margin = max(16, height // 24)
    return Window(
        max(0, int(rows[0] * scale_y) - margin),
        min(height, int((rows[-1] + 1) * scale_y) + margin),
        max(0, int(columns[0] * scale_x) - margin),
        min(width, int((columns[-1] + 1) * scale_x) + margin),
    )


def moving_cells(thumbnails: Thumbnails) -> np.ndarray:
    """Return where anything moves, lone cells aside, bool (height, width).

    Args:
        thumbnails: All frames of the scene.
    """
    import cv2

    # a lone cell is a flicker of the codec; label 0 is what does not move
    _, labels, stats, _ = cv2.connectedComponentsWithStats(
        _changing_cells(thumbnails).astype(np.uint8), connectivity=8
    )
    large = stats[:, cv2.CC_STAT_AREA] >= SPECK_CELLS
    large[0] = False
    return large[np.asarray(labels, dtype=np.intp)]


def moving_outside(thumbnails: Thumbnails, window: Window, size: tuple[int, int]) -> np.ndarray | None:
    """Return where anything moves outside of a rectangle, bool (height, width), or None where nothing does.

    Args:
        thumbnails: All frames of the scene.
        window: The rectangle.
        size: Width and height of the clip's pictures [px].
    """
    import cv2

    # an edge that moves shows a little in the cells around
    cells = cv2.dilate(moving_cells(thumbnails).astype(np.uint8), np.ones((3, 3), np.uint8))
    moves = cv2.resize(cells, size, interpolation=cv2.INTER_NEAREST) > 0
    moves[window.top : window.bottom, window.left : window.right] = False
    return moves if moves.any() else None


def _changing_cells(thumbnails: Thumbnails) -> np.ndarray:
    """Return where the thumbnails change by more than noise, bool (height, width)."""
    return np.any(thumbnails.ranges > thumbnails.still, axis=0)
