"""An identified mechanism in, its motion at any time stamps out: before, within and after the fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.arrays import frozen, increasing
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Fit, Start
from monodyn.mechanism.drive import Drive

ERROR_BOUND = 1e-6
"""Largest integration error that is aimed at [rad or m]."""
MOST_FILL_SUBSTEPS = 64


@dataclass(frozen=True, eq=False)
class States:
    """Motion under the identified dynamics.

    Attributes:
        time: Time stamps [s], (frame,).
        position: Joint positions [rad or m], (frame, dof).
        velocity: Joint rates [rad/s or m/s], (frame, dof).
        std: Standard deviation of the positions from that of the fit [rad or m], (frame, dof).
        velocity_std: Standard deviation of the rates, likewise [rad/s or m/s], (frame, dof).
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    std: np.ndarray
    velocity_std: np.ndarray

    def __post_init__(self) -> None:
        frames, dofs = np.shape(self.position)
        object.__setattr__(self, "time", frozen("States.time", self.time, (frames,)))
        for name in ("position", "velocity", "std", "velocity_std"):
            object.__setattr__(self, name, frozen(f"States.{name}", getattr(self, name), (frames, dofs)))


def fill(fit: Fit, times: np.ndarray, *, record: int = 0) -> States:
    """Simulate the identified mechanism from the fitted start state, forwards and backwards.

    std^2 = diag(J C J^T) with J the derivative of the motion by parameters and start state, and C their
    covariance, and what the model lacks in addition, which grows before and after the fitted frames. It is
    infinite before and after free or known torques, where nothing is known of them, and throughout where the
    fit has no intervals.

    Args:
        fit: The identified mechanism.
        times: Time stamps [s], (frame,), increasing.
        record: Which record's start state.

    Returns:
        The motion at ``times``.

    Raises:
        SettingsError: The times do not increase, there is no such record, or nothing was identified.
    """
    times = increasing("fill: times", np.asarray(times, dtype=float), error=SettingsError)
    if not fit.starts:
        raise SettingsError(f"fill: expected an identified mechanism, got a fit without one: {fit.status}")
    if not 0 <= record < len(fit.starts):
        raise SettingsError(f"fill: expected a record from 0 to {len(fit.starts) - 1}, got {record}.")
    start = fit.starts[record]
    # the start lies within the times: one rollout runs forwards from it, one backwards
    usual = float(np.median(np.diff(fit.time[record]))) if len(fit.time[record]) > 1 else 0.05
    before = np.flatnonzero(times < start.time)[::-1]
    after = np.flatnonzero(times >= start.time)
    dofs = len(start.position)
    motion, std = np.zeros((2, len(times), 2 * dofs))
    for rows in (before, after):
        if len(rows):
            motion[rows], std[rows] = _one_way(fit, start, record, times[rows], usual)
    return States(times, motion[:, :dofs], motion[:, dofs:], std[:, :dofs], std[:, dofs:])


def _one_way(
    fit: Fit, start: Start, record: int, times: np.ndarray, usual: float
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate away from the start: states at ``times``, positions then rates, and their standard deviations,
    each (frame, 2 dof)."""
    from monodyn.mechanism.simulate import accelerations, least_substeps, rollout, rollout_derivatives

    mechanism = fit.mechanism
    tree, stretch = mechanism.tree, mechanism.values["time_scale"]
    stamps, rows = fine_stamps(start.time, times, usual)
    drive, least = fit.driven(stamps, record)
    # a clip k times slower than life has time_scale 1/k: dynamics and drive run on the stretched clock
    clock = stamps * stretch
    state = (start.position, start.velocity)

    def positions(substeps: int) -> np.ndarray:
        return rollout(tree, clock, *state, substeps=substeps, drive=drive)[0]

    substeps, _ = least_substeps(positions, ERROR_BOUND, MOST_FILL_SUBSTEPS, least)
    q, v, dq, dv = rollout_derivatives(tree, fit.directions(), clock, *state, substeps=substeps, drive=drive)
    # of a function of the stretched clock the slope in the stretch is the rate times the time since
    if "time_scale" in fit.shared:
        at, since = fit.shared.index("time_scale"), (stamps - start.time)[:, None]
        dq[:, :, at] += v * since
        dv[:, :, at] += accelerations(tree, q, v, drive.at(clock)) * since
    covariance = fit.motion_covariance(record)
    by_unknowns = np.concatenate((dq, dv), axis=1)[rows]
    variance = np.einsum("fip,pr,fir->fi", by_unknowns, covariance, by_unknowns, optimize=True)
    variance += _astray(fit, record, stamps, (q, v), drive, substeps)[rows]
    # a fit that is not determined has no covariance
    unknown = np.isnan(variance).any(axis=1) | fit.unpushed(stamps[rows], record)
    # rounding may leave a variance slightly below zero where the motion hardly depends on the unknowns
    std = np.where(unknown[:, None], np.inf, np.sqrt(np.maximum(variance, 0.0)))
    return np.concatenate((q, v), axis=1)[rows], std


def _astray(
    fit: Fit,
    record: int,
    stamps: np.ndarray,
    motion: tuple[np.ndarray, np.ndarray],
    drive: Drive,
    substeps: int,
) -> np.ndarray:
    """Return by how much the motion is astray of the identified one for what the model lacks: variances that
    grow before and after the fitted frames, of the positions, then the rates, (frame, 2 dof)."""
    added = np.zeros((len(stamps), 2 * motion[0].shape[1]))
    if fit.unmodelled is None:
        return added
    density, covariance = fit.unmodelled
    # among the fitted frames it is as far off as it was there
    added[:] = np.diag(covariance)
    away = stamps > fit.time[record][-1] + 1e-9 if stamps[-1] > stamps[0] else stamps < stamps[0]
    if not away.any():
        return added
    from monodyn.mechanism.simulate import transitions

    clock, start = stamps * fit.mechanism.values["time_scale"], np.concatenate([part[0] for part in motion])
    carried = transitions(fit.mechanism.tree, clock, start, substeps=substeps, drive=drive)
    for i in np.flatnonzero(away):
        pushed = random_push(density, clock[i] - clock[i - 1])
        covariance = carried[i] @ covariance @ carried[i].T + pushed
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


def fine_stamps(first: float, times: np.ndarray, usual: float) -> tuple[np.ndarray, np.ndarray]:
    """Put the start before ``times`` and stamps into gaps over twice the usual step.

    Args:
        first: Time stamp of the start [s].
        times: Time stamps [s], (frame,), rising or falling away from it.
        usual: The usual step [s].

    Returns:
        All stamps, and which of them are ``times``, int (frame,).
    """
    # substeps are chosen for the usual step; a gap (frames that did not decode) is cut into such steps
    stamps = times if times[0] == first else np.concatenate(([first], times))
    parts = np.maximum(np.ceil(np.abs(np.diff(stamps)) / (2.0 * usual) - 1e-9), 1.0).astype(int)
    at = np.concatenate(([0], np.cumsum(parts)))
    filled = np.interp(np.arange(at[-1] + 1), at, stamps)
    return filled, at[len(stamps) - len(times) :]
