"""Unknowns in, cost and Gauss-Newton model out: simulated against measured joint positions.

The least-squares problem of eq. (14) of the 2012 paper, with the covariance of every sample as weight and the
start state of every piece of a record among the unknowns. The torque at a joint is that of its friction and
spring, which the tree carries, and that of the mechanism's drive, whose table's entries are unknowns like any
other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from monodyn.estimation.record.samples import Data, Pieces
from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.shooting.instance import Instance
from monodyn.estimation.shooting.prior import Prior, size_prior
from monodyn.estimation.shooting.trial import Run, Trial, in_batches
from monodyn.estimation.shooting.unknowns import Unknowns, choose_unknowns
from monodyn.mechanism import Mechanism
from monodyn.mechanism.dimensions import power
from monodyn.mechanism.drive import Drive
from monodyn.mechanism.simulate import rollouts, rollouts_derivatives
from monodyn.mechanism.torques import LAG
from monodyn.mechanism.upright import ROLL, with_roll
from monodyn.optimize import Arrow

Moved = tuple[np.ndarray, ...]
"""Positions and rates by row, and their derivatives where they are wanted."""
ALONG = 0.1
"""Share of a step at which its bend is measured."""


@dataclass(frozen=True, eq=False)
class Problem:
    """One identification.

    Attributes:
        mechanism: The start.
        unknowns: What is searched.
        prior: The picture's information about the sizes.
        data: The measurements.
        near: Sizes that nothing measures are unknowns, about in the file's proportion.
        base: Common scale of the sizes of ``mechanism`` against those that the record was measured in.
    """

    mechanism: Mechanism
    unknowns: Unknowns
    prior: Prior
    data: Data
    near: bool = field(default=False, kw_only=True)
    base: float = field(default=1.0, kw_only=True)

    def with_data(self, data: Data) -> Problem:
        """Return the same problem on other data.

        Args:
            data: The data.
        """
        return replace(self, data=data)

    def of(self, mechanism: Mechanism) -> Problem:
        """Return the identification of a mechanism from the same data, with as much open of its sizes.

        Args:
            mechanism: The mechanism; its sizes start as those of this one.
        """
        return replace(posed(mechanism, self.data, near=self.near), base=self.base)

    def mechanism_at(self, x: np.ndarray) -> Mechanism:
        """Return the mechanism at coordinates.

        Args:
            x: Coordinates, (param,).
        """
        return self.mechanism.at_rows(self._rows, self.unknowns.with_tied(x))

    @cached_property
    def _rows(self) -> np.ndarray:
        """Rows of the unknowns and of what is tied to them, in the mechanism's table, int (param + tied,)."""
        return self.mechanism.rows((*self.unknowns.names, *self.unknowns.tied))

    def size(self, x: np.ndarray) -> float:
        """Return the common scale of the sizes against those that the record was measured in.

        Args:
            x: Coordinates, (param,).
        """
        return self.base * float(np.exp(self.prior.weights @ (x - self.unknowns.x0)))

    def at(self, x: np.ndarray) -> Instance:
        """Bring the mechanism at coordinates into the form that is simulated.

        Args:
            x: Coordinates, (param,).

        Returns:
            Tree and drive with their derivatives by coordinate.
        """
        mechanism, unknowns = self.mechanism_at(x), self.unknowns
        directions = mechanism.directions_by(self._rows, unknowns.chain(x))
        dstretch = unknowns.only("time_scale")
        if dstretch.any():
            # at the same stamps a slower clock makes torques larger, and the drive's own time run ahead
            load = directions.load + power("torque", time=-1.0) * dstretch
            directions = replace(directions, load=load, clock=directions.clock + dstretch)
        # the common scale is a weighted mean of logarithms: its derivatives are the weights, whatever x is
        size, stretch = self.size(x), self.stretch(x)
        return Instance(
            mechanism, directions, size, self.prior.weights, stretch, dstretch,
            self.roll(x), unknowns.only(ROLL), self.lag(mechanism),
        )  # fmt: skip

    def driven(self, drive: Drive, lag: float, stretch: float, first: int, stop: int) -> Drive:
        """Return the torques along rows of one record: those that are known of it, or the mechanism's.

        Args:
            drive: The mechanism's.
            lag: How much later than in their log known torques act [s].
            stretch: True seconds per stamped second.
            first: First row.
            stop: The row after the last.
        """
        if not self.data.torques:
            return drive
        record = int(np.searchsorted(self.data.first, first, side="right")) - 1
        begin = int(self.data.first[record])
        return self.data.torques[record].drive(lag, stretch, first - begin, stop - begin)

    def model(
        self, x: np.ndarray, rows: tuple[np.ndarray, np.ndarray], pieces: Pieces, limit: float
    ) -> Arrow:
        """Bring whitened residuals and the picture's information into cost and Gauss-Newton model.

        Args:
            x: Coordinates, (param,).
            rows: Residuals (row, dof) and Jacobian there, from ``rows``.
            pieces: How the records are cut.
            limit: Residual norm from which on a sample's pull no longer grows; 0 for plain least squares.

        Returns:
            The model; it keeps the rows as they are before the loss.
        """
        from monodyn.estimation.shooting.kernels import normal_blocks

        cost, hessian, gradient, cross, local, slope = normal_blocks(*rows, pieces.first, len(x), limit)
        change = self.prior.away(x - self.unknowns.x0)
        pull = self.prior.information @ change
        # the picture's information is quadratic in the logarithms: it has no loss and needs no linearization
        cost += 0.5 * float(change @ pull)
        return Arrow(cost, hessian + self.prior.information, gradient + pull, cross, local, slope, rows)

    def rows(self, trial: Trial) -> tuple[np.ndarray, np.ndarray]:
        """Return whitened residuals and their Jacobian.

        Args:
            trial: Unknowns and start states.

        Returns:
            Residuals (row, dof) and Jacobian (row, dof, param + 2 dof), whose last columns belong to the
            start state of the piece that the row is part of.
        """
        from monodyn.estimation.shooting.kernels import whitened_rows

        data, x = self.data, trial.x
        q, _, dq, _ = self.moved(trial)
        if ROLL in self.unknowns.names:
            # the picture of a rolled camera lacks the roll: it is added to what was measured, and its
            # derivative is that of the simulated less the measured position
            dq = dq.copy()
            dq[:, :, self.unknowns.names.index(ROLL)] -= data.turning
        position = data.position + data.turning * self.roll(x)
        return whitened_rows(q, dq, position, data.white, data.sliding, self.size(x), self.prior.weights)

    def moved(self, trial: Trial) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Simulate every piece with its derivatives, as ``tangents`` does; the trial keeps them.

        Args:
            trial: Unknowns and start states.

        Returns:
            Positions and rates, (row, dof), and their derivatives, (row, dof, param + 2 dof).
        """
        known = trial.recalled("tangents", self._moving)
        if known is not None:
            return known
        moved = self.tangents(self.instance(trial), trial.substeps, trial.runs, most_off=trial.most_off)
        return trial.remember("tangents", self._moving, moved)

    def instance(self, trial: Trial) -> Instance:
        """Return the mechanism at the unknowns of a trial, as ``at`` does; the trial keeps it.

        Args:
            trial: The trial.

        Returns:
            Tree and drive with their derivatives by coordinate.
        """
        known = trial.recalled("instance", self._moving)
        return known or trial.remember("instance", self._moving, self.at(trial.x))

    @property
    def _moving(self) -> tuple[object, ...]:
        """What a motion depends on in addition to a trial, whatever was measured of it."""
        return self.mechanism, self.unknowns, self.data.times, self.data.by_roll, self.prior.weights

    def tangents(
        self, instance: Instance, substeps: int, runs: Sequence[Run], *, most_off: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Simulate runs of rows with their derivatives.

        Args:
            instance: The mechanism.
            substeps: Integration steps between two time stamps.
            runs: First row, one past the last row and start state (2 dof,) of each.
            most_off: As ``simulate`` has it.

        Returns:
            Positions and rates of all runs end to end, in metres and true time, each (row, dof), and their
            derivatives, each (row, dof, param + 2 dof): by coordinate, then by the start state of the run.
        """
        dofs, params = self.data.position.shape[1], len(instance.dsize)
        moving = partial(rollouts_derivatives, instance.tree, instance.slowed, most_off=most_off)
        q, v, dq, dv = self._together(moving, instance.drive, instance.lag, instance.stretch, runs, substeps)
        if instance.dstretch.any():
            # start rates are by true time: a slower clock is like larger ones, at the same stamps
            # of a motion that grows beyond all bounds nothing is finite, which the search rejects
            v0 = np.repeat([run[2][dofs:] for run in runs], [run[1] - run[0] for run in runs], axis=0)
            with np.errstate(invalid="ignore", over="ignore"):
                for part in (dq, dv):
                    along = part[:, :, params + dofs :] @ v0[:, :, None]
                    part[:, :, :params] += along * instance.dstretch
                # and so are those of every row, which the change of forces has by the stamps
                dv[:, :, :params] -= v[:, :, None] * instance.dstretch
        return q, v, dq, dv

    def bend(
        self, model: Arrow, trial: Trial, step: tuple[np.ndarray, np.ndarray], limit: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return how the residuals bend along a step, as a pull on the unknowns.

        Args:
            model: The model at the trial, with its rows.
            trial: Unknowns and start states.
            step: Step of the unknowns (param,) and of the start states (piece, 2 dof).
            limit: As for the model.

        Returns:
            J.r'' with r'' the second derivative of the residuals along the step, of the unknowns (param,) and
            of the start states (piece, 2 dof).
        """
        from monodyn.estimation.shooting.kernels import bent_pull

        (residual, jacobian, *_), (shared, local) = model.kept, step
        ahead = trial.at(trial.x + ALONG * shared, trial.states + ALONG * local)
        with np.errstate(invalid="ignore", over="ignore"):
            there = self.residuals(ahead)
        return bent_pull(residual, jacobian, there, shared, local, trial.pieces.first, ALONG, limit)

    def residuals(self, trial: Trial) -> np.ndarray:
        """Return the whitened residuals alone, as ``rows`` does.

        Args:
            trial: Unknowns and start states.

        Returns:
            Residuals, 0 in gaps, (row, dof).
        """
        # gaps are NaN in a difference, and would spread through the product with W
        difference = np.where(self.data.measured, self.differences(trial), 0.0)
        return -np.einsum("fij,fj->fi", self.data.white, difference)

    def simulated(self, trial: Trial) -> np.ndarray:
        """Simulate every piece.

        Args:
            trial: Unknowns and start states.

        Returns:
            Positions, slides in metres of the identified scale [rad or m], (row, dof).
        """
        if (with_tangents := trial.recalled("tangents", self._moving)) is not None:
            return with_tangents[0]
        if (motion := trial.recalled("motion", self._moving)) is not None:
            return motion
        motion = self.moving(trial.x)(trial.runs, trial.substeps)[:, : self.data.position.shape[1]]
        return trial.remember("motion", self._moving, motion)

    def differences(self, trial: Trial) -> np.ndarray:
        """Compare the measured with the simulated positions.

        Args:
            trial: Unknowns and start states.

        Returns:
            Measured less simulated positions in the record's units, NaN in gaps, (row, dof).
        """
        simulated, data = self.simulated(trial), self.data
        position = data.position + data.turning * self.roll(trial.x)
        difference = position - np.where(data.sliding, simulated / self.size(trial.x), simulated)
        return np.where(data.measured, difference, np.nan)

    def rates(self, trial: Trial) -> np.ndarray:
        """Differentiate the simulated positions by the time stamps.

        Args:
            trial: Unknowns and start states.

        Returns:
            Rates in the record's units by stamped second, (row, dof).
        """
        simulated = self.simulated(trial)
        simulated = np.where(self.data.sliding, simulated / self.size(trial.x), simulated)
        rates = np.zeros_like(simulated)
        for first, stop in zip(self.data.first[:-1], self.data.first[1:], strict=True):
            if stop - first > 1:
                rates[first:stop] = np.gradient(simulated[first:stop], self.data.times[first:stop], axis=0)
        return rates

    def moving(self, x: np.ndarray) -> Callable[[Sequence[Run], int], np.ndarray]:
        """Return what simulates runs of rows at coordinates, with any number of integration steps between two
        time stamps.

        Args:
            x: Coordinates, (param,).

        Returns:
            A function of runs (first row, one past the last row and start state (2 dof,) of each) and steps,
            which returns the states of all runs end to end, positions then rates [rad or m, rad/s or m/s],
            (row, 2 dof).
        """
        mechanism, stretch = self.mechanism_at(x), self.stretch(x)
        tree, drive, lag = mechanism.tree, mechanism.drive, self.lag(mechanism)

        def simulated(runs: Sequence[Run], substeps: int) -> np.ndarray:
            return np.hstack(self._together(partial(rollouts, tree), drive, lag, stretch, runs, substeps))

        return simulated

    def _together(
        self, integrate: Callable[..., Moved], drive: Drive, lag: float, stretch: float, runs: Sequence[Run],
        substeps: int,
    ) -> Moved:  # fmt: skip
        """Return what integrates runs under one drive applied to all of them, end to end; where torques are
        known each has a drive of its own."""
        data = self.data

        def of(batch: Sequence[Run]) -> Moved:
            times = np.concatenate([data.times[first:stop] for first, stop, _ in batch]) * stretch
            begins = np.cumsum([0, *(stop - first for first, stop, _ in batch)])
            own = self.driven(drive, lag, stretch, *batch[0][:2])
            states = np.array([state for *_, state in batch])
            return integrate(times, begins, states, substeps=substeps, drive=own)

        def each(batch: Sequence[Run]) -> list[Moved]:
            return [of([run]) for run in batch] if data.torques else [of(batch)]

        parts = in_batches(each, runs, substeps)
        found = [part for batch in parts for part in batch]
        return (
            found[0] if len(found) == 1 else tuple(np.concatenate(part) for part in zip(*found, strict=True))
        )

    def lag(self, mechanism: Mechanism) -> float:
        """Return how much later than in their log known torques act [s]; 0 where that is no question.

        Args:
            mechanism: This mechanism at some coordinates.
        """
        return mechanism.values.get(LAG, 0.0) if self.data.torques else 0.0

    def stretch(self, x: np.ndarray) -> float:
        """Return the true seconds per stamped second.

        Args:
            x: Coordinates, (param,).
        """
        if "time_scale" not in self.unknowns.names:
            return self._values["time_scale"]
        return float(np.exp(x[self.unknowns.names.index("time_scale")]))

    def roll(self, x: np.ndarray) -> float:
        """Return the roll of the camera [rad].

        Args:
            x: Coordinates, (param,).
        """
        if ROLL not in self.unknowns.names:
            return self._values[ROLL]
        return float(x[self.unknowns.names.index(ROLL)])

    @cached_property
    def _values(self) -> dict[str, float]:
        return self.mechanism.values

    def started(self, x: np.ndarray, pieces: Pieces, smoothed: tuple[Smoothed, ...]) -> Trial:
        """Begin at unknowns with the start states that smooth motion has.

        Args:
            x: Coordinates, (param,).
            pieces: How the records are cut.
            smoothed: Smooth motion of each record.

        Returns:
            The trial; its integration steps are still to be chosen.
        """
        dofs = self.data.position.shape[1]
        # records are in their own units and stamped time, start states in metres and true time
        states = np.zeros((len(pieces.record), 2 * dofs))
        for k, record in enumerate(pieces.record):
            row = self.data.source[pieces.first[k]]
            unit = np.where(self.data.slide[record], self.size(x), 1.0)
            states[k, :dofs] = smoothed[record].position[row] * unit
            states[k, :dofs] += self.data.by_roll[record] * self.roll(x)
            states[k, dofs:] = smoothed[record].velocity[row] * unit / self.stretch(x)
        return Trial(x, states, pieces)


def posed(mechanism: Mechanism, data: Data, *, torques_only: bool = False, near: bool = False) -> Problem:
    """Return the identification of a mechanism from data: unknowns and the picture's information about them.

    Args:
        mechanism: The start.
        data: The measurements.
        torques_only: Hold all but the torques of the drive.
        near: Sizes that nothing measures are unknowns, about in the file's proportion; else they are exactly
            in it.

    Returns:
        The problem, with its unknowns at their start.
    """
    if not data.by_roll.any():
        # nothing was measured against a picture
        mechanism = with_roll(mechanism, mechanism.values[ROLL], free=False)
    unknowns = choose_unknowns(mechanism, torques_only=torques_only, near=near)
    return Problem(mechanism, unknowns, size_prior(mechanism, unknowns), data, near=near)
