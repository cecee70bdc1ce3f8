"""How the camera moved, by tracked points that do not move: the pivot of the first hinge, points of the
scene.

Their common shift, and their common turn where there are several, is smoothed as far as their noise and the
unrest of the camera say, and taken out of all points. A camera that stands still moves nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LEAST_SHIFT_PX = 0.7
"""Standard deviation of a slow shift from which the camera counts as moving [px]."""
SLOW = 1.2
"""Mean square of a point's change from frame to frame over its variance, below which it shifts slowly; it is
2 for noise."""
LEAST_FRAMES = 12
"""Frames in which a point must be found to show a shift."""
ROUNDS = 5
"""Times that outliers are left out and the path is smoothed anew."""
OUTSIDE = 4.0
"""Distance from the smoothed shift from which a point does not count, in standard deviations."""
LEAST_BASE = 0.05
"""Least distance between two points that show a turn, as a share of the picture's width."""
LEAST_NOISE_PX = 0.05
"""Least noise of a point [px]."""
STIFFNESSES = tuple(10.0 ** (0.5 * k) for k in range(-4, 13))
"""Variances of the noise over that of the second differences of the camera's path that are tried."""


@dataclass(frozen=True, eq=False)
class Drift:
    """How the camera moved.

    Attributes:
        shift: Shift of the picture [px], (frame, 2).
        turn: Its turn about ``centre``, clockwise in the picture [rad], (frame,).
        centre: Point about which it turns [px], (2,).
    """

    shift: np.ndarray
    turn: np.ndarray
    centre: np.ndarray

    def at(self, row: int) -> Drift:
        """Return the motion of one frame.

        Args:
            row: Row of the frame.
        """
        one = slice(row, row + 1)
        return Drift(self.shift[one], self.turn[one], self.centre)

    def maps(self, middle: np.ndarray) -> np.ndarray:
        """Return the motion as maps of the whole picture, from a camera at rest to each frame.

        Args:
            middle: Middle of the picture [px], (2,), from which the maps count columns and rows.

        Returns:
            Homographies, (frame, 3, 3).
        """
        maps = np.zeros((len(self.turn), 3, 3))
        c, s = np.cos(self.turn), np.sin(self.turn)
        maps[:, 0, 0], maps[:, 0, 1], maps[:, 1, 0], maps[:, 1, 1], maps[:, 2, 2] = c, -s, s, c, 1.0
        maps[:, :2, 2] = self.added(np.broadcast_to(middle, (len(maps), 1, 2)))[:, 0] - middle
        return maps

    def removed(self, px: np.ndarray) -> np.ndarray:
        """Return points as the camera at rest would show them, (frame, point, 2).

        Args:
            px: Columns and rows [px], (frame, point, 2).
        """
        return self._moved(px - self.shift[:, None], -self.turn)

    def added(self, px: np.ndarray) -> np.ndarray:
        """Return points as the moving camera shows them, (frame, point, 2).

        Args:
            px: Columns and rows before the camera at rest [px], (frame, point, 2).
        """
        return self._moved(px, self.turn) + self.shift[:, None]

    def _moved(self, px: np.ndarray, turn: np.ndarray) -> np.ndarray:
        c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
        x, y = np.moveaxis(px - self.centre, 2, 0)
        return self.centre + np.stack([c * x - s * y, s * x + c * y], axis=2)


def drift_of(px: np.ndarray, width: int) -> Drift | None:
    """Find how the camera moved by points that do not move.

    Args:
        px: Such points [px], (frame, point, 2); NaN where not found.
        width: Picture width [px].

    Returns:
        The motion; None where no point shifts slowly and by more than its noise.
    """
    moving = [_slow(px[:, i]) for i in range(px.shape[1])]
    if not any(moving):
        return None
    centre = np.nanmedian(px[:, 0], axis=0)
    rest = np.nanmedian(px, axis=0)
    change = px - rest
    shift = _common(change[:, 0])
    turn = np.zeros(len(px))
    bases = rest - centre
    far = [i for i in range(1, px.shape[1]) if np.hypot(*bases[i]) > LEAST_BASE * width]
    if far:
        # further points shift by less or more where they are farther or nearer: what is square to the line to
        # them, over its length, is the turn
        turns = []
        for i in far:
            near = _nearness(shift, change[:, i])
            across = np.array([-bases[i][1], bases[i][0]]) / (bases[i] @ bases[i])
            turns.append((change[:, i] - near * shift) @ across)
        turn = _common(_mean(np.array(turns))[:, None], least=1e-6)[:, 0]
    return Drift(shift, turn, centre)


def _slow(points: np.ndarray) -> bool:
    """Return whether a point (frame, 2) shifts slowly and by more than the least."""
    rows = np.flatnonzero(np.isfinite(points).all(axis=1))
    if len(rows) < LEAST_FRAMES:
        return False
    smooth = _common(points - np.nanmedian(points, axis=0))
    clean = points[rows] - np.median(points[rows], axis=0)
    off = np.hypot(*(clean - smooth[rows]).T)
    clean = clean[off <= OUTSIDE * 1.5 * max(float(np.median(off)), LEAST_NOISE_PX)]
    variance = np.var(clean, axis=0)
    unrest = np.mean(np.diff(clean, axis=0) ** 2, axis=0)
    return bool(np.any((variance > LEAST_SHIFT_PX**2) & (unrest < SLOW * variance)))


def _mean(turns: np.ndarray) -> np.ndarray:
    """Return the mean over the points, (frame,); NaN where there is none."""
    known = np.isfinite(turns)
    return np.where(known, turns, 0.0).sum(axis=0) / np.where(known.any(axis=0), known.sum(axis=0), np.nan)


def _nearness(shift: np.ndarray, change: np.ndarray) -> float:
    """Return by how much a point shifts for the common shift, each (frame, 2), robustly."""
    known = np.isfinite(change).all(axis=1)
    kept = known
    near = 1.0
    for _ in range(ROUNDS):
        if kept.sum() < LEAST_FRAMES:
            break
        near = float(np.sum(change[kept] * shift[kept]) / max(np.sum(shift[kept] ** 2), 1e-12))
        off = np.hypot(*np.nan_to_num(change - near * shift).T)
        kept = known & (off <= OUTSIDE * max(float(np.median(off[known])), LEAST_NOISE_PX))
    return near


def _common(change: np.ndarray, least: float = LEAST_NOISE_PX) -> np.ndarray:
    """Smooth a path (frame, 2) with gaps and outliers."""
    known = np.isfinite(change).all(axis=1)
    path = np.nan_to_num(change)
    # the middle of its neighbours shows which points are outliers
    smooth = _medians(change)
    noise = 0.0
    for _ in range(ROUNDS):
        off = np.linalg.norm(path - smooth, axis=1)
        typical = noise or 1.5 * float(np.median(off[known]))
        kept = known & (off <= OUTSIDE * 1.5 * max(typical, least))
        if kept.sum() < LEAST_FRAMES:
            break
        stiffness, found = min((_evidence(path, kept, s) for s in STIFFNESSES), key=lambda pair: pair[1][0])
        noise = max(found[1], least)
        smooth = smoothed(path, kept.astype(np.float64), stiffness)
    return smooth


def _evidence(path: np.ndarray, kept: np.ndarray, stiffness: float) -> tuple[float, tuple[float, float]]:
    """Return a stiffness, minus twice the logarithm of how likely it makes the path, and the noise then.

    Source:
        Restricted maximum likelihood of y = f + e with white second differences of f.
    """
    from monodyn.solving import banded_root

    weight = kept.astype(np.float64)
    smooth = smoothed(path, weight, stiffness)
    bend = np.diff(smooth, 2, axis=0)
    squares = float(np.sum(weight[:, None] * (path - smooth) ** 2) + stiffness * np.sum(bend**2))
    free = path.shape[1] * max(int(kept.sum()) - 2, 1)
    size = 2.0 * float(np.sum(np.log(banded_root(_bands(weight, stiffness))[2])))
    bent = (len(path) - 2) * np.log(stiffness)
    return stiffness, (
        free * np.log(squares / free + 1e-30) + path.shape[1] * (size - bent),
        np.sqrt(squares / free),
    )


def _medians(change: np.ndarray, reach: int = 2) -> np.ndarray:
    """Return the median of each row and its neighbours (frame, 2), gaps filled."""
    count = len(change)
    rows = np.clip(np.arange(count)[:, None] + np.arange(-reach, reach + 1), 0, count - 1)
    near = change[rows]
    known = np.asarray(np.isfinite(near).all(axis=2)).any(axis=1)
    rough = np.zeros(change.shape)
    rough[known] = np.nanmedian(near[known], axis=1)
    numbers = np.arange(count)
    for axis in range(change.shape[1]):
        rough[:, axis] = np.interp(numbers, numbers[known], rough[known, axis])
    return rough


def smoothed(path: np.ndarray, weight: np.ndarray, stiffness: float) -> np.ndarray:
    """Minimize the squared distances from a path plus its squared second differences.

    Args:
        path: The path, (frame, 2).
        weight: Weight of each row's distance, (frame,).
        stiffness: Weight of the second differences.

    Returns:
        The smooth path, (frame, 2).
    """
    from monodyn.solving import banded_root, banded_solved

    return banded_solved(banded_root(_bands(weight, stiffness)), weight[:, None] * path)


def _bands(weight: np.ndarray, stiffness: float) -> np.ndarray:
    """Return the upper bands of the normal equations, (3, frame)."""
    count = len(weight)
    bands = np.zeros((3, count))
    # a path without any point at its ends is still determined
    bands[2] = weight + 1e-9 * weight.max()
    inner, bend = np.arange(count - 2), (1.0, -2.0, 1.0)
    for i in range(3):
        for j in range(i, 3):
            bands[2 - (j - i), inner + j] += stiffness * bend[i] * bend[j]
    return bands
