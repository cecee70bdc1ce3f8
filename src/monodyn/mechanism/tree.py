"""The arrays a mechanism becomes: the joint tree for the dynamics, the shapes for the picture.

Both are in the plane frame: x right, y up, z toward the camera. Every joint owns one link; a link's frame
sits at its joint and turns with it, so a body with several joints becomes a chain of massless links and one
that carries geoms and inertia.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from monodyn.arrays import Frozen, freeze
from monodyn.errors import MechanismError

HINGE = 0
SLIDE = 1

ANCHOR_X, ANCHOR_Y, ANGLE, AXIS_X, AXIS_Y, MASS, COM_X, COM_Y, INERTIA = range(9)
DAMPING, FRICTION, STIFFNESS, REST, ARMATURE, DRAG, AIR, LEAD = range(9, 17)
COLUMNS = 17
PASSIVE = (DAMPING, FRICTION, STIFFNESS, DRAG, AIR)
"""Columns of what acts at a single joint, or of the air on its link, in proportion to the column."""
BRAKES = {"friction": 0, "damping": 1, "drag": 2, "air": 2}
"""Kinds of parameter that take energy out of a joint, with the power of the rate in the torque."""

CREEP = (0.004, 0.002)
"""Friction loss is ``friction * tanh(rate / creep)``, by kind of joint [rad/s, m/s]: full (to 1e-12) beyond
14 times that, smooth at zero. A joint that it holds creeps, as it does in its own way in MuJoCo, whose
friction loss is a constraint: less than what a camera or an encoder shows, also of a cart that a pendulum
pulls at."""
LONGEST_LEAD = 0.05
"""Time by which dry friction turns ahead of the rate, at most [s]: five times that of MuJoCo's default."""


@dataclass(frozen=True, eq=False)
class Tree(Frozen):
    """The joint tree as plain arrays, one row a joint (dof) and the link that moves with it.

    Columns of ``links`` (named by the constants of this module):

    * ``ANCHOR_X, ANCHOR_Y`` joint position in the parent link's frame at q = 0 [m] (the world's for a root);
    * ``ANGLE`` turn of the link's frame against the parent link's at q = 0 [rad];
    * ``AXIS_X, AXIS_Y`` of a slide: its unit direction in the link's own frame; of a hinge: its sign (+1
      turns counter-clockwise) and 0;
    * ``MASS`` [kg], ``COM_X, COM_Y`` centre of mass in the link's frame [m], ``INERTIA`` about it [kg m^2];
    * ``DAMPING`` [N m s/rad or N s/m], ``FRICTION`` [N m or N], ``STIFFNESS`` [N m/rad or N/m] about ``REST``
      [rad or m], ``ARMATURE`` [kg m^2 or kg], ``DRAG`` c of the torque -c |v| v [N m s^2/rad^2 or N s^2/m^2],
      ``AIR`` c of the same law of the link's motion through the air, whatever carries it (``planar``),
      ``LEAD`` how far ahead of the rate dry friction turns [s], as the soft constraint of a simulator does.

    Attributes:
        parent: Row of the parent link, -1 for the world, int64 (dof,); a parent comes before its children.
        kind: ``HINGE`` or ``SLIDE``, int64 (dof,).
        links: float64 (dof, column), or complex128 for a complex step.
        gravity: Acceleration of free fall [m/s^2], (2,), of the type of ``links``.
    """

    parent: np.ndarray
    kind: np.ndarray
    links: np.ndarray
    gravity: np.ndarray

    def __post_init__(self) -> None:
        dofs = len(self.parent)
        freeze(self, (dofs,), "parent", "kind", dtype=np.int64, error=MechanismError)
        number = complex if np.iscomplexobj(self.links) or np.iscomplexobj(self.gravity) else float
        freeze(self, (dofs, COLUMNS), "links", dtype=number, error=MechanismError)
        freeze(self, (2,), "gravity", dtype=number, error=MechanismError)

    def along(self, directions: Directions, param: int, step: complex) -> Tree:
        """Return the tree a step along one direction, to first order.

        Args:
            directions: Derivatives of this tree.
            param: Which of them.
            step: Length of the step, in units of the parameter; imaginary for a complex step.
        """
        return Tree(
            self.parent,
            self.kind,
            self.links + step * directions.links[:, :, param],
            self.gravity + step * directions.gravity[:, param],
        )


@dataclass(frozen=True, eq=False)
class Directions:
    """How parameters, or the coordinates of a search, change a tree and the drive at its joints.

    A parameter p changes the drive's torque by d tau_i / dp = sum of basis_c where ``entry[i, c]`` is p,
    + load[p] tau_i + clock[p] t dtau_i/dt + lag[p] times the drive's derivative by a lag.

    Attributes:
        links: Derivative of ``Tree.links``, (dof, column, param).
        gravity: Derivative of ``Tree.gravity``, (2, param).
        entry: Parameter that an entry of the drive's table is, -1 where none, int64 (dof, column).
        load: Derivative of the logarithm of all torques of the drive, (param,).
        clock: Derivative of the logarithm of the drive's clock, (param,).
        lag: Derivative of the lag of known torques, (param,).
    """

    links: np.ndarray
    gravity: np.ndarray
    entry: np.ndarray
    load: np.ndarray
    clock: np.ndarray
    lag: np.ndarray

    @cached_property
    def always(self) -> np.ndarray:
        """True for parameters that change more than an entry of the drive's table, bool (param,)."""
        found = self.links.any(axis=(0, 1)) | self.gravity.any(axis=0)
        return found | (self.load != 0) | (self.clock != 0) | (self.lag != 0)

    @cached_property
    def acting(self) -> np.ndarray:
        """True for parameters that change anything, bool (param,)."""
        found = self.always.copy()
        found[self.entry[self.entry >= 0]] = True
        return found

    def chained(self, chain: np.ndarray) -> Directions:
        """Return the derivatives by other variables, by the chain rule.

        Args:
            chain: Derivatives of these parameters by the other variables, (param, variable); a parameter that
                is an entry of the drive's table must be the variable of the same number.
        """

        def turned(table: np.ndarray) -> np.ndarray:
            return np.ascontiguousarray(np.tensordot(np.moveaxis(table, -1, 0), chain, axes=(0, 0)))

        return Directions(
            turned(self.links), turned(self.gravity), self.entry, self.load @ chain, self.clock @ chain,
            self.lag @ chain,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Shapes(Frozen):
    """What the camera sees: each geom is the convex hull of its points, each grown by its radius.

    Attributes:
        link: Row of the link that the geom moves with, int64 (geom,).
        body: Name of the geom's body, by geom.
        first: Geom ``g`` owns points ``first[g]`` to ``first[g + 1] - 1``, int64 (geom + 1,).
        points: Position in the link's frame at the depth of the whole mechanism [m], (point, 3): x and y turn
            with the link, z is the distance toward the camera from the plane of the first root body.
        radius: Growth of the points [m], (geom,).
    """

    link: np.ndarray
    body: tuple[str, ...]
    first: np.ndarray
    points: np.ndarray
    radius: np.ndarray

    def __post_init__(self) -> None:
        geoms = len(self.body)
        freeze(self, (geoms,), "link", dtype=np.int64, error=MechanismError)
        freeze(self, (geoms + 1,), "first", dtype=np.int64, error=MechanismError)
        freeze(self, (None, 3), "points", error=MechanismError)
        freeze(self, (geoms,), "radius", error=MechanismError)


@dataclass(frozen=True, eq=False)
class Measured(Frozen):
    """The picture's information about sizes, around the current values of the mechanism that carries it.

    Attributes:
        names: Names of sizes and of places.
        information: Information matrix (inverse covariance) of the logarithms of the sizes and the ratios of
            the places to the sizes that they stand against, (param, param); zero along the common scale of
            the sizes, which no picture shows.
    """

    names: tuple[str, ...]
    information: np.ndarray

    def __post_init__(self) -> None:
        params = len(self.names)
        object.__setattr__(self, "names", tuple(self.names))
        freeze(self, (params, params), "information", error=MechanismError)
