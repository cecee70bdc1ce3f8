"""numba kernels: how a mechanism has to move for its outline to lie on the edges of a mask.

The residuals are the displacements t* of the mask's edges along the normals of the outline (``normals``). A
Gauss-Newton step moves the outline by t* along its normals.
"""

# elements of typed arrays are arrays to the type checker and numbers to numba
# pyright: reportArgumentType=false
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.types import FULL
from monodyn.uncounted import INLINED, UNCOUNTED
from monodyn.vision.drawing import probe
from monodyn.vision.drawing.camera import displaced_camera
from monodyn.vision.drawing.normals import edge_samples
from monodyn.vision.drawing.rig import Rig, altered
from monodyn.vision.drawing.shutter import swept_points
from monodyn.vision.drawing.silhouette import Outlines, blank_outlines, draw, projected
from monodyn.vision.foreground.masks import View

MATCHED_PX = 1.5
"""An outline sample whose edge is closer than this lies on it [px]."""
POSE_STEP = 1e-6
"""Shift of a joint for the derivative of the outline [rad or m]."""
PICTURE_STEP = 1e-3
"""Shift of the whole picture for the same [px]."""
COMMON = 1.0
"""Variance of the error that the samples of an edge along the pixels' rows or columns have in common, over
that of one sample: renderers and codecs place such an edge in steps of about a quarter pixel."""
PHASE_PX = 0.25
"""That step: an edge that crosses several of them averages the error out [px]."""
MOST_SAMPLES = 4096
"""Outline samples of a mechanism that are used."""
SAMPLES, TRUST, NEAR, SQUARES, COVERED, BEHIND, ROBUST = range(7)
"""Columns of what is found on each link: number of outline samples; their trust; that of those near an edge;
their squared distances from it, by trust [px^2]; coverage just inside, by trust; number of samples that other
geoms cover; weight of the samples in the normal equations."""
LINK_COLUMNS = ROBUST + 1
"""Number of these columns."""


class Agreement(NamedTuple):
    """How well an outline lies on a mask, its samples weighted by their trust.

    Attributes:
        samples: Number of outline samples at which an edge could be looked for.
        matched: Share of them within ``MATCHED_PX`` of an edge.
        rms_px: Root mean square displacement of these [px].
        inside: Mean coverage just inside of the outline.
        links: What these come from, in the columns named above, (dof, column).
    """

    samples: int
    matched: float
    rms_px: float
    inside: float
    links: np.ndarray


def agreement_of(links: np.ndarray) -> Agreement:
    """Return how well an outline lies on a mask, from what is found on each link.

    Args:
        links: In the columns named above, (dof, column).

    Returns:
        The agreement over all links.
    """
    samples, trust, near, squares, covered, *_ = links.sum(axis=0).tolist()
    total = max(trust, 1e-9)
    return Agreement(int(samples), near / total, (squares / max(near, 1e-9)) ** 0.5, covered / total, links)


class EdgeTerms(NamedTuple):
    """Normal equations of one mask over (pose, shared parameters), for unit noise of a sample
    and the common error of an edge along the pixels.

    Attributes:
        normal: Normal matrix, (dof + param, dof + param).
        right: Right side, (dof + param,).
        agreement: How well the outline lies on the mask.
    """

    normal: np.ndarray
    right: np.ndarray
    agreement: Agreement


class Shifts(NamedTuple):
    """A rig with each of some shared parameters shifted by a step, for derivatives.

    Attributes:
        links: Link tables, (param, dof, column).
        points: Points of the geoms [m], (param, point, 3).
        radius: Radius of the geoms [m], (param, geom).
        cameras: Packed cameras, (param, entry).
        steps: The steps, in units of each parameter, (param,).
    """

    links: np.ndarray
    points: np.ndarray
    radius: np.ndarray
    cameras: np.ndarray
    steps: np.ndarray


@njit(cache=True)
def no_shifts(rig: Rig) -> Shifts:
    """Return the shifts of no parameter.

    Args:
        rig: The mechanism.

    Returns:
        Shifts whose param axis has length 0.
    """
    links = np.empty((0, rig.links.shape[0], rig.links.shape[1]))
    points = np.empty((0, rig.points.shape[0], 3))
    cameras = np.empty((0, rig.camera.shape[0]))
    return Shifts(links, points, np.empty((0, rig.radius.shape[0])), cameras, np.empty(0))


def picture_shifts(rig: Rig) -> Shifts:
    """Return the shifts of a displacement of the whole picture, to the right and down [px].

    Args:
        rig: The mechanism.

    Returns:
        Shifts whose param axis has length 2.
    """
    links, points, radius = (
        np.repeat(part[np.newaxis], 2, axis=0) for part in (rig.links, rig.points, rig.radius)
    )
    cameras = np.stack([displaced_camera(rig.camera, by) for by in PICTURE_STEP * np.eye(2)])
    return Shifts(links, points, radius, cameras, np.full(2, PICTURE_STEP))


def edge_terms(
    planes: np.ndarray,
    view: View,
    rig: Rig,
    shifts: Shifts,
    position: np.ndarray,
    reach: float,
    spacing: float,
) -> EdgeTerms:
    """Form the normal equations of one mask over (pose, shared parameters).

    Args:
        planes: Mask by colour, uint8 (colour, height, width).
        view: How its planes are to be read.
        rig: The mechanism and its camera.
        shifts: The same with each shared parameter shifted.
        position: Joint positions, (dof,).
        reach: Length of the search along the normals [px].
        spacing: Distance between samples [px].

    Returns:
        The equations and how well the outline lies on the mask; all zero where the pose cannot be drawn.
    """
    normal, right, found = edge_kernel(planes, view, rig, shifts, position, reach, spacing)
    return EdgeTerms(normal, right, agreement_of(found))


@njit(cache=True, nogil=True)
def edge_kernel(
    planes: np.ndarray,
    view: View,
    rig: Rig,
    shifts: Shifts,
    position: np.ndarray,
    reach: float,
    spacing: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Do the work of ``edge_terms`` for it and for other kernels.

    Args:
        planes: Mask by colour, uint8 (colour, height, width).
        view: How its planes are to be read.
        rig: The mechanism and its camera.
        shifts: The same with each shared parameter shifted.
        position: Joint positions, (dof,).
        reach: Length of the search along the normals [px].
        spacing: Distance between samples [px].

    Returns:
        Normal matrix (dof + param, dof + param), right side (dof + param,), and what is found on each link
        (dof, column), in the columns named above.
    """
    room = edge_room(rig)
    if not draw(rig, position, room.outlines):
        size = position.shape[0] + shifts.steps.shape[0]
        return np.zeros((size, size)), np.zeros(size), np.zeros((position.shape[0], LINK_COLUMNS))
    return drawn_edge_terms(planes, view, rig, shifts, position, room, reach, spacing)


class EdgeRoom(NamedTuple):
    """Room for an outline and its samples, to be used for one pose after the other.

    Attributes:
        outlines: The outlines of the pose.
        ends: Outline points of each sample's edges, (sample, column).
        samples: What is found, (sample, column).
    """

    outlines: Outlines
    ends: np.ndarray
    samples: np.ndarray


@njit(cache=True)
def edge_room(rig: Rig) -> EdgeRoom:
    """Make room for the outline of a mechanism and its samples.

    Args:
        rig: The mechanism and its camera.

    Returns:
        Room to be filled by ``draw`` and ``drawn_edge_terms``.
    """
    ends = np.empty((MOST_SAMPLES, probe.END_COLUMNS), dtype=np.int64)
    samples = np.empty((MOST_SAMPLES, probe.SAMPLE_COLUMNS))
    return EdgeRoom(blank_outlines(rig, rig.radius.shape[0]), ends, samples)


@njit(cache=True)
def drawn_edge_terms(
    planes: np.ndarray,
    view: View,
    rig: Rig,
    shifts: Shifts,
    position: np.ndarray,
    room: EdgeRoom,
    reach: float,
    spacing: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Do the work of ``edge_kernel`` for a pose whose outlines are drawn.

    Args:
        planes: Mask by colour, uint8 (colour, height, width).
        view: How its planes are to be read.
        rig: The mechanism and its camera.
        shifts: The same with each shared parameter shifted.
        position: Joint positions, (dof,).
        room: Its outlines; the samples are filled in.
        reach: Length of the search along the normals [px].
        spacing: Distance between samples [px].

    Returns:
        What ``edge_kernel`` returns.
    """
    dofs, shared = position.shape[0], shifts.steps.shape[0]
    size = dofs + shared
    normal, right = np.zeros((size, size)), np.zeros(size)
    found = np.zeros((dofs, LINK_COLUMNS))
    outlines, ends, samples = room.outlines, room.ends, room.samples
    swept = swept_points(rig, position, outlines)
    count = edge_samples(planes, view, outlines, swept, (reach, spacing), ends, samples, True)
    moved, rows = moved_points(rig, shifts, position, outlines), np.zeros((2, size))
    _add_samples(planes, view, rig, shifts, room, moved, count, reach, rows, normal, right, found)
    return normal, right, found


@njit(cache=True, **UNCOUNTED)
def _add_samples(
    planes: np.ndarray, view: View, rig: Rig, shifts: Shifts, room: EdgeRoom, moved: np.ndarray,
    count: int, reach: float, rows: np.ndarray, normal: np.ndarray, right: np.ndarray, found: np.ndarray,
) -> None:  # fmt: skip
    """Add the samples in ``room`` to ``normal``, ``right`` and ``found``, which ``edge_kernel`` returns.

    ``moved`` is from ``moved_points``, ``count`` the number of samples, ``reach`` the length of the search
    [px]; ``rows`` (2, dof + param) is room: for the derivatives of a sample, and for the weighted sum of
    these over the samples of an edge.
    """
    px, ends, samples = room.outlines.px, room.ends, room.samples
    size, dofs, row, edge_row = right.shape[0], right.shape[0] - shifts.steps.shape[0], rows[0], rows[1]
    scale = max(0.35 * reach, 1.0)
    # the edge that the samples before lie on, and the weighted sums over these
    edge, edge_weight, edge_away = (0, 0), 0.0, 0.0
    for s in range(count):
        link = found[rig.link[int(samples[s, probe.GEOM])]]
        if samples[s, probe.REASON] != probe.USED:
            link[BEHIND] += samples[s, probe.REASON] == probe.HIDDEN
            continue
        p, r = ends[s, probe.FROM], ends[s, probe.TO]
        share, nx, ny, away = (
            samples[s, probe.SHARE],
            samples[s, probe.NORMAL_X],
            samples[s, probe.NORMAL_Y],
            samples[s, probe.AWAY],
        )
        gain, a, b, other = (
            samples[s, probe.GAIN],
            ends[s, probe.FAR_FROM],
            ends[s, probe.FAR_TO],
            samples[s, probe.FAR_SHARE],
        )
        far = samples[s, probe.FAR_X] != 0.0 or samples[s, probe.FAR_Y] != 0.0
        # A sample lies at a fixed share of its edge, and moves with the edge's two points. Only what moves
        # it along the normal can be seen: along itself an edge looks the same.
        for j in range(size):
            h = POSE_STEP if j < dofs else shifts.steps[j - dofs]
            dx = (1.0 - share) * (moved[j, p, 0] - px[p, 0]) + share * (moved[j, r, 0] - px[r, 0])
            dy = (1.0 - share) * (moved[j, p, 1] - px[p, 1]) + share * (moved[j, r, 1] - px[r, 1])
            row[j] = gain * (dx * nx + dy * ny) / h
            if far:
                dx = (1.0 - other) * (moved[j, a, 0] - px[a, 0]) + other * (moved[j, b, 0] - px[b, 0])
                dy = (1.0 - other) * (moved[j, a, 1] - px[a, 1]) + other * (moved[j, b, 1] - px[b, 1])
                row[j] += (dx * samples[s, probe.FAR_X] + dy * samples[s, probe.FAR_Y]) / h
        # the robust weight changes as the outline comes near: it is for the step, and not for the agreement
        trusted = samples[s, probe.WEIGHT]
        w = trusted * robust_weight(away, scale)
        link[SAMPLES] += 1.0
        link[TRUST] += trusted
        link[ROBUST] += w
        if abs(away) < MATCHED_PX:
            link[NEAR] += trusted
            link[SQUARES] += trusted * away * away
        link[COVERED] += trusted * _level_inside(planes, view, samples[s])
        if edge != (p, r):
            _take_out(normal, right, px[edge[0]], px[edge[1]], edge_weight, edge_row, edge_away)
            edge, edge_weight, edge_away = (p, r), 0.0, 0.0
            edge_row[:] = 0.0
        edge_weight, edge_away = edge_weight + w, edge_away + w * away
        for j in range(size):
            edge_row[j] += w * row[j]
            right[j] += w * row[j] * away
            for k in range(size):
                normal[j, k] += w * row[j] * row[k]
    _take_out(normal, right, px[edge[0]], px[edge[1]], edge_weight, edge_row, edge_away)


@njit(cache=True, **INLINED)
def _take_out(
    normal: np.ndarray, right: np.ndarray, start: np.ndarray, end: np.ndarray, weight: float,
    row: np.ndarray, away: float,
) -> None:  # fmt: skip
    """Take out of the normal equations what an error that the samples of an edge have in common adds to them.

    The edge lies between two points, (2,) [px]; the rest are weighted sums over its samples. With the weights
    w on a diagonal W and a common variance c, the inverse covariance is W - w w' c / (1 + c sum w).

    Source:
        Sherman and Morrison, "Adjustment of an inverse matrix", 1950.
    """
    steps = min(abs(end[0] - start[0]), abs(end[1] - start[1])) / PHASE_PX
    common = COMMON / (1.0 + steps * steps)
    share = common / (1.0 + common * weight)
    for j in range(len(row)):
        right[j] -= share * row[j] * away
        for k in range(len(row)):
            normal[j, k] -= share * row[j] * row[k]


@njit(cache=True, **INLINED)
def _level_inside(planes: np.ndarray, view: View, sample: np.ndarray) -> float:
    """Return the coverage just inside of a sample (column,), as a share of what counts as whole there."""
    if sample[probe.BORDER] > 0.0:  # that the rest of the geom does not show is why it was looked for
        return 1.0
    deep = min(probe.DEEP_PX, sample[probe.INNER])
    ix = int(sample[probe.AT_X] - deep * sample[probe.NORMAL_X] + 0.5)
    iy = int(sample[probe.AT_Y] - deep * sample[probe.NORMAL_Y] + 0.5)
    g = int(sample[probe.GEOM])
    whole = sample[probe.SHOWN] * (probe.LEAST_LEVEL * FULL if view.shaded[g] else FULL)
    return min(planes[view.part[g], iy, ix] / whole, 1.0)


@njit(cache=True)
def moved_points(rig: Rig, shifts: Shifts, position: np.ndarray, outlines: Outlines) -> np.ndarray:
    """Return the outline points with each joint, then each shared parameter, shifted by its step.

    Forward differences are exact enough: 1e-6 of a mechanism's size moves a point by less than a thousandth
    of a pixel, over which its path is straight. A shift keeps the number of points, because no radius
    becomes zero by it.

    Args:
        rig: The mechanism and its camera.
        shifts: The same with each shared parameter shifted.
        position: Joint positions [rad or m], (dof,).
        outlines: The outlines of the pose.

    Returns:
        The points [px], (dof + param, outline point, 2).
    """
    dofs = position.shape[0]
    moved = np.empty((dofs + shifts.steps.shape[0], outlines.px.shape[0], 2))
    for j in range(dofs):
        shifted = position.copy()
        shifted[j] += POSE_STEP
        projected(rig, shifted, moved[j], outlines.frames, 0)
    for k in range(shifts.steps.shape[0]):
        other = altered(rig, shifts.links[k], shifts.points[k], shifts.radius[k], shifts.cameras[k])
        projected(other, position, moved[dofs + k], outlines.frames, 0)
    return moved


@njit(cache=True, **UNCOUNTED)
def robust_weight(residual: float, scale: float) -> float:
    """Return the Geman-McClure weight of a residual.

    Args:
        residual: The residual.
        scale: Residual at which the weight has fallen to a quarter.

    Returns:
        The weight, from 0 to 1.

    Source:
        Geman and McClure, "Statistical methods for tomographic image reconstruction", 1987.
    """
    u = residual / scale
    return 1.0 / (1.0 + u * u) ** 2
