"""Where each geom sits on its link, how far it extends and how it is turned: its parameters and their forms.

Every geom has a place of its own along and across its link's long axis, and extents along and across its own
direction. What the file puts exactly onto another part stays there: a disc at a hinge, a ball at the end of
its rod, an arm flush with the end of its link, a box along the axis. Such a place *follows* by a form in the
sizes, until the user fixes or frees it; any other one is free.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from monodyn.mechanism.axis import RODS, TINY, Axis, Form, Profile, extent, plus, times
from monodyn.mechanism.parts import ANY, Entry, Table

FARTHEST = 1e3
"""Bound of a place, in sizes of its link."""


@dataclass(frozen=True)
class Naming:
    """How the parameters of a geom are named.

    Attributes:
        prefix: Start of the names of its sizes, with the dot.
        places: Start of the names of its place and turn, with the dot.
        masses: Start of the name of a given mass, with the dot.
        main: True for the main geom of its link, whose width and length are those of the body.
    """

    prefix: str
    places: str
    masses: str
    main: bool


@dataclass(frozen=True, eq=False)
class Span:
    """Where a geom is and how far it extends in the plane.

    Attributes:
        direction: In-plane direction of ``along`` in the file, (2,).
        middle: Forms of the place of its middle along and across the axis [m].
        along: Form of the extent along ``direction`` [m]; empty for what is round.
        across: Form of the extent across it [m].
        turn: Name of the parameter that turns it about its middle, or empty.
    """

    direction: np.ndarray
    middle: tuple[Form, Form]
    along: Form
    across: Form
    turn: str


@dataclass(frozen=True, eq=False)
class _Box:
    """A geom in the plane as the file has it.

    Attributes:
        shape: The geom.
        axis: Long axis of its link.
        place: Its middle along and across the axis [m].
        direction: Direction of its extent, (2,).
        half: Half extents along ``direction`` and across it [m].
        round: True if it has no direction.
    """

    shape: Profile
    axis: Axis
    place: tuple[float, float]
    direction: np.ndarray
    half: tuple[float, float]
    round: bool

    @property
    def angle(self) -> float:
        """Angle of its direction from the axis [rad]."""
        x, y = float(self.direction @ self.axis.along), float(self.direction @ self.axis.across)
        return math.atan2(y, x)

    @property
    def aligned(self) -> bool:
        """True if it lies along the axis."""
        return self.round or abs(math.sin(self.angle)) < TINY

    @property
    def square(self) -> bool:
        """True if it lies across the axis."""
        return not self.round and abs(math.cos(self.angle)) < TINY


def span_of(shape: Profile, axis: Axis, table: Table, naming: Naming) -> Span:
    """Return place, extents and turn of a geom as forms and enter its own parameters into the table.

    Args:
        shape: The geom.
        axis: Long axis of its link.
        table: The parameters so far; the main geom's width must be in it.
        naming: How its parameters are named.
    """
    box = _box(shape, axis, main=naming.main)
    width: Form = {naming.prefix + "width": 1.0}
    if not naming.main:
        _enter_size(box, table, naming.prefix + "width", 2 * box.half[1])
    # the main geom of a link lies along its axis as a rule: length, tail and tip are its ends
    if naming.main and (box.round or box.aligned):
        return _main_span(box, table, naming, width)
    along: Form = {}
    if not box.round:
        along = {_enter_length(box, table, naming): 1.0}
    middle = (
        _enter_place(box, table, naming.places + "along", (along, width)),
        _enter_place(box, table, naming.places + "across", (along, width)),
    )
    turn = ""
    if not box.round and shape.geom.kind != "mesh":
        tie = {"": box.angle} if box.aligned or box.square else None
        limits = (-2 * math.pi, 2 * math.pi)
        turn = table.add(
            Entry(
                naming.places + "turn", "turn", shape.geom.body, box.angle, "rad", free=tie is None,
                bounds=limits, sign=ANY, follows=tie is not None, tie=tie,
            )
        )  # fmt: skip
    return Span(box.direction, middle, along, width, turn)


def half_across(shape: Profile, axis: np.ndarray) -> float:
    """Return half the size of a main geom that the width of its body stands for [m].

    Args:
        shape: The geom.
        axis: Direction of the link's long axis, (2,).
    """
    side = np.array([-axis[1], axis[0]])
    if shape.geom.kind == "mesh":
        return extent(shape.geom, side)[1] / 2
    if _lies_across(shape, axis):
        return shape.half[0]
    return shape.half[1]


def main_ends(shape: Profile | None, axis: np.ndarray, caps: tuple[float, float]) -> tuple[float, ...]:
    """Return where the main geom of a body begins and ends along its axis [m]; nothing if it is tilted.

    Args:
        shape: The geom, or None.
        axis: Direction of the link's long axis, (2,).
        caps: How far its round ends count, as ``caps_of`` has it.
    """
    if shape is None:
        return ()
    middle, half = float(shape.centre @ axis), 0.0
    if shape.geom.kind == "mesh":
        half = extent(shape.geom, axis)[1] / 2
    elif shape.long is not None and abs(abs(float(shape.long @ axis)) - 1) < TINY**2:
        half = shape.half[0]
    elif _lies_across(shape, axis):
        half = shape.half[1]
    elif shape.long is not None:
        return ()
    return middle - half - caps[0], middle + half + caps[1]


def main_sides(shape: Profile | None, axis: np.ndarray) -> tuple[float, ...]:
    """Return middle and sides of the main geom of a body across its axis [m]; none if it is not along it.

    Args:
        shape: The geom, or None.
        axis: Direction of the link's long axis, (2,).
    """
    side = np.array([-axis[1], axis[0]])
    if shape is None or abs(float(shape.centre @ side)) > TINY * shape.half[0]:
        return ()
    if shape.long is not None and abs(abs(float(shape.long @ axis)) - 0.5) < 0.5 - TINY**2:
        return ()
    half = half_across(shape, axis)
    return -half, half


def _lies_across(shape: Profile, axis: np.ndarray) -> bool:
    """True for a block whose longer side is square to the axis."""
    if shape.long is None or shape.geom.kind in RODS:
        return False
    return abs(float(shape.long @ axis)) < TINY


def _box(shape: Profile, axis: Axis, *, main: bool) -> _Box:
    """Return a geom in the plane with the direction that its length is counted along."""
    (t, s), (a, b) = (float(shape.centre @ d) for d in (axis.along, axis.across)), shape.half
    if shape.long is None:
        return _Box(shape, axis, (t, s), axis.along, (b, b), round=True)
    geom = shape.geom
    if geom.kind == "mesh":
        # a hull has no direction of its own: its extents are those along and across the link
        (x, a), (y, b) = extent(geom, axis.along), extent(geom, axis.across)
        t, s = float(geom.centre[:2] @ axis.along) + x, float(geom.centre[:2] @ axis.across) + y
        return _Box(shape, axis, (t, s), axis.along, (a / 2, b / 2), round=False)
    direction = shape.long
    # a square block lies along the axis, and so does the main one, whichever of its sides is longer
    if _lies_across(shape, axis.along) and (main or abs(a - b) < TINY * a):
        direction, a, b = axis.along, b, a
    # either way along it is the same direction, except for a rod that also leaves the plane
    if geom.kind not in RODS or abs(shape.deep) < TINY * a:
        ahead, aside = float(direction @ axis.along), float(direction @ axis.across)
        if ahead < -TINY or (ahead < TINY and aside < 0):
            direction = -direction
    return _Box(shape, axis, (t, s), direction, (a, b), round=False)


def _main_span(box: _Box, table: Table, naming: Naming, width: Form) -> Span:
    """Return the main geom of a link that lies along its axis: its ends are those of the link."""
    axis, (t, s) = box.axis, box.place
    middle, along = axis.at(t), {}
    if not box.round:
        # a round end that counts reaches half the width beyond the end of the geom's axis
        low, high = (
            plus(axis.at(t + side * (box.half[0] + cap)), times(width, -0.5 * side if cap else 0.0))
            for side, cap in zip((-1.0, 1.0), axis.caps, strict=True)
        )
        middle, along = times(plus(low, high), 0.5), plus(high, times(low, -1.0))
    across = axis.beside(s)
    if abs(s) > TINY * max(axis.length, axis.width):
        across = _enter_place(box, table, naming.places + "across", (along, width))
    return Span(axis.along, (middle, across), along, width, "")


def _enter_size(box: _Box, table: Table, name: str, start: float, tie: Form | None = None) -> str:
    """Enter a width or a length of a geom and return its name."""
    kind = "width" if name.endswith("width") else "extent"
    return table.add(
        Entry(
            name, kind, box.shape.geom.body, start, "m", free=tie is None, follows=tie is not None, tie=tie,
            against=box.axis.against,
        )
    )  # fmt: skip


def _enter_length(box: _Box, table: Table, naming: Naming) -> str:
    """Enter the extent of a geom along its direction; one that ends where other parts do follows them."""
    axis, t, half = box.axis, box.place[0], box.half[0]
    tie = None
    low, high = (axis.mark_along(t + side) if box.aligned else None for side in (-half, half))
    if low is not None and high is not None:
        tie = plus(high, times(low, -1.0))
    prefix = naming.places if naming.main else naming.prefix
    return _enter_size(box, table, prefix + "length", 2 * half, tie)


def _enter_place(box: _Box, table: Table, name: str, sizes: tuple[Form, Form]) -> Form:
    """Enter where the middle of a geom is along or across the axis and return its form.

    It follows where the file puts the middle, or else one of the geom's ends, onto a mark of the axis.
    """
    axis, kind = box.axis, name.rsplit(".", 1)[1]
    along = kind == "along"
    middle = box.place[0 if along else 1]
    mark = axis.mark_along if along else axis.mark_across
    ends: list[tuple[float, Form]] = [(0.0, {})]
    if box.aligned or box.square:
        # which of its two extents lies in this direction
        own = sizes[0] if box.aligned == along and not box.round else sizes[1]
        half = box.half[0] if box.aligned == along else box.half[1]
        ends += [(-half, times(own, 0.5)), (half, times(own, -0.5))]
    marks = ((mark(middle + step), back) for step, back in ends)
    tie = next((plus(form, back) for form, back in marks if form is not None), None)
    far = FARTHEST * max(axis.length, axis.width, abs(middle), *box.half)
    table.add(
        Entry(
            name, kind, box.shape.geom.body, middle, "m", free=tie is None, bounds=(-far, far), sign=ANY,
            follows=tie is not None, tie=tie, against=axis.against,
        )
    )  # fmt: skip
    return {name: 1.0}
