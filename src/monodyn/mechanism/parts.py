"""A mechanism as its file gives it, in the plane frame: links, geoms, given inertials; the parameters' table.

These are start values: ``plan`` turns them into maps from parameter values to the tree and the shapes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import numpy as np

from monodyn.errors import MechanismError


@dataclass(frozen=True)
class Joint:
    """A joint as the file names it.

    Attributes:
        name: Name in the file.
        body: Name of the body it moves.
        kind: ``"hinge"`` or ``"slide"``.
        lower: Lower limit [rad or m], -inf if none.
        upper: Upper limit [rad or m], inf if none.
        sign: +1 for a hinge that turns counter-clockwise in the picture, -1 for the other way; +1 for slides.
    """

    name: str
    body: str
    kind: str
    lower: float
    upper: float
    sign: int

    @property
    def turns(self) -> bool:
        """True for a hinge that nothing keeps from whole turns."""
        return self.kind == "hinge" and not (math.isfinite(self.lower) and math.isfinite(self.upper))


@dataclass(frozen=True)
class Parameter:
    """A named number of a mechanism.

    Attributes:
        name: ``<body>.length``, ``<joint>.damping``, ``gravity``, ...
        kind: What it is: ``length``, ``damping``, ``torque`` (a coefficient of a torque over time), ...; the
            kinds are the rows of ``dimensions.DIMENSIONS``.
        owner: Name of the body or joint that it belongs to; empty for ``gravity`` and the like.
        value: Current value.
        lower: Lower bound.
        upper: Upper bound.
        unit: Unit of value and bounds.
        free: True if an identification may change it.
        follows: True if the value follows from other parameters (the mass of a uniform body from its sizes,
            the place of a geom that the file puts onto another part).
        against: Name of the size to which another size or a place keeps its proportion where nothing
            determines it, empty if there is none.
    """

    name: str
    kind: str
    owner: str
    value: float
    lower: float
    upper: float
    unit: str
    free: bool
    follows: bool
    against: str


@dataclass(frozen=True, eq=False)
class Geom:
    """One geom in its link's frame (z counts from the plane of the link's body).

    Attributes:
        body: Body of the file that holds it: the link's own or one welded to it.
        name: Name in the file, or empty.
        kind: ``box``, ``ellipsoid``, ``mesh``, ``capsule``, ``cylinder`` or ``sphere``.
        centre: Place of its frame [m], (3,).
        axes: Directions of its frame as columns, (3, 3).
        size: Half sizes as MuJoCo states them [m], (3,).
        vertices: Hull corners of a mesh in its frame [m], (point, 3), else empty.
        drawn: True if it can be seen.
        density: Density [kg/m^3], or None.
        mass: Given mass [kg], or None; with neither it weighs nothing.
    """

    body: str
    name: str
    kind: str
    centre: np.ndarray
    axes: np.ndarray
    size: np.ndarray
    vertices: np.ndarray
    drawn: bool
    density: float | None
    mass: float | None


@dataclass(frozen=True, eq=False)
class Given:
    """An inertial that the file states.

    Attributes:
        body: Body of the file that has it.
        mass: Mass [kg].
        com: Centre of mass in the link's frame [m], (2,).
        inertia: Inertia about it, along the hinge axis [kg m^2].
    """

    body: str
    mass: float
    com: np.ndarray
    inertia: float


@dataclass(frozen=True, eq=False)
class Site:
    """A marked point of a link.

    Attributes:
        name: Name in the file.
        place: Its place in the link's frame [m], (2,).
        ahead: How far it stands before the plane of the link's body, toward the camera [m].
    """

    name: str
    place: np.ndarray
    ahead: float


@dataclass(frozen=True, eq=False)
class Link:
    """What one joint moves. Of a body with several joints only the last joint's link ``carries`` it.

    Attributes:
        joint: The joint.
        parent: Row of the parent link, -1 for the world.
        carries: True if the body's geoms and inertia are on this link.
        anchor: Joint position in the parent link's frame at q = 0 [m], (2,).
        angle: Turn against the parent link's frame at q = 0 [rad].
        axis: Slide direction in the link's frame, (2,); of a hinge its sign and 0.
        offset: Distance of the body from its parent body toward the camera [m].
        geoms: Its geoms.
        givens: Inertials stated for its body or for bodies welded to it.
        terms: Start values of the joint's own parameters by kind (``plan.JOINT``): damping, friction, ...
        sites: Marked points of its body.
    """

    joint: Joint
    parent: int
    carries: bool
    anchor: np.ndarray
    angle: float
    axis: np.ndarray
    offset: float
    geoms: tuple[Geom, ...]
    givens: tuple[Given, ...]
    terms: Mapping[str, float]
    sites: tuple[Site, ...] = ()


PLACE_KINDS = ("along", "across")
"""Kinds of parameters that are places on a link: lengths with a sign."""
POSITIVE, NOT_NEGATIVE, ANY = 0, 1, 2


@dataclass(frozen=True)
class Entry:
    """A parameter as it is entered into the table.

    Attributes:
        name: Its name.
        kind: What it is, as in `Parameter`.
        owner: Body or joint that it belongs to, or empty.
        start: Start value.
        unit: Unit.
        free: True if it is estimated by default.
        bounds: Lower and upper bound; None for start * [1e-3, 1e3], which suits a positive quantity.
        sign: ``POSITIVE``, ``NOT_NEGATIVE`` or ``ANY``.
        follows: True if the value follows from others by default.
        tie: What a following size or place is by default: factors by parameter name, ``""`` for a constant;
            the parameters must be in the table already. None for all others.
        against: As in `Parameter`.
    """

    name: str
    kind: str
    owner: str
    start: float
    unit: str
    free: bool = False
    bounds: tuple[float, float] | None = None
    sign: int = POSITIVE
    follows: bool = False
    tie: Mapping[str, float] | None = None
    against: str = ""


@dataclass
class Table:
    """The parameters while a plan is made: one row a parameter, in order of entry, kept by column.

    Attributes:
        names: Their names.
        kind, owner, start, unit, free, follows, sign, tie, against: As in `Entry`, row by row.
        lower: Lower bounds, in the parameter's unit.
        upper: Upper bounds.
    """

    names: list[str] = field(default_factory=list)
    kind: list[str] = field(default_factory=list)
    owner: list[str] = field(default_factory=list)
    start: list[float] = field(default_factory=list)
    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    unit: list[str] = field(default_factory=list)
    free: list[bool] = field(default_factory=list)
    follows: list[bool] = field(default_factory=list)
    sign: list[int] = field(default_factory=list)
    tie: list[Mapping[str, float] | None] = field(default_factory=list)
    against: list[str] = field(default_factory=list)

    def add(self, entry: Entry) -> str:
        """Return the name of a parameter after entering it.

        Args:
            entry: The parameter; its name must be new.

        Raises:
            MechanismError: The name has been entered before.
        """
        if entry.name in self.names:
            raise MechanismError(
                f"parameter '{entry.name}': expected one part of that name, got two; rename a body, geom or "
                "joint."
            )
        lower, upper = entry.bounds or (1e-3 * entry.start, 1e3 * entry.start)
        self.names.append(entry.name)
        self.kind.append(entry.kind)
        self.owner.append(entry.owner)
        self.start.append(float(entry.start))
        self.lower.append(float(lower))
        self.upper.append(float(upper))
        self.unit.append(entry.unit)
        self.free.append(entry.free)
        self.follows.append(entry.follows)
        self.sign.append(entry.sign)
        self.tie.append(entry.tie)
        self.against.append(entry.against)
        return entry.name

    def check(self, row: int, value: float) -> None:
        """Raise unless a value is a number of the sign that its parameter has.

        Args:
            row: Row of the parameter.
            value: The value.

        Raises:
            MechanismError: The value is not finite or has the wrong sign.
        """
        name, sign = self.names[row], self.sign[row]
        if not math.isfinite(value):
            raise MechanismError(f"parameter '{name}': expected a number, got {value}.")
        if (sign == POSITIVE and value <= 0) or (sign == NOT_NEGATIVE and value < 0):
            least = "above" if sign == POSITIVE else "not below"
            raise MechanismError(
                f"parameter '{name}': expected a value {least} 0 {self.unit[row]}, got {value:g}."
            )

    def copy(self) -> Table:
        """Return a table with the same entries that can take further ones."""
        return Table(**{column.name: [*getattr(self, column.name)] for column in fields(self)})
