"""The parameters of torques over time, which come after those of the plan in one table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monodyn.arrays import Frozen, frozen, increasing
from monodyn.errors import MechanismError
from monodyn.mechanism.parts import ANY, Entry, Joint, Table
from monodyn.mechanism.plan import Plan
from monodyn.names import quoted

TORQUES = ("friction", "fourier", "free", "known")
LAG = "torque.lag"
"""How much later than in their log known torques act: a parameter."""
MOST_LAG = 0.2
"""Either bound of it [s], where the user sets none."""


@dataclass(frozen=True, eq=False)
class TorqueParameters(Frozen):
    """The parameters of torques over time.

    Attributes:
        model: ``"friction"`` (none), ``"fourier"``, ``"free"`` or ``"known"``.
        table: All parameters of the mechanism: those of its plan, then those of the torques.
        index: Row of each parameter in ``table``.
        rows: Rows in ``table`` of the entries of ``Drive.table``, int64 (dof, column).
        knots: Knots of ``"free"`` [s], (knot,), else empty.
    """

    model: str
    table: Table
    index: dict[str, int]
    rows: np.ndarray
    knots: np.ndarray

    def __post_init__(self) -> None:
        set_, shape = object.__setattr__, (None, None)
        set_(self, "rows", frozen("torque.rows", self.rows, shape, dtype=np.int64, error=MechanismError))
        set_(self, "knots", frozen("torque.knots", self.knots, (None,), error=MechanismError))

    def entries(self, rows: np.ndarray) -> np.ndarray:
        """Return which of some parameters each entry of ``Drive.table`` is.

        Args:
            rows: Rows of the parameters in ``table``, int (param,).

        Returns:
            Place in ``rows``, -1 where none of them, int64 (dof, column).
        """
        place = np.full(len(self.table.names), -1, dtype=np.int64)
        place[rows] = np.arange(len(rows))
        return place[self.rows]

    def entries_of(self, names: Sequence[str]) -> np.ndarray:
        """Return which of some parameters each entry of ``Drive.table`` is, as ``entries`` does.

        Args:
            names: Names of the parameters.

        Returns:
            Place in ``names``, -1 where none of them, int64 (dof, column).
        """
        return self.entries(np.array([self.index[name] for name in names], dtype=np.int64))

    def slopes(self, rows: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how some parameters change the clock of the drive, and the lag of known torques.

        Args:
            rows: Rows of the parameters in ``table``, int (param,).
            numbers: Values of all parameters, (row,).

        Returns:
            Derivatives of the logarithm of the clock, and of the lag, (param,) each.
        """
        # a longer period is a slower clock of the torque; a log is on the clock of the stamps, whatever their
        # true time
        timed = self.index.get({"fourier": "torque.period", "known": "time_scale"}.get(self.model, ""))
        clock = np.zeros(len(rows)) if timed is None else np.where(rows == timed, -1.0 / numbers[timed], 0.0)
        return clock, np.where(rows == self.index.get(LAG, -1), 1.0, 0.0)


def make_torques(
    plan: Plan, model: str, *, terms: int = 0, knots: np.ndarray | None = None, period: float | None = None
) -> TorqueParameters:
    """Return the parameters of a torque model.

    Args:
        plan: The mechanism's plan.
        model: ``"friction"``, ``"fourier"``, ``"free"`` or ``"known"``.
        terms: Harmonics of ``"fourier"``.
        knots: Knots of ``"free"`` [s], (knot,).
        period: Start value of the period of ``"fourier"`` [s].

    Raises:
        MechanismError: The model is unknown, has no term, no period above 0 or fewer than two knots, or the
            knots do not increase.
    """
    joints = [link.joint for link in plan.links]
    if model not in TORQUES:
        raise MechanismError(f"torque: expected one of {quoted(TORQUES)}, got '{model}'.")
    nothing = np.zeros((len(joints), 0), dtype=np.int64)
    if model == "friction":
        return TorqueParameters(model, plan.table, plan.index, nothing, np.zeros(0))
    table, stamps = plan.table.copy(), np.zeros(0)
    if model == "known":
        table.add(Entry(LAG, "lag", "", 0.0, "s", free=True, bounds=(-MOST_LAG, MOST_LAG), sign=ANY))
        rows = nothing
    elif model == "fourier":
        rows = _enter_series(table, joints, terms, period)
    else:
        stamps = frozen("torque.knots", () if knots is None else knots, (None,), error=MechanismError)
        increasing("torque.knots", stamps, error=MechanismError)
        if len(stamps) < 2:
            raise MechanismError(
                f"torque.knots: expected 2 or more, got {len(stamps)}; give their times [s]."
            )
        rows = [[_enter_torque(table, joint, str(k)) for joint in joints] for k in range(len(stamps))]
        rows = np.array(rows, dtype=np.int64).T
    index = {name: row for row, name in enumerate(table.names)}
    return TorqueParameters(model, table, index, rows, stamps)


def common_names(plan: Plan, old: TorqueParameters, new: TorqueParameters) -> list[str]:
    """Return the parameters that mean the same under two torque models: those of the plan come first.

    A torque at a knot means the same only where the knots are the same.

    Args:
        plan: The mechanism's plan.
        old: The parameters under one model.
        new: The parameters under the other.

    Returns:
        Their names, in the order of ``new``.
    """
    known = plan.index if new.model == "free" and not np.array_equal(new.knots, old.knots) else old.index
    return [name for name in new.table.names if name in known]


def _enter_series(table: Table, joints: Sequence[Joint], terms: int, period: float | None) -> np.ndarray:
    """Enter period and Fourier coefficients; return the coefficients' rows, (dof, column)."""
    if terms < 1:
        raise MechanismError(f"torque.terms: expected 1 or more, got {terms}.")
    if period is None or not 0 < period < math.inf:
        raise MechanismError(f"torque.period: expected a time above 0 s, got {period}.")
    table.add(Entry("torque.period", "period", "", period, "s", free=True))
    waves = [f"{wave}{k}" for k in range(1, terms + 1) for wave in ("cos", "sin")]
    rows = [[_enter_torque(table, joint, what) for what in ("mean", *waves)] for joint in joints]
    return np.array(rows, dtype=np.int64)


def _enter_torque(table: Table, joint: Joint, what: str) -> int:
    """Enter a coefficient of a joint's torque and return its row."""
    unit = "N m" if joint.kind == "hinge" else "N"
    name = f"{joint.name}.torque.{what}"
    bounds = (-math.inf, math.inf)
    table.add(Entry(name, "torque", joint.name, 0.0, unit, free=True, bounds=bounds, sign=ANY))
    return len(table.names) - 1
