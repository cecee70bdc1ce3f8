"""Unknowns in, cost and Gauss-Newton model out: simulated against measured joint positions.

The least-squares problem of eq. (14) of the 2012 paper, with the covariance of every sample as weight and the
start state of every piece of a record among the unknowns. The torque at a joint is that of its friction and
spring, which the tree carries, and that of the mechanism's drive, whose table's entries are unknowns like any
other.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from monodyn.arrays import plain
from monodyn.estimation.record.samples import Data, Pieces
from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.shooting.unknowns import (
    MASS_KINDS,
    Prior,
    Unknowns,
    choose_unknowns,
    kind_of,
    size_prior,
)
from monodyn.mechanism import Mechanism
from monodyn.mechanism.drive import Drive
from monodyn.mechanism.simulate import accelerations, rollout, rollout_derivatives
from monodyn.mechanism.tree import DAMPING, FRICTION, STIFFNESS, Directions, Tree
from monodyn.optimize import Arrow

STEP = 1e-6
"""Step of the differences by coordinate when accelerations are matched, which only gives a start."""


@dataclass(frozen=True, eq=False)
class Point:
    """The mechanism at one set of shared unknowns, with its derivatives by coordinate.

    Attributes:
        tree: The joint tree.
        drive: Torque over time.
        directions: What each coordinate changes in both, the time scale in the drive alone.
        size: Metric scale of slides.
        dsize: Derivative of its logarithm, (param,).
        stretch: Seconds per stamped second.
        dstretch: Derivative of its logarithm, (param,).
    """

    tree: Tree
    drive: Drive
    directions: Directions
    size: float
    dsize: np.ndarray
    stretch: float
    dstretch: np.ndarray


@dataclass(frozen=True, eq=False)
class Problem:
    """One identification.

    Attributes:
        mechanism: The start.
        unknowns: What is searched.
        prior: What the picture knows of the sizes.
        data: The measurements.
        base: Common scale of the sizes of ``mechanism`` against those that the record was measured in.
    """

    mechanism: Mechanism
    unknowns: Unknowns
    prior: Prior
    data: Data
    base: float = field(default=1.0, kw_only=True)

    def with_data(self, data: Data) -> Problem:
        """Return the same problem on other data."""
        return replace(self, data=data)

    def mechanism_at(self, x: np.ndarray) -> Mechanism:
        """Return the mechanism at the coordinates ``x`` (param,)."""
        return self.mechanism.with_values(self.unknowns.named(x))

    def size(self, x: np.ndarray) -> float:
        """Return the common scale of the sizes against those that the record was measured in."""
        return self.base * float(np.exp(self.prior.weights @ (x - self.unknowns.x0)))

    def mass_scaled(self, x: np.ndarray) -> np.ndarray:
        """Return ``x`` with all masses, dampings, ... changed by one factor, to be near the start on average.

        Where nothing fixes the scale of masses this does not change the motion; it keeps the numbers plain.
        """
        names, log = self.unknowns.names, self.unknowns.log
        heavy = np.array([kind_of(name) in MASS_KINDS for name in names], dtype=bool)
        anchors = heavy & log
        if not anchors.any():
            return x
        factor = float(np.exp(np.mean((self.unknowns.x0 - x)[anchors])))
        moved = np.where(anchors, x + np.log(factor), np.where(heavy, x * factor, x))
        return np.clip(moved, self.unknowns.lower, self.unknowns.upper)

    def gravity_scaled(self, x: np.ndarray) -> np.ndarray:
        """Return ``x`` with gravity as at the start, and lengths and what goes with them changed to match.

        With everything k times as long and k times the gravity, inertias k^2 (free) or k^4 (uniform, same
        thickness) times as large and dampings likewise, the motion of hinges stays the same.
        """
        names = self.unknowns.names
        if "gravity" not in names or self.data.slide.any():
            return x
        at = names.index("gravity")
        k = float(np.exp(self.unknowns.x0[at] - x[at]))
        free = any(kind_of(name) == "inertia" for name in names)
        power: dict[str, int] = dict.fromkeys(
            ("length", "width", "tail", "tip", "com_x", "com_y", "gravity"), 1
        )
        power |= dict.fromkeys(("damping", "friction", "stiffness", "inertia", "torque"), 2 if free else 4)
        powers = np.array([power.get(kind_of(name), 0) for name in names])
        moved = np.where(self.unknowns.log, x + powers * np.log(k), x * k**powers)
        return np.clip(moved, self.unknowns.lower, self.unknowns.upper)

    def clock_scaled(self, x: np.ndarray) -> np.ndarray:
        """Return ``x`` with the time scale as at the start, and lengths and what goes with them to match.

        With everything k times as long motion takes k^(1/2) times as long, when masses stay and inertias are
        k^2 times as large (free) or masses k^2 and inertias k^4 (uniform, same thickness); frictions,
        stiffnesses and dampings follow from their units, with inertias at a hinge and masses at a slide.
        """
        names = self.unknowns.names
        if "time_scale" not in names:
            return x
        at = names.index("time_scale")
        k = float(np.exp(2.0 * (self.unknowns.x0[at] - x[at])))
        mass = 0.0 if any(kind_of(name) == "inertia" for name in names) else 2.0
        power: dict[str, float] = dict.fromkeys(("length", "width", "tail", "tip", "com_x", "com_y"), 1.0)
        power |= {"time_scale": 0.5, "torque.period": 0.5, "mass": mass, "inertia": mass + 2.0}
        for joint in self.mechanism.joints:
            hinge = joint.kind == "hinge"
            moves = mass + 2.0 if hinge else mass
            power |= {f"{joint.name}.armature": moves, f"{joint.name}.damping": moves - 0.5}
            power |= {f"{joint.name}.stiffness": moves - 1.0}
            force = moves - 1.0 if hinge else moves
            power |= {f"{joint.name}.friction": force}
            power |= {name: force for name in names if name.startswith(f"{joint.name}.torque.")}
        powers = np.array([power.get(name, power.get(kind_of(name), 0.0)) for name in names])
        moved = np.where(self.unknowns.log, x + powers * np.log(k), x * k**powers)
        return np.clip(moved, self.unknowns.lower, self.unknowns.upper)

    def at(self, x: np.ndarray) -> Point:
        """Bring the mechanism at the coordinates ``x`` (param,) into the form that is simulated."""
        mechanism, unknowns = self.mechanism_at(x), self.unknowns
        by_parameter = mechanism.directions((*unknowns.names, *unknowns.tied))
        directions = by_parameter.chained(unknowns.chain(x))
        dstretch = np.array([name == "time_scale" for name in unknowns.names], dtype=float)
        directions = replace(
            directions, load=directions.load + 2.0 * dstretch, clock=directions.clock + dstretch
        )
        size, stretch = self.size(x), mechanism.values["time_scale"]
        return Point(mechanism.tree, mechanism.drive, directions, size, self.prior.weights, stretch, dstretch)

    def model(
        self, x: np.ndarray, rows: tuple[np.ndarray, np.ndarray], pieces: Pieces, limit: float
    ) -> Arrow:
        """Bring whitened residuals and what the picture knows into cost and Gauss-Newton model.

        Args:
            x: Coordinates, (param,).
            rows: Residuals and Jacobian there, from ``rows``.
            pieces: How the records are cut.
            limit: Residual norm from which on a sample's pull no longer grows; 0 for plain least squares.

        Returns:
            The model; it keeps the residuals (row, dof) as they are before the loss.
        """
        from monodyn.estimation.shooting.kernels import normal_blocks

        cost, hessian, gradient, cross, local, slope = normal_blocks(*rows, pieces.first, len(x), limit)
        change = x - self.unknowns.x0
        pull = self.prior.information @ change
        cost += 0.5 * float(change @ pull)
        return Arrow(cost, hessian + self.prior.information, gradient + pull, cross, local, slope, rows[0])

    def rows(
        self, x: np.ndarray, states: np.ndarray, pieces: Pieces, substeps: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return whitened residuals (row, dof) and their Jacobian (row, dof, param + 2 dof).

        The last columns belong to the start state of the piece that the row is part of.
        """
        from monodyn.estimation.shooting.kernels import whitened_rows

        point, data = self.at(x), self.data
        clock, starts = data.times * point.stretch, plain(states)
        directions = _slowed(point)
        dofs, params = data.position.shape[1], len(x)
        parts = []
        for first, stop, state in zip(pieces.first[:-1], pieces.first[1:], starts, strict=True):
            q0, v0 = state[:dofs], state[dofs:]
            q, _, dq, _ = rollout_derivatives(
                point.tree, directions, clock[first:stop], q0, v0, substeps=substeps, drive=point.drive
            )
            dq[:, :, :params] += (dq[:, :, params + dofs :] @ v0)[:, :, None] * point.dstretch
            parts.append((q, dq))
        q, dq = (np.concatenate(part) for part in zip(*parts, strict=True))
        slide = np.repeat(data.slide[pieces.record], np.diff(pieces.first), axis=0)
        return whitened_rows(q, dq, data.position, data.white, slide, point.size, point.dsize)

    def residuals(self, x: np.ndarray, states: np.ndarray, pieces: Pieces, substeps: int) -> np.ndarray:
        """Return the whitened residuals alone, as in ``rows`` (row, dof)."""
        difference = np.where(self.data.measured, self.differences(x, states, pieces, substeps), 0.0)
        return -np.einsum("fij,fj->fi", self.data.white, difference)

    def simulated(self, x: np.ndarray, states: np.ndarray, pieces: Pieces, substeps: int) -> np.ndarray:
        """Return the simulated positions [rad or m], (row, dof), slides in metres."""
        ends = zip(pieces.first[:-1], pieces.first[1:], states, strict=True)
        return self.rollouts(x, list(ends), substeps)

    def differences(self, x: np.ndarray, states: np.ndarray, pieces: Pieces, substeps: int) -> np.ndarray:
        """Return measured less simulated positions in the record's units, NaN in gaps, (row, dof)."""
        simulated = self.simulated(x, states, pieces, substeps)
        rows = np.repeat(self.data.slide[pieces.record], np.diff(pieces.first), axis=0)
        difference = self.data.position - np.where(rows, simulated / self.size(x), simulated)
        return np.where(self.data.measured, difference, np.nan)

    def rollouts(self, x: np.ndarray, runs: list[tuple[int, int, np.ndarray]], substeps: int) -> np.ndarray:
        """Simulate runs of rows (first, stop, start state), positions [rad or m] end to end (row, dof)."""
        mechanism, stretch = self.mechanism_at(x), self.stretch(x)
        tree, drive, parts = mechanism.tree, mechanism.drive, []
        for first, stop, state in runs:
            times, (q0, v0) = self.data.times[first:stop] * stretch, np.split(state, 2)
            parts.append(rollout(tree, times, q0, v0, substeps=substeps, drive=drive)[0])
        return np.concatenate(parts)

    def stretch(self, x: np.ndarray) -> float:
        """Return the true seconds per stamped second."""
        return self.unknowns.named(x).get("time_scale", self.mechanism.values["time_scale"])

    def start_states(self, x: np.ndarray, pieces: Pieces, smoothed: tuple[Smoothed, ...]) -> np.ndarray:
        """Take the start states of the pieces from smooth motion, (piece, 2 dof)."""
        dofs = self.data.position.shape[1]
        states = np.zeros((len(pieces.record), 2 * dofs))
        for k, record in enumerate(pieces.record):
            row = self.data.source[pieces.first[k]]
            unit = np.where(self.data.slide[record], self.size(x), 1.0)
            states[k, :dofs] = smoothed[record].position[row] * unit
            states[k, dofs:] = smoothed[record].velocity[row] * unit / self.stretch(x)
        return states

    def acceleration_rows(self, x: np.ndarray, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Return weighted acceleration mismatches (row,) and their Jacobian (row, param), prior included."""
        point, root, weight = self.at(x), motion.prior_root, motion.weight
        jacobian = np.zeros((weight.size, len(x)))
        torque, slopes = self._torques(point, motion)
        for p in range(len(x)):
            ahead, behind = (
                self._accelerations(point, motion, p, step, torque + step * slopes[:, :, p])
                for step in (STEP, -STEP)
            )
            jacobian[:, p] = ((ahead - behind) * weight).ravel() / (2.0 * STEP)
        return self._mismatch(x, motion), np.concatenate((jacobian, root))

    def acceleration_cost(self, x: np.ndarray, motion: Motion) -> float:
        """Return the sum of squares of the weighted acceleration mismatches, prior included."""
        rows = self._mismatch(x, motion)
        return float(rows @ rows)

    def _mismatch(self, x: np.ndarray, motion: Motion) -> np.ndarray:
        rows = (self.accelerations(x, motion) - motion.acceleration) * motion.weight
        return np.concatenate((rows.ravel(), motion.prior_root @ (x - self.unknowns.x0)))

    def accelerations(self, x: np.ndarray, motion: Motion, torque: np.ndarray | None = None) -> np.ndarray:
        """Return the accelerations by time stamp along smooth motion, (frame, dof).

        Args:
            x: Coordinates, (param,).
            motion: Smooth motion.
            torque: Torques besides friction and springs [N m or N], (frame, dof); None takes the drive's.
        """
        point = self.at(x)
        acting = point.drive.at(motion.time * point.stretch) if torque is None else torque
        return self._accelerations(point, motion, 0, 0.0, acting)

    def torque_response(self, x: np.ndarray, motion: Motion) -> np.ndarray:
        """Return the accelerations by time stamp that a unit torque at each joint adds, (frame, dof, dof)."""
        point, none = self.at(x), np.zeros_like(motion.position)
        still = self._accelerations(point, motion, 0, 0.0, none)
        columns = [
            self._accelerations(point, motion, 0, 0.0, none + push) - still
            for push in np.eye(len(self.mechanism.joints))
        ]
        return np.stack(columns, axis=2)

    def _torques(self, point: Point, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Torque of the drive along the motion, (frame, dof), and its derivatives, (frame, dof, param)."""
        return point.drive.derivatives(point.directions, motion.time * point.stretch)

    def _accelerations(
        self, point: Point, motion: Motion, param: int, step: float, torque: np.ndarray
    ) -> np.ndarray:
        """Accelerations by time stamp along smooth motion, one coordinate moved by ``step``, (frame, dof)."""
        tree, size, stretch = point.tree, point.size, point.stretch
        if step != 0.0:
            tree = tree.along(point.directions, param, step)
            size *= np.exp(step * point.dsize[param])
            stretch *= np.exp(step * point.dstretch[param])
        unit = np.where(motion.slide, size, 1.0)
        found = accelerations(tree, motion.position * unit, motion.velocity * unit / stretch, torque)
        return found * stretch**2 / unit


def posed(mechanism: Mechanism, data: Data, *, torques_only: bool = False) -> Problem:
    """Return the identification of a mechanism from data: its unknowns and what the picture knows of them.

    Args:
        mechanism: The start.
        data: The measurements.
        torques_only: Hold all but the torques of the drive.
    """
    unknowns = choose_unknowns(mechanism, torques_only=torques_only)
    return Problem(mechanism, unknowns, size_prior(mechanism, unknowns), data)


def _slowed(point: Point) -> Directions:
    """Add what a change of the time scale does, written as a change of forces at the same stamps.

    q(s t; gravity, stiffness, friction, damping, v0) = q(t; s^2 gravity, s^2 stiffness, s^2 friction,
    s damping, s v0) holds for the integrated motion as well, step by step, so that the derivative is exact
    and a time scale that lengths can make up for is seen to be open. The rate within which friction changes
    sign is part of the method and not of the mechanism: it goes along with the scale. The derivative of the
    start rates is the caller's.
    """
    directions, dstretch = point.directions, point.dstretch
    if not dstretch.any():
        return directions
    power = np.zeros(point.tree.links.shape[1])
    power[DAMPING], power[FRICTION], power[STIFFNESS] = 1.0, 2.0, 2.0
    links = directions.links + (power * point.tree.links)[:, :, None] * dstretch
    gravity = directions.gravity + 2.0 * point.tree.gravity[:, None] * dstretch
    return replace(directions, links=plain(links), gravity=plain(gravity))


@dataclass(frozen=True, eq=False)
class Motion:
    """Smooth motion at the measured rows, for comparing accelerations without integrating.

    Attributes:
        time: Time stamps [s], (frame,).
        position: Positions [rad or m], (frame, dof).
        velocity: Rates by time stamp [rad/s or m/s], (frame, dof).
        acceleration: Accelerations by time stamp [rad/s^2 or m/s^2], (frame, dof).
        weight: One over the standard deviation of the accelerations, (frame, dof).
        slide: True for slides in the start scale, (frame, dof).
        prior_root: Square root of the picture's information, (row, param).
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    weight: np.ndarray
    slide: np.ndarray
    prior_root: np.ndarray


def smooth_motion(problem: Problem, smoothed: tuple[Smoothed, ...], most: int = 400) -> Motion:
    """Collect smooth motion at up to ``most`` measured rows, away from the ends of the records."""
    parts = []
    for record, found in enumerate(smoothed):
        a, b = problem.data.first[record : record + 2]
        rows = problem.data.source[a:b][problem.data.measured[a:b].all(axis=1)]
        rows = rows[2:-2] if len(rows) > 12 else rows
        slide = np.repeat(problem.data.slide[record][None], len(rows), axis=0)
        kept = (found.time, found.position, found.velocity, found.acceleration, found.acceleration_std)
        parts.append((*(values[rows] for values in kept), slide))
    t, q, v, a, std, slide = (np.concatenate(part) for part in zip(*parts, strict=True))
    if len(q) > most:
        pick = np.linspace(0, len(q) - 1, most).astype(int)
        t, q, v, a, std, slide = (values[pick] for values in (t, q, v, a, std, slide))
    usual = np.sqrt(np.mean(a**2, axis=0)) + 1e-9 if len(a) else np.ones(q.shape[1])
    weight = 1.0 / np.sqrt(std**2 + (0.05 * usual) ** 2)
    values, vectors = np.linalg.eigh(problem.prior.information)
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    return Motion(t, q, v, a, weight, slide, root)
