"""Marks of a mechanism before a camera, in all frames at once, and how their places in the picture change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.mechanism.axis import TOUCHING
from monodyn.mechanism.tree import ANCHOR_X, ANCHOR_Y, ANGLE, AXIS_X, AXIS_Y, HINGE
from monodyn.types import Camera
from monodyn.vision.drawing.camera import rotation
from monodyn.vision.points.marks import END, JOINT, SITE, Mark

STEP = 1e-6
"""Step of the derivatives, in rad, metres or a logarithm."""
SHIFT_PX = 50.0
"""Unit in which shifts of the picture stand next to joint positions [px]."""


class Shown(NamedTuple):
    """A mechanism with marks before a camera, as plain arrays.

    Attributes:
        parent: Parent of each link, -1 for the world, (dof,).
        kind: Joint kinds, (dof,).
        links: Link table of the mechanism's tree, (dof, column).
        link: Link of each mark, -1 for the scene, (point,).
        place: Places of the marks in the frames of their links; of the scene's in the plane [m], (point, 2).
        height: How far each mark stands before the plane of the first body [m], (point,).
        camera: The camera.
    """

    parent: np.ndarray
    kind: np.ndarray
    links: np.ndarray
    link: np.ndarray
    place: np.ndarray
    height: np.ndarray
    camera: Camera


@dataclass(frozen=True, eq=False)
class Places:
    """Where the marks are on a mechanism whose sizes change.

    Attributes:
        marks: The marks.
        start: The mechanism of the file.
        free: Rows of the marks whose places are unknowns, int (point,).
    """

    marks: tuple[Mark, ...]
    start: Mechanism
    free: np.ndarray

    def at(self, mechanism: Mechanism, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return places and heights of the marks.

        Args:
            mechanism: The mechanism with its sizes.
            own: Places of the free marks as ratios to their bodies' lengths, (point, 2).

        Returns:
            Places in the frames of the links [m], (point, 2), and heights [m], (point,).
        """
        depths = mechanism.plan.depths @ np.append(mechanism.plan_numbers, 1.0)
        place, height = np.zeros((len(self.marks), 2)), np.zeros(len(self.marks))
        for i, mark in enumerate(self.marks):
            grown = self.growth(mechanism, i)
            if mark.kind in (END, SITE):
                place[i] = mark.place * grown
            height[i] = 0.0 if mark.link < 0 else depths[mark.link] + mark.ahead * grown
        for row, ratio in zip(self.free, own, strict=True):
            place[row] = ratio * self.length(mechanism, int(row))
        return place, height

    def growth(self, mechanism: Mechanism, row: int) -> float:
        """Return by how much the body of a mark is longer than where its place was read from the file.

        Args:
            mechanism: The mechanism with its sizes.
            row: Row of the mark.
        """
        return self.length(mechanism, row) / self._length(self._file, row)

    @cached_property
    def hinged(self) -> np.ndarray:
        """True for free sites that the file puts onto the hinge of a next link, bool (free point,)."""
        return np.array([bool(hinges_at(self.marks[i], self.start)) for i in self.free], dtype=bool)

    def by_file(self, row: int) -> np.ndarray:
        """Return the place of a mark by the file as ratios to the length of its body, (2,).

        Args:
            row: Row of the mark.
        """
        return self.marks[row].place / self._length(self._file, row)

    @cached_property
    def _file(self) -> dict[str, float]:
        """Values of the file by name: places of marks are read from its geometry."""
        table = self.start.plan.table
        return dict(zip(table.names, table.start, strict=True))

    def length(self, mechanism: Mechanism, row: int) -> float:
        """Return the length of the body of a mark; the mean one for a body without, and for the scene [m].

        Args:
            mechanism: The mechanism with its sizes.
            row: Row of the mark.
        """
        return self._length(mechanism.values, row)

    def _length(self, values: Mapping[str, float], row: int) -> float:
        """Return the length of the body of a mark among values by name [m]."""
        link = self.marks[row].link
        body = "" if link < 0 else self.start.joints[link].body
        own = values.get(f"{body}.length", 0.0)
        if own:
            return own
        lengths = [value for name, value in values.items() if name.endswith(".length") and value > 0.0]
        return float(np.exp(np.mean(np.log(lengths)))) if lengths else 1.0


def mean_length(mechanism: Mechanism) -> float:
    """Return the mean length of the bodies, 1 m where none has any [m].

    Args:
        mechanism: The mechanism.
    """
    lengths = [p.value for p in mechanism.parameters if p.kind == "length"]
    return float(np.exp(np.mean(np.log(lengths)))) if lengths else 1.0


def shown_by(places: Places, mechanism: Mechanism, camera: Camera, own: np.ndarray) -> Shown:
    """Pack a mechanism with its marks before a camera.

    Args:
        places: The marks.
        mechanism: The mechanism with its sizes.
        camera: The camera.
        own: Places of the free marks as ratios to their bodies' lengths, (point, 2).

    Returns:
        The arrays.
    """
    tree = mechanism.tree
    place, height = places.at(mechanism, own)
    link = np.array([mark.link for mark in places.marks], dtype=np.int64)
    return Shown(tree.parent, tree.kind, tree.links, link, place, height, camera)


def frames_of(shown: Shown, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Place every link's frame in the plane, in all frames.

    Args:
        shown: The mechanism.
        position: Joint positions [rad or m], (frame, dof).

    Returns:
        Origins [m], (frame, dof, 2), and angles [rad], (frame, dof).
    """
    links = shown.links
    origin, angle = np.zeros((*position.shape, 2)), np.zeros(position.shape)
    for i, parent in enumerate(shown.parent):
        above = (
            (origin[:, parent], angle[:, parent]) if parent >= 0 else (np.zeros(2), np.zeros(len(position)))
        )
        turn = above[1] + links[i, ANGLE]
        origin[:, i] = above[0] + turned(links[i, [ANCHOR_X, ANCHOR_Y]], above[1])
        if shown.kind[i] == HINGE:
            angle[:, i] = turn + links[i, AXIS_X] * position[:, i]
        else:
            angle[:, i] = turn
            origin[:, i] += position[:, i, None] * turned(links[i, [AXIS_X, AXIS_Y]], turn)
    return origin, angle


def turned(vector: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Turn vectors.

    Args:
        vector: One vector, (2,), or one a frame, (frame, 2).
        angle: Angles [rad], (frame,).

    Returns:
        The turned vectors, (frame, 2).
    """
    c, s = np.cos(angle), np.sin(angle)
    x, y = vector[..., 0], vector[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def project(shown: Shown, position: np.ndarray) -> np.ndarray:
    """Return where the marks are in the picture.

    Args:
        shown: The mechanism with its marks before the camera.
        position: Joint positions [rad or m], (frame, dof); where the camera moves two more columns with the
            shift of the picture to the right and down [``SHIFT_PX``].

    Returns:
        Columns and rows [px], (frame, point, 2).
    """
    dofs = len(shown.parent)
    origin, angle = frames_of(shown, position[:, :dofs])
    camera, count = shown.camera, len(shown.link)
    seen = np.empty((len(position), count, 3))
    for i, link in enumerate(shown.link):
        on = shown.place[i]
        seen[:, i, :2] = on if link < 0 else origin[:, link] + turned(on, angle[:, link])
    seen[:, :, 2] = shown.height
    before = (seen - [camera.x, camera.y, camera.depth]) @ rotation(camera).T
    # what lies behind the camera has no place in the picture
    depth = np.where(before[..., 2:] > 1e-9, before[..., 2:], np.nan)
    centre = np.array([(camera.width - 1) / 2.0, (camera.height - 1) / 2.0])
    px = centre + camera.focal * before[..., :2] / depth
    return px + SHIFT_PX * position[:, None, dofs:] if position.shape[1] > dofs else px


def pose_slopes(shown: Shown, position: np.ndarray, base: np.ndarray) -> np.ndarray:
    """Return the derivatives of the places in the picture by the joints.

    Args:
        shown: The mechanism with its marks before the camera.
        position: Joint positions, and shifts of the picture where the camera moves, as ``project`` takes
            them, (frame, dof).
        base: The places there, from ``project``, (frame, point, 2).

    Returns:
        The derivatives [px/rad or px/m], (frame, point, 2, dof).
    """
    slopes = np.empty((*base.shape, position.shape[1]))
    for dof in range(position.shape[1]):
        moved = position.copy()
        moved[:, dof] += STEP
        slopes[..., dof] = (project(shown, moved) - base) / STEP
    return slopes


def in_plane(camera: Camera, px: np.ndarray) -> np.ndarray:
    """Return where the lines of sight meet the plane of the mechanism, in units of the camera's distance.

    Args:
        camera: The camera; its turns and focal length count.
        px: Columns and rows [px], (..., 2).

    Returns:
        Places to the right and up of the point of the plane before the camera, (..., 2).
    """
    centre = np.array([(camera.width - 1) / 2.0, (camera.height - 1) / 2.0])
    rays = np.concatenate([(px - centre) / camera.focal, np.ones((*px.shape[:-1], 1))], axis=-1)
    rays = rays @ rotation(camera)
    return rays[..., :2] / -rays[..., 2:]


def hinges_at(mark: Mark, mechanism: Mechanism) -> list[int]:
    """List the links whose hinges are where the file has a site.

    Args:
        mark: The site.
        mechanism: The mechanism of the file.
    """
    tree = mechanism.tree
    near = TOUCHING * float(np.hypot(*mark.place))
    return [
        i for i, parent in enumerate(tree.parent)
        if mark.kind == SITE and parent == mark.link and tree.kind[i] == HINGE
        and np.hypot(*(tree.links[i, [ANCHOR_X, ANCHOR_Y]] - mark.place)) <= near
    ]  # fmt: skip


def tied_sites(marks: Sequence[Mark], mechanism: Mechanism) -> set[int]:
    """Return the rows of sites that stay where the file has them in proportion to their body.

    Where no mark at a joint or an end shows the direction of a link, its farthest site does; where marks turn
    about the hinge of a next link, that hinge shows the length, and the site may be elsewhere.

    Args:
        marks: The marks.
        mechanism: The mechanism.
    """
    parent, kind = mechanism.tree.parent, mechanism.tree.kind
    anchors = mechanism.tree.links[:, [ANCHOR_X, ANCHOR_Y]]
    tied = set()
    for link in range(len(parent)):
        shown = any(m.kind == END and m.link == link for m in marks) or any(
            m.kind == JOINT and m.link >= 0 and parent[m.link] == link and np.hypot(*anchors[m.link]) > 0.0
            for m in marks
        )
        sites = [i for i, m in enumerate(marks) if m.kind == SITE and m.link == link]
        turning = any(
            parent[m.link] == link and kind[m.link] == HINGE and np.hypot(*anchors[m.link]) > 0.0
            for m in marks
            if m.link >= 0 and m.kind in (SITE, END) and np.hypot(*m.place) > 0.0
        )
        if sites and not shown and not turning:
            tied.add(max(sites, key=lambda i: float(np.hypot(*marks[i].place))))
    return tied
