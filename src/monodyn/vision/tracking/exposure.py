"""How long each picture is exposed, from the blur that motion leaves in it.

Along a normal of the outline a sharp picture falls from covered to not covered in a step, a blurred one over
the way that the outline goes while the picture is exposed. The poses give the way in a whole interval between
two frames; the share of it that explains the pictures best is the exposure.
"""

# elements of typed arrays are arrays to the type checker and numbers to numba
# pyright: reportArgumentType=false
from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from monodyn.arrays import usual_step
from monodyn.cores import on_all_cores
from monodyn.types import FULL, Poses
from monodyn.uncounted import UNCOUNTED
from monodyn.vision.drawing import probe
from monodyn.vision.drawing.blurred import covered_part, times_of
from monodyn.vision.drawing.edges import MOST_SAMPLES
from monodyn.vision.drawing.normals import edge_samples
from monodyn.vision.drawing.rig import Rig, rig_of
from monodyn.vision.drawing.shutter import SWEPT_COLUMNS, Shutter, swept_points, way
from monodyn.vision.drawing.silhouette import blank_outlines, draw
from monodyn.vision.foreground.masks import View, planes_for
from monodyn.vision.locating.scene import Scene

FRAMES = 12
"""Frames of the fastest motion from which the exposure is estimated."""
SHARES = 14
"""Shares of the interval between two frames that are tried."""
LARGEST_SHARE = 1.3
"""The largest of them: blur of more than an interval is none of an exposure."""
ROUNDED = 1.05
"""By how much an exposure may exceed the time between two pictures, both being rounded."""
CLEARER = 1.25
"""A blurred outline has to explain the pictures better than a sharp one by this factor."""
LEAST_BLUR_PX = 4.0
"""Blur of the fastest frames below which pictures count as sharp [px]."""
LEAST_STD = 0.03
"""Least standard deviation of the exposure, as a share of it: what errors of sizes and rates leave."""
LEAST_FRAMES = 4
"""Frames of fast motion below which the exposure is not estimated."""
LEAST_ROWS = 4
"""Measured frames from which the motion between them is known."""
REACH_PX = 5.0
"""Length of the normals beyond the blur [px]."""
SPACING_PX = 4.0
"""Distance between the outline samples [px]."""
LEAST_WAY_PX = 3.0
"""Way along the normal in a whole interval from which a sample tells something [px]."""
LEAST_SHIFTED = 0.25
"""Change of the share along a normal from which the edge's place is known."""


@dataclass(frozen=True)
class Exposure:
    """How long each picture is exposed.

    Attributes:
        seconds: The time [s]; 0 for sharp pictures.
        std: Its standard deviation [s].
    """

    seconds: float
    std: float = 0.0


SHARP = Exposure(0.0)
"""That of pictures that motion does not blur."""


def with_shutter(scene: Scene, poses: Poses, exposure: Exposure, readout: float = 0.0) -> Scene:
    """Return a scene in which every joint moves as the poses say while a picture is exposed.

    Args:
        scene: The scene.
        poses: The clip, followed in it.
        exposure: How long a picture is exposed.
        readout: From the exposure of the first row to that of the last [s].

    Returns:
        The scene with that shutter; before the first measured frame and after the last the motion is steady.
    """
    position, rate, acceleration = motion(poses)
    frames = int(poses.frame[-1]) + 1
    shape = frames, position.shape[1]
    positions, rates, accelerations = np.full(shape, np.nan), np.zeros(shape), np.zeros(shape)
    positions[poses.frame] = position
    accelerations[poses.frame] = np.nan_to_num(acceleration)
    for j, known in enumerate(np.isfinite(rate).T):
        if known.any():
            rates[:, j] = np.interp(np.arange(frames), poses.frame[known], rate[known, j])
    shutter = Shutter(exposure.seconds, exposure.std, readout, positions, rates, accelerations)
    return replace(scene, shutter=shutter)


def motion(poses: Poses) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Interpolate the motion of each joint by a cubic spline through what was measured.

    Args:
        poses: The tracked clip.

    Returns:
        Positions [rad or m], rates [rad/s or m/s] and accelerations [rad/s^2 or m/s^2] in every row, NaN
        before the first and after the last frame in which a joint was measured, each (row, dof).

    Source:
        de Boor, "A practical guide to splines", 1978, chapter IV.
    """
    position, rate, acceleration = (np.full(poses.position.shape, np.nan) for _ in range(3))
    for j in range(len(poses.joints)):
        rows = np.flatnonzero(poses.measured[:, j])
        if len(rows) < LEAST_ROWS:
            continue
        t, q = poses.time[rows], poses.position[rows, j]
        between = slice(rows[0], rows[-1] + 1)
        found = _on_spline(t, q, _slopes(t, q), poses.time[between])
        position[between, j], rate[between, j], acceleration[between, j] = found
    return position, rate, acceleration


def _on_spline(
    t: np.ndarray, q: np.ndarray, slopes: np.ndarray, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return values, slopes and curvatures at some times of the cubics between knots of known values and
    slopes."""
    i = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    step = t[i + 1] - t[i]
    u, rise = (times - t[i]) / step, q[i + 1] - q[i]
    a, b = step * slopes[i] - rise, rise - step * slopes[i + 1]
    value = q[i] + u * rise + u * (1.0 - u) * ((1.0 - u) * a + u * b)
    slope = rise + (1.0 - 2.0 * u) * ((1.0 - u) * a + u * b) + u * (1.0 - u) * (b - a)
    curvature = 2.0 * (b - 2.0 * a) - 6.0 * u * (b - a)
    return value, slope / step, curvature / step**2


@njit(cache=True)
def _slopes(t: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the slopes at the knots, (knot,), with which the cubics between them join with equal curvature;
    at both ends that of the parabola through three knots."""
    count = t.shape[0]
    slopes, share = np.zeros(count), np.zeros(count)
    step = t[1:] - t[:-1]
    chord = (q[1:] - q[:-1]) / step
    first = (chord[1] - chord[0]) / (step[0] + step[1])
    last = (chord[-1] - chord[-2]) / (step[-2] + step[-1])
    slopes[0], slopes[-1] = chord[0] - first * step[0], chord[-1] + last * step[-1]
    # Equal curvature at a knot ties its slope to those beside it; elimination of the one before, from the
    # first knot on, leaves each slope tied to the next one, and the last one is known.
    for i in range(1, count - 1):
        left, right = 1.0 / step[i - 1], 1.0 / step[i]
        pivot = 2.0 * (left + right) - left * share[i - 1]
        known = 3.0 * (left * chord[i - 1] + right * chord[i]) - left * slopes[i - 1]
        share[i], slopes[i] = right / pivot, known / pivot
    for i in range(count - 2, 0, -1):
        slopes[i] -= share[i] * slopes[i + 1]
    return slopes


def exposure_of(scene: Scene, poses: Poses) -> Exposure:
    """Estimate how long each picture is exposed.

    Args:
        scene: The scene.
        poses: The clip, followed in it.

    Returns:
        The exposure; 0 where the pictures are sharp or do not determine it.
    """
    if len(poses) < LEAST_ROWS:
        return SHARP
    step = usual_step(poses.time)
    _, rate, acceleration = motion(poses)
    whole, bend = rate * step, acceleration * step**2 / 8.0
    samples = {frame.index: frame for frame in scene.masks.samples.frames}
    rows = [row for row in range(len(poses)) if poses.frame[row] in samples and np.isfinite(whole[row]).all()]
    rows = [row for row in rows if poses.seen[row]]
    rig = rig_of(scene.mechanism, scene.camera)
    view = scene.masks.view(len(rig.radius))
    ways = [way(rig._replace(sweep=whole[row]), poses.position[row]) for row in rows]
    fastest = [rows[i] for i in np.argsort(ways)[::-1][:FRAMES] if ways[i] > LEAST_WAY_PX]
    shares = np.linspace(0.0, LARGEST_SHARE, SHARES)

    def misfits_of(row: int) -> np.ndarray:
        planes = planes_for(scene.masks.of(samples[int(poses.frame[row])]), view)
        moving, misfit = rig._replace(sweep=whole[row], bend=bend[row]), np.zeros(SHARES)
        _add_misfits(planes, view, moving, poses.position[row], shares, misfit)
        return misfit

    misfits = np.array(on_all_cores(misfits_of, fastest)).reshape(-1, SHARES)
    total = misfits.sum(axis=0)
    if len(fastest) < LEAST_FRAMES or total[0] < CLEARER * total.min():
        return SHARP
    # the jackknife: the estimates without each of the frames
    others = np.array([_best_share(shares, total - misfit) for misfit in misfits])
    spread = np.sqrt((len(others) - 1.0) / len(others) * np.sum((others - others.mean()) ** 2))
    share = _best_share(shares, total)
    # edges that are wider still are so for another reason: a size that is wrong, a codec
    if share > ROUNDED:
        return SHARP
    # what blurs no more than optics and codec soften every edge is not told from that, and does no harm
    if share * float(np.median(np.sort(ways)[::-1][: len(fastest)])) < LEAST_BLUR_PX:
        return SHARP
    share = min(share, 1.0)
    return Exposure(share * step, max(float(spread), LEAST_STD * share) * step)


def _best_share(shares: np.ndarray, misfits: np.ndarray) -> float:
    """Return where the parabola through the least misfit (share,) and its neighbours has its least value."""
    best = int(np.argmin(misfits))
    if best in (0, len(shares) - 1):
        return float(shares[best])
    left, middle, right = misfits[best - 1 : best + 2]
    shift = 0.5 * (left - right) / max(left - 2.0 * middle + right, 1e-12)
    return float(shares[best] + shift * (shares[1] - shares[0]))


@njit(cache=True, nogil=True)
def _add_misfits(
    planes: np.ndarray,
    view: View,
    rig: Rig,
    position: np.ndarray,
    shares: np.ndarray,
    misfits: np.ndarray,
) -> None:
    """Add to ``misfits`` (share,) how much of the coverage along the normals is not explained by an exposure
    of each share of the rig's sweep.

    Each profile is scaled and shifted to fit: only its width counts.
    """
    outlines = blank_outlines(rig, rig.radius.shape[0])
    if not draw(rig, position, outlines):
        return
    swept = swept_points(rig, position, outlines)
    if swept.shape[0] == 0:
        return
    px, hull, first = outlines.px, outlines.hull, outlines.first
    ends, samples = (
        np.empty((MOST_SAMPLES, probe.END_COLUMNS), dtype=np.int64),
        np.empty((MOST_SAMPLES, probe.SAMPLE_COLUMNS)),
    )
    sharp = np.empty((0, SWEPT_COLUMNS))
    count = edge_samples(planes, view, outlines, sharp, (REACH_PX, SPACING_PX), ends, samples)
    lines = probe.outline_lines(px, hull, first)
    for s in range(count):
        sample, own = samples[s], int(samples[s, probe.GEOM])
        if sample[probe.BORDER] > 0.0:
            continue
        plane, known = planes[view.part[own]], view.trust[view.part[own]]
        at = probe.Normal(
            sample[probe.AT_X], sample[probe.AT_Y], sample[probe.NORMAL_X], sample[probe.NORMAL_Y]
        )
        path = (1.0 - sample[probe.SHARE]) * swept[ends[s, probe.FROM]] + sample[probe.SHARE] * swept[
            ends[s, probe.TO]
        ]
        low, high = path[0] * at.nx + path[1] * at.ny, path[2] * at.nx + path[3] * at.ny
        low, high = min(low, high, 0.0), max(low, high, 0.0)
        if high - low < LEAST_WAY_PX:
            continue
        outer = REACH_PX + high
        inner = min(REACH_PX - low, 0.5 * probe.depth_inside(lines, first[own], first[own + 1], at))
        if _leaves(plane, at, inner, outer) or probe.least_trust(known, at, inner, outer) < probe.TRUSTED:
            continue
        begun = probe.Normal(at.x - path[0], at.y - path[1], at.nx, at.ny)
        ended = probe.Normal(at.x - path[2], at.y - path[3], at.nx, at.ny)
        covered = probe.is_covered(lines, first, view.order, own, begun, REACH_PX)
        if covered or probe.is_covered(lines, first, view.order, own, ended, REACH_PX):
            continue
        steps = math.ceil(inner + outer)
        step = (inner + outer) / steps
        shown, share = np.empty(steps + 1), np.empty(steps + 1)
        for k in range(steps + 1):
            t = -inner + k * step
            shown[k] = min(probe.bilinear(plane, at.x + t * at.nx, at.y + t * at.ny), FULL) / FULL
        for j in range(shares.shape[0]):
            way = _part_of(path, shares[j])
            share[:] = 0.0
            times = times_of(way)
            for i in range(times):
                part = covered_part(px, hull, first[own], first[own + 1], at, way, (i + 0.5) / times - 0.5)
                for k in range(steps + 1):
                    t = -inner + k * step
                    within = min(part[1], t + 0.5 * step) - max(part[0], t - 0.5 * step)
                    share[k] += max(within, 0.0) / (step * times)
            misfits[j] += _misfit(shown, share)


@njit(cache=True, inline="always")
def _part_of(path: np.ndarray, share: float) -> tuple[float, float, float, float]:
    """Return where the middle share of a path begins and ends, (column,), which is a parabola in time."""
    steady, bent = 0.5 * (path[2:4] - path[:2]), 0.5 * (path[2:4] + path[:2])
    begun, ended = share * (share * bent - steady), share * (share * bent + steady)
    return begun[0], begun[1], ended[0], ended[1]


@njit(cache=True, **UNCOUNTED)
def _leaves(plane: np.ndarray, at: probe.Normal, inner: float, outer: float) -> bool:
    """Return whether a normal leaves the picture, (height, width)."""
    height, width = plane.shape
    for t in (-inner, outer):
        x, y = at.x + t * at.nx, at.y + t * at.ny
        if not (0.0 <= x < width - 1.001 and 0.0 <= y < height - 1.001):
            return True
    return False


@njit(cache=True, **UNCOUNTED)
def _misfit(shown: np.ndarray, share: np.ndarray) -> float:
    """Return what is left of a profile, (step,), less a multiple of another one, shifted and softened."""
    count = shown.shape[0]
    gain = share[0] - share[count - 1]
    shift = 0.0
    if gain > LEAST_SHIFTED:
        shift = (np.sum(shown) - np.sum(share)) / gain
    power, product, size = 0.0, 0.0, 0.0
    for k in range(count):
        soft = 0.0
        # optics, chroma and codec soften every edge by about a pixel
        for m, weight in ((-1, 0.25), (0, 0.5), (1, 0.25)):
            place = min(max(k - shift + m, 0.0), count - 1.0)
            i = min(int(place), count - 2)
            soft += weight * (share[i] + (place - i) * (share[i + 1] - share[i]))
        power += soft * soft
        product += soft * shown[k]
        size += shown[k] * shown[k]
    return size - product * product / max(power, 1e-12)
