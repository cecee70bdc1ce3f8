"""Geoms as linear maps: extents, centres and outline points of every geom as forms in the parameters.

A box, ellipsoid or mesh is an affine image of its start shape; a capsule, cylinder or sphere is two points
(or one) with a diameter. Masses and inertias of both are closed formulas of a few forms (``assemble``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.mechanism.axis import RODS, Axis, Form, Profile, corners, extent, is_rod, plus, times
from monodyn.mechanism.hull import hull
from monodyn.mechanism.parts import Entry, Geom, Given, Table
from monodyn.mechanism.places import Naming, span_of

BLOCK, CAPSULE, CYLINDER, SPHERE = range(4)
KINDS = {"capsule": CAPSULE, "cylinder": CYLINDER, "sphere": SPHERE}
RIM = 24


@dataclass(frozen=True, eq=False)
class Solid:
    """A geom, or a given inertial, as forms.

    Attributes:
        kind: ``BLOCK``, ``CAPSULE``, ``CYLINDER`` or ``SPHERE``.
        body: Body that holds it.
        place: Forms of its centre of mass in the link's frame [m].
        along: Form of the in-plane extent along its direction [m] (of a rod: its axis).
        across: Form of the extent across [m] (of a rod or sphere: its diameter).
        deep: Form of the extent along z [m] (of a rod: its axis).
        volume: Share of along * across * deep that a block fills.
        gyration: Inertia about z per mass, as factors of along^2 and across^2 (blocks only).
        weight: Name of the parameter that weighs it (a density or a mass), or empty.
        dense: True if that parameter is a density.
        points: Forms of x, y, z of its outline points.
        radius: Form of the growth of the points [m].
        look: Kind in the file, direction and middle for writing it again; None if it cannot be seen.
        turn: Name of the parameter that turns the geom about its middle, or empty.
    """

    kind: int
    body: str
    place: tuple[Form, Form]
    along: Form
    across: Form
    deep: Form
    volume: float
    gyration: tuple[float, float]
    weight: str
    dense: bool
    points: tuple[tuple[Form, Form, Form], ...]
    radius: Form
    look: Look | None
    turn: str = ""


@dataclass(frozen=True, eq=False)
class Look:
    """How to write a visible geom.

    Attributes:
        kind: Kind in the file.
        direction: In-plane direction of ``along`` in the file, (2,).
        middle: Forms of the x, y, z of the middle of its extents [m].
    """

    kind: str
    direction: np.ndarray
    middle: tuple[Form, Form, Form]


@dataclass(frozen=True, eq=False)
class _Extents:
    """Where a geom is and how far it extends, as forms.

    Attributes:
        axis: Long axis of its link.
        direction: In-plane direction of ``along``, (2,).
        middle: Forms of the place of its middle along and across the axis [m].
        along: Form of the extent along ``direction`` [m].
        across: Form of the extent across it [m].
        deep: Form of the extent along z [m].
        z: Form of the height of its middle [m].
        turn: Name of the parameter that turns it, or empty.
    """

    axis: Axis
    direction: np.ndarray
    middle: tuple[Form, Form]
    along: Form
    across: Form
    deep: Form
    z: Form
    turn: str

    @property
    def side(self) -> np.ndarray:
        """Direction of ``across``, a quarter turn counter-clockwise from ``direction``, (2,)."""
        return np.array([-self.direction[1], self.direction[0]])

    def point(self, steps: tuple[tuple[np.ndarray, Form], ...]) -> tuple[Form, Form]:
        """Return x and y of the middle moved by directions times forms."""
        x, y = self.axis.combine(*self.middle)
        for direction, form in steps:
            x, y = plus(x, times(form, float(direction[0]))), plus(y, times(form, float(direction[1])))
        return x, y


@dataclass(frozen=True)
class _Weight:
    """The parameter that weighs a geom: its name, or empty; and whether it is a density or a mass."""

    name: str
    dense: bool


def given_solid(given: Given, axis: Axis, weight: str) -> Solid:
    """Return a given inertial: its centre moves with the link, its inertia grows with mass length^2.

    Args:
        given: The inertial of the file.
        axis: Long axis of the link.
        weight: Name of its mass parameter.
    """
    return Solid(
        kind=BLOCK,
        body=given.body,
        place=axis.point(given.com),
        along=axis.scale(),
        across={},
        deep={},
        volume=0.0,
        gyration=(given.inertia / given.mass, 0.0),
        weight=weight,
        dense=False,
        points=(),
        radius={},
        look=None,
    )


def geom_solid(shape: Profile, axis: Axis, table: Table, naming: Naming, depth: Form) -> Solid:
    """Return a geom as forms and enter its own parameters (sizes, density) into the table.

    Args:
        shape: The geom.
        axis: Long axis of its link.
        table: The parameters so far; the main geom's width must be in it.
        naming: How its parameters are named.
        depth: Form of the z of its link's body.
    """
    geom, span = shape.geom, span_of(shape, axis, table, naming)
    along, across = span.along, span.across
    if geom.kind == "sphere":
        along = across
    z = plus(depth, times(axis.scale(), float(geom.centre[2])))
    free = geom.mass is None and bool(geom.density)
    # The picture shows no size along the line of sight, unless that of a round geom is its diameter or lies
    # along an axis that is seen: only then does it follow; else it is a separate parameter.
    if geom.kind == "sphere":
        deep = across
    elif is_rod(shape) and naming.main:
        deep = times(axis.scale(), shape.deep)
    elif is_rod(shape):
        deep = times(along, shape.deep / (2 * shape.half[0]))
    else:
        thickness = Entry(
            naming.prefix + "thickness", "thickness", geom.body, abs(shape.deep), "m", free=free,
            against="" if naming.main else axis.thick,
        )  # fmt: skip
        deep = {table.add(thickness): 1.0}
    extents = _Extents(axis, span.direction, span.middle, along, across, deep, z, span.turn)
    weight = _weight(geom, table, naming)
    return _rod(shape, extents, weight) if geom.kind in RODS else _block(shape, extents, weight)


def _weight(geom: Geom, table: Table, naming: Naming) -> _Weight:
    """Enter the mass or the density of a geom that has one."""
    if geom.mass:
        bounds = (1e-6 * geom.mass, 1e6 * geom.mass)
        mass = Entry(naming.masses + "mass", "mass", geom.body, geom.mass, "kg", free=True, bounds=bounds)
        return _Weight(table.add(mass), False)
    if geom.density and geom.mass is None:
        name = naming.prefix + "density"
        return _Weight(table.add(Entry(name, "density", geom.body, geom.density, "kg/m^3")), True)
    return _Weight("", False)


def _rod(shape: Profile, extents: _Extents, weight: _Weight) -> Solid:
    """Return a capsule, cylinder or sphere."""
    kind, direction, across = shape.geom.kind, extents.direction, extents.across
    points: list[tuple[Form, Form, Form]] = []
    ends = (-0.5, 0.5) if kind != "sphere" else (0.0,)
    tilt = float(np.arctan2(shape.deep, 2 * shape.half[0])) if shape.long is not None else np.pi / 2
    for end in ends:
        x, y = extents.point(((direction, times(extents.along, end)),))
        height = plus(extents.z, times(extents.deep, end))
        if kind != "cylinder":
            points.append((x, y, height))
            continue
        # the rim of an end face is a circle square to the axis, which leaves the plane by ``tilt``
        for turn in np.linspace(0, 2 * np.pi, RIM, endpoint=False):
            rim = 0.5 * (np.cos(turn) * extents.side - np.sin(turn) * np.sin(tilt) * direction)
            rise = 0.5 * float(np.sin(turn) * np.cos(tilt))
            points.append((
                plus(x, times(across, float(rim[0]))), plus(y, times(across, float(rim[1]))),
                plus(height, times(across, rise)),
            ))  # fmt: skip
    place = extents.point(())
    look = Look(kind, direction, (*place, extents.z)) if shape.geom.drawn else None
    return Solid(
        kind=KINDS[kind],
        body=shape.geom.body,
        place=place,
        along=extents.along if kind != "sphere" else {},
        across=across,
        deep=extents.deep,
        volume=1.0,
        gyration=(0.0, 0.0),
        weight=weight.name,
        dense=weight.dense,
        points=tuple(points),
        radius={} if kind == "cylinder" else times(across, 0.5),
        look=look,
        turn=extents.turn,
    )


def _block(shape: Profile, extents: _Extents, weight: _Weight) -> Solid:
    """Return a box, ellipsoid or mesh: an affine image of its start shape."""
    geom, direction, side = shape.geom, extents.direction, extents.side
    along, across, deep = extents.along, extents.across, extents.deep
    points, com, volume, gyration, lift = _unit_shape(shape, direction, side)
    z = plus(extents.z, times(deep, lift))
    outline = []
    for a, b, c in points:
        x, y = extents.point(((direction, times(along, float(a))), (side, times(across, float(b)))))
        outline.append((x, y, plus(z, times(deep, float(c)))))
    place = extents.point(((direction, times(along, float(com[0]))), (side, times(across, float(com[1])))))
    # A block whose edges leave the plane has no size of a box or an ellipsoid: it is written as its hull.
    tilted = float(np.max(np.abs(geom.axes[2]))) < 1 - 1e-9
    kind = "mesh" if tilted else geom.kind
    look = Look(kind, direction, (*extents.point(()), z)) if geom.drawn else None
    return Solid(
        kind=BLOCK,
        body=geom.body,
        place=place,
        along=along,
        across=across,
        deep=deep,
        volume=volume,
        gyration=gyration,
        weight=weight.name,
        dense=weight.dense,
        points=tuple(outline),
        radius={},
        look=look,
        turn=extents.turn,
    )


def _unit_shape(
    shape: Profile, direction: np.ndarray, side: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float, tuple[float, float], float]:
    """Return outline, mass centre, volume, gyration factors and height of a block of unit extents."""
    geom = shape.geom
    onto = np.stack([[*direction, 0.0], [*side, 0.0], [0.0, 0.0, 1.0]])
    local = corners(geom) @ onto.T
    if geom.kind == "ellipsoid":
        spans = np.array([extent(geom, direction)[1], extent(geom, side)[1], shape.deep])
        volume = 4 / 3 * np.pi * float(np.prod(geom.size)) / float(np.prod(spans))
        return local / spans, np.zeros(3), volume, (1 / 20, 1 / 20), 0.0
    low, high = local.min(axis=0), local.max(axis=0)
    unit = (local - (low + high) / 2) / (high - low)
    volume, com, second = (
        hull_moments(unit) if geom.kind == "mesh" else box_moments(onto @ geom.axes, geom.size)
    )
    lift = float((low + high)[2] / 2 / (high - low)[2])
    return unit, com, volume, (float(second[0]), float(second[1])), lift


def box_moments(axes: np.ndarray, half: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the moments of a box scaled to extents of one: 1/12 along an edge, less where it is tilted.

    Args:
        axes: Directions of its edges as columns, (3, 3).
        half: Half lengths of its edges [m], (3,).

    Returns:
        As ``hull_moments``: volume, centre of mass (3,), second moments (3,).
    """
    edges = axes * half
    spans = 2 * np.abs(edges).sum(axis=1)
    return float(8 * np.prod(half) / np.prod(spans)), np.zeros(3), (edges**2).sum(axis=1) / 3 / spans**2


def hull_moments(points: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Integrate over the convex hull of points.

    Args:
        points: Corners, (point, 3).

    Returns:
        Volume, centre of mass (3,), and second moments about it per volume along each axis (3,).

    Source: moments of a tetrahedron with one corner at the origin: volume det/6, second moments
        (sum of squares of the corners + square of their sum) / 20.
    """
    middle = points.mean(axis=0)
    faces = points[hull(points)] - middle
    volumes = np.abs(np.linalg.det(faces)) / 6
    total = float(volumes.sum())
    sums = faces.sum(axis=1)
    com = (volumes @ sums) / 4 / total
    second = (volumes @ ((faces**2).sum(axis=1) + sums**2)) / 20 / total - com**2
    return total, com + middle, second
