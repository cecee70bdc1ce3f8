"""What an identification found: the noun that `identify` returns, and its parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from monodyn.arrays import Frozen, usual_step
from monodyn.errors import FitError, SettingsError
from monodyn.estimation.masses import MassScale, mass_scale
from monodyn.estimation.parts import Combination, Common, Start, TriedTorque, Unmodelled
from monodyn.extras import extra
from monodyn.markup import card, counted, sentences, table
from monodyn.mechanism import Mechanism
from monodyn.mechanism.assemble import following_slopes
from monodyn.mechanism.drive import Drive
from monodyn.mechanism.logged import logged
from monodyn.mechanism.plan import OWNED_COLUMNS
from monodyn.mechanism.steps import ERROR_BOUND, Steps, fine_stamps, spacing, steps_away
from monodyn.mechanism.torques import LAG
from monodyn.mechanism.tree import Directions
from monodyn.names import known
from monodyn.numbers import interval, number, short
from monodyn.typed import checked
from monodyn.types import TorqueLog

if TYPE_CHECKING:
    from pandas import DataFrame

Grade = Literal["trusted", "approximate", "refused"]
"""How far a fit can be relied on: in full; for what its status says holds; not at all."""
GRADES: tuple[Grade, ...] = ("trusted", "approximate", "refused")
"""All of them, the best first."""
PAYS = frozenset({"friction", "drag", "air"})
"""Kinds that are freed only where that explains more than chance would."""
SHOWN = 3.0
"""Standard deviations above zero from which on a friction shows."""


@dataclass(frozen=True)
class Doubt:
    """What speaks against a fit.

    Attributes:
        grade: What is left of the fit: ``approximate`` or ``refused``.
        reason: What was found, and what to do about it, in sentences.
    """

    grade: Grade
    reason: str


@dataclass(frozen=True)
class Estimate:
    """One parameter with its 95 % interval.

    Attributes:
        name: Parameter name.
        value: Estimate, or the fixed value.
        std: Standard deviation; 0 for a fixed parameter, infinite where the data do not fix it. One that
            follows from others has that of its value; one that only keeps its proportion to a length (see
            ``Fit.tied``) has an infinite one.
        lower: Lower end of the 95 % interval; the parameter's bound or -infinity where nothing limits it.
        upper: Upper end, likewise.
        unit: Unit of value and std.
        free: True when it was estimated.
        identifiable: True when the data determine it, at least within a factor of about three.
        at_bound: True when it ended on a bound.
    """

    name: str
    value: float
    std: float
    lower: float
    upper: float
    unit: str
    free: bool
    identifiable: bool
    at_bound: bool


@dataclass(frozen=True, eq=False)
class Fit(Frozen):
    """An identified mechanism with its error bars.

    Attributes:
        status: What came of it, one sentence.
        doubts: What speaks against it, the gravest first.
        advice: Plain sentences: what is not known, and what would fix it.
        mechanism: The identified mechanism.
        parameters: All parameters with their intervals.
        combinations: What the motion fixes even where single parameters stay open.
        starts: Start state of each record.
        tied: Sizes that keep their proportion to a length because nothing determines them, densities and
            leads that keep theirs to the first one: (parameter, what it keeps it to) pairs.
        covariance: Covariance of the unknowns ``names``, (unknown, unknown); directions that the data do not
            fix, and that do not move the motion, are left out of it; NaN for parameters of which none is
            determined.
        residual: Measured less simulated positions by record [rad or m], NaN where not measured, each
            (frame, dof).
        rms: Root mean square of the residual by joint [rad or m].
        scale: Metres per unit of length of the start.
        torque: Torque model.
        time: Time stamps of each record [s], each (frame,).
        evaluations: Evaluations of the model.
        seconds: Wall time [s].
        stamp_error: Standard deviation of the time stamps, as the residuals show it [s]; 0 where they show
            none.
        unmodelled: What the model lacks, which predictions go astray by; None where the noise explains the
            residuals.
        torques: Known torques of each record; empty where none are known.
        tried_torques: The kinds of torque that were tried, the chosen one first; empty where friction left
            nothing to explain, or where the kind was named.
        alternatives: Values of the estimated parameters by name with which the motion is as close to the
            record, so that nothing in it prefers this fit.
        common: Errors that the positions of each record have in common; None for a record of which nothing
            is said, empty where nothing is of any.
        unknowns: How many parameters were estimated, where ``parameters`` are those of a written model in
            place of these; None where they are the free ones.
    """

    status: str
    doubts: tuple[Doubt, ...]
    advice: tuple[str, ...]
    mechanism: Mechanism
    parameters: tuple[Estimate, ...]
    combinations: tuple[Combination, ...]
    starts: tuple[Start, ...]
    tied: tuple[tuple[str, str], ...]
    covariance: np.ndarray
    residual: tuple[np.ndarray, ...]
    rms: dict[str, float]
    scale: float
    torque: str
    time: tuple[np.ndarray, ...]
    evaluations: int
    seconds: float
    stamp_error: float = 0.0
    unmodelled: Unmodelled | None = None
    torques: tuple[TorqueLog, ...] = ()
    tried_torques: tuple[TriedTorque, ...] = ()
    alternatives: tuple[Mapping[str, float], ...] = ()
    common: tuple[Common | None, ...] = ()
    unknowns: int | None = None

    def common_of(self, record: int) -> Common | None:
        """Return what the positions of a record have in common; None where nothing is said of it.

        Args:
            record: Which record.
        """
        return self.common[record] if self.common else None

    def start_of(self, record: int, where: str) -> Start:
        """Return the start state of a record.

        Args:
            record: Which record.
            where: What asks for it, for the message.

        Raises:
            SettingsError: Nothing was identified, or there is no such record.
        """
        if not self.starts:
            raise SettingsError(
                f"{where}: expected an identified mechanism, got a fit without one: {self.status}"
            )
        if not 0 <= record < len(self.starts):
            raise SettingsError(f"{where}: expected a record from 0 to {len(self.starts) - 1}, got {record}.")
        return self.starts[record]

    @property
    def grade(self) -> Grade:
        """How far it can be relied on: as the gravest doubt has it."""
        return self.doubts[0].grade if self.doubts else GRADES[0]

    @property
    def ok(self) -> bool:
        """True where it can be used, at least for what its status says holds."""
        return self.grade != "refused"

    def doubted(self, doubts: Sequence[Doubt]) -> Fit:
        """Return the fit with more doubts; the gravest becomes its status.

        Args:
            doubts: What else speaks against it.
        """
        if not doubts:
            return self
        gravest = sorted((*self.doubts, *doubts), key=lambda doubt: -GRADES.index(doubt.grade))
        said = gravest[0].reason
        status = said if gravest[0].grade == "refused" else f"Approximate. {said}"
        return replace(self, status=status, doubts=tuple(gravest))

    @cached_property
    def shared(self) -> tuple[str, ...]:
        """Names of the estimated parameters, which all records share."""
        return tuple(p.name for p in self.parameters if p.free) if self.starts else ()

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns: parameters first, then ``record0.joint1``, ``record0.joint1_vel``, ..."""
        joints = [joint.name for joint in self.mechanism.joints]
        states = [*joints, *(f"{name}_vel" for name in joints)]
        return (*self.shared, *(f"record{k}.{name}" for k in range(len(self.starts)) for name in states))

    @property
    def shared_covariance(self) -> np.ndarray:
        """Covariance of the estimated parameters alone, (param, param)."""
        count = len(self.shared)
        return self.covariance[:count, :count]

    def motion_covariance(self, record: int) -> np.ndarray:
        """Return the covariance of all that determines the motion of one record.

        Args:
            record: Which record.

        Returns:
            Covariance of the estimated parameters and the record's start state, positions then rates,
            (param + 2 dof, param + 2 dof).
        """
        count, width = len(self.shared), 2 * len(self.mechanism.joints)
        # start states of the other records do not move this one
        chosen = np.concatenate((np.arange(count), count + record * width + np.arange(width)))
        return self.covariance[np.ix_(chosen, chosen)]

    @cached_property
    def mass_scale(self) -> MassScale | None:
        """What determines masses themselves: known ``"torques"``, or a mass, a friction or the like that was
        ``"given"``; None where the motion shows their ratios only."""
        std = {p.name: p.std for p in self.parameters}
        return mass_scale(self.mechanism, std, self.shared, self.directions, torque=self.torque)

    @cached_property
    def acting(self) -> tuple[str, ...]:
        """What acts at the joints, as far as it shows: ``"viscous friction"``, ``"dry friction"``,
        ``"quadratic drag"``, ``"air drag"``, ``"spring"``, and one of ``"periodic torque"``,
        ``"free torque"``, ``"known torque"``.

        A friction shows where it, or its ratio to a mass, is three standard deviations above zero.
        """
        kinds = {p.name: p.kind for p in self.mechanism.parameters}
        given = {p.name for p in self.parameters if not p.free and p.value > 0.0}
        rows = [(p.name, p.value, p.std) for p in self.parameters if p.free]
        # without a mass a friction is known in proportion to one alone
        rows += [(c.name.split(" ")[0], c.value, c.std) for c in self.combinations]
        shown = {kinds.get(name) for name, value, std in rows if value > SHOWN * std}
        # where no ratio is known either it is one that was freed because it pays
        shown |= {
            kinds[p.name] for p in self.parameters if p.free and p.value > 0.0 and np.isinf(p.std)
        } & PAYS
        shown |= {kinds[name] for name in given}
        laws = {
            "damping": "viscous friction",
            "friction": "dry friction",
            "drag": "quadratic drag",
            "air": "air drag",
            "stiffness": "spring",
        }
        over_time = {"fourier": "periodic torque", "free": "free torque", "known": "known torque"}
        also = (over_time[self.torque],) if self.torque in over_time else ()
        return (*(word for kind, word in laws.items() if kind in shown), *also)

    def driven(self, stamps: np.ndarray, record: int) -> tuple[Drive, int]:
        """Return what acts at the joints of one record in addition to friction and springs.

        Args:
            stamps: Time stamps [s], (frame,), rising or falling.
            record: Which record.

        Returns:
            The drive in true time, and the least number of integration steps between two stamps.
        """
        if not self.torques:
            return self.mechanism.drive, 1
        values, joints = self.mechanism.values, tuple(joint.name for joint in self.mechanism.joints)
        known = logged(self.torques[record], joints, np.sort(stamps))
        return known.drive(values[LAG], values["time_scale"]), known.parts

    def unpushed(self, stamps: np.ndarray, record: int) -> np.ndarray:
        """Mark the time stamps at which the torques are not known although they are elsewhere.

        Args:
            stamps: Time stamps [s], (frame,).
            record: Which record.

        Returns:
            True before and after known torques, and before and after free ones, bool (frame,).
        """
        if self.torques:
            log, late = self.torques[record].time, self.mechanism.values[LAG]
            # a lag leaves the torque open for as long at the beginning; that of the first row stands for it
            first, last = min(log[0], log[0] + late), max(log[-1], log[-1] + late)
            step = usual_step(log)
            return (stamps < first - step) | (stamps > last + step)
        if self.torque != "free":
            return np.zeros(len(stamps), dtype=bool)
        knots = self.mechanism.drive.times / self.mechanism.values["time_scale"]
        return (stamps < knots[0] - 1e-9) | (stamps > knots[-1] + 1e-9)

    def directions(self) -> Directions:
        """Differentiate tree and drive by the estimated parameters; a size tied to a length moves with it.

        Returns:
            The derivatives by ``shared``.
        """
        names = (*self.shared, *(size for size, _ in self.tied))
        return self.mechanism.directions(names, self._chain())

    @cached_property
    def spread(self) -> tuple[tuple[str, ...], np.ndarray]:
        """Names and joint covariance of all that was not given: the parameters in their order, estimated ones
        and such as follow from these, then the start states as in ``names``."""
        mechanism, tied = self.mechanism, [size for size, _ in self.tied]
        plan, count = mechanism.plan, len(self.shared)
        slopes = dict(zip((*self.shared, *tied), self._chain(), strict=True))
        links = self.directions().links if self.starts else np.zeros((*mechanism.tree.links.shape, 0))
        for link, rows in enumerate(plan.owned):
            for row, column in zip(rows or (), OWNED_COLUMNS, strict=False):
                if plan.follows[row] and not mechanism.own[row]:
                    slopes[plan.table.names[row]] = links[link, column]
        moving = {mechanism.row(name): slope for name, slope in slopes.items() if name not in tied}
        moving |= {mechanism.row(size): slopes[size] for size in tied}
        inner = [row for row in moving if row < len(plan.table.names)]
        forms = following_slopes(plan, mechanism.own)
        for row, _ in plan.ties:
            if not mechanism.own[row]:
                slopes[plan.table.names[row]] = sum(
                    (forms[row, other] * moving[other] for other in inner), np.zeros(count)
                )
        names = [p.name for p in mechanism.parameters if np.any(slopes.get(p.name, 0.0))]
        states = len(self.names) - count
        by_unknowns = np.zeros((len(names) + states, count + states))
        for k, name in enumerate(names):
            by_unknowns[k, :count] = slopes[name]
        by_unknowns[len(names) :, count:] = np.eye(states)
        return (*names, *self.names[count:]), by_unknowns @ self.covariance @ by_unknowns.T

    def _chain(self) -> np.ndarray:
        """Return the derivatives of the estimated parameters, then of the sizes tied to lengths, by the
        estimated parameters, (param + tied, param)."""
        count, values = len(self.shared), self.mechanism.values
        chain = np.eye(count + len(self.tied))[:, :count]
        for k, (size, length) in enumerate(self.tied):
            chain[count + k, self.shared.index(length)] = values[size] / (values[length] or 1.0)
        return chain

    def check(self) -> Fit:
        """Return the fit if it can be used.

        Raises:
            FitError: It cannot; the message is the status.
        """
        if not self.ok:
            raise FitError(self.status)
        return self

    def steps(self, start: Start, record: int, times: np.ndarray, error_bound: float = ERROR_BOUND) -> Steps:
        """Return the steps in which the motion away from a start is integrated.

        Args:
            start: The start.
            record: Which record's torques act.
            times: Time stamps [s], (frame,), that rise or fall from the start.
            error_bound: Largest integration error that is aimed at [rad or m].
        """
        stamps, rows = fine_stamps(start.time, times, spacing(self.time[record]))
        driven = self.driven(stamps, record)
        return steps_away(self.mechanism, (start.position, start.velocity), stamps, rows, driven, error_bound)

    def plot(self, record: int = 0) -> np.ndarray:
        """Draw the fitted frames of a record and their motion under the fit (needs monodyn[plots]).

        Args:
            record: Which record.

        Returns:
            Axes of matplotlib: the motion of each joint, and below it what was measured less what the fit
            makes of it, (dof, 2).

        Raises:
            FitError: Nothing was identified, or there is no such record.

        Example:
            ``fit.plot()[0, 0].figure.savefig("fit.png")``
        """
        from monodyn.estimation.plot import plot_motion
        from monodyn.mechanism.simulate import rollout

        if not 0 <= record < len(self.starts):
            raise FitError(f"plot: expected one of {len(self.starts)} fitted records, got {record}.")
        start, time = self.starts[record], self.time[record]
        _, rows, clock, drive, substeps = self.steps(start, record, time)
        state = (start.position, start.velocity)
        motion = rollout(self.mechanism.tree, clock, *state, substeps=substeps, drive=drive)[0][rows]
        # one that was read back from a run folder has none
        residual = self.residual[record] if self.residual else np.full(motion.shape, np.nan)
        return plot_motion(self.mechanism.joints, time, motion, residual, title=repr(self).strip("<>"))

    def to_pandas(self) -> DataFrame:
        """Return the parameters as a table of pandas (needs monodyn[tables]).

        Returns:
            One row a parameter, by name: ``value``, ``std``, ``lower`` and ``upper`` end of the 95 %
            interval, ``unit``, ``free``, ``identifiable``, ``at_bound``.
        """
        pandas = extra("to_pandas", "pandas", "tables")
        return pandas.DataFrame([asdict(one) for one in self.parameters]).set_index("name")

    def __repr__(self) -> str:
        frames = counted(sum(len(stamps) for stamps in self.time), "frame")
        unknowns = len(self.shared) if self.unknowns is None else self.unknowns
        parameters = counted(unknowns, "estimated parameter")
        records = f" of {counted(len(self.time), 'record')}" if len(self.time) > 1 else ""
        return f"<Fit of {self.mechanism.name!r}: {self.grade}, {parameters} from {frames}{records}>"

    def _repr_html_(self) -> str:
        """Return the fit as HTML, for notebooks: what came of it, and what was estimated."""
        torques = {p.name for p in self.mechanism.parameters if p.kind == "torque"}
        rows = []
        for p in self.parameters:
            if p.free and p.name not in torques:
                within = interval(
                    p.lower, p.upper, p.std, free=True, known=p.identifiable, at_bound=p.at_bound
                )
                rows.append([p.name, number(p.value, p.std), within, p.unit])
        shown = table(("parameter", "value", "95 % interval", "unit"), rows, words=("unit",))
        ratios = [[c.name, number(c.value, c.std), short(c.std), c.unit] for c in self.combinations]
        if ratios:
            shown += table(("combination", "value", "std", "unit"), ratios, words=("unit",))
        return card(repr(self), sentences([self.status]), shown, sentences(self.advice))

    @checked
    def parameter(self, name: str) -> Estimate:
        """Return one parameter by name.

        Args:
            name: Its name.

        Raises:
            FitError: There is no such parameter.
            SettingsError: From deeper down: the name is no text.
        """
        for estimate in self.parameters:
            if estimate.name == name:
                return estimate
        names = known("parameters", [estimate.name for estimate in self.parameters], name)
        raise FitError(f"parameter {name!r} is not in the fit; {names}")
