"""The identification of the 2012 paper as published: eq. (14) with its three torque models and its solver.

Unlike the default method it takes the start state from the filtered poses, compares angles without weights,
lets no picture vouch for sizes, and searches with BFGS and an active set.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.estimation.fit import Fit
from monodyn.estimation.record.samples import Data, ordered, prepare
from monodyn.estimation.record.smooth import Smoothed, smooth
from monodyn.estimation.settings import USUAL_TERMS
from monodyn.estimation.shooting.problem import Problem, posed, smooth_motion
from monodyn.estimation.shooting.shoot import Grown, typical
from monodyn.estimation.shooting.unknowns import kind_of
from monodyn.estimation.torque.evidence import stands_out
from monodyn.estimation.torque.periods import SCANNED_TERMS, Undriven
from monodyn.estimation.torque.task import NO_PERIOD, Task, by_series, frictionless
from monodyn.estimation.verdict import advice as say
from monodyn.estimation.verdict.conclude import collected, refuse
from monodyn.estimation.verdict.trust import motion_sizes
from monodyn.estimation.verdict.uncertainty import know, noise_factors
from monodyn.mechanism import Mechanism
from monodyn.paper.descent import Descent, descend
from monodyn.paper.filter import Gains, filter_response, filtered
from monodyn.paper.fixed_start import Held, held_states, targets, with_start_noise
from monodyn.paper.settings import PAPER_GAINS, PaperIdentifySettings
from monodyn.types import Poses, Progress

UNSTARTED = (
    "The motion of the start cannot be simulated through the record; check the mechanism file and that its "
    "joints turn as in the record."
)
UNSURE = 0.05
"""A search that did not reach its minimum must come so near, as a share of the motion."""
UNCLEAR = 0.01
"""Residuals above this share of the motion may come from bodies or friction that the model lacks."""
FEWEST = 5
"""Measured samples that each joint needs in each record."""
MOST_TORQUES = 400
"""Free torques that a search over rollouts can find in half a minute."""
SHORT = 10
"""Frames of a record that can hardly be shorter."""
LOST = 0.25
"""The fit does not follow the record when the rms residual of a joint is above this share of its motion."""


def identify_published(
    records: Sequence[Poses],
    mechanism: Mechanism,
    settings: PaperIdentifySettings,
    progress: Progress | None = None,
) -> Fit:
    """Minimize |X_s - X_e| over the unknowns of the paper's Case I, II or III, within bounds.

    Unknowns are the free lengths and thicknesses, whose bodies keep their aspect ratio, and with
    ``settings.torque``

    * ``friction`` (Case I): the dampings, b in tau = -b v; 6 for two links;
    * ``fourier`` (Case II): the coefficients of a series of ``settings.terms`` harmonics (7 when 0) a joint,
      the period estimated beforehand and held; with ``with-friction`` the dampings as well: 4 + 2 + 30 = 36
      for two links, the paper's count, which its own 4 + 2 s_1 + 2 s_2 + 2 = 34 is not;
    * ``free`` (Case III): a torque a joint and time stamp, linear in between, from zero; 2 k + 4 for two
      links.

    The start state of each record is the filtered one, eq. (6), at its first sample: the parabola through
    the first three samples, before any correction, so that the gains count only with filtered states or
    rates. Bounds: a factor of ten about the sizes of file or picture, lengths in the common scale of the
    start (a factor of three beside free torques) and within the user's bounds; dampings up to where friction
    alone balances the weight; torques up to ten times that of weight and inertia, three times for free ones.
    The start has its common scale from the accelerations of smoothed motion, where the paper starts by hand;
    free torques start as those that lead the motion along the smoothed poses, and are fitted to the first
    samples before more. No sample is left out as a gross error, which the paper does not do either.

    Intervals are those of the least squares with the noise of the samples, which reaches the parameters
    directly and by way of the start state; free torques, underdetermined, have none.

    Args:
        records: Records of joint positions, at least one.
        mechanism: Topology, start values, what is free and fixed.
        settings: The torque model, gains, what is compared, how many starts.
        progress: Called as ``progress("identify", rollouts, None)`` every few hundred rollouts.

    Returns:
        The identified mechanism; ``ok`` is False, with the reason as its status, where it does not follow the
        record or nothing could be identified. ``evaluations`` counts rollouts.

    Raises:
        VideoError: A record cannot be used.
        MechanismError: The joints of a record are not those of the mechanism.
        SettingsError: The gains are outside of eq. (7).

    Source:
        Eq. (9), (13) and (14) of "Estimating dynamics on-the-fly using monocular video", 2012.
    """
    began = time.perf_counter()
    records = tuple(records)
    gains = Gains.of(settings.gains)
    mechanism = replace(mechanism.with_bodies(settings.bodies), measured=None)
    data = prepare(records, mechanism)
    records = tuple(ordered(record, mechanism) for record in records)
    smoothed = tuple(smooth(record) for record in records)
    model = _with_model(mechanism, settings, data, smoothed)
    problem = model.problem
    if model.reason is not None:
        return _refused(problem, model.reason, records, settings, began)
    motion = tuple(filtered(r.time, _seen(r), gains, r.covariance) for r in records)
    target, white = targets(data, motion, settings.states, settings.rates)
    blank = Held(
        problem.mechanism, problem.unknowns, problem.prior, data, held=held_states(data, motion),
        target=target, white=white, change=np.ones(len(problem.unknowns)), substeps=1,
        response=tuple(
            filter_response(r.time, np.isfinite(_seen(r)), gains)
            for r in records if settings.rates or settings.states == "filtered"
        ),
        filtered=settings.states == "filtered",
    )  # fmt: skip
    found = descend(blank, smoothed, model.start, settings, progress)
    if found is None:
        return _refused(problem, UNSTARTED, records, settings, began)
    if settings.torque == "fourier" and not stands_out(found.held, found.x, smooth_motion(problem, smoothed)):
        if model.period is not None:
            return _refused(problem, NO_PERIOD, records, settings, began)
        model = replace(model, doubt=tuple(say.no_harmonic(found.held.mechanism_at(found.x))))
    return _fit(found, model, records, settings, began)


@dataclass(frozen=True, eq=False)
class _Model:
    """The problem with its torque model.

    Attributes:
        problem: With the parameters of the torque.
        reason: Why there is no point in a search, or None.
        start: Coordinates at which a torque of the period explains the accelerations, (param,), or None.
        period: The period [s] that was estimated, or None.
        doubt: Advice on a torque that does not stand out.
    """

    problem: Problem
    reason: str | None = None
    start: np.ndarray | None = None
    period: float | None = None
    doubt: tuple[str, ...] = ()


def _with_model(
    mechanism: Mechanism, settings: PaperIdentifySettings, data: Data, smoothed: tuple[Smoothed, ...]
) -> _Model:
    """Give the mechanism the parameters of its torque."""
    plain = mechanism.with_torque("friction")
    if settings.torque != "friction" and len(smoothed) > 1:
        return _Model(posed(plain, data), "A torque over time belongs to one record; fit them one by one.")
    if settings.torque == "friction":
        driven = plain
    elif settings.torque == "free":
        knots = data.times * mechanism.values["time_scale"]
        driven = frictionless(mechanism).with_torque("free", knots=knots)
    else:
        mechanism = frictionless(mechanism) if settings.series == "alone" else mechanism
        driven = _of_period(mechanism, settings.terms or USUAL_TERMS)
    problem = posed(driven, data)
    reason = _hopeless(problem, settings)
    if reason is not None or settings.torque != "fourier":
        return _Model(problem, reason)
    return _periodic(mechanism, settings, problem, smoothed)


def _periodic(
    mechanism: Mechanism, settings: PaperIdentifySettings, problem: Problem, smoothed: tuple[Smoothed, ...]
) -> _Model:
    """Estimate the period, with no more harmonics than it takes: one of many harmonics is a long one."""
    undriven = Undriven.of(mechanism, problem.data, smoothed)
    guesses = undriven.guesses(settings.terms if settings.terms in SCANNED_TERMS else 0)
    known = undriven.bounds[0] == undriven.bounds[1]
    if not guesses:
        return _Model(problem, None if known else NO_PERIOD)
    # a series makes up for what the model lacks; whether a torque acts at all the default search tells
    if not known and by_series(mechanism, Task(problem.data, smoothed, settings, None)).grown is None:
        return _Model(problem, NO_PERIOD)
    period = guesses[0].period
    if not known:
        problem = posed(_of_period(mechanism, settings.terms or USUAL_TERMS, period), problem.data)
    return _Model(problem, None, undriven.start(guesses[0], problem), None if known else period)


def _of_period(mechanism: Mechanism, terms: int, period: float | None = None) -> Mechanism:
    """Hold the period of a Fourier series: at ``period`` [s], or where it is until that is known."""
    driven = mechanism.with_torque("fourier", terms=terms, period=1.0)
    return driven.with_choices(fix={"torque.period": period or driven.values["torque.period"]})


def _refused(
    problem: Problem, reason: str, records: tuple[Poses, ...], settings: PaperIdentifySettings, began: float
) -> Fit:
    return replace(refuse(problem, reason, records, time.perf_counter() - began), torque=settings.torque)


def _seen(record: Poses) -> np.ndarray:
    """Positions with gaps as NaN, (frame, dof)."""
    return np.where(record.seen[:, None], record.position, np.nan)


def _hopeless(problem: Problem, settings: PaperIdentifySettings) -> str | None:
    """Say why there is no point in a search, or None."""
    data, unknowns = problem.data, len(problem.unknowns)
    samples = data.samples * (2 if settings.rates else 1)
    names = [joint.name for joint in problem.mechanism.joints]
    for first, stop in zip(data.first[:-1], data.first[1:], strict=True):
        for name, count in zip(names, data.measured[first:stop].sum(axis=0), strict=True):
            if count < FEWEST:
                return f"Joint {name!r} was measured {count} times, {FEWEST} are needed; give more frames."
    if settings.torque == "free" and len(data.times) * len(names) > MOST_TORQUES:
        return (
            f"{len(data.times) * len(names)} torques, one a joint and time stamp, are too many for the "
            f"published method; fit at most {MOST_TORQUES // len(names)} frames."
        )
    if settings.torque != "free" and samples <= unknowns:
        instead = "give more frames or fix parameters"
        if settings.torque == "fourier":
            instead = "give more frames, fix parameters, or take fewer harmonics with --identify.terms"
        return f"{samples} measured values cannot determine {unknowns} unknowns; {instead}."
    moved, noise = motion_sizes(data), np.nanmedian(data.std, axis=0)
    if (moved <= 4.0 * noise).all():
        return "Nothing moves in the record: no joint leaves its noise; give frames with motion."
    return None


def _fit(
    found: Descent, model: _Model, records: tuple[Poses, ...], settings: PaperIdentifySettings, began: float
) -> Fit:
    """Collect what was found; intervals from the Jacobian and the noise of the samples."""
    held, x = found.held, found.x
    compared = int(np.isfinite(held.target).sum())
    freedom = max(compared - len(x), 1)
    residuals = held.residuals_at(x)
    noise = float(np.sqrt(np.sum(residuals**2) / freedom))
    held = replace(held, noise=max(noise, 1e-12))
    grown = _grown(found, held, residuals)
    known = know(held, replace(grown, states=np.zeros((len(records), 0))))
    known = with_start_noise(held, x, known)
    if compared <= len(x):
        known = replace(known, open=np.eye(len(x)), std=np.full(len(x), np.inf))
    fit = collected(held, grown, known, records, freedom, began)
    if compared <= len(x):
        fit = replace(fit, combinations=())
    status, ok = _verdict(found, fit.rms, settings, model.period)
    open_names = known.without_effect(held.unknowns.names)
    advice = _advice(found, model, fit, records, settings, open_names)
    return replace(fit, status=status, ok=ok, advice=advice)


def _grown(found: Descent, held: Held, residuals: np.ndarray) -> Grown:
    """The optimum in the form that covariance and estimates take."""
    low, high = found.bounds
    near = 1e-6 * held.change
    scaled = residuals / held.noise
    sigma = typical(scaled, np.isfinite(held.target))
    return Grown(
        found.x, held.states(found.x), held.pieces, held.substeps, scaled, 0.5 * float(np.sum(scaled**2)),
        sigma, found.evaluations, found.converged, (found.x <= low + near) | (found.x >= high - near),
    )  # fmt: skip


def _verdict(
    found: Descent, rms: dict[str, float], settings: PaperIdentifySettings, period: float | None
) -> tuple[str, bool]:
    """Say what came of the fit, and whether it follows the record at all."""
    held = found.held
    share = _shares(found, rms)
    j = int(np.argmax(share))
    name = list(rms)[j]
    frames = int(held.data.measured.any(axis=1).sum())
    if not share[j] < (LOST if found.converged else UNSURE):
        what = "The simulated motion does not follow the record"
        instead = ["fit fewer frames"] if frames > SHORT else []
        if share[j] < LOST:
            what = "The search ended before its minimum"
            instead = ["allow more with --identify.evaluations"]
        elif settings.states == "filtered":
            instead = ["compare with --identify.states measured, which do not lag"]
        if period is not None:
            known = f"give the period, estimated as {period:.4g} s, with --fix torque.period=SECONDS"
            instead.append(known)
        return (
            f"{what}: rms residual of {name} {say.amount(held.mechanism, name, rms[name])}, "
            f"{say.percent(share[j])} of its motion; {', '.join([*instead, ''])}"
            f"{'or ' if instead else ''}try --identify.method fast.",
            False,
        )
    each = [f"{say.amount(held.mechanism, name, value)} ({name})" for name, value in rms.items()]
    unknowns = len(held.unknowns)
    open_all = " (more than there are measured values: one of many solutions)"
    lacking = open_all if np.isfinite(held.target).sum() <= unknowns else ""
    return (
        f"Identified {unknowns} unknowns{lacking} by the published method from {frames} frames, torque model "
        f"{settings.torque}; rms residual {say.listed(each, 12)}.",
        True,
    )


def _shares(found: Descent, rms: dict[str, float]) -> np.ndarray:
    """Rms residuals as shares of the motion, (dof,)."""
    held = found.held
    unit = np.where(held.data.slide.any(axis=0), held.size(found.x), 1.0)
    return np.array(list(rms.values())) / np.maximum(motion_sizes(held.data) * unit, 1e-12)


def _advice(
    found: Descent,
    model: _Model,
    fit: Fit,
    records: tuple[Poses, ...],
    settings: PaperIdentifySettings,
    without_effect: tuple[str, ...],
) -> tuple[str, ...]:
    """All that the reader should know, the gravest first."""
    held, unknowns = found.held, len(found.x)
    compared = int(np.isfinite(held.target).sum())
    bodies = tuple(p for p in fit.parameters if ".torque." not in p.name)
    advice = say.integration(held.substeps, found.error, settings.error_bound)
    if settings.torque == "free":
        advice += _beside_torques(held, unknowns, compared)
    else:
        advice += _misfit(found, fit, records)
    advice += [*model.doubt, *_filtering(settings)]
    if model.period is not None:
        advice.append(f"The period of {model.period:.4g} s was estimated beforehand and held.")
    if settings.torque != "free":
        advice += say.open_parameters(bodies, without_effect)
        advice += say.few(compared, unknowns)
    advice += say.bounds(bodies)
    advice += say.limits(
        held.mechanism, held.simulated(found.x, held.states(found.x), held.pieces, held.substeps)
    )
    if settings.torque != "free":
        advice += say.clock(fit.parameters)
    if not found.converged:
        advice.append(
            "The search ended before it was sure of the minimum; allow more with --identify.evaluations."
        )
    if found.tried > 1:
        advice.append(f"{found.tried} starts were tried; the best of them is reported.")
    return tuple(advice)


def _beside_torques(held: Held, unknowns: int, compared: int) -> list[str]:
    """Say what free torques leave open."""
    advice = [
        f"{unknowns} unknowns and {compared} measured values: free torques are underdetermined and follow "
        "the noise of the poses; there are no intervals."
    ]
    sizes = [name for name in held.unknowns.names if ".torque." not in name]
    if sizes:
        advice.append(
            f"Beside free torques any sizes and masses will do: {say.listed(sizes, 8)} are arbitrary; give "
            "measured values with --fix."
        )
    return advice


def _misfit(found: Descent, fit: Fit, records: tuple[Poses, ...]) -> list[str]:
    """Say where residuals are far above the stated noise; a held start state adds to them."""
    held, mechanism = found.held, fit.mechanism
    difference = held.differences(found.x, held.states(found.x), held.pieces, held.substeps)
    size, spread = noise_factors(held.data, difference, len(found.x))
    large = bool(_shares(found, fit.rms).max() > UNCLEAR)
    dry = [f"{joint.name}.friction" for joint in mechanism.joints]
    dry = [name for name in dry if mechanism.values[name] == 0 and name not in held.unknowns.names]
    advice = say.misfit(
        mechanism, fit.rms, size, spread, uniform=large and not _free_bodies(held),
        frictionless=dry if large else (), pictured=not all(record.metric for record in records),
    )  # fmt: skip
    if advice:
        advice.append(
            "The published method holds the start state at the filtered one, whose error adds to the "
            "residual; --identify.method fast estimates it."
        )
    return advice


def _free_bodies(held: Held) -> bool:
    return any(kind_of(name) == "inertia" for name in held.unknowns.names)


def _filtering(settings: PaperIdentifySettings) -> list[str]:
    """Say what the gains do, where they are not the usual ones or ring."""
    used = settings.rates or settings.states == "filtered"
    if not used and tuple(settings.gains) != PAPER_GAINS:
        return [
            "The gains have no effect on this fit: measured angles are compared, and the start state is the "
            "parabola through the first three samples."
        ]
    gains = Gains.of(settings.gains)
    if used and not gains.stable:
        most = 2.0 * gains.alpha * gains.beta / (2.0 - gains.alpha)
        return [
            f"With these gains the filtered states ring and errors do not die out; take a gamma below "
            f"{most:.3g} with --identify.gains."
        ]
    return []
