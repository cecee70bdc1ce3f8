"""A window of a record fitted from a start nearby, with what rows that have left it say of its motion.

The core of a moving horizon. The search is that of a batch fit on one piece; while no row has left the window
it has the same optimum and the same covariance. When the window slides, the rows that leave become a
quadratic cost of what the motion depends on (``regrouped``) and of the state at the first row that stays. In
these numbers a motion is linear that is far from linear in sizes and masses: quadratics in the sizes
themselves, taken at a different point each time, would soon contradict one another. What the picture knows of
sizes stays as it is, however many rows have left. The motion between two rows is no estimate but a function
of its start, so that a window that slides loses nothing but what the rows are not linear in.

Coordinates of the unknowns are those of ``shooting.unknowns``: logarithms of sizes, densities and masses,
frictions as they are. States are positions, then rates, in true time and metres.

Source: Rao, Rawlings and Mayne, Constrained state estimation for nonlinear discrete-time systems: stability
    and moving horizon approximations, 2003 (arrival cost).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from monodyn.errors import FitError
from monodyn.estimation.arrival import Arrival, symmetric
from monodyn.estimation.fit import Fit
from monodyn.estimation.parts import Common
from monodyn.estimation.record.samples import Data, Pieces, prepare
from monodyn.estimation.shooting.common import left_open, less, whitened_shifts
from monodyn.estimation.shooting.instance import Instance
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.shoot import choose_substeps, most_off
from monodyn.estimation.shooting.trial import Trial
from monodyn.estimation.verdict.regrouped import Trees, features
from monodyn.estimation.verdict.surrogate import BESIDES, STEP, UNEXPLAINED
from monodyn.estimation.verdict.uncertainty import covariance_of
from monodyn.mechanism import Mechanism
from monodyn.optimize import Arrow, SearchSettings, minimize_arrow
from monodyn.types import Poses

FEW_STEPS = SearchSettings(evaluations=10, decrease=1e-7, relative=1e-9, damping=1e-9)
"""From a start nearby: all but plain Gauss-Newton steps, until the cost falls by nothing that counts."""
EXACT = 1e-5
"""Largest integration error of a window [rad or m], as of an identification."""
ROUNDING = 1e-12
"""Size of the derivatives of something that the motion depends on, over that of the largest, up to which they
are those of rounding."""
ALIKE = 1e-9
"""Share of the largest effect of the unknowns on what the motion depends on below which there is none."""


@dataclass(frozen=True, eq=False)
class Window:
    """What is searched, and the rows that it is searched by.

    Attributes:
        problem: The mechanism, the unknowns and what the picture knows of them, with the rows as data.
        substeps: Integration steps between two rows.
        regrouped: The motion depends on the unknowns through regrouped inertias; else rows that leave become
            a quadratic in the unknowns themselves.
    """

    problem: Problem
    substeps: int
    regrouped: bool

    @property
    def times(self) -> np.ndarray:
        """Time stamps of the rows [s], (row,); more of them than frames where some are missing."""
        return self.problem.data.times

    def on(self, poses: Poses, noise: np.ndarray | float = 1.0, common: Common | None = None) -> Window:
        """Return the same unknowns with other rows.

        Args:
            poses: The rows of the window.
            noise: Factors of the stated noise, by joint (dof,) or one for all, as a fit has found them.
            common: Errors that all positions have in common, as a fit has found them: they are taken off,
                and less of them is open.

        Raises:
            VideoError: From ``prepare``: nothing was measured, or a covariance is none.
        """
        data = prepare([poses], self.problem.mechanism)
        if common is not None:
            data = left_open(less(data, common.mean), common.root)
        factors = np.broadcast_to(np.asarray(noise, dtype=float), data.position.shape[1:])
        # no integration step may go beyond a bend of known torques
        substeps = max(self.substeps, *(torque.parts for torque in data.torques), 1)
        return replace(self, problem=self.problem.with_data(data.scaled(factors)), substeps=substeps)

    def shown(self, trial: Trial) -> tuple[np.ndarray, np.ndarray]:
        """Return what the motion depends on, (feature,), and its derivatives, (feature, param).

        Args:
            trial: Unknowns and start state.
        """
        problem, x = self.problem, trial.x
        if not self.regrouped:
            return x, np.eye(len(x))
        of = problem.mechanism, problem.unknowns, problem.prior.weights
        if (known := trial.recalled("shown", of)) is not None:
            return known
        instance = problem.instance(trial)
        tree, steps = instance.tree, instance.directions
        # one tree more, without a step, where there may be no unknown at all
        links, gravity = (
            np.concatenate((value[..., None] + 1j * STEP * slopes, value[..., None]), axis=-1)
            for value, slopes in ((tree.links, steps.links), (tree.gravity, steps.gravity))
        )
        found, _ = features(Trees(tree.parent, tree.kind, links, gravity), absolute=False)
        also = [i for i, kind in enumerate(problem.unknowns.kinds) if kind in BESIDES]
        lines = [np.eye(len(x))[also]]
        if problem.data.slide.any():
            lines.append(problem.prior.weights[None])
        more = np.concatenate(lines)
        slopes = np.concatenate((np.imag(found[:, :-1]) / STEP, more))
        return trial.remember("shown", of, (np.concatenate((np.real(found[:, -1]), more @ x)), slopes))


@dataclass(frozen=True, eq=False)
class Refitted:
    """The optimum of a window.

    Attributes:
        window: The window.
        arrival: What rows before it say; None where there were none.
        trial: The unknowns, and the state at the first row.
        information: Second derivatives of the cost by unknowns and that state, by Gauss and Newton,
            (param + 2 dof, param + 2 dof): rows, arrival and picture together.
        pulled: How the gradient follows what moves all positions together, by one deviation of each
            direction, (param + 2 dof, direction).
        residual: Measured less simulated positions in the record's units, NaN in gaps [rad or m], (row, dof).
        sigma: Root mean square of the whitened residuals: 1 where noise is as it was stated.
        cost: Half the sum of their squares, with the costs of arrival and picture.
        evaluations: Evaluations of the model.
        converged: True where no step predicts a lower cost.
    """

    window: Window
    arrival: Arrival | None
    trial: Trial
    information: np.ndarray
    pulled: np.ndarray
    residual: np.ndarray
    sigma: float
    cost: float
    evaluations: int
    converged: bool

    @property
    def x(self) -> np.ndarray:
        """Coordinates of the unknowns, (param,)."""
        return self.trial.x

    @property
    def state(self) -> np.ndarray:
        """State at the first row, (2 dof,)."""
        return self.trial.states[0]

    @property
    def instance(self) -> Instance:
        """The mechanism as it is simulated."""
        return self.window.problem.instance(self.trial)

    @cached_property
    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """The state at each row, (row, 2 dof), and its derivatives by unknowns and state at the first row,
        (row, 2 dof, param + 2 dof)."""
        q, v, dq, dv = self.window.problem.moved(self.trial)
        return np.hstack((q, v)), np.concatenate((dq, dv), axis=1)

    @property
    def scale(self) -> float:
        """Metres per unit of length of the start."""
        return self.window.problem.size(self.x)

    @cached_property
    def unit(self) -> np.ndarray:
        """Metres per unit of the record, 1 for hinges, (dof,)."""
        return np.where(self.window.problem.data.slide[0], self.scale, 1.0)

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism as identified."""
        return self.instance.mechanism

    @cached_property
    def covariance(self) -> np.ndarray:
        """Covariance of unknowns and state at the first row, (param + 2 dof, param + 2 dof); directions that
        nothing determines are left out of it. What moves all positions together is no noise: it moves the
        optimum as a whole."""
        alone, _ = covariance_of(self.window.problem.unknowns, self.information)
        moved = alone @ self.pulled
        return alone + moved @ moved.T


class Ahead(NamedTuple):
    """The state at a row of a window.

    Attributes:
        state: Positions, then rates, (2 dof,).
        slopes: Their derivatives by unknowns and state at the first row, (2 dof, param + 2 dof).
        covariance: Covariance of unknowns and this state, (param + 2 dof, param + 2 dof).
    """

    state: np.ndarray
    slopes: np.ndarray
    covariance: np.ndarray


def window_of(fit: Fit, mechanism: Mechanism, poses: Poses) -> Window:
    """Return a window with the unknowns that a fit has ended with.

    Args:
        fit: The fit, without a torque over time but those that are known.
        mechanism: What it began with, as the picture has measured it.
        poses: The first rows that were fitted; the integration steps are chosen by them.

    Returns:
        The window, with these rows as data.

    Raises:
        FitError: There is a torque over time; or, from ``check``, the fit cannot be used.
    """
    fit.check()
    if fit.torque not in ("friction", "known"):
        raise FitError(
            f"window: expected a fit of friction, or of known torques, got the torque {fit.torque!r}; "
            "identify the first seconds with --identify.torque friction."
        )
    # what was free, and what was found to act, is that of the fit; sizes start where the picture has them
    begun, ended = mechanism.with_torque(fit.torque), fit.mechanism
    numbers = np.where(ended.free, begun.numbers, ended.numbers)
    begun = replace(begun, numbers=numbers, free=ended.free, own=ended.own, chosen=ended.chosen)
    problem = posed(begun, prepare([poses], begun), near=True)
    window = Window(problem, 1, regrouped=True)
    trial = _trial(window, *start_of(fit, window))
    window = replace(window, substeps=choose_substeps(problem, trial, EXACT)[0])
    return replace(window, regrouped=_explained(window, trial))


def start_of(fit: Fit, window: Window) -> tuple[np.ndarray, np.ndarray]:
    """Return where a fit ended as a start of a window that begins where its first record does.

    Args:
        fit: The fit.
        window: A window of its unknowns.

    Returns:
        Coordinates of the unknowns (param,), and the state at the first row (2 dof,).
    """
    unknowns, values = window.problem.unknowns, fit.mechanism.values
    x = unknowns.coordinates(np.array([values[name] for name in unknowns.names]))
    return x, np.concatenate((fit.starts[0].position, fit.starts[0].velocity))


def refit(
    window: Window,
    arrival: Arrival | None,
    x: np.ndarray,
    state: np.ndarray,
    *,
    limit: float = 0.0,
    settings: SearchSettings = FEW_STEPS,
) -> Refitted:
    """Minimize the cost of a window's rows, of those before it and of the picture, from a start nearby.

    Args:
        window: Unknowns and rows.
        arrival: What the rows before it say, from ``slid``; None where there are none.
        x: First coordinates of the unknowns, (param,).
        state: First state at the first row, (2 dof,).
        limit: Norm of a row's whitened residual from which on its pull no longer grows; 0 for plain least
            squares.
        settings: When to stop.

    Returns:
        The optimum and the information there.

    Example::

        window = window_of(fit, scene.mechanism, poses[:40])
        found = refit(window, None, *start_of(fit, window))
        # the next frame: the first row leaves, one comes
        arrival, state = slid(found, 1), ahead(found, 1).state
        found = refit(window.on(poses[1:41]), arrival, found.x, state)
        now = ahead(found, -1)  # state at the last row, with the covariance of a prediction from there
    """
    problem, begun = window.problem, replace(_trial(window, x, state), most_off=most_off(settings))

    def evaluate(at: np.ndarray, local: np.ndarray) -> Arrow:
        trial = begun.at(at, local)
        model = _model(window, arrival, trial, limit)
        return replace(model, kept=(*model.kept, trial))

    unknowns = problem.unknowns
    found = minimize_arrow(
        evaluate, begun.x, begun.states, (unknowns.lower, unknowns.upper), settings=settings,
        reach=unknowns.reach,
    )  # fmt: skip
    whitened, jacobian, trial = found.model.kept
    pulled = _pulled(problem.data, jacobian)
    if arrival is not None:
        _, slopes = window.shown(trial)
        pulled += _chain(slopes, begun.states.shape[1]).T @ arrival.pulled
    return Refitted(
        window=window,
        arrival=arrival,
        trial=trial,
        information=_whole(found.model),
        pulled=pulled,
        residual=problem.differences(trial),
        sigma=float(np.sqrt(np.sum(whitened**2) / max(problem.data.samples, 1))),
        cost=found.model.cost,
        evaluations=found.evaluations,
        converged=found.converged,
    )


def slid(found: Refitted, row: int) -> Arrival:
    """Return what all rows before one of a window say: that row's arrival cost.

    Args:
        found: Optimum of the window.
        row: The first row that stays in the window, 1 or more.

    Returns:
        The cost of what the motion depends on and of the state at that row, those of the arrival so far
        included; the state before it is eliminated exactly.
    """
    window, count = found.window, len(found.x)
    shown, slopes = window.shown(found.trial)
    back = _inverse(slopes)
    residual, jacobian = (part[:row] for part in window.problem.rows(found.trial))
    # the rows by what the motion depends on in place of the unknowns, and by the state
    rows = jacobian.reshape(residual.size, -1)
    rows = np.hstack((rows[:, :count] @ back, rows[:, count:]))
    known, gradient = rows.T @ rows, rows.T @ residual.ravel()
    pulled = _pulled(window.problem.data.part(np.arange(row)), rows.reshape(*residual.shape, -1))
    if found.arrival is not None:
        pulled = pulled + found.arrival.pulled
        known = known + found.arrival.information
        gradient = gradient + found.arrival.at(np.concatenate((shown, found.state)))[1]
    state, tangents = (part[row] for part in found.motion)
    # with T the derivative of (features, new state) by (features, old state): H' = T^-T H T^-1, g' = T^-T g,
    # the Schur complement of the old state where the motion ties the two without any slack
    width = len(shown)
    turn = np.eye(width + len(state))
    turn[width:, width:] = np.linalg.inv(tangents[:, count:])
    turn[width:, :width] = -turn[width:, width:] @ (tangents[:, :count] @ back)
    point = np.concatenate((shown, state))
    return Arrival(point, symmetric(turn.T @ known @ turn), turn.T @ gradient, turn.T @ pulled)


def ahead(found: Refitted, row: int) -> Ahead:
    """Return the state at a row of a window and all that is known there.

    Args:
        found: Optimum of the window.
        row: The row; negative ones count from the end.

    Returns:
        The state, its derivatives, and the covariance of unknowns and state there.
    """
    state, slopes = (part[row] for part in found.motion)
    turn = np.eye(len(found.information))
    turn[len(found.x) :] = slopes
    return Ahead(state, slopes, symmetric(turn @ found.covariance @ turn.T))


def _model(window: Window, arrival: Arrival | None, trial: Trial, limit: float) -> Arrow:
    """Return the model of the rows, the picture and the rows before them."""
    problem, count = window.problem, len(trial.x)
    model = problem.model(trial.x, problem.rows(trial), trial.pieces, limit)
    if arrival is None:
        return model
    shown, slopes = window.shown(trial)
    cost, pull = arrival.at(np.concatenate((shown, trial.states[0])))
    chain = _chain(slopes, trial.states.shape[1])
    known, pull = chain.T @ arrival.information @ chain, chain.T @ pull
    return replace(
        model,
        cost=model.cost + cost,
        hessian=model.hessian + known[:count, :count],
        gradient=model.gradient + pull[:count],
        cross=model.cross + known[None, :count, count:],
        local_hessian=model.local_hessian + known[None, count:, count:],
        local_gradient=model.local_gradient + pull[None, count:],
    )


def _chain(slopes: np.ndarray, width: int) -> np.ndarray:
    """Return the derivatives of what the motion depends on and the state by unknowns and the state."""
    features, count = slopes.shape
    chain = np.zeros((features + width, count + width))
    chain[:features, :count], chain[features:, count:] = slopes, np.eye(width)
    return chain


def _pulled(data: Data, jacobian: np.ndarray) -> np.ndarray:
    """Return how the gradient of rows (row, dof, column) follows what moves all of their positions, (column,
    direction)."""
    # a residual is the simulated less the measured position
    shifts, samples = whitened_shifts(data), jacobian.shape[0] * jacobian.shape[1]
    return -jacobian.reshape(samples, -1).T @ shifts.reshape(samples, shifts.shape[2])


def _explained(window: Window, trial: Trial) -> bool:
    """Return whether the motion depends on the unknowns through regrouped inertias alone."""
    count = len(trial.x)
    _, slopes = window.shown(trial)
    _, jacobian = window.problem.rows(trial)
    rows = jacobian.reshape(-1, jacobian.shape[2])[:, :count]
    size = np.abs(rows).max(axis=0, initial=0.0)
    lacking = np.abs(rows @ _inverse(slopes) @ slopes - rows).max(axis=0, initial=0.0)
    return bool(np.all(lacking <= UNEXPLAINED * size))


def _inverse(slopes: np.ndarray) -> np.ndarray:
    """Return the derivatives of the unknowns by what the motion depends on, (param, feature)."""
    size = np.linalg.norm(slopes, axis=1)
    # what is always zero for this mechanism may be so but for rounding, which is no derivative
    size = np.where(size > ROUNDING * size.max(initial=0.0), size, np.inf)
    return np.linalg.pinv(slopes / size[:, None], rcond=ALIKE) / size


def _whole(model: Arrow) -> np.ndarray:
    """Return the second derivatives by unknowns and state, (param + 2 dof, param + 2 dof)."""
    cross = model.cross[0]
    known = np.block([[model.hessian, cross], [cross.T, model.local_hessian[0]]])
    return symmetric(known)


def _trial(window: Window, x: np.ndarray, state: np.ndarray) -> Trial:
    pieces = Pieces(np.array([0, len(window.times)]), np.array([0]))
    return Trial(np.asarray(x, dtype=float), np.asarray(state, dtype=float)[None], pieces, window.substeps)
