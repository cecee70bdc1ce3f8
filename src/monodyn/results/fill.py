"""An identified mechanism in, its motion at any time stamps out: before, within and after the fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monodyn.arrays import Frozen, frozen, increasing
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Fit
from monodyn.estimation.parts import Start
from monodyn.extras import extra
from monodyn.markup import brief, card, counted, stretch, table
from monodyn.mechanism.drive import Drive
from monodyn.mechanism.steps import ERROR_BOUND, spacing
from monodyn.numbers import number, short

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

MOST_ROWS = 1_000_000
"""Rows of a prediction at most: a typing error in a time must not fill the disk."""


@dataclass(frozen=True, eq=False)
class States(Frozen):
    """Motion under the identified dynamics.

    Attributes:
        joints: Joint names, in the order of the dof axis.
        time: Time stamps [s], (frame,).
        position: Joint positions [rad or m], (frame, dof).
        velocity: Joint rates [rad/s or m/s], (frame, dof).
        std: Standard deviation of the positions from that of the fit [rad or m], (frame, dof).
        velocity_std: Standard deviation of the rates, likewise [rad/s or m/s], (frame, dof).
    """

    joints: tuple[str, ...]
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    std: np.ndarray
    velocity_std: np.ndarray

    def __post_init__(self) -> None:
        frames, dofs = len(self.time), len(self.joints)
        object.__setattr__(self, "time", frozen("States.time", self.time, (frames,)))
        for name in ("position", "velocity", "std", "velocity_std"):
            object.__setattr__(self, name, frozen(f"States.{name}", getattr(self, name), (frames, dofs)))

    def __len__(self) -> int:
        return len(self.time)

    def columns(self) -> dict[str, np.ndarray]:
        """Return the motion as columns of ``states.csv`` by name, each (frame,)."""
        ends = {"": self.position, "_vel": self.velocity, "_std": self.std, "_vel_std": self.velocity_std}
        found = {"time": self.time}
        for end, values in ends.items():
            found |= {f"{name}{end}": values[:, dof] for dof, name in enumerate(self.joints)}
        return found

    def to_pandas(self) -> DataFrame:
        """Return the motion as a table of pandas, with the columns of ``states.csv`` (needs monodyn[tables]).

        Returns:
            One row a time: ``time`` [s], and by joint the position [rad or m], ``_vel`` [rad/s or m/s], and
            their standard deviations ``_std`` and ``_vel_std``.
        """
        return extra("to_pandas", "pandas", "tables").DataFrame(self.columns())

    def to_xarray(self) -> Dataset:
        """Return the motion as a data set of xarray (needs monodyn[tables]).

        Returns:
            ``position``, ``velocity``, ``std`` and ``velocity_std`` by ``time`` and ``joint``.
        """
        names = ("position", "velocity", "std", "velocity_std")
        data = {name: (("time", "joint"), getattr(self, name)) for name in names}
        places = {"time": self.time, "joint": list(self.joints)}
        return extra("to_xarray", "xarray", "tables").Dataset(data, places)

    def __repr__(self) -> str:
        times = counted(len(self), "time")
        name, joints = type(self).__name__, brief(self.joints, "joints")
        return f"<{name} of {joints}: {times}, {stretch(self.time.tolist())}>"

    def _repr_html_(self) -> str:
        """Return the motion as HTML, for notebooks: where it begins and ends."""
        rows = []
        for dof, name in enumerate(self.joints if len(self) else ()):
            ends = [(self.position[k, dof], self.std[k, dof]) for k in (0, -1)]
            rows.append([name, *(text for value, std in ends for text in (number(value, std), short(std)))])
        columns = ("joint [rad or m]", "first", "std", "last", "std")
        return card(repr(self), table(columns, rows))


def fill(fit: Fit, times: np.ndarray, *, record: int = 0, error_bound: float = ERROR_BOUND) -> States:
    """Simulate the identified mechanism from the fitted start state, forwards and backwards.

    std^2 = diag(J C J^T) with J the derivative of the motion by parameters and start state, and C their
    covariance, and what the model lacks in addition, which grows before and after the fitted frames. It is
    infinite before and after free or known torques, where nothing is known of them, and throughout where the
    fit has no intervals.

    Args:
        fit: The identified mechanism.
        times: Time stamps [s], (frame,), increasing.
        record: Which record's start state.
        error_bound: Largest integration error that is aimed at [rad or m].

    Returns:
        The motion at ``times``.

    Raises:
        SettingsError: The times do not increase or are too far from the record, there is no such record,
            nothing was identified, or the error is none.
    """
    times = frozen("fill: times", times, (None,), error=SettingsError)
    times = increasing("fill: times", times, error=SettingsError)
    start = fit.start_of(record, "fill")
    if not 0.0 < error_bound < np.inf:
        raise SettingsError(
            f"fill: expected an error bound above 0 and finite [rad or m], got {error_bound:g}; give another."
        )
    stamps = fit.time[record]
    farthest = MOST_ROWS * spacing(stamps)
    if len(times) and max(start.time - times[0], times[-1] - start.time) > farthest:
        raise SettingsError(
            f"fill: expected times within {farthest:.3g} s of {start.time:g} s, got {times[0]:.6g} to "
            f"{times[-1]:.6g} s; give times nearer to those of the record."
        )
    # the start lies within the times: one rollout runs forwards from it, one backwards
    before = np.flatnonzero(times < start.time)[::-1]
    after = np.flatnonzero(times >= start.time)
    dofs = len(start.position)
    motion, std = np.zeros((2, len(times), 2 * dofs))
    for rows in (before, after):
        if len(rows):
            motion[rows], std[rows] = _one_way(fit, start, record, times[rows], error_bound)
    joints = tuple(joint.name for joint in fit.mechanism.joints)
    return States(joints, times, motion[:, :dofs], motion[:, dofs:], std[:, :dofs], std[:, dofs:])


@dataclass(frozen=True, eq=False)
class Carried:
    """A motion away from a start, with its derivatives.

    Attributes:
        stamps: Time stamps [s], (sample,), the start's the first, in steps that are fine enough.
        motion: Positions, then rates, (sample, 2 dof).
        slopes: Derivatives of these by parameters and start state, (sample, 2 dof, param + 2 dof).
        rows: Which of the stamps were asked for, int (frame,).
        drive: What acts.
        substeps: Integration steps between two stamps.
    """

    stamps: np.ndarray
    motion: np.ndarray
    slopes: np.ndarray
    rows: np.ndarray
    drive: Drive
    substeps: int


def moment(fit: Fit, time: float, *, record: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return the state of a record at a time, and what it depends on.

    Args:
        fit: The identified mechanism.
        time: Time stamp [s].
        record: Which record.

    Returns:
        Positions, then rates [SI], (2 dof,), and their derivatives by the estimated parameters and the start
        state, (2 dof, param + 2 dof).
    """
    carried = carried_from(fit, fit.starts[record], record, np.array([time]))
    row = carried.rows[0]
    return carried.motion[row], carried.slopes[row]


def carried_from(
    fit: Fit, start: Start, record: int, times: np.ndarray, *, error_bound: float = ERROR_BOUND
) -> Carried:
    """Simulate away from a start.

    Args:
        fit: The identified mechanism.
        start: The start.
        record: Which record's torques act.
        times: Time stamps [s], (frame,), that rise or fall from the start.
        error_bound: Largest integration error that is aimed at [rad or m].

    Returns:
        The motion, with its derivatives.
    """
    from monodyn.mechanism.simulate import accelerations, rollout_derivatives

    tree, state = fit.mechanism.tree, (start.position, start.velocity)
    stamps, rows, clock, drive, substeps = fit.steps(start, record, times, error_bound)
    q, v, dq, dv = rollout_derivatives(tree, fit.directions(), clock, *state, substeps=substeps, drive=drive)
    # of a function of the stretched clock the slope in the stretch is the rate times the time since
    if "time_scale" in fit.shared:
        at, since = fit.shared.index("time_scale"), (stamps - start.time)[:, None]
        dq[:, :, at] += v * since
        dv[:, :, at] += accelerations(tree, q, v, drive.at(clock)) * since
    motion, slopes = np.concatenate((q, v), axis=1), np.concatenate((dq, dv), axis=1)
    return Carried(stamps, motion, slopes, rows, drive, substeps)


def _one_way(
    fit: Fit, start: Start, record: int, times: np.ndarray, error_bound: float
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate away from the start: states at ``times``, positions then rates, and their standard deviations,
    each (frame, 2 dof)."""
    carried = carried_from(fit, start, record, times, error_bound=error_bound)
    rows, slopes = carried.rows, carried.slopes[carried.rows]
    variance = np.einsum("fip,pr,fir->fi", slopes, fit.motion_covariance(record), slopes, optimize=True)
    variance += _astray(fit, record, carried)[rows]
    # a fit that is not determined has no covariance
    unknown = np.isnan(variance).any(axis=1) | fit.unpushed(carried.stamps[rows], record)
    # rounding may leave a variance slightly below zero where the motion hardly depends on the unknowns
    std = np.where(unknown[:, None], np.inf, np.sqrt(np.maximum(variance, 0.0)))
    return carried.motion[rows], std


def _astray(fit: Fit, record: int, carried: Carried) -> np.ndarray:
    """Return by how much the motion is astray of the identified one for what the model lacks: variances that
    grow before and after the fitted frames, of the positions, then the rates, (sample, 2 dof)."""
    stamps, motion = carried.stamps, carried.motion
    added = np.zeros(motion.shape)
    if fit.unmodelled is None:
        return added
    density, covariance = fit.unmodelled
    # among the fitted frames it is as far off as it was there
    added[:] = np.diag(covariance)
    away = stamps > fit.time[record][-1] + 1e-9 if stamps[-1] > stamps[0] else stamps < stamps[0]
    if not away.any():
        return added
    from monodyn.mechanism.simulate import transitions

    clock, drive = stamps * fit.mechanism.values["time_scale"], carried.drive
    steps = transitions(fit.mechanism.tree, clock, motion, substeps=carried.substeps, drive=drive)
    for i in np.flatnonzero(away):
        pushed = random_push(density, clock[i] - clock[i - 1])
        covariance = steps[i] @ covariance @ steps[i].T + pushed
        added[i] = np.diag(covariance)
    return added


def random_push(density: np.ndarray, seconds: float) -> np.ndarray:
    """Return the covariance that random accelerations and their integrals add to a state.

    Args:
        density: Spectral density of each joint's acceleration [rad^2/s^3 or m^2/s^3], (dof,).
        seconds: For how long they act [s]; below zero for the state before them.

    Returns:
        Covariance of positions, then rates [SI], (2 dof, 2 dof).
    """
    h = abs(seconds)
    both = 0.5 * h * seconds
    return np.kron([[h**3 / 3.0, both], [both, h]], np.diag(density))
