"""A mechanism under one of the paper's torque models, Case I, II or III, with the period found beforehand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.estimation.record.samples import Data
from monodyn.estimation.settings import USUAL_TERMS
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.search import NOTHING_MOVES
from monodyn.estimation.torque.task import frictionless
from monodyn.mechanism import Mechanism
from monodyn.paper.pose_series import PoseSeries, pose_series, shown_periods
from monodyn.paper.settings import PaperIdentifySettings

FEWEST_MEASURED = 5
"""Measured samples that each joint needs in each record."""
AT_BOUND = 1e-3
"""A period this near to one of its bounds, as a share, is that of the bound."""
MOST_PUBLISHED_TORQUES = 400
"""Free torques that a search over rollouts can find in half a minute."""


@dataclass(frozen=True, eq=False)
class TorqueModel:
    """The problem with its torque model.

    Attributes:
        problem: With the parameters of the torque.
        reason: Why there is no point in a search, or None.
        series: The Fourier series of the poses, from which that of the torque starts, or None.
        known: True where the user gave the period.
        bounded: True where the period lies at one of its bounds.
    """

    problem: Problem
    reason: str | None = None
    series: PoseSeries | None = None
    known: bool = False
    bounded: bool = False


def torque_model(mechanism: Mechanism, settings: PaperIdentifySettings, data: Data) -> TorqueModel:
    """Give the mechanism the parameters of its torque.

    Args:
        mechanism: The start.
        settings: The torque model, its harmonics.
        data: The measurements.

    Returns:
        The problem, or why there is no point in a search.
    """
    plain = mechanism.with_torque("friction")
    if settings.torque != "friction" and data.records > 1:
        reason = "A torque over time belongs to one record; fit them one by one."
        return TorqueModel(posed(plain, data, exact=True), reason)
    # a torque over time stands for the friction as well, unless both are wanted
    if settings.torque != "friction" and settings.series != "with-friction":
        mechanism = frictionless(mechanism)
    if settings.torque == "friction":
        driven = plain
    elif settings.torque == "free":
        driven = mechanism.with_torque("free", knots=data.times * mechanism.values["time_scale"])
    else:
        driven = _of_period(mechanism, settings.terms or USUAL_TERMS)
    problem = posed(driven, data, exact=True)
    reason = _obstacle(problem, settings)
    if reason is not None or settings.torque != "fourier":
        return TorqueModel(problem, reason)
    return _periodic(mechanism, settings.terms or USUAL_TERMS, data)


def _periodic(mechanism: Mechanism, terms: int, data: Data) -> TorqueModel:
    """Hold the period at that of the poses, or at the user's."""
    clock = mechanism.with_torque("fourier", terms=1, period=1.0).parameter("torque.period")
    stretch = mechanism.values["time_scale"]
    bounds = (clock.lower, clock.upper) if clock.free else (clock.value, clock.value)
    position = np.where(data.measured, data.position, np.nan)
    times, noise = data.times * stretch, np.nanmedian(data.std, axis=0)
    known, (shortest, longest) = bounds[0] == bounds[1], shown_periods(times)
    if not known and (bounds[1] < shortest or bounds[0] > longest):
        reason = (
            f"torque.period: {bounds[0]:.4g} to {bounds[1]:.4g} s leave no period that the poses can show; "
            f"expected bounds that reach into {shortest:.4g} to {longest:.4g} s; widen them with --bounds, "
            "or give the period with --fix torque.period=SECONDS."
        )
        return TorqueModel(posed(_of_period(mechanism, terms), data, exact=True), reason)
    series = pose_series(times, position, noise, bounds)
    driven = _of_period(mechanism, terms, series.period)
    ends = any(abs(series.period / end - 1.0) < AT_BOUND for end in bounds if end > 0.0)
    return TorqueModel(posed(driven, data, exact=True), None, series, known, ends and not known)


def _of_period(mechanism: Mechanism, terms: int, period: float | None = None) -> Mechanism:
    """Hold the period of a Fourier series: at ``period`` [s], or where it is until that is known."""
    driven = mechanism.with_torque("fourier", terms=terms, period=1.0)
    return driven.with_choices(fix={"torque.period": period or driven.values["torque.period"]})


def _obstacle(problem: Problem, settings: PaperIdentifySettings) -> str | None:
    """Return the reason why there is no point in a search, or None."""
    data, unknowns, fewest = problem.data, len(problem.unknowns), FEWEST_MEASURED
    # rates are derived from the same samples, but the paper counts them
    samples = data.samples * (2 if settings.rates else 1)
    names = [joint.name for joint in problem.mechanism.joints]
    for first, stop in zip(data.first[:-1], data.first[1:], strict=True):
        for name, count in zip(names, data.measured[first:stop].sum(axis=0), strict=True):
            if count < fewest:
                return f"Joint {name!r} was measured {count} times, {fewest} are needed; give more frames."
    if settings.torque == "free" and len(data.times) * len(names) > MOST_PUBLISHED_TORQUES:
        return (
            f"{len(data.times) * len(names)} torques, one a joint and time stamp, are too many for the "
            f"published method; fit at most {MOST_PUBLISHED_TORQUES // len(names)} frames."
        )
    if settings.torque != "free" and samples <= unknowns:
        instead = "give more frames or fix parameters"
        if settings.torque == "fourier":
            instead = "give more frames, fix parameters, or take fewer harmonics with --identify.terms"
        return f"{samples} measured values cannot determine {unknowns} unknowns; {instead}."
    moved, noise = data.motion_size, np.nanmedian(data.std, axis=0)
    if (moved <= 4.0 * noise).all():
        return NOTHING_MOVES
    return None
