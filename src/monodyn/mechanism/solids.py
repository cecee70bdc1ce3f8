"""Geoms as linear maps: extents, centres and outline points of every geom as forms in the parameters.

A box, ellipsoid or mesh is an affine image of its start shape; a capsule, cylinder or sphere is two points
(or one) with a diameter. Masses and inertias of both are closed formulas of a few forms (``assemble``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.mechanism.axis import TINY, Axis, Form, Profile, corners, extent, plus, times
from monodyn.mechanism.parts import Given, Table

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


@dataclass(frozen=True, eq=False)
class Look:
    """How to write a visible geom.

    Attributes:
        kind: Kind in the file.
        direction: In-plane direction of ``along``, (2,).
        middle: Forms of the x, y, z of the middle of its extents [m].
    """

    kind: str
    direction: np.ndarray
    middle: tuple[Form, Form, Form]


def given_solid(given: Given, axis: Axis, weight: str) -> Solid:
    """Return a given inertial: its centre moves with the link, its inertia grows with mass length^2.

    Args:
        given: The inertial of the file.
        axis: Long axis of the link.
        weight: Name of its mass parameter.
    """
    return Solid(
        BLOCK, given.body, axis.point(given.com), axis.scale(), {}, {}, 0.0,
        (given.inertia / given.mass, 0.0), weight, False, (), {}, None,
    )  # fmt: skip


def geom_solid(
    shape: Profile, axis: Axis, table: Table, prefix: str, masses: str, main: bool, depth: Form
) -> Solid:
    """Return a geom as forms and enter its own parameters (sizes, density) into the table.

    Args:
        shape: The geom.
        axis: Long axis of its link.
        table: The parameters so far; the main geom's width must be in it.
        prefix: Start of its parameters' names, with the dot.
        masses: Start of the name of a given mass, with the dot.
        main: True for the link's main geom.
        depth: Form of the z of its link's body.
    """
    geom = shape.geom
    direction, middle, along, across_half = _span(shape, axis, table, prefix, main)
    if not main:
        table.add(prefix + "width", 2 * across_half, "m", kind="width", owner=geom.body, free=True)
    across: Form = {prefix + "width": 1.0}
    if shape.long is None:
        along = {} if geom.kind != "sphere" else across
    z = plus(depth, times(axis.scale(), float(geom.centre[2])))
    free = geom.mass is None and bool(geom.density)
    if geom.kind == "sphere" or (geom.kind in KINDS and shape.long is not None):
        deep = times(axis.scale(), shape.deep) if geom.kind != "sphere" else across
    else:
        name = prefix + "thickness"
        deep = {table.add(name, abs(shape.deep), "m", kind="thickness", owner=geom.body, free=free): 1.0}
    weight, dense = "", False
    if geom.mass:
        bounds = (1e-6 * geom.mass, 1e6 * geom.mass)
        weight = table.add(
            masses + "mass", geom.mass, "kg", kind="mass", owner=geom.body, free=True, bounds=bounds
        )
    elif geom.density and geom.mass is None:
        dense = True
        weight = table.add(
            prefix + "density", geom.density, "kg/m^3", kind="density", owner=geom.body, free=False
        )
    if geom.kind in KINDS:
        return _rod(shape, axis, direction, middle, along, across, deep, z, weight, dense)
    return _block(shape, axis, direction, middle, along, across, deep, z, weight, dense)


def _span(
    shape: Profile, axis: Axis, table: Table, prefix: str, main: bool
) -> tuple[np.ndarray, tuple[Form, Form], Form, float]:
    """Return direction, middle (forms along and across the axis), extent and half extent across."""
    t, s = float(shape.centre @ axis.along), float(shape.centre @ axis.across)
    if shape.long is None:
        return axis.along, (axis.at(t), axis.beside(s)), {}, shape.half[1]
    a, b = shape.half
    turn = abs(float(shape.long @ axis.across))
    block = shape.geom.kind not in KINDS
    if shape.geom.kind == "mesh":
        (x, a), (y, b) = extent(shape.geom, axis.along), extent(shape.geom, axis.across)
        t, s = float(shape.geom.centre[:2] @ axis.along) + x, float(shape.geom.centre[:2] @ axis.across) + y
        a, b, turn = a / 2, b / 2, 0.0
    elif block and abs(turn - 1) < TINY**2:
        a, b, turn = b, a, 0.0
    if turn < TINY:
        low, high = axis.at(t - a), axis.at(t + a)
        return axis.along, (times(plus(low, high), 0.5), axis.beside(s)), plus(high, times(low, -1.0)), b
    if main:
        return shape.long, (axis.at(t), axis.beside(s)), times(axis.scale(), 2 * a), b
    own = table.add(prefix + "length", 2 * a, "m", kind="length", owner=shape.geom.body, free=True)
    return shape.long, (axis.at(t), axis.beside(s)), {own: 1.0}, b


def _point(
    axis: Axis, middle: tuple[Form, Form], steps: tuple[tuple[np.ndarray, Form], ...]
) -> tuple[Form, Form]:
    """Return x and y of the middle moved by directions times forms."""
    x, y = axis.combine(*middle)
    for direction, form in steps:
        x, y = plus(x, times(form, float(direction[0]))), plus(y, times(form, float(direction[1])))
    return x, y


def _rod(
    shape: Profile, axis: Axis, direction: np.ndarray, middle: tuple[Form, Form], along: Form, across: Form,
    deep: Form, z: Form, weight: str, dense: bool,
) -> Solid:  # fmt: skip
    """Return a capsule, cylinder or sphere."""
    kind = shape.geom.kind
    side = np.array([-direction[1], direction[0]])
    points: list[tuple[Form, Form, Form]] = []
    ends = (-0.5, 0.5) if kind != "sphere" else (0.0,)
    tilt = float(np.arctan2(shape.deep, 2 * shape.half[0])) if shape.long is not None else np.pi / 2
    for end in ends:
        x, y = _point(axis, middle, ((direction, times(along, end)),))
        height = plus(z, times(deep, end))
        if kind != "cylinder":
            points.append((x, y, height))
            continue
        for turn in np.linspace(0, 2 * np.pi, RIM, endpoint=False):
            rim = 0.5 * (np.cos(turn) * side - np.sin(turn) * np.sin(tilt) * direction)
            rise = 0.5 * float(np.sin(turn) * np.cos(tilt))
            points.append((
                plus(x, times(across, float(rim[0]))), plus(y, times(across, float(rim[1]))),
                plus(height, times(across, rise)),
            ))  # fmt: skip
    look = Look(kind, direction, (*axis.combine(*middle), z)) if shape.geom.drawn else None
    return Solid(
        KINDS[kind], shape.geom.body, axis.combine(*middle), along if kind != "sphere" else {}, across, deep,
        1.0, (0.0, 0.0), weight, dense, tuple(points), {} if kind == "cylinder" else times(across, 0.5), look,
    )  # fmt: skip


def _block(
    shape: Profile, axis: Axis, direction: np.ndarray, middle: tuple[Form, Form], along: Form, across: Form,
    deep: Form, z: Form, weight: str, dense: bool,
) -> Solid:  # fmt: skip
    """Return a box, ellipsoid or mesh: an affine image of its start shape."""
    geom = shape.geom
    side = np.array([-direction[1], direction[0]])
    points, com, volume, gyration, lift = _unit_shape(shape, direction, side)
    z = plus(z, times(deep, lift))
    outline = []
    for a, b, c in points:
        x, y = _point(axis, middle, ((direction, times(along, float(a))), (side, times(across, float(b)))))
        outline.append((x, y, plus(z, times(deep, float(c)))))
    place = _point(
        axis, middle, ((direction, times(along, float(com[0]))), (side, times(across, float(com[1]))))
    )
    tilted = float(np.max(np.abs(geom.axes[2]))) < 1 - 1e-9
    look = (
        Look("mesh" if tilted else geom.kind, direction, (*axis.combine(*middle), z)) if geom.drawn else None
    )
    return Solid(
        BLOCK,
        geom.body,
        place,
        along,
        across,
        deep,
        volume,
        gyration,
        weight,
        dense,
        tuple(outline),
        {},
        look,
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
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    middle = points.mean(axis=0)
    faces = points[hull.simplices] - middle
    volumes = np.abs(np.linalg.det(faces)) / 6
    total = float(volumes.sum())
    sums = faces.sum(axis=1)
    com = (volumes @ sums) / 4 / total
    second = (volumes @ ((faces**2).sum(axis=1) + sums**2)) / 20 / total - com**2
    return total, com + middle, second
