"""The end of the published search in, status and advice out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.estimation.fit import Fit
from monodyn.estimation.verdict import advice, undetermined
from monodyn.estimation.verdict.uncertainty import noise_factors
from monodyn.estimation.wording import amount, amounts, listed, percent
from monodyn.paper.descent import Descent
from monodyn.paper.filter import Gains
from monodyn.paper.fit_bounds import centred
from monodyn.paper.fixed_start import FixedStart
from monodyn.paper.settings import PAPER_GAINS, PaperIdentifySettings
from monodyn.paper.torque_model import TorqueModel
from monodyn.types import Poses

UNSURE_SHARE = 0.05
"""A search that did not reach its minimum must come so near, as a share of the motion."""
UNCLEAR_SHARE = 0.01
"""Residuals above this share of the motion may come from bodies or friction that the model lacks."""
SHORT_OF_MINIMUM = (
    "From the given start values the search ended short of a minimum; --identify.begin matched starts nearer."
)
"""Advice where the search was left to start values as they are."""
SHORT_RECORD = 10
"""Frames of a record that can hardly be shorter."""
FIX_PERIOD = "--fix torque.period=SECONDS"
"""How the user gives the period."""
SEVERAL_PERIODS = 2.0
"""Periods that a record must hold for their estimate to be taken for granted."""
NOT_FOLLOWED_SHARE = 0.25
"""The fit does not follow the record when the rms residual of a joint is above this share of its motion."""


def published_verdict(
    found: Descent, rms: dict[str, float], settings: PaperIdentifySettings, model: TorqueModel
) -> tuple[str, bool]:
    """Write what came of the fit, and decide whether it follows the record at all.

    Args:
        found: Where the search ended.
        rms: Root mean square of the residual by joint [rad or m].
        settings: What was compared, under which torque model.
        model: The torque model.

    Returns:
        The status, one sentence, and whether the fit can be used.
    """
    problem, share = found.fixed.problem, _shares(found, rms)
    # a search that ended early may be anywhere: it must have come nearer than one that is at its minimum
    j = int(np.argmax(share))
    name = list(rms)[j]
    frames = int(problem.data.measured.any(axis=1).sum())
    if not share[j] < (NOT_FOLLOWED_SHARE if found.converged else UNSURE_SHARE):
        what = "The simulated motion does not follow the record"
        instead = ["fit fewer frames"] if frames > SHORT_RECORD else []
        if share[j] < NOT_FOLLOWED_SHARE:
            what = "The search ended before its minimum"
            instead = ["allow more with --identify.evaluations"] if found.spent else _surer(found)
        elif settings.states == "filtered":
            instead = ["compare with --identify.states measured, which do not lag"]
        if model.series is not None and not model.known:
            known = f"give the period, {model.series.period:.4g} s in the poses, with {FIX_PERIOD}"
            instead.append(known)
        return (
            f"{what}: rms residual of {name} {amount(problem.mechanism, name, rms[name])}, "
            f"{percent(share[j])} of its motion; {', '.join([*instead, ''])}"
            f"{'or ' if instead else ''}try --identify.method fast.{_too_short(model)}",
            False,
        )
    unknowns = len(problem.unknowns)
    open_all = " (more than there are measured values: one of many solutions)"
    lacking = open_all if found.fixed.compared <= unknowns else ""
    return (
        f"Identified {unknowns} unknowns{lacking} by the published method from {frames} frames, torque model "
        f"{settings.torque}; rms residual {amounts(problem.mechanism, rms)}.{_too_short(model)}",
        True,
    )


def _too_short(model: TorqueModel) -> str:
    """Add to a status that the record does not hold one period, or nothing."""
    if model.series is None or model.known or model.series.periods >= 1.0:
        return ""
    return (
        f" The frames hold {model.series.periods:.2g} of the period of {model.series.period:.4g} s; its "
        "estimate requires multiple periods."
    )


def _shares(found: Descent, rms: dict[str, float]) -> np.ndarray:
    """Rms residuals as shares of the motion, (dof,)."""
    problem = found.fixed.problem
    unit = np.where(problem.data.slide.any(axis=0), problem.size(found.x), 1.0)
    return np.array(list(rms.values())) / np.maximum(problem.data.motion_size * unit, 1e-12)


def published_advice(
    found: Descent,
    model: TorqueModel,
    fit: Fit,
    records: tuple[Poses, ...],
    settings: PaperIdentifySettings,
    without_effect: Sequence[str],
) -> tuple[str, ...]:
    """Write all that the reader should know, the gravest first.

    Args:
        found: Where the search ended.
        model: The torque model.
        fit: What was found, all but status and advice.
        records: The records.
        settings: What was compared, under which torque model.
        without_effect: Names of unknowns on which nothing depends.

    Returns:
        Sentences.
    """
    fixed, problem, mechanism = found.fixed, found.fixed.problem, found.fixed.problem.mechanism
    kinds = {p.name: p.kind for p in mechanism.parameters}
    # torques are a means here: there is no advice on each of hundreds of them
    bodies = [p for p in fit.parameters if kinds[p.name] != "torque"]
    sentences = advice.integration(fixed.substeps, found.error, settings.error_bound)
    sentences += _under_torques(fixed) if settings.torque == "free" else _misfit(found, fit, records)
    sentences += [*_period(model), *_filtering(settings)]
    if settings.torque != "free":
        sentences += undetermined.open_parameters(mechanism, bodies, without_effect)
        sentences += advice.few(fixed.compared, len(problem.unknowns))
    edge = _at_reach(found)
    sentences += _beyond_reach(found, edge)
    inside = [p for p in bodies if p.name not in edge]
    sentences += [*undetermined.nothing_seen(inside), *advice.bounds_met(inside)]
    sentences += advice.limits(mechanism, problem.simulated(fixed.trial(found.x)))
    if settings.torque != "free":
        sentences += advice.clock(mechanism, fit.parameters)
    if settings.begin == "given" and not found.converged:
        sentences.append(SHORT_OF_MINIMUM)
    if not found.converged and not found.spent:
        sentences.append(
            "The search ended before the minimum was certain, and more evaluations would not take it "
            f"further; {' or '.join(_surer(found))}."
        )
    ended = advice.search_end(found.converged or not found.spent)
    return (*sentences, *ended, *advice.starts_tried(found.tried))


def _surer(found: Descent) -> list[str]:
    """What leaves the search fewer directions in which hardly anything changes."""
    if found.fixed.problem.mechanism.torque == "free":
        return ["fit fewer frames"]
    series = found.fixed.problem.mechanism.torque == "fourier"
    fewer = "take fewer harmonics with --identify.terms" if series else "fix parameters"
    return [fewer, "give more frames"]


def _under_torques(fixed: FixedStart) -> list[str]:
    """Report what free torques leave open."""
    unknowns = fixed.problem.unknowns
    sentences = [
        f"{len(unknowns)} unknowns and {fixed.compared} measured values: free torques are underdetermined "
        "and follow the noise of the poses; there are no intervals."
    ]
    pairs = zip(unknowns.names, unknowns.kinds, strict=True)
    sizes = [name for name, kind in pairs if kind != "torque"]
    if sizes:
        sentences.append(
            f"With free torques any sizes and masses are possible: {listed(sizes, 8)} are arbitrary; give "
            "measured values with --fix."
        )
    return sentences


def _misfit(found: Descent, fit: Fit, records: tuple[Poses, ...]) -> list[str]:
    """Report where residuals are far above the stated noise; a given start state adds to them."""
    problem, mechanism = found.fixed.problem, fit.mechanism
    noise = noise_factors(problem.data, problem.differences(found.fixed.trial(found.x)), len(found.x))
    large = bool(_shares(found, fit.rms).max() > UNCLEAR_SHARE)
    assumed = advice.Assumed(
        uniform=large and problem.unknowns.uniform,
        frictionless=advice.zero_frictions(mechanism, problem.unknowns) if large else (),
        level=not all(record.metric for record in records),
    )
    sentences = advice.misfit(mechanism, fit.rms, noise, assumed)
    if sentences:
        sentences.append(
            "The published method holds the start state at the filtered one, whose error adds to the "
            "residual; --identify.method fast estimates it."
        )
    return sentences


def _at_reach(found: Descent) -> dict[str, int]:
    """Sizes that ended where the search itself is bounded, and not at a bound of the user, by place."""
    unknowns, x, (low, high) = found.fixed.problem.unknowns, found.x, found.bounds
    near = 1e-6 * found.fixed.scale
    at_low = (x <= low + near) & (low > unknowns.lower + near)
    at_high = (x >= high - near) & (high < unknowns.upper - near)
    sized = unknowns.log & (unknowns.of_kind("length") | unknowns.of_kind("thickness"))
    return {unknowns.names[p]: int(p) for p in np.flatnonzero((at_low | at_high) & sized)}


def _beyond_reach(found: Descent, edge: dict[str, int]) -> list[str]:
    """Report the sizes of ``_at_reach``, each with its bound."""
    if not edge:
        return []
    reach = centred(found.fixed, found.x)[1]
    ends = []
    for name, p in edge.items():
        above = found.x[p] > 0.5 * found.bounds[:, p].sum()
        factor = f"{np.exp(reach[p]):.3g} times" if above else f"1/{np.exp(reach[p]):.3g} of"
        ends.append(f"{name} at {np.exp(found.x[p]):.3g} m, {factor} its start value")
    return [
        f"The search ended at its own bounds: {'; '.join(ends)}; the truth may lie beyond: give nearer "
        "values in the mechanism file."
    ]


def _period(model: TorqueModel) -> list[str]:
    """Report where the period comes from, and whether the record shows it more than once."""
    series = model.series
    if series is None or model.known:
        return []
    sentences = [f"The period of {series.period:.4g} s is that of the poses, held in the fit."]
    if model.bounded:
        sentences = [
            f"The period of {series.period:.4g} s, held in the fit, is a bound of torque.period: that of the "
            "poses may lie beyond; widen it with --bounds."
        ]
    if 1.0 <= series.periods < SEVERAL_PERIODS:
        sentences.append(
            f"The frames hold {series.periods:.2g} periods, and its estimate requires multiple ones; give "
            f"more frames, or the period with {FIX_PERIOD}."
        )
    return sentences


def _filtering(settings: PaperIdentifySettings) -> list[str]:
    """Report what the gains do, where they are not the usual ones or ring."""
    used = settings.rates or settings.states == "filtered"
    idle = ["The gains"] if tuple(settings.gains) != PAPER_GAINS else []
    idle += [f"--identify.filter {settings.filter}"] if settings.filter != "printed" else []
    if not used and idle:
        verb = "have" if "The gains" in idle else "has"
        return [
            f"{' and '.join(idle)} {verb} no effect on this fit: measured angles are compared, and the start "
            "state is the parabola through the first three samples."
        ]
    # the paper's own gains lie on the edge, where errors neither grow nor die out
    gains = Gains.of(settings.gains, settings.filter)
    if used and not gains.stable:
        own = ", the paper's own," if tuple(settings.gains) == PAPER_GAINS else ""
        return [
            f"With these gains{own} the filtered states ring and errors do not die out; take a gamma below "
            f"{gains.ringing:.3g} with --identify.gains, or the other reading of eq. (6) with "
            "--identify.filter consistent."
        ]
    return []
