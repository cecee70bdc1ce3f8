"""How a picture is exposed while the mechanism moves.

A row of the picture collects light for a while, over which what moves is blurred, and a rolling shutter
exposes one row after the other. Both move a place of the outline along its path; the motion from picture to
picture is known once the clip has been followed.
"""

# elements of typed arrays are arrays to the type checker and numbers to numba
# pyright: reportArgumentType=false
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from monodyn.vision.drawing.camera import CENTRE_Y
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.drawing.silhouette import Outlines, blank_outlines, draw, project

BEGIN_X, BEGIN_Y, END_X, END_Y, DURING_X, DURING_Y, WHEN = range(7)
"""Columns of a moving outline point: where it is at the beginning and at the end of its row's exposure,
against the middle [px]; how far it moves between the exposures of the first row and of the last [px]; and
when its own row is exposed, -0.5 to 0.5."""
SWEPT_COLUMNS = WHEN + 1
"""Number of these columns."""
SLOW_PX = 2.0
"""Way while a picture is exposed up to which the inside of an outline shows its colour [px]."""


@dataclass(frozen=True, eq=False)
class Shutter:
    """How each picture is exposed, and the motion meanwhile.

    Attributes:
        exposure: How long a row of the picture is exposed [s].
        std: Standard deviation of the exposure [s]; 0 where it was given.
        readout: From the exposure of the first row to that of the last [s]; negative where the last is first.
        position: Joint positions in the middle of each picture's exposure [rad; m in the start scale], NaN
            where the motion is not known, (frame, dof).
        rate: Their rates, 0 where the motion is not known [rad/s or m/s], (frame, dof).
        acceleration: And their accelerations [rad/s^2 or m/s^2], (frame, dof).
    """

    exposure: float
    std: float
    readout: float
    position: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray

    def of(self, rig: Rig, frame: int) -> Rig:
        """Return a mechanism as it moves during the exposure of a picture; beyond the last one it is still.

        Args:
            rig: The mechanism.
            frame: Row of the picture.
        """
        if frame >= len(self.rate):
            return rig
        rate, half = self.rate[frame], self.acceleration[frame] / 8.0
        return rig._replace(
            sweep=self.exposure * rate, skew=self.readout * rate,
            bend=self.exposure**2 * half, lean=self.readout**2 * half,
        )  # fmt: skip

    def during(self, frame: int, position: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return the poses at some times of a picture's exposure, (time, dof).

        Args:
            frame: Row of the picture.
            position: The pose in its middle [rad or m], (dof,).
            times: Times from there on [s], (time,).
        """
        t = times[:, np.newaxis]
        return position + t * (self.rate[frame] + 0.5 * t * self.acceleration[frame])

    def only(self, frames: Sequence[int] | np.ndarray, scale: np.ndarray | float = 1.0) -> Shutter:
        """Return the rows of some pictures, with each joint in another unit.

        Args:
            frames: Their rows, (picture,).
            scale: By what each joint is multiplied, (dof,).
        """
        rows = np.asarray(frames, dtype=np.int64)
        return replace(
            self, position=self.position[rows] * scale, rate=self.rate[rows] * scale,
            acceleration=self.acceleration[rows] * scale,
        )  # fmt: skip

    @property
    def span(self) -> float:
        """From the beginning of the first row's exposure to the end of the last row's [s]."""
        return self.exposure + abs(self.readout)


@njit(cache=True)
def swept_points(rig: Rig, position: np.ndarray, outlines: Outlines) -> np.ndarray:
    """Return how far each outline point moves while a picture is exposed.

    Args:
        rig: The mechanism and its camera.
        position: Joint positions in the middle of the exposure [rad or m], (dof,).
        outlines: The outlines there.

    Returns:
        Where each point is at the beginning of its row's exposure and at its end, against the middle; how far
        it moves from the first row's exposure to the last's [px]; and when its row is exposed, as a share of
        that time, in the columns named above, (outline point, column); (0, column) where nothing moves.
    """
    moves, skewed = False, False
    for j in range(rig.sweep.shape[0]):
        skewed = skewed or rig.skew[j] != 0.0
        moves = moves or skewed or rig.sweep[j] != 0.0
    if not moves:
        return np.empty((0, SWEPT_COLUMNS))
    swept = np.zeros((outlines.px.shape[0], SWEPT_COLUMNS))
    before, after = np.empty_like(outlines.px), np.empty_like(outlines.px)
    drawn = project(rig, position - 0.5 * rig.sweep + rig.bend, before)
    if drawn and project(rig, position + 0.5 * rig.sweep + rig.bend, after):
        swept[:, :2] = before - outlines.px
        swept[:, 2:4] = after - outlines.px
    if skewed:
        drawn = project(rig, position - 0.5 * rig.skew + rig.lean, before)
        if drawn and project(rig, position + 0.5 * rig.skew + rig.lean, after):
            swept[:, DURING_X] = after[:, 0] - before[:, 0]
            swept[:, DURING_Y] = after[:, 1] - before[:, 1]
            middle = rig.camera[CENTRE_Y]
            swept[:, WHEN] = 0.5 * (outlines.px[:, 1] - middle) / middle
    return swept


def way(rig: Rig, position: np.ndarray) -> float:
    """Return how far the outline of a pose moves at most while a picture is exposed.

    Args:
        rig: The mechanism, its camera, and its sweep.
        position: Joint positions in the middle of the exposure [rad or m], (dof,).

    Returns:
        The way [px]; 0 where the pose cannot be drawn.
    """
    outlines = blank_outlines(rig, len(rig.radius))
    if not draw(rig, position, outlines):
        return 0.0
    path = swept_points(rig, position, outlines)
    return float(np.hypot(*(path[:, 2:4] - path[:, :2]).T).max(initial=0.0))
