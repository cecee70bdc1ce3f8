"""A chain of states along the identified dynamics and what is measured of it in, its likeliest motion out.

A Kalman filter goes through the chain forwards, its adjoint goes back; the dynamics that they go through are
linear about the motion that the pass before found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from monodyn.arrays import usual_step
from monodyn.estimation.fit import Fit
from monodyn.mechanism.drive import Drive
from monodyn.mechanism.tree import Directions
from monodyn.results.fill import random_push

FAR = 4.0
"""Standard deviations beyond which a measured position counts less the farther it is off."""
PASSES = 12
"""Most linearisations with random accelerations of one density."""
SETTLED = 0.02
"""Standard deviations by which the motion may change from one linearisation to the next at the end."""
SHORTEST = 0.1
"""Least share of a step towards the motion of the next linearisation."""
GAP = 2.5
"""Usual steps without a measured position from which on it is a gap."""
MISSED = 5.0
"""Standard deviations of an innovation after a gap, from which on a motion may not be the likeliest one."""
FASTEST = 20.0
"""Rate of a motion that begins anew, one standard deviation [pi rad/s, or pi m/s]."""
EASED = 10.0 ** np.arange(7.0, -0.1, -0.5)
"""Factors of the density by which a wild motion is led to what is measured, one after the other."""
MOST_FAILED = 3
"""Factors in a row with which it does not settle, after which it is given up."""


@dataclass(frozen=True, eq=False)
class Seen:
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


@dataclass(frozen=True, eq=False)
class Dynamics:
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

    @property
    def dofs(self) -> int:
        """Number of joints."""
        return len(self.fit.mechanism.joints)

    @cached_property
    def density(self) -> np.ndarray:
        """Density of the random accelerations [rad^2/s^3 or m^2/s^3], (dof,)."""
        return np.zeros(self.dofs) if self.fit.unmodelled is None else self.fit.unmodelled.density

    def pushed(self, stamps: np.ndarray, stronger: float) -> np.ndarray:
        """Return the covariance that random accelerations add from one stamp to the next.

        Args:
            stamps: Both [s], (frame,).
            stronger: Factor of their density.

        Returns:
            Covariance of positions, then rates [SI], (2 dof, 2 dof).
        """
        density = self.density
        if stronger > 1.0:
            # where there are none, those that move the motion by its residuals in a second
            least = np.array([3.0 * self.fit.rms[joint.name] ** 2 for joint in self.fit.mechanism.joints])
            density = stronger * np.maximum(density, least)
        return random_push(density, (stamps[1] - stamps[0]) * self.fit.mechanism.values["time_scale"])

    def ahead(self, stamps: np.ndarray, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Integrate the motion with its derivatives.

        Args:
            stamps: Time stamps [s], (frame,).
            state: Positions, then rates at the first one [SI], (2 dof,).

        Returns:
            The state at the last one, (2 dof,), and its derivatives by the first state, then by parameters in
            their standard deviations, (2 dof, 2 dof + param).
        """
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
class Chain:
    """The motion as states at time stamps, each following from the one before.

    Attributes:
        dynamics: How.
        stamps: Time stamps [s], (frame,).
        wanted: Stamps that were asked for, int (frame,).
        asked: Their rows among all times that were asked for, int (frame,).
        measured: Row of the record at each stamp, -1 for none, int (frame,).
        start: State at the first stamp, (2 dof,).
        covariance: What is known of it and of the parameters before, (2 dof + param, 2 dof + param).
        cuts: Stamps before which the motion is not followed.
    """

    dynamics: Dynamics
    stamps: np.ndarray
    wanted: np.ndarray
    asked: np.ndarray
    measured: np.ndarray
    start: np.ndarray
    covariance: np.ndarray
    cuts: tuple[int, ...] = ()


class Pass(NamedTuple):
    """What one linearisation leads to.

    Attributes:
        states: Positions, then rates, (frame, 2 dof).
        covariance: Their covariance, (frame, 2 dof, 2 dof).
        ratio: Mean square of the innovations over what it should be, for rows that the fit has not used and
            for those that it has, (2,).
        farthest: Largest innovation after a gap in its standard deviations.
        likelihood: Logarithm of that of all innovations, but for a constant.
    """

    states: np.ndarray
    covariance: np.ndarray
    ratio: np.ndarray
    farthest: float
    likelihood: float


def settled(chain: Chain, seen: Seen) -> tuple[Pass, np.ndarray] | None:
    """Linearise about the motion again and again until it stays.

    Where no motion is found that leads through a gap the chain is cut there, the longest gap first.

    Args:
        chain: The dynamics.
        seen: What is measured.

    Returns:
        The motion, and true for stamps in gaps that it was not followed through, bool (frame,); None where it
        does not settle anywhere.
    """
    measured = np.array([row >= 0 and bool(seen.used[row].any()) for row in chain.measured])
    rows = np.flatnonzero(measured)
    gaps = [(int(a), int(b)) for a, b in pairwise(rows) if b > a + 1]
    lost = np.zeros(len(measured), dtype=bool)
    # a motion that is lost on the way grows beyond all numbers
    with np.errstate(all="ignore"):
        for first, after in [(0, 0), *sorted(gaps, key=lambda gap: gap[0] - gap[1])]:
            if after:
                chain = replace(chain, cuts=(*chain.cuts, after))
                lost[first + 1 : after] = True
            found = _followed(chain, seen)
            if found is not None:
                return found, lost
    return None


def _followed(chain: Chain, seen: Seen) -> Pass | None:
    """Settle from the filtered states, or else from afar.

    Of a wild motion through a long gap the filter may be too far off. Then random accelerations that are much
    stronger than those found draw the motion through what is measured, whatever the dynamics, and weaken
    step by step.
    """
    found = _iterated(chain, seen, None, 1.0)
    if found is not None and found.farthest < MISSED:
        return found
    about, failed, eased = _between(chain, seen), 0, None
    for stronger in EASED:
        eased = _iterated(chain, seen, about, stronger)
        if eased is not None:
            about, failed = eased.states, 0
        elif (failed := failed + 1) == MOST_FAILED:
            break
    # one that needs stronger accelerations than there are is another motion
    ends = [one for one in (found, eased) if one is not None]
    return max(ends, key=lambda one: one.likelihood) if ends else None


def _iterated(chain: Chain, seen: Seen, about: np.ndarray | None, stronger: float) -> Pass | None:
    """Settle with random accelerations of so many times their density; None where it does not."""
    dofs = chain.dynamics.dofs
    found = _passed(chain, seen, about, np.ones(len(seen.time)), stronger)
    about, share, last = found.states, 1.0, np.inf
    for _ in range(PASSES):
        if not np.isfinite(about).all():
            return None
        found = _passed(chain, seen, about, _weaker(chain, seen, about[:, :dofs]), stronger)
        change, variance = found.states - about, np.diagonal(found.covariance, axis1=1, axis2=2)
        size = float(np.max(np.abs(change) / np.sqrt(np.maximum(variance, 1e-300))))
        if size <= SETTLED:
            return found
        # where steps grow they are too long
        share = max(0.5 * share, SHORTEST) if size > last else min(1.0, 2.0 * share)
        about, last = about + share * change, size
    return None


def _between(chain: Chain, seen: Seen) -> np.ndarray:
    """Return smooth curves through what is measured as states, (frame, 2 dof)."""
    dofs = chain.dynamics.dofs
    states = np.tile(chain.start, (len(chain.stamps), 1))
    for dof in range(dofs):
        rows = np.flatnonzero(seen.used[:, dof])
        if len(rows) > 1:
            curve = _curve(seen.time[rows], seen.position[rows, dof], chain.stamps)
            states[:, dof], states[:, dofs + dof] = curve
    return states


def _curve(time: np.ndarray, value: np.ndarray, stamps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return values and rates at time stamps, (stamp,) each, of a smooth curve through points, (point,), that
    rises and falls only where they do; before and after them its ends stand.

    Source:
        Fritsch and Butland, A method for constructing local monotone piecewise cubic interpolants, 1984.
    """
    span = np.diff(time)
    rise = np.diff(value) / span
    rate = np.concatenate((rise[:1], np.zeros(len(time) - 2), rise[-1:]))
    before, after = rise[:-1], rise[1:]
    weights = 2.0 * span[1:] + span[:-1], span[1:] + 2.0 * span[:-1]
    same = before * after > 0.0
    mean = weights[0][same] / before[same] + weights[1][same] / after[same]
    rate[1:-1][same] = (weights[0] + weights[1])[same] / mean
    at = np.clip(stamps, time[0], time[-1])
    k = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(span) - 1)
    # the cubic with value and rate of both ends of its span
    u, h = (at - time[k]) / span[k], span[k]
    bend = rate[k] + rate[k + 1] - 2.0 * rise[k]
    lean = 3.0 * rise[k] - 2.0 * rate[k] - rate[k + 1]
    return (
        value[k] + h * u * (rate[k] + u * (lean + u * bend)),
        rate[k] + u * (2.0 * lean + 3.0 * u * bend),
    )


def _weaker(chain: Chain, seen: Seen, position: np.ndarray) -> np.ndarray:
    """Return by which factor the noise of each row counts as larger: of one that is far off it does."""
    factor = np.ones(len(seen.time))
    for at, row in enumerate(chain.measured):
        use = np.flatnonzero(seen.used[row] & (row >= 0))
        if len(use):
            off = _off(seen, row, use, position[at])
            size = off @ np.linalg.solve(seen.noise[row][np.ix_(use, use)], off) / len(use)
            factor[row] = max(1.0, size / FAR**2)
    return factor


def _off(seen: Seen, row: int, use: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return measured less other positions of the joints that are used, (used,)."""
    off = seen.position[row, use] - position[use]
    # a gap may hide a turn, which the fit has found where it used the row
    return np.where(
        seen.turning[use] & ~seen.fitted[row], off - 2.0 * np.pi * np.round(off / (2.0 * np.pi)), off
    )


def _passed(chain: Chain, seen: Seen, about: np.ndarray | None, weaker: np.ndarray, stronger: float) -> Pass:
    """Go forwards and backwards once, linearised about a motion; without one about the filtered states.

    The state of the chain has positions and rates, then the parameters less the identified ones.
    """
    count, width, full = len(chain.stamps), len(chain.start), len(chain.covariance)
    mean, covariance = np.zeros(full), chain.covariance
    mean[:width] = chain.start
    means, covariances = np.empty((count, full)), np.empty((count, full, full))
    carried, gained = np.zeros((count, full, full)), np.tile(np.eye(full), (count, 1, 1))
    pulls, weights = np.zeros((count, full)), np.zeros((count, full, full))
    fresh = _between(chain, seen) if chain.cuts else np.zeros(0)
    unknown = np.repeat([np.pi**2, (FASTEST * np.pi) ** 2], width // 2)
    sums, farthest, likelihood = np.zeros((2, 2)), 0.0, 0.0
    since, gap = np.full(width // 2, chain.stamps[0]), GAP * usual_step(seen.time)
    for at, row in enumerate(chain.measured):
        means[at], covariances[at] = mean, covariance
        use = np.flatnonzero(seen.used[row] & (row >= 0))
        if len(use):
            noise = weaker[row] * seen.noise[row][np.ix_(use, use)]
            inverse = _inverse(covariance[np.ix_(use, use)] + noise)
            off = _off(seen, row, use, mean)
            gain = covariance[:, use] @ inverse
            pulls[at, use] = inverse @ off
            weights[at][np.ix_(use, use)] = inverse
            gained[at][:, use] -= gain
            mean = mean + gain @ off
            covariance = gained[at] @ covariance @ gained[at].T + gain @ noise @ gain.T
            square = off @ inverse @ off
            sums[int(seen.fitted[row])] += square, len(use)
            if chain.stamps[at] - since.min() > gap:
                farthest = max(farthest, square / len(use))
            since[use] = chain.stamps[at]
            likelihood += 0.5 * (np.linalg.slogdet(inverse)[1] - square)
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
            covariance[:width, :width] += chain.dynamics.pushed(stamps, stronger)
            if at + 1 in chain.cuts:
                # the state begins anew near what is measured, the parameters go on
                carried[at][:width], mean[:width] = 0.0, fresh[at + 1]
                covariance[:width], covariance[:, :width] = 0.0, 0.0
                covariance[:width, :width] = np.diag(unknown)
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
    ratio = sums[:, 0] / np.maximum(sums[:, 1], 1.0)
    return Pass(states, spread, ratio, float(np.sqrt(farthest)), float(likelihood))


def _inverse(matrix: np.ndarray) -> np.ndarray:
    """Return the inverse of a matrix; NaN where it has none, as of a motion that grows beyond all numbers."""
    try:
        return np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        return np.full_like(matrix, np.nan)
