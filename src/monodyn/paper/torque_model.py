"""A mechanism under one of the paper's torque models, Case I, II or III, with the period found beforehand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.estimation.record.samples import Data
from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.settings import USUAL_TERMS
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.search import NOTHING_MOVES
from monodyn.estimation.torque.fourier import NO_PERIOD, fit_series
from monodyn.estimation.torque.periods import SCANNED_TERMS, PeriodSearch
from monodyn.estimation.torque.task import Task, frictionless
from monodyn.mechanism import Mechanism
from monodyn.paper.settings import PaperIdentifySettings

FEWEST_MEASURED = 5
"""Measured samples that each joint needs in each record."""
MOST_PUBLISHED_TORQUES = 400
"""Free torques that a search over rollouts can find in half a minute."""


@dataclass(frozen=True, eq=False)
class TorqueModel:
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


def torque_model(
    mechanism: Mechanism, settings: PaperIdentifySettings, data: Data, smoothed: tuple[Smoothed, ...]
) -> TorqueModel:
    """Give the mechanism the parameters of its torque.

    Args:
        mechanism: The start.
        settings: The torque model, its harmonics.
        data: The measurements.
        smoothed: Smooth motion of each record.

    Returns:
        The problem, or why there is no point in a search.
    """
    plain = mechanism.with_torque("friction")
    if settings.torque != "friction" and len(smoothed) > 1:
        reason = "A torque over time belongs to one record; fit them one by one."
        return TorqueModel(posed(plain, data), reason)
    if settings.torque == "friction":
        driven = plain
    elif settings.torque == "free":
        knots = data.times * mechanism.values["time_scale"]
        driven = frictionless(mechanism).with_torque("free", knots=knots)
    else:
        mechanism = frictionless(mechanism) if settings.series != "with-friction" else mechanism
        driven = _of_period(mechanism, settings.terms or USUAL_TERMS)
    problem = posed(driven, data)
    reason = _obstacle(problem, settings)
    if reason is not None or settings.torque != "fourier":
        return TorqueModel(problem, reason)
    return _periodic(mechanism, settings, problem, smoothed)


def _periodic(
    mechanism: Mechanism, settings: PaperIdentifySettings, problem: Problem, smoothed: tuple[Smoothed, ...]
) -> TorqueModel:
    """Estimate the period, with no more harmonics than it takes: one of many harmonics is a long one."""
    periods = PeriodSearch.of(mechanism, problem.data, smoothed)
    # many harmonics are those of a long period: where there are more, one to three are tried
    guesses = periods.guesses(settings.terms if settings.terms in SCANNED_TERMS else 0)
    known = periods.bounds[0] == periods.bounds[1]
    if not guesses:
        return TorqueModel(problem, None if known else NO_PERIOD)
    period = guesses[0].period
    if not known:
        # a series can fit what the model lacks; the default search decides whether a torque acts at all
        default = fit_series(mechanism, Task(problem.data, smoothed, settings, None))
        if default.optimum is None:
            return TorqueModel(problem, NO_PERIOD)
        problem = posed(_of_period(mechanism, settings.terms or USUAL_TERMS, period), problem.data)
    return TorqueModel(problem, None, periods.start(guesses[0], problem), None if known else period)


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
