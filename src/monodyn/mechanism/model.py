"""The mechanism: named parameters on a fixed topology, and the tree and shapes that follow from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from monodyn.errors import MechanismError
from monodyn.markup import brief, card, counted, sentences, table
from monodyn.mechanism.assemble import derivatives, settled, shapes_of, tree_of
from monodyn.mechanism.parts import Joint, Parameter
from monodyn.mechanism.plan import OWNED_COLUMNS, Plan
from monodyn.mechanism.torques import TorqueParameters, common_names, make_torques
from monodyn.mechanism.tree import Directions, Measured, Shapes, Tree
from monodyn.names import known
from monodyn.numbers import number
from monodyn.typed import checked

if TYPE_CHECKING:
    from monodyn.mechanism.drive import Drive


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A planar mechanism: the topology of its file, and values, bounds and choices by parameter.

    Made by ``load``; changed copies come from the ``with_...`` methods.

    Attributes:
        name: Name of the model.
        joints: Joints in the file's order, which is the order of the dof axis.
        bodies: Names of the bodies that move.
        plan: How parameters make links and shapes; shared by all copies.
        torques: The parameters of torques over time, and the table of all parameters.
        numbers: Values by row of the table, (param,); those of the plan come first.
        lower: Lower bounds, (param,).
        upper: Upper bounds, (param,).
        free: True where an identification may change the value, bool (param,).
        own: True where a mass, centre of mass or inertia has its own value instead of following, bool
            (param,).
        chosen: Names whose freedom the user chose; ``with_bodies`` leaves them alone.
        measured: The picture's information about sizes, or None.
        source: The file that it was read from, or the bundled name.
        ends: Bodies that end otherwise than there, as ``with_ends`` takes them.
    """

    name: str
    joints: tuple[Joint, ...]
    bodies: tuple[str, ...]
    plan: Plan
    torques: TorqueParameters
    numbers: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    free: np.ndarray
    own: np.ndarray
    chosen: frozenset[str] = frozenset()
    measured: Measured | None = None
    source: str = ""
    ends: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def tree(self) -> Tree:
        """The joint tree for the dynamics."""
        return tree_of(self.plan, self.plan_numbers, self.own)

    @cached_property
    def shapes(self) -> Shapes:
        """What the camera sees."""
        return shapes_of(self.plan, self.plan_numbers)

    @cached_property
    def plan_numbers(self) -> np.ndarray:
        """Values by row of the plan, without those of the torques, those that follow filled in, (param,)."""
        return settled(self.plan, self.numbers[: len(self.plan.table.names)], self.own)

    @property
    def slides(self) -> np.ndarray:
        """True for the joints that slide, bool (dof,)."""
        return np.array([joint.kind == "slide" for joint in self.joints])

    @property
    def torque(self) -> str:
        """What acts at the joints in addition to springs: ``"friction"``, ``"fourier"``, ``"free"``, or
        ``"known"`` torques, which belong to a record."""
        return self.torques.model

    @cached_property
    def drive(self) -> Drive:
        """Torques over true time; known ones are no part of the mechanism, but for their lag."""
        from monodyn.mechanism.drive import FOURIER, KNOTS, UNDRIVEN, Drive

        table = self.numbers[self.torques.rows]
        if self.torque == "fourier":
            return Drive(FOURIER, self.numbers[[self.row("torque.period")]], table)
        return Drive(KNOTS, self.torques.knots, table) if self.torque == "free" else UNDRIVEN(len(table))

    @cached_property
    def _current(self) -> np.ndarray:
        """Values with those that follow filled in, (param,)."""
        values = self.numbers.copy()
        values[: len(self.plan_numbers)] = self.plan_numbers
        # What follows from all sizes stands in the tree; a value that does not follow stands there unchanged.
        for i, rows in enumerate(self.plan.owned):
            if rows is not None:
                values[list(rows)] = self.tree.links[i, OWNED_COLUMNS]
        return values

    @cached_property
    def _follows(self) -> np.ndarray:
        """True where the value follows from others, bool (param,)."""
        follows = np.zeros(len(self.numbers), dtype=bool)
        follows[: len(self.plan.follows)] = self.plan.follows
        return follows & ~self.own

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Every parameter, in a fixed order."""
        table = self.torques.table
        columns = (
            table.names, table.kind, table.owner, self._current.tolist(), self.lower.tolist(),
            self.upper.tolist(), table.unit, self.free.tolist(), self._follows.tolist(), table.against,
        )  # fmt: skip
        return tuple(Parameter(*row) for row in zip(*columns, strict=True))

    @property
    def values(self) -> dict[str, float]:
        """Value by parameter name, those that follow included."""
        return dict(zip(self.torques.table.names, self._current.tolist(), strict=True))

    @checked
    def parameter(self, name: str) -> Parameter:
        """Return one parameter.

        Args:
            name: Its name.

        Raises:
            MechanismError: From ``row``: there is no parameter of that name.
            SettingsError: From deeper down: the name is no text.

        Example:
            >>> import monodyn.mechanism
            >>> monodyn.mechanism.load("single").parameter("link1.length").value
            0.2
        """
        return self.parameters[self.row(name)]

    def row(self, name: str) -> int:
        """Return the row of a parameter in the table.

        Args:
            name: Its name.

        Raises:
            MechanismError: There is no parameter of that name.
        """
        row = self.torques.index.get(name)
        if row is None:
            names = known("parameters", self.torques.table.names, name)
            raise MechanismError(f"parameter '{name}' is not in the mechanism; {names}")
        return row

    def rows(self, names: Sequence[str]) -> np.ndarray:
        """Return the rows of parameters in the table, int64 (param,).

        Args:
            names: Their names.

        Raises:
            MechanismError: From ``row``: there is no parameter of that name.
        """
        return np.array([self.row(name) for name in names], dtype=np.int64)

    @checked
    def with_values(self, values: Mapping[str, float]) -> Mechanism:
        """Return a copy with other values; signs are checked, bounds are not.

        Args:
            values: New value by name. A value that follows from others cannot be set here: free or fix it
                first with ``with_choices``.

        Raises:
            MechanismError: A value follows from others; or, from deeper down, a name is unknown, a value is
                not finite or has the wrong sign.
            SettingsError: From deeper down: a name is no text, or a value no number.
        """
        rows = self.rows(tuple(values))
        for name, row in zip(values, rows.tolist(), strict=True):
            if self.torques.table.follows[row] and not self.own[row]:
                raise MechanismError(
                    f"parameter '{name}': follows from the sizes of its body; fix or free it to give it a "
                    f"value."
                )
        return self.at_rows(rows, np.array([*values.values()], dtype=float))

    def at_rows(self, rows: np.ndarray, values: np.ndarray) -> Mechanism:
        """Return a copy with other values of some rows of the table, as a search tries them by the hundred.

        Args:
            rows: Rows of parameters that do not follow from others, int (param,).
            values: Their values, (param,).

        Raises:
            MechanismError: From ``check``: a value is not finite or has the wrong sign.
        """
        table = self.torques.table
        for row, value in zip(rows.tolist(), values.tolist(), strict=True):
            table.check(row, value)
        numbers = self.numbers.copy()
        numbers[rows] = values
        return replace(self, numbers=numbers)

    @checked
    def with_choices(
        self,
        fix: Mapping[str, float] | None = None,
        free: Sequence[str] = (),
        bounds: Mapping[str, tuple[float, float]] | None = None,
    ) -> Mechanism:
        """Return a copy with parameters fixed, freed and bounded as the user chose.

        Args:
            fix: Value by name of parameters to hold.
            free: Names of parameters to estimate.
            bounds: Lower and upper bound by name.

        Raises:
            SettingsError: A choice is of another type.
            MechanismError: A name is both fixed and freed, or bounds are reversed; or, from deeper down, a
                name is unknown, or a value is not finite, has the wrong sign or lies outside its bounds.
        """
        fix, bounds = dict(fix or {}), dict(bounds or {})
        lower, upper = self.lower.copy(), self.upper.copy()
        for name, (low, high) in bounds.items():
            row = self.row(name)
            if not low <= high:
                raise MechanismError(
                    f"bounds of '{name}': expected the lower bound first, got {low:g} and {high:g}."
                )
            lower[row], upper[row] = low, high
        frees, own, numbers = self.free.copy(), self.own.copy(), self.numbers.copy()
        for name in (*fix, *free):
            row = self.row(name)
            if name in fix and name in free:
                raise MechanismError(f"parameter '{name}': is both fixed and freed; choose one of them.")
            # A value that followed so far is independent from here on, and begins at what it was.
            if self.torques.table.follows[row] and not own[row]:
                own[row], numbers[row] = True, self._current[row]
            frees[row] = name in free
        chosen = self.chosen | {*fix, *free}
        copy = replace(self, numbers=numbers, lower=lower, upper=upper, free=frees, own=own, chosen=chosen)
        for name, value in fix.items():
            copy._check_bounds(name, value)
        copy = copy.with_values(fix)
        for name in (*free, *bounds):
            copy._check_bounds(name)
        return copy

    def with_following(self, names: Sequence[str], *, follow: bool) -> Mechanism:
        """Return a copy in which sizes and places follow others as in the file, or have their own values.

        Args:
            names: Names of sizes and places that follow by a form by default.
            follow: True for those that follow; else they are free, and begin at what they are.

        Raises:
            MechanismError: From ``row``: a name is unknown.
        """
        rows = self.rows(names)
        own, free, numbers = self.own.copy(), self.free.copy(), self.numbers.copy()
        own[rows], free[rows], numbers[rows] = not follow, not follow, self._current[rows]
        return replace(self, own=own, free=free, numbers=numbers)

    def with_bodies(self, bodies: str) -> Mechanism:
        """Return a copy whose bodies are uniform or free.

        Args:
            bodies: ``"uniform"``: masses follow from sizes and densities where the file gives no mass.
                ``"free"``: mass, centre of mass and inertia of every body are estimated, starting from their
                uniform values, and densities and thicknesses are held. Parameters that the user fixed or
                freed stay as they are.

        Raises:
            MechanismError: ``bodies`` is neither.
        """
        if bodies not in ("uniform", "free"):
            raise MechanismError(f"bodies: expected 'uniform' or 'free', got '{bodies}'; choose one of them.")
        table = self.torques.table
        numbers, free, own = self.numbers.copy(), self.free.copy(), self.own.copy()
        owned = {row for rows in self.plan.owned if rows is not None for row in rows}
        for row, name in enumerate(table.names):
            # what the user chose stays, and so does a place that a picture has shown to be another, and
            # whether there is a camera
            if name in self.chosen or table.tie[row] is not None or table.kind[row] == "roll":
                continue
            if bodies == "uniform":
                free[row], own[row] = table.free[row], False
            elif row in owned:
                if table.follows[row] and not own[row]:
                    own[row], numbers[row] = True, self._current[row]
                free[row] = True
            elif table.kind[row] in ("density", "thickness", "mass"):
                free[row] = False
        return replace(self, numbers=numbers, free=free, own=own)

    def with_torque(
        self,
        model: str,
        *,
        terms: int = 0,
        knots: np.ndarray | None = None,
        period: float | None = None,
    ) -> Mechanism:
        """Return a copy with torques over time at its joints, in addition to friction and springs.

        A parameter that the mechanism has already keeps its value, bounds and freedom (torques at knots only
        if the knots are the same); new coefficients start at 0.

        Args:
            model: ``"friction"``: none. ``"fourier"``: a Fourier series with the parameters ``torque.period``
                and, for each joint, ``<joint>.torque.mean``, ``.torque.cos1``, ``.torque.sin1``, ...
                ``"free"``: values at knots, linear in between, ``<joint>.torque.0``, ``.torque.1``, ...
                ``"known"``: those of a record's log, with the parameter ``torque.lag`` alone.
            terms: Harmonics of the Fourier series.
            knots: Times of the knots [s], (knot,), in true time.
            period: Start value of the period [s], where the mechanism has none yet.

        Raises:
            MechanismError: From ``make_torques``: the model is unknown, has no term, no period above 0 or
                fewer than two knots, or the knots do not increase.

        Example:
            >>> import monodyn.mechanism
            >>> single = monodyn.mechanism.load("single").with_torque("fourier", terms=1, period=0.5)
            >>> [name for name in single.values if "torque" in name]
            ['torque.period', 'joint1.torque.mean', 'joint1.torque.cos1', 'joint1.torque.sin1']
        """
        if period is None and self.torque == "fourier":
            period = self.values["torque.period"]
        torques = make_torques(self.plan, model, terms=terms, knots=knots, period=period)
        table, kept = torques.table, common_names(self.plan, self.torques, torques)
        to, since = [torques.index[name] for name in kept], [self.torques.index[name] for name in kept]

        def merged(start: list, now: np.ndarray) -> np.ndarray:
            column = np.array(start, dtype=now.dtype)
            column[to] = now[since]
            return column

        return replace(
            self,
            torques=torques,
            numbers=merged(table.start, self.numbers),
            lower=merged(table.lower, self.lower),
            upper=merged(table.upper, self.upper),
            free=merged(table.free, self.free),
            own=merged([False] * len(table.names), self.own),
            chosen=self.chosen.intersection(kept),
        )

    def with_measured(self, measured: Measured) -> Mechanism:
        """Return a copy that carries the information of the picture about its sizes.

        Args:
            measured: Names and information matrix.

        Raises:
            MechanismError: From ``row``: a name is unknown.
        """
        self.rows(measured.names)
        return replace(self, measured=measured)

    def directions(self, names: Sequence[str], chain: np.ndarray | None = None) -> Directions:
        """Differentiate the tree and the drive by parameters, or by what these depend on, exactly.

        Args:
            names: Names of the parameters; ``time_scale`` and sizes of no link change nothing.
            chain: Their derivatives by other variables, (param, variable); a parameter that is an entry of
                the drive's table must be the variable of the same number. None for the parameters themselves.

        Returns:
            The derivatives by ``names``, or by the variables.

        Raises:
            MechanismError: The value of a parameter follows from others; or, from ``row``, a name is unknown.
        """
        rows = self.rows(names)
        if self._follows[rows].any():
            following = names[int(np.argmax(self._follows[rows]))]
            raise MechanismError(
                f"parameter '{following}': follows from the sizes of its body; fix or free it first."
            )
        return self.directions_by(rows, np.eye(len(rows)) if chain is None else chain)

    def directions_by(self, rows: np.ndarray, chain: np.ndarray) -> Directions:
        """Differentiate as ``directions`` does, by parameters that are given by their rows in the table.

        Args:
            rows: Their rows, int (param,); none of them follows from others.
            chain: Their derivatives by other variables, (param, variable).

        Returns:
            The derivatives by the variables.
        """
        # Rows beyond the plan are torques: they change the drive alone.
        inner = rows < len(self.plan_numbers)
        links, gravity = derivatives(self.plan, self.plan_numbers, self.own, rows[inner], chain[inner])
        clock, lag = self.torques.slopes(rows, self.numbers)
        load = np.zeros(chain.shape[1])
        return Directions(links, gravity, self.torques.entries(rows), load, clock @ chain, lag @ chain)

    def __repr__(self) -> str:
        names = brief([f"{joint.name} ({joint.kind})" for joint in self.joints], "joints")
        return f"<Mechanism {self.name!r}: {names}; {self.free.sum()} of {len(self.free)} parameters free>"

    def _repr_html_(self) -> str:
        """Return the mechanism as HTML, for notebooks: its parameters, but for those without effect."""
        shown = [p for p in self.parameters if p.free or p.value != 0.0]
        rows = [
            [p.name, number(p.value), p.unit, "free" if p.free else "follows" if p.follows else "held"]
            for p in shown
        ]
        more = len(self.parameters) - len(shown)
        rest = [f"{counted(more, 'parameter')} of value 0 not listed."] if more else []
        parameters = table(("parameter", "value", "unit", ""), rows, words=("unit", ""))
        return card(repr(self), parameters, sentences(rest))

    def _check_bounds(self, name: str, value: float | None = None) -> None:
        """Raise unless a parameter's value, or the one that it is to have, lies within its bounds."""
        p = self.parameter(name)
        value = p.value if value is None else float(value)
        self.torques.table.check(self.row(name), value)
        if not p.lower <= value <= p.upper:
            raise MechanismError(
                f"parameter '{name}': expected a value between {p.lower:g} and {p.upper:g} {p.unit}, "
                f"got {value:g}; change the value or the bounds."
            )
