"""The optimum in, the fit out: gross errors left out, noise as found, intervals, status and advice."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from monodyn.estimation.fit import Estimate, Fit, Start
from monodyn.estimation.record.samples import Data
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.shoot import Grown, Route, choose_substeps, fit_pieces, typical
from monodyn.estimation.shooting.unknowns import kind_of
from monodyn.estimation.verdict import advice as say
from monodyn.estimation.verdict.combinations import combinations
from monodyn.estimation.verdict.intervals import estimates
from monodyn.estimation.verdict.trust import motion_sizes, typical_differences, verdict
from monodyn.estimation.verdict.uncertainty import Knowledge, know, noise_factors
from monodyn.mechanism import Mechanism
from monodyn.optimize import SearchSettings
from monodyn.types import Poses

if TYPE_CHECKING:
    from monodyn.estimation.settings import IdentifySettings

MOST_REJECTED = 0.1
"""With more far-off samples than this share they are no accident, and none is left out."""
LONGEST_RUN = 3
"""Nor is a run of more far-off measured rows than this: there the motion does not follow."""


def conclude(
    problem: Problem,
    grown: Grown,
    records: tuple[Poses, ...],
    settings: IdentifySettings,
    *,
    tried: int,
    began: float,
) -> Fit:
    """Turn the best optimum into a fit.

    Args:
        problem: The problem, with the noise as stated.
        grown: The optimum.
        records: The records, for the shape of the residuals.
        settings: How gross errors are told, how exact the last search is.
        tried: Number of starts that were tried.
        began: When the identification began.

    Returns:
        The fit.
    """
    if not np.isfinite(grown.cost):
        reason = (
            "The motion of the start cannot be simulated through the record; check the mechanism file and "
            "that its joints turn as in the record."
        )
        return refuse(problem, reason, records, time.perf_counter() - began)
    rejected = _gross(problem.data, grown.residuals, settings.outlier)
    stated = problem.with_data(problem.data.without(rejected))
    fine = SearchSettings(evaluations=settings.evaluations, decrease=1e-7, relative=1e-9)
    route = Route(settings.piece, settings.error_bound, fine)
    evaluations = grown.evaluations
    grown = _plain(stated, grown)
    substeps, error, rounds = 0, 0.0, 0
    # twice, and again where the optimum needs more steps than the search chose; they double at least
    while rounds < 2 or substeps > grown.substeps:
        size, spread = noise_factors(stated.data, _differences(stated, grown), _fitted(problem, grown))
        weighted = stated.with_data(stated.data.scaled(size * spread))
        grown = fit_pieces(weighted, grown.x, grown.states, grown.pieces, route, fine, robust=False)
        evaluations, rounds = evaluations + grown.evaluations, rounds + 1
        substeps, error = choose_substeps(stated, grown.x, grown.states, grown.pieces, settings.error_bound)
    size, spread = noise_factors(stated.data, _differences(stated, grown), _fitted(problem, grown))
    weighted = stated.with_data(stated.data.scaled(size * spread))
    known = know(weighted, grown)
    freedom = max(stated.data.samples - _fitted(stated, grown), 1) / float(np.mean(spread)) ** 2
    fit = collected(stated, replace(grown, evaluations=evaluations), known, records, freedom, began)
    status, ok = verdict(stated, grown, fit.rms, size)
    fit = replace(fit, status=status, ok=ok)
    advice = _advice(stated, grown, known, fit, rejected, size, spread, tried, records)
    return replace(fit, advice=(*say.integration(substeps, error, settings.error_bound), *advice))


def refuse(problem: Problem, status: str, records: tuple[Poses, ...], seconds: float) -> Fit:
    """Return a fit that says why nothing was identified; the mechanism stays as it was."""
    parameters = tuple(
        Estimate(p.name, p.value, np.inf, p.lower, p.upper, p.unit, True, False, False)
        if p.name in problem.unknowns.names
        else Estimate(p.name, p.value, 0.0, p.value, p.value, p.unit, False, False, False)
        for p in problem.mechanism.parameters
    )
    residual = tuple(np.full(record.position.shape, np.nan) for record in records)
    return Fit(
        status=status, ok=False, advice=(), mechanism=problem.mechanism, parameters=parameters,
        combinations=(), starts=(), names=(), tied=(), covariance=np.zeros((0, 0)), residual=residual,
        rms={joint.name: float("nan") for joint in problem.mechanism.joints}, scale=1.0,
        torque=problem.mechanism.torque, time=tuple(record.time for record in records), evaluations=0,
        seconds=seconds,
    )  # fmt: skip


def _plain(problem: Problem, grown: Grown) -> Grown:
    """Bring gravity, time scale and the scale of masses to the start where the motion does not fix them."""
    before = float(np.sum(_stated_residuals(problem, grown) ** 2))
    dofs = grown.states.shape[1] // 2
    slide = np.tile(problem.data.slide[grown.pieces.record], 2)
    # the sign of friction changes within a rate that does not scale: a small change, and the search goes on
    steps = ((problem.gravity_scaled, 1e-6), (problem.clock_scaled, 1e-3), (problem.mass_scaled, 1e-6))
    for plainer, change in steps:
        x = plainer(grown.x)
        # start states are in metres and by true time, what was measured is not
        states = grown.states * np.where(slide, problem.size(x) / problem.size(grown.x), 1.0)
        states[:, dofs:] *= problem.stretch(grown.x) / problem.stretch(x)
        moved = replace(grown, x=x, states=states)
        after = float(np.sum(_stated_residuals(problem, moved) ** 2))
        if abs(after - before) <= change * (1.0 + before):
            grown, before = moved, after
    return grown


def _uniform(problem: Problem) -> bool:
    """True when inertia follows from sizes."""
    return not any(kind_of(name) == "inertia" for name in problem.unknowns.names)


def _frictionless(problem: Problem) -> tuple[str, ...]:
    """Names of the dry frictions that are zero and were not estimated."""
    names = [f"{joint.name}.friction" for joint in problem.mechanism.joints]
    values = problem.mechanism.values
    return tuple(name for name in names if values[name] == 0 and name not in problem.unknowns.names)


def _stated_residuals(problem: Problem, grown: Grown) -> np.ndarray:
    """Residuals in units of the stated noise, (row, dof)."""
    return problem.residuals(grown.x, grown.states, grown.pieces, grown.substeps)


def _differences(problem: Problem, grown: Grown) -> np.ndarray:
    """Measured less simulated positions in the record's units, NaN in gaps, (row, dof)."""
    return problem.differences(grown.x, grown.states, grown.pieces, grown.substeps)


def _fitted(problem: Problem, grown: Grown) -> int:
    """Number of unknowns that take a degree of freedom from the motion."""
    from_picture = problem.prior.rank
    return max(len(problem.unknowns) - from_picture, 0) + grown.states.size


def _gross(data: Data, residuals: np.ndarray, outlier: float) -> np.ndarray:
    """Rows of short runs with a residual above ``outlier`` typical ones of their joint, (row,)."""
    far = np.zeros(len(residuals), dtype=bool)
    if outlier == 0:
        return far
    for dof, use in enumerate(data.measured.T):
        size = max(typical(residuals[:, [dof]], use[:, None]), 1.0)
        far[use & (np.abs(residuals[:, dof]) > outlier * size)] = True
    measured = np.asarray(data.measured.any(axis=1))
    alone = np.zeros_like(far)
    for first, stop in zip(data.first[:-1], data.first[1:], strict=True):
        rows = first + np.flatnonzero(measured[first:stop])
        ends = np.flatnonzero(np.diff(far[rows].astype(int), prepend=0, append=0))
        for begin, end in ends.reshape(-1, 2):
            alone[rows[begin:end]] = end - begin <= LONGEST_RUN
    return alone if alone.sum() <= MOST_REJECTED * measured.sum() else np.zeros_like(far)


def collected(
    problem: Problem,
    grown: Grown,
    known: Knowledge,
    records: tuple[Poses, ...],
    freedom: float,
    began: float,
) -> Fit:
    """Collect what was found, all but status and advice.

    Args:
        problem: The problem.
        grown: The optimum, one piece a record.
        known: What is known of the unknowns and the start states.
        records: The records, for the shape of the residuals.
        freedom: Degrees of freedom of the intervals.
        began: When the identification began.
    """
    from scipy.special import stdtrit

    data, mechanism, unknowns = problem.data, problem.mechanism_at(grown.x), problem.unknowns
    unit = np.where(data.slide, problem.size(grown.x), 1.0)
    difference = _differences(problem, grown) * np.repeat(unit, np.diff(data.first), axis=0)
    rms = np.sqrt(np.nanmean(difference**2, axis=0)).tolist()
    tied = zip(unknowns.tied, unknowns.tied_to, strict=True)
    return Fit(
        status="",
        ok=True,
        advice=(),
        mechanism=mechanism,
        parameters=estimates(problem, grown, known, float(stdtrit(max(freedom, 1.0), 0.975))),
        combinations=combinations(problem, grown.x, known),
        starts=_starts(problem, grown, known),
        names=_unknown_names(problem),
        tied=tuple((name, unknowns.names[i]) for name, i in tied),
        covariance=_natural(problem, grown, known),
        residual=_by_record(data, difference, records),
        rms=dict(zip((joint.name for joint in mechanism.joints), rms, strict=True)),
        scale=problem.size(grown.x),
        torque=mechanism.torque,
        time=tuple(record.time for record in records),
        evaluations=grown.evaluations,
        seconds=time.perf_counter() - began,
    )


def _without_use(mechanism: Mechanism) -> list[str]:
    """Names of given thicknesses and densities on which no link depends."""
    given = [
        name
        for name in mechanism.values
        if name in mechanism.chosen
        and kind_of(name) in ("thickness", "density")
        and not mechanism.parameter(name).free
    ]
    return [name for name in given if not mechanism.directions([name]).links.any()]


def _advice(
    problem: Problem,
    grown: Grown,
    known: Knowledge,
    fit: Fit,
    rejected: np.ndarray,
    size: np.ndarray,
    spread: np.ndarray,
    tried: int,
    records: tuple[Poses, ...],
) -> tuple[str, ...]:
    """All that the reader should know, the gravest first."""
    simulated = problem.simulated(grown.x, grown.states, grown.pieces, grown.substeps)
    gone = problem.data.source[rejected]
    left_out = [int(records[0].frame[row]) for row in gone] if len(records) == 1 else []
    share = float((typical_differences(problem, grown) / np.maximum(motion_sizes(problem.data), 1e-12)).max())
    found = say.misfit(
        problem.mechanism, fit.rms, size, spread, uniform=_uniform(problem) and share > 0.01,
        frictionless=_frictionless(problem) if share > 0.01 or not fit.ok else (),
        pictured=not all(record.metric for record in records),
    )  # fmt: skip
    found += say.limits(problem.mechanism, simulated)
    found += say.contradictions(problem.prior.negative)
    if fit.ok:
        found += say.open_parameters(fit.parameters, known.without_effect(problem.unknowns.names))
        found += say.bounds(fit.parameters)
        found += say.proportions(problem.unknowns.tied if _uniform(problem) else ())
    found += say.without_use(_without_use(problem.mechanism))
    if problem.mechanism.torque == "free":
        found += say.free_torques(problem.mechanism)
    found += say.clock(fit.parameters)
    total = int(problem.data.measured.any(axis=1).sum()) + int(rejected.sum())
    found += say.outliers(total, int(rejected.sum()), left_out)
    found += say.few(problem.data.samples, _fitted(problem, grown))
    if not grown.converged:
        found.append(
            "The search ended before it was sure of the minimum; allow more with --identify.evaluations."
        )
    if tried > 1:
        found.append(f"{tried} starts were tried; the best of them is reported.")
    return tuple(found)


def _unknown_names(problem: Problem) -> tuple[str, ...]:
    """Names of the shared unknowns, then of each record's start state."""
    joints = [joint.name for joint in problem.mechanism.joints]
    states = [*joints, *(f"{name}_vel" for name in joints)]
    records = range(len(problem.data.first) - 1)
    return (*problem.unknowns.names, *(f"record{k}.{name}" for k in records for name in states))


def _natural(problem: Problem, grown: Grown, known: Knowledge) -> np.ndarray:
    """Bring the covariance from coordinates to the parameters themselves."""
    slope = np.ones(len(known.full))
    slope[: len(problem.unknowns)] = problem.unknowns.slope(grown.x)
    return known.full * np.outer(slope, slope)


def _starts(problem: Problem, grown: Grown, known: Knowledge) -> tuple[Start, ...]:
    """Start state of each record."""
    count, width = len(problem.unknowns), grown.states.shape[1]
    found = []
    for k, state in enumerate(grown.states):
        block = slice(count + k * width, count + (k + 1) * width)
        when = float(problem.data.times[problem.data.first[k]])
        q0, v0 = np.split(state, 2)
        found.append(Start(when, q0, v0, known.full[block, block]))
    return tuple(found)


def _by_record(data: Data, difference: np.ndarray, records: tuple[Poses, ...]) -> tuple[np.ndarray, ...]:
    """Cut the residuals back into the tables of the records."""
    found = []
    for k, record in enumerate(records):
        table = np.full((len(record), difference.shape[1]), np.nan)
        rows = slice(data.first[k], data.first[k + 1])
        source = data.source[rows]
        table[source[source >= 0]] = difference[rows][source >= 0]
        found.append(table)
    return tuple(found)
