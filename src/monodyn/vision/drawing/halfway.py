"""numba kernel: where the coverage along a normal passes half of its level.

``normals`` takes an edge from the area under the coverage. Where the blur is symmetric, and the colours of
figure and ground are right, the area and half of the level give the same place; otherwise they are apart.
"""

# elements of typed arrays are arrays to the type checker and numbers to numba
# pyright: reportArgumentType=false
from __future__ import annotations

import math

import numpy as np
from numba import njit

from monodyn.types import FULL
from monodyn.uncounted import INLINED
from monodyn.vision.drawing import probe
from monodyn.vision.foreground.masks import View


@njit(cache=True)
def half_ways(planes: np.ndarray, view: View, samples: np.ndarray, reach: float) -> np.ndarray:
    """Return how far outwards of the outline the coverage passes half of its level, at each sample.

    Args:
        planes: Mask by colour, uint8 (colour, height, width).
        view: How its planes are to be read.
        samples: What was found along the outline, (sample, column), from ``edge_samples``.
        reach: Length of the search outwards [px].

    Returns:
        The passage next to the edge that was found, (sample,) [px]; NaN where there is none, and where only a
        border of the geom shows, whose profile has no level of its own.
    """
    found = np.full(samples.shape[0], np.nan)
    for s in range(samples.shape[0]):
        if samples[s, probe.BORDER] > 0.0:
            continue
        g, inner, away = int(samples[s, probe.GEOM]), samples[s, probe.INNER], samples[s, probe.AWAY]
        coverage = planes[view.part[g]]
        level = float(FULL)
        if view.shaded[g] and inner >= probe.FLAT_PX:
            own = _level_inside(coverage, samples[s], inner)
            level = own if own > probe.LEAST_LEVEL * FULL else level
        steps = max(2, math.ceil((inner + reach) / probe.STEP_PX))
        step = (inner + reach) / steps
        before = 0.0
        for k in range(steps + 1):
            t = -inner + k * step
            now = _coverage(coverage, samples[s], t) - 0.5 * level
            if k > 0 and before >= 0.0 > now:
                place = t - step * now / (now - before)
                if not abs(place - away) >= abs(found[s] - away):
                    found[s] = place
            before = now
    return found


@njit(cache=True, **INLINED)
def _coverage(coverage: np.ndarray, sample: np.ndarray, t: float) -> float:
    """Return the coverage, ``FULL`` at most, at a distance outwards of a sample (column,) [px]."""
    x, y = sample[probe.AT_X] + t * sample[probe.NORMAL_X], sample[probe.AT_Y] + t * sample[probe.NORMAL_Y]
    return min(probe.bilinear(coverage, x, y), float(FULL))


@njit(cache=True, **INLINED)
def _level_inside(coverage: np.ndarray, sample: np.ndarray, inner: float) -> float:
    """Return the mean coverage inside of a sample (column,), where blur leaves it alone."""
    total, count = 0.0, 0
    t = -inner
    while t < -0.6 * inner:
        total += _coverage(coverage, sample, t)
        count += 1
        t += probe.STEP_PX
    return total / count
