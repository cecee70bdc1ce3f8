"""From a mechanism's parts to its plan: the parameters and the linear maps from them to links and shapes.

Every length, centre and outline point is linear in the parameters, so the plan is one matrix; masses and
inertias are closed formulas of its rows (``assemble``). Parameters of torques over time come after those of
the plan (``torques``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from monodyn.mechanism import axis as axes
from monodyn.mechanism import tree
from monodyn.mechanism.packed import Packed, pack
from monodyn.mechanism.parts import ANY, NOT_NEGATIVE, Entry, Link, Table
from monodyn.mechanism.places import Naming, half_across, main_ends, main_sides
from monodyn.mechanism.solids import Solid, geom_solid, given_solid

OWNED_KINDS = ("mass", "com_x", "com_y", "inertia")
"""Kinds of the parameters that may follow from the others of a body, in the order of ``Plan.owned``."""
OWNED_COLUMNS = (tree.MASS, tree.COM_X, tree.COM_Y, tree.INERTIA)
"""Their columns in ``Tree.links``."""


class JointTerm(NamedTuple):
    """A parameter of every joint.

    Attributes:
        column: Its column in ``Tree.links``.
        at_hinge: Its unit at a hinge.
        at_slide: Its unit at a slide.
    """

    column: int
    at_hinge: str
    at_slide: str


JOINT = {
    "damping": JointTerm(tree.DAMPING, "N m s/rad", "N s/m"),
    "friction": JointTerm(tree.FRICTION, "N m", "N"),
    "stiffness": JointTerm(tree.STIFFNESS, "N m/rad", "N/m"),
    "rest": JointTerm(tree.REST, "rad", "m"),
    "armature": JointTerm(tree.ARMATURE, "kg m^2", "kg"),
    "drag": JointTerm(tree.DRAG, "N m s^2/rad^2", "N s^2/m^2"),
    "air": JointTerm(tree.AIR, "N m s^2/rad^2", "N s^2/m^2"),
    "lead": JointTerm(tree.LEAD, "s", "s"),
}
"""The parameters of every joint by kind, in the order in which they are entered."""
JOINT_COLUMNS = [term.column for term in JOINT.values()]
FARTHEST_REST = 4.0 * math.pi
"""Position of a hinge up to which its spring may be slack [rad]: from farther off it is a constant torque."""
START_DAMPING = 1e-3
"""Damping at which a joint starts that has none in the file [N m s/rad or N s/m]."""


class Turn(NamedTuple):
    """A shape that a parameter turns about its middle.

    Attributes:
        shape: Row of the shape.
        row: Row of the parameter.
        start: Its value in the file [rad].
        middle: Linear map to the middle's x and y, (2, param + 1).
    """

    shape: int
    row: int
    start: float
    middle: np.ndarray


@dataclass(frozen=True, eq=False)
class Plan:
    """What does not change when parameters change.

    Attributes:
        links: The links, in dof order.
        table: The parameters with start values and bounds.
        index: Row of each parameter.
        parent: int64 (dof,).
        kind: int64 (dof,).
        template: ``Tree.links`` with the constant columns filled, (dof, column).
        forms: Rows of the linear map on (values, 1): two anchor rows a link, then five rows a solid (along,
            across, deep, centre x, centre y), (row, param + 1).
        solids: By link, the solids that weigh something, with their first row in ``forms``.
        weights: For each of those the row of its density or mass parameter, by link.
        owned: By link, the rows of mass, com_x, com_y, inertia of its body, or None for a massless link.
        joints: Rows of the parameters of each joint, in the order of ``JOINT``, int (dof, term).
        drawn: The solids that can be seen, in order of the shapes.
        shape_link: Link of each shape, int64 (geom,).
        first: First point of each shape, (geom + 1,).
        outline: Linear map to the points, (3 * point, param + 1).
        radius: Linear map to the radii, (geom, param + 1).
        depths: Linear map to the z of each link's body, (dof, param + 1).
        ties: Sizes and places that follow others by default: their rows, and their linear maps,
            (param + 1,), in an order in which none depends on a later one.
        turns: Shapes that a parameter turns about their middle, in order of the shapes.
    """

    links: tuple[Link, ...]
    table: Table
    index: dict[str, int]
    parent: np.ndarray
    kind: np.ndarray
    template: np.ndarray
    forms: np.ndarray
    solids: tuple[tuple[tuple[Solid, int], ...], ...]
    weights: tuple[tuple[int, ...], ...]
    owned: tuple[tuple[int, ...] | None, ...]
    joints: np.ndarray
    drawn: tuple[Solid, ...]
    shape_link: np.ndarray
    first: np.ndarray
    outline: np.ndarray
    radius: np.ndarray
    depths: np.ndarray
    ties: tuple[tuple[int, np.ndarray], ...]
    turns: tuple[Turn, ...]

    @cached_property
    def follows(self) -> np.ndarray:
        """True where a value follows from others by default, bool (param,)."""
        return np.array(self.table.follows, dtype=bool)

    @cached_property
    def packed(self) -> Packed:
        """The plan as arrays, for kernels."""
        weighing = [
            [(solid, row, weight) for (solid, row), weight in zip(*of_link, strict=True)]
            for of_link in zip(self.solids, self.weights, strict=True)
        ]
        return pack((self.template, self.forms, self.joints), JOINT_COLUMNS, self.ties, self.owned, weighing)


def make_plan(links: Sequence[Link], gravity: float) -> Plan:
    """Return the plan of a mechanism.

    Args:
        links: Its links, parents first.
        gravity: Gravity in the plane, downward [m/s^2].
    """
    table = Table()
    reach = 1e3 * _reach(links)
    anchors: list[tuple[axes.Form, axes.Form]] = [
        ({"": float(k.anchor[0])}, {"": float(k.anchor[1])}) for k in links
    ]
    solids: list[list[Solid]] = []
    depths: list[axes.Form] = []
    # A parent comes before its children, so that anchors of children are forms before they are stacked.
    for i, link in enumerate(links):
        depth: axes.Form = depths[link.parent] if link.parent >= 0 else {}
        solids.append([])
        if link.carries:
            children = [k for k in range(len(links)) if links[k].parent == i]
            axis = _enter_body(link, [links[k].anchor for k in children], table)
            depth = axes.plus(depth, _enter_offset(links, i, table, reach))
            for k in children:
                anchors[k] = axis.point(links[k].anchor)
            solids[i] = _enter_solids(link, axis, table, depth)
            _enter_inertia(link, table, reach)
        depths.append(depth)
    joints = [_enter_joint(link, table) for link in links]
    if gravity > 0:
        table.add(Entry("gravity", "gravity", "", gravity, "m/s^2"))
    else:
        none = Entry("gravity", "gravity", "", 0.0, "m/s^2", bounds=(0.0, math.inf), sign=NOT_NEGATIVE)
        table.add(none)
    table.add(Entry("time_scale", "time_scale", "", 1.0, "1"))
    # gravity's direction in a picture: no part of the mechanism, but an unknown of its motion there
    turns = (-2.0 * math.pi, 2.0 * math.pi)
    table.add(Entry("camera.roll", "roll", "", 0.0, "rad", bounds=turns, sign=ANY))
    return _stack(links, table, anchors, solids, joints, depths)


def _reach(links: Sequence[Link]) -> float:
    """Return a length that no size of the mechanism exceeds much [m]."""
    sizes = [float(np.hypot(*link.anchor)) for link in links if link.parent >= 0]
    sizes += [float(np.hypot(*g.centre[:2])) + float(np.max(g.size)) for link in links for g in link.geoms]
    sizes += [float(np.hypot(*given.com)) for link in links for given in link.givens]
    return max(sizes, default=0.0) or 1.0


def _enter_body(link: Link, anchors: list[np.ndarray], table: Table) -> axes.Axis:
    """Enter length, width, tail and tip of a body and return its long axis."""
    body = link.joint.body
    profiles = [axes.profile(g) for g in link.geoms if g.body == body]
    along, length = axes.long_axis(link, anchors, profiles)
    main = axes.main_geom(profiles)
    name = ""
    if length > 0:
        name = table.add(Entry(f"{body}.length", "length", body, length, "m", free=True))
    cart = link.joint.kind == "slide" and not any(abs(float(a @ along)) > axes.TINY * length for a in anchors)
    caps = axes.caps_of(link, anchors, profiles, along)
    ends = main_ends(main, along, caps)
    places = [float(a @ along) for a in anchors]
    tail, tip = (0.0, 0.0) if cart or not name else _overhang([*places, *ends], length)
    names = {"tail": "", "tip": ""}
    for what, extra in (("tail", tail), ("tip", tip)):
        if extra > 0:
            limits = (0.0, 1e3 * max(extra, length))
            names[what] = table.add(
                Entry(
                    f"{body}.{what}", what, body, extra, "m", free=True, bounds=limits, sign=NOT_NEGATIVE,
                    against=name,
                )
            )  # fmt: skip
    width = 0.0
    if main is not None:
        width = 2 * half_across(main, along)
        table.add(Entry(f"{body}.width", "width", body, width, "m", free=True, against=name))
    across = f"{body}.width" if width else ""
    aside = [float(a @ np.array([-along[1], along[0]])) for a in anchors]
    return axes.Axis(
        along=along,
        length=length,
        tail=tail,
        tip=tip,
        width=width,
        names=axes.AxisNames(length=name, tail=names["tail"], tip=names["tip"], width=across),
        marks=(0.0, length, *places, *ends),
        marks_across=(0.0, *aside, *main_sides(main, along)),
        caps=caps,
        thick="" if main is None else across if axes.is_rod(main) else f"{body}.thickness",
    )


def _overhang(places: Sequence[float], length: float) -> tuple[float, float]:
    """Return how far hinges and main geom reach behind the hinge and beyond the length [m], or 0."""
    tail, tip = -min(places, default=0.0), max(places, default=0.0) - length
    return (tail if tail > axes.TINY * length else 0.0), (tip if tip > axes.TINY * length else 0.0)


def _enter_offset(links: Sequence[Link], i: int, table: Table, reach: float) -> axes.Form:
    """Return the form of a body's distance from its parent body, a parameter if that one moves too."""
    # Massless links of a body with several joints are skipped: the parent is the last link that carries one.
    base = i
    while links[base].parent >= 0 and not links[links[base].parent].carries:
        base = links[base].parent
    link = links[i]
    if links[base].parent < 0:
        return {"": link.offset}
    body, bounds = link.joint.body, (-reach, reach)
    name = table.add(
        Entry(f"{body}.offset", "offset", body, link.offset, "m", free=True, bounds=bounds, sign=ANY)
    )
    return {name: 1.0}


def _enter_solids(link: Link, axis: axes.Axis, table: Table, depth: axes.Form) -> list[Solid]:
    """Return the geoms and given inertials of a link as forms and enter their parameters."""
    body = link.joint.body
    alone = len(link.givens) + sum(1 for g in link.geoms if g.mass or (g.density and g.mass is None)) == 1
    solids = []
    for owner in dict.fromkeys([body] + [g.body for g in link.geoms]):
        shapes = [axes.profile(g) for g in link.geoms if g.body == owner]
        main = axes.main_geom(shapes)
        for shape in shapes:
            kind = shape.geom.name or shape.geom.kind
            label = _free_name(f"{owner}.{kind}", table)
            prefix = f"{owner}." if shape is main else f"{label}."
            # <body>.mass is the mass of all its parts, so one of several parts has its mass by its own name.
            masses = f"{owner}." if alone or (shape is main and owner != body) else f"{label}."
            naming = Naming(prefix, f"{label}.", masses, shape is main and owner == body)
            solids.append(geom_solid(shape, axis, table, naming, depth))
    for given in link.givens:
        name = f"{given.body}.mass" if alone or given.body != body else f"{given.body}.inertial.mass"
        bounds = (1e-6 * given.mass, 1e6 * given.mass)
        table.add(Entry(name, "mass", given.body, given.mass, "kg", free=True, bounds=bounds))
        solids.append(given_solid(given, axis, name))
    return solids


def _free_name(stem: str, table: Table) -> str:
    """Return the stem, numbered if a geom of that name has been entered."""
    # the name of a parameter is its label and its kind, so one of any kind shows that the label is taken
    entered = list(zip(table.names, table.kind, strict=True))
    label, count = stem, 1
    while any(name == f"{label}.{kind}" for name, kind in entered):
        count += 1
        label = f"{stem}{count}"
    return label


def _enter_inertia(link: Link, table: Table, reach: float) -> None:
    """Enter mass, centre of mass and inertia of a body, which follow from its solids."""
    body = link.joint.body
    if f"{body}.mass" not in table.names:
        table.add(Entry(f"{body}.mass", "mass", body, 1.0, "kg", follows=True))
    for what in ("com_x", "com_y"):
        limits = (-reach, reach)
        table.add(Entry(f"{body}.{what}", what, body, 0.0, "m", bounds=limits, sign=ANY, follows=True))
    table.add(Entry(f"{body}.inertia", "inertia", body, 1.0, "kg m^2", follows=True))


def _enter_joint(link: Link, table: Table) -> list[str]:
    """Enter the parameters of a joint: what the file has is free, and damping always is; armature never, nor
    where a spring is slack, nor the lead of dry friction."""
    name, names = link.joint.name, []
    for kind, term in JOINT.items():
        start = link.terms[kind]
        free = kind == "damping" or (start > 0 and kind not in ("armature", "rest", "lead"))
        limits, sign = (_rests(link), ANY) if kind == "rest" else ((0.0, math.inf), NOT_NEGATIVE)
        if kind == "lead":
            limits = (0.0, tree.LONGEST_LEAD)
        if kind == "damping":
            start = start or START_DAMPING
        unit = term.at_hinge if link.joint.kind == "hinge" else term.at_slide
        entry = Entry(f"{name}.{kind}", kind, name, start, unit, free, limits, sign)
        names.append(table.add(entry))
    return names


def _rests(link: Link) -> tuple[float, float]:
    """Return the bounds of where a spring is slack [rad or m]."""
    return (-FARTHEST_REST, FARTHEST_REST) if link.joint.kind == "hinge" else (-math.inf, math.inf)


def _stack(
    links: Sequence[Link],
    table: Table,
    anchors: list[tuple[axes.Form, axes.Form]],
    solids: list[list[Solid]],
    joints: list[list[str]],
    depths: list[axes.Form],
) -> Plan:
    """Turn the forms into matrices."""
    index = {name: row for row, name in enumerate(table.names)}
    forms = [form for pair in anchors for form in pair]
    # The order of rows that ``assemble`` counts on: two anchors a link, then five forms a solid.
    heavy: list[tuple[tuple[Solid, int], ...]] = []
    for group in solids:
        rows = []
        for solid in group:
            if solid.weight:
                rows.append((solid, len(forms)))
                forms += [solid.along, solid.across, solid.deep, *solid.place]
        heavy.append(tuple(rows))
    drawn = [(i, solid) for i, group in enumerate(solids) for solid in group if solid.look is not None]
    points = [form for _, solid in drawn for point in solid.points for form in point]
    template = np.zeros((len(links), tree.COLUMNS))
    for i, link in enumerate(links):
        template[i, [tree.ANGLE, tree.AXIS_X, tree.AXIS_Y]] = link.angle, *link.axis
    return Plan(
        links=tuple(links),
        table=table,
        index=index,
        parent=np.array([link.parent for link in links], dtype=np.int64),
        kind=np.array([tree.HINGE if k.joint.kind == "hinge" else tree.SLIDE for k in links], dtype=np.int64),
        template=template,
        forms=matrix(forms, index),
        solids=tuple(heavy),
        weights=tuple(tuple(index[solid.weight] for solid, _ in group) for group in heavy),
        owned=tuple(
            tuple(index[f"{k.joint.body}.{f}"] for f in OWNED_KINDS) if k.carries else None for k in links
        ),
        joints=np.array([[index[name] for name in names] for names in joints], dtype=np.int64),
        drawn=tuple(solid for _, solid in drawn),
        shape_link=np.array([i for i, _ in drawn], dtype=np.int64),
        first=np.cumsum([0] + [len(solid.points) for _, solid in drawn]).astype(np.int64),
        outline=matrix(points, index),
        radius=matrix([solid.radius for _, solid in drawn], index),
        depths=matrix(depths, index),
        ties=tuple(
            (row, matrix([dict(tie)], index)[0]) for row, tie in enumerate(table.tie) if tie is not None
        ),
        turns=tuple(
            Turn(
                shape, index[solid.turn], table.start[index[solid.turn]], matrix(solid.look.middle[:2], index)
            )
            for shape, (_, solid) in enumerate(drawn)
            if solid.turn and solid.look is not None
        ),
    )


def matrix(forms: Sequence[axes.Form], index: dict[str, int]) -> np.ndarray:
    """Return the rows of forms as a matrix on (values, 1).

    Args:
        forms: The forms.
        index: Row of each parameter in the values.

    Returns:
        Matrix, (form, param + 1).
    """
    rows = np.zeros((len(forms), len(index) + 1))
    for row, form in zip(rows, forms, strict=True):
        for name, factor in form.items():
            row[index[name] if name else -1] += factor
    return rows
