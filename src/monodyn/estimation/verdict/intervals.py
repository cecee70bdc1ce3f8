"""The optimum and what is known there in, every parameter with its interval out.

A parameter is an unknown of the search, or follows from several, or was given; and some only keep their
proportion to a length, about which the data give no information.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from monodyn.estimation.fit import Estimate
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.shoot import Optimum
from monodyn.estimation.shooting.unknowns import PICTURE_ONLY
from monodyn.estimation.verdict.posterior import Posterior
from monodyn.estimation.verdict.uncertainty import Knowledge
from monodyn.mechanism import Parameter
from monodyn.mechanism.assemble import following_slopes
from monodyn.mechanism.plan import OWNED_COLUMNS
from monodyn.mechanism.upright import ROLL_STD

WEAK = 1.0
"""Standard deviation of the logarithm above which a value is hardly known: a factor of e either way."""


def estimates(
    problem: Problem, optimum: Optimum, known: Knowledge, quantile: float, drawn: Posterior | None = None
) -> tuple[Estimate, ...]:
    """Bring every parameter together with its interval.

    Args:
        problem: The problem.
        optimum: The optimum.
        known: What the data know there.
        quantile: Half width of an interval in standard deviations.
        drawn: Draws of the posterior, from which intervals are taken where there are any.

    Returns:
        One estimate by parameter of the mechanism, in its order. A size that keeps its proportion to a length
        has no interval, because nothing determines it; nor have offsets, on which the motion does not depend,
        and what is held under free torques.
    """
    unknowns, x = problem.unknowns, optimum.x
    where = {name: i for i, name in enumerate(unknowns.names)}
    tied = {name: k for k, name in enumerate(unknowns.tied)}
    mechanism = problem.mechanism_at(x)
    # what follows from sizes stands in the tree: its derivatives are those of the tree's columns
    dlinks = problem.at(x).directions.links
    columns = {
        mechanism.plan.table.names[row]: dlinks[i, column]
        for i, rows in enumerate(mechanism.plan.owned)
        for row, column in zip(rows or (), OWNED_COLUMNS, strict=False)
    }
    # what follows by a form moves with the sizes in it, the tied ones included
    chain, slopes = unknowns.chain(x), following_slopes(mechanism.plan, mechanism.own)
    moving = [mechanism.row(name) for name in (*unknowns.names, *unknowns.tied)]
    inner = [k for k, row in enumerate(moving) if row < len(slopes)]
    for row, _ in mechanism.plan.ties:
        columns[mechanism.plan.table.names[row]] = slopes[row, [moving[k] for k in inner]] @ chain[inner]
    # sizes that are held under free torques could have any value: they are not known, though they are fixed
    held = mechanism.torque == "free"
    found = []
    for p in mechanism.parameters:
        if p.name in where:
            i = where[p.name]
            log = bool(unknowns.log[i])
            deviation = Deviation(float(known.std[i]) * (p.value if log else 1.0), log)
            if unknowns.ratio[i] or unknowns.against[i] >= 0:
                # its own ratio may be known better than what it is a ratio to
                along = _along(chain[i], p.value, known)
                deviation = Deviation(along.std, False)
            found.append(_estimate(p, deviation, quantile, free=True, at_bound=bool(optimum.at_bound[i])))
        elif p.kind == "roll" and p.free:  # held under free torques, at what is assumed of it
            found.append(_estimate(p, Deviation(ROLL_STD, False), quantile))
        elif p.kind == "roll" and p.name not in mechanism.chosen and p.value == 0.0:
            continue  # there is no camera
        elif p.name in tied and p.kind == "density":  # as well known as the one it keeps its proportion to
            along = _along(chain[len(unknowns) + tied[p.name]], p.value, known)
            found.append(_estimate(p, along, quantile))
        elif p.name in tied or (p.free and (held or p.kind in PICTURE_ONLY)):
            found.append(_estimate(p, Deviation(np.inf, False), quantile))
        elif p.follows:
            found.append(_estimate(p, _along(columns[p.name], p.value, known), quantile))
        else:
            found.append(_estimate(p, Deviation(0.0, False), quantile))
    if drawn is not None:
        found = [_from_draws(estimate, mechanism.parameter(estimate.name), drawn) for estimate in found]
    return tuple(found)


@dataclass(frozen=True)
class Deviation:
    """How far a value may be off.

    Attributes:
        std: Standard deviation in the parameter's unit, infinite where nothing fixes it.
        ratio: True where the error is a factor, of a positive value.
    """

    std: float
    ratio: bool


def _along(gradient: np.ndarray, value: float, known: Knowledge) -> Deviation:
    """Return how far a value that follows may be off, from its derivatives by coordinate (param,)."""
    # a value is known where no open direction changes it, though all that it follows from may be open
    open_share = np.abs(known.open.T @ (gradient / known.relative)) if known.open.size else np.zeros(1)
    if open_share.max(initial=0.0) > 1e-3 * max(abs(value), 1e-300):
        return Deviation(np.inf, value > 0)
    return Deviation(float(np.sqrt(max(gradient @ known.covariance @ gradient, 0.0))), value > 0)


def _from_draws(estimate: Estimate, p: Parameter, drawn: Posterior) -> Estimate:
    """Return an estimate with the interval of the draws, cut at its bounds; it always contains its value."""
    values = drawn.values.get(estimate.name)
    if values is None or not 0.0 < estimate.std < np.inf:
        return estimate
    low, high = drawn.interval(values)
    lower, upper = max(low, p.lower), min(high, p.upper)
    return replace(estimate, lower=min(lower, estimate.value), upper=max(upper, estimate.value))


def _estimate(
    p: Parameter, deviation: Deviation, quantile: float, *, free: bool = False, at_bound: bool = False
) -> Estimate:
    """Return a parameter with its interval, cut at its bounds."""
    value, std = float(p.value), deviation.std
    made = partial(Estimate, name=p.name, value=value, unit=p.unit, free=free, at_bound=at_bound)
    if std == 0.0:
        return made(std=0.0, lower=value, upper=value, identifiable=True)
    if not np.isfinite(std):
        return made(std=float("inf"), lower=p.lower, upper=p.upper, identifiable=False)
    if deviation.ratio:
        # the error of a logarithm is symmetric, that of the value is not; beyond e^700 there is no number
        reach = float(np.exp(min(quantile * std / value, 700.0)))
        lower, upper = value / reach, value * reach
    else:
        lower, upper = value - quantile * std, value + quantile * std
    clear = not deviation.ratio or std < WEAK * value
    lower, upper = max(float(lower), p.lower), min(float(upper), p.upper)
    return made(std=std, lower=lower, upper=upper, identifiable=clear)
