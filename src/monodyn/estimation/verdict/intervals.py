"""The optimum and what is known there in, every parameter with its interval out.

A parameter is an unknown of the search, or follows from several, or was given; and some only keep their
proportion to a length, about which the data give no information.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.estimation.fit import Estimate
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.shoot import Optimum
from monodyn.estimation.shooting.unknowns import LOGARITHMIC, ONE_FOR_ALL, PICTURE_ONLY, Unknowns
from monodyn.estimation.verdict.posterior import Posterior
from monodyn.estimation.verdict.uncertainty import Knowledge
from monodyn.mechanism import Parameter
from monodyn.mechanism.assemble import following_slopes
from monodyn.mechanism.plan import OWNED_COLUMNS
from monodyn.mechanism.upright import ROLL_STD

WEAK = 1.0
"""Standard deviation of the logarithm above which a value is hardly known: a factor of e either way."""
LONGEST = 700.0
"""Longest side of the interval of a logarithm: beyond e^700 there is no number."""


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
    moving = mechanism.rows((*unknowns.names, *unknowns.tied))
    inner = moving < len(slopes)
    for row, _ in mechanism.plan.ties:
        columns[mechanism.plan.table.names[row]] = slopes[row, moving[inner]] @ chain[inner]
    # sizes that are held under free torques could have any value: they are not known, though they are fixed
    held = mechanism.torque == "free"
    found = []
    for p in mechanism.parameters:
        i, std = where.get(p.name, -1), 0.0
        if i >= 0 and (unknowns.ratio[i] or unknowns.against[i] >= 0):
            # its own ratio may be known better than what it is a ratio to
            std = _std_along(chain[i], p.value, known)
        elif i >= 0:
            std = float(known.std[i]) * (p.value if unknowns.log[i] else 1.0)
        elif p.kind == "roll" and p.free:  # held under free torques, at what is assumed of it
            std = ROLL_STD
        elif p.kind == "roll" and p.name not in mechanism.chosen and p.value == 0.0:
            continue  # there is no camera
        elif p.name in tied and p.kind in ONE_FOR_ALL:  # as well known as the one it keeps its proportion to
            std = _std_along(chain[len(unknowns) + tied[p.name]], p.value, known)
        elif p.name in tied or (p.free and (held or p.kind in PICTURE_ONLY)):
            std = np.inf
        elif p.follows:
            std = _std_along(columns[p.name], p.value, known)
        at_bound = i >= 0 and bool(optimum.at_bound[i])
        by_factor = errs_by_factor(unknowns, p)
        found.append(stated(p, std, quantile, by_factor=by_factor, free=i >= 0, at_bound=at_bound))
    if drawn is not None:
        found = [_from_draws(estimate, mechanism.parameter(estimate.name), drawn) for estimate in found]
    return tuple(found)


def stated(
    p: Parameter, std: float, quantile: float, *, by_factor: bool, free: bool, at_bound: bool
) -> Estimate:
    """Return a parameter with its interval, cut at its bounds.

    Args:
        p: The parameter, with its value.
        std: Its standard deviation; 0 where it is known exactly, infinite where nothing is known of it.
        quantile: Half width of an interval in standard deviations.
        by_factor: Whether its error is a factor.
        free: Whether it was searched.
        at_bound: Whether it ended on a bound.
    """
    value, lower, upper = float(p.value), p.lower, p.upper
    if std == 0.0:
        lower, upper, clear = value, value, True
    elif np.isfinite(std):
        low, high = widened(value, value, value, quantile * std, by_factor=by_factor)
        lower, upper = max(low, lower), min(high, upper)
        clear = determined(value, std, by_factor=by_factor)
    else:
        clear = False
    return Estimate(p.name, value, std, lower, upper, p.unit, free, clear, at_bound)


def errs_by_factor(unknowns: Unknowns, p: Parameter) -> bool:
    """Return whether the error of a parameter is a factor, so that its interval is that of a logarithm.

    Args:
        unknowns: What was searched, and how.
        p: The parameter, with its value.

    Returns:
        True for what was searched as a logarithm, and for positive values that follow.
    """
    if p.name in unknowns.names:
        i = unknowns.names.index(p.name)
        return bool(unknowns.log[i] and not unknowns.ratio[i] and unknowns.against[i] < 0)
    return p.value > 0.0 and (p.follows or (p.name in unknowns.tied and p.kind in LOGARITHMIC))


def determined(value: float, std: float, *, by_factor: bool) -> bool:
    """Return whether a value is known at least within a factor of about three.

    Args:
        value: The value.
        std: Its standard deviation.
        by_factor: Whether its error is a factor.
    """
    return std < WEAK * value if by_factor else bool(np.isfinite(std))


def widened(value: float, lower: float, upper: float, half: float, *, by_factor: bool) -> tuple[float, float]:
    """Return the ends of an interval with an error more, which is independent of what it has already.

    Either side becomes sqrt(side^2 + half^2): of a factor in the logarithm, in which its error is symmetric.

    Args:
        value: What it is about.
        lower: Its lower end; the value itself where it is known exactly.
        upper: Its upper end, likewise.
        half: Half width of the interval that the error alone would leave, in the unit of the value.
        by_factor: Whether the error is a factor.
    """
    if not by_factor:
        return value - float(np.hypot(value - lower, half)), value + float(np.hypot(upper - value, half))
    below = np.log(value / lower) if lower > 0.0 else np.inf
    down, up = (
        float(np.exp(min(np.hypot(side, half / value), LONGEST))) for side in (below, np.log(upper / value))
    )
    # no number reaches as far as zero or infinity
    return min(value / down, lower), max(value * up, upper)


def _std_along(gradient: np.ndarray, value: float, known: Knowledge) -> float:
    """Return the standard deviation of a value that follows, from its derivatives by coordinate (param,)."""
    # a value is known where no open direction changes it, though all that it follows from may be open
    open_share = np.abs(known.open.T @ (gradient / known.relative)) if known.open.size else np.zeros(1)
    if open_share.max(initial=0.0) > 1e-3 * max(abs(value), 1e-300):
        return np.inf
    return float(np.sqrt(max(gradient @ known.covariance @ gradient, 0.0)))


def _from_draws(estimate: Estimate, p: Parameter, drawn: Posterior) -> Estimate:
    """Return an estimate with the interval of the draws, cut at its bounds; it always contains its value."""
    values = drawn.values.get(estimate.name)
    if values is None or not 0.0 < estimate.std < np.inf:
        return estimate
    low, high = drawn.interval(values)
    lower, upper = max(low, p.lower), min(high, p.upper)
    return replace(estimate, lower=min(lower, estimate.value), upper=max(upper, estimate.value))
