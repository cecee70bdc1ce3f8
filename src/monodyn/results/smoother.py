"""A record and its identified mechanism in, the motion at any time out, gaps filled from both sides.

Where the noise explains what the fit leaves over, parameters and start state hold all that the fitted frames
know, and the motion is the roll-out. Else random accelerations push the motion off it, and every measured
position shows where it is near its own time. The states, and the parameters that all of them share, then form
a chain along the identified dynamics: a Kalman filter goes through it forwards, and its adjoint backwards.
The dynamics are linearised about the motion that the pass before found.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.arrays import increasing, usual_step
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Fit
from monodyn.estimation.verdict.unmodelled import noise_of_rows
from monodyn.mechanism.steps import ERROR_BOUND, MOST_SUBSTEPS, fine_stamps
from monodyn.mechanism.substeps import least_substeps
from monodyn.results.chain import Chain, Dynamics, Pass, Seen, settled
from monodyn.results.fill import States, fill
from monodyn.results.trace import fitted_rows, metric
from monodyn.types import Poses

WIDER = 25.0
"""Variance of parameters and start state before the first frame, over that of the fit: where the frames of
the fit are used again, what the fit knows from them may hardly count."""
SHOWS = 2.0
"""Standard deviations above zero from which on the covariance of neighbouring residuals shows."""
SAME = 1e-9
"""Time stamps that are closer are the same [s]."""


def smooth(fit: Fit, poses: Poses, times: np.ndarray | None = None, *, record: int = 0) -> States:
    """Return the motion that the identified dynamics and the frames on both sides determine.

    The state x of positions and rates follows x(t') = f(x(t), p) + w, with w from random accelerations of the
    density that the fit found, and p about the identified parameters; what is measured is x with its noise.
    A record is used beyond its fitted frames as well. Where nothing is lacking w is zero, and what the fitted
    frames say is in the fit: those before and after them alone correct the motion, which without such frames
    is that of ``fill``. Free torques follow the record by themselves: with them it is that of ``fill``, too.

    Args:
        fit: The identified mechanism.
        poses: The whole record; what is hidden in it may be single joints.
        times: Time stamps [s], (frame,), increasing; those of the record when left out. They may lie between
            its rows, where frames were dropped.
        record: Which record of the fit it is.

    Returns:
        The motion; its standard deviations are those of the pose in a frame, see ``framed``.

    Raises:
        SettingsError: the times do not increase, there is no such record, or nothing was identified.
        VideoError: the record is not the one that was fitted.

    Source:
        Rauch, Tung and Striebel, Maximum likelihood estimates of linear dynamic systems, 1965, in the form of
        Bryson and Frazier, 1963, which inverts no covariance of a state; iterated: Bell, The iterated Kalman
        smoother as a Gauss-Newton method, 1994.

    Example:
        ``smooth(fit, poses).position[~poses.measured]`` are the positions that were not seen.
    """
    stamps = increasing(
        "smooth: times", np.asarray(poses.time if times is None else times, float), error=SettingsError
    )
    rolled = fill(fit, stamps, record=record)
    seen = _seen(fit, poses, record)
    chain = _chain(fit, seen, stamps, record)
    if chain is None:
        return framed(fit, rolled, record)
    found = settled(chain, seen)
    # a motion that cannot be followed from one side of a gap to the other is not known in it
    known = _unknown(rolled) if found is None else _joined(rolled, chain, seen, *found)
    return framed(fit, known, record)


def _seen(fit: Fit, poses: Poses, record: int) -> Seen:
    """Collect what is measured that the fit has not used, and where the model lacks something all of it."""
    if not fit.residual:
        raise SettingsError(
            "smooth: expected a fit with its residuals, got one that was read back from a run folder; "
            "states.csv holds its motion, gaps filled, or identify poses.csv again."
        )
    first, stop = fitted_rows(fit, poses, record)
    poses = metric(poses, fit.mechanism, fit.scale, fit.common_of(record))
    rows, residual = slice(first, stop), fit.residual[record]
    fitted = np.zeros(len(poses), dtype=bool)
    fitted[rows] = True
    used = poses.measured.copy()
    # what has no residual was left out as a gross error
    used[rows] &= np.isfinite(residual) & (fit.unmodelled is not None)
    rms = np.array([fit.rms[name] for name in poses.joints])
    covariance = poses.covariance.copy()
    # without a stated noise it is what the residuals show
    unstated = ~(np.diagonal(covariance, axis1=1, axis2=2) > 0.0)
    covariance[unstated.any(axis=1)] = np.diag(rms**2)
    stated = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    there = np.where(np.isfinite(residual), stated[rows], np.nan)
    # what is no motion changes from row to row; where nothing is lacking that is all of it
    found = np.abs(residual) if fit.unmodelled is None else noise_of_rows(residual, there)
    known = np.isfinite(there).any(axis=0)
    factor = np.ones(len(rms))
    factor[known] = np.sqrt(np.nanmean((found[:, known] / there[:, known]) ** 2, axis=0))
    shared = np.zeros_like(stated) if poses.shifts is None else np.sum(poses.shifts**2, axis=0)
    limits = np.array([[joint.lower, joint.upper] for joint in fit.mechanism.joints])
    hinge = np.array([joint.kind == "hinge" for joint in fit.mechanism.joints])
    turning = hinge & ~np.isfinite(limits).all(axis=1)
    noise = covariance * np.outer(factor, factor)
    return Seen(poses.time, poses.position, used, noise, shared, turning, fitted)


def _chain(fit: Fit, seen: Seen, times: np.ndarray, record: int) -> Chain | None:
    """Lay out the chain through the times and the record; None where the roll-out is all that is known."""
    if fit.torque == "free" or not seen.used.any() or not np.isfinite(fit.motion_covariance(record)).all():
        return None
    every = np.concatenate((seen.time, times[np.abs(_nearest(seen.time, times) - times) > SAME]))
    # where known torques are not known there are no dynamics to go along
    every = np.sort(every[~fit.unpushed(every, record)])
    usual = usual_step(fit.time[record])
    stamps, _ = fine_stamps(every[0], every, usual)
    dynamics = _dynamics(fit, stamps, record)
    start, covariance = _begun(dynamics, fine_stamps(fit.starts[record].time, stamps[:1], usual)[0], record)
    asked = np.flatnonzero(np.abs(_nearest(stamps, times) - times) <= SAME)
    measured = np.full(len(stamps), -1)
    rows = np.flatnonzero(np.abs(_nearest(stamps, seen.time) - seen.time) <= SAME)
    measured[np.searchsorted(stamps, seen.time[rows] - SAME)] = rows
    wanted = np.searchsorted(stamps, times[asked] - SAME)
    return Chain(dynamics, stamps, wanted, asked, measured, start, covariance)


def _dynamics(fit: Fit, stamps: np.ndarray, record: int) -> Dynamics:
    """Return the dynamics with as many integration steps between two stamps as the motion needs."""
    from monodyn.mechanism.simulate import rollout

    start, tree = fit.starts[record], fit.mechanism.tree
    drive, least = fit.driven(stamps, record)
    later = np.concatenate(([start.time], stamps[stamps > start.time + SAME]))
    clock = later * fit.mechanism.values["time_scale"]

    def positions(substeps: int) -> np.ndarray:
        return rollout(tree, clock, start.position, start.velocity, substeps=substeps, drive=drive)[0]

    substeps, _ = least_substeps(positions, ERROR_BOUND, MOST_SUBSTEPS, least)
    return Dynamics(fit, drive, substeps)


def _begun(dynamics: Dynamics, way: np.ndarray, record: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the state at the end of the way from the start of the fit, and what is known of it and of the
    parameters before the record is used."""
    fit, spread = dynamics.fit, dynamics.spread
    start, count = fit.starts[record], len(dynamics.spread)
    state = np.concatenate((start.position, start.velocity))
    width = len(state)
    carried = np.eye(width, width + count)
    if len(way) > 1:
        state, carried = dynamics.ahead(way, state)
    # the covariance of the fit has the parameters first, and in their own units
    unit = np.concatenate((np.ones(width), np.where(spread > 0.0, spread, 1.0)))
    order = np.roll(np.arange(count + width), -count)
    known = fit.motion_covariance(record)[np.ix_(order, order)] / np.outer(unit, unit)
    onto = np.concatenate((carried, np.eye(count, width + count, width)))
    known = onto @ known @ onto.T
    if fit.unmodelled is not None:
        known *= WIDER
        known[:width, :width] += fit.unmodelled.off
    return state, known


def _nearest(stamps: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the stamp nearest to each time."""
    after = np.searchsorted(stamps, times)
    left, right = stamps[np.maximum(after - 1, 0)], stamps[np.minimum(after, len(stamps) - 1)]
    return np.where(np.abs(times - left) <= np.abs(right - times), left, right)


def _joined(rolled: States, chain: Chain, seen: Seen, found: Pass, lost: np.ndarray) -> States:
    """Put the smoothed motion in the place of the roll-out."""
    rows, dofs = chain.wanted, seen.position.shape[1]
    variance = np.maximum(np.diagonal(found.covariance[rows], axis1=1, axis2=2), 0.0)
    # frames that lie farther from what the filter expects than it believes make it know less
    time, fitted = chain.stamps[rows], seen.time[seen.fitted][[0, -1]]
    inside = ((time >= fitted[0] - SAME) & (time <= fitted[1] + SAME)).astype(int)
    variance = variance * np.maximum(found.ratio, 1.0)[inside, np.newaxis]
    # what moves all measured positions together moves the motion with them
    for dof in range(dofs):
        variance[:, dof] += np.interp(time, seen.time, seen.shared[:, dof])
    states, std = (
        np.concatenate((rolled.position, rolled.velocity), axis=1),
        np.full((len(rolled.time), 2 * dofs), np.inf),
    )
    states[chain.asked], std[chain.asked] = found.states[rows], np.sqrt(variance)
    std[chain.asked[lost[rows]]] = np.inf
    return States(
        rolled.joints, rolled.time, states[:, :dofs], states[:, dofs:], std[:, :dofs], std[:, dofs:]
    )


def _unknown(rolled: States) -> States:
    """Return the roll-out as one of which nothing is known."""
    endless = np.full_like(rolled.std, np.inf)
    return replace(rolled, std=endless, velocity_std=endless)


def framed(fit: Fit, states: States, record: int) -> States:
    """Add to the bands what sets the pose in a frame apart from the motion.

    That is the error of its time stamp, and what is slow in the residuals where it is too little of it to be
    explained by random accelerations.

    Args:
        fit: The identified mechanism.
        states: Its motion at the time stamps.
        record: Which record.

    Returns:
        The motion with wider bands.
    """
    from monodyn.mechanism.simulate import accelerations

    scale = fit.mechanism.values["time_scale"]
    drive, _ = fit.driven(states.time, record)
    rate = accelerations(fit.mechanism.tree, states.position, states.velocity, drive.at(states.time * scale))
    late = fit.stamp_error * scale
    over = np.zeros(states.std.shape[1]) if fit.unmodelled is not None else left_over(fit.residual[record])
    std = np.sqrt(states.std**2 + (late * states.velocity) ** 2 + over)
    return replace(states, std=std, velocity_std=np.hypot(states.velocity_std, late * rate))


def left_over(residual: np.ndarray) -> np.ndarray:
    """Return the mean square of what is slow in residuals: their covariance from row to row, where it shows.

    Args:
        residual: Residuals, NaN where not measured, (frame, dof).

    Returns:
        Its mean square, zero where noise alone may be the reason, (dof,).
    """
    found = np.zeros(residual.shape[1])
    for dof, column in enumerate(residual.T):
        pairs = column[1:] * column[:-1]
        pairs, squares = pairs[np.isfinite(pairs)], column[np.isfinite(column)] ** 2
        # of white noise the mean of n products has the variance over the root of n as its deviation
        if len(pairs) and np.mean(pairs) > SHOWS * np.mean(squares) / np.sqrt(len(pairs)):
            found[dof] = np.mean(pairs)
    return found
