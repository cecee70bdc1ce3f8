"""numba kernels: a picture aligned with a key picture of the same scene, by the grey levels at its edges.

Inverse compositional alignment (Gauss-Newton with the gradients of the key picture) over points of strong
gradient, spread evenly over the picture, from coarse to fine. The one idea: what a point is worth is limited
by how far off an edge may be, not by its contrast, and a point that is off by more does not count. So a dark
mechanism does not outweigh a pale wall, and wherever it moves it drops out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.solving import inverted, product, solved
from monodyn.vision.clip.homography import Homography
from monodyn.vision.registration.keypicture import BLOCKS, LEAST_BLOCKS, LEAST_POINTS, Key, Level, halfway

ROUNDS = 8
"""Iterations at each size of the picture, at most."""
WIDE = 2
"""The first of them, in which every edge may be far off."""
SETTLED_PX = 1e-2
"""Displacement below which the alignment has settled [px of the level]."""
OFF_PX, OFF_COARSE_PX = 0.15, 0.6
"""How far off an edge of the still scene may be at the finest size and at the others [px of the level]."""
CUTOFF = 3.0
"""Times that, beyond which a point does not count."""
UNKNOWNS = 8
"""Displacement to the right and down, zoom, turn, perspective across and down, gain and offset."""
GAIN = 6
"""The gain among them."""
OUTSIDE = -1.0
"""Weight of a point that a picture does not show."""
BENT = 4
"""The first of the two of perspective."""
BENDING, BENDING_PX = 0.1, 0.05
"""Standard deviation of the perspective before the picture is looked at, as what it makes halfway to a
corner: as a share of the displacement, as a turn of a usual camera has it, and least [px]."""
LEAST_AGREEING = 0.4
"""Share of the points that must agree."""
MORE_ALIKE = 0.7
"""Median difference from the key picture in one place over that in another, below which a picture is clearly
more alike in the first."""
MOST_STD = 1.0
"""Standard deviation of a displacement above which it is not known [px]."""


class Alignment(NamedTuple):
    """How a picture lies on a key picture.

    Attributes:
        at: Map from the key picture to the picture.
        agreeing: Share of the points within the picture that agree.
        within: Share of the points that are within the picture.
        blocks: Number of blocks that hold it.
        std: Standard deviation of a displacement, by leaving out each block once [px]; infinite without hold.
    """

    at: Homography
    agreeing: float
    within: float
    blocks: int
    std: float

    @property
    def known(self) -> bool:
        """Whether the picture shows the scene of the key picture there."""
        return self.std <= MOST_STD and self.agreeing >= LEAST_AGREEING and self.blocks >= LEAST_BLOCKS


def align(pictures: Sequence[np.ndarray], key: Key, start: Homography) -> Alignment:
    """Find where the scene of a key picture appears in a picture.

    Args:
        pictures: From ``pyramid``, each uint8 (height, width).
        key: The key picture.
        start: Map from the key picture to the picture, to start from.

    Returns:
        The map, and how well it is known.
    """
    entries, light = start.entries.copy(), np.array([1.0, 0.0])
    residuals = weights = np.zeros(0)
    for picture, level in zip(pictures, key.levels, strict=True):
        off = OFF_PX if level is key.levels[-1] else OFF_COARSE_PX
        residuals, weights = _align(picture, level, start.middle, off, entries, light)
    normal, right, counts = _by_block(key.levels[-1], residuals, weights)
    at = Homography(entries / entries[2, 2], start.size)
    agreeing, within = counts.sum(axis=0).tolist()
    share, overlap = agreeing / max(within, 1.0), within / max(len(key.levels[-1].block), 1)
    held = int(np.sum(counts[:, 0] >= LEAST_POINTS))
    bending = BENDING * float(np.hypot(*at.shift)) + BENDING_PX
    return Alignment(at, share, overlap, held, _spread(normal, right, bending))


def more_alike_blocks(picture: np.ndarray, level: Level, found: Homography, before: Homography) -> int:
    """Count the blocks where a picture matches the key picture clearly better in one place than in another.

    Only points that are within the picture in both places, and whose grey level the displacement between the
    places changes by more than the noise, can distinguish them: a displacement along an edge changes nothing.

    Args:
        picture: A picture at the size of the level, uint8 (height, width).
        level: Points of the key picture.
        found: Map from the key picture to the picture that should match better.
        before: The map with which it is compared.

    Returns:
        Number of blocks in which the median difference with ``found`` is less than ``MORE_ALIKE`` times that
        with ``before``.
    """
    places = [at.of(level.points[:2].T + at.middle) for at in (found, before)]
    last = level.scale * (np.array(picture.shape[::-1]) - 1.0)
    within = np.all([(place >= 0.0) & (place <= last) for place in places], axis=(0, 2))
    change = np.abs(np.sum(level.points[3:5] * (places[0] - places[1]).T, axis=0))
    counted = within & (change > level.noise)
    with_found, with_before = (_differences(picture, level, place, within) for place in places)
    blocks = 0
    for block in np.unique(level.block[counted]):
        own = counted & (level.block == block)
        if np.sum(own) >= LEAST_POINTS:
            blocks += bool(np.median(with_found[own]) < MORE_ALIKE * np.median(with_before[own]))
    return blocks


def _differences(picture: np.ndarray, level: Level, places: np.ndarray, within: np.ndarray) -> np.ndarray:
    """Return the absolute difference of the picture from each point [grey levels], (point,).

    Args:
        picture: A picture at the size of the level, uint8 (height, width).
        level: The points.
        places: Where they appear in the picture [px of the clip], (point, 2).
        within: Whether they are within the picture, (point,); the brightness is adapted to theirs.
    """
    import cv2

    mapped = (places / level.scale).astype(np.float32)[:, np.newaxis]
    shown = cv2.remap(picture, mapped, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # pyright: ignore
    difference = shown[:, 0].astype(np.float64) - level.points[2]
    return np.abs(difference - (np.median(difference[within]) if within.any() else 0.0))


@njit(cache=True, error_model="numpy")
def _spread(normal: np.ndarray, right: np.ndarray, bending: float) -> float:
    """Return the standard deviation of a displacement [px], by leaving out each block once.

    Args:
        normal: Normal matrix of each block, (block, unknown, unknown).
        right: Right side of each, (block, unknown).
        bending: Standard deviation of the perspective before the picture is looked at [px].

    Source:
        The delete-one-group jackknife: Shao and Tu, "The Jackknife and Bootstrap", 1995.
    """
    whole, total = normal.sum(axis=0), right.sum(axis=0)
    for j in range(UNKNOWNS):
        whole[j, j] += 1e-9
    for j in range(BENT, BENT + 2):
        whole[j, j] += 1.0 / bending**2
    count, spread, noise = 0, 0.0, 0.0
    for b in range(len(normal)):
        if normal[b, 0, 0] + normal[b, 1, 1] > 0.0:
            inverse = inverted(whole - normal[b])
            step = product(inverse, total - right[b])
            # zoom and turn count as what they do halfway to a corner, perspective, which hardly shows in the
            # middle, does not; what is left without the most important block must determine the
            # displacement too
            spread += np.sum(step[:4] ** 2)
            noise = max(noise, inverse[0, 0] + inverse[1, 1] + inverse[2, 2] + inverse[3, 3])
            count += 1
    variance = spread * (count - 1) / max(count, 1) + noise
    return math.sqrt(variance) if count >= 3 and 0.0 < variance < math.inf else math.inf


@njit(cache=True, fastmath=True, error_model="numpy")
def _align(
    picture: np.ndarray,
    level: Level,
    middle: np.ndarray,
    off: float,
    entries: np.ndarray,
    light: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Change the map ``entries`` (3, 3) and the light (gain, offset) until the picture agrees.

    Returns the last residuals and weights, (point,) each, as ``_compare`` fills them.
    """
    scale, count = level.scale, level.points.shape[1]
    reach = halfway(middle)
    residuals, weights = np.empty(count), np.empty(count)
    change = np.zeros((3, 3))
    for done in range(ROUNDS):
        # what is off at first may only not have been met yet
        far = off if done >= WIDE else max(off, OFF_COARSE_PX)
        agreeing = _compare(picture, level, middle, far, entries, light, residuals, weights)
        if agreeing < 2 * UNKNOWNS:
            break
        whole, g = _normal(level.rows, residuals, weights, 0, count)
        for j in range(UNKNOWNS):
            whole[j, j] += 1e-9 + 1e-6 * whole[j, j]
        # only a turn makes perspective, and it displaces: the few edges of a bare wall say little of it
        bending = BENDING * math.sqrt(entries[0, 2] ** 2 + entries[1, 2] ** 2) + BENDING_PX
        for j in range(2):
            bent = -entries[2, j] * reach * reach
            whole[BENT + j, BENT + j] += 1.0 / bending**2
            g[BENT + j] += bent / bending**2
        step = solved(whole, g)
        # The picture shows at W(z) what the key picture shows at z moved by the step: W is taken back by it.
        change[0, 0] = change[1, 1] = 1.0 + step[2] / reach
        change[1, 0], change[0, 1] = step[3] / reach, -step[3] / reach
        change[0, 2], change[1, 2] = step[0], step[1]
        change[2, 0], change[2, 1] = -step[4] / reach**2, -step[5] / reach**2
        change[2, 2] = 1.0
        back = inverted(change)
        for j in range(3):
            entries[j] = product(back.T, entries[j])
        entries[:] = entries / entries[2, 2]
        light[0] += step[6]
        light[1] += step[7]
        moved = np.abs(step[:6]).sum()
        if far == off and moved < SETTLED_PX * scale:
            break
    return residuals, weights


@njit(cache=True, fastmath=True, error_model="numpy")
def _compare(
    picture: np.ndarray,
    level: Level,
    middle: np.ndarray,
    far: float,
    entries: np.ndarray,
    light: np.ndarray,
    residuals: np.ndarray,
    weights: np.ndarray,
) -> int:
    """Return how many points agree with the picture.

    ``residuals`` (point,) [grey levels] and ``weights`` (point,) are filled; a weight is 0 where a point does
    not agree, and ``OUTSIDE`` where the picture does not show it.
    """
    height, width = picture.shape
    scale, h = level.scale, entries
    x, y, grey, gx, gy = level.points
    over = level.rows[GAIN]
    from_x, from_y = middle[0] / scale, middle[1] / scale
    right, down = np.empty_like(x), np.empty_like(x)
    for i in range(len(x)):
        z = 1.0 / ((h[2, 0] * x[i] + h[2, 1] * y[i] + h[2, 2]) * scale)
        right[i] = (h[0, 0] * x[i] + h[0, 1] * y[i] + h[0, 2]) * z + from_x
        down[i] = (h[1, 0] * x[i] + h[1, 1] * y[i] + h[1, 2]) * z + from_y
    for i in range(len(x)):
        u, v = right[i], down[i]
        residuals[i], weights[i] = 0.0, OUTSIDE
        if u >= 0.0 and v >= 0.0 and u < width - 1.001 and v < height - 1.001:
            iu, iv = int(u), int(v)
            fu, fv = u - iu, v - iv
            top = (1.0 - fu) * picture[iv, iu] + fu * picture[iv, iu + 1]
            low = (1.0 - fu) * picture[iv + 1, iu] + fu * picture[iv + 1, iu + 1]
            residuals[i] = (1.0 - fv) * top + fv * low - grey[i] - (light[0] - 1.0) * over[i] - light[1]
            weights[i] = 1.0
    agreeing = 0
    for i in range(len(x)):
        slack = level.noise**2 + (far * scale) ** 2 * (gx[i] * gx[i] + gy[i] * gy[i])
        share = max(0.0, 1.0 - residuals[i] * residuals[i] / (slack * CUTOFF**2))
        if weights[i] > 0.0:
            weights[i] = share * share / slack
            agreeing += share > 0.0
    return agreeing


@njit(cache=True, fastmath=True, error_model="numpy")
def _normal(
    rows: np.ndarray, residuals: np.ndarray, weights: np.ndarray, first: int, end: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal matrix (unknown, unknown) and the right side (unknown,) of some points."""
    normal, right = np.empty((UNKNOWNS, UNKNOWNS)), np.empty(UNKNOWNS)
    counted, off = np.maximum(weights[first:end], 0.0), residuals[first:end]
    weighted = np.empty_like(counted)
    # parts counted from 0 on: an index that may be negative would keep the sums from going many at a time
    for j in range(UNKNOWNS):
        one, total = rows[j, first:end], 0.0
        for i in range(len(counted)):
            weighted[i] = counted[i] * one[i]
            total += weighted[i] * off[i]
        right[j] = total
        for k in range(j + 1):
            other, total = rows[k, first:end], 0.0
            for i in range(len(counted)):
                total += weighted[i] * other[i]
            normal[j, k] = normal[k, j] = total
    return normal, right


@njit(cache=True, fastmath=True, error_model="numpy")
def _by_block(
    level: Level, residuals: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the normal equations of each block, (block, unknown, unknown) and (block, unknown), and how many
    points agree and are within the picture, (block, 2)."""
    blocks, end = BLOCKS[0] * BLOCKS[1], 0
    normal, right = np.empty((blocks, UNKNOWNS, UNKNOWNS)), np.empty((blocks, UNKNOWNS))
    counts = np.zeros((blocks, 2))
    for b in range(blocks):
        first = end
        while end < len(weights) and level.block[end] == b:
            counts[b, 0] += weights[end] > 0.0
            counts[b, 1] += weights[end] != OUTSIDE
            end += 1
        normal[b], right[b] = _normal(level.rows, residuals, weights, first, end)
    return normal, right, counts
