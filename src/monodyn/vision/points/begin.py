"""Tracked marks in, first poses and sizes out, by geometry alone: link by link from the root.

A joint that is tracked is where it is; one that is not is the centre of the circle on which the marks beyond
it move, seen from the link before. The direction from a joint to a mark of its link is the link's angle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.mechanism.tree import ANCHOR_X, ANCHOR_Y, ANGLE, AXIS_X, AXIS_Y, HINGE
from monodyn.vision.points.marks import JOINT, Mark
from monodyn.vision.points.shown import turned

ROUNDS = 6
"""Times that a circle is fitted to the points that lie on it."""
TRIPLES = 300
"""Circles through three points that are tried."""
OFF_CIRCLE = 4.0
"""Typical distances from the circle within which a point counts."""


@dataclass(frozen=True, eq=False)
class Begin:
    """First poses and sizes, lengths in units of the distance from the camera.

    Attributes:
        position: Joint positions [rad; that unit], (frame, dof); NaN where the marks do not show them.
        scale: Units by metre of the file, by link; NaN where the marks do not show it, (dof,).
        root: Where the first joint of the tree is before the camera, (2,).
    """

    position: np.ndarray
    scale: np.ndarray
    root: np.ndarray


def rigid_marks(marks: Sequence[Mark], mechanism: Mechanism, link: int) -> list[tuple[int, np.ndarray]]:
    """List the marks that show the direction of a link, the farthest from its joint first.

    Args:
        marks: The marks.
        mechanism: The mechanism.
        link: The link.

    Returns:
        Row of each mark, and its place on the link by the file [m], (2,).
    """
    tree, found = mechanism.tree, []
    for row, mark in enumerate(marks):
        place = mark.place if mark.link == link else None
        if mark.kind == JOINT and mark.link >= 0 and tree.parent[mark.link] == link:
            # the joint of the next link is a point of this one, unless it slides along it
            place = tree.links[mark.link, [ANCHOR_X, ANCHOR_Y]] if tree.kind[mark.link] == HINGE else None
        if place is not None and np.all(np.isfinite(place)) and np.hypot(*place) > 0.0:
            found.append((row, np.array(place)))
    return sorted(found, key=lambda pair: -float(np.hypot(*pair[1])))


def begin(marks: Sequence[Mark], mechanism: Mechanism, plane: np.ndarray) -> Begin:
    """Find first poses and sizes.

    Args:
        marks: The marks.
        mechanism: The mechanism of the file.
        plane: Where each mark is in the plane, in units of the camera's distance, (frame, point, 2); NaN
            where it was not found.

    Returns:
        What the marks show.
    """
    tree, count = mechanism.tree, len(plane)
    dofs = len(tree.parent)
    origin, angle = np.full((dofs, count, 2), np.nan), np.full((dofs, count), np.nan)
    position, scale = np.full((count, dofs), np.nan), np.full(dofs, np.nan)
    root = np.full(2, np.nan)
    for i, parent in enumerate(tree.parent):
        base, turn = (
            (origin[parent], angle[parent]) if parent >= 0 else (np.zeros((count, 2)), np.zeros(count))
        )
        shown = rigid_marks(marks, mechanism, i)
        joint = [row for row, mark in enumerate(marks) if mark.kind == JOINT and mark.link == i]
        local = turned(plane.transpose(1, 0, 2) - base, -turn)
        if tree.kind[i] == HINGE:
            anchor = _anchor(local, joint, [row for row, _ in shown])
            origin[i] = base + turned(anchor, turn)
            angle[i], scale[i] = _angle(plane, origin[i], shown)
            sign = tree.links[i, AXIS_X]
            position[:, i] = sign * (angle[i] - turn - tree.links[i, ANGLE])
        else:
            angle[i] = turn + tree.links[i, ANGLE]
            along = turned(tree.links[i, [AXIS_X, AXIS_Y]], np.array([tree.links[i, ANGLE]]))[0]
            moving = local[(joint or [row for row, _ in shown] or [0])[0]]
            across = np.array([-along[1], along[0]])
            # where a slide is zero is a matter of choice: where its joint, or the foot of the camera, is
            anchor = float(_usual((moving @ across)[:, np.newaxis])[0]) * across
            position[:, i] = moving @ along
            origin[i] = base + turned(anchor, turn) + position[:, i, None] * turned(along, turn)
        if parent < 0:
            root = anchor
    return Begin(position, scale, root)


def _anchor(local: np.ndarray, joint: Sequence[int], shown: Sequence[int]) -> np.ndarray:
    """Return where a hinge is in the frame of the link before, from the marks there (point, frame, 2)."""
    if joint:
        return _usual(local[joint[0]])
    return circle(local[shown[0]])[0] if shown else np.full(2, np.nan)


def _angle(
    plane: np.ndarray, origin: np.ndarray, shown: Sequence[tuple[int, np.ndarray]]
) -> tuple[np.ndarray, float]:
    """Return the angle of a link (frame,) and its units by metre, from the marks that show its direction."""
    angle, scale = np.full(len(plane), np.nan), np.nan
    for row, place in shown:
        away = plane[:, row] - origin
        own = np.arctan2(away[:, 1], away[:, 0]) - np.arctan2(place[1], place[0])
        if np.isnan(scale):
            scale = float(_usual(np.hypot(*away.T)[:, np.newaxis])[0] / np.hypot(*place))
        else:
            # further marks need not be where the file has them: their direction from the first one's counts
            both = own - angle
            apart = np.arctan2(*_usual(np.stack([np.sin(both), np.cos(both)], axis=1)))
            own = own - (0.0 if np.isnan(apart) else apart)
        angle = np.where(np.isnan(angle), own, angle)
    return angle, scale


def _usual(values: np.ndarray) -> np.ndarray:
    """Return the median of the rows (row, column) that are known, (column,); NaN without any."""
    known = values[np.isfinite(values).all(axis=1)]
    return np.median(known, axis=0) if len(known) else np.full(values.shape[1], np.nan)


def circle(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Fit a circle by least squares of x^2 + y^2 = 2 c.x + (r^2 - c.c) to the points that lie on it.

    Args:
        points: Points on it, (frame, 2); NaN does not count.

    Returns:
        Its centre, (2,), and radius; NaN with fewer than three points.
    """
    points = points[np.isfinite(points).all(axis=1)]
    centre, radius = _median_circle(points)
    off = np.abs(np.hypot(*(points - centre).T) - radius)
    kept = off <= OFF_CIRCLE * max(float(np.median(off)), 1e-12) if len(off) else np.zeros(0, dtype=bool)
    for _ in range(ROUNDS):
        if kept.sum() < 3:
            break
        middle = points[kept].mean(axis=0)
        near = points[kept] - middle
        rows = np.column_stack([2.0 * near, np.ones(len(near))])
        found = np.linalg.lstsq(rows, np.sum(near**2, axis=1), rcond=None)[0]
        centre = middle + found[:2]
        radius = float(np.sqrt(max(found[2] + found[:2] @ found[:2], 0.0)))
        off = np.abs(np.hypot(*(points - centre).T) - radius)
        kept = off <= OFF_CIRCLE * max(float(np.median(off)), 1e-12)
    return centre, radius


def _median_circle(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Return centre (2,) and radius of the circle through three of the points (frame, 2) that half of all are
    nearest to; NaN with fewer than three."""
    if len(points) < 3:
        return np.full(2, np.nan), np.nan
    triples = np.random.default_rng(0).integers(0, len(points), (TRIPLES, 3))
    a, b, c = (points[triples[:, k]] for k in range(3))
    # the centre c of a circle through a, b, c solves 2 (b - a).x = |b|^2 - |a|^2 and the same of c
    rows = 2.0 * np.stack([b - a, c - a], axis=1)
    right = np.stack([np.sum(b**2 - a**2, axis=1), np.sum(c**2 - a**2, axis=1)], axis=1)
    proper = np.abs(np.linalg.det(rows)) > 1e-12 * np.abs(rows).max() ** 2
    if not proper.any():
        return np.full(2, np.nan), np.nan
    centres = np.linalg.solve(rows[proper], right[proper][..., None])[..., 0]
    radii = np.linalg.norm(a[proper] - centres, axis=1)
    off = np.abs(np.linalg.norm(points - centres[:, None], axis=2) - radii[:, None])
    best = int(np.argmin(np.median(off, axis=1)))
    return centres[best], float(radii[best])
