"""Intervals from many fits in place of the covariance: profiles of the cost, or records with other noise.

Where a parameter enters the motion so that the cost is no parabola over the interval, the covariance at the
optimum gives one that is too short on one side. Profiles follow the cost itself; the bootstrap asks how far
the optimum moves with the noise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.estimation.fit import Doubt, Estimate
from monodyn.estimation.record.samples import Data
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.prior import size_ratios
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.shoot import Optimum, Route, fit_pieces
from monodyn.estimation.verdict.intervals import determined, errs_by_factor
from monodyn.estimation.verdict.refine import Refined
from monodyn.estimation.verdict.surrogate import surrogate_of
from monodyn.estimation.verdict.uncertainty import knowledge_at
from monodyn.optimize import SearchSettings
from monodyn.types import Progress

RECORDS = 200
"""Records that are drawn."""
SIDES = (2.5, 97.5)
"""Percentiles of the fits of drawn records between which a parameter lies."""
LEAST_FITS = 0.8
"""Share of the drawn records that have to be fitted for intervals to be taken from them."""
STEPS, NEAR = 8, 0.02
"""Fits on either side of the optimum at most, and how near to the height of the cost one has to come."""
FARTHEST = 3.0
"""A step toward the end of an interval goes this many times as far as the last one at most."""
AGAIN = SearchSettings(evaluations=60, decrease=1e-4, relative=1e-7)
"""From the optimum to one nearby."""


@dataclass(frozen=True, eq=False)
class _Refits:
    """What is fitted again: the problem with the noise as found, and its optimum."""

    problem: Problem
    optimum: Optimum
    route: Route

    def settled(self, problem: Problem, x: np.ndarray, held: np.ndarray | bool) -> Optimum:
        """Fit from the states of the optimum."""
        trial = self.optimum.trial.at(x, self.optimum.trial.states)
        return fit_pieces(problem, trial, self.route, AGAIN, robust=False, held=held)


def refitted(
    found: Refined, estimates: Sequence[Estimate], quantile: float, settings: IdentifySettings,
    progress: Progress | None,
) -> tuple[tuple[Estimate, ...], Doubt | None]:  # fmt: skip
    """Return the estimates with intervals from many fits.

    Args:
        found: The optimum, and what is known there.
        estimates: The estimates with intervals from the covariance; those without one, or of which it is
            infinite, stay as they are.
        quantile: Half width of an interval in standard deviations.
        settings: How: ``profile`` gives the intervals of what is searched, and leaves what follows from
            several of these as it is; ``bootstrap`` those of all.
        progress: Called as ``progress("refit", done, total)``.

    Returns:
        The estimates, in their order, and what the fits say against the fit.

    Source:
        Bates and Watts, Nonlinear Regression Analysis and Its Applications, 1988, chapter 6 (profiles);
        Efron and Tibshirani, An Introduction to the Bootstrap, 1993, section 6.5 (noise of a model).
    """
    route = Route(settings.piece, settings.error_bound, AGAIN)
    weighted = found.weighted
    optimum = fit_pieces(weighted, found.optimum.trial, route, AGAIN, robust=False)
    refits = _Refits(weighted, optimum, route)
    if settings.uncertainty == "profile":
        return _profiled(refits, found, estimates, quantile, _counted(progress, len(weighted.unknowns))), None
    return _redrawn(refits, found, estimates, settings.seed, _counted(progress, RECORDS))


def _counted(progress: Progress | None, total: int) -> Callable[[], None]:
    """Return what is called after each of ``total`` steps."""
    done = 0

    def step() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress("refit", done, total)

    return step


def _profiled(
    refits: _Refits, found: Refined, estimates: Sequence[Estimate], quantile: float, step: Callable[[], None]
) -> tuple[Estimate, ...]:
    """Take each interval to where the cost, all else fitted again, is as high as the quantile has it."""
    problem, optimum = refits.problem, refits.optimum
    unknowns, known = problem.unknowns, found.known
    _, jacobian = problem.rows(optimum.trial)
    unshifted = problem.with_data(replace(problem.data, shifts=None))
    noise = knowledge_at(unshifted, optimum.x, jacobian, optimum.trial.pieces)
    # shifts of all positions move the optimum, and leave the cost as it is: they are added to what it tells
    shifted = np.sqrt(np.maximum(np.diag(known.covariance) - np.diag(noise.covariance), 0.0))

    def ends(i: int) -> tuple[float, float] | None:
        if not np.isfinite(known.std[i]) or known.std[i] <= 0.0 or unknowns.against[i] >= 0:
            step()
            return None
        along = noise.covariance[:, i] / max(noise.covariance[i, i], 1e-300)
        apart = [_end(refits, i, side * quantile * noise.std[i], along, quantile) for side in (-1.0, 1.0)]
        apart = [np.sign(d) * float(np.hypot(d, quantile * shifted[i])) for d in apart]
        low, high = np.clip(optimum.x[i] + apart, unknowns.lower[i], unknowns.upper[i])
        step()
        return low, high

    found_ends = dict(zip(unknowns.names, on_all_cores(ends, range(len(unknowns))), strict=True))
    made = []
    for estimate in estimates:
        pair = found_ends.get(estimate.name)
        if pair is not None:
            i = unknowns.names.index(estimate.name)
            at = [unknowns.values(np.where(np.arange(len(unknowns)) == i, x, optimum.x))[i] for x in pair]
            estimate = replace(estimate, lower=float(min(at)), upper=float(max(at)))
        made.append(estimate)
    return tuple(made)


def _end(refits: _Refits, i: int, first: float, along: np.ndarray, quantile: float) -> float:
    """Return how far from the optimum the cost of one coordinate is ``quantile**2 / 2`` higher.

    Args:
        refits: The problem and its optimum.
        i: The coordinate.
        first: Where that is about; its sign tells the side.
        along: How the others follow it, (param,).
        quantile: The height, as a number of standard deviations.

    Returns:
        The distance, with its sign; as far as the bound where it is not reached before.
    """
    problem, optimum = refits.problem, refits.optimum
    unknowns = problem.unknowns
    held = np.arange(len(unknowns)) == i
    bound = (unknowns.upper if first > 0 else unknowns.lower)[i] - optimum.x[i]
    at, near, far = first, 0.0, bound
    for _ in range(STEPS):
        at = min(at, bound, key=abs)
        x = np.clip(optimum.x + at * along, unknowns.lower, unknowns.upper)
        x[i] = optimum.x[i] + at
        height = np.sqrt(2.0 * max(refits.settled(problem, x, held).cost - optimum.cost, 0.0))
        if abs(height - quantile) <= NEAR * quantile or (at == bound and height < quantile):
            return at
        near, far = (at, far) if height < quantile else (near, at)
        # about proportional to the distance; where it is not, half way between what is too near and too far
        ahead = at * min(max(quantile / max(height, 1e-12), 1.0 / FARTHEST), FARTHEST)
        inside = abs(near) < abs(ahead) < abs(far)
        at = ahead if inside else (0.5 * (near + far) if np.isfinite(far) else FARTHEST * near)
    return at


def _redrawn(
    refits: _Refits, found: Refined, estimates: Sequence[Estimate], seed: int, step: Callable[[], None]
) -> tuple[tuple[Estimate, ...], Doubt | None]:
    """Take the intervals from the fits of records with other noise."""
    problem, optimum = refits.problem, refits.optimum
    difference = problem.differences(optimum.trial)

    def values(k: int) -> dict[str, float] | None:
        rng = np.random.default_rng((seed, k))
        data = _drawn(problem.data, difference, found.freedom, rng)
        prior = problem.prior.drawn_about(optimum.x - problem.unknowns.x0, rng)
        another = replace(problem, data=data, prior=prior)
        again = refits.settled(another, _near(another, optimum), False)
        step()
        if not again.converged or not np.isfinite(again.cost):
            return None
        return dict(problem.mechanism_at(again.x).values)

    drawn = [one for one in on_all_cores(values, range(RECORDS)) if one is not None]
    if len(drawn) < LEAST_FITS * RECORDS:
        few = (
            f"Of {RECORDS} records with the same motion and other noise only {len(drawn)} could be fitted: "
            "the intervals are those of the covariance, and may be too short; a longer record would help."
        )
        return tuple(estimates), Doubt("approximate", few)
    found_at = problem.mechanism_at(optimum.x)

    def spread(one: Estimate) -> Estimate:
        if one.name not in drawn[0] or not np.isfinite(one.std) or one.std <= 0.0:
            return one
        values_of = np.array([each[one.name] for each in drawn])
        low, high = np.percentile(values_of, SIDES)
        std = float(np.std(values_of))
        by_factor = errs_by_factor(problem.unknowns, found_at.parameter(one.name))
        clear = determined(one.value, std, by_factor=by_factor)
        return replace(one, std=std, lower=float(low), upper=float(high), identifiable=clear)

    return tuple(map(spread, estimates)), None


def _near(problem: Problem, optimum: Optimum) -> np.ndarray:
    """Return where a search begins, (param,): where sizes are assumed the optimum lies far along a bent
    valley, which a search creeps along and closed forms follow at once."""
    if not size_ratios(problem.mechanism, problem.unknowns):
        return optimum.x
    surrogate = surrogate_of(problem, optimum.trial, optimum.at_bound)
    if surrogate is None:
        return optimum.x
    unknowns = problem.unknowns
    x = unknowns.coordinates(surrogate.sizes.unknowns(surrogate.peak()[None])[0])
    return np.clip(x, unknowns.lower, unknowns.upper)


def _drawn(data: Data, difference: np.ndarray, freedom: float, rng: np.random.Generator) -> Data:
    """Return data about the same motion with noise, and shifts, of their own.

    Args:
        data: The data, with the noise as found: correlated noise counts as so much more of white one.
        difference: Measured less simulated positions, NaN in gaps, (row, dof).
        freedom: Independent samples from which the noise is known; it is drawn too.
        rng: Draws them.

    Returns:
        The data.
    """
    size = np.sqrt(freedom / rng.chisquare(freedom))
    position = data.position - difference + size * data.std * rng.normal(size=data.position.shape)
    if data.shifts is not None:
        position = position + np.tensordot(rng.normal(size=len(data.shifts)), data.shifts, axes=1)
    return replace(data, position=np.where(data.measured, position, 0.0))
