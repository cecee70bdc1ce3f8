"""The optimum of the search in, that of the plain least squares out: noise as found, gross errors left out.

A search bounds the pull of gross errors and takes the noise as stated. The fit that is reported leaves gross
errors out altogether, and weighs the joints with the noise that their residuals show.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from monodyn.estimation.parts import Common
from monodyn.estimation.record.samples import Data
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting import shoot
from monodyn.estimation.shooting.common import common_error, left_open, less, unknown_errors
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.scaling import (
    with_clock_of_start,
    with_gravity_of_start,
    with_masses_of_start,
)
from monodyn.estimation.shooting.search import NEGLIGIBLE
from monodyn.estimation.shooting.trial import Trial
from monodyn.estimation.torque.evidence import at_noise, cleared
from monodyn.estimation.verdict.trust import LOST_NOISE, LOST_SHARE
from monodyn.estimation.verdict.uncertainty import Knowledge, NoiseFactors, knowledge_at, noise_factors
from monodyn.mechanism.simulate import rollout, transitions
from monodyn.mechanism.torques import LAG
from monodyn.optimize import SearchSettings

MOST_REJECTED = 0.1
"""With more far-off samples than this share they are no accident, and none is left out."""
LONGEST_RUN = 3
"""Nor is a run of more far-off measured rows than this: there the motion does not follow."""
NOISE_ROUNDS, COMMON_ROUNDS = 2, 4
"""How often the noise is taken from residuals, the second fit being weighted by the first; and how often at
most where positions have errors in common, which at first count as noise. It ends earlier once the noise
stays; where the motion is not followed once is enough."""
GIVEN = 1e-9
"""Share of sizes in the common scale from which on some of them are given."""


@dataclass(frozen=True, eq=False)
class Refined:
    """The optimum of the plain least squares.

    Attributes:
        problem: The problem without gross errors, with the noise as stated, and less what the positions have
            in common; ``shifts`` of its data are what is not known of that.
        optimum: Its optimum with the noise as found; ``evaluations`` counts all.
        known: What the data know there.
        noise: How residuals compare with the stated noise.
        rejected: True for rows left out as gross errors, (row,).
        substeps: Integration steps between stamps that the optimum needs.
        error: Integration error with them [rad or m].
        common: Errors that the positions have in common.
    """

    problem: Problem
    optimum: shoot.Optimum
    known: Knowledge
    noise: NoiseFactors
    rejected: np.ndarray
    substeps: int
    error: float
    common: Common | None = None

    @property
    def weighted(self) -> Problem:
        """The problem with the noise as found."""
        return _weighted(self.problem, self.noise)

    @property
    def fitted(self) -> int:
        """Number of unknowns that take a degree of freedom from the motion."""
        return _fitted(self.problem, self.optimum)

    @cached_property
    def carried_along(self) -> tuple[np.ndarray, np.ndarray]:
        """The clock of the motion [s], (row,), and the derivative of the state at each row by that at the row
        before, (row, state, state); the identity where a record begins."""
        problem, trial = self.problem, self.optimum.trial
        mechanism, stretch = problem.mechanism_at(trial.x), problem.stretch(trial.x)
        clock, lag, parts = problem.data.times * stretch, mechanism.values.get(LAG, 0.0), []
        for first, stop, state in trial.runs:
            drive = problem.driven(mechanism.drive, lag, stretch, first, stop)
            tree, times, fine = mechanism.tree, clock[first:stop], trial.substeps
            motion = np.hstack(rollout(tree, times, *np.split(state, 2), substeps=fine, drive=drive))
            parts.append(transitions(tree, times, motion, substeps=fine, drive=drive))
        return clock, np.concatenate(parts)

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the intervals: samples that are independent, less the unknowns."""
        left = max(self.problem.data.samples - self.fitted, 1)
        return left / float(np.mean(self.noise.correlation)) ** 2


def refine(problem: Problem, optimum: shoot.Optimum, settings: IdentifySettings) -> Refined:
    """Leave gross errors out and weigh the joints with the noise that their residuals show.

    Args:
        problem: The problem, with the noise as stated.
        optimum: Its optimum, one piece a record.
        settings: How gross errors are distinguished from the motion, how exact the search is.

    Returns:
        The optimum and what is known there.
    """
    problem, optimum = shoot.with_proportions(problem, optimum)
    rejected = _gross(problem.data, optimum.residuals, settings.outlier)
    stated = problem.with_data(problem.data.without(rejected))
    route = route_of(problem, optimum, settings)
    evaluations = optimum.evaluations
    optimum = _settled(stated, optimum)
    # a motion that is not followed tells nothing of the camera, and little of sizes
    common = None if route.share else unknown_errors(stated.data)
    if route.share:
        optimum = _as_seen(stated, optimum)
    whole, steps, rounds = stated, None, 0
    if common is not None and not at_noise(stated, optimum):
        # noise that holds such errors is large and correlated, and only slowly gives way to them
        without = cleared(stated, optimum, route)
        if without is not None:
            common, stated, optimum = without
            evaluations += optimum.evaluations
    most = 1 if route.share else NOISE_ROUNDS if common is None else COMMON_ROUNDS
    noise = _noise(stated, optimum)
    while True:
        if common is not None:
            # the noise is that of positions to which the motion was fitted: it has yet to follow others
            common = common_error(_weighted(stated, noise), optimum.trial, common.mean)
            stated = whole.with_data(less(whole.data, common.mean))
        optimum = shoot.fit_pieces(
            _weighted(stated, noise), optimum.trial, route, route.fine, robust=False, substeps=steps
        )
        evaluations, rounds = evaluations + optimum.evaluations, rounds + 1
        before, noise = noise, _noise(stated, optimum)
        # the motion hardly changes from round to round, and neither do the steps that it needs
        steps = optimum.trial.substeps
        if rounds >= most or (rounds >= NOISE_ROUNDS and noise.is_about(before)):
            needed, error = shoot.choose_substeps(stated, optimum.trial, settings.error_bound)
            # again where the optimum needs more integration steps than the search chose; they double at least
            if needed <= steps or route.share:
                break
            steps = needed
    if common is not None:
        stated = stated.with_data(left_open(stated.data, common.root))
    weighted = _weighted(stated, noise)
    _, jacobian = weighted.rows(optimum.trial)
    known = knowledge_at(weighted, optimum.x, jacobian, optimum.trial.pieces)
    optimum = replace(optimum, evaluations=evaluations)
    return Refined(stated, optimum, known, noise, rejected, needed, error, common)


def route_of(problem: Problem, optimum: shoot.Optimum, settings: IdentifySettings) -> shoot.Route:
    """Return how exactly an optimum is searched: roughly where the motion does not follow the record.

    Args:
        problem: The problem, with the noise as stated.
        optimum: The optimum.
        settings: Gives the numbers.
    """
    if shoot.relative_difference(problem, optimum.trial) > LOST_SHARE and optimum.sigma > LOST_NOISE:
        # it is refused, however exactly it was found
        return shoot.Route(settings.piece, settings.error_bound, shoot.ROUGH, NEGLIGIBLE)
    # so near to the optimum all but plain Gauss-Newton steps lead there
    fine = SearchSettings(evaluations=settings.evaluations, decrease=1e-7, relative=1e-9, damping=1e-9)
    return shoot.Route(settings.piece, settings.error_bound, fine)


def _noise(problem: Problem, optimum: shoot.Optimum) -> NoiseFactors:
    difference, rates = problem.differences(optimum.trial), problem.rates(optimum.trial)
    return noise_factors(problem.data, difference, _fitted(problem, optimum), rates)


def _weighted(problem: Problem, noise: NoiseFactors) -> Problem:
    """Return the problem weighted with the noise as found."""
    return problem.with_data(noise.weighted(problem.data))


def _fitted(problem: Problem, optimum: shoot.Optimum) -> int:
    """Number of unknowns that take a degree of freedom from the motion."""
    from_picture = problem.prior.rank
    return max(len(problem.unknowns) - from_picture, 0) + optimum.trial.states.size


def _as_seen(problem: Problem, optimum: shoot.Optimum) -> shoot.Optimum:
    """Bring the sizes that a picture has shown to its proportions, at their common scale.

    With the noise that its residuals show, a motion that is not followed tells less of them than the picture
    does, but no search through it gets there: a small step of a size changes many turns altogether.
    """
    measured, unknowns = problem.mechanism.measured, problem.unknowns
    where = unknowns.index(measured.names if measured is not None else ())
    at = where[where >= 0]
    x, x0 = optimum.x.copy(), unknowns.x0
    weights = problem.prior.weights
    # sizes that are given have the scale of the start
    scale = float(weights @ (x - x0)) if weights.sum() > 1.0 - GIVEN else 0.0
    x[at] = np.clip(x0 + np.where(unknowns.log, scale, 0.0), unknowns.lower, unknowns.upper)[at]
    return replace(optimum, trial=_in_units_of(problem, optimum, x))


def _settled(problem: Problem, optimum: shoot.Optimum) -> shoot.Optimum:
    """Bring gravity, time scale and the scale of masses to the start where the motion does not fix them."""
    before = float(np.sum(problem.residuals(optimum.trial) ** 2))
    # each change is kept only where the motion does not change, which the change itself does not know: a
    # given length, a spring or a friction may fix the scale. The rate within which friction changes sign does
    # not scale, so that the clock changes a little, and the search goes on from there
    steps = ((with_gravity_of_start, 1e-6), (with_clock_of_start, 1e-3), (with_masses_of_start, 1e-6))
    for settle, change in steps:
        x = settle(problem, optimum.x)
        if np.array_equal(x, optimum.x):
            continue
        moved = replace(optimum, trial=_in_units_of(problem, optimum, x))
        after = float(np.sum(problem.residuals(moved.trial) ** 2))
        if abs(after - before) <= change * (1.0 + before):
            optimum, before = moved, after
    return optimum


def _in_units_of(problem: Problem, optimum: shoot.Optimum, x: np.ndarray) -> Trial:
    """Move to ``x`` (param,) with the measured start: states are in metres and true time, records are not."""
    trial = optimum.trial
    dofs = trial.states.shape[1] // 2
    slide = np.tile(problem.data.slide[trial.pieces.record], 2)
    states = trial.states * np.where(slide, problem.size(x) / problem.size(optimum.x), 1.0)
    states[:, dofs:] *= problem.stretch(optimum.x) / problem.stretch(x)
    return trial.at(x, states)


def _gross(data: Data, residuals: np.ndarray, outlier: float) -> np.ndarray:
    """Rows of short runs with a residual above ``outlier`` typical ones of their joint, (row,)."""
    far = np.zeros(len(residuals), dtype=bool)
    if outlier == 0:
        return far
    for dof, use in enumerate(data.measured.T):
        size = max(shoot.typical(residuals[:, [dof]], use[:, None]), 1.0)
        far[use & (np.abs(residuals[:, dof]) > outlier * size)] = True
    # a gross error comes alone: where the motion itself is missed, many rows in a row are far off
    measured = np.asarray(data.measured.any(axis=1))
    alone = np.zeros_like(far)
    for first, stop in zip(data.first[:-1], data.first[1:], strict=True):
        rows = first + np.flatnonzero(measured[first:stop])
        ends = np.flatnonzero(np.diff(far[rows].astype(int), prepend=0, append=0))
        for begin, end in ends.reshape(-1, 2):
            alone[rows[begin:end]] = end - begin <= LONGEST_RUN
    return alone if alone.sum() <= MOST_REJECTED * measured.sum() else np.zeros_like(far)
