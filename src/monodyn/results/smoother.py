"""A record and its identified mechanism in, the motion at any time out, gaps filled from both sides.

Where the noise explains what the fit leaves over, parameters and start state hold all that the fitted frames
know, and the motion is the roll-out. Else random accelerations push the motion off it, and every measured
position shows where it is near its own time. The states, and the parameters that all of them share, then form
a chain along the identified dynamics: a Kalman filter goes through it forwards, and its adjoint backwards.
The dynamics are linearised about the motion that the pass before found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from monodyn.arrays import increasing
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Fit
from monodyn.estimation.verdict.unmodelled import noise_of_rows
from monodyn.mechanism.drive import Drive
from monodyn.mechanism.tree import Directions
from monodyn.results.fill import (
    ERROR_BOUND,
    MOST_FILL_SUBSTEPS,
    States,
    fill,
    fine_stamps,
    random_push,
)
from monodyn.results.trace import fitted_rows, metric
from monodyn.types import Poses

WIDER = 25.0
"""Variance of parameters and start state before the first frame, over that of the fit: where the frames of
the fit are used again, what the fit knows from them may hardly count."""
FAR = 4.0
"""Standard deviations beyond which a measured position counts less the farther it is off."""
PASSES = 20
"""Most linearisations."""
SAME = 1e-9
"""Time stamps that are closer are the same [s]."""
SETTLED = 0.02
"""Standard deviations by which the motion may change from one linearisation to the next at the end."""


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
        The motion; its standard deviations have the error of a frame's time stamp in addition.

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
    seen = _Seen.of(fit, poses, record)
    chain = _chain(fit, seen, stamps, record)
    if chain is None:
        return _framed(fit, rolled, record)
    return _framed(fit, _joined(rolled, chain, seen, _settled(chain, seen)), record)


def filled(fit: Fit, poses: Poses, times: np.ndarray | None = None, *, record: int = 0) -> States:
    """Return the motion that stands for a record in the run folder.

    It is that of ``smooth`` where the model lacks something. Else it is the roll-out, which any simulator
    follows, but for one case: frames outside of the fitted ones in which something was hidden, and that the
    roll-out gives less exactly than they would have been measured.

    Args:
        fit: The identified mechanism.
        poses: The whole record.
        times: Time stamps [s], (frame,), increasing; those of the record when left out.
        record: Which record of the fit it is.

    Returns:
        The motion; its standard deviations have the error of a frame's time stamp in addition.
    """
    if not fit.ok:
        # of another mechanism than the filmed one: no gap is filled by it
        return fill(fit, poses.time if times is None else times, record=record)
    if fit.unmodelled is None:
        first, stop = fitted_rows(fit, poses, record)
        hidden = ~poses.measured
        hidden[first:stop] = False
        noise = np.array([fit.rms[name] for name in poses.joints])
        rough = fill(fit, poses.time, record=record).std > noise
        if not np.any(rough & hidden):
            poses = poses.part(first, stop)
    return smooth(fit, poses, times, record=record)


@dataclass(frozen=True, eq=False)
class _Seen:
    """What is measured that the motion is drawn to.

    Attributes:
        time: Time stamps [s], (frame,).
        position: Measured positions [rad or m], (frame, dof).
        used: True for those that count, (frame, dof).
        noise: Their covariance as it was found, (frame, dof, dof).
        shared: Variance of what moves all positions together, (frame, dof).
        turning: True for hinges whose whole turns are open, (dof,).
        fitted: True for the rows that the fit has used, (frame,).
    """

    time: np.ndarray
    position: np.ndarray
    used: np.ndarray
    noise: np.ndarray
    shared: np.ndarray
    turning: np.ndarray
    fitted: np.ndarray

    @classmethod
    def of(cls, fit: Fit, poses: Poses, record: int) -> _Seen:
        """Collect it: all that the fit has not used, and where the model lacks something that, too."""
        first, stop = fitted_rows(fit, poses, record)
        poses = metric(poses, fit.mechanism, fit.scale)
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
        return cls(poses.time, poses.position, used, noise, shared, turning, fitted)


@dataclass(frozen=True, eq=False)
class _Dynamics:
    """The identified dynamics from one time to another.

    Attributes:
        fit: The identified mechanism.
        drive: What acts in addition to friction and springs.
        substeps: Integration steps between two stamps.
    """

    fit: Fit
    drive: Drive
    substeps: int

    @cached_property
    def spread(self) -> np.ndarray:
        """Standard deviations of the estimated parameters, the units that these are counted in, (param,)."""
        return np.sqrt(np.maximum(np.diag(self.fit.shared_covariance), 0.0))

    @cached_property
    def directions(self) -> Directions:
        """What each parameter changes."""
        return self.fit.directions()

    @cached_property
    def density(self) -> np.ndarray:
        """Density of the random accelerations [rad^2/s^3 or m^2/s^3], (dof,)."""
        dofs = len(self.fit.mechanism.joints)
        return np.zeros(dofs) if self.fit.unmodelled is None else self.fit.unmodelled.density

    def pushed(self, stamps: np.ndarray) -> np.ndarray:
        """Return the covariance that random accelerations add between two stamps, (2 dof, 2 dof)."""
        return random_push(self.density, (stamps[1] - stamps[0]) * self.fit.mechanism.values["time_scale"])

    def ahead(self, stamps: np.ndarray, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the state at the last stamp, (2 dof,), and its derivatives by that at the first, then by the
        parameters, (2 dof, 2 dof + param)."""
        from monodyn.mechanism.simulate import accelerations, rollout_derivatives

        tree, clock = self.fit.mechanism.tree, stamps * self.fit.mechanism.values["time_scale"]
        q, v, dq, dv = rollout_derivatives(
            tree, self.directions, clock, *np.split(state, 2), substeps=self.substeps, drive=self.drive
        )
        slopes, shared = np.concatenate((dq[-1], dv[-1])), len(self.spread)
        if "time_scale" in self.fit.shared:
            rate = accelerations(tree, q[-1:], v[-1:], self.drive.at(clock[-1:]))[0]
            more = np.concatenate((v[-1], rate)) * (stamps[-1] - stamps[0])
            slopes[:, self.fit.shared.index("time_scale")] += more
        ordered = np.concatenate((slopes[:, shared:], slopes[:, :shared] * self.spread), axis=1)
        return np.concatenate((q[-1], v[-1])), ordered


@dataclass(frozen=True, eq=False)
class _Chain:
    """The motion as states at time stamps, each following from the one before.

    Attributes:
        dynamics: How.
        stamps: Time stamps [s], (frame,).
        wanted: Stamps that were asked for, int (wanted,).
        asked: Their rows among all times that were asked for, int (wanted,).
        measured: Row of the record at each stamp, -1 for none, int (frame,).
        start: State at the first stamp, (2 dof,).
        covariance: What is known of it and of the parameters before, (2 dof + param, 2 dof + param).
    """

    dynamics: _Dynamics
    stamps: np.ndarray
    wanted: np.ndarray
    asked: np.ndarray
    measured: np.ndarray
    start: np.ndarray
    covariance: np.ndarray


class _Pass(NamedTuple):
    """What one linearisation leads to.

    Attributes:
        states: Positions, then rates, (frame, 2 dof).
        covariance: Their covariance, (frame, 2 dof, 2 dof).
        ratio: Mean square of the innovations over what it should be, for rows that the fit has not used and
            for those that it has, (2,).
    """

    states: np.ndarray
    covariance: np.ndarray
    ratio: np.ndarray


def _chain(fit: Fit, seen: _Seen, times: np.ndarray, record: int) -> _Chain | None:
    """Lay out the chain through the times and the record; None where the roll-out is all that is known."""
    if fit.torque == "free" or not seen.used.any() or not np.isfinite(fit.motion_covariance(record)).all():
        return None
    every = np.concatenate((seen.time, times[np.abs(_nearest(seen.time, times) - times) > SAME]))
    # where known torques are not known there are no dynamics to go along
    every = np.sort(every[~fit.unpushed(every, record)])
    usual = float(np.median(np.diff(fit.time[record])))
    stamps, _ = fine_stamps(every[0], every, usual)
    dynamics = _dynamics(fit, stamps, record)
    start, covariance = _begun(dynamics, fine_stamps(fit.starts[record].time, stamps[:1], usual)[0], record)
    asked = np.flatnonzero(np.abs(_nearest(stamps, times) - times) <= SAME)
    measured = np.full(len(stamps), -1)
    rows = np.flatnonzero(np.abs(_nearest(stamps, seen.time) - seen.time) <= SAME)
    measured[np.searchsorted(stamps, seen.time[rows] - SAME)] = rows
    wanted = np.searchsorted(stamps, times[asked] - SAME)
    return _Chain(dynamics, stamps, wanted, asked, measured, start, covariance)


def _dynamics(fit: Fit, stamps: np.ndarray, record: int) -> _Dynamics:
    """Return the dynamics with as many integration steps between two stamps as the motion needs."""
    from monodyn.mechanism.simulate import least_substeps, rollout

    start, tree = fit.starts[record], fit.mechanism.tree
    drive, least = fit.driven(stamps, record)
    later = np.concatenate(([start.time], stamps[stamps > start.time + SAME]))
    clock = later * fit.mechanism.values["time_scale"]

    def positions(substeps: int) -> np.ndarray:
        return rollout(tree, clock, start.position, start.velocity, substeps=substeps, drive=drive)[0]

    substeps, _ = least_substeps(positions, ERROR_BOUND, MOST_FILL_SUBSTEPS, least)
    return _Dynamics(fit, drive, substeps)


def _begun(dynamics: _Dynamics, way: np.ndarray, record: int) -> tuple[np.ndarray, np.ndarray]:
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


def _settled(chain: _Chain, seen: _Seen) -> _Pass:
    """Linearise about the motion again and again until it stays."""
    dofs = len(chain.dynamics.density)
    found, weaker = _passed(chain, seen, None, np.ones(len(seen.time))), np.ones(len(seen.time))
    for _ in range(PASSES):
        before, weaker = found, _weaker(chain, seen, found.states[:, :dofs])
        found = _passed(chain, seen, before.states, weaker)
        change = (found.states - before.states) ** 2
        if np.all(change <= SETTLED**2 * np.diagonal(found.covariance, axis1=1, axis2=2)):
            return found
    # a motion that does not settle is known no better than it moves
    covariance = found.covariance + change[:, :, None] * np.eye(2 * dofs)
    return found._replace(covariance=covariance)


def _weaker(chain: _Chain, seen: _Seen, position: np.ndarray) -> np.ndarray:
    """Return by which factor the noise of each row counts as larger: of one that is far off it does."""
    factor = np.ones(len(seen.time))
    for at, row in enumerate(chain.measured):
        use = np.flatnonzero(seen.used[row] & (row >= 0))
        if len(use):
            off = _off(seen, row, use, position[at])
            size = off @ np.linalg.solve(seen.noise[row][np.ix_(use, use)], off) / len(use)
            factor[row] = max(1.0, size / FAR**2)
    return factor


def _off(seen: _Seen, row: int, use: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return measured less other positions of the joints that are used, (used,)."""
    off = seen.position[row, use] - position[use]
    # a gap may hide a turn
    return np.where(seen.turning[use], off - 2.0 * np.pi * np.round(off / (2.0 * np.pi)), off)


def _passed(chain: _Chain, seen: _Seen, about: np.ndarray | None, weaker: np.ndarray) -> _Pass:
    """Go forwards and backwards once, linearised about a motion; without one about the filtered states.

    The state of the chain has positions and rates, then the parameters less the identified ones.
    """
    count, width, full = len(chain.stamps), len(chain.start), len(chain.covariance)
    mean, covariance = np.zeros(full), chain.covariance
    mean[:width] = chain.start
    means, covariances = np.empty((count, full)), np.empty((count, full, full))
    carried, gained = np.zeros((count, full, full)), np.tile(np.eye(full), (count, 1, 1))
    pulls, weights = np.zeros((count, full)), np.zeros((count, full, full))
    sums = np.zeros((2, 2))
    for at, row in enumerate(chain.measured):
        means[at], covariances[at] = mean, covariance
        use = np.flatnonzero(seen.used[row] & (row >= 0))
        if len(use):
            noise = weaker[row] * seen.noise[row][np.ix_(use, use)]
            inverse = np.linalg.inv(covariance[np.ix_(use, use)] + noise)
            off = _off(seen, row, use, mean)
            gain = covariance[:, use] @ inverse
            pulls[at, use] = inverse @ off
            weights[at][np.ix_(use, use)] = inverse
            gained[at][:, use] -= gain
            mean = mean + gain @ off
            covariance = gained[at] @ covariance @ gained[at].T + gain @ noise @ gain.T
            sums[int(seen.fitted[row])] += off @ inverse @ off, len(use)
        if at + 1 < count:
            point = mean[:width] if about is None else about[at]
            stamps = chain.stamps[at : at + 2]
            ahead, slopes = chain.dynamics.ahead(stamps, point)
            carried[at] = np.eye(full)
            carried[at][:width] = slopes
            moved = carried[at] @ mean
            moved[:width] = (
                ahead + slopes[:, :width] @ (mean[:width] - point) + slopes[:, width:] @ mean[width:]
            )
            mean, covariance = moved, carried[at] @ covariance @ carried[at].T
            covariance[:width, :width] += chain.dynamics.pushed(stamps)
            covariance = 0.5 * (covariance + covariance.T)
    states, spread = np.empty((count, width)), np.empty((count, width, width))
    pull, weight = np.zeros(full), np.zeros((full, full))
    for at in range(count - 1, -1, -1):
        # what all later frames say, brought back to the state before this frame was used
        pull = pulls[at] + gained[at].T @ (carried[at].T @ pull)
        weight = weights[at] + gained[at].T @ (carried[at].T @ weight @ carried[at]) @ gained[at]
        part = covariances[at][:width]
        states[at] = means[at][:width] + part @ pull
        spread[at] = covariances[at][:width, :width] - part @ weight @ part.T
    return _Pass(states, spread, sums[:, 0] / np.maximum(sums[:, 1], 1.0))


def _joined(rolled: States, chain: _Chain, seen: _Seen, found: _Pass) -> States:
    """Put the smoothed motion in the place of the roll-out."""
    rows, dofs = chain.wanted, seen.position.shape[1]
    variance = np.maximum(np.diagonal(found.covariance[rows], axis1=1, axis2=2), 0.0)
    # frames that lie farther from what the filter expects than it believes make it know less
    inside = np.zeros(len(rows), dtype=int)
    inside[np.isin(chain.measured[rows], np.flatnonzero(seen.fitted))] = 1
    variance = variance * np.maximum(found.ratio, 1.0)[inside, np.newaxis]
    # what moves all measured positions together moves the motion with them
    for dof in range(dofs):
        variance[:, dof] += np.interp(chain.stamps[rows], seen.time, seen.shared[:, dof])
    states, std = (
        np.concatenate((rolled.position, rolled.velocity), axis=1),
        np.full((len(rolled.time), 2 * dofs), np.inf),
    )
    states[chain.asked], std[chain.asked] = found.states[rows], np.sqrt(variance)
    return States(rolled.time, states[:, :dofs], states[:, dofs:], std[:, :dofs], std[:, dofs:])


def _framed(fit: Fit, states: States, record: int) -> States:
    """Add what the error of its time stamp does to the pose in a frame."""
    if not fit.stamp_error:
        return states
    from monodyn.mechanism.simulate import accelerations

    scale = fit.mechanism.values["time_scale"]
    drive, _ = fit.driven(states.time, record)
    rate = accelerations(fit.mechanism.tree, states.position, states.velocity, drive.at(states.time * scale))
    late = fit.stamp_error * scale
    std = np.hypot(states.std, late * states.velocity)
    return replace(states, std=std, velocity_std=np.hypot(states.velocity_std, late * rate))
