"""The optimum in, the fit out: intervals, status and advice."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from monodyn.estimation.fit import Doubt, Estimate, Fit
from monodyn.estimation.parts import Start
from monodyn.estimation.record.samples import Data
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.common import by_record
from monodyn.estimation.shooting.prior import Proportion, size_ratios, thickness_ratios
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.shoot import Optimum, relative_difference
from monodyn.estimation.torque.task import TorqueSolution
from monodyn.estimation.verdict import advice, assumed, trust, undetermined
from monodyn.estimation.verdict.combinations import combinations
from monodyn.estimation.verdict.gravity import density_shares, gravity_share
from monodyn.estimation.verdict.intervals import estimates
from monodyn.estimation.verdict.posterior import Posterior, posterior
from monodyn.estimation.verdict.refine import Refined, refine
from monodyn.estimation.verdict.refits import refitted
from monodyn.estimation.verdict.repeating import repeating_share
from monodyn.estimation.verdict.shares import with_share
from monodyn.estimation.verdict.springs import like_weight
from monodyn.estimation.verdict.student import half_width
from monodyn.estimation.verdict.twins import told, twins_of
from monodyn.estimation.verdict.uncertainty import Knowledge
from monodyn.estimation.verdict.unmodelled import unmodelled
from monodyn.estimation.wording import listed
from monodyn.mechanism import Mechanism, Parameter
from monodyn.mechanism.upright import ROLL, feels_roll
from monodyn.types import Poses, Progress

UNSTARTED = (
    "The motion of the start cannot be simulated through the record; check the mechanism file and that its "
    "joints turn as in the record."
)
UNSTABLE = (
    "The identified mechanism cannot be simulated: with as many integration steps as there may be its "
    "motion still grows beyond all bounds, as with a joint that is damped so much that it hardly turns; "
    "check that the mechanism is the one in the record, without joints that it has not."
)
SAME_SCALE = 0.1
"""Standard deviation of the logarithm of a ratio of lengths up to which their scale is all that is open."""
RATIO_KNOWN = 0.5
"""Standard deviation over the value up to which a ratio counts as determined."""
BEYOND = 1e3
"""No motion reaches this many times its range, nor this many radians or metres where that is small."""
CLEAR_SHARE = 0.01
"""Residuals below this share of the motion are too small for bodies or dry friction to be the reason."""


def summarize(
    solution: TorqueSolution, records: tuple[Poses, ...], settings: IdentifySettings, began: float,
    progress: Progress | None = None,
) -> Fit:  # fmt: skip
    """Turn the solution of a search into a fit.

    Args:
        solution: The problem, with the noise as stated, and its optimum or why there is none.
        records: The records, for the shape of the residuals.
        settings: How gross errors are distinguished from the motion, how exact the last search is.
        began: When the identification began.
        progress: Called with the fits done, where the intervals are from many.

    Returns:
        The fit; without an optimum one whose status is the reason.
    """
    problem, optimum = solution.problem, solution.optimum
    if optimum is None:
        return refused(problem, solution.reason, records, time.perf_counter() - began)
    if not np.isfinite(optimum.cost):
        status = UNSTARTED
        return replace(refused(problem, status, records, time.perf_counter() - began), advice=solution.advice)
    found = refine(problem, optimum, settings)
    missed = trust.verdict(found.problem, found.optimum, rms_of(found.problem, found.optimum), found.noise)
    # a motion that is refused is that of another mechanism: neither intervals nor twins are any use
    lost = missed is not None and missed.grade == "refused"
    fit = fit_of(
        found.problem, found.optimum, found.known, records, freedom=found.freedom, began=began,
        drawn=None if lost else posterior(found),
    )  # fmt: skip
    by_noise, hardly = fit, None
    if settings.uncertainty != "linear" and not lost:
        quantile = half_width(found.freedom)
        parameters, hardly = refitted(found, fit.parameters, quantile, settings, progress)
        fit = replace(fit, parameters=parameters, seconds=time.perf_counter() - began)
    if lost and found.common is not None:
        # nor does it tell anything of the camera
        unshifted = problem.with_data(replace(problem.data, shifts=None))
        return summarize(replace(solution, problem=unshifted), records, settings, began, progress)
    by_gravity = gravity_share(found, by_noise)
    lacking = unmodelled(found)
    random = np.zeros(len(fit.rms)) if lacking is None else lacking.density
    shares = [] if lost else [*density_shares(found, by_noise), repeating_share(found, random)]
    for more in (by_gravity, *shares):
        parameters, ratios = with_share(
            fit.parameters, fit.combinations, more, found.problem, half_width(found.freedom)
        )
        fit = replace(fit, parameters=parameters, combinations=ratios)
    ended = [problem.unknowns.named(x) for x in optimum.twins]
    fit = replace(
        fit,
        status=trust.identified(found.problem, fit.rms),
        stamp_error=found.noise.stamps,
        unmodelled=lacking,
        common=() if found.common is None else by_record(found.common, records),
        tried_torques=solution.compared,
        alternatives=() if lost else twins_of(found, ended, fit.parameters, settings),
    )
    unsupported = [Doubt("approximate", solution.doubt)] if solution.doubt else []
    few = [hardly] if hardly else []
    others = [Doubt("approximate", reason) for reason in told(fit.alternatives, fit.parameters)]
    against = [missed] if missed is not None and lost else _doubts(found, fit, settings, missed)
    fit = fit.doubted([*unsupported, *few, *against, *others])
    said = _advice(found, fit, records, settings)
    if fit.ok and (by_gravity.parameters or by_gravity.combinations):
        said += advice.taken_gravity(problem.mechanism)
    if fit.ok:
        said += advice.taken_densities(problem.mechanism)
    advised = (*solution.advice, *said, *advice.starts_tried(solution.tried))
    return replace(fit, advice=advised)


def _doubts(found: Refined, fit: Fit, settings: IdentifySettings, missed: Doubt | None) -> list[Doubt]:
    """Return what the search and its end say against a fit that is not refused for its residuals."""
    doubts = [missed] if missed is not None else []
    if reason := _unlikely(found, fit):
        return [Doubt("refused", reason), *doubts]
    found_so = [
        *_damaged(found),
        *_hardly_scaled(fit, found.problem.mechanism),
        *advice.integration(found.substeps, found.error, settings.error_bound),
        *advice.bounds_met(fit.parameters),
        *advice.search_end(found.optimum.converged),
    ]
    return [*doubts, *(Doubt("approximate", reason) for reason in found_so)]


def _damaged(found: Refined) -> list[str]:
    """Say that the record holds what no motion could have left there: then it may be wrong elsewhere too."""
    problem = found.problem
    size = np.abs(problem.data.position) / np.maximum(trust.motion_ranges(problem), 1.0)
    beyond = size[found.rejected] > BEYOND
    if not beyond.any():
        return []
    joint = problem.mechanism.joints[int(np.flatnonzero(beyond.any(axis=0))[0])]
    most = np.nanmax(np.abs(problem.data.position[found.rejected]))
    return [
        f"The record is damaged: {int(beyond.any(axis=1).sum())} of its rows have positions that no motion "
        f"reaches, up to {most:.3g} of {joint.name}. They were left out; look whether the others are right."
    ]


def _unlikely(found: Refined, fit: Fit) -> str | None:
    """Return why a fit whose residuals are small is not that of the mechanism, a sentence; None for no
    reason."""
    mechanism = found.problem.mechanism
    if not np.isfinite(found.error):
        # small residuals with one number of steps only: neither a prediction nor a simulator follows
        return UNSTABLE
    if trust.moves_evenly(found.problem.data):
        return trust.EVEN
    if ended := _at_limit(fit, mechanism):
        return (
            f"{listed(ended)} ended at the limit of what is tried: the motion is not that of the mechanism, "
            "or does not determine its size; check the mechanism file, or set the limits with --bounds."
        )
    unsure = _undetermined(fit, mechanism)
    if unsure and not _scale_alone(fit, unsure):
        return (
            f"The motion does not determine {listed(unsure)}: the error is as large as the value. A longer "
            "record or a livelier motion would help, or a measured length, given with --fix."
        )
    return None


def _at_limit(fit: Fit, mechanism: Mechanism) -> list[str]:
    """Name the lengths and masses that ended on a bound which the user did not set."""
    ended, table = [], mechanism.plan.table
    for p in fit.parameters:
        if p.at_bound and p.value != 0.0 and mechanism.parameter(p.name).kind in ("length", "mass"):
            row = table.names.index(p.name)
            bounds = mechanism.lower[row], mechanism.upper[row]
            if bounds == (table.lower[row], table.upper[row]):
                ended.append(p.name)
    return ended


def _undetermined(fit: Fit, mechanism: Mechanism) -> list[str]:
    """Name the lengths of bodies that turn, on which the motion depends, whose interval reaches as far as
    their value.

    That is no scale left open: of all lengths together, which a choice of gravity or time leaves, none has
    an interval at all.
    """
    turning: set[str] = set()
    for joint, parent in zip(mechanism.joints, mechanism.tree.parent.tolist(), strict=True):
        if joint.kind == "hinge" or (parent >= 0 and mechanism.joints[parent].body in turning):
            turning.add(joint.body)
    hardly = [p.name for p in fit.parameters if p.free and np.isfinite(p.std) and not p.identifiable]
    sizes = [mechanism.parameter(name) for name in hardly]
    return [p.name for p in sizes if p.kind == "length" and p.owner in turning]


def _scale_alone(fit: Fit, names: list[str]) -> bool:
    """Return whether of lengths that are hardly determined the common scale alone is not: it moves nothing
    where gravity hardly pulls, and is no more a reason than one that nothing determines."""
    at = [fit.shared.index(name) for name in names]
    values = np.array([fit.parameter(name).value for name in names])
    relative = fit.covariance[np.ix_(at, at)] / np.outer(values, values)
    variance = np.diag(relative) + relative[0, 0] - 2.0 * relative[0]
    return len(names) > 1 and bool(np.all(variance < SAME_SCALE**2))


def _hardly_scaled(fit: Fit, mechanism: Mechanism) -> list[str]:
    """Say that lengths are hardly determined but for their ratios."""
    unsure = _undetermined(fit, mechanism)
    if not unsure:
        return []
    return [
        f"The motion hardly shows how large {listed(unsure)} are, each uncertain by as much as its value, "
        "and well what ratio they are in; a measured length, given with --fix, fixes the scale."
    ]


def refused(problem: Problem, status: str, records: tuple[Poses, ...], seconds: float) -> Fit:
    """Return a fit whose status is the reason why nothing was identified; the mechanism is not changed.

    Args:
        problem: The problem.
        status: The reason, a sentence.
        records: The records.
        seconds: Wall time [s].

    Returns:
        A fit without start states, whose ``ok`` is False.
    """
    parameters = tuple(
        Estimate(
            name=p.name,
            value=p.value,
            std=np.inf if free else 0.0,
            lower=p.lower if free else p.value,
            upper=p.upper if free else p.value,
            unit=p.unit,
            free=free,
            identifiable=False,
            at_bound=False,
        )
        for p in problem.mechanism.parameters
        for free in (p.name in problem.unknowns.names,)
    )
    residual = tuple(np.full(record.position.shape, np.nan) for record in records)
    return Fit(
        status=status, doubts=(Doubt("refused", status),), advice=(), mechanism=problem.mechanism,
        parameters=parameters, combinations=(), starts=(), tied=(), covariance=np.zeros((0, 0)),
        residual=residual,
        rms={joint.name: float("nan") for joint in problem.mechanism.joints}, scale=1.0,
        torque=problem.mechanism.torque, time=tuple(record.time for record in records), evaluations=0,
        seconds=seconds,
    )  # fmt: skip


def fit_of(
    problem: Problem,
    optimum: Optimum,
    known: Knowledge,
    records: tuple[Poses, ...],
    *,
    freedom: float,
    began: float,
    drawn: Posterior | None = None,
) -> Fit:
    """Collect what was found, all but status and advice.

    Args:
        problem: The problem.
        optimum: The optimum, one piece a record.
        known: What is known of the unknowns and the start states.
        records: The records, for the shape of the residuals.
        freedom: Degrees of freedom of the intervals.
        began: When the identification began.
        drawn: Draws of the posterior, from which intervals are taken where there are any.

    Returns:
        The fit, with an empty status.
    """
    data, mechanism, unknowns = problem.data, problem.mechanism_at(optimum.x), problem.unknowns
    difference = _differences(problem, optimum)
    tied = zip(unknowns.tied, unknowns.tied_to, strict=True)
    covariance = _natural(problem, optimum, known)
    return Fit(
        status="",
        doubts=(),
        advice=(),
        mechanism=mechanism,
        parameters=estimates(problem, optimum, known, half_width(freedom), drawn),
        combinations=combinations(problem, optimum.x, known, half_width(freedom), drawn),
        starts=_starts(problem, optimum, covariance),
        tied=tuple((name, unknowns.names[i]) for name, i in tied),
        covariance=covariance,
        residual=_by_record(data, difference, records),
        rms=rms_of(problem, optimum),
        scale=problem.size(optimum.x),
        torque=mechanism.torque,
        time=tuple(record.time for record in records),
        evaluations=optimum.evaluations,
        seconds=time.perf_counter() - began,
        torques=tuple(torque.log for torque in data.torques),
    )


def rms_of(problem: Problem, optimum: Optimum) -> dict[str, float]:
    """Return the root mean square of the residual by joint [rad or m].

    Args:
        problem: The problem.
        optimum: The optimum, one piece a record.
    """
    rms = np.sqrt(np.nanmean(_differences(problem, optimum) ** 2, axis=0)).tolist()
    return dict(zip((joint.name for joint in problem.mechanism.joints), rms, strict=True))


def _differences(problem: Problem, optimum: Optimum) -> np.ndarray:
    """Return the residuals, those of slides in metres of the identified scale as the user reads them."""
    unit = np.where(problem.data.slide, problem.size(optimum.x), 1.0)
    return problem.differences(optimum.trial) * problem.data.by_row(unit)


def _natural(problem: Problem, optimum: Optimum, known: Knowledge) -> np.ndarray:
    """Bring the covariance from coordinates to the parameters themselves, (unknown, unknown)."""
    # start states are their own coordinates
    count = len(problem.unknowns)
    slope = np.eye(len(known.full))
    slope[:count, :count] = problem.unknowns.slope(optimum.x)
    return slope @ known.full @ slope.T


def _starts(problem: Problem, optimum: Optimum, covariance: np.ndarray) -> tuple[Start, ...]:
    """Start state of each record; its covariance is a view of the whole."""
    count, width = len(problem.unknowns), optimum.trial.states.shape[1]
    found = []
    for k, state in enumerate(optimum.trial.states):
        block = slice(count + k * width, count + (k + 1) * width)
        when = float(problem.data.times[problem.data.first[k]])
        q0, v0 = np.split(state, 2)
        found.append(Start(when, q0, v0, covariance[block, block]))
    return tuple(found)


def _by_record(data: Data, difference: np.ndarray, records: tuple[Poses, ...]) -> tuple[np.ndarray, ...]:
    """Cut the residuals back into the tables of the records."""
    found = []
    for k, record in enumerate(records):
        table = np.full((len(record), difference.shape[1]), np.nan)
        rows = slice(data.first[k], data.first[k + 1])
        # rows that were put into gaps have no source, and belong to no table
        source = data.source[rows]
        table[source[source >= 0]] = difference[rows][source >= 0]
        found.append(table)
    return tuple(found)


def _advice(found: Refined, fit: Fit, records: tuple[Poses, ...], settings: IdentifySettings) -> list[str]:
    """What the reader should know of the fit, the gravest first."""
    problem, optimum, mechanism = found.problem, found.optimum, found.problem.mechanism
    unknowns, gone = problem.unknowns, found.rejected
    left_out = [int(records[0].frame[row]) for row in problem.data.source[gone]] if len(records) == 1 else []
    # hardly any record states its noise well: what is small against the motion is no fault of the model; and
    # what is as large as the motion itself is none that masses or a tilt could explain
    share = relative_difference(problem, optimum.trial)
    large = CLEAR_SHARE < share <= trust.LOST_SHARE
    # where they were open, free ones were tried
    uniform = unknowns.uniform and (settings.torque != "auto" or settings.bodies == "uniform")
    lacking = advice.Assumed(
        uniform=uniform and large,
        frictionless=advice.zero_frictions(mechanism, unknowns) if large or not fit.ok else (),
        # the zero of an encoder may be a quarter turn away, which no picture's is
        level=(share <= trust.LOST_SHARE or mechanism.measured is None) and _taken_level(problem),
    )
    sentences = advice.without_weight(mechanism)
    sentences += advice.misfit(mechanism, fit.rms, found.noise, lacking)
    sentences += advice.stamps(found.noise.stamps)
    sentences += advice.limits(mechanism, problem.simulated(optimum.trial))
    sentences += advice.contradictions(problem.prior.negative)
    sentences += advice.turning_ahead(problem.mechanism_at(optimum.x), unknowns)
    if ROLL in unknowns.names:
        sentences += advice.one_roll(int(problem.data.by_roll.any(axis=1).sum()))
    if fit.ok:
        without_effect = found.known.without_effect(unknowns.names)
        sentences += advice.tilt(fit.parameters)
        ratios = size_ratios(mechanism, unknowns)
        near = [ratio.size.name for ratio in ratios]
        sentences += undetermined.open_parameters(
            mechanism, fit.parameters, without_effect, near, _known_in_ratio(fit)
        )
        sentences += undetermined.nothing_seen(fit.parameters)
        sentences += like_weight(found)
        sentences += assumed.proportions(_hardly_known(ratios, found.known.covariance))
        sentences += assumed.thicknesses(
            _hardly_known(thickness_ratios(mechanism, unknowns), found.known.covariance)
        )
    sentences += undetermined.without_use(_without_use(mechanism))
    if mechanism.torque == "free":
        sentences += advice.free_torques(mechanism)
    sentences += advice.clock(mechanism, fit.parameters)
    total = int(problem.data.measured.any(axis=1).sum()) + int(gone.sum())
    sentences += advice.outliers(total, int(gone.sum()), left_out)
    return sentences + advice.few(problem.data.samples, found.fitted)


def _known_in_ratio(fit: Fit) -> list[str]:
    """Name what is determined by its ratio to an inertia, or a mass."""
    ratios = [one.name for one in fit.combinations if one.std < RATIO_KNOWN * abs(one.value)]
    return [name.partition(" / ")[0] for name in ratios if name.endswith((".J", ".M"))]


def _taken_level(problem: Problem) -> bool:
    """Return whether gravity was taken to act where the angles have it, and nobody said so."""
    chosen = ROLL in problem.unknowns.names or ROLL in problem.mechanism.chosen
    return not chosen and bool(problem.data.by_roll.any()) and feels_roll(problem.mechanism)


def _hardly_known(ratios: list[Proportion], covariance: np.ndarray) -> list[Parameter]:
    """Return what is hardly known better than it was assumed to be."""
    return [ratio.size for ratio in ratios if ratio.hardly_known(covariance)]


def _without_use(mechanism: Mechanism) -> list[str]:
    """Names of given thicknesses and densities on which no link depends."""
    kinds = ("thickness", "density")
    given = [p for p in mechanism.parameters if p.name in mechanism.chosen and p.kind in kinds and not p.free]
    return [p.name for p in given if not mechanism.directions([p.name]).links.any()]
