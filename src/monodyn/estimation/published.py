"""The identification of the 2012 paper as published: eq. (14) with its three torque models and its solver.

Unlike the default method it takes the start state from the filtered poses, compares angles without weights,
lets no picture vouch for sizes, and searches with BFGS and an active set.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.estimation import advice as say
from monodyn.estimation.combinations import combinations
from monodyn.estimation.conclude import refuse
from monodyn.estimation.data import Data, prepare
from monodyn.estimation.descent import Descent, descend
from monodyn.estimation.estimates import estimates
from monodyn.estimation.filtering import FIRST, Gains, filter_response, filtered
from monodyn.estimation.fit import Estimate, Fit, Start
from monodyn.estimation.grow import Grown, typical
from monodyn.estimation.held import Held, held_states, targets
from monodyn.estimation.period import Period, estimate_period, periodic_scale
from monodyn.estimation.problem import Problem
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.uncertainty import know
from monodyn.estimation.unknowns import choose_unknowns, size_prior
from monodyn.estimation.verdict import motion_sizes
from monodyn.mechanism import Mechanism
from monodyn.types import Poses, Progress

TERMS = 7
"""Harmonics of the paper's Fourier series."""
UNSTARTED = (
    "The motion of the start cannot be simulated through the record; check the mechanism file and that its "
    "joints turn as in the record."
)
LOST = 0.25
"""The fit does not follow the record when the rms residual of a joint is above this share of its motion."""


def identify_published(
    records: Sequence[Poses],
    mechanism: Mechanism,
    settings: IdentifySettings,
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

    The start state of each record is the filtered one, eq. (6), at its first sample. Bounds: a factor of
    ten about the start for positive parameters (within the user's), dampings up to where friction alone
    balances the weight, torques up to ten times that of weight and inertia. The start has its common scale
    from the accelerations of smoothed motion, where the paper starts by hand.

    Args:
        records: Records of joint positions, at least one.
        mechanism: Topology, start values, what is free and fixed.
        settings: The torque model, gains, what is compared, how many starts.
        progress: Called as ``progress("identify", done, None)`` after each start.

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
    records = tuple(_ordered(record, mechanism) for record in records)
    posed = _with_model(mechanism, settings, data, records)
    problem = _problem(posed.mechanism, data)
    reason = posed.reason or _hopeless(problem, settings)
    if reason is not None:
        refused = refuse(problem, reason, records, time.perf_counter() - began)
        return replace(refused, torque=settings.torque)
    motion = tuple(filtered(r.time, _seen(r), gains, r.covariance) for r in records)
    target, white = targets(data, motion, settings.states, settings.rates)
    blank = Held(
        problem.mechanism, problem.unknowns, problem.prior, data, held=held_states(data, motion),
        target=target, white=white, change=np.ones(len(problem.unknowns)), substeps=1,
        response=tuple(
            filter_response(r.time, np.isfinite(_seen(r)), gains) for r in records if settings.rates
        ),
        filtered=settings.states == "filtered",
    )  # fmt: skip
    found = descend(blank, records, posed.scale, settings, progress)
    if found is None:
        refused = refuse(problem, UNSTARTED, records, time.perf_counter() - began)
        return replace(refused, torque=settings.torque)
    return _fit(found, posed, records, settings, began)


@dataclass(frozen=True, eq=False)
class _Posed:
    """The mechanism with its torque model.

    Attributes:
        mechanism: With the parameters of the torque.
        period: What the poses say of the period, or None.
        reason: Why there is no model, or None.
        scale: Common scale of sizes at which the torque is periodic, NaN where that is not known.
    """

    mechanism: Mechanism
    period: Period | None = None
    reason: str | None = None
    scale: float = float("nan")


def _ordered(record: Poses, mechanism: Mechanism) -> Poses:
    """Bring the joints of a record into the mechanism's order."""
    names = tuple(joint.name for joint in mechanism.joints)
    order = [record.joints.index(name) for name in names]
    covariance = record.covariance[:, order][:, :, order]
    position = record.position[:, order]
    return Poses(names, record.frame, record.time, position, covariance, record.seen, record.metric)


def _problem(mechanism: Mechanism, data: Data) -> Problem:
    unknowns = choose_unknowns(mechanism)
    return Problem(mechanism, unknowns, size_prior(mechanism, unknowns), data)


def _with_model(
    mechanism: Mechanism, settings: IdentifySettings, data: Data, records: Sequence[Poses]
) -> _Posed:
    """Give the mechanism the parameters of its torque."""
    if settings.torque == "friction":
        return _Posed(mechanism.with_torque("friction"))
    if len(records) > 1:
        return _Posed(mechanism, reason="A torque over time belongs to one record; fit them one by one.")
    clock = mechanism.values["time_scale"]
    if settings.torque == "free":
        return _Posed(_frictionless(mechanism.with_torque("free", knots=data.times * clock)))
    terms = settings.terms or TERMS
    if settings.series == "alone":
        mechanism = _frictionless(mechanism)
    plain, seen = mechanism.with_torque("friction"), (records[0].time * clock, _seen(records[0]))
    if "torque.period" in mechanism.chosen:
        given = mechanism.values["torque.period"]
        driven = mechanism.with_torque("fourier", terms=terms, period=given)
        return _Posed(driven, scale=periodic_scale(*seen, given, terms, plain))
    period = estimate_period(*seen, terms, mechanism=plain)
    if not period.found:
        return _Posed(mechanism, period, f"The period of the torque cannot be estimated. {period.status}")
    driven = mechanism.with_torque("fourier", terms=terms, period=period.seconds)
    driven = driven.with_choices(fix={"torque.period": period.seconds})
    return _Posed(driven, period, scale=period.scale)


def _frictionless(mechanism: Mechanism) -> Mechanism:
    """Hold dampings and dry frictions at zero, but for those that the user chose."""
    names = [f"{j.name}.{kind}" for j in mechanism.joints for kind in ("damping", "friction")]
    return mechanism.with_choices(fix={name: 0.0 for name in names if name not in mechanism.chosen})


def _seen(record: Poses) -> np.ndarray:
    """Positions with gaps as NaN, (frame, dof)."""
    return np.where(record.seen[:, None], record.position, np.nan)


def _hopeless(problem: Problem, settings: IdentifySettings) -> str | None:
    """Say why there is no point in a search, or None."""
    data, unknowns = problem.data, len(problem.unknowns)
    samples = data.samples * (2 if settings.rates else 1)
    names = [joint.name for joint in problem.mechanism.joints]
    for first, stop in zip(data.first[:-1], data.first[1:], strict=True):
        for name, count in zip(names, data.measured[first:stop].sum(axis=0), strict=True):
            if count < FIRST:
                return f"Joint {name!r} was measured {count} times, {FIRST} are needed; give more frames."
    if settings.torque != "free" and samples <= unknowns:
        return (
            f"{samples} measured values cannot determine {unknowns} unknowns; give more frames, fix "
            "parameters, or take fewer harmonics with --identify.terms."
        )
    moved, noise = motion_sizes(data), np.nanmedian(data.std, axis=0)
    if (moved <= 4.0 * noise).all():
        return "Nothing moves in the record: no joint leaves its noise; give frames with motion."
    return None


def _fit(
    found: Descent, posed: _Posed, records: tuple[Poses, ...], settings: IdentifySettings, began: float
) -> Fit:
    """Collect what was found; intervals from the Jacobian and the variance of the residuals."""
    from scipy.special import stdtrit

    held, x = found.held, found.x
    compared = int(np.isfinite(held.target).sum())
    freedom = max(compared - len(x), 1)
    residuals = held.residuals_at(x)
    noise = float(np.sqrt(np.sum(residuals**2) / freedom))
    held = replace(held, noise=max(noise, 1e-12))
    grown = _grown(found, held, residuals)
    known = know(held, replace(grown, states=np.zeros((len(records), 0))))
    difference = held.differences(x, grown.states, grown.pieces, grown.substeps)
    unit = np.where(held.data.slide, held.size(x), 1.0)
    difference = difference * np.repeat(unit, np.diff(held.data.first), axis=0)
    rms = dict(zip(_names(held.mechanism), np.sqrt(np.nanmean(difference**2, axis=0)).tolist(), strict=True))
    parameters = estimates(held, grown, known, float(stdtrit(freedom, 0.975)))
    status, ok = _verdict(held, x, rms, settings)
    open_names = known.without_effect(held.unknowns.names)
    free = settings.torque == "free"
    return Fit(
        status=status,
        ok=ok,
        advice=_advice(found, posed, parameters, settings, compared, open_names),
        mechanism=held.mechanism_at(x),
        parameters=parameters,
        combinations=() if free else combinations(held, x, known),
        starts=_starts(held, x),
        names=(*held.unknowns.names, *_state_names(held)),
        tied=tuple(
            (name, held.unknowns.names[i])
            for name, i in zip(held.unknowns.tied, held.unknowns.tied_to, strict=True)
        ),
        covariance=_covariance(held, x, known.full, grown.states.size),
        residual=_by_record(held.data, difference, records),
        rms=rms,
        scale=held.size(x),
        torque=settings.torque,
        time=tuple(record.time for record in records),
        evaluations=found.evaluations,
        seconds=time.perf_counter() - began,
    )


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


def _names(mechanism: Mechanism) -> list[str]:
    return [joint.name for joint in mechanism.joints]


def _state_names(held: Held) -> list[str]:
    """Names of each record's start state, which is not searched."""
    names = _names(held.mechanism)
    states = [*names, *(f"{name}_vel" for name in names)]
    return [f"record{k}.{name}" for k in range(len(held.held)) for name in states]


def _starts(held: Held, x: np.ndarray) -> tuple[Start, ...]:
    """The held start states, without a covariance of their own."""
    found = []
    for first, state in zip(held.data.first[:-1], held.states(x), strict=True):
        q0, v0 = np.split(state, 2)
        found.append(Start(float(held.data.times[first]), q0, v0, np.zeros((len(state), len(state)))))
    return tuple(found)


def _covariance(held: Held, x: np.ndarray, coordinates: np.ndarray, states: int) -> np.ndarray:
    """Covariance of the parameters, then of the start states, which are held."""
    count = len(x)
    full = np.zeros((count + states, count + states))
    full[:count, :count] = coordinates * np.outer(held.unknowns.slope(x), held.unknowns.slope(x))
    return full


def _by_record(data: Data, difference: np.ndarray, records: tuple[Poses, ...]) -> tuple[np.ndarray, ...]:
    """Cut the residuals back into the tables of the records."""
    found = [np.full(record.position.shape, np.nan) for record in records]
    for table, first, stop in zip(found, data.first[:-1], data.first[1:], strict=True):
        rows = first + np.flatnonzero(data.source[first:stop] >= 0)
        table[data.source[rows]] = difference[rows]
    return tuple(found)


def _verdict(
    held: Held, x: np.ndarray, rms: dict[str, float], settings: IdentifySettings
) -> tuple[str, bool]:
    """Say what came of the fit, and whether it follows the record at all."""
    unit = np.where(held.data.slide.any(axis=0), held.size(x), 1.0)
    share = np.array(list(rms.values())) / np.maximum(motion_sizes(held.data) * unit, 1e-12)
    j = int(np.argmax(share))
    name = list(rms)[j]
    if not share[j] < LOST:
        lag = settings.states == "filtered"
        instead = "compare with --identify.states measured, which do not lag" if lag else "fit fewer frames"
        return (
            f"The simulated motion does not follow the record: rms residual of {name} "
            f"{say.amount(held.mechanism, name, rms[name])}, {100 * share[j]:.2g} % of its motion; "
            f"{instead}, or try --identify.method fast.",
            False,
        )
    frames = int(held.data.measured.any(axis=1).sum())
    each = [f"{say.amount(held.mechanism, name, value)} ({name})" for name, value in rms.items()]
    unknowns = len(held.unknowns)
    return (
        f"Identified {unknowns} unknowns by the published method from {frames} frames, torque model "
        f"{settings.torque}; rms residual {say.listed(each, 12)}.",
        True,
    )


def _advice(
    found: Descent,
    posed: _Posed,
    parameters: tuple[Estimate, ...],
    settings: IdentifySettings,
    compared: int,
    without_effect: tuple[str, ...],
) -> tuple[str, ...]:
    """All that the reader should know, the gravest first."""
    held, unknowns = found.held, len(found.x)
    bodies = tuple(p for p in parameters if ".torque." not in p.name)
    advice = say.integration(held.substeps, found.error, settings.error_bound)
    if posed.period is not None:
        advice.append(posed.period.status)
    if settings.torque == "free":
        advice.append(
            f"{unknowns} unknowns and {compared} measured values: free torques are underdetermined and "
            "follow the noise of the poses; they and the sizes beside them are one of many solutions."
        )
    else:
        advice += say.open_parameters(bodies, without_effect)
        advice += say.few(compared, unknowns)
    advice += say.bounds(bodies)
    advice += say.limits(
        held.mechanism, held.simulated(found.x, held.states(found.x), held.pieces, held.substeps)
    )
    advice += say.clock(parameters)
    if not found.converged:
        advice.append(
            "The search ended before it was sure of the minimum; allow more with --identify.evaluations."
        )
    if found.tried > 1:
        advice.append(f"{found.tried} starts were tried; the best of them is reported.")
    return tuple(advice)
