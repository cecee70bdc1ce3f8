"""The long axis of a body: how points on a link move when its length, tail, tip or width changes.

Along the axis places are mapped piecewise linearly: behind the hinge by the tail, up to the farthest child's
hinge (or the far end of the main geom) by the length, beyond it by the tip. Everything on the link is
therefore linear in the parameters; such a linear expression is a *form*: a dict from parameter name to
factor, ``""`` being the constant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from monodyn.mechanism.parts import Geom, Link

Form = dict[str, float]

TINY = 1e-6
"""Relative size below which an offset in the file is rounding, not geometry."""
TOUCHING = 1e-3
"""Distance in lengths of a link within which the file means two parts to touch: it may have rounded."""
UPRIGHT = 3e-4
"""Sine of the angle from the line of sight below which a rod is seen along its axis: files round angles."""
RODS = ("capsule", "cylinder", "sphere")
"""Kinds of geoms that are one or two points with a diameter."""


def times(form: Form, factor: float) -> Form:
    """Return ``factor * form``.

    Args:
        form: A form.
        factor: Number to scale it by.
    """
    return {name: factor * value for name, value in form.items()}


def plus(*forms: Form) -> Form:
    """Return the sum of forms.

    Args:
        forms: The summands.
    """
    total: Form = {}
    for form in forms:
        for name, value in form.items():
            total[name] = total.get(name, 0.0) + value
    return total


@dataclass(frozen=True, eq=False)
class Profile:
    """A geom seen along the hinge axis.

    Attributes:
        geom: The geom.
        centre: Middle of its extent in the plane [m], (2,).
        long: In-plane direction of its longer side, (2,), or None if it is round in the plane.
        half: Half extent along ``long`` and across it [m]; for a capsule or cylinder without caps along it.
        deep: Extent along z [m]; of a capsule or cylinder, of its axis only.
    """

    geom: Geom
    centre: np.ndarray
    long: np.ndarray | None
    half: tuple[float, float]
    deep: float


def corners(geom: Geom) -> np.ndarray:
    """Return points whose hull is the geom, relative to its centre in the link's frame [m], (point, 3).

    Args:
        geom: A box, ellipsoid or mesh.
    """
    if geom.kind == "mesh":
        local = geom.vertices
    elif geom.kind == "box":
        local = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * geom.size
    else:
        turn = np.linspace(0, 2 * np.pi, 48, endpoint=False)
        ring = np.stack([np.cos(turn), np.sin(turn), np.zeros(48)], axis=1)
        # An ellipsoid that lies flat is drawn by its equator; a tilted one needs points all over.
        flat = int(np.argmax(np.abs(geom.axes[2])))
        if abs(geom.axes[2, flat]) > 1 - 1e-12:
            local = np.roll(ring, flat + 1, axis=1) * geom.size
        else:
            heights = np.cos(np.linspace(0, np.pi, 25))[:, None, None]
            sphere = ring * np.sqrt(1 - heights**2) + heights * np.array([0.0, 0.0, 1.0])
            local = sphere.reshape(-1, 3) * geom.size
    return local @ geom.axes.T


def profile(geom: Geom) -> Profile:
    """Return how a geom looks along the hinge axis.

    Args:
        geom: A geom in its link's frame.
    """
    centre = geom.centre[:2]
    if geom.kind == "sphere":
        return Profile(geom, centre, None, (geom.size[0], geom.size[0]), 2 * geom.size[0])
    # A rod seen along its axis is round; otherwise its shadow is a bar of its diameter.
    if geom.kind in ("capsule", "cylinder"):
        axis, flat = geom.axes[:, 2], float(np.hypot(*geom.axes[:2, 2]))
        if flat < UPRIGHT:
            return Profile(geom, centre, None, (geom.size[0], geom.size[0]), 2 * geom.size[1])
        return Profile(
            geom,
            centre,
            axis[:2] / flat,
            (geom.size[1] * flat, geom.size[0]),
            2 * geom.size[1] * float(axis[2]),
        )
    points = corners(geom)
    deep = (
        float(np.ptp(points[:, 2])) if geom.kind != "ellipsoid" else 2 * _reach(geom, np.array([0, 0, 1.0]))
    )
    # A block with an edge along z has its other edges in the plane; a tilted one takes the direction in which
    # its shadow spreads most.
    upright = int(np.argmax(np.abs(geom.axes[2])))
    if abs(geom.axes[2, upright]) > 1 - 1e-9:
        first = geom.axes[:2, (upright + 1) % 3]
    else:
        first = np.linalg.svd(points[:, :2] - points[:, :2].mean(axis=0))[2][0]
    first = first / np.hypot(*first)
    second = np.array([-first[1], first[0]])
    (x, a), (y, b) = extent(geom, first), extent(geom, second)
    centre = centre + x * first + y * second
    if b > a * (1 + TINY):
        first, a, b = second, b, a
    return Profile(geom, centre, first, (a / 2, b / 2), deep)


def is_rod(shape: Profile) -> bool:
    """Return whether a geom's diameter is seen: a sphere, or a capsule or cylinder across the line of sight.

    Args:
        shape: The geom.
    """
    return shape.geom.kind == "sphere" or (shape.geom.kind in RODS and shape.long is not None)


def _reach(geom: Geom, direction: np.ndarray) -> float:
    """Return the half extent of an ellipsoid along a direction."""
    return float(np.linalg.norm(geom.size * (geom.axes.T @ direction)))


def extent(geom: Geom, direction: np.ndarray) -> tuple[float, float]:
    """Return middle (from the geom's centre) and full extent of a box, ellipsoid or mesh along a direction.

    Args:
        geom: A box, ellipsoid or mesh.
        direction: Unit direction in the plane, (2,).
    """
    if geom.kind == "ellipsoid":
        return 0.0, 2 * _reach(geom, np.array([*direction, 0.0]))
    along = corners(geom)[:, :2] @ direction
    return float(along.max() + along.min()) / 2, float(np.ptp(along))


def main_geom(profiles: list[Profile]) -> Profile | None:
    """Return the longest geom (the first of equals, of equal balls the farthest), visible ones before hidden.

    Args:
        profiles: The geoms of one body.
    """
    seen = [p for p in profiles if p.geom.drawn] or profiles
    best = None
    for p in seen:
        if best is None or p.half[0] > best.half[0] * (1 + TINY):
            best = p
        elif p.long is None and best.long is None and p.half[0] >= best.half[0] * (1 - TINY):
            best = p if np.hypot(*p.centre) > np.hypot(*best.centre) * (1 + TINY) else best
    return best


class AxisNames(NamedTuple):
    """Names of the parameters that stretch a link along and across its axis, each empty where there is none.

    Attributes:
        length: Name of the length.
        tail: Name of the tail.
        tip: Name of the tip.
        width: Name of the width.
    """

    length: str
    tail: str
    tip: str
    width: str


@dataclass(frozen=True, eq=False)
class Axis:
    """Long axis of a link with the names of the parameters that stretch it.

    Attributes:
        along: Unit direction in the link's frame, (2,).
        length: Start length [m].
        tail: Start extent behind the hinge [m].
        tip: Start extent beyond the length [m].
        width: Start width of the main geom [m].
        names: Names of these parameters.
        marks: Start places along the axis that belong to other parts: hinges and ends of the main geom [m].
        marks_across: Start places across it: hinges, middle and sides of the main geom [m].
        caps: How far round ends of the main geom reach behind and beyond its own axis, as ``caps_of`` has it.
        thick: Name of the size that the main geom has along the line of sight, or empty.
    """

    along: np.ndarray
    length: float
    tail: float
    tip: float
    width: float
    names: AxisNames
    marks: tuple[float, ...] = ()
    marks_across: tuple[float, ...] = ()
    caps: tuple[float, float] = (0.0, 0.0)
    thick: str = ""

    @property
    def across(self) -> np.ndarray:
        """Direction across the axis, a quarter turn counter-clockwise from it, (2,)."""
        return np.array([-self.along[1], self.along[0]])

    @property
    def against(self) -> str:
        """Name of the size that the link grows with: its length, else its width, else none."""
        return self.names.length or self.names.width

    def mark_along(self, t: float) -> Form | None:
        """Return where a place along the axis goes if another part is there, else None.

        Args:
            t: Start place [m].
        """
        mark = self._nearest(t, self.marks)
        return None if mark is None else plus(self.at(mark), times(self.scale(), t - mark))

    def mark_across(self, s: float) -> Form | None:
        """Return where a place across the axis goes if another part is there, else None.

        Args:
            s: Start place [m].
        """
        mark = self._nearest(s, self.marks_across)
        return None if mark is None else plus(self.beside(mark), times(self.scale(), s - mark))

    def _nearest(self, place: float, marks: tuple[float, ...]) -> float | None:
        """Return the mark that a place is at, but for rounding in the file."""
        mark = min(marks, key=lambda mark: abs(place - mark), default=math.inf)
        return mark if abs(place - mark) <= TOUCHING * max(self.length, self.width) else None

    def scale(self) -> Form:
        """Return the factor by which the link has grown: by its length, else its width, else not at all."""
        if self.names.length:
            return {self.names.length: 1 / self.length}
        if self.names.width:
            return {self.names.width: 1 / self.width}
        return {"": 1.0}

    def at(self, t: float) -> Form:
        """Return where a place along the axis goes, as a form in the size parameters.

        Args:
            t: Start place [m].
        """
        tail, tip = self.names.tail, self.names.tip
        if t < 0 and tail:
            return {tail: t / self.tail}
        if tip and t > self.length:
            return plus({self.names.length: 1.0}, {tip: (t - self.length) / self.tip})
        return times(self.scale(), t)

    def beside(self, s: float) -> Form:
        """Return where a place across the axis goes: with the width inside the main geom, else the length.

        Args:
            s: Start place [m].
        """
        if self.names.width and abs(s) <= 0.5 * self.width * (1 + TINY):
            return {self.names.width: s / self.width}
        return times(self.scale(), s)

    def point(self, place: np.ndarray) -> tuple[Form, Form]:
        """Map a point of the link.

        Args:
            place: Start point in the link's frame [m], (2,).

        Returns:
            Forms of its x and y.
        """
        return self.combine(self.at(float(place @ self.along)), self.beside(float(place @ self.across)))

    def combine(self, along: Form, across: Form) -> tuple[Form, Form]:
        """Return the forms of x and y of a point with these places along and across the axis.

        Args:
            along: Form of the place along the axis.
            across: Form of the place across it.
        """
        (ux, uy), (nx, ny) = self.along, self.across
        return plus(times(along, ux), times(across, nx)), plus(times(along, uy), times(across, ny))


def caps_of(
    link: Link, anchors: list[np.ndarray], profiles: list[Profile], along: np.ndarray
) -> tuple[float, float]:
    """Return how far the round ends of a link's main geom count beyond the ends of its axis [m].

    A body is as long as it reaches, round end included, whatever its shape. Where a hinge, a site or the
    middle of another geom is on the end of a capsule's axis, that is the place which the file states, and the
    cap, half the width, comes in addition.

    Args:
        link: The link.
        anchors: Joint positions of its children in its frame [m], each (2,).
        profiles: Profiles of its own body's geoms.
        along: Direction of its long axis, (2,).

    Returns:
        Behind and beyond; 0 for a flat end, and for one at such a place.
    """
    main = main_geom(profiles)
    if main is None or main.geom.kind != "capsule" or main.long is None:
        return 0.0, 0.0
    (half, radius), middle = main.half, float(main.centre @ along)
    stated = [np.zeros(2), *anchors, *(site.place for site in link.sites)]
    stated += [shape.centre for shape in profiles if shape is not main]
    places, near = np.array(stated) @ along, TOUCHING * 2 * half
    low, high = (radius * float(np.all(np.abs(places - middle - end) > near)) for end in (-half, half))
    return low, high


def long_axis(link: Link, anchors: list[np.ndarray], profiles: list[Profile]) -> tuple[np.ndarray, float]:
    """Return direction, (2,), and start length [m] of a link's long axis; length 0 where it has none.

    A link with a child is as long as from hinge to hinge, the last one as from its hinge to its end; where a
    ball is all there is, to its middle.

    Args:
        link: The link.
        anchors: Joint positions of its children in its frame [m], each (2,).
        profiles: Profiles of its own body's geoms.
    """
    main = main_geom(profiles)
    size = max([math.hypot(*a) for a in anchors] + [p.half[0] for p in profiles], default=0.0)
    far = max(anchors, key=lambda a: math.hypot(*a), default=np.zeros(2))
    reach = math.hypot(*far)
    # A cart is as long as its main geom, whichever way it slides; its origin may lie anywhere along it.
    if link.joint.kind == "slide" and main is not None and main.long is not None:
        along = main.long if main.long[np.argmax(np.abs(main.long))] > 0 else -main.long
        reach = float(far @ along)
        if abs(reach) <= TINY * size:
            return along, 2 * main.half[0] + sum(caps_of(link, anchors, profiles, along))
        return (along, reach) if reach > 0 else (-along, -reach)
    if reach > TINY * size:
        return far / reach, reach
    if main is None:
        # a body without geoms reaches to what marks it farthest from its hinge
        marked = max((site.place for site in link.sites), key=lambda p: math.hypot(*p), default=np.zeros(2))
        reach = math.hypot(*marked)
        return (marked / reach, reach) if reach > 0.0 else (np.array([1.0, 0.0]), 0.0)
    if main.long is None:
        away = float(np.hypot(*main.centre))
        return (main.centre / away, away) if away > TINY * size else (np.array([1.0, 0.0]), 0.0)
    sides = [(main.long, main.half[0]), (np.array([-main.long[1], main.long[0]]), main.half[1])]
    if main.geom.kind in ("capsule", "cylinder"):
        sides = sides[:1]
    along, half = max(sides, key=lambda side: abs(float(main.centre @ side[0])) + side[1])
    if float(main.centre @ along) < -TINY * size:
        along = -along
    return along, float(main.centre @ along) + half + caps_of(link, anchors, profiles, along)[1]
